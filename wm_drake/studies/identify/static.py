"""Quasi-static tests: force table and hysteresis of each axis ([B] 3.1.1), or of a sponge."""

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np
import xarray as xr

from wm_drake.errors import input_error
from wm_drake.parameters import MeasuredLoop
from wm_drake.parameters.types import FloatArray
from wm_drake.report.quantity import Quantity
from wm_drake.rigs.smoothing import smoothed
from wm_drake.studies.rig.quantities import loop_quantities
from wm_drake.studies.rig.study import ENERGY

SPONGE = "sponge"
"""Name in place of an axis, and field of a damper type, for the sponge of a free-stroke damper."""

NODES = 40
"""Places on each side of zero at which branches are averaged."""

TURN = 0.02
"""Least way back, by the range of the motion, that ends a branch."""

DEVELOPED = 0.1
"""Part of a branch after a reversal in which friction has not turned round: it does not count."""

NOMINAL = 0.2
"""Part of the curve whose linear fit gives the nominal stiffness, as in [B] section 4."""

ROUNDING = 1e-12
"""Part of the largest force below which the force at that slope is rounding."""


TESTS = Quantity("tests", decimals=0)

StaticSignal: TypeAlias = tuple[FloatArray, FloatArray, FloatArray]
"""Smoothed displacement, force and rate of a test."""


def field_of(axis: str) -> str:
    """Return the field of a bushing, or of a damper type, that holds the table of an axis."""
    if axis == SPONGE:
        return SPONGE
    return f"{'rotational_' if axis.startswith('about') else ''}stiffness_{axis[-1]}"


def is_about(axis: str) -> bool:
    """Return whether tests of an axis have moments over angles."""
    return axis.startswith("about")


def table_of_curve(curve: xr.Dataset, knots: int) -> dict[str, tuple[float, ...]]:
    """Return the monotone table of the mean curve. [SI]

    Args:
        curve: As of `static_curve`.
        knots: Points on each side of zero, where the range has that side.
    """
    position = curve.position.values
    places = _places(float(position[0]), float(position[-1]), knots)
    force = np.interp(places, position, _never_falling(position, curve["mean"].values))
    names = ("angle", "torque") if is_about(curve.axis) else ("displacement", "force")
    return dict(zip(names, (tuple(places.tolist()), tuple(force.tolist())), strict=True))


def static_curve(axis: str, loops: Sequence[MeasuredLoop]) -> xr.Dataset:
    """Return force table and hysteresis of quasi-static tests of one axis.

    A test goes to one or both sides of the rest position and back, any number of times. It is split
    at its reversals into branches. A branch counts where friction has turned round. The elastic
    force is the mean of loading and unloading; where only one of them counts, near an end, it is
    that one less or plus the half width next to it.

    Args:
        axis: One of `wm_drake.rigs.AXES`, or `SPONGE`.
        loops: Tests of this axis, at least one.

    Returns:
        Over `place`: `position` in the range, zero among them [m; rad]; mean force of the branches
        that rise, `loading`, and fall, `unloading`, in displacement, where friction has developed,
        without offset, NaN elsewhere; their `mean`, zero at zero; half of their difference,
        `half_width` [N; N m]. Over no dimension: `offset`, taken off the force so that the mean
        goes through zero, and `hysteresis`, the median half width [N; N m]; nominal `stiffness`,
        the slope of a line through zero fitted to the first 20 % of the mean [N/m; N m/rad];
        `energy_per_cycle`, work of a way through the whole range and back [J]; `median_rate`
        [m/s; rad/s]; `largest_fall` of the mean, which a table cannot have [N; N m]; number of
        `tests`. The attribute `axis` is the axis.

    Raises:
        InputError: The motion does not contain zero, or does not come back.
    """
    signals = [_signal(loop) for loop in loops]
    low, high, size = _range(signals, loops[0].path)
    places = _places(low, high, NODES)
    loading, unloading, loss = _both_ways(signals, places, size, loops[0].path)
    half = 0.5 * (loading - unloading)
    if not np.any(np.isfinite(half)):
        raise input_error(
            "loading and unloading have no displacement in common where friction has developed",
            where=loops[0].path,
        )
    elastic = _elastic(places, loading, unloading)
    offset = float(np.interp(0.0, places, elastic))
    elastic = elastic - offset
    first = np.abs(places) <= NOMINAL * max(high, -low) * (1.0 + 1e-9)
    fallen = np.max(np.abs(_never_falling(places, elastic) - elastic))
    rates = np.concatenate([np.abs(rate) for _, _, rate in signals])
    slope = np.sum(places[first] * elastic[first]) / np.sum(np.square(places[first]))
    if abs(slope) * max(high, -low) < ROUNDING * np.max(np.abs(elastic)):
        slope = 0.0  # of a curve with free stroke
    quantities = loop_quantities(is_about(axis))
    load = replace(quantities["load"], decimals=None)
    numbers: dict[str, tuple[Quantity, Any]] = {
        "position": (quantities["displacement"], places),
        "loading": (load.named("loading"), loading - offset),
        "unloading": (load.named("unloading"), unloading - offset),
        "mean": (load.named("mean"), elastic),
        "half_width": (load.named("half width of hysteresis"), half),
        "stiffness": (replace(quantities["stiffness"], decimals=None), slope),
        "hysteresis": (load.named("half width of hysteresis"), np.nanmedian(half)),
        "energy_per_cycle": (ENERGY, loss * 2.0 * (high - low)),
        "offset": (load.named("offset"), offset),
        "median_rate": (quantities["velocity"].named("median rate"), np.median(rates)),
        "largest_fall": (load.named("largest fall"), fallen),
        "tests": (TESTS, len(loops)),
    }
    return xr.Dataset(
        {name: q.variable(("place",)[: np.ndim(v)], v) for name, (q, v) in numbers.items()},
        attrs={"axis": axis},
    )


def _both_ways(
    signals: Sequence[StaticSignal], places: FloatArray, size: float, path: str
) -> tuple[FloatArray, FloatArray, float]:
    """Return mean forces of loading and of unloading at places, and the mean loss of a way.

    Args:
        signals: Position, force and rate of each test.
        places: Positions in the range. [m; rad]
        size: Size of the range. [m; rad]
        path: File of the first test.

    Returns:
        Forces, NaN where friction has not developed [N; N m]; work over the way [N; N m].

    Raises:
        InputError: The motion does not come back.
    """
    sides: dict[bool, list[FloatArray]] = {True: [], False: []}
    energy, way = 0.0, 0.0
    for position, force, _ in signals:
        ends = _turning_points(position, TURN * size)
        for begin, end in itertools.pairwise(ends):
            branch = slice(begin, end + 1)
            sides[bool(position[end] > position[begin])].append(
                _branch(places, position[branch], force[branch])
            )
        energy += float(np.trapezoid(force, position))
        way += float(np.sum(np.abs(np.diff(position[ends]))))
    if not (sides[True] and sides[False]):
        raise input_error(
            "displacement goes one way only; a quasi-static test goes to its end and back",
            where=path,
        )
    return _mean(sides[True]), _mean(sides[False]), energy / way


def _range(signals: Sequence[StaticSignal], path: str) -> tuple[float, float, float]:
    """Return both ends of the displacements, zero for one near it, and the size of their range."""
    low = min(float(np.min(position)) for position, _, _ in signals)
    high = max(float(np.max(position)) for position, _, _ in signals)
    size = high - low
    if low > 0.05 * size or high < -0.05 * size:
        raise input_error(
            "displacement does not contain zero, which is the rest position of the component",
            where=path,
        )
    low, high = (0.0 if abs(end) < 0.05 * size else end for end in (low, high))
    return low, high, size


def _places(low: float, high: float, count: int) -> FloatArray:
    """Return zero and a number of places on each side of it, where the range has that side."""
    below = np.linspace(low, 0.0, count + 1)[:-1] if low < 0.0 else np.zeros(0)
    above = np.linspace(0.0, high, count + 1)[1:] if high > 0.0 else np.zeros(0)
    return np.concatenate([below, [0.0], above])


def _elastic(places: FloatArray, loading: FloatArray, unloading: FloatArray) -> FloatArray:
    """Return the mean of loading and unloading; where one is missing, from the next half width."""
    half = 0.5 * (loading - unloading)
    known = np.isfinite(half)
    nearest = np.interp(places, places[known], half[known])
    raised = np.where(np.isfinite(loading), loading - nearest, unloading + nearest)
    elastic = np.where(known, 0.5 * (loading + unloading), raised)
    there = np.isfinite(elastic)
    return np.interp(places, places[there], elastic[there])


def _signal(loop: MeasuredLoop) -> StaticSignal:
    """Return smoothed displacement, force and rate of a test."""
    time = loop.time - loop.time[0]
    curve = smoothed(time, loop.displacement, None, loop.path)
    return curve.position, loop.force, curve.rate(time)


def _turning_points(position: FloatArray, threshold: float) -> list[int]:
    """Return the indices of the ends of a motion and of its reversals by more than a threshold."""
    turns, extreme, rises = [0], 0, 0
    for index in range(1, len(position)):
        moved = position[index] - position[extreme]
        if rises == 0:
            if abs(moved) > threshold:
                rises, extreme = (1 if moved > 0.0 else -1), index
        elif moved * rises > 0.0:
            extreme = index
        elif -moved * rises > threshold:
            turns.append(extreme)
            rises, extreme = -rises, index
    return [*turns, extreme] if extreme != turns[-1] else turns


def _branch(places: FloatArray, position: FloatArray, force: FloatArray) -> FloatArray:
    """Return the force of a branch at places, NaN where it has none or has just turned.

    The force at a place is that of a straight line fitted to the samples nearest to it.
    """
    begin, end = float(position[0]), float(position[-1])
    way = end - begin
    order = np.argsort(position, kind="stable")
    x, y = position[order], force[order]
    step = float(np.min(np.diff(places))) if len(places) > 1 else abs(way)
    forces = np.full(len(places), np.nan)
    for index, place in enumerate(places):
        part = (place - begin) / way
        if not DEVELOPED <= part <= 1.0 + 1e-6:
            continue
        near = slice(*np.searchsorted(x, [place - step, place + step]))
        if len(x[near]) >= 4 and np.ptp(x[near]) > 0.5 * step:
            slope, level = np.polyfit(x[near] - place, y[near], 1)
            forces[index] = level if np.isfinite(slope) else np.nan
        else:
            forces[index] = float(np.interp(place, x, y))
    return forces


def _mean(branches: list[FloatArray]) -> FloatArray:
    """Return the mean of branches at each place; NaN where there is none."""
    stacked = np.array(branches)
    counts = np.sum(np.isfinite(stacked), axis=0)
    total = np.sum(np.where(np.isfinite(stacked), stacked, 0.0), axis=0)
    return np.where(counts > 0, total / np.maximum(counts, 1), np.nan)


def _never_falling(places: FloatArray, force: FloatArray) -> FloatArray:
    """Return a curve that does not fall on its way out from zero."""
    curve = force.copy()
    zero = int(np.argmin(np.abs(places)))
    curve[zero:] = np.maximum.accumulate(force[zero:])
    curve[: zero + 1] = np.minimum.accumulate(force[: zero + 1][::-1])[::-1]
    return curve
