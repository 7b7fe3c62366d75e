"""Calibration of a machine: parameter map, targets, recovery of a known machine, interruption."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from analysis_tools.ledgers import kept_in
from linear_fits import fit_at

from wm_drake.batch.ledger import open_ledger
from wm_drake.errors import InputError
from wm_drake.model.build import build_machine
from wm_drake.parameters import load_machine, measured_amplitudes
from wm_drake.parameters.files import yaml_text
from wm_drake.parameters.vary_file import load_vary
from wm_drake.report.labelled import LabelledTable
from wm_drake.studies.calibrate.computed import Evaluation
from wm_drake.studies.calibrate.parameter_map import parameter_map_of, read_parameter_map
from wm_drake.studies.calibrate.prediction import predict
from wm_drake.studies.calibrate.results import amplitudes_of, predictions_of, quantities_of
from wm_drake.studies.calibrate.solutions import Solution, distinct, solved_machine
from wm_drake.studies.calibrate.study import SearchPlan, calibrate
from wm_drake.studies.calibrate.targets import Targets, targets_of
from wm_drake.studies.experiment import Experiment

FREE = """
vary:
  friction:
    bounds: (10, 60) N
    prior: (30, 10) N
    sets: damper_types.friction.friction_force
    source: test
  lean:
    bounds: (-60, 90) mm
    prior: (20, 30) mm
    sets: {frames.damper_left_housing.position.x: -1, frames.damper_right_rear_housing.position.x: 1}
    source: test
  motor:
    bounds: (4, 6) kg
    prior: (5, 0.5) kg
    sets: {bodies.motor.mass: 1, bodies.motor.inertia.xx: 0.0024 m^2}
    source: test
"""
TABLE = """
  slope:
    bounds: (1, 6) N/mm
    prior: (3, 1) N/mm
    sets: {gasket.stiffness_x.force: "(-30, 0, 30) mm"}
    source: test
  hardening:
    bounds: (0, 80) N
    prior: (20, 20) N
    sets: {gasket.stiffness_x.force: "(-1, 0, 1)"}
    source: test
"""
PRELOAD = """
spring_preload:
  prior: (100, 20) N
  source: test
"""


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """Build the reference machine with a table for the gasket and a short run-up."""
    path = tmp_path_factory.mktemp("machine") / "short.yaml"
    path.write_text(
        "extends: reference\nname: short\n"
        "gasket: {stiffness_x: {displacement: '(-30, 0, 30) mm', force: '(-110, 0, 110) N'}}\n"
        "profile: {time: '(0, 20) s', speed: '(40, 270) rpm'}\n"
    )
    return build_machine(load_machine(path))


def free_file(tmp_path, text=FREE):
    path = Path(tmp_path) / "free.yaml"
    path.write_text(text)
    return load_vary(path)


def mapped(machine, tmp_path, text):
    path = Path(tmp_path) / "free.yaml"
    return read_parameter_map(machine, path, free_file(tmp_path, text))


def planted(
    machine, parameter_map, point, loads=(("middle", True), ("counter", True), ("counter", False))
):
    """Return the amplitudes of the machine at a point as targets."""
    shape = len(loads), len(machine.parameters.sensors)
    empty = Targets(loads, tuple(machine.parameters.sensors), np.ones(shape), np.ones(shape))
    amplitude = Evaluation(Experiment(machine, ()), parameter_map, empty)(
        np.array([point])
    ).amplitude[0]
    return replace(empty, amplitude=amplitude)


def test_values_depend_linearly_on_the_quantities(short, tmp_path):
    parameter_map = parameter_map_of(short, free_file(tmp_path, FREE + TABLE))
    drawn = parameter_map.base.frames
    made = parameter_map.parameters_at(np.array([40.0, 0.03, 5.5, 4000.0, 10.0]))
    assert made.damper_types["friction"].friction_force == 40.0
    assert made.frames["damper_left_housing"].position == (
        -0.03,
        *drawn["damper_left_housing"].position[1:],
    )
    assert made.frames["damper_right_rear_housing"].position[0] == 0.03
    assert made.bodies["motor"].mass == 5.5
    assert made.bodies["motor"].inertia.xx == pytest.approx(5.5 * 0.0024)
    assert made.bodies["motor"].inertia.yy == parameter_map.base.bodies["motor"].inertia.yy
    assert made.gasket.stiffness_x.force == pytest.approx((-130.0, 0.0, 130.0))
    assert made.gasket.stiffness_x.displacement == short.parameters.gasket.stiffness_x.displacement
    assert (
        parameter_map.parameters_at(parameter_map.expected).bodies["motor"].mass == 5.0
    )  # the base was not written into


def test_machine_with_explicit_values_is_that_of_the_sdf(short, tmp_path):
    parameter_map = parameter_map_of(short, free_file(tmp_path))
    one, other = short.set_up(), short.set_up(parameters=parameter_map.base)
    for name, damper in one.dampers.items():
        assert np.array_equal(damper.packed(), other.dampers[name].packed())
    masses = [short.plant.CalcTotalMass(setup.plant_context) for setup in (one, other)]
    assert masses[0] == masses[1]


MISFITS = {
    "no bounds": (FREE.replace("    bounds: (10, 60) N\n", ""), "vary.friction: a fit needs low and high; add"),
    "prior outside": (FREE.replace("(30, 10) N", "(70, 10) N"), "the expected value is outside the bounds"),
    "preload that is no force": (PRELOAD.replace(") N", ") kg") + FREE, "is not a pair of numbers such as '(2, 1) N'"),
    "unknown key": (FREE.replace("friction_force", "fricton_force"), "is not a number of the machine (did you mean"),
    "unknown frame": (FREE.replace("damper_left_housing", "damper_lft_housing"), "no frame 'damper_lft_housing'"),
    "unknown body": (FREE.replace("bodies.motor.mass", "bodies.motr.mass"), "no link 'motr'"),
    "wrong dimension": (
        FREE.replace("(10, 60) N", "(10, 60) kg").replace("(30, 10) N", "(30, 10) kg"),
        "needs a unit such as N, but kg is not of this kind",
    ),
    "factor for a table": (FREE + TABLE.replace('"(-30, 0, 30) mm"', '"(-30, 30) mm"'), "needs a list of 3 factors, not 2"),
    "factor of the wrong dimension": (FREE.replace("0.0024 m^2", "0.0024 m"), "but kg times m is not of this kind"),
}  # fmt: skip


@pytest.mark.parametrize("misfit", MISFITS)
def test_free_file_that_does_not_fit_the_machine_is_refused(misfit, short, tmp_path):
    text, message = MISFITS[misfit]
    with pytest.raises(InputError) as refused:
        mapped(short, tmp_path, text)
    assert message in str(refused.value)
    assert "free.yaml" in str(refused.value)


def measured(rows):
    return pd.DataFrame(
        rows, columns=["load", "gasket", "source", "Xr", "Yr", "Zr", "Xf", "Yf", "Zf"]
    )


def test_targets_are_the_rows_of_the_experiment(reference):
    rows = [
        ["middle", "no", "experiment", *range(1, 7)],
        ["middle", "no", "another model", *range(6)],
    ]
    targets = targets_of(reference, measured(rows))
    assert targets.loads == (("middle", False),)
    assert targets.amplitude == pytest.approx(np.arange(1, 7)[None] * 1e-3)


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ([["midle", "no", "experiment", *range(1, 7)]], "no load 'midle' in the machine (did you mean 'middle'?"),
        ([["back", "no", "experiment", *range(1, 7)]] * 2, "'back' occurs twice"),
        ([["back", "no", "experiment", *range(6)]], "not above 0"),
        ([["back", "no", "a model", *range(1, 7)]], "has no row of source 'experiment'"),
    ],
)  # fmt: skip
def test_targets_that_cannot_be_used_are_refused(rows, message, reference):
    with pytest.raises(InputError) as refused:
        targets_of(reference, measured(rows), "t.csv")
    assert message in str(refused.value)
    assert str(refused.value).startswith("t.csv")


def test_point_without_a_machine_is_nan_and_does_not_change_others(short, tmp_path):
    text = FREE.replace(
        "{bodies.motor.mass: 1, bodies.motor.inertia.xx: 0.0024 m^2}", "bodies.motor.mass"
    ).replace("(4, 6)", "(-6, 6)")
    parameter_map = parameter_map_of(short, free_file(tmp_path, text))
    points = np.array([[30.0, 0.0, 5.0], [30.0, 0.0, -5.0], [30.0, 0.0, 5.0]])
    values = Evaluation(Experiment(short, ()), parameter_map, one_case(short))(points)
    for array in (values.amplitude, values.power_mean, values.preload):
        assert np.isnan(array[1]).all()
        assert np.array_equal(array[0], array[2])
        assert np.isfinite(array[0]).all()


def test_point_whose_step_is_too_long_is_nan_and_the_first_start_is_refused(short, tmp_path):
    path = tmp_path / "free.yaml"
    path.write_text(
        "vary: {damping: {bounds: '(0, 300) N*s/mm', prior: '(200, 40) N*s/mm', source: test,"
        " sets: damper_types.friction.damping}}\n"
    )
    parameter_map = parameter_map_of(short, load_vary(path))
    evaluation = Evaluation(Experiment(short, ()), parameter_map, one_case(short))
    values = evaluation(np.array([[50.0], [200e3], [100.0]]))
    assert np.isfinite(values.amplitude).all(axis=(1, 2)).tolist() == [True, False, True]
    assert np.array_equal(values.amplitude[2], evaluation(np.array([[100.0]])).amplitude[0])
    targets = planted(short, parameter_map, [50.0], loads=(("middle", True),))
    plan = SearchPlan(starts=1, iterations=1)
    with pytest.raises(InputError, match="is too long for the tub"):
        calibrate(Experiment(short, ()), load_vary(path), targets, plan)


def test_point_that_only_the_gasket_holds_is_nan_for_loads_without_it(short, tmp_path):
    hooks = {f"frames.spring_{n}_housing.position.y": s for n, s in short.set_up().springs.items()}
    quantity = {"bounds": "(-20, 20) mm", "prior": "(0, 10) mm", "sets": dict.fromkeys(hooks, 1)}
    known = {
        f"hook_{number}": {"value": f"{spring.p_WH[1]} m", "sets": key, "source": "test"}
        for number, (key, spring) in enumerate(hooks.items())
    }
    tree = {"vary": {"forward": {**quantity, "source": "test"}}, "known": known}
    parameter_map = parameter_map_of(short, free_file(tmp_path, yaml_text(tree)))
    with_gasket = one_case(short)
    without = replace(with_gasket, loads=(("middle", False),))
    points = np.array([[0.0], [0.01]])
    for targets, finite in ((with_gasket, [True, True]), (without, [True, False])):
        amplitude = Evaluation(Experiment(short, ()), parameter_map, targets)(points).amplitude
        assert np.isfinite(amplitude).all(axis=(1, 2)).tolist() == finite


def test_preload_residuals_compare_with_the_prior(short, tmp_path):
    parameter_map = parameter_map_of(short, free_file(tmp_path, PRELOAD + FREE))
    points = np.array(
        [[30.0, 0.02, 5.0], [30.0, 0.02, 500.0]]
    )  # the second has a motor that no spring holds
    springs = short.set_up(parameters=parameter_map.parameters_at(points[0])).springs.values()
    expected = [(spring.preload - 100.0) / 20.0 for spring in springs]
    residuals = known_residuals(short, parameter_map, points)
    assert residuals[0] == pytest.approx(expected)
    assert np.isnan(residuals[1]).all()
    without = parameter_map_of(short, free_file(tmp_path, FREE))
    assert known_residuals(short, without, points).shape == (2, 0)


def one_case(machine):
    sensors = tuple(machine.parameters.sensors)
    ones = np.ones((1, len(sensors)))
    return Targets((("middle", True),), sensors, 0.01 * ones, ones)


def known_residuals(machine, parameter_map, points):
    found = Evaluation(Experiment(machine, ()), parameter_map, one_case(machine))(points)
    return parameter_map.prior_residuals(points, found.preload, found.elongation)


def test_expected_preload_is_prior_not_data(short, tmp_path):
    free = free_file(tmp_path, PRELOAD + FREE)
    targets = Targets((("middle", True),), ("Xr",) * 6, np.full((1, 6), 0.01), np.ones((1, 6)))
    with open_ledger(tmp_path / "ledger.sqlite", {"study": "test"}) as ledger:
        (found,) = calibrate(
            Experiment(short, (), kept_in(ledger)),
            free,
            targets,
            SearchPlan(starts=1, iterations=1),
        ).ended
    assert found.fit.linear.count == 6
    parameter_map = parameter_map_of(short, free)
    rows = known_residuals(short, parameter_map, found.point[None])[0]
    assert found.fit.linear.slopes.shape == (6 + len(rows) + 3, 3)
    assert found.prior_cost == pytest.approx(0.5 * (np.sum(rows**2) + np.sum(found.coordinates**2)))


def test_weights_go_by_load_by_sensor_and_by_both():
    targets = Targets(
        (("a", False), ("a", True), ("b", True)), ("X", "Y"), np.ones((3, 2)), np.ones((3, 2))
    )
    weight = targets.weighted({"a": 2.0, "Y": 3.0, "b:X": 0.0}).weight
    assert weight.tolist() == [[2.0, 6.0], [2.0, 6.0], [0.0, 3.0]]
    assert targets.weight.all()
    for key, factor, message in (
        ("c", 1.0, "'c' is no load"),
        ("a:Q", 1.0, "'a:Q' is no load"),
        ("a", -1.0, "must be >= 0"),
    ):
        with pytest.raises(InputError, match=message):
            targets.weighted({key: factor})


def limited_pair():
    targets = Targets(
        (("a", False), ("b", True)), ("X", "Y"), np.ones((2, 2)), np.array([[1.0, 1.0], [1.0, 0.0]])
    )
    return targets.limited({"amplitudes": 0.2, "X": 0.1, "b:X": 0.5})


def test_limit_that_fits_the_fewest_values_counts():
    assert limited_pair().limit_of_each().tolist() == [0.1, 0.2, 0.5]  # b:Y is not used
    assert np.isinf(limited_pair().limited({"b": 0.3}).limit_of_each()[:2]).all()


def test_excess_is_the_logarithm_beyond_the_limit_on_both_sides():
    spread = np.full((2, 2), 0.05)
    found = limited_pair().excesses(np.array([[1.2, 0.7], [1.4, 9.0]]), np.empty(0), spread)
    assert found == pytest.approx([np.log(1.2 / 1.1) / 0.05, np.log(0.7 / 0.8) / 0.05, 0.0])
    everything = limited_pair().limited({"amplitudes": 1.5})
    tiny = everything.excesses(np.full((2, 2), 1e-9), np.empty(0), spread)
    assert tiny.tolist() == [0.0, 0.0, 0.0]  # more than 100 % is no limit below


def test_values_beyond_their_limits_are_named():
    found = solution([0.0], [1.0], np.zeros((1, 1)), targets=limited_pair())
    found = replace(found, amplitude=np.array([[1.05, 0.7], [1.4, 9.0]]))
    assert found.values_beyond() == ["a without gasket Y -30 % (20 %)"]


def test_search_keeps_a_limit_that_the_cost_alone_does_not(short, tmp_path):
    free = free_file(tmp_path, FREE)
    parameter_map = parameter_map_of(short, free)
    targets = planted(short, parameter_map, parameter_map.expected, (("middle", True),))
    place = targets.sensors.index("Xr")
    targets.amplitude[0, place] *= 0.9  # no machine has this amplitude and the others
    errors = []
    for number, limits in enumerate(({}, {"Xr": 0.03})):
        with open_ledger(tmp_path / f"{number}.sqlite", {"study": "test"}) as ledger:
            (found,) = calibrate(
                Experiment(short, (), kept_in(ledger)),
                free,
                targets.limited(limits),
                SearchPlan(starts=1, iterations=20),
            ).ended
        errors.append(abs(found.errors[0, place]))
    assert errors[0] > 0.05
    assert errors[1] < 0.035


def test_gasket_effect_is_the_relative_change():
    amplitude = np.array([[2.0, 1.0], [3.0, 0.5], [9.0, 9.0]])
    targets = Targets(
        (("a", False), ("a", True), ("b", True)), ("X", "Y"), amplitude, np.ones((3, 2))
    )
    effects = targets.gasket_effects(amplitude)
    assert list(effects) == ["a"]
    assert effects["a"] == pytest.approx([0.5, -0.5])


IDENTITY = {"study": "calibration"}


@pytest.fixture(scope="module")
def recovered(short, tmp_path_factory):
    """Return a known machine and its calibration."""
    folder = tmp_path_factory.mktemp("calibration")
    free = free_file(folder)
    parameter_map = parameter_map_of(short, free)
    truth = parameter_map.expected + np.array([-0.7, 0.6, 0.9]) * parameter_map.deviation
    targets, plan = (
        planted(short, parameter_map, truth),
        SearchPlan(starts=2, seed=4, iterations=12, deviation=0.002, resolution=0.0),
    )
    with open_ledger(folder / "ledger.sqlite", IDENTITY) as ledger:
        experiment = Experiment(short, (), kept_in(ledger))
        calibration = calibrate(experiment, free, targets, plan)
        predictions = predict(experiment, free, calibration, [["middle"]])
        ledger.mark_finished()
    return truth, free, targets, plan, calibration, predictions, folder


def test_known_machine_is_recovered_within_its_standard_deviations(recovered):
    truth, _, _, _, calibration, _, _ = recovered
    best = calibration.solutions[0]
    parameter_map = calibration.parameter_map
    posterior = best.fit.remaining * parameter_map.deviation
    assert np.all(np.abs(best.point - truth) < 3.0 * posterior + 0.02 * parameter_map.deviation)
    assert np.nanmax(np.abs(best.errors)) < 0.01
    # friction and lean change the amplitudes; the mass of the motor hardly does
    assert np.all(best.fit.remaining[:2] < 0.2)
    assert np.sum(best.fit.linear.directions() > 1.0) >= 2


def test_start_values_of_the_free_file_are_not_used_for_predictions(short, recovered, tmp_path):
    truth, free, _, _, calibration, predictions, _ = recovered
    units = {"friction": "N", "lean": "m", "motor": "kg"}
    started = {
        name: entry.model_copy(update={"start": f"{value!r} {units[name]}"})
        for (name, entry), value in zip(free.vary.items(), truth.tolist(), strict=True)
    }
    started = free.model_copy(update={"vary": started})
    assert np.array_equal(parameter_map_of(short, started).start, truth)
    with open_ledger(tmp_path / "ledger.sqlite", IDENTITY) as ledger:
        experiment = Experiment(short, (), kept_in(ledger))
        (again,) = predict(experiment, started, calibration, [["middle"]])
    assert np.array_equal(again.amplitude, predictions[0].amplitude)


def test_held_out_loads_are_predicted_from_the_others(recovered):
    (prediction,) = recovered[5]
    assert prediction.loads == ("middle",)
    row = predictions_of([prediction]).isel(row=0)
    (kind,) = prediction.kinds()
    assert (row.held_out, row.what, row["values"]) == ("middle", "amplitudes", 6)
    assert row.predicted_mean == pytest.approx(np.abs(kind.predicted).mean())
    assert np.abs(kind.predicted).max() < 0.05
    assert not np.array_equal(kind.predicted, kind.calibrated)


def test_interrupted_calibration_continues_where_it_stopped(short, tmp_path, recovered):
    _, free, targets, plan, calibration, _, _ = recovered
    steps = []

    def stop(_fraction, _least):
        steps.append(1)
        if len(steps) > 2:
            raise KeyboardInterrupt

    path = tmp_path / "ledger.sqlite"
    with pytest.raises(KeyboardInterrupt), open_ledger(path, IDENTITY) as ledger:
        calibrate(Experiment(short, (), kept_in(ledger)), free, targets, plan, stop)
    with open_ledger(path, IDENTITY, resume=True) as ledger:
        assert len(ledger) > 5
        resumed = calibrate(Experiment(short, (), kept_in(ledger, 1)), free, targets, plan)
    # also: any number of workers
    assert quantities_of(resumed).identical(quantities_of(calibration))


def test_solved_machine_has_the_source_of_each_number(recovered):
    calibration = recovered[4]
    solved = solved_machine(calibration.solutions[0])
    value = f"{solved.damper_types['friction'].friction_force:.10g}"
    text = solved.sources["damper_types.friction.friction_force"]
    assert text.startswith(f"fit: friction {value} ± ")
    assert text.endswith("N (expected 30 ± 10 N)")
    assert solved.damper_types["friction"].friction_force == pytest.approx(
        calibration.solutions[0].point[0], abs=0.01
    )
    assert len(value) <= len("12.345")  # no digits that mean nothing
    assert solved.sources["gravity"]  # others are kept


def test_table_of_amplitudes_is_a_file_of_measured_amplitudes(recovered, short, tmp_path):
    path = tmp_path / "again.csv"
    table = LabelledTable(
        "", amplitudes_of(recovered[4]).to_dataset(name="amplitude"), across="sensor"
    )
    table.frame().to_csv(path, index=False)
    named = short.parameters.model_copy(update={"measured": (str(path),)})
    again, targets = targets_of(short.parameters, measured_amplitudes(named)), recovered[2]
    order = [again.loads.index(case) for case in targets.loads]
    assert again.amplitude[order] == pytest.approx(targets.amplitude)


ONE_VALUE = Targets((("a", True),), ("X",), np.array([[1.0]]), np.ones((1, 1)))


def solution(coordinates, amplitude, slopes, cost=1.0, targets=ONE_VALUE, unknowns=None):
    fit = fit_at(coordinates, slopes, unknowns)
    return Solution(None, targets, 0, fit, np.array([amplitude]), np.empty(0), cost, 0.0)


def test_distinct_solutions_are_good_and_far_apart():
    best, near, far, bad = (
        solution(at, [1.0 + error], [[1.0, 0.0]], cost)
        for at, error, cost in (
            ([0, 0], 0.1, 1.0),
            ([0.1, 0], 0.1, 1.1),
            ([2, 0], 0.11, 1.2),
            ([-2, 0], 0.5, 9.0),
        )
    )
    assert distinct([bad, far, near, best]) == [best, far]


KNOWN = """
known:
  slope:
    value: 3 N/mm
    sets: {gasket.stiffness_x.force: "(-30, 0, 30) mm"}
    source: data sheet
"""


def test_known_quantities_enter_like_free_ones(short, tmp_path):
    hardening = TABLE[TABLE.index("  hardening") :]
    parameter_map = parameter_map_of(short, free_file(tmp_path, KNOWN + FREE + hardening))
    made = parameter_map.parameters_at(np.array([40.0, 0.03, 5.5, 10.0]))
    assert made.gasket.stiffness_x.force == pytest.approx((-100.0, 0.0, 100.0))
    found = solution([0.0] * 4, [1.0], np.zeros((1, 4)), unknowns=parameter_map.unknowns)
    found = replace(found, parameter_map=parameter_map)
    text = solved_machine(found).sources["gasket.stiffness_x.force"]
    assert text.startswith("fit: hardening 20 ± 20 N (expected 20 ± 20 N); assumption: ")
    assert text.endswith("slope 3 N/mm (data sheet)")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (KNOWN.replace("slope", "friction") + FREE, "'friction' is in vary and in known"),
        (KNOWN.replace("3 N/mm", "3 kg") + FREE, "known.slope: 'gasket.stiffness_x.force'"),
        (KNOWN.replace("3 N/mm", "(3, 4) N/mm") + FREE, "it must be one number with a unit"),
    ],
)
def test_wrong_known_quantities_are_refused(short, tmp_path, text, message):
    with pytest.raises(InputError) as refused:
        mapped(short, tmp_path, text)
    assert message in str(refused.value)


def test_slack_springs_are_residuals(short, tmp_path):
    limits = "spring_elongation: {at_least: '(100, 2) mm', source: test}\n"
    parameter_map = parameter_map_of(short, free_file(tmp_path, limits + FREE))
    points = parameter_map.expected[None]
    elongation = Evaluation(Experiment(short, ()), parameter_map, one_case(short))(
        points
    ).elongation
    assert ((elongation > -0.02) & (elongation < 0.05)).all()
    residuals = known_residuals(short, parameter_map, points)
    assert residuals == pytest.approx((0.1 - elongation) / 0.002)
    enough = parameter_map_of(short, free_file(tmp_path, limits.replace("100", "-90") + FREE))
    assert not known_residuals(short, enough, points).any()
