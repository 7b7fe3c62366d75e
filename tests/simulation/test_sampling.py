"""Samples of a run are so close that the peaks between them are found, however fast the drum is."""

from dataclasses import replace

import numpy as np
import pytest

import wm_drake as wm
from wm_drake.parameters import SpinProfile
from wm_drake.parameters.spin import SAMPLES_OF_TURN
from wm_drake.simulation.displacements import filtered_displacement
from wm_drake.simulation.records import sample_period

RAD_S = np.pi / 30.0
"""One rpm. [rad/s]"""

MOST_BESIDE = 1.0 - np.cos(np.pi / SAMPLES_OF_TURN)
"""Largest part of a peak of order one that a sample misses: 0.55 %."""


def run_up(rpm: float, ramp: float = 1.5, hold: float = 1.5) -> SpinProfile:
    return SpinProfile(time=(0.0, ramp, ramp + hold), speed=(0.0, rpm * RAD_S, rpm * RAD_S))


@pytest.mark.parametrize(
    ("rpm", "milliseconds"),
    [(0, 5.0), (400, 5.0), (-400, 5.0), (401, 2.5), (800, 2.5), (1200, 1.25), (5400, 0.3125)],
)
def test_a_turn_at_the_highest_speed_has_thirty_samples(rpm, milliseconds):
    period = run_up(rpm).sample_period(5e-3)
    assert period == pytest.approx(1e-3 * milliseconds, rel=1e-12)
    assert abs(rpm) / 60.0 * period <= (1.0 + 1e-12) / SAMPLES_OF_TURN


def test_engines_and_batch_take_the_same_samples(machine):
    case = wm.Case("front", machine.parameters.loads["front"], run_up(1200.0, 0.05, 0.05))
    records = [wm.simulate(machine, case, engine) for engine in ("compiled", "drake-accurate")]
    finished = []
    wm.simulate_many(machine, [case], histories=True, finished=finished.append)
    for record in (*records, finished[0].record):
        assert len(record.time) == 81
        assert sample_period(record) == pytest.approx(1.25e-3)


@pytest.mark.parametrize("rpm", [300.0, 600.0, 613.0, 1200.0, 1373.0, 1400.0])
def test_peaks_of_a_hold_are_those_of_fine_samples(machine, rpm):
    # at 300, 600, 1200 rpm every turn is sampled at the same angles
    parameters = machine.parameters
    fine = parameters.model_copy(update={"output_period": 5e-3 / 16.0})
    case = wm.Case("front", parameters.loads["front"], run_up(rpm, 2.0, 3.0))
    usual, finer = (wm.simulate(machine, one) for one in (case, replace(case, parameters=fine)))
    for signal in (filtered_displacement, lambda record: record.tub_acceleration):
        found, expected = (
            np.abs(signal(record).sel(time=slice(4.0, 4.8)).values).max(axis=0)
            for record in (usual, finer)
        )
        assert found == pytest.approx(expected, abs=MOST_BESIDE * expected.max())
