"""Read and check what a user writes: machine, component, load, spin profile, study files.

Enters: YAML and CSV files, and text with units. Leaves: frozen types in SI units
(`MachineParameters`, `Component`, `Load`, `SpinProfile`, `VaryFile`, `MeasuredLoop`) or an
`InputError` that names file, line and key. `with_value` is the one way to change a number, an
`Entry` declares one that varies, and a `Varied` is that for one machine.
May import: `laws`, `compiler` and `errors`; no pydrake.
"""

from wm_drake.parameters.components import Component, load_component, shipped_components
from wm_drake.parameters.damper_laws import (
    DAMPER_LAWS,
    CoulombDamper,
    DamperType,
    FreeStrokeDamper,
    HavsinDamper,
    MstvDamper,
    StvDamper,
    StvSpongeDamper,
)
from wm_drake.parameters.drive import Drive, MotorDrive
from wm_drake.parameters.elements import (
    Bushing,
    BushingType,
    Damper,
    EndBushing,
    ForceTable,
    Spring,
    SpringType,
    TelescopicDamper,
    TorqueTable,
)
from wm_drake.parameters.files import (
    load_load,
    load_machine,
    load_profile,
    located,
    machine_file_with,
    machine_path,
    machine_yaml,
    shipped_machines,
)
from wm_drake.parameters.inertia import InertiaMatrix
from wm_drake.parameters.keys import quantities, source_of, with_value, with_values
from wm_drake.parameters.loop_files import MeasuredLoop, read_loop, read_loops
from wm_drake.parameters.machine import (
    Bearing,
    BodyOverride,
    Clearance,
    FrameOverride,
    MachineParameters,
    Sensor,
)
from wm_drake.parameters.measured import measured_amplitudes, measured_changes
from wm_drake.parameters.published import PublishedResults, PublishedTerm, published_results
from wm_drake.parameters.spin import Load, SpinProfile, Unbalance
from wm_drake.parameters.variation import Change
from wm_drake.parameters.vary import Entry
from wm_drake.parameters.vary_file import VaryFile, load_vary
from wm_drake.parameters.varying import Varied, Varying, varying

__all__ = [
    "DAMPER_LAWS",
    "Bearing",
    "BodyOverride",
    "Bushing",
    "BushingType",
    "Change",
    "Clearance",
    "Component",
    "CoulombDamper",
    "Damper",
    "DamperType",
    "Drive",
    "EndBushing",
    "Entry",
    "ForceTable",
    "FrameOverride",
    "FreeStrokeDamper",
    "HavsinDamper",
    "InertiaMatrix",
    "Load",
    "MachineParameters",
    "MeasuredLoop",
    "MotorDrive",
    "MstvDamper",
    "PublishedResults",
    "PublishedTerm",
    "Sensor",
    "SpinProfile",
    "Spring",
    "SpringType",
    "StvDamper",
    "StvSpongeDamper",
    "TelescopicDamper",
    "TorqueTable",
    "Unbalance",
    "Varied",
    "VaryFile",
    "Varying",
    "load_component",
    "load_load",
    "load_machine",
    "load_profile",
    "load_vary",
    "located",
    "machine_file_with",
    "machine_path",
    "machine_yaml",
    "measured_amplitudes",
    "measured_changes",
    "published_results",
    "quantities",
    "read_loop",
    "read_loops",
    "shipped_components",
    "shipped_machines",
    "source_of",
    "varying",
    "with_value",
    "with_values",
]
