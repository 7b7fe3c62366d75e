"""A sample of runs is run again with half the step: what is not converged is said."""

from dataclasses import replace

import numpy as np
import pytest

import wm_drake as wm
from wm_drake.batch.verification import MOST_RUNS, Sample, StepError


def test_runs_of_the_reference_are_converged(machine):
    cases = [wm.case_of(machine.parameters, load) for load in machine.parameters.loads]
    error = wm.step_error(machine, cases)
    assert 0.0 < error.difference < 1e-3
    assert (error.step, error.runs, error.is_large) == (machine.parameters.step, 4, False)


def test_springs_that_no_step_at_rest_reveals_are_found(sponges):
    # stable and below the limit of the phase, but amplitudes are wrong by up to 90 %
    stiff = wm.with_value(sponges, "spring_types.suspension.stiffness", 1510e3)
    machine = wm.build_machine(stiff)
    error = wm.step_error(machine, [wm.case_of(stiff, "back")])
    assert error.difference > 0.1
    assert "amplitudes of 'back' differ by" in error.warning
    assert "the results are not converged" in error.warning


def test_error_has_the_size_of_the_difference(machine):
    # second route: two plain runs of one integrator
    case = wm.case_of(machine.parameters, "middle")
    sampled = wm.with_value(machine.parameters, "output_period", 2.5e-3)
    given, half = (
        wm.measure(wm.simulate(machine, finer, step=step)).amplitude.values
        for finer, step in ((case, 2.5e-3), (replace(case, parameters=sampled), 1.25e-3))
    )
    expected = np.max(np.abs(given - half)) / np.max(given)
    assert wm.step_error(machine, [case]).difference == pytest.approx(expected, rel=1e-6)


def test_sample_is_spread_over_all_runs(machine):
    sample = Sample()
    for number in range(1000):
        sample.add(machine, number)
    numbers = [case for _, case in sample.cases]
    assert MOST_RUNS // 2 < len(numbers) <= MOST_RUNS
    assert len(set(np.diff(numbers))) == 1
    assert numbers[0] == 0
    assert numbers[-1] > 800


def test_run_that_diverges_with_one_step_only_is_large():
    error = StepError(float("inf"), "middle", 1e-3, 5e-3, 1)
    assert error.is_large
    assert "one of the two runs of 'middle' diverges" in error.text
