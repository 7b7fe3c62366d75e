"""Compiled functions of a page that set a machine up: bodies, struts, preloads, rest pose, feet.

The rest pose is found by the function of the engine (`wm_drake.model.tub_statics`). The others do
what `wm_drake.model.equilibrium` and `wm_drake.model.cabinet` do with numpy and Drake.
"""

from typing import Any

import numpy as np
from numba import njit

from wm_drake.compiler.compilation import for_one_run, law
from wm_drake.compiler.elementary import sqrt
from wm_drake.compiler.matrices import solve_least
from wm_drake.compiler.vectors import add, cross, dot, scale, subtract
from wm_drake.elements.cabinet import FEET_COUNT, FOOT, FULL_DAMPING, PADS, read_pads
from wm_drake.elements.feet import FEET, load_on_feet, read_feet
from wm_drake.elements.friction_damper import FRICTION_DAMPER
from wm_drake.elements.mount import WRENCH_SIZE
from wm_drake.elements.spring import SPRING, read_spring, taut_tension
from wm_drake.engines.compiled.cabinet import FEET_BEGIN
from wm_drake.engines.compiled.mechanics import BODIES, mass_properties, read_bodies
from wm_drake.export.kernel import (
    INVERSE_MASS,
    OPTIONS,
    add_point_mass,
    drum_adder,
    numbers_at,
    part,
)
from wm_drake.export.page_plan import BODY_CONSTANTS, BODY_SIZE, FREE_LENGTH, PUSHES, SOLVED, SUMS
from wm_drake.laws.feet import normal_loads
from wm_drake.laws.table import stiffness_force
from wm_drake.model.tub_statics import balance_tub, weight_wrench, wrenches_on_tub

REMAINING = 1e-10
"""Largest force [N] or moment [N m] that remains on the tub at rest."""
NOT_BALANCED, SLACK, FAR = -1.0, -2.0, -3.0
"""Why a machine has no equilibrium near its drawn pose."""


def body_changer(plan: Any) -> Any:
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


def strut_placer(plan: Any, set_taut: Any) -> Any:
    """Return the function (v) that computes what follows from the ends of struts.

    These are drawn lengths and given preloads of springs, and the axes of dampers.
    """
    at, first, mounts, settles = plan.at, plan.count.numbers, plan.elements.mounts, plan.settles
    axis, length = FRICTION_DAMPER.offsets["axis"], SPRING.offsets["rest_length"]
    preload, kinds = SPRING.offsets["preload"], np.array([k % PUSHES for k in (*plan.springs, 0)])

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


def settler(plan: Any, set_taut: Any) -> Any:
    """Return the function (v) that finds preloads and rest pose of the empty machine.

    It does what `wm_drake.model.equilibrium` does: preloads that balance the tub as drawn as well
    as they can, then the pose at which nothing remains. It returns 0, or why there is no such pose.
    """
    at, size, limits, resting = plan.at, plan.elements.begins.size, plan.limits, plan.resting
    numbers, wrenches = plan.count.numbers, WRENCH_SIZE * (_resting_count(plan) + 1)
    on_tub = for_one_run(wrenches_on_tub)
    balance = for_one_run(balance_tub, wrenches_on_tub=on_tub)
    preload_springs = _preloads(plan, set_taut)

    @njit(**OPTIONS)
    def settle(v):
        rest, state, p = numbers_at(v, at.rest), numbers_at(v, at.state), numbers_at(v, at.packed)
        trial, of_mounts = part(v, at.trial, size), part(v, at.wrenches, wrenches)
        for k in range(size):
            trial[k] = state[k] if k >= 6 else 0.0
        packed, weight = part(v, at.packed, numbers), weight_of_bodies(p)
        left = part(v, at.wrenches + wrenches - 6, 6)
        on_tub(trial, packed, resting, weight, of_mounts)
        status = preload_springs(v, left)
        if status < 0.0:
            return status
        left = part(v, at.step, 6)
        balance(trial, packed, resting, weight, REMAINING, of_mounts, left)
        for k in range(6):
            rest[k] = trial[k]
            if not abs(left[k]) <= REMAINING:
                return NOT_BALANCED
        for k in range(6):
            if not abs(rest[k]) <= limits[k // 3]:
                return FAR
        return 0.0

    return settle


def _resting_count(plan: Any) -> int:
    """Return the number of mounts that act at rest."""
    others = len(plan.resting.others.on_cabinet) if plan.resting.others else 0
    return sum(len(mounts) for mounts in plan.resting[:3]) + others


def _preloads(plan: Any, set_taut: Any) -> Any:
    """Return the function (v, wrench) that finds the preloads which balance the machine as drawn.

    They are the smallest that solve the least squares of force and moment, as in
    `wm_drake.model.equilibrium.preloaded`; wrench is that on the tub without them.
    """
    at, preload = plan.at, SPRING.offsets["preload"]
    solved = [k for k, kind in enumerate(plan.springs) if kind % PUSHES == SOLVED]
    count, numbers = len(solved), np.array([*solved, 0])
    begins = np.array([*plan.elements.mounts.springs[solved], 0], dtype=np.int64)
    pushes = np.array([*(plan.springs[k] >= PUSHES for k in solved), False])

    @njit(**OPTIONS)
    def preload_springs(v, wrench):
        p, products = numbers_at(v, at.packed), numbers_at(v, at.slopes)
        right, axes = numbers_at(v, at.step), numbers_at(v, at.jacobian)
        for k in range(6):
            right[k] = -wrench[k]
            for j in range(6):
                products[6 * k + j] = 0.0
                for i in range(count):
                    pull = pull_of(p, begins[i])
                    products[6 * k + j] = products[6 * k + j] + pull[k] * pull[j]
        solve_least(products, right, 6, axes)
        for i in range(count):
            force = product(pull_of(p, begins[i]), right)
            p[begins[i] + preload] = force
            set_taut(v, numbers[i])
            if not (force > 0.0 or pushes[i]):
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


@law
def weight_of_bodies(p):
    """Return the weight of tub and empty drum: force in W, and centre of mass in T. [N, m]

    Args:
        p: Packed numbers of the bodies; the drum is at angle 0.
    """
    bodies, masses = read_bodies(p, 0), mass_properties(p, 1.0, 0.0)
    centre = add(bodies.origin, scale(bodies.inverse_mass, masses.moment))
    return scale(1.0 / bodies.inverse_mass, bodies.gravity), centre


def foot_loader(plan: Any) -> Any:
    """Return the function (v) that puts the weight on the feet of a cabinet that moves.

    It does what `wm_drake.model.cabinet.cabinet_at_rest` does.
    """
    at, numbers, cabinet = plan.at, plan.count.packed - FEET.fixed_size, plan.elements.cabinet
    first = 0 if cabinet is None else cabinet + FEET_BEGIN
    growth, sag = PADS.offsets["damping_growth"], PADS.fixed_size + FOOT.offsets["at_rest"]
    foot = FOOT.fixed_size

    @njit(**OPTIONS)
    def load_feet(v, motion):
        p = numbers_at(v, at.packed)
        feet, pads = read_feet(p, numbers), read_pads(p, first)
        load = load_on_feet(weight_wrench(motion, weight_of_bodies(p)), feet)
        normal = normal_loads(load[0], load[3], load[4], feet.x, feet.y)
        mean = 0.25 * (normal[0] + normal[1] + normal[2] + normal[3])
        p[first + growth] = pads.vertical_stiffness / (FULL_DAMPING * mean)
        for i in range(FEET_COUNT):
            p[first + sag + foot * i] = normal[i] / pads.vertical_stiffness

    return load_feet
