"""Targets that are no amplitudes: files, and what is known of ratios."""

import numpy as np
import pytest

from wm_drake.batch import simulate_many
from wm_drake.errors import InputError
from wm_drake.model.build import build_machine
from wm_drake.parameters import load_machine
from wm_drake.parameters.measured import measured_amplitudes, measured_responses
from wm_drake.parameters.vary_file import load_vary
from wm_drake.simulation.cases import Case
from wm_drake.studies.calibrate.computed import Evaluation
from wm_drake.studies.calibrate.parameter_map import parameter_map_of
from wm_drake.studies.calibrate.response_targets import (
    ComputedResponses,
    response_targets_of,
    with_deviations,
)
from wm_drake.studies.calibrate.targets import targets_of
from wm_drake.studies.experiment import Experiment

HEAD = "load,gasket,source,of,Fx [N],My [N*mm]\n"
ROWS = "middle,yes,test,machine,50,4000\ncounter,yes,test,machine,30,2000\n"
PROFILE = "profile: {time: '(0, 12) s', speed: '(60, 200) rpm'}\n"


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    path = tmp_path_factory.mktemp("machine") / "short.yaml"
    path.write_text("extends: reference\nname: short\n" + PROFILE)
    return build_machine(load_machine(path))


def named(machine, tmp_path, text):
    path = tmp_path / "responses.csv"
    path.write_text(text)
    parameters = machine.parameters.model_copy(update={"measured": (str(path),)})
    return measured_responses(parameters)


def test_values_are_read_with_the_unit_in_the_head(short, tmp_path):
    targets = response_targets_of(short.parameters, named(short, tmp_path, HEAD + ROWS))
    found = {(t.load, t.response.name): t.value for t in targets}
    assert found["middle", "Fx"] == 50.0
    assert found["counter", "My"] == pytest.approx(2.0)  # read in N mm, shown in N m


def test_files_of_responses_are_no_files_of_amplitudes(short, tmp_path):
    path = tmp_path / "responses.csv"
    path.write_text(HEAD + ROWS)
    both = short.parameters.model_copy(
        update={"measured": (*load_machine("reference").measured, str(path))}
    )
    assert set(measured_amplitudes(both)["source"]) == {"experiment", "Adams model of [B]"}
    assert len(measured_responses(both)) == 4


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (HEAD.replace("Fx [N]", "Fx") + ROWS, "'Fx' is not of the form 'NAME [unit]'"),
        (HEAD.replace("[N]", "[kg]") + ROWS, "column 'Fx' is in kg; it needs a unit such as N"),
        (HEAD.replace("Fx", "Fq") + ROWS, "no response 'Fq'"),
        (HEAD + ROWS.replace("middle", "midle"), "no load 'midle' in the machine"),
        (HEAD + ROWS.replace("machine", "design"), "is not allowed; allowed are machine"),
        (HEAD + ROWS.replace("50", "0"), "it must be above 0"),
        (HEAD + ROWS.replace("counter", "middle"), "occurs twice"),
        (HEAD + ROWS.replace("50", "x"), "'x' is not a finite number"),
    ],
)  # fmt: skip
def test_a_wrong_file_is_refused(short, tmp_path, text, message):
    with pytest.raises(InputError) as refused:
        response_targets_of(short.parameters, named(short, tmp_path, text))
    assert message in str(refused.value)


def test_a_response_of_the_machine_is_that_of_a_run(short, tmp_path):
    targets = response_targets_of(short.parameters, named(short, tmp_path, HEAD + ROWS))
    computed = ComputedResponses(Experiment(short, ()), targets)([short.parameters])[0]
    p = short.parameters
    cases = [Case(load, p.loads[load], p.profile, True) for load in ("middle", "counter")]
    table = simulate_many(short, cases, measures=("extremes",))
    expected = [
        value
        for run in (0, 1)
        for value in (table.gasket_force.values[run, 0], table.gasket_moment.values[run, 1])
    ]
    assert computed == pytest.approx(expected, rel=1e-12)


def test_weights_and_deviations_go_by_name_and_by_kind(short, tmp_path):
    rows = measured_amplitudes(load_machine("reference"))
    targets = targets_of(
        short.parameters, rows, responses=named(short, tmp_path, HEAD + ROWS)
    ).weighted({"Fx": 4.0, "moment": 0.0, "counter:Fx": 0.25})
    assert [t.weight for t in targets.responses] == [4.0, 0.0, 1.0, 0.0]
    assert targets.count == 36 + 2
    near = with_deviations(targets.responses, {"force": 0.2, "middle:Fx": 0.05})
    assert [t.deviation for t in near] == [0.05, 0.1, 0.2, 0.1]
    with pytest.raises(InputError, match="'Fq' is no response of the targets"):
        with_deviations(targets.responses, {"Fq": 0.1})


def test_residuals_are_logarithms_in_standard_deviations(short, tmp_path):
    rows = measured_amplitudes(load_machine("reference"))
    targets = targets_of(short.parameters, rows, responses=named(short, tmp_path, HEAD + ROWS))
    amplitude = 1.1 * targets.amplitude
    responses = np.array([2.0 * target.value for target in targets.responses])
    residuals = targets.residuals(amplitude, responses, np.full(amplitude.shape, 0.05))
    assert residuals[:36] == pytest.approx(np.log(1.1) / 0.05)
    assert residuals[36:] == pytest.approx(np.log(2.0) / 0.1)
    held_out = targets.without("middle")
    assert held_out.count == 36 - 12 + 2


FREE = """
relations:
  ring:
    quantity: torsion
    to: {radial: 0.0648 m^2/rad}
    at_most: (0.9, 0.05)
    source: "torsional stiffness of a ring of 180 mm radius"
  flange:
    quantity: torsion
    to: {radial: 0.01 m^2/rad}
    prior: (4, 2)
    source: test
vary:
  radial:
    bounds: (1, 6) N/mm
    prior: (3, 1) N/mm
    sets: {gasket.stiffness_x: 1}
    source: test
  torsion:
    bounds: (10000, 500000) N*mm/rad
    prior: (150000, 50000) N*mm/rad
    sets: {gasket.rotational_stiffness_y: 1}
    source: test
"""


def ratio_map(tmp_path, text=FREE):
    path = tmp_path / "free.yaml"
    path.write_text(text)
    machine = tmp_path / "linear.yaml"
    machine.write_text(
        "extends: reference\nname: linear\n"
        "gasket: {stiffness_x: 3 N/mm, rotational_stiffness_y: 150000 N*mm/rad}\n"
    )
    built = build_machine(load_machine(machine))
    return built, parameter_map_of(built, load_vary(path))


def test_relations_are_residuals_of_ratios(tmp_path):
    _, ratios = ratio_map(tmp_path)
    points = np.array([[3000.0, 150.0], [2000.0, 150.0]])
    residuals = ratios.prior_residuals(points, np.empty((2, 0)), np.empty((2, 0)))
    bound = [150.0 / (3000.0 * 0.0648), 150.0 / (2000.0 * 0.0648)]
    assert residuals[0] == pytest.approx([0.0, (150.0 / 30.0 - 4.0) / 2.0])
    assert residuals[1] == pytest.approx([(bound[1] - 0.9) / 0.05, (150.0 / 20.0 - 4.0) / 2.0])
    assert bound[0] < 0.9 < bound[1]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("quantity: torsion", "quantity: torsoin", "no quantity 'torsoin'"),
        ("{radial: 0.01 m^2/rad}", "{radial: 0.01 m/rad}", "has not the dimension of torsion"),
        ("prior: (4, 2)", "prior: (4, 0)", "standard deviation must be above 0"),
        ("    prior: (4, 2)\n", "", "needs either 'prior' or 'at_most'"),
        ("prior: (4, 2)", "prior: (4, 2) N", "'(4, 2) N' is not a pair of numbers"),
    ],
)
def test_a_wrong_relation_is_refused(tmp_path, old, new, message):
    with pytest.raises(InputError) as refused:
        ratio_map(tmp_path, FREE.replace(old, new))
    assert message in str(refused.value)


def test_an_evaluation_has_amplitudes_and_responses(short, tmp_path):
    targets = targets_of(
        short.parameters,
        measured_amplitudes(load_machine("reference")),
        responses=named(short, tmp_path, HEAD + ROWS),
    )
    path = tmp_path / "friction.yaml"
    path.write_text(
        "vary: {friction: {bounds: '(10, 60) N', prior: '(30, 10) N', source: test,"
        " sets: damper_types.friction.friction_force}}\n"
    )
    ratios = parameter_map_of(short, load_vary(path))
    values = Evaluation(Experiment(short, ()), ratios, targets)(np.array([[30.0], [50.0]]))
    assert values.amplitude.shape == (2, 6, 6)
    assert values.responses.shape == (2, 4)
    assert np.isfinite(values.responses).all()
    assert not np.allclose(values.responses[0], values.responses[1])
