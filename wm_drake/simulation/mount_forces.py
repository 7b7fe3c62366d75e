"""Forces of the mounts on the cabinet: springs, dampers, gasket and bushings of a record."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from wm_drake.parameters import SpinProfile
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.simulation.mounts import force_measures
from wm_drake.simulation.records import Record, sample_period
from wm_drake.simulation.vibration import region_samples

BoolArray: TypeAlias = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]

SPEED_STEP_RPM = 100.0
"""Width of the ranges of drum speed for a profile without regions. [rpm]"""

MOST_RANGES = 8
"""Largest number of ranges of drum speed; with a higher speed they are wider."""


@dataclass(frozen=True)
class MountForce:
    """Force of one mount on the cabinet over a run.

    Attributes:
        name: Key path of the mount: `springs.left`, `dampers.left`, `gasket`.
        force: (n, 3) force on the cabinet, in W. [N]
        at_rest: Size of the force at the first sample, with the machine at rest. [N]
        peak: Largest size of the force. [N]
        peak_index: Sample of the peak.
    """

    name: str
    force: FloatArray
    at_rest: float
    peak: float
    peak_index: int

    def dynamic_rms(self, samples: BoolArray) -> float:
        """Return the RMS of the force without its mean over some samples. [N]

        It is the measure `dynamic_rms` of `force_measures` over these samples. NaN without samples.
        """
        _, _, dynamic = force_measures(self.force[samples][:, None, :])
        return float(dynamic[0])


@dataclass(frozen=True)
class SpeedRange:
    """Part of a run for which an RMS is given: its name and which samples (n,) belong to it."""

    name: str
    samples: BoolArray


def mount_forces(record: Record) -> list[MountForce]:
    """Return the forces of all mounts of a record.

    There are none if the record has no samples or is of version 0.1. A gasket that is taken out is
    left out.
    """
    if not record.sizes["time"] or "mount_force" not in record:
        return []
    missing = {"gasket"} if record.attrs["gasket"] != "yes" else set()
    return [
        _mount_force(str(name), record.mount_force.values[:, index])
        for index, name in enumerate(record.mount.values)
        if name not in missing
    ]


def _mount_force(name: str, force: FloatArray) -> MountForce:
    size = np.linalg.norm(force, axis=1)
    index = int(np.argmax(size))
    return MountForce(name, force, float(size[0]), float(size[index]), index)


def speed_ranges(record: Record, profile: SpinProfile) -> list[SpeedRange]:
    """Return the parts of a run for which an RMS is given.

    These are the regions of the profile if it has any, else ranges of drum speed of equal width.
    Samples of a standing drum belong to the first range.
    """
    if profile.regions:
        numbers = np.arange(record.sizes["time"])
        parts = region_samples(profile, sample_period(record), len(numbers))
        return [
            SpeedRange(region.name, (numbers >= part.start) & (numbers < part.stop))
            for region, part in zip(profile.regions, parts, strict=True)
        ]
    in_rpm = Unit("rad/s", "rpm").from_si(1.0)
    speed = in_rpm * np.abs(record.drum_speed.values)
    highest = in_rpm * profile.highest_speed
    width = SPEED_STEP_RPM * max(1.0, np.ceil(highest / SPEED_STEP_RPM / MOST_RANGES))
    count = max(1, int(np.ceil(highest / width * (1.0 - 1e-9))))
    place = np.minimum((speed / width * (1.0 + 1e-9)).astype(int), count - 1)
    return [
        SpeedRange(f"{width * index:g} to {width * (index + 1):g} rpm", place == index)
        for index in range(count)
    ]


def rms_table(forces: Sequence[MountForce], ranges: Sequence[SpeedRange]) -> FloatArray:
    """Return the RMS of each force without its mean in each range. (forces, ranges) [N]"""
    return np.array(
        [[force.dynamic_rms(part.samples) for part in ranges] for force in forces]
    ).reshape(len(forces), len(ranges))
