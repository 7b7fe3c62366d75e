"""Design of measurements on problems of known answer: variances in closed form, no machine runs."""

import warnings
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from wm_drake.errors import InputError
from wm_drake.model.build import build_machine
from wm_drake.parameters import load_machine
from wm_drake.parameters.candidates import load_candidates
from wm_drake.simulation.measures import MEASURES
from wm_drake.simulation.measures.responses import Response
from wm_drake.studies.next.knowledge import of_calibration_folder
from wm_drake.studies.next.measurements import CandidateMeasurement, _Reading, measurements_of
from wm_drake.studies.next.question import Observed, Question
from wm_drake.studies.next.study import (
    Model,
    model_of,
    pairs_of,
    sequence_of,
    singles_of,
    steps_of,
)
from wm_drake.studies.next.task import with_candidates

GAP = Response("gap", MEASURES["gap"].variables[0])


def linear_model(slopes, data, samples=4000, costs=None, bend=0.0):
    """Return the model of answers `slopes` (K, p) and data `data` (n, p) each, made up."""
    slopes = np.atleast_2d(np.asarray(slopes, dtype=float))
    rng = np.random.default_rng(3)
    scores = rng.standard_normal((samples, slopes.shape[1]))
    data = [np.atleast_2d(np.asarray(rows, dtype=float)) for rows in data]
    costs = costs or [np.nan] * len(data)
    measurements = tuple(
        CandidateMeasurement(
            f"m{k}", f"m{k}", cost, lambda numbers: numbers, lambda machines: machines
        )
        for k, cost in enumerate(costs)
    )
    loads = tuple(f"load{k}" for k in range(len(slopes)))
    return Model(
        Question(SimpleNamespace(names=("a",)), measurements, (GAP,), loads, {}),
        np.zeros(len(slopes)),
        slopes,
        tuple(data),
        scores @ slopes.T + bend * (scores[:, :1] ** 2 - 1.0),
        tuple(scores @ rows.T + rng.standard_normal((samples, len(rows))) for rows in data),
        scores,
    )


@pytest.mark.parametrize("accuracy", [0.1, 1.0, 3.0])
def test_direct_measurement_leaves_the_variance_of_two_combined_normals(accuracy):
    model = linear_model([1.0], [[1.0 / accuracy]])
    expected = accuracy**2 / (1.0 + accuracy**2)
    assert model.is_linear
    assert model.remaining([0]) == pytest.approx(expected, rel=1e-6)
    assert np.var(model.sampled([0])) == pytest.approx(expected, rel=0.05)


def test_measurement_of_something_else_leaves_the_answer():
    model = linear_model([1.0, 0.0], [[0.0, 50.0]])
    assert model.remaining([0]) == pytest.approx(1.0)


def test_worst_of_two_loads_has_the_variance_of_a_smallest_of_two_normals():
    model = linear_model(np.eye(2), [[100.0, 0.0]])
    # the smaller of two independent normals has the variance 1 - 1/pi
    assert np.var(model.linear(())) == pytest.approx(1.0 - 1.0 / np.pi, rel=0.05)
    # with one of them known to be 0, it is that of min(0, z): 1/2 - 1/(2 pi)
    known = 0.5 - 0.5 / np.pi
    assert np.var(model.linear([0])) == pytest.approx(known, rel=0.05)
    # a model of one load, or of their mean, would say that half remains
    assert model.remaining([0]) == pytest.approx(known / (1.0 - 1.0 / np.pi), rel=0.05)


def test_pairs_find_two_measurements_that_help_only_together():
    # b sees the answer behind something large, c sees that; a sees the answer badly
    model = linear_model([1.0, 0.0], [[1.2, 0.0], [100.0, 1000.0], [0.0, 1000.0]])
    assert sequence_of(model, 1) == [0]
    best = pairs_of(model).isel(pair=0)
    assert {best["first"].item(), best["second"].item()} == {"m1", "m2"}
    assert best.remaining.item() < 1e-3
    assert model.remaining([0, 1]) > 0.1


def test_sequence_never_widens_the_interval_and_repeats_nothing():
    rng = np.random.default_rng(0)
    model = linear_model(rng.standard_normal((3, 6)), list(rng.standard_normal((8, 2, 6))))
    taken = sequence_of(model, 5)
    assert len(set(taken)) == 5
    steps = steps_of(model, taken)
    widths = (steps.high - steps.low).values[:, 0]
    assert (np.diff(widths) < 1e-9).all()
    assert (steps.low < steps.value).all()
    assert (steps.value < steps.high).all()


def test_singles_are_ranked_and_have_gain_per_cost():
    model = linear_model([1.0], [[1.0], [3.0], [0.1]], costs=[1.0, 10.0, np.nan])
    singles = singles_of(model)
    assert singles["name"].values.tolist() == ["m1", "m0", "m2"]
    gains = singles.gain.sel(candidate=["m0", "m1"]).values
    widths = [1.0 - np.sqrt(1.0 / 2.0), 1.0 - np.sqrt(1.0 / 10.0)]
    assert gains == pytest.approx(widths, rel=0.02)
    per_cost = singles.gain_per_cost.sel(candidate=["m0", "m1"]).values
    assert per_cost == pytest.approx([gains[0], gains[1] / 10.0])
    assert np.isnan(singles.gain_per_cost.sel(candidate="m2"))


def test_weak_measurement_of_the_worst_of_loads_gains_next_to_nothing():
    rng = np.random.default_rng(1)
    model = linear_model(np.eye(4), list(1e-3 * rng.standard_normal((20, 1, 4))))
    assert model.is_linear
    gains = singles_of(model).gain.values
    assert (gains >= 0.0).all()
    assert (gains < 1e-4).all()


def test_curved_answer_is_judged_by_samples_that_keep_what_a_line_misses():
    model = linear_model([1.0], [[100.0]], bend=0.6)
    assert not model.is_linear
    # var(u + b (u^2 - 1)) = 1 + 2 b^2; a linear estimate misses the second part
    explained = 1.0 - 2.0 * 0.36 / (1.0 + 2.0 * 0.36)
    assert model.explained[0] == pytest.approx(explained, abs=0.05)
    assert model.remaining([0]) == pytest.approx(1.0 - explained, abs=0.05)


def test_wrong_slopes_never_widen_an_interval():
    """Machines tell how far data go with the answer, also where the slopes are wrong."""
    model = linear_model([1.0], [[2.0], [0.05], [0.0]], samples=400, bend=0.6)
    wrong = replace(model, data_slopes=tuple(-5.0 * rows for rows in model.data_slopes[:2]))
    wrong = replace(wrong, drawn_data=model.drawn_data[:2])
    # data u + e / 2 hold 1 / (1 + 1/4) of the straight part of u + b (u^2 - 1)
    straight = 1.0 / (1.0 + 2.0 * 0.36)
    for one in (model, wrong):
        assert not one.is_linear
        assert one.remaining([0]) == pytest.approx(1.0 - 0.8 * straight, abs=0.06)
        assert 1.0 - 0.03 < one.remaining([1]) <= 1.0


class Bent(Question):
    """A question with a bent answer, of which some machines cannot be measured."""

    def at(self, scores, what):  # noqa: ARG002
        u = np.asarray(scores)
        answers = -(5.0 + u[:, :1] + 0.6 * (u[:, :1] ** 2 - 1.0))
        numbers = np.where(np.abs(u[:, :1] - 0.5) < 0.1, np.nan, 3.0 + u[:, :1])
        return Observed(answers, (numbers,) * len(self.measurements))


def test_machines_that_cannot_be_measured_are_left_out_of_the_samples():
    measurement = CandidateMeasurement("m", "m", 1.0, lambda numbers: np.array([0.01]), None)
    question = Bent(SimpleNamespace(names=("a",)), (measurement,), (GAP,), ("x",), {True: None})
    model = model_of(question, 512, 0)
    assert not model.is_linear
    assert 400 < len(model.drawn) < 512
    assert len(model.drawn) == len(model.scores) == len(model.drawn_data[0])
    u = model.scores[:, 0]  # what is left is the bend
    bend = np.var(0.6 * u**2) / np.var(u + 0.6 * u**2)
    assert model.remaining([0]) == pytest.approx(bend, rel=0.02)


class Made(Question):
    """A question whose machines are functions of the scores."""

    def at(self, scores, what):  # noqa: ARG002
        u = np.asarray(scores)
        answers = np.stack([-(5.0 + u[:, 0] - 2.0 * u[:, 1]), -(6.0 + u[:, 1])], axis=1)
        numbers = np.stack([20.0 + 0.5 * u[:, 1], np.full(len(u), 7.0)], axis=1)
        answers[u[:, 0] > 2.5] = np.nan  # no such machine
        return Observed(answers, (numbers, numbers[:, 1:]))


def test_model_of_made_up_machines_has_their_slopes():
    accuracy = np.array([0.1, 0.1])
    measurements = (
        CandidateMeasurement("both", "both", 1.0, lambda numbers: accuracy, None),
        CandidateMeasurement("nothing", "nothing", 1.0, lambda numbers: accuracy[:1], None),
    )
    question = Made(
        SimpleNamespace(names=("a", "b")), measurements, (GAP,), ("x", "y"), {True: None}
    )
    model = model_of(question, 512, 0)
    assert [m.name for m in model.question.measurements] == ["both"]
    np.testing.assert_allclose(model.slopes, [[-1.0, 2.0], [0.0, -1.0]], atol=1e-12)
    np.testing.assert_allclose(model.data_slopes[0], [[0.0, 5.0], [0.0, 0.0]], atol=1e-12)
    assert model.question.worst(model.middle[None])[0, 0] == pytest.approx(5.0)
    assert len(model.drawn) < 512
    assert model.is_linear


OWN = """
about: one load and one sensor of the laboratory
loads:
  test_mass: {unbalances: [{mass: 300 g, radius: 235 mm, y: -100 mm, phase: 0 deg}]}
sensors:
  top: {position: '(0, -150, 262) mm', axis: x}
candidates:
  small_run: {kind: run, load: test_mass, sensors: [top], accuracy: 5 %}
"""


def test_candidates_add_loads_and_sensors_to_the_machine(tmp_path):
    path = tmp_path / "lab.yaml"
    path.write_text(OWN)
    file, reference = load_candidates(path), load_machine("reference")
    machine = build_machine(with_candidates(reference, file))
    assert machine.parameters.loads["test_mass"].mass == pytest.approx(0.3)
    assert "top" in machine.parameters.sensors
    (run,) = measurements_of(machine, file)
    assert run.run == ("test_mass", True)
    taken = file.model_copy(update={"loads": {"middle": file.loads["test_mass"]}})
    with pytest.raises(InputError, match=r"loads\.middle: is in the machine already"):
        with_candidates(reference, taken)


def test_a_sensor_that_nothing_moves_says_nothing():
    sizes = xr.DataArray(
        [[[0.0, 2e-3]]], {"load": ["middle"], "sensor": ["Y", "X"]}, ("point", "load", "sensor")
    )
    machines = SimpleNamespace(runs={True: xr.Dataset({"amplitude": sizes})})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        (numbers,) = _Reading(("middle", True), ("Y", "X")).numbers(machines)
    assert np.isnan(numbers[0])
    assert numbers[1] == pytest.approx(np.log(2e-3))


def test_a_calibration_to_records_is_known_without_its_recorder(tmp_path):
    """Keep, of a normal distribution of three, the part of the covariance of two."""
    force, mass = "damper_types.friction.friction_force", "bodies.motor.mass"
    vary = tmp_path / "vary.yaml"
    vary.write_text(
        f"vary:\n  {force}: {{low: 10 N, high: 70 N, mean: 40 N, deviation: 4 N}}\n"
        f"  {mass}: {{low: 1 kg, high: 11 kg, mean: 6 kg, deviation: 1 kg}}\n"
    )
    (tmp_path / "estimates.csv").write_text(
        f"unknown,unit,value,deviation\ngain of S1,,1.01,0.01\n{force},N,42,2\n{mass},kg,6,0.5\n"
    )
    (tmp_path / "correlations.csv").write_text(
        f"unknown,gain of S1,{force},{mass}\n"
        f"gain of S1,1,0.3,0.2\n{force},0.3,1,0.5\n{mass},0.2,0.5,1\n"
    )
    machine = build_machine(load_machine("reference"))
    knowledge = of_calibration_folder(machine, str(vary), tmp_path)
    assert set(knowledge.names) == {force, mass}
    values = knowledge.values(np.random.default_rng(1).standard_normal((20000, 2)))
    at = [knowledge.names.index(name) for name in (force, mass)]
    assert values.mean(axis=0)[at] == pytest.approx([42.0, 6.0], rel=0.01)
    assert values.std(axis=0)[at] == pytest.approx([2.0, 0.5], rel=0.02)
    assert np.corrcoef(values.T)[0, 1] == pytest.approx(0.5, abs=0.02)
