"""Results of the gasket study of [B] as targets: runs of its trials, and predictions by kind."""

from dataclasses import replace

import numpy as np
import pytest
from analysis_tools.study_targets import StudyRuns, study_targets
from linear_fits import fit_at

from wm_drake.batch import simulate_many
from wm_drake.model.build import build_machine
from wm_drake.parameters import (
    load_machine,
    measured_amplitudes,
    varying,
)
from wm_drake.parameters.vary_file import gasket_entries
from wm_drake.simulation.cases import Case
from wm_drake.studies.calibrate.prediction import Prediction
from wm_drake.studies.calibrate.response_targets import ComputedResponses
from wm_drake.studies.calibrate.results import predictions_of
from wm_drake.studies.calibrate.solutions import Solution
from wm_drake.studies.calibrate.targets import targets_of
from wm_drake.studies.doe.orthogonal import orthogonal_levels
from wm_drake.studies.experiment import Experiment

MEANS = "load,response,term,percent,effects\nmiddle,Fx,constant,,50\nmiddle,My,constant,,4\n"
OF_STUDY = """load,response,term,percent,effects
middle,Fx,constant,,40
middle,Fx,main effects,99,
middle,Fx,K_Lx,90,-20 1
middle,My,constant,,4
middle,My,C_L,0.5,
"""


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    path = tmp_path_factory.mktemp("machine") / "short.yaml"
    path.write_text(
        "extends: reference\nname: short\nprofile: {time: '(0, 12) s', speed: '(60, 200) rpm'}\n"
    )
    return build_machine(load_machine(path))


def targets_in(machine, tmp_path, text):
    path = tmp_path / "study.csv"
    path.write_text(text)
    return study_targets(machine.parameters.model_copy(update={"published": (str(path),)}))


def test_a_mean_over_the_design_is_that_of_its_trials(short, tmp_path):
    targets = targets_in(short, tmp_path, MEANS)
    computed = ComputedResponses(Experiment(short, ()), targets)(
        [short.parameters, short.parameters]
    )
    p, factors = short.parameters, varying(short.parameters, gasket_entries(), tables="linear")
    trials = [factors.at_levels(row.tolist()) for row in orthogonal_levels(8, 27)]
    cases = [Case("middle", p.loads["middle"], p.profile, parameters=trial) for trial in trials]
    table = simulate_many(build_machine(trials[0]), cases, measures=("extremes",))
    assert computed[0] == pytest.approx(
        [table.gasket_force.values[:, 0].mean(), table.gasket_moment.values[:, 1].mean()], rel=1e-12
    )
    assert np.array_equal(computed[0], computed[1])


def test_effects_and_contributions_of_a_design_are_targets(short, tmp_path):
    """Take the values from trials of a known law: 40 + 20 K_Lx - 3 K_Lx^2 + 2."""
    targets = targets_in(short, tmp_path, OF_STUDY)
    of = ["design", "K_Lx at -1", "K_Lx at 0", "K_Lx", "design", "C_L"]
    assert [target.of for target in targets] == of
    assert [target.deviation for target in targets] == [0.10, 0.03, 0.03, 0.10, 0.10, 0.10]
    design = StudyRuns(short)
    level = design.levels[:, list(gasket_entries()).index("K_Lx")].astype(float)
    other = design.levels[:, 0].astype(float)
    runs = (40.0 + 20.0 * level - 3.0 * level**2 + 2.0 + 4.0 * other)[None]
    found = [float(design.statistic(target, runs)[0]) for target in targets]
    assert found[:3] == pytest.approx([40.0, -21.0, 2.0])
    sums = np.square([-21.0, 2.0, 19.0]).sum(), 2.0 * 4.0**2
    assert [found[3], found[5]] == pytest.approx([100.0 * s / sum(sums) for s in sums])
    of_all = targets_of(short.parameters, measured_amplitudes(load_machine("reference")))
    of_all = replace(of_all, responses=targets)
    errors = of_all.response_errors(np.array(found))
    assert errors[:3] == pytest.approx([0.0, -1.0 / 40.0, 1.0 / 40.0])
    assert errors[5] == pytest.approx((found[5] - 0.5) / 100.0)
    residuals = of_all.residuals(of_all.amplitude, np.array(found), np.ones((6, 6)))
    linear = [1, 2, 3, 5]
    assert residuals[36:][linear] == pytest.approx(
        (errors / [0.1, 0.03, 0.03, 0.1, 0.1, 0.1])[linear]
    )
    assert residuals[40] == pytest.approx(np.log(found[4] / 4.0) / 0.1)
    limited = of_all.limited({"effect": 0.01})
    beyond = limited.excesses(of_all.amplitude, np.array(found), np.ones((6, 6)))
    assert beyond == pytest.approx([-0.5, 0.5])


def test_values_of_held_out_loads_are_predicted_by_kind(short, tmp_path):
    text = OF_STUDY + "counter,Fx,constant,,30\ncounter,Fx,C_T,40,\n"
    targets = targets_of(short.parameters, measured_amplitudes(load_machine("reference")))
    targets = replace(targets, responses=targets_in(short, tmp_path, text))
    wanted = np.array([target.value for target in targets.responses])
    for target, value in zip(targets.responses, wanted, strict=True):
        assert target.misfits(target.scattered(value, 0.2)) == pytest.approx(0.2)
    others = targets.without("counter")
    amplitude, responses = 1.1 * targets.amplitude, wanted.copy()
    responses[[target.load == "counter" for target in targets.responses]] = [33.0, 50.0]
    limits = np.stack([responses, responses - 11.0, responses + 4.0])
    fit = fit_at([0.0], [[1.0]])
    with_all, without = (
        Solution(None, t, 0, fit, a, r, 1.0, 0.0)
        for t, a, r in (
            (targets, targets.amplitude, wanted),
            (others, 1.2 * others.amplitude, wanted[: len(others.responses)]),
        )
    )
    bounds = np.stack([amplitude, 0.9 * amplitude, 1.2 * amplitude])
    prediction = Prediction(("counter",), with_all, without, bounds, limits, 0.04)
    table = predictions_of([prediction])
    assert table.what.values.tolist() == ["amplitudes", "means", "contributions"]
    assert table["values"].values.tolist() == [12, 1, 1]
    assert table.predicted_mean.values == pytest.approx([0.1, 0.1, 0.1])
    assert table.seen_mean[0] == pytest.approx(0.2)
    assert table.in_intervals.values.tolist() == [1.0, 1.0, 1.0]
    assert (table.calibrated_mean == 0.0).all()
    below = replace(prediction, responses=limits + 20.0)
    assert [kind.is_covered.all() for kind in below.kinds()] == [True, False, False]
