"""The order of all states is in one place: any other order gives the same motion."""

import numpy as np
import pytest
from machine_with_bearing import with_bearing
from machines_of_each_kind import RUBBER
from telescopic_machine import telescopic

from wm_drake.elements import state_map
from wm_drake.elements.state_map import CARRIER, ORDER, STRETCHES, VELOCITIES
from wm_drake.engines.compiled.derivative import StateDerivative
from wm_drake.engines.compiled.packing import initial_state
from wm_drake.engines.compiled.slopes import SlopedDerivative
from wm_drake.model import placed_elements
from wm_drake.model.build import build_machine
from wm_drake.parameters import load_machine


def rubber(parameters):
    return parameters.model_copy(
        update={"gasket": parameters.gasket.model_copy(update=dict(RUBBER))}
    )


MACHINES = {
    "rubber and bearing": lambda: with_bearing(rubber(load_machine("reference"))),
    "tubes and bearing": lambda: with_bearing(telescopic()),
    "cabinet, motor and rubber": lambda: rubber(load_machine("heavy_cabinet").model_copy(update={"drive": load_machine("motor").drive})),
}  # fmt: skip


def evaluated(setup):
    """Return states by kind of part, derivative there and slopes, of a machine and its Jacobian."""
    derivative, sloped = StateDerivative(setup), SlopedDerivative(setup)
    spans, moved = [], []
    for states in (derivative.layout.states, sloped.layout.states):
        spans.append({kind: np.r_[states.span(kind)] for kind in ORDER})
        moved.append(np.zeros(states.size))
        for number, span in enumerate(spans[-1].values()):
            moved[-1][span] = np.random.default_rng(number).uniform(-1e-3, 1e-3, len(span))
    slopes = np.zeros((len(moved[1]), len(moved[1])))
    slopes[np.ix_(sloped.free, sloped.free)] = sloped.jacobian((sloped.rest + moved[1])[None])[0]
    profile = setup.parameters.profile
    rate = derivative(initial_state(setup, profile) + moved[0], 2.0, reference=3.0)
    return spans, rate, slopes


@pytest.mark.slow
@pytest.mark.parametrize("name", MACHINES)
def test_no_other_place_knows_the_order(name, monkeypatch):
    """Compare with the states in the opposite order, behind tub and drum."""
    parameters = MACHINES[name]()
    setup = build_machine(parameters).set_up(next(iter(parameters.loads)))
    spans, rate, slopes = evaluated(setup)
    opposite = (ORDER[0], *ORDER[:0:-1])
    monkeypatch.setattr(state_map, "ORDER", opposite)
    placed_elements._states.cache_clear()
    try:
        _, other_rate, other_slopes = evaluated(setup)
    finally:
        placed_elements._states.cache_clear()
    place, place_of_slopes = (np.concatenate([span[kind] for kind in opposite]) for span in spans)
    assert not np.array_equal(place, np.arange(len(place)))
    np.testing.assert_array_equal(other_rate, rate[place])
    np.testing.assert_array_equal(other_slopes, slopes[np.ix_(place_of_slopes, place_of_slopes)])


@pytest.mark.parametrize("name", MACHINES)
def test_parts_are_joined_as_they_are_taken_apart(name):
    parameters = MACHINES[name]()
    setup = build_machine(parameters).set_up()
    states = setup.elements.states()
    rows = np.random.default_rng(0).uniform(-1.0, 1.0, (3, states.size))
    others = {kind: states.take(rows, kind) for kind in (CARRIER, STRETCHES)}
    parts = states.take(rows, "tub"), states.deformation(rows), states.tubes(rows)
    np.testing.assert_array_equal(states.joined(*parts, others), rows)
    assert len(states.words()) == states.size == len(states.kinds())
    assert len(states.indices(*VELOCITIES)) == 7 * (1 + len(setup.telescopes)) + 6 * bool(
        setup.bearing
    )
