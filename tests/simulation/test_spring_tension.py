"""Smallest tension of each spring: of a record and of a batch."""

import numpy as np
import pytest

from wm_drake.batch import simulate_many
from wm_drake.parameters import Load, SpinProfile, Unbalance, with_value
from wm_drake.simulation.cases import Case
from wm_drake.simulation.spring_tension import slack_springs, smallest_tensions, tensions_at

RUN_UP = SpinProfile(time=(0.0, 1.5, 2.0), speed=(8.0, 26.0, 26.0))
PUSHING = "spring_types.suspension.action"


def case(mass, parameters=None):
    load = Load(unbalances=(Unbalance(mass=mass, radius=0.25, y=-0.05),))
    return Case(f"{mass} kg", load, RUN_UP, parameters=parameters)


@pytest.fixture(scope="module")
def cases(reference):
    pushing = with_value(reference, PUSHING, "tension-compression")
    return [case(0.1), case(3.0), case(3.0, pushing), case(90.0)]


def test_elongation_follows_from_the_stiffness(machine, cases, reference):
    table = simulate_many(machine, cases, measures=["spring tensions"])
    assert list(table.spring.values) == ["left", "right", "rear"]
    slack = [slack_springs(table.smallest_spring_tension.sel(run=run)) for run in range(3)]
    assert slack == [[], ["left", "right", "rear"], []]
    assert table.smallest_spring_tension.values[2].min() < -100.0  # these push
    assert bool(table.diverged.values[3])  # measured until then
    stiffness = reference.spring_types["suspension"].stiffness
    tension = stiffness * table.smallest_spring_elongation
    for run in (0, 2):  # taut, and pushed
        np.testing.assert_allclose(
            table.smallest_spring_tension.sel(run=run), tension.sel(run=run), rtol=1e-9
        )
    assert (tension.sel(run=1) < 0.0).all()


def test_a_run_without_samples_has_none(machine):
    assert np.all(np.isnan(smallest_tensions(np.empty((0, 3)))))
    springs = machine.set_up().springs.values()
    for values in tensions_at(springs, np.full(3, np.inf)):
        assert np.isnan(values).all()
