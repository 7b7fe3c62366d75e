"""The midpoint rule for telescopic dampers: its linear step, its order, and when it is chosen."""

import numpy as np
import pytest
from simple_machines import constant_speed
from telescopic_machine import RUN_UP, changed, telescopic

from wm_drake.compiler.lane_memory import aligned, fill_lanes
from wm_drake.compiler.lanes import WIDTH
from wm_drake.engines.compiled.linear import jacobians
from wm_drake.engines.compiled.local_error import SUMS_SIZE
from wm_drake.engines.compiled.midpoint import integrate_midpoint_lanes, midpoint_work
from wm_drake.engines.compiled.midpoint_check import (
    midpoint_follows,
    relaxation_matrices,
    step_matrices,
    tube_jacobians,
)
from wm_drake.engines.compiled.packing import initial_state, pack
from wm_drake.engines.compiled.step_check import free_states
from wm_drake.engines.compiled.stepping import choose_stepping
from wm_drake.errors import InputError
from wm_drake.model.build import build_machine
from wm_drake.simulation.cases import Case
from wm_drake.simulation.runs import simulate

STANDSTILL = constant_speed(0.0, 1.0)
STEP = 2.5e-4


@pytest.fixture(scope="module")
def machine(shipped):
    return shipped("free_stroke")


@pytest.fixture(scope="module")
def setup(machine):
    return machine.set_up()


def at_rest(setup, difference):
    """Return packed numbers, layout, state of rest and Jacobian there, in each lane."""
    packed, layout = pack(setup)
    rest, (free, _) = initial_state(setup, STANDSTILL), free_states(setup, layout.states)
    found, _ = jacobians(packed, layout, np.tile(rest, (WIDTH, 1)), free, difference)
    return packed, layout, rest, found


def after_a_step(packed, layout, relaxation, states, kept):
    """Return state and what is kept from step to step after a step of each lane. (WIDTH, size)"""
    lanes = fill_lanes(aligned(len(packed) * WIDTH), [packed])
    matrices = fill_lanes(aligned(relaxation.size * WIDTH), [relaxation.ravel()])
    x = fill_lanes(aligned(states.size), list(states))
    work = midpoint_work(states.shape[1], 0)
    fill_lanes(work.past, list(kept))
    steps = (  # the step with number 1: that with number 0 begins with an own derivative
        np.full(2, STEP),
        np.zeros(2),
        np.tile([0.0, 1.0, 0.0, 0.0], (5, 1)),
        np.full(2, -1, dtype=np.int64),
    )
    sums = aligned(SUMS_SIZE * WIDTH)
    integrate_midpoint_lanes(
        steps, 1, 2, lanes, layout.elements, matrices, x, work, sums, aligned(8)
    )
    return x.reshape(-1, WIDTH).T.copy(), work.past.reshape(-1, WIDTH).T.copy()


def test_a_small_motion_takes_the_step_of_the_linearised_machine(setup):
    """Compare the compiled step with the matrix of the check, along random motions."""
    size = 1e-8
    packed, layout, rest, jacobian = at_rest(setup, size)
    relaxation = relaxation_matrices(tube_jacobians(setup, layout, jacobian), STEP)
    matrix = step_matrices(setup, layout, jacobian, STEP)[0]
    free, _ = free_states(setup, layout.states)
    free, n = np.array(free), len(free)
    velocities = _kept(setup)
    rng = np.random.default_rng(1)
    directions = size * rng.uniform(-1.0, 1.0, (WIDTH, n + len(velocities)))
    found = []
    for sign in (1.0, -1.0):
        states, kept = np.tile(rest, (WIDTH, 1)), np.zeros((WIDTH, len(rest)))
        states[:, free] += sign * directions[:, :n]
        kept[:, velocities] = sign * directions[:, n:]
        moved, past = after_a_step(packed, layout, relaxation, states, kept)
        found.append(np.hstack([moved[:, free], past[:, velocities]]))
    expected = 2.0 * directions @ matrix.T
    largest = np.abs(expected).max(axis=0)
    np.testing.assert_allclose((found[0] - found[1]) / largest, expected / largest, atol=2e-5)


def _kept(setup):
    """Return the indices of all velocities, then of all sponges, as the check has them."""
    begins = [14 + 15 * number for number in range(len(setup.telescopes))]
    velocities = [*range(7, 13), *(begin + 7 + k for begin in begins for k in range(7))]
    return velocities + [begin + 14 for begin in begins]


def test_with_its_own_jacobian_the_step_is_the_implicit_midpoint_rule(setup):
    """Check that a motion of the tubes alone is multiplied by (1 + z/2) / (1 - z/2)."""
    _, layout, _, jacobian = at_rest(setup, 1e-8)
    free, _ = free_states(setup, layout.states)
    tubes = np.array([place for place, k in enumerate(free) if 14 <= k < 14 + 14])
    alone = np.zeros_like(jacobian)
    alone[:, tubes[:, None], tubes] = jacobian[:, tubes[:, None], tubes]
    steps = np.linalg.eigvals(step_matrices(setup, layout, alone, STEP)[0])
    z = STEP * np.linalg.eigvals(alone[0][np.ix_(tubes, tubes)])
    expected = (1.0 + 0.5 * z) / (1.0 - 0.5 * z)
    assert np.abs(z).max() > 1.0
    for root in expected:
        assert np.abs(steps - root).min() < 1e-9


def test_errors_are_of_second_order(machine):
    case = Case("front", machine.parameters.loads["front"], RUN_UP)
    fine = simulate(machine, case, step=6.25e-5, integrator="runge_kutta").displacement
    errors = []
    for step in (5e-4, 2.5e-4):
        found = simulate(machine, case, step=step, integrator="midpoint").displacement
        errors.append(float(np.abs(found - fine).max() / np.abs(fine).max()))
    assert errors[0] < 1e-3
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.3)


@pytest.mark.parametrize(
    ("rpm", "step", "chosen", "length"),
    [(350.0, 2.5e-4, "midpoint", 2.5e-4), (350.0, 2.5e-3, "midpoint", 2.5e-4)],
)
def test_auto_chooses_the_midpoint_rule_for_tubes(setup, rpm, step, chosen, length):
    profile = constant_speed(rpm * np.pi / 30.0, 1.0)
    stepping = choose_stepping(setup, *pack(setup), profile, step)
    assert (stepping.integrator, stepping.step) == (chosen, length)
    assert stepping.relaxation.shape == (3 * 49,)


def test_the_midpoint_rule_is_refused_where_it_does_not_follow(setup, shipped):
    _, layout, _, jacobian = at_rest(setup, 1e-8)
    assert midpoint_follows(setup, layout, jacobian, STEP)
    steep = jacobian.copy()
    steep[1:] *= 30.0  # far steeper than at rest, where R is from
    assert not midpoint_follows(setup, layout, steep, STEP)
    plain = shipped("reference").set_up()
    with pytest.raises(InputError, match="'midpoint' needs telescopic dampers"):
        choose_stepping(plain, *pack(plain), STANDSTILL, 2.5e-3, "midpoint")
    fast = constant_speed(300.0, 1.0)
    with pytest.raises(InputError, match=r"'midpoint' does not follow this machine at 0\.208"):
        choose_stepping(setup, *pack(setup), fast, STEP, "midpoint")


def test_friction_that_jumps_gets_the_runge_kutta_scheme():
    coulomb = {"free_stroke": {"law": "coulomb", "friction_force": 25.0}}
    jumping = build_machine(changed(telescopic(), damper_types=coulomb)).set_up()
    stepping = choose_stepping(jumping, *pack(jumping), constant_speed(37.0, 1.0), STEP)
    assert (stepping.integrator, stepping.step) == ("runge_kutta", STEP)
