"""Compiled functions of a machine in a web page: they set it up, run it and measure the run.

As in `wm_drake.export.kernel`, all numbers of an instance are in one array v, and what does not
change in a second array c. The loops are those of a batch, compiled for a single run
(`for_one_run`), so that a page measures what `wm-drake spin` measures. Only the equilibrium and the
distance of two shapes have functions of their own; elsewhere numpy and Drake compute them.
"""

from collections import namedtuple
from typing import Any

import numpy as np
from numba import carray, cfunc, njit, types

from wm_drake.compiler.compilation import for_one_run, law
from wm_drake.compiler.elementary import sine_cosine, sqrt
from wm_drake.compiler.matrices import plus, scaled, six
from wm_drake.compiler.vectors import (
    add,
    cross,
    dot,
    rotate,
    rotate_back,
    rotation_from_rpy,
    scale,
    subtract,
)
from wm_drake.elements.cabinet import FEET_COUNT, FOOT, FULL_DAMPING, PADS, read_pads
from wm_drake.elements.feet import FEET, load_on_feet, read_feet
from wm_drake.elements.friction_damper import FRICTION_DAMPER
from wm_drake.elements.motion import tub_motion
from wm_drake.elements.mount import WRENCH_SIZE, write_mount_wrenches
from wm_drake.elements.rubber import bushing_wrench
from wm_drake.elements.sensor import POINT_SIZE, displacement_at
from wm_drake.elements.spring import SPRING, read_spring, taut_tension
from wm_drake.engines.compiled.cabinet import FEET_BEGIN
from wm_drake.engines.compiled.integration import Work, integrate_lanes
from wm_drake.engines.compiled.mechanics import BODIES, DRUM_RATE, mass_properties, read_bodies
from wm_drake.engines.compiled.midpoint import MidpointWork, integrate_midpoint_lanes
from wm_drake.engines.compiled.multistep import PAST_INPUTS, PAST_RATES
from wm_drake.engines.trajectory import LARGEST_ANGLE, LARGEST_DISPLACEMENT
from wm_drake.export.kernel import (
    HARMONICS_BEGIN,
    HARMONICS_SIZE,
    INVERSE_MASS,
    OPTIONS,
    PAIR_SIZE,
    POINTER,
    SHAPE_SIZE,
    add_point_mass,
    drum_adder,
    load_adder,
    numbers_at,
    pointer_at,
    row_writer,
)
from wm_drake.laws.feet import normal_loads
from wm_drake.laws.table import stiffness_force
from wm_drake.model.outline import lowest_point
from wm_drake.model.tub_statics import MOST_STEPS, POSE_STEP
from wm_drake.simulation.histories import measure_samples_lanes
from wm_drake.simulation.mount_histories import (
    VECTOR_SIZE,
    VECTOR_SUMS,
    measure_mounts_lanes,
)
from wm_drake.simulation.signals import filter_both_ways, largest_peaks

REMAINING = 1e-10
"""Largest force [N] or moment [N m] that remains on the tub at rest."""
BODY_SIZE = 4
"""Numbers of a body that may change: mass, centre of mass in its frame. [kg, m]"""
BODY_CONSTANTS = 24
"""Constants of such a body: 1 if it is in the drum, else 0; 1 if its inertia grows with its mass,
else 0; its mass and centre of mass as exported (4); rotation and position of its frame (12), as
`Constants.drum`; its central inertia in T (6)."""
SUMS = 10
"""Sums of masses: mass, first moment and inertia about O, in T."""
SOLVED, GIVEN, FREE_LENGTH = range(3)
"""What gives the preload of a spring: the equilibrium as drawn, the machine file, a free length."""
PUSHES = 4
"""Added to it for a spring that can push."""
NOT_BALANCED, SLACK, FAR = -1.0, -2.0, -3.0
"""Why a machine has no equilibrium near its drawn pose."""
MOST_PROJECTIONS = 20000
"""Projections after which the nearest points of two shapes count as found."""
TOUCHING = 1e-7
"""Accuracy of a distance of two shapes. [m]"""

Places = namedtuple(
    "Places",
    "time parameters bodies unbalances of_load speed packed total state rest trial wrenches slopes "
    "step rate inputs stage sum past_rates past_inputs extremes sums answer size",
)
"""Indices in the array of an instance.

parameters: numbers of the machine file by straight lines; bodies: `BODY_SIZE` each; unbalances:
those of the load, the residual imbalance of the drum last; of_load: what else the load adds to the
harmonics of the drum; speed: of the drum at the start [rad/s]; packed: packed numbers, then the
free length of each spring, the measured points and the numbers of the feet; rest: pose of the tub
at rest; extremes, sums: what `measure_samples_lanes` and `measure_mounts_lanes` write; answer: the
gap (`GAP_SIZE`), then the peak force of each mount; the others are arrays to work in.
"""
Constants = namedtuple(
    "Constants",
    "packed start entries harmonics drum bodies initial relaxation sections settled pairs size",
)
"""Indices in the array of constants.

packed, start, entries, harmonics, drum: as in `wm_drake.export.kernel`; bodies: `BODY_CONSTANTS`
each; initial: state before a run; relaxation: of the midpoint rule; sections, settled: of the
filter; pairs: shapes, `PAIR_SIZE` each, then the distance of each pair at the initial pose.
"""
Counts = namedtuple(
    "Counts",
    "packed numbers parameters entries bodies unbalances springs points sensors mounts pairs",
)
"""How many of each there are; packed: packed numbers, free lengths, points and feet; numbers:
packed numbers alone."""
Plan = namedtuple(
    "Plan", "at of count elements resting springs gasket integrator limits reach settles"
)
"""What the functions are compiled for.

resting: `Mounts` that act at rest; springs: what gives the preload of each, and whether it pushes;
limits: largest angle and displacement of the rest pose [rad, m]; reach: largest distance of a point
of the tub group from To [m]; settles: whether the equilibrium is found in the page.
"""
GAP_SIZE = 10
"""Smallest gap, its sample, number of the pair, nearest points of both shapes, number of good
samples."""


@law
def solve(a, b, n):
    """Solve n linear equations by elimination with pivots; return whether there is a solution.

    Args:
        a: Coefficients by rows, overwritten.
        b: Right side; the solution is written into it.
    """
    for i in range(n):
        pivot = i
        for k in range(i + 1, n):
            if abs(a[n * k + i]) > abs(a[n * pivot + i]):
                pivot = k
        if not abs(a[n * pivot + i]) > 0.0:
            return False
        for j in range(n):
            a[n * i + j], a[n * pivot + j] = a[n * pivot + j], a[n * i + j]
        b[i], b[pivot] = b[pivot], b[i]
        for k in range(i + 1, n):
            factor = a[n * k + i] / a[n * i + i]
            for j in range(i, n):
                a[n * k + j] = a[n * k + j] - factor * a[n * i + j]
            b[k] = b[k] - factor * b[i]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            b[i] = b[i] - a[n * i + j] * b[j]
        b[i] = b[i] / a[n * i + i]
    return True


def page_kernel(plan: Any) -> dict[str, Any]:
    """Return the compiled functions of a machine by name."""
    return {
        "wm_set_up": _set_up(plan),
        "wm_integrate": _integrate(plan),
        "wm_measure": _measure(plan),
        "wm_smooth": _smooth(plan),
        "wm_find_gap": _find_gap(plan),
        "wm_bin_forces": _bin_forces(plan),
    }


def _set_up(plan: Any) -> Any:
    """Return the function (v, c) that packs all numbers and puts the machine to rest.

    It returns 0, or why there is no equilibrium.
    """
    at, of, count = plan.at, plan.of, plan.count
    settles, size = plan.settles, plan.elements.begins.size
    write_rows, add_load = row_writer(plan), load_adder(plan)
    add_bodies, place_struts, settle = _bodies(plan), _struts(plan), _settle(plan)
    load_feet, stands = _feet(plan), settles and plan.elements.cabinet is not None

    @cfunc(types.float64(POINTER, POINTER), **OPTIONS)
    def wm_set_up(v, c):
        numbers, constants, p = numbers_at(v, 0), numbers_at(c, 0), numbers_at(v, at.packed)
        state, rest = numbers_at(v, at.state), numbers_at(v, at.rest)
        write_rows(v, c)
        add_bodies(v, c)
        place_struts(v)
        for k in range(size):
            state[k] = constants[of.initial + k]
        for k in range(6):
            rest[k] = state[k]
        status = 0.0
        if settles:
            status = settle(v)
        for k in range(6):
            state[k] = rest[k]
        state[DRUM_RATE] = 0.0
        motion = tub_motion(state)
        if stands:
            load_feet(v, motion)
        for k in range(count.points):
            point = count.numbers + count.springs + POINT_SIZE * k
            p[point + POINT_SIZE - 1] = 0.0
            p[point + POINT_SIZE - 1] = displacement_at(motion, p, point)
        state[DRUM_RATE] = numbers[at.speed]
        add_load(v, c)
        for k in range(HARMONICS_SIZE):
            p[HARMONICS_BEGIN + k] = p[HARMONICS_BEGIN + k] + numbers[at.of_load + k]
        return status

    return wm_set_up


def _bodies(plan: Any) -> Any:
    """Return the function (v, c) that changes mass and centre of mass of bodies.

    In the sums of tub group and drum, a body is a point mass and its central inertia.
    """
    at, of, count = plan.at, plan.of, plan.count
    add_to_drum = drum_adder(plan)
    moment, inertia = BODIES.offsets["tub_moment"], BODIES.offsets["tub_inertia"]

    @njit(**OPTIONS)
    def change_body(v, c, k, sums):
        numbers, body, place = numbers_at(v, 0), of.bodies + BODY_CONSTANTS * k, at.bodies
        place += BODY_SIZE * k
        constants, frame = numbers_at(c, 0), body + 6
        mass, old = numbers[place], constants[body + 2]
        centre = (numbers[place + 1], numbers[place + 2], numbers[place + 3])
        drawn = (constants[body + 3], constants[body + 4], constants[body + 5])
        add_point_mass(sums, mass, centre, constants, frame)
        add_point_mass(sums, -old, drawn, constants, frame)
        growth = constants[body + 1] * (mass / old - 1.0)
        for i in range(6):
            sums[4 + i] = sums[4 + i] + growth * constants[frame + 12 + i]

    @njit(**OPTIONS)
    def add_bodies(v, c):
        p, constants = numbers_at(v, at.packed), numbers_at(c, 0)
        of_drum, of_tub = numbers_at(v, at.total), numbers_at(v, at.total + SUMS)
        for k in range(2 * SUMS):
            of_drum[k] = 0.0
        for k in range(count.bodies):
            in_drum = constants[of.bodies + BODY_CONSTANTS * k] > 0.5
            change_body(v, c, k, of_drum if in_drum else of_tub)
        p[INVERSE_MASS] = p[INVERSE_MASS] / (1.0 + of_tub[0] * p[INVERSE_MASS])
        for k in range(3):
            p[moment + k] = p[moment + k] + of_tub[1 + k]
        for k in range(6):
            p[inertia + k] = p[inertia + k] + of_tub[4 + k]
        add_to_drum(v, c)

    return add_bodies


def _struts(plan: Any) -> Any:
    """Return the function (v) that computes what follows from the ends of struts.

    These are drawn lengths and given preloads of springs, and the axes of dampers.
    """
    at, first, mounts, settles = plan.at, plan.count.numbers, plan.elements.mounts, plan.settles
    axis, length = FRICTION_DAMPER.offsets["axis"], SPRING.offsets["rest_length"]
    preload, kinds = SPRING.offsets["preload"], np.array([k % PUSHES for k in (*plan.springs, 0)])
    set_taut = taut_setter(plan)

    @njit(**OPTIONS)
    def place_struts(v):
        p = numbers_at(v, at.packed)
        for begin in mounts.dampers:
            line, size = strut(p, begin)
            for k in range(3):
                p[begin + axis + k] = line[k] / size
        for k in range(len(mounts.springs)):
            begin = mounts.springs[k]
            _, p[begin + length] = strut(p, begin)
            if kinds[k] == FREE_LENGTH:
                short = p[first + k] - p[begin + length]
                p[begin + preload] = -stiffness_force(short, *read_spring(p, begin).stiffness)
            if kinds[k] == SOLVED and settles:
                p[begin + preload] = 0.0
            set_taut(v, k)

    return place_struts


@law
def strut(p, at):
    """Return line and length of a strut as drawn, from the housing end to the tub end. [m]"""
    tub, housing = read_spring_ends(p, at)
    line = subtract(tub, housing)
    return line, sqrt(dot(line, line))


@law
def read_spring_ends(p, at):
    """Return tub end (T) and housing end (W) of a strut, with which its numbers begin. [m]"""
    return (p[at], p[at + 1], p[at + 2]), (p[at + 3], p[at + 4], p[at + 5])


def taut_setter(plan: Any) -> Any:
    """Return the function (v, k) that sets the tension from which spring k is taut."""
    at, mounts, taut = plan.at, plan.elements.mounts, SPRING.offsets["taut_from"]
    pushes = np.array([kind >= PUSHES for kind in (*plan.springs, 0)])

    @njit(**OPTIONS)
    def set_taut(v, k):
        p, begin = numbers_at(v, at.packed), mounts.springs[k]
        spring = read_spring(p, begin)
        p[begin + taut] = -np.inf
        if not pushes[k]:
            p[begin + taut] = taut_tension(spring.preload, *spring.stiffness)

    return set_taut


def _settle(plan: Any) -> Any:
    """Return the function (v) that finds preloads and rest pose of the empty machine.

    It does what `wm_drake.model.equilibrium` does: preloads that balance the tub as drawn as well
    as they can, then the pose at which nothing remains, by Newton's method. It returns 0, or why
    there is no such pose.
    """
    at, size, limits = plan.at, plan.elements.begins.size, plan.limits
    preload_springs, newton_step = _preloads(plan), _newton_step(plan)

    @njit(**OPTIONS)
    def settle(v):
        rest, trial = numbers_at(v, at.rest), numbers_at(v, at.trial)
        state = numbers_at(v, at.state)
        for k in range(size):
            trial[k] = state[k]
        for k in range(6):
            rest[k] = trial[k] = 0.0
        status = preload_springs(v)
        if status < 0.0:
            return status
        for _ in range(MOST_STEPS):
            status = newton_step(v)
            if status != 1.0:
                break
        if status != 0.0:
            return NOT_BALANCED
        for k in range(6):
            if not abs(rest[k]) <= limits[k // 3]:
                return FAR
        return 0.0

    return settle


def _newton_step(plan: Any) -> Any:
    """Return the function (v) that moves the rest pose by a step.

    It returns 0 if the pose is one of rest, 1 after a step, -1 if there is none.
    """
    at, on_tub = plan.at, _on_tub(plan)

    @njit(**OPTIONS)
    def newton_step(v):
        rest, trial = numbers_at(v, at.rest), numbers_at(v, at.trial)
        slopes, step = numbers_at(v, at.slopes), numbers_at(v, at.step)
        for k in range(6):
            trial[k] = rest[k]
        now, largest = on_tub(v), 0.0
        for k in range(6):
            step[k], largest = now[k], max(largest, abs(now[k]))
        if largest <= REMAINING:
            return 0.0
        for k in range(6):
            trial[k] = rest[k] + POSE_STEP
            moved = on_tub(v)
            trial[k] = rest[k]
            for i in range(6):
                slopes[6 * i + k] = (moved[i] - now[i]) / POSE_STEP
        if not solve(slopes, step, 6):
            return -1.0
        for k in range(6):
            rest[k] = rest[k] - step[k]
        return 1.0

    return newton_step


def _preloads(plan: Any) -> Any:
    """Return the function (v) that finds the preloads which balance the machine as drawn.

    They solve the normal equations of the least squares of force and moment.
    """
    at, preload = plan.at, SPRING.offsets["preload"]
    solved = [k for k, kind in enumerate(plan.springs) if kind % PUSHES == SOLVED]
    count, numbers = len(solved), np.array([*solved, 0])
    begins = np.array([*plan.elements.mounts.springs[solved], 0], dtype=np.int64)
    pushes = np.array([*(plan.springs[k] >= PUSHES for k in solved), False])
    set_taut, on_tub = taut_setter(plan), _on_tub(plan)

    @njit(**OPTIONS)
    def preload_springs(v):
        p, normal = numbers_at(v, at.packed), numbers_at(v, at.slopes)
        right = numbers_at(v, at.step)
        now = on_tub(v)
        for i in range(count):
            pull = pull_of(p, begins[i])
            right[i] = -product(pull, now)
            for j in range(count):
                normal[count * i + j] = product(pull, pull_of(p, begins[j]))
        if not solve(normal, right, count):
            return NOT_BALANCED
        for i in range(count):
            p[begins[i] + preload] = right[i]
            set_taut(v, numbers[i])
            if not (right[i] > 0.0 or pushes[i]):
                return SLACK
        return 0.0

    return preload_springs


@law
def product(a, b):
    """Return the scalar product of two tuples of six numbers."""
    return dot((a[0], a[1], a[2]), (b[0], b[1], b[2])) + dot((a[3], a[4], a[5]), (b[3], b[4], b[5]))


@law
def pull_of(p, at):
    """Return moment about To and force, six numbers, of a spring that pulls with 1 N as drawn."""
    hook, housing = read_spring_ends(p, at)
    line = subtract(housing, hook)
    pull = scale(1.0 / sqrt(dot(line, line)), line)
    moment = cross(hook, pull)
    return (moment[0], moment[1], moment[2], pull[0], pull[1], pull[2])


def _on_tub(plan: Any) -> Any:
    """Return the function (v) of moment about the origin of W and force on the tub at rest.

    They are those of gravity and all mounts at the state `at.trial`.
    """
    at, resting = plan.at, plan.resting
    others = len(resting.others.at) if resting.others else 0
    count = sum(len(part) for part in resting[:3]) + others

    @njit(**OPTIONS)
    def on_tub(v):
        p, x = numbers_at(v, at.packed), numbers_at(v, at.trial)
        wrenches = numbers_at(v, at.wrenches)
        write_mount_wrenches(x, p, resting, wrenches)
        total = weight_at(tub_motion(x), p)
        for i in range(count):
            total = plus(total, scaled(-1.0, six(wrenches, WRENCH_SIZE * i)))
        return total

    return on_tub


@law
def weight_at(motion, p):
    """Return moment about the origin of W and force of the weight of tub and empty drum. [N m, N]

    Args:
        motion: `TubMotion`.
        p: Packed numbers of the bodies, the drum at angle 0.
    """
    bodies, masses = read_bodies(p, 0), mass_properties(p, 1.0, 0.0)
    mass = 1.0 / bodies.inverse_mass
    about_To = add(masses.moment, scale(mass, bodies.origin))
    about_Wo = add(rotate(motion.rotation, about_To), scale(mass, motion.position))
    m, f = cross(about_Wo, bodies.gravity), scale(mass, bodies.gravity)
    return (m[0], m[1], m[2], f[0], f[1], f[2])


def _feet(plan: Any) -> Any:
    """Return the function (v) that puts the weight on the feet of a cabinet that moves.

    It does what `wm_drake.model.cabinet.cabinet_at_rest` does.
    """
    at, numbers, cabinet = plan.at, plan.count.packed - FEET.fixed_size, plan.elements.cabinet
    first = 0 if cabinet is None else cabinet + FEET_BEGIN
    growth, sag = PADS.offsets["damping_growth"], PADS.fixed_size + FOOT.offsets["at_rest"]

    @njit(**OPTIONS)
    def load_feet(v, motion):
        p = numbers_at(v, at.packed)
        feet, pads = read_feet(p, numbers), read_pads(p, first)
        load = load_on_feet(weight_at(motion, p), feet)
        normal = normal_loads(load[0], load[3], load[4], feet.x, feet.y)
        mean = 0.25 * (normal[0] + normal[1] + normal[2] + normal[3])
        p[first + growth] = pads.vertical_stiffness / (FULL_DAMPING * mean)
        for i in range(FEET_COUNT):
            p[first + sag + FOOT.fixed_size * i] = normal[i] / pads.vertical_stiffness

    return load_feet


INT32S, BYTES, INT64S = (types.CPointer(kind) for kind in (types.int32, types.uint8, types.int64))


@njit(**OPTIONS)
def part(v, begin, count):
    """Return some of the numbers behind a pointer as an array."""
    return carray(pointer_at(v, begin), (count,))


def _integrate(plan: Any) -> Any:
    """Return the function that runs the machine through the steps of a schedule.

    Arguments: v, c; length, drum acceleration and drum motion, sample numbers of the steps, whether
    a controller acts, whether a step takes one derivative; number of steps; samples to write, their
    number.
    """
    elements = plan.elements
    sample = elements.begins.size + elements.begins.rates
    advance = _midpoint(plan) if plan.integrator == "midpoint" else _advance(plan)
    signature = types.void(
        POINTER, POINTER, POINTER, POINTER, POINTER, INT32S, BYTES, BYTES, types.int32, POINTER,
        types.int32
    )  # fmt: skip

    @cfunc(signature, **OPTIONS)
    def wm_integrate(v, c, length, rate, drum, row, controls, one, n, history, rows):
        steps = (
            carray(length, (n,)), carray(rate, (n,)), carray(drum, (2 * n + 1, 4)),
            carray(row, (n,)), carray(controls, (n,)), carray(one, (n,))
        )  # fmt: skip
        advance(steps, n, v, c, part(history, 0, rows * sample))

    return wm_integrate


def _advance(plan: Any) -> Any:
    """Return the function (steps, n, v, c, history) of steps with one derivative or four."""
    at, elements, count = plan.at, plan.elements, plan.count.numbers
    size, inputs, run = elements.begins.size, at.stage - at.inputs, for_one_run(integrate_lanes)

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
        run(steps, 0, n, p, elements, x, work, history)

    return advance


def _midpoint(plan: Any) -> Any:
    """Return the function (steps, n, v, c, history) of steps of the midpoint rule."""
    at, of, elements, count = plan.at, plan.of, plan.elements, plan.count.numbers
    size, inputs, matrices = elements.begins.size, at.stage - at.inputs, of.sections - of.relaxation
    run = for_one_run(integrate_midpoint_lanes)

    @njit(**OPTIONS)
    def advance(steps, n, v, c, history):
        work = MidpointWork(
            part(v, at.rate, size),
            part(v, at.inputs, inputs),
            part(v, at.stage, size),
            part(v, at.past_rates, size),
            part(v, at.sum, size),
        )
        p, x = part(v, at.packed, count), part(v, at.state, size)
        relaxation = part(c, of.relaxation, matrices)
        run(steps[:4], 0, n, p, elements, relaxation, x, work, history)

    return advance


def _measure(plan: Any) -> Any:
    """Return the function that measures samples: displacements, largest values, forces of mounts.

    Arguments: v; samples and their number; displacements at each point, written.
    """
    at, count, elements = plan.at, plan.count, plan.elements
    sample = elements.begins.size + elements.begins.rates
    bounds, none, gasket = (LARGEST_ANGLE, LARGEST_DISPLACEMENT), np.empty(0, np.int64), plan.gasket
    samples_of, mounts_of = for_one_run(measure_samples_lanes), for_one_run(measure_mounts_lanes)
    sums, points = at.answer - at.sums, count.points
    largest, first = VECTOR_SUMS.offsets["largest"], at.packed + count.numbers + count.springs

    @cfunc(types.void(POINTER, POINTER, types.int32, POINTER), **OPTIONS)
    def wm_measure(v, history, rows, moved):
        numbers, unused = numbers_at(v, 0), part(v, at.step, 0)
        samples, p = part(history, 0, rows * sample), part(v, at.packed, count.numbers)
        extremes, total = part(v, at.extremes, points + 7), part(v, at.sums, sums)
        samples_of(
            samples, rows, sample, bounds, p, gasket, elements.mounts.branches,
            part(v, first, POINT_SIZE * points), points, none, part(moved, 0, rows * points),
            extremes, unused
        )  # fmt: skip
        mounts_of(samples, rows, sample, bounds, p, elements.mounts, count.mounts, unused, total)
        for i in range(count.mounts):
            numbers[at.answer + GAP_SIZE + i] = sqrt(total[VECTOR_SIZE * i + largest])
        numbers[at.answer + GAP_SIZE - 1] = extremes[points + 6]

    return wm_measure


def _smooth(plan: Any) -> Any:
    """Return the function that filters displacements and finds their largest peaks.

    Arguments: c; displacements of the sensors, rows, signals, padding; array to work in; filtered
    displacements, amplitudes and the samples where they are, written.
    """
    of, run, peaks = plan.of, for_one_run(filter_both_ways), for_one_run(largest_peaks)
    sections, settled = of.settled - of.sections, of.pairs - of.settled

    counts = types.int32, types.int32, types.int32

    @cfunc(types.void(POINTER, POINTER, *counts, POINTER, POINTER, POINTER, INT64S), **OPTIONS)
    def wm_smooth(c, moved, rows, signals, padding, work, filtered, sizes, places):
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


def _bin_forces(plan: Any) -> Any:
    """Return the function that finds the smallest and largest force in parts of a run.

    Arguments: v; samples, their number, number of parts; written: for each part, smallest and
    largest of the six numbers of the gasket and of the force of each mount.
    """
    at, count, elements, gasket = plan.at, plan.count, plan.elements, plan.gasket
    sample = elements.begins.size + elements.begins.rates
    signals = 6 + count.mounts

    @njit(**OPTIONS)
    def put(bins, at, value):
        bins[at] = min(bins[at], value)
        bins[at + 1] = max(bins[at + 1], value)

    @cfunc(types.void(POINTER, POINTER, types.int32, types.int32, POINTER), **OPTIONS)
    def wm_bin_forces(v, history, rows, parts, bands):
        p, wrenches, bins = (
            numbers_at(v, at.packed),
            numbers_at(v, at.wrenches),
            numbers_at(bands, 0),
        )
        for k in range(parts * signals):
            bins[2 * k], bins[2 * k + 1] = np.inf, -np.inf
        for row in range(rows):
            x = numbers_at(history, sample * row)
            place = 2 * signals * (row * parts // rows)
            if gasket >= 0:
                _, force = bushing_wrench(tub_motion(x), p, gasket, x, elements.mounts.branches)
                for k in range(6):
                    put(bins, place + 2 * k, force[k])
            write_mount_wrenches(x, p, elements.mounts, wrenches)
            for i in range(count.mounts):
                w = WRENCH_SIZE * i + 3
                f = (wrenches[w], wrenches[w + 1], wrenches[w + 2])
                put(bins, place + 2 * (6 + i), sqrt(dot(f, f)))

    return wm_bin_forces


@law
def nearest_in(shape, is_round, q):
    """Return the point of a shape nearest a point, both in the frame of its body. [m]

    Args:
        shape, is_round: As for `lowest_point`.
        q: The point.
    """
    x, y = (shape[3], shape[4], shape[5]), (shape[6], shape[7], shape[8])
    z, centre = (shape[9], shape[10], shape[11]), (shape[0], shape[1], shape[2])
    r = subtract(q, centre)
    a, b, along = dot(x, r), dot(y, r), dot(z, r)
    if is_round:
        away = sqrt(a * a + b * b)
        inside = shape[12] / away if away > shape[12] else 1.0
        a, b = a * inside, b * inside
    else:
        a, b = min(max(a, -shape[12]), shape[12]), min(max(b, -shape[13]), shape[13])
    along = min(max(along, -shape[14]), shape[14])
    return add(centre, add(scale(a, x), add(scale(b, y), scale(along, z))))


@law
def separation(motion, moving, fixed, rounds, d):
    """Return the gap of two shapes along a direction: a lower bound of their distance. [m]

    Args:
        motion: Rotation and position of the body of the first shape.
        moving, fixed: Numbers of the shapes.
        rounds: Whether each is a cylinder.
        d: Unit vector in W along which the first moves away from the second.
    """
    bound = lowest_point(rotate_back(motion[0], d), moving, rounds[0]) + dot(motion[1], d)
    return bound + lowest_point((-d[0], -d[1], -d[2]), fixed, rounds[1])


@law
def distance_of(motion, moving, fixed, rounds, d):
    """Return the distance of two shapes, the direction that separates them, and nearest points.

    A point is projected onto one shape and the other in turn. If the shapes overlap, the distance
    is the largest `separation` near the last direction: minus the depth of the overlap.

    Args:
        motion, moving, fixed, rounds: As for `separation`.
        d: Direction in which the search for shapes that overlap begins.
    """
    x = add(motion[1], rotate(motion[0], (moving[0], moving[1], moving[2])))
    y = x
    gap = 0.0
    for k in range(MOST_PROJECTIONS):
        y = nearest_in(fixed, rounds[1], x)
        q = nearest_in(moving, rounds[0], rotate_back(motion[0], subtract(y, motion[1])))
        x = add(motion[1], rotate(motion[0], q))
        line = subtract(x, y)
        gap = sqrt(dot(line, line))
        if gap < TOUCHING:
            break
        if k % 8 == 7:
            d = scale(1.0 / gap, line)
            if gap - separation(motion, moving, fixed, rounds, d) < TOUCHING:
                return gap, d, x, y
    best = separation(motion, moving, fixed, rounds, d)
    if gap >= TOUCHING:  # nearly: the bound is the safe side
        return best, d, x, y
    turn = 0.3
    while turn > 1e-6:
        improved = False
        side = (1.0, 0.0, 0.0) if abs(d[0]) < 0.7 else (0.0, 1.0, 0.0)
        u = cross(d, side)
        u = scale(1.0 / sqrt(dot(u, u)), u)
        w = cross(d, u)
        for k in range(16):
            s, c = sine_cosine(0.39269908169872414 * k)
            trial = add(d, scale(turn, add(scale(c, u), scale(s, w))))
            trial = scale(1.0 / sqrt(dot(trial, trial)), trial)
            bound = separation(motion, moving, fixed, rounds, trial)
            if bound > best:
                best, d, improved = bound, trial, True
        if not improved:
            turn = 0.5 * turn
    return best, d, x, y


@law
def pose_of(x):
    """Return rotation and position of the tub from a sample."""
    return rotation_from_rpy(x[0], x[1], x[2]), (x[3], x[4], x[5])


def _pair_reader(plan: Any) -> Any:
    """Return the function (c, pair) of both shapes, whether each is round, and a direction."""
    of = plan.of

    @njit(**OPTIONS)
    def pair_at(c, pair):
        begin, constants = of.pairs + PAIR_SIZE * pair, numbers_at(c, 0)
        d = begin + PAIR_SIZE - 3
        rounds = constants[d - 2] > 0.5, constants[d - 1] > 0.5
        moving, fixed = numbers_at(c, begin), numbers_at(c, begin + SHAPE_SIZE)
        return moving, fixed, rounds, (constants[d], constants[d + 1], constants[d + 2])

    return pair_at


def _measure_pair(plan: Any) -> Any:
    """Return the function that measures a pair in a sample; it returns what separates the pair.

    Arguments: v, c; number of the pair; the sample and its number; the direction to begin with.
    """
    at, pair_at = plan.at, _pair_reader(plan)

    @njit(**OPTIONS)
    def measure_pair(v, c, pair, x, row, d):
        moving, fixed, rounds, _ = pair_at(c, pair)
        answer = numbers_at(v, at.answer)
        gap, d, nearest, other = distance_of(pose_of(x), moving, fixed, rounds, d)
        if gap < answer[0]:
            answer[0], answer[1], answer[2] = gap, row, pair
            for k in range(3):
                answer[3 + k], answer[6 + k] = nearest[k], other[k]
        return d

    return measure_pair


def _smallest_of_pair(plan: Any) -> Any:
    """Return the function that finds the smallest gap of a pair, if it is the smallest so far.

    Arguments: v, c; number of the pair; samples and their number; array of bounds.
    """
    at, pair_at, measure_pair = plan.at, _pair_reader(plan), _measure_pair(plan)
    sample = plan.elements.begins.size + plan.elements.begins.rates

    @njit(**OPTIONS)
    def smallest_of_pair(v, c, pair, history, rows, bounds):
        moving, fixed, rounds, d = pair_at(c, pair)
        answer = numbers_at(v, at.answer)
        for row in range(rows):
            bounds[row] = -np.inf
        while True:
            least = 0
            for row in range(rows):
                if bounds[row] < answer[0]:
                    pose = pose_of(numbers_at(history, sample * row))
                    bounds[row] = max(bounds[row], separation(pose, moving, fixed, rounds, d))
                if bounds[row] < bounds[least]:
                    least = row
            if not bounds[least] < answer[0]:
                return
            d = measure_pair(v, c, pair, numbers_at(history, sample * least), least, d)
            bounds[least] = np.inf

    return smallest_of_pair


def _find_gap(plan: Any) -> Any:
    """Return the function that finds the smallest gap of a run, as `Scene.smallest_gap`.

    Arguments: v, c; samples and their number; array of bounds, a number for each sample.
    """
    at, of, count, reach = plan.at, plan.of, plan.count, plan.reach
    sample = plan.elements.begins.size + plan.elements.begins.rates
    distances = of.pairs + PAIR_SIZE * count.pairs
    pair_at, measure_pair = _pair_reader(plan), _measure_pair(plan)
    smallest_of_pair = _smallest_of_pair(plan)

    @njit(**OPTIONS)
    def farthest_of(history, c, rows):
        drawn, farthest, moved = numbers_at(c, of.initial), 0, -1.0
        for row in range(rows):
            x = numbers_at(history, sample * row)
            turned = abs(x[0] - drawn[0]) + abs(x[1] - drawn[1]) + abs(x[2] - drawn[2])
            line = (x[3] - drawn[3], x[4] - drawn[4], x[5] - drawn[5])
            shift = sqrt(dot(line, line)) + turned * reach
            if shift > moved:
                farthest, moved = row, shift
        return farthest, moved

    @cfunc(types.void(POINTER, POINTER, POINTER, types.int32, POINTER), **OPTIONS)
    def wm_find_gap(v, c, history, rows, work):
        at_rest, bounds = numbers_at(c, distances), numbers_at(work, 0)
        answer = numbers_at(v, at.answer)
        answer[0] = np.inf
        if rows == 0 or count.pairs == 0:
            return
        row, shift = farthest_of(history, c, rows)
        first = 0
        for pair in range(count.pairs):
            if at_rest[pair] < at_rest[first]:
                first = pair
        x = numbers_at(history, sample * row)
        measure_pair(v, c, first, x, row, pair_at(c, first)[3])
        smallest_of_pair(v, c, first, history, rows, bounds)
        for pair in range(count.pairs):
            if pair != first and at_rest[pair] - shift < answer[0]:
                smallest_of_pair(v, c, pair, history, rows, bounds)

    return wm_find_gap
