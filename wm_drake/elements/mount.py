"""Forces of the mounts on the cabinet: of springs, dampers, bushings and telescopic dampers.

A mount is everything that connects the oscillating group to the cabinet (the housing of the SDF);
an element on the drum is none.
"""

import functools
from collections import namedtuple
from collections.abc import Mapping, Sequence

import numpy as np

from wm_drake.compiler.chosen import call
from wm_drake.compiler.compilation import law, long_running
from wm_drake.compiler.elementary import in_each_lane, lanes_to_rows, rows_to_lanes
from wm_drake.compiler.lanes import WIDTH, align_stack, keep, lane_array
from wm_drake.compiler.matrices import plus
from wm_drake.compiler.vectors import add, cross, scale
from wm_drake.elements.bushing import six_component_bushing_wrench
from wm_drake.elements.friction_damper import (
    friction_damper_line,
    friction_damper_tension,
    friction_damper_wrench,
)
from wm_drake.elements.kind import ElementKind, registered_laws
from wm_drake.elements.motion import motion_at, read_tree_state, tub_motion
from wm_drake.elements.rubber import Branches, bushing_wrench
from wm_drake.elements.spring import spring_strut_wrench
from wm_drake.elements.state_map import ELEMENT, STRETCHES, StateMap
from wm_drake.elements.telescopic_damper import (
    TUBES_STATE_SIZE,
    inner_tube_motion,
    read_telescopic_damper,
)

WRENCH_SIZE = 6
"""Numbers of the wrench of a mount: moment about the origin of W, then force, in W. [N m, N]"""

Mounts = namedtuple(
    "Mounts", "springs dampers bushings telescopes branches others sponge_states tube_states"
)
"""Indices at which the mounts of a machine begin.

springs, dampers, bushings: arrays of indices of the elements in the packed numbers; telescopes: the
same for the numbers of `TELESCOPIC_DAMPER`, None if there are none; branches: `Branches` of rubber
bushings, None without them; others: `RegisteredLaws` of elements of other packages, or None;
sponge_states, tube_states: where the sponges of strut dampers and the states of telescopic dampers
begin in the state.
"""


def mounts_at(
    begins: Mapping[str, Sequence[int]],
    rubber: Sequence[int],
    kinds: Sequence[ElementKind],
    states: StateMap,
) -> Mounts:
    """Return the indices of mounts.

    Args:
        begins: Indices of springs, dampers, bushings, telescopes and others in packed numbers.
        rubber: Those of the bushings that are of rubber.
        kinds: Kinds of the others.
        states: States of the machine.
    """
    fields = ("springs", "dampers", "bushings", "telescopes", "others")
    parts = (tuple(begins.get(field, ())) for field in fields)
    return _mounts_at(tuple(parts), tuple(rubber), tuple(kinds), states)


@functools.lru_cache(maxsize=64)  # thousands of machines of a study have the same indices
def _mounts_at(
    begins: tuple[tuple[int, ...], ...],
    rubber: tuple[int, ...],
    kinds: tuple[ElementKind, ...],
    states: StateMap,
) -> Mounts:
    """Return the indices of mounts; see `mounts_at`."""
    springs, dampers, bushings, telescopes, others = (
        np.array(indices, dtype=np.int64) for indices in begins
    )
    branches = None
    if len(rubber):
        count = len(states.indices(kinds=[STRETCHES]))
        branches = Branches(np.array(rubber, dtype=np.int64), states.begins_of(STRETCHES), count)
    return Mounts(
        springs,
        dampers,
        bushings,
        telescopes if len(telescopes) else None,
        branches,
        registered_laws(kinds, others.tolist(), states.begins_of(ELEMENT).tolist()),
        states.begins.sponges,
        states.begins.tubes,
    )


@law
def reaction_on_cabinet(position, wrench):
    """Return the wrench on the cabinet of a massless mount from its wrench on a moving body.

    The forces at the two ends of a massless mount are in equilibrium, own derivation:

        f_cabinet = -f,    m_cabinet about Wo = -(m + p x f)

    Args:
        position: p, position of the origin of the body in W. [m]
        wrench: Moment m about that origin and force f on the body, in W (six numbers). [N m, N]

    Returns:
        Moment about the origin of W and force, in W (six numbers). [N m, N]
    """
    force = (wrench[3], wrench[4], wrench[5])
    m = scale(-1.0, add((wrench[0], wrench[1], wrench[2]), cross(position, force)))
    return (m[0], m[1], m[2], -force[0], -force[1], -force[2])


@law
def telescopic_damper_on_cabinet(x, k, p, at):
    """Return the wrench of a telescopic damper on the cabinet, as `reaction_on_cabinet`.

    Args:
        x, k: State, and index in it where the `TREE_STATE` of the tubes begins.
        p, at: Array that holds the numbers of `TELESCOPIC_DAMPER`, and where they begin.
    """
    damper, state = read_telescopic_damper(p, at), read_tree_state(x, k)
    inner, _, _ = inner_tube_motion(motion_at(x, k), state.joint_position, state.joint_rate, damper)
    on_inner, _ = six_component_bushing_wrench(inner, *damper.housing_bushing)
    return reaction_on_cabinet(inner.position, on_inner)


@law
def write_wrench(wrenches, at, wrench):
    """Write the six numbers of a wrench; return the index behind them."""
    for k in range(WRENCH_SIZE):
        wrenches[at + k] = wrench[k]
    return at + WRENCH_SIZE


@law
def write_mount_wrenches(x, p, mounts, wrenches):
    """Write the wrench of each mount on the cabinet, one after the other.

    The order is that of `Mounts`: springs, dampers, bushings, telescopic dampers, others.

    Args:
        x: State.
        p: Packed numbers.
        mounts: `Mounts`.
        wrenches: Written: `WRENCH_SIZE` numbers for each mount.
    """
    motion, column = tub_motion(x), 0
    for at in mounts.springs:
        wrench, _ = spring_strut_wrench(motion, p, at)
        column = write_wrench(wrenches, column, reaction_on_cabinet(motion.position, wrench))
    for i in range(len(mounts.dampers)):
        at = mounts.dampers[i]
        arm, line = friction_damper_line(motion, p, at)
        tension, _ = friction_damper_tension(line[1], x[mounts.sponge_states + i], p, at)
        wrench = friction_damper_wrench(motion, arm, line, tension, p, at)
        column = write_wrench(wrenches, column, reaction_on_cabinet(motion.position, wrench))
    for at in mounts.bushings:
        wrench, _ = bushing_wrench(motion, p, at, x, mounts.branches)
        column = write_wrench(wrenches, column, reaction_on_cabinet(motion.position, wrench))
    begin = mounts.tube_states
    column = _write_telescopic_dampers(x, p, mounts.telescopes, begin, wrenches, column)
    _write_others(x, p, motion, mounts.others, wrenches, column)


@law
def _write_telescopic_dampers(x, p, telescopes, tubes, wrenches, column):
    """Write the wrench of each telescopic damper; `telescopes` is None if there are none.

    It is an argument of its own, so that the function is compiled without the branch that is not
    taken.
    """
    if telescopes is not None:
        for i in range(len(telescopes)):
            k = tubes + TUBES_STATE_SIZE * i
            wrench = telescopic_damper_on_cabinet(x, k, p, telescopes[i])
            column = write_wrench(wrenches, column, wrench)
    return column


@law
def _write_others(x, p, motion, others, wrenches, column):
    """Write the wrench of each element of another package; `others` is None without any."""
    if others is not None:
        for i in others.on_cabinet:
            wrench = call(others.wrench, i, x, None, motion, p, others.at[i], others.states[i])
            column = write_wrench(wrenches, column, reaction_on_cabinet(motion.position, wrench))


@law
def torque_on_drum(x, motion, p, others):
    """Return the torque on the drum of all elements on it; arguments as for `add_others`. [N m]"""
    if others is None:
        return 0.0
    return _torque_of(x, motion, p, others.torque, others)


@law
def _torque_of(x, motion, p, torque, others):
    """Return the torque on the drum; `torque` is None without elements on the drum.

    It is an argument of its own, so that the function is compiled without the branch that is not
    taken.
    """
    if torque is None:
        return 0.0
    total = 0.0 * motion.velocity[0]
    for i in range(len(others.at)):
        total = total + call(torque, i, x, motion, p, others.at[i], others.states[i])
    return total


@law
def add_others(x, dx, motion, p, others, total):
    """Return the wrench on the tub with that of all elements of other packages.

    Args:
        x, dx: State and its time derivative, of which that of the elements is written.
        motion: `TubMotion` of the tub.
        p: Packed numbers.
        others: `RegisteredLaws`; None without such elements.
        total: Wrench of all other elements: moment about To and force, in W. [N m, N]
    """
    if others is None:
        return total
    for i in range(len(others.at)):
        wrench = call(others.wrench, i, x, dx, motion, p, others.at[i], others.states[i])
        total = plus(total, wrench)
    return total


@long_running
def mount_wrench_history(states, p, mounts, wrenches):
    """Evaluate the wrench of each mount on the cabinet at each sample.

    Args:
        states: (n, size) states as `write_mount_wrenches` reads them.
        p: Packed numbers of the mounts.
        mounts: `Mounts`.
        wrenches: (n, 6 mounts), written. [N m, N]
    """
    align_stack()
    x_numbers, p_numbers = np.empty(states.shape[1] * WIDTH), in_each_lane(p)
    numbers = np.empty(wrenches.shape[1] * WIDTH)
    x, q, wrench_lanes = lane_array(x_numbers), lane_array(p_numbers), lane_array(numbers)
    for begin in range(0, len(states), WIDTH):
        rows_to_lanes(states, begin, x_numbers)
        write_mount_wrenches(x, q, mounts, wrench_lanes)
        lanes_to_rows(numbers, begin, wrenches)
    keep(p_numbers)
