"""When the midpoint rule of `wm_drake.engines.compiled.midpoint` suits a machine, and its matrices.

The linearised machine takes the steps of the rule, with the matrices R of the machine at rest, at
states with slow and fast motion. It must not grow faster than the linearised machine itself.
"""

import numpy as np

from wm_drake.elements.state_map import (
    ELEMENT_STATE,
    JOINT,
    JOINT_VELOCITY,
    PLACES,
    SPONGE,
    TUB,
    TUBES,
    VELOCITIES,
)
from wm_drake.engines.compiled.midpoint import BODY, MOVING, write_relaxation
from wm_drake.engines.compiled.midpoint import TUBES as TUBES_FREEDOM
from wm_drake.engines.compiled.packing import Layout
from wm_drake.engines.compiled.step_check import free_states
from wm_drake.model.machine import Setup
from wm_drake.parameters.types import FloatArray

DOUBLINGS = 9
"""Growth is seen from 2^9 to 2^10 steps."""

LARGEST_GROWTH = 3.0
"""Largest growth in these steps beyond that of the linearised machine."""


def tube_jacobians(setup: Setup, layout: Layout, jacobians: FloatArray) -> FloatArray:
    """Return the Jacobian at rest of the tubes of each telescopic damper. (dampers, 14, 14) [1/s]

    Args:
        setup, layout: The machine and its layout.
        jacobians: (lanes, n, n) of its free states, the first one at rest. [1/s]
    """
    place = _places(setup, layout)
    moving = [[place[at + k] for k in MOVING] for at in layout.states.begins_of(TUBES)]
    return np.array([jacobians[0][np.ix_(states, states)] for states in moving])


def relaxation_matrices(tubes: FloatArray, step: float) -> FloatArray:
    """Return R of each telescopic damper at a step. (dampers, 7, 7)

    Args:
        tubes: From `tube_jacobians`.
        step: Step size. [s]
    """
    count = len(tubes) * TUBES_FREEDOM**2
    matrices, newton, right = np.empty(count), np.empty(TUBES_FREEDOM**2), np.empty(TUBES_FREEDOM)
    for number, jacobian in enumerate(tubes):
        numbers, at = np.ascontiguousarray(jacobian).ravel(), number * len(newton)
        write_relaxation(numbers, step, newton, right, matrices, at)
    return matrices.reshape(-1, TUBES_FREEDOM, TUBES_FREEDOM)


def midpoint_follows(setup: Setup, layout: Layout, jacobians: FloatArray, step: float) -> bool:
    """Return whether steps of the midpoint rule grow no faster than the linearised machine.

    Args:
        setup, layout, jacobians: As for `tube_jacobians`.
        step: Step size. [s]
    """
    from scipy.linalg import expm  # slow to import, for tubes only

    if not np.all(np.isfinite(jacobians)):
        return False
    steps = step_matrices(setup, layout, jacobians, step)
    with np.errstate(over="ignore", invalid="ignore"):
        grown = _growth(steps) / np.maximum(_growth(expm(step * jacobians)), 1.0)
    return bool(np.all(grown <= LARGEST_GROWTH))  # not a number: no


def step_matrices(setup: Setup, layout: Layout, jacobians: FloatArray, step: float) -> FloatArray:
    """Return the matrices that take the linearised machine through a step of the midpoint rule.

    Args:
        setup, layout, jacobians, step: As for `midpoint_follows`.

    Returns:
        (lanes, m, m) for the free states, then what is kept from step to step: the acceleration
        of each velocity and the rate of each sponge.
    """
    place = _places(setup, layout)
    q, v, sponges = (np.array([place[k] for k in part]) for part in _parts(layout))
    n, moving, internal = jacobians.shape[1], len(v), len(sponges)
    relaxation = np.eye(moving)
    for number, matrix in enumerate(
        relaxation_matrices(tube_jacobians(setup, layout, jacobians), step)
    ):
        at = BODY + TUBES_FREEDOM * number
        relaxation[at : at + TUBES_FREEDOM, at : at + TUBES_FREEDOM] = matrix
    state, kept, rates = np.split(np.eye(n + moving + internal), [n, n + moving])
    transitions = []
    for jacobian in jacobians:
        kinematics = jacobian[np.ix_(q, v)]
        middle, after = state.copy(), state.copy()
        middle[v] += 0.5 * step * kept
        middle[q] += 0.5 * step * kinematics @ middle[v]
        middle[sponges] += 0.5 * step * rates
        rate = jacobian @ middle
        acceleration = kept + relaxation @ (rate[v] - kept)
        after[q] += step * kinematics @ (state[v] + 0.5 * step * acceleration)
        after[v] += step * acceleration
        after[sponges] += step * rate[sponges]
        transitions.append(np.vstack([after, acceleration, rate[sponges]]))
    return np.array(transitions)


def _growth(matrices: FloatArray) -> FloatArray:
    """Return how much a power 2^(DOUBLINGS + 1) of each matrix is larger than its root. (n,)"""
    power = matrices
    for _ in range(DOUBLINGS):
        power = power @ power
    sizes = [np.linalg.norm(each, axis=(1, 2)) for each in (power @ power, power)]
    return np.asarray(sizes[0] / sizes[1])


def _places(setup: Setup, layout: Layout) -> dict[int, int]:
    """Return the place of each free state among them, by its index in the state."""
    free, _ = free_states(setup, layout.states)
    return {index: place for place, index in enumerate(free)}


def _parts(layout: Layout) -> tuple[list[int], list[int], list[int]]:
    """Return the indices of positions, of their velocities, and of other states of elements.

    The order is that of the bodies: tub, tubes, carrier. The joint of the tub is the drum's.
    """
    positions, velocities = list[int](), list[int]()
    for part in layout.states.parts:
        skipped = (JOINT, JOINT_VELOCITY) if part.kind == TUB else ()
        positions += part.indices(*(role for role in PLACES if role not in skipped))
        velocities += part.indices(*(role for role in VELOCITIES if role not in skipped))
    return positions, velocities, layout.states.indices(SPONGE, ELEMENT_STATE).tolist()
