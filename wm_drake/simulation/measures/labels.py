"""Labels along each dimension of measures."""

from collections.abc import Callable, Sequence
from typing import TypeAlias

from wm_drake.elements.bushing import AXES
from wm_drake.parameters import MachineParameters, SpinProfile
from wm_drake.simulation.mounts import mount_names
from wm_drake.simulation.stops import stop_names

Labels: TypeAlias = Callable[[MachineParameters, SpinProfile], Sequence[str]]

LABELS: dict[str, Labels] = {
    "axis": lambda machine, profile: AXES,
    "sensor": lambda machine, profile: tuple(machine.sensors),
    "accelerometer": lambda machine, profile: tuple(machine.accelerometer_frames()),
    "mount": lambda machine, profile: mount_names(machine),
    "spring": lambda machine, profile: tuple(machine.springs),
    "stop": lambda machine, profile: stop_names(machine),
    "foot": lambda machine, profile: machine.cabinet.corners if machine.cabinet else (),
    "order": lambda machine, profile: ("cosine", "sine"),
    "region": lambda machine, profile: tuple(region.name for region in profile.regions),
}
"""Function that returns the labels along each dimension, except `pair`, whose labels are those of
`wm_drake.model.scene.Scene.pair_names`."""
