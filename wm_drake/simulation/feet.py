"""Loads of the feet of the cabinet and margins against lift-off, sliding, turning and tilting."""

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np

from wm_drake.elements.feet import packed_feet
from wm_drake.errors import input_error
from wm_drake.parameters import MachineParameters, SpinProfile
from wm_drake.parameters.cabinet import Cabinet
from wm_drake.parameters.types import FloatArray
from wm_drake.simulation.foot_histories import (
    FEET_COUNT,
    NORMAL_LARGEST,
    NORMAL_SMALLEST,
    TANGENTIAL_LARGEST,
    fixed_feet_history,
    foot_extremes,
    foot_history,
    moving_feet_history,
)
from wm_drake.simulation.vibration import region_samples

MARGINS = ("smallest_foot_load", "slide_margin", "turn_margin", "tilt_margin")
"""Names of the smallest values, in the order of the columns of `foot_histories`."""

BY_FOOT = ("foot_normal_smallest", "foot_normal_largest", "foot_tangential_largest")
"""Names of what is measured of each foot, in the order of the rows of `foot_histories`."""

REGION_VARIABLES = tuple(f"region_{name}" for name in MARGINS)
"""Names of what is measured of the feet in each region of the profile."""


def cabinet_of(parameters: MachineParameters) -> Cabinet:
    """Return the cabinet of a machine."""
    if parameters.cabinet is None:
        raise input_error(
            f"machine '{parameters.name}' has no cabinet, so the loads of its feet are unknown; "
            "add mass, centre_of_mass, floor, friction and feet under the key 'cabinet'",
            key="cabinet",
        )
    return parameters.cabinet


@dataclass(frozen=True)
class FootLoads:
    """Loads of the feet over time.

    Attributes:
        feet: Names of the feet, in the order of the columns.
        total: (n, 6) load on all feet, as of `fixed_feet_history`. [N, N m]
        of_feet: (n, 2, 4) normal and tangential load of each foot. [N]
        packed: Numbers of `wm_drake.elements.feet`.
    """

    feet: tuple[str, ...]
    total: FloatArray
    of_feet: FloatArray
    packed: FloatArray

    @property
    def normal(self) -> FloatArray:
        """Return the normal load of each foot. (n, 4) [N]"""
        return self.of_feet[:, 0]

    @property
    def tangential(self) -> FloatArray:
        """Return the tangential load of each foot. (n, 4) [N]"""
        return self.of_feet[:, 1]

    @functools.cached_property
    def margins(self) -> FloatArray:
        """Return the margins of the feet.

        Returns:
            (n, 4) smallest normal load of the feet [N] and margins of sliding [N], turning [N m]
            and tilting [N m].
        """
        margins = np.empty((len(self.total), len(MARGINS)))
        foot_history(self.total, self.of_feet, self.packed, margins)
        return margins


def foot_loads(
    cabinet: Cabinet,
    gravity: float,
    wrenches: FloatArray,
    *,
    floor_forces: FloatArray | None = None,
) -> FootLoads:
    """Return the loads of the feet over time.

    Args:
        gravity: [m/s^2]
        wrenches: (n, 6) moment about the origin of W and force of all mounts on the cabinet, in W.
            [N m, N]
        floor_forces: (n, 4, 3) force of the floor on each foot of a cabinet that moves, in its
            frame [N]; None for a fixed one, whose loads follow from statics.
    """
    p = packed_feet(cabinet, gravity)
    return FootLoads(cabinet.corners, *_loads(p, wrenches, floor_forces), p)


def _loads(
    p: FloatArray, wrenches: FloatArray, floor_forces: FloatArray | None
) -> tuple[FloatArray, FloatArray]:
    """Return load on all feet (n, 6), and normal and tangential load of each (n, 2, 4)."""
    loads, of_feet = np.empty((len(wrenches), 6)), np.empty((len(wrenches), 2, FEET_COUNT))
    if floor_forces is None:
        fixed_feet_history(np.ascontiguousarray(wrenches), p, loads, of_feet)
    else:
        moving_feet_history(np.ascontiguousarray(floor_forces), p, loads, of_feet)
    return loads, of_feet


@dataclass(frozen=True)
class FeetLoaded:
    """What the measures of the feet are computed from.

    Attributes:
        cabinet, gravity: Cabinet and gravity. [m/s^2]
        wrenches: (n, 6) moment about the origin of W and force of all mounts on the cabinet, in W.
            [N m, N]
        floor_forces: (n, 4, 3) forces of the floor on the feet of a cabinet that moves. [N]
        ranges: Which samples belong to each part of the run, for a profile without regions.
    """

    cabinet: Cabinet
    gravity: float
    wrenches: FloatArray
    floor_forces: FloatArray | None = None
    ranges: tuple[np.ndarray, ...] = ()


def foot_measures(feet: FeetLoaded, profile: SpinProfile, period: float) -> dict[str, FloatArray]:
    """Return the measures of the feet of a run.

    Args:
        period: Time between samples. [s]

    Returns:
        By the names of `BY_FOOT`, `MARGINS` and `REGION_VARIABLES`: smallest and largest normal
        load and largest tangential load (4,) of the feet [N]; smallest load of any foot [N] and
        smallest margins of sliding [N], turning [N m] and tilting [N m] over the run; the same in
        each region (regions,). NaN without samples, and for regions without `region_samples`.
    """
    p, count = packed_feet(feet.cabinet, feet.gravity), len(feet.wrenches)
    parts: list[Any] = [*region_samples(profile, period, count)] or [*feet.ranges]
    extremes, smallest = np.empty((3, FEET_COUNT)), np.empty((1 + len(parts), len(MARGINS)))
    region_of = np.full(count, -1, dtype=np.int64)
    for number, part in enumerate(parts):
        region_of[part] = number
    loads = _loads(p, feet.wrenches, feet.floor_forces)
    foot_extremes(*loads, p, region_of, extremes, smallest)
    smallest[~np.isfinite(smallest)] = np.nan
    rows = (NORMAL_SMALLEST, NORMAL_LARGEST, TANGENTIAL_LARGEST)
    of_feet = dict(zip(BY_FOOT, (extremes[row] for row in rows), strict=True))
    of_run = dict(zip(MARGINS, map(np.array, smallest[0]), strict=True))
    return of_feet | of_run | dict(zip(REGION_VARIABLES, smallest[1:].T, strict=True))
