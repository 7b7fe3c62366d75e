"""Numbers enter here: frozen types of a machine, a load, a spin profile, in SI; files and units are read and checked."""

from wm_drake.parameters.elements import (
    Bushing,
    CoulombDamper,
    Damper,
    DamperType,
    EndBushing,
    ForceTable,
    FreeStrokeDamper,
    HavsinDamper,
    MstvDamper,
    Spring,
    SpringType,
    StvDamper,
    TorqueTable,
    packed_stiffness,
)
from wm_drake.parameters.files import load_load, load_machine, load_profile, machine_path, machine_yaml, shipped_machines
from wm_drake.parameters.keys import quantities, source_of, with_value
from wm_drake.parameters.machine import (
    BodyOverride,
    Clearance,
    Drive,
    FrameOverride,
    InertiaMatrix,
    MachineParameters,
    Sensor,
)
from wm_drake.parameters.measured import measured_amplitudes
from wm_drake.parameters.spin import Load, SpinProfile, Unbalance

__all__ = [
    "BodyOverride",
    "Bushing",
    "Clearance",
    "CoulombDamper",
    "Damper",
    "DamperType",
    "Drive",
    "EndBushing",
    "ForceTable",
    "FrameOverride",
    "FreeStrokeDamper",
    "HavsinDamper",
    "InertiaMatrix",
    "Load",
    "MachineParameters",
    "MstvDamper",
    "Sensor",
    "SpinProfile",
    "Spring",
    "SpringType",
    "StvDamper",
    "TorqueTable",
    "Unbalance",
    "load_load",
    "load_machine",
    "load_profile",
    "machine_path",
    "machine_yaml",
    "measured_amplitudes",
    "packed_stiffness",
    "quantities",
    "shipped_machines",
    "source_of",
    "with_value",
]
