"""Compiled functions of a page that run a machine and measure the run.

The loops are those of a batch, compiled for a single run (`for_one_run`), so that a page measures
what `wm-drake spin` measures.
"""

import functools
from typing import Any

import numpy as np
from numba import carray, cfunc, njit, types

from wm_drake.compiler.compilation import for_one_run
from wm_drake.compiler.elementary import sqrt
from wm_drake.compiler.matrices import plus, six
from wm_drake.compiler.vectors import dot
from wm_drake.elements.cabinet import foot_of
from wm_drake.elements.feet import FEET, load_on_feet, read_feet
from wm_drake.elements.motion import tub_motion
from wm_drake.elements.mount import WRENCH_SIZE, write_mount_wrenches
from wm_drake.elements.rubber import bushing_wrench
from wm_drake.elements.sensor import POINT_SIZE
from wm_drake.elements.telescopic_damper import TUBES_STATE_SIZE
from wm_drake.engines.compiled.bearing import carrier_motion
from wm_drake.engines.compiled.cabinet import FEET_BEGIN, SLIPS_BEGIN
from wm_drake.engines.compiled.integration import Work, integrate_lanes, runge_kutta_step
from wm_drake.engines.compiled.linear import jacobian_lanes
from wm_drake.engines.compiled.local_error import SUMS_SIZE
from wm_drake.engines.compiled.mechanics import state_derivative
from wm_drake.engines.compiled.midpoint import (
    MOVING,
    TUBES,
    MidpointWork,
    integrate_midpoint_lanes,
    write_relaxation,
)
from wm_drake.engines.compiled.multistep import PAST_INPUTS, PAST_RATES
from wm_drake.engines.compiled.stepping import ACROSS_JUMPS
from wm_drake.engines.trajectory import LARGEST_ANGLE, LARGEST_DISPLACEMENT
from wm_drake.export.kernel import OPTIONS, POINTER, numbers_at, part, pointer_at
from wm_drake.export.page_plan import GAP_SIZE
from wm_drake.laws.feet import normal_loads
from wm_drake.simulation.histories import measure_samples_lanes
from wm_drake.simulation.mount_histories import VECTOR_SIZE, VECTOR_SUMS, measure_mounts_lanes
from wm_drake.simulation.signals import filter_both_ways, largest_peaks

INT32S, INT64S = types.CPointer(types.int32), types.CPointer(types.int64)
BOUNDS = LARGEST_ANGLE, LARGEST_DISPLACEMENT
"""Largest roll, pitch and yaw [rad] and displacement [m] of a good sample."""


@functools.cache
def _derivative() -> Any:
    """Return the time derivative as a function of its own.

    Inlined at each of its calls it would take half of the time to compile and of the page.
    """
    return for_one_run(state_derivative)


@functools.cache
def _runge_kutta() -> Any:
    """Return the Runge-Kutta step as a function of its own."""
    return for_one_run(runge_kutta_step, state_derivative=_derivative())


@njit(**OPTIONS)
def cleared(v, begin, count):
    """Return some of the numbers behind a pointer as an array, all zero."""
    numbers = part(v, begin, count)
    for k in range(count):
        numbers[k] = 0.0
    return numbers


def integrator(plan: Any) -> Any:
    """Return the function that runs the machine through the steps of a schedule.

    Arguments: v, c; length, drum acceleration and drum motion of all steps, one after the other;
    sample numbers, whether a controller acts and whether a step takes one derivative, likewise;
    number of steps; samples to write, their number.
    """
    elements = plan.elements
    sample = elements.begins.size + elements.begins.rates
    advance = _midpoint(plan) if plan.midpoint else _advance(plan)
    signature = types.void(POINTER, POINTER, POINTER, INT32S, types.int32, POINTER, types.int32)

    @cfunc(signature, **OPTIONS)
    def wm_integrate(v, c, motion, marks, n, history, rows):
        numbers = carray(marks, (3 * n,))
        steps = (
            part(motion, 0, n), part(motion, n, n),
            carray(pointer_at(motion, 2 * n), (2 * n + 1, 4)),
            numbers[:n], numbers[n : 2 * n], numbers[2 * n :]
        )  # fmt: skip
        advance(steps, n, v, c, part(history, 0, rows * sample))

    return wm_integrate


def _advance(plan: Any) -> Any:
    """Return the function (steps, n, v, c, history) of steps with one derivative or four."""
    at, elements, count = plan.at, plan.elements, plan.count.numbers
    size, inputs = elements.begins.size, at.stage - at.inputs
    run = for_one_run(
        integrate_lanes, state_derivative=_derivative(), runge_kutta_step=_runge_kutta()
    )

    @njit(**OPTIONS)
    def advance(steps, n, v, c, history):
        work = Work(
            part(v, at.rate, size),
            part(v, at.inputs, inputs),
            part(v, at.stage, size),
            part(v, at.sum, size),
            part(v, at.past_rates, PAST_RATES * size),
            part(v, at.past_inputs, PAST_INPUTS * inputs),
        )
        p, x = part(v, at.packed, count), part(v, at.state, size)
        run(steps, 0, n, p, elements, x, work, cleared(v, at.errors, SUMS_SIZE), history)

    return advance


def _midpoint(plan: Any) -> Any:
    """Return the function (steps, n, v, c, history) of steps of the midpoint rule."""
    at, elements, count = plan.at, plan.elements, plan.count.numbers
    size, inputs, dampers = elements.begins.size, at.stage - at.inputs, len(elements.tubes)
    run = for_one_run(integrate_midpoint_lanes, state_derivative=_derivative())
    relax_tubes = _relaxer(plan)

    @njit(**OPTIONS)
    def advance(steps, n, v, c, history):
        for i in range(dampers):
            relax_tubes(v, c, i)
        work = MidpointWork(
            part(v, at.rate, size),
            part(v, at.inputs, inputs),
            part(v, at.stage, size),
            part(v, at.past_rates, size),
            part(v, at.past_rates + size, size),
            part(v, at.sum, size),
        )
        p, x = part(v, at.packed, count), part(v, at.state, size)
        relaxation = part(v, at.relaxation, TUBES * TUBES * dampers)
        sums = cleared(v, at.errors, SUMS_SIZE)
        run(steps[:4], 0, n, p, elements, relaxation, x, work, sums, history)

    return advance


def _relaxer(plan: Any) -> Any:
    """Return the function (v, c, i) that computes the matrix R of damper i.

    It does what `wm_drake.engines.compiled.midpoint_check.relaxation_matrices` does.
    """
    at, of, elements, count = plan.at, plan.of, plan.elements, plan.count.numbers
    size, inputs, n = elements.begins.size, at.stage - at.inputs, 2 * TUBES
    begins = elements.begins.tubes + TUBES_STATE_SIZE * np.arange(len(elements.tubes))
    free = begins[:, None] + np.array(MOVING)
    write_jacobian = for_one_run(jacobian_lanes, state_derivative=_derivative())

    @njit(**OPTIONS)
    def relax_tubes(v, c, i):
        p, x, work = (
            part(v, at.packed, count), part(v, at.trial, size), part(v, at.rate, size + inputs)
        )  # fmt: skip
        start, relaxation = numbers_at(c, of.slowest), numbers_at(v, at.relaxation)
        for k in range(size):
            x[k] = start[k]
        whole, none = part(v, at.jacobian, n * n), part(v, at.jacobian, 0)
        write_jacobian(x, work, free[i], ACROSS_JUMPS, p, elements, whole, none)
        write_relaxation(
            numbers_at(v, at.jacobian), numbers_at(v, at.length)[0], numbers_at(v, at.slopes),
            numbers_at(v, at.step), relaxation, TUBES * TUBES * i
        )  # fmt: skip

    return relax_tubes


def measurer(plan: Any) -> Any:
    """Return the function that measures samples: displacements, largest values, good samples.

    Arguments: v; samples and their number; displacements at each point, written.
    """
    at, count, elements, gasket = plan.at, plan.count, plan.elements, plan.gasket
    sample = elements.begins.size + elements.begins.rates
    none = np.empty(0, np.int64)
    samples_of, points = for_one_run(measure_samples_lanes), count.points
    first = at.packed + count.numbers + count.springs

    @cfunc(types.void(POINTER, POINTER, types.int32, POINTER), **OPTIONS)
    def wm_measure(v, history, rows, moved):
        samples, p = part(history, 0, rows * sample), part(v, at.packed, count.numbers)
        extremes = part(v, at.extremes, points + 7)
        samples_of(
            samples, rows, sample, BOUNDS, p, gasket, elements.mounts.branches,
            part(v, first, POINT_SIZE * points), points, none, part(moved, 0, rows * points),
            extremes, part(v, at.step, 0)
        )  # fmt: skip
        numbers_at(v, 0)[at.answer + GAP_SIZE - 1] = extremes[points + 6]

    return wm_measure


def mount_measurer(plan: Any) -> Any:
    """Return the function that finds the largest force of each mount.

    Arguments: v; samples and their number.
    """
    at, count, elements = plan.at, plan.count, plan.elements
    sample = elements.begins.size + elements.begins.rates
    mounts_of, sums = for_one_run(measure_mounts_lanes), at.answer - at.sums
    largest = VECTOR_SUMS.offsets["largest"]

    @cfunc(types.void(POINTER, POINTER, types.int32), **OPTIONS)
    def wm_measure_mounts(v, history, rows):
        samples, p = part(history, 0, rows * sample), part(v, at.packed, count.numbers)
        numbers, total = numbers_at(v, 0), part(v, at.sums, sums)
        unused = part(v, at.step, 0)
        mounts_of(samples, rows, sample, BOUNDS, p, elements.mounts, count.mounts, unused, total)
        for i in range(count.mounts):
            numbers[at.answer + GAP_SIZE + i] = sqrt(total[VECTOR_SIZE * i + largest])

    return wm_measure_mounts


def smoother(plan: Any) -> Any:
    """Return the function that filters displacements and finds their largest peaks.

    Arguments: c; displacements of the sensors, rows, padding; array to work in; filtered
    displacements, amplitudes and the samples where they are, written.
    """
    of, signals = plan.of, plan.count.sensors
    run, peaks = for_one_run(filter_both_ways), for_one_run(largest_peaks)
    sections, settled = of.settled - of.sections, of.pairs - of.settled
    counts = types.int32, types.int32

    @cfunc(types.void(POINTER, POINTER, *counts, POINTER, POINTER, POINTER, INT64S), **OPTIONS)
    def wm_smooth(c, moved, rows, padding, work, filtered, sizes, places):
        if padding > 0:
            run(
                part(moved, 0, rows * signals), (rows, signals), part(c, of.sections, sections),
                part(c, of.settled, settled), padding, part(work, 0, rows + 2 * padding),
                part(filtered, 0, rows * signals)
            )  # fmt: skip
        at = carray(places, (signals,))
        for k in range(signals):
            column = carray(pointer_at(filtered, k * rows), (rows, 1))
            peaks(column, part(sizes, k, 1), at[k : k + 1])

    return wm_smooth


def force_binner(plan: Any) -> Any:
    """Return the function that finds the smallest and largest force in parts of a run.

    Arguments: v; samples, their number, number of parts; written: for each part, smallest and
    largest of the six numbers of the gasket, of the force of each mount, and of the normal load of
    each foot.
    """
    count, begins, put_sample = plan.count, plan.elements.begins, _sample_binner(plan)
    sample, signals = begins.size + begins.rates, 6 + count.mounts + count.feet

    @cfunc(types.void(POINTER, POINTER, types.int32, types.int32, POINTER), **OPTIONS)
    def wm_bin_forces(v, history, rows, parts, bands):
        bins = numbers_at(bands, 0)
        for k in range(parts * signals):
            bins[2 * k], bins[2 * k + 1] = np.inf, -np.inf
        for row in range(rows):
            part_of_row = 2 * signals * (row * parts // rows)
            put_sample(v, numbers_at(history, sample * row), bins, part_of_row)

    return wm_bin_forces


def _sample_binner(plan: Any) -> Any:
    """Return the function (v, x, bins, at) that puts the forces in a sample into its bins."""
    places, count, elements, gasket = plan.at, plan.count, plan.elements, plan.gasket
    foot_loads = _foot_loads(plan)

    @njit(**OPTIONS)
    def put(bins, at, value):
        bins[at] = min(bins[at], value)
        bins[at + 1] = max(bins[at + 1], value)

    @njit(**OPTIONS)
    def put_feet(v, x, bins, at):
        loads = foot_loads(v, x)
        for i in range(count.feet):
            put(bins, at + 2 * i, loads[i])

    @njit(**OPTIONS)
    def put_sample(v, x, bins, at):
        p, wrenches = numbers_at(v, places.packed), numbers_at(v, places.wrenches)
        if gasket >= 0:
            _, force = bushing_wrench(tub_motion(x), p, gasket, x, elements.mounts.branches)
            for k in range(6):
                put(bins, at + 2 * k, force[k])
        write_mount_wrenches(x, p, elements.mounts, wrenches)
        for i in range(count.mounts):
            w = WRENCH_SIZE * i + 3
            f = (wrenches[w], wrenches[w + 1], wrenches[w + 2])
            put(bins, at + 2 * (6 + i), sqrt(dot(f, f)))
        if count.feet:
            put_feet(v, x, bins, at + 2 * (6 + count.mounts))

    return put_sample


def _foot_loads(plan: Any) -> Any:
    """Return the function (v, x) of the normal load of each foot in a sample. [N]

    That of a fixed cabinet follows from the wrenches of the mounts at `at.wrenches`.
    """
    at, count, begins = plan.at, plan.count, plan.elements.begins
    cabinet, numbers = plan.elements.cabinet, count.packed - FEET.fixed_size

    @njit(**OPTIONS)
    def of_fixed(v, _x):
        wrenches, feet = numbers_at(v, at.wrenches), read_feet(numbers_at(v, at.packed), numbers)
        total = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        for i in range(count.mounts):
            total = plus(total, six(wrenches, WRENCH_SIZE * i))
        load = load_on_feet(total, feet)
        return normal_loads(load[0], load[3], load[4], feet.x, feet.y)

    @njit(**OPTIONS)
    def of_moving(v, x):
        p, first = numbers_at(v, at.packed), begins.cabinet + SLIPS_BEGIN
        standing, _ = carrier_motion(x, begins.cabinet)
        return (
            foot_of(x, first, standing, p, cabinet + FEET_BEGIN, 0).force[2],
            foot_of(x, first, standing, p, cabinet + FEET_BEGIN, 1).force[2],
            foot_of(x, first, standing, p, cabinet + FEET_BEGIN, 2).force[2],
            foot_of(x, first, standing, p, cabinet + FEET_BEGIN, 3).force[2],
        )

    return of_fixed if cabinet is None else of_moving
