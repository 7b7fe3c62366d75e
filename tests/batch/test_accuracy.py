"""A run whose step is too long is repeated: the rule, and machines with planted faults."""

import math

import numpy as np
import pytest
from stopped_machine import RUN_UP, stopped

import wm_drake as wm
from wm_drake.engines.trajectory import Estimates
from wm_drake.simulation.convergence import (
    MOST_AT_ONCE,
    MOST_HALVINGS,
    Attempt,
    StepSummary,
    difference,
    judged,
)

ALLOWED = 0.005


def attempt(estimate, amplitude=1e-2, lost=0.0, halvings=0, diverged=""):
    values = {"amplitude": np.array([amplitude, 1e-3]), "critical_speed": np.array([9.0, 8.0])}
    step = 2.5e-3 / 2**halvings
    return Attempt(Estimates(estimate, lost), step, halvings, diverged, values, 1e-2)


def test_a_run_is_accepted_by_its_estimate():
    accuracy, finer = judged(attempt(0.004), None, ALLOWED)
    assert (accuracy.error, accuracy.is_converged, finer) == (0.004, 1.0, None)


@pytest.mark.parametrize(
    ("estimate", "halvings", "closer"), [(0.006, 1, 1), (0.03, 1, 1), (0.1, 2, 1), (9.0, 3, 2)]
)
def test_a_rough_run_is_repeated_the_finer_the_rougher_it_is(estimate, halvings, closer):
    accuracy, finer = judged(attempt(estimate), None, ALLOWED)
    assert (accuracy.is_converged, finer.step, finer.period) == (0.0, halvings, closer)
    assert finer.step <= MOST_AT_ONCE


def test_samples_that_miss_a_peak_are_doubled():
    _, finer = judged(attempt(0.001, lost=0.02), None, ALLOWED)
    assert (finer.step, finer.period) == (1, 1)


def test_a_repeated_run_is_accepted_if_its_measures_stay():
    before = attempt(0.03, 1.000e-2)
    stays, moves = attempt(0.008, 1.004e-2, halvings=1), attempt(0.008, 1.02e-2, halvings=1)
    accuracy, finer = judged(stays, before, ALLOWED)
    assert accuracy.error == pytest.approx(4e-5 / 1.004e-2)
    assert (accuracy.is_converged, finer) == (1.0, None)
    accuracy, finer = judged(moves, before, ALLOWED)
    assert (accuracy.is_converged, finer.step) == (0.0, 1)


def test_a_run_that_never_settles_is_not_converged_and_has_its_spread():
    last = attempt(0.02, 1.3e-2, halvings=MOST_HALVINGS)
    accuracy, finer = judged(last, attempt(0.02, 1e-2, halvings=MOST_HALVINGS - 1), ALLOWED)
    assert finer is None
    assert (accuracy.is_converged, accuracy.error) == (0.0, pytest.approx(0.3 / 1.3))
    steps = StepSummary()
    steps.add("middle", accuracy)
    steps.add("front", judged(attempt(0.001), None, ALLOWED)[0])
    assert "1 of 2 runs are not converged" in steps.warning
    assert "differ by 23 %" in steps.warning
    assert steps.text.startswith("0.07812 to 2.5 ms; 1 of 2 runs were repeated")


def test_a_run_that_diverges_twice_diverges():
    first, second = attempt(0.0, diverged="at 3 s"), attempt(0.0, halvings=3, diverged="at 3 s")
    assert judged(first, None, ALLOWED)[1].step == MOST_AT_ONCE
    assert judged(second, first, ALLOWED)[1] is None
    assert difference(first, attempt(0.0)) == math.inf
    last = attempt(0.02, halvings=MOST_HALVINGS)
    assert "inf" not in judged(last, first, ALLOWED)[0].text


def test_numbers_that_one_run_lacks_differ_without_bound():
    assert difference(attempt(0.0, np.nan), attempt(0.0)) == math.inf


@pytest.mark.parametrize("stiffness", [80e3, 600e3, 2000e3])
def test_a_stop_that_is_met_within_a_step_has_its_true_force(stiffness):
    parameters = stopped(stiffness)
    machine, load = wm.build_machine(parameters), parameters.loads["middle"]
    measures = ["mounts", "gap", "extremes"]

    def run(accuracy, step=None, period=5e-3):
        given = parameters.model_copy(update={"accuracy": accuracy, "output_period": period})
        case = wm.Case("middle", load, RUN_UP, parameters=given)
        return wm.simulate_many(machine, [case], measures=measures, step=step, workers=1)

    as_it_is, repeated = run(1.0), run(ALLOWED)
    true = run(1.0, 2.5e-3 / 64, 5e-3 / 16)
    assert as_it_is.error.item() > ALLOWED  # the estimate sees it
    assert repeated.is_converged.item() == 1.0
    assert repeated.step.item() < 2.5e-3
    expected = true.mount_force_peak.sel(mount="elements.bump").item()
    found = repeated.mount_force_peak.sel(mount="elements.bump").item()
    assert expected > 100.0
    assert found == pytest.approx(expected, rel=2.0 * ALLOWED)
    assert repeated.smallest_gap.item() == pytest.approx(true.smallest_gap.item(), abs=1e-4)


def test_results_do_not_depend_on_workers_and_neighbours():
    parameters = stopped(300e3)
    machine = wm.build_machine(parameters)
    cases = [wm.Case(name, load, RUN_UP) for name, load in parameters.loads.items()]
    together = wm.simulate_many(machine, cases * 3, workers=2)
    alone = [wm.simulate_many(machine, [case], workers=1) for case in cases]
    assert len(set(together.halvings.values[:4])) > 1  # only some are repeated
    for number, case in enumerate(cases * 3):
        expected = alone[cases.index(case)]
        for name in ("amplitude", "detergent_displacement", "gasket_force"):
            np.testing.assert_array_equal(together[name][number], expected[name][0])
        assert together.error[number] == expected.error[0]


RUBBER_X = {"gasket.maxwell_stiffness_x": "2 N/mm", "gasket.maxwell_damping_x": "0.04 N*s/mm"}
LONG = {"output_period": "20 ms", "step": "20 ms", "integrator": "runge_kutta"}
KINDS = {
    "springs that go slack": ("reference", LONG | {"gravity": "1.5 m/s^2"}),
    "gasket and dampers": ("reference", LONG),
    "rubber": ("reference", LONG | RUBBER_X),
    "motor": ("motor", LONG | {"output_period": "10 ms", "step": "10 ms"}),
    "feet": ("light_cabinet", LONG | {"output_period": "5 ms", "step": "5 ms"}),
    "balls": ("ball_rings", {}),
    "liquid": ("liquid_rings", {"step": "1.25 ms", "integrator": "runge_kutta"}),
    "tubes": ("free_stroke", {"step": "0.25 ms"}),
}
"""Machine and changes, with the longest step that the machine at rest allows."""


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_shows_what_too_long_a_step_loses(kind):
    name, changes = KINDS[kind]
    parameters = wm.with_values(wm.load_machine(name), changes)
    machine, (load, *_) = wm.build_machine(parameters), parameters.loads

    def run(accuracy, step=None):
        given = parameters.model_copy(update={"accuracy": accuracy})
        case = wm.Case(load, parameters.loads[load], RUN_UP, parameters=given)
        table = wm.simulate_many(machine, [case], step=step, workers=1)
        values = {v: table[v].values[0] for v in ("amplitude", "detergent_displacement")}
        size = float(np.abs(values["detergent_displacement"]).max())
        return table, Attempt(Estimates(0.0, 0.0), 0.0, values=values, size=size)

    (rough, as_it_is), (_, true) = run(1.0), run(1.0, parameters.step / 16)
    lost = difference(as_it_is, true)
    assert rough.error.item() >= 0.5 * lost  # never optimistic by more than 2
    repeated, _ = run(0.5 * rough.error.item())
    assert repeated.halvings.item() > 0
    assert repeated.is_converged.item() == 1.0
