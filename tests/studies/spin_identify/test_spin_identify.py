"""Identification from vibrations of the whole machine: known and undetermined numbers, command."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from lab_writers import write_mdf
from made_up_runs import made_up

from wm_drake.errors import InputError
from wm_drake.model.build import build_machine
from wm_drake.parameters import Entry, SpinProfile, load_machine, load_profile, with_value
from wm_drake.parameters.recorded_sensors import recorded_test_of
from wm_drake.parameters.spin import Region
from wm_drake.parameters.unbalance_cases import load_unbalance_cases
from wm_drake.simulation.cases import Case
from wm_drake.simulation.recorded_signal import recorded_signal
from wm_drake.simulation.runs import simulate
from wm_drake.studies.calibrate.blocks import calibrated
from wm_drake.studies.calibrate.fit_page import FitWords, summary, warnings_of
from wm_drake.studies.fitting.free_numbers import free_numbers
from wm_drake.studies.spin_identify.study import (
    planted_values,
    spin_model,
    with_virtual_experiment,
)

PROFILE = SpinProfile(
    time=(0.0, 5.0),
    speed=(8.0, 30.0),
    regions=tuple(Region(name=f"R{k + 1}", begin=1.0 * k, end=1.0 * k + 1.0) for k in range(5)),
)
CASES = tuple(load_unbalance_cases()[1:5:3])  # 400 g in front, at the rear
KEYS = (
    ("gasket.stiffness_x",),
    ("gasket.stiffness_y", "gasket.stiffness_z"),
    ("gasket.damping_x",),
)


LINEAR = (
    "extends: reference\ngasket: {stiffness_x: 4 N/mm, stiffness_y: 4 N/mm, stiffness_z: 4 N/mm}\n"
)


def unknowns(machine, *every):
    return free_numbers(machine, {"+".join(k): Entry(keys=k) for k in every}, "identified")


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """Return the reference machine with numbers in place of tables."""
    path = tmp_path_factory.mktemp("machine") / "linear.yaml"
    path.write_text(LINEAR)
    return load_machine(path)


def model_of(reference, seen):
    """Return a model with a known answer: the last number changes the displacements only if `seen`."""
    waves = np.sin(np.arange(3 * 2 * 5 * 9).reshape(3, 2, 5, 3, 3) ** 1.3)

    def regions(cases):
        rows = []
        for number, case in enumerate(cases):
            gasket = case.parameters.gasket
            assert gasket.stiffness_y == gasket.stiffness_z
            numbers = (
                gasket.stiffness_x / 4e3,
                gasket.stiffness_y / 4e3,
                (gasket.damping_x / 19.0 if seen else 1.0),
            )
            here = waves[:, number % len(CASES)]
            rows.append(2.0 + sum(here[k] * value**0.5 for k, value in enumerate(numbers)))
        dims = ("run", "region", "accelerometer", "axis")
        return xr.Dataset({"region_displacement": (dims, 1e-3 * np.abs(rows))})

    return spin_model(made_up(regions, reference), unknowns(reference, *KEYS), PROFILE, CASES)


def planted_in(model, seed, noise=0.0):
    """Return planted values, and the model of their virtual experiment."""
    planted = planted_values(model.free, seed)
    return planted, with_virtual_experiment(model, planted, noise, seed)


def summary_of(model, fit, data):
    """Return what the page says first, and its warnings."""
    words = FitWords("", "", "cases", "displacements", "", "")
    return summary(model, fit, data, words), warnings_of(model, fit, data)


def test_true_numbers_are_recovered_and_differ_from_the_machines(reference):
    planted, model = planted_in(model_of(reference, seen=True), seed=3)
    starts = np.array([unknown.start for unknown in model.unknowns])
    assert np.abs(planted / starts - 1.0).min() > 0.03
    fit, found = calibrated(model, 0, starts=1)
    np.testing.assert_allclose(fit.values, planted, rtol=1e-4)
    assert all(estimate.determined for estimate in fit.estimates)
    missed = model.missed(found)
    assert missed["after"] < 1e-5 < missed["before"]


def test_numbers_that_the_data_do_not_determine_are_named(reference):
    planted, model = planted_in(model_of(reference, seen=False), seed=4, noise=1e-3)
    fit, _ = calibrated(model, 0, starts=1)
    assert [estimate.determined for estimate in fit.estimates] == [True, True, False]
    assert np.abs(fit.values / planted - 1.0)[:2].max() < 0.02
    assert any("gasket.damping_x" in direction.names for direction in fit.undetermined)
    machine = model.free.solved(fit, "virtual experiment: identified")
    assert machine.name == "reference_identified"
    assert machine.gasket.stiffness_x == fit["gasket.stiffness_x"].value
    assert machine.gasket.damping_x == reference.gasket.damping_x
    assert "virtual experiment: identified" in machine.sources["gasket.stiffness_z"]
    assert machine.sources.get("gasket.damping_x") == reference.sources.get("gasket.damping_x")


def test_verdict_is_that_of_the_displacements_not_of_the_intervals(reference):
    """Fit a model that cannot reproduce the measurement: it still determines its numbers."""
    _, model = planted_in(model_of(reference, seen=True), seed=3)
    text, warnings = summary_of(model, *calibrated(model, 0, starts=1))
    assert text.startswith("Good fit to cases")
    assert not warnings
    signs = np.sin(7.0 * np.arange(model.measured.size)).reshape(model.measured.shape)
    other = replace(model, measured=model.measured * (1.0 + 0.6 * signs))
    fit, data = calibrated(other, 0, starts=1)
    text, warnings = summary_of(other, fit, data)
    assert other.missed(data)["after"] > 0.15
    assert np.sqrt(np.mean(data.misfit.values**2)) == pytest.approx(fit.rmse)
    assert text.startswith("Poor fit")
    assert len(warnings) == 1


def test_noise_widens_intervals(reference):
    model = model_of(reference, seen=True)
    fits = [calibrated(planted_in(model, 5, noise)[1], 0, starts=1)[0] for noise in (1e-3, 1e-2)]
    widths = np.array([[e.upper - e.lower for e in fit.estimates] for fit in fits])
    assert (widths[1] > 3.0 * widths[0]).all()


def test_numbers_that_are_one_unknown_change_together(reference):
    free = unknowns(reference, ("gasket.stiffness_x", "gasket.stiffness_z"))
    changed = free.parameters_at(np.array([5e3]))
    assert (changed.gasket.stiffness_x, changed.gasket.stiffness_z) == (5e3, 5e3)
    assert changed == with_value(
        with_value(reference, "gasket.stiffness_x", 5e3), "gasket.stiffness_z", 5e3
    )


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        (("gasket.stifness_x",), "unknown key 'stifness_x' .did you mean 'stiffness_x'"),
        (("gasket.stiffness_x", "gasket.damping_x"), "have different units"),
        (("gasket.friction_torque_x",), "is not positive, so its range must be given"),
    ],
)  # fmt: skip
def test_bad_unknowns_are_refused(reference, keys, message):
    with pytest.raises(InputError, match=message):
        unknowns(reference, keys)


@pytest.fixture
def identify(wm_drake):
    def run(*arguments):
        text = "time: (0, 4) s\nspeed: (80, 300) rpm\nregions: [{name: A, begin: 0 s, end: 2 s}, {name: B, begin: 2 s, end: 4 s}]\n"
        Path("p.yaml").write_text(text)
        Path("linear.yaml").write_text(LINEAR)
        common = "--machine linear.yaml --profile p.yaml --case 2 --case 5 --out out"
        return wm_drake(f"study spin-identify {common}", *arguments)

    return run


def test_command_recovers_the_true_numbers(identify):
    unknowns = (
        "--unknown",
        "gasket.stiffness_x+gasket.stiffness_z=(2, 8) N/mm",
        "--unknown",
        "gasket.stiffness_y",
    )
    ended = identify("--json", "--noise", "0", *unknowns)
    assert (ended.code, len(ended.out.splitlines())) == (0, 1)
    shown = json.loads(ended.out)
    (numbers,) = shown["numbers"]
    assert numbers["is_virtual_experiment"] is True
    for entry in shown["estimates"]:
        assert entry["value"] == pytest.approx(entry["planted"], rel=0.02)
    assert numbers["average_error_after_percent"] < 0.1 < numbers["average_error_before_percent"]
    written = load_machine("out/identified.yaml")
    table = pd.read_csv("out/estimates.csv").set_index("unknown")
    assert list(table.index) == ["gasket.stiffness_x+gasket.stiffness_z", "gasket.stiffness_y"]
    for name in table.index:
        for key in name.split("+"):
            value = getattr(written.gasket, key.removeprefix("gasket."))
            assert table.value[name] == pytest.approx(1e-3 * value, rel=1e-5)
        assert table.lower_95[name] <= table.value[name] <= table.upper_95[name]
        assert table.unit[name] == "N/mm"
    assert written.name == "reference_identified"
    real = identify("--json", "--measured", "out/measured.csv", "--overwrite", *unknowns)
    told = json.loads(real.out)
    assert told["numbers"][0]["is_virtual_experiment"] is False
    for entry, other in zip(told["estimates"], shown["estimates"], strict=True):
        assert "planted" not in entry
        assert entry["value"] == pytest.approx(other["value"], rel=1e-3)


CYCLE = """time: (0, 16) s
speed: (80, 300) rpm
regions: [{name: A, begin: 2 s, end: 6 s}, {name: B, begin: 6 s, end: 10 s}, {name: C, begin: 10 s, end: 14 s}]
"""


@pytest.mark.slow
def test_a_recorded_case_gives_the_planted_number(wm_drake):
    Path("p.yaml").write_text(CYCLE)
    Path("linear.yaml").write_text(LINEAR)
    parameters = load_machine("linear.yaml")
    machine = build_machine(with_value(parameters, "gasket.stiffness_y", 4800.0))
    load = next(case for case in load_unbalance_cases() if case.name == "2").load(parameters)
    record = simulate(machine, Case("2", load, load_profile("p.yaml")))
    points = machine.set_up().accelerometer_points
    channels = {
        name: (recorded_signal(record, sensor, points[name[:2]]), "m/s^2")
        for name, sensor in recorded_test_of(parameters).sensors.items()
        if name[:2] in points
    }
    write_mdf(Path("run_2.mf4"), record.time.values, channels)
    words = [
        "study",
        "spin-identify",
        "--machine",
        "linear.yaml",
        "--profile",
        "p.yaml",
        "--out",
        "out",
        "--json",
    ]
    sought = ("--unknown", "gasket.stiffness_y=(3, 6) N/mm")
    ended = wm_drake(*words, "--record", "2=run_2.mf4", *sought)
    assert ended.code == 0, ended.err
    estimate = json.loads(ended.out)["estimates"][0]
    assert estimate["value"] == pytest.approx(4.8, rel=0.03)
    assert load_machine("out/identified.yaml").gasket.stiffness_y == pytest.approx(
        1e3 * estimate["value"], rel=1e-3
    )
    write_mdf(Path("copy.mf4"), record.time.values, channels)
    copied = ("--record", "2=run_2.mf4", "--record", "5=copy.mf4")
    other = wm_drake(*words, *copied, *sought, "--overwrite")
    assert other.code == 2
    assert "copy.mf4: has the same samples as run_2.mf4" in other.err
    other = wm_drake(*words, "--record", "9q=run_2.mf4", *sought, "--overwrite")
    assert other.code == 2
    assert "--record: unknown case '9q'" in other.err
