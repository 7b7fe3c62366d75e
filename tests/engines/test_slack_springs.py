"""Springs that go slack: both engines, runs in which they stay taut, the step."""

import numpy as np
import pytest

from wm_drake.parameters import Load, SpinProfile, Unbalance, with_value
from wm_drake.simulation.cases import Case
from wm_drake.simulation.runs import simulate

RUN_UP = SpinProfile(time=(0.0, 1.5, 2.0), speed=(8.0, 26.0, 26.0))
ACTION = "spring_types.suspension.action"


def unbalanced(mass, **changes):
    load = Load(unbalances=(Unbalance(mass=mass, radius=0.25, y=-0.05),))
    return Case(f"{mass} kg", load, RUN_UP, **changes)


@pytest.fixture(scope="module")
def pushing(reference):
    return with_value(reference, ACTION, "tension-compression")


def test_a_run_with_taut_springs_is_that_of_springs_that_push(machine, pushing):
    ours = simulate(machine, unbalanced(0.2))
    theirs = simulate(machine, unbalanced(0.2, parameters=pushing))
    assert float(ours.spring_tension.min()) > 20.0
    np.testing.assert_array_equal(ours.displacement, theirs.displacement)
    np.testing.assert_array_equal(ours.spring_tension, theirs.spring_tension)


def test_slack_springs_move_as_in_drake(machine, pushing):
    drake = simulate(machine, unbalanced(3.0), "drake-accurate")
    compiled = simulate(machine, unbalanced(3.0), step=2.5e-3 / 8)
    other = simulate(machine, unbalanced(3.0, parameters=pushing))
    for record in (drake, compiled):
        assert float(record.spring_tension.min()) == 0.0
    slack = (compiled.spring_tension == 0.0).any("spring")
    assert float(slack.mean()) > 0.1
    assert float(other.spring_tension.min()) < -100.0
    motion = float(np.abs(drake.displacement).max())
    np.testing.assert_allclose(compiled.displacement, drake.displacement, atol=3e-4 * motion)
    np.testing.assert_allclose(
        compiled.spring_tension, drake.spring_tension, atol=3e-4 * float(drake.spring_tension.max())
    )
    assert float(np.abs(other.displacement - drake.displacement).max()) > 0.05 * motion


def test_the_default_step_follows_slack_springs(machine, reference):
    coarse, fine = (
        simulate(machine, unbalanced(3.0), step=reference.step / parts) for parts in (1, 16)
    )
    motion = float(np.abs(fine.displacement).max())
    np.testing.assert_allclose(coarse.displacement, fine.displacement, atol=1e-3 * motion)
