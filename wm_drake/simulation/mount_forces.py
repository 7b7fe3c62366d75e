"""Forces of the mounts on the cabinet: springs, dampers, gasket and bushings of a record."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from wm_drake.parameters import SpinProfile
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.simulation.records import Record

BoolArray: TypeAlias = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]

SPEED_STEP_RPM = 100.0
"""Width of the ranges of drum speed for a profile without regions. [rpm]"""

RPM_PER_RAD_S = Unit("rad/s", "rpm").from_si(1.0)

MOST_RANGES = 8
"""Largest number of ranges of drum speed; with a higher speed they are wider."""


@dataclass(frozen=True)
class MountForce:
    """Force of one mount on the cabinet over a run.

    Attributes:
        name: `spring left`, `damper left`, `gasket` or the name of the bushing.
        force: (n, 1) tension of a spring or a damper, or (n, 3) force of the gasket or a bushing on
            the housing. [N]
        at_rest: Size of the force at the first sample, with the machine at rest; with its sign for
            a tension. [N]
        peak: Largest absolute value, or largest length of the vector. [N]
        peak_index: Sample of the peak.
    """

    name: str
    force: FloatArray
    at_rest: float
    peak: float
    peak_index: int

    def rms(self, samples: BoolArray) -> float:
        """Return the RMS of the change of the force from rest over some samples. [N]

        For a vector it is the root of the mean square length. NaN without samples.
        """
        change = self.force[samples] - self.force[0]
        return float(np.sqrt(np.mean(np.sum(change**2, axis=1)))) if len(change) else np.nan


@dataclass(frozen=True)
class SpeedRange:
    """Part of a run for which an RMS is given: its name and which samples (n,) belong to it."""

    name: str
    samples: BoolArray


def mount_forces(record: Record) -> list[MountForce]:
    """Return the forces of all mounts of a record; none if the record has no samples.

    A gasket that is taken out is left out. The force of a spring, or of a damper that is a massless
    strut, is its tension; the transverse forces of its end bushings are not included. A damper
    whose tubes are bodies acts through the bushing at its housing end.
    """
    if not record.sizes["time"]:
        return []
    histories: dict[str, FloatArray] = {}
    for kind in ("spring", "damper"):
        tensions = record[f"{kind}_tension"].values
        for index, name in enumerate(record[kind].values):
            histories[f"{kind} {name}"] = tensions[:, index : index + 1]
    tubes = [str(name) for name in record["tube"].values] if "tube" in record.dims else []
    dampers = {f"{name}_housing": f"damper {name}" for name in tubes}
    elsewhere = {f"{name}_tub" for name in tubes}  # between tub and tube, not on the cabinet
    if record.attrs["gasket"] != "yes":
        elsewhere.add("gasket")
    for index, name in enumerate(map(str, record["bushing"].values)):
        if name not in elsewhere:
            histories[dampers.get(name, name)] = record.bushing_force.values[:, index]
    return [_mount_force(name, force) for name, force in histories.items()]


def _mount_force(name: str, force: FloatArray) -> MountForce:
    size = np.linalg.norm(force, axis=1)
    index = int(np.argmax(size))
    at_rest = float(force[0, 0] if force.shape[1] == 1 else size[0])
    return MountForce(name, force, at_rest, float(size[index]), index)


def speed_ranges(record: Record, profile: SpinProfile) -> list[SpeedRange]:
    """Return the parts of a run for which an RMS is given.

    These are the regions of the profile if it has any, else ranges of drum speed of equal width.
    Samples of a standing drum belong to the first range.
    """
    time = record.time.values
    if profile.regions:
        return [
            SpeedRange(region.name, (time >= region.begin) & (time < region.end))
            for region in profile.regions
        ]
    speed = RPM_PER_RAD_S * np.abs(record.drum_speed.values)
    highest = RPM_PER_RAD_S * float(np.max(np.abs(profile.speed)))
    width = SPEED_STEP_RPM * max(1.0, np.ceil(highest / SPEED_STEP_RPM / MOST_RANGES))
    count = max(1, int(np.ceil(highest / width * (1.0 - 1e-9))))
    place = np.minimum((speed / width * (1.0 + 1e-9)).astype(int), count - 1)
    return [
        SpeedRange(f"{width * index:g} to {width * (index + 1):g} rpm", place == index)
        for index in range(count)
    ]


def rms_table(forces: Sequence[MountForce], ranges: Sequence[SpeedRange]) -> FloatArray:
    """Return the RMS of the change of each force from rest in each range. (forces, ranges) [N]"""
    return np.array([[force.rms(part.samples) for part in ranges] for force in forces]).reshape(
        len(forces), len(ranges)
    )
