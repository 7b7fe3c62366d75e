"""Hits of stops: against a flight of constant acceleration, and the same in record and batch."""

import numpy as np
import pytest

import wm_drake as wm
from wm_drake.parameters import MachineParameters, SpinProfile, load_machine
from wm_drake.simulation.cases import Case
from wm_drake.simulation.measures import MEASURES
from wm_drake.simulation.measures.responses import known_responses
from wm_drake.simulation.stops import hits_of

PERIOD = 5e-3


def test_velocity_at_the_face_is_that_of_a_flight_with_constant_acceleration():
    acceleration, start = 12.0, 0.03
    time = PERIOD * np.arange(40)
    d, v = 0.5 * acceleration * time**2 - start, acceleration * time
    fall = np.sqrt(2.0 * start / acceleration)
    d[time >= fall] = 1e-3  # stays in the buffer
    count, velocity = hits_of(d[:, None], v[:, None], PERIOD)
    assert count == [1.0]
    assert velocity[0] == pytest.approx(np.sqrt(2.0 * acceleration * start), rel=1e-12)


def test_each_contact_is_a_hit_and_a_start_in_contact_is_none():
    d = np.array([1.0, 1.0, -1.0, -0.5, 2.0, 1.0, -1.0, 3.0, 3.0])[:, None] * 1e-3
    v = np.array([0.0, -0.4, -0.2, 0.3, 0.1, -0.4, 0.6, 0.2, 0.0])[:, None]
    count, velocity = hits_of(d, v, PERIOD)
    assert count == [2.0]
    # the second hit: the sample before its flight is in contact, so its acceleration is not known
    assert velocity[0] == pytest.approx(0.6)


def test_a_stop_that_is_not_met_has_no_hit():
    count, velocity = hits_of(np.full((5, 2), -1e-3), np.ones((5, 2)), PERIOD)
    assert (count.tolist(), velocity.tolist()) == ([0.0, 0.0], [0.0, 0.0])


def test_no_samples_are_no_number():
    assert np.isnan(hits_of(np.empty((0, 2)), np.empty((0, 2)), PERIOD)).all()


def with_stop():
    tree = load_machine("reference").model_dump(exclude_unset=True)
    frames = {"tub_frame": "damper_left_tub", "housing_frame": "damper_left_housing"}
    stop = {"kind": "stop", **frames, "gap": 0.002, "stiffness": 4e4, "loss": 0.4}
    return MachineParameters.model_validate(tree | {"elements": {"left": stop}})


@pytest.mark.slow
def test_record_and_batch_count_the_same_hits():
    machine = wm.build_machine(with_stop())
    profile = SpinProfile(time=(0.0, 1.0, 3.0), speed=(5.0, 18.0, 18.0))
    case = Case("middle", machine.parameters.loads["middle"], profile)
    record = wm.simulate(machine, case)
    alone = wm.measure(record, measures=["stops"]).table
    table = wm.simulate_many(machine, [case], measures=["stops"])
    assert alone.stop_hits.sel(stop="left") > 2
    for name in MEASURES["stops"].names:
        np.testing.assert_allclose(table[name][0], alone[name], rtol=1e-9)
    # the rate at the sample before a hit, within what gravity and springs add in a sample
    d, v = record.stop_compression.values[:, 0], record.stop_closing_velocity.values[:, 0]
    before = v[:-1][(d[:-1] <= 0.0) & (d[1:] > 0.0)]
    assert float(alone.stop_hit_velocity[0]) == pytest.approx(before.max(), abs=0.2)


def test_only_machines_with_stops_have_responses_of_stops():
    names = [
        {r.name for r in known_responses(machine, machine.profile)}
        for machine in (with_stop(), load_machine("reference"))
    ]
    assert "stop_hits_left" in names[0]
    assert not any(name.startswith("stop_") for name in names[1])
