"""Damping of the gasket: known values are recovered."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from wm_drake.batch import simulate_many
from wm_drake.errors import InputError
from wm_drake.model.build import build_machine
from wm_drake.parameters import SpinProfile
from wm_drake.simulation.cases import Case
from wm_drake.simulation.runs import simulate
from wm_drake.studies.fitting.assessment import assess
from wm_drake.studies.fitting.fit import SearchLog
from wm_drake.studies.fitting.methods import identify
from wm_drake.studies.fitting.problem import Measurement, Unknown
from wm_drake.studies.fitting.search import Search, descended
from wm_drake.studies.gasket_damping.study import (
    NOISE,
    STARTS,
    UPPER,
    DistanceProblem,
    as_measured,
    damping_numbers,
    envelope_model,
    grid_of_paper,
    run_up_of,
)

TRUTH = np.array([28.7, 4.98])  # N s/m, N m s/rad


@pytest.fixture(scope="module")
def fast(reference):
    """Return the reference machine with five times the rate of its run-up.

    The resonances are between 10 and 20 s; the rest is steady, and `shorten` leaves it out.
    """
    profile = SpinProfile(time=(0.0, 8.0, 25.0, 50.0), speed=(0.0, 8.0, 30.0, 30.0))
    return reference.model_copy(update={"profile": profile})


def shorten(patch):
    """Compare records at the resonances of `fast` only."""
    patch.setattr("wm_drake.studies.gasket_damping.study.WINDOW", (9.0, 21.0))
    patch.setattr("wm_drake.studies.gasket_damping.study.AFTER", 2.0)


@pytest.fixture(scope="module")
def records(fast):
    """Return the displacements of the machine with the true damping, in the short window."""
    with pytest.MonkeyPatch.context() as patch:
        shorten(patch)
        profile = run_up_of(fast)
    assert profile.duration == 23.0
    planted = damping_numbers(fast).parameters_at(TRUTH)
    machine = build_machine(planted)
    return {
        load: simulate(machine, Case(load, planted.loads[load], profile)).displacement
        for load in ("middle", "counter")
    }


@pytest.fixture
def short_problem(fast, monkeypatch):
    """Return the function that returns the problem of records in the short window."""
    shorten(monkeypatch)
    machine = build_machine(fast)
    return lambda measured: envelope_model(machine, measured).problem()


@pytest.fixture
def distance(short_problem, records):
    """Return the distance of [B] at points (k, 2). [N s/m, N m s/rad -> mm]"""
    plain = short_problem(records)
    problem = DistanceProblem(plain.unknowns, plain.measurements, plain.evaluate)

    def at(points):
        coordinates = problem.coordinates_of(np.array(points))
        return 1e3 * problem.costs_of(problem.residuals(coordinates))

    return at


def test_distance_is_the_sum_over_the_loads_of_norms_over_both_envelopes():
    problem = DistanceProblem(
        (Unknown("a", -1.0, 1.0),),
        tuple(Measurement(name, np.array(values)) for name, values in {
            "one, X": [3.0, 0.0], "one, Y": [0.0, 4.0], "two, X": [1.0, 0.0]}.items()),
        lambda points: np.zeros((len(points), 6)),
    )  # fmt: skip
    here = np.zeros((1, 1))
    norms = np.sqrt(2.0) * (5.0 + 1.0)
    assert problem.costs_of(problem.residuals(here))[0] == pytest.approx(norms)
    failed = DistanceProblem(
        problem.unknowns, problem.measurements, lambda points: np.full((len(points), 6), np.nan)
    )
    assert failed.costs_of(failed.residuals(here))[0] == np.inf


def test_distance_is_zero_at_the_true_damping_and_grows_away_from_it(distance):
    steps = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [0.0, 0.2], [0.0, 0.4]])
    here, *others = distance([TRUTH + step for step in steps])
    assert here == pytest.approx(0.0, abs=1e-6)
    near_linear, far_linear, near_torsional, far_torsional = others
    assert 0.1 < near_linear < far_linear
    assert 0.1 < near_torsional < far_torsional


def test_value_does_not_depend_on_the_other_points(distance):
    points = [0.0 * UPPER, UPPER, TRUTH + 1.0]
    assert distance(points)[2] == pytest.approx(distance([points[2]])[0], rel=1e-9)


def with_noise(records, seed):
    rng = np.random.default_rng(seed)
    return {
        load: record + rng.normal(scale=NOISE, size=record.shape)
        for load, record in records.items()
    }


def test_fit_and_grids_find_the_true_damping(short_problem, records):
    """Repeat with one pair, one load and the resonances only."""
    problem = short_problem(with_noise({"counter": records["counter"]}, 1))
    fit = identify(problem, starts=STARTS, screened=8)
    assert fit.values == pytest.approx(TRUTH, rel=0.02)
    for estimate, true in zip(fit.estimates, TRUTH, strict=True):
        assert estimate.lower < true < estimate.upper
    grids = grid_of_paper(problem, 0.002)
    best = grids.isel(point=int(grids.objective.argmin("point")))
    assert [best.C_L.item(), best.C_T.item()] == pytest.approx(TRUTH, rel=0.02)
    assert set(grids.spacing.values) <= {0.25 * 0.5**k for k in range(8)}


@pytest.mark.hours
def test_intervals_hold_the_planted_damping(short_problem, records):
    """Count 40 intervals of 95 %: by chance fewer than 34 hold in 1 of 300 experiments."""
    held = 0
    for seed in range(20):
        problem = short_problem(with_noise(records, seed))
        end = descended(Search(problem), problem.coordinates_of(1.05 * TRUTH))
        fit = assess(problem, end.point, SearchLog("from beside the truth"))
        held += sum(e.lower < t < e.upper for e, t in zip(fit.estimates, TRUTH, strict=True))
    assert held >= 34


def test_measured_records_are_interpolated_to_samples_every_5_ms():
    time = np.arange(0.0, 60.0, 0.002)
    record = xr.DataArray(
        np.column_stack([time, 2.0 * time]),
        {"time": time, "sensor": ["a", "b"]},
        ["time", "sensor"],
    )
    put = as_measured(record, ["b", "a"], "file")
    assert np.diff(put.time.values) == pytest.approx(0.005)
    assert put.sel(sensor="b").values == pytest.approx(2.0 * put.time.values, abs=1e-6)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda r: r.isel(time=slice(0, 100)), "must cover 10 to 50 s"),
        (lambda r: r.where(r.time != 20.0), "lacks a displacement at 19.505 s"),
        (lambda r: r.isel(time=slice(None, None, -1)), "must cover"),
        (lambda r: r.sel(sensor=["a"]), "has no sensor b"),
    ],
)
def test_faulty_records_are_refused(change, message):
    time = np.arange(0.0, 60.0, 0.5)
    record = xr.DataArray(
        np.zeros((len(time), 2)), {"time": time, "sensor": ["a", "b"]}, ["time", "sensor"]
    )
    with pytest.raises(InputError, match=f"file: .*{message}"):
        as_measured(change(record), ["a", "b"], "file")


def test_short_profile_is_refused(reference):
    short = reference.model_copy(
        update={"profile": SpinProfile(time=(0.0, 30.0), speed=(0.0, 30.0))}
    )
    with pytest.raises(InputError, match="ends at 30 s"):
        run_up_of(short)


ENGINES = 1e-3
"""Relative difference of peaks between the two engines at their default steps (tested)."""


@pytest.mark.hours
def test_command_recovers_its_virtual_experiment_and_names_it_so(wm_drake):
    ended = wm_drake("study", "gasket-damping", "--mesh", "0.1", "--out", "out", "--json")
    assert ended.code == 0
    assert "The Drake engine runs a virtual experiment" in ended.err
    printed = json.loads(ended.out)
    for row in printed["estimates"]:
        assert row["value"] == pytest.approx(row["planted"], rel=0.02)
        # the engines differ by 1e-3
        assert row["lower_95"] < row["planted"] * (1.0 + ENGINES)
        assert row["upper_95"] > row["planted"] * (1.0 - ENGINES)
    best = min(printed["objective"], key=lambda row: row["objective_mm"])
    for row, name in zip(printed["estimates"], ("C_L_Ns_per_mm", "C_T_Nmms_per_deg"), strict=True):
        assert best[name] == pytest.approx(row["planted"], rel=0.02)
    assert "virtual experiment" in Path("out/report.html").read_text()
    assert len(pd.read_csv("out/objective.csv")) == len(printed["objective"])


@pytest.mark.slow
def test_damping_is_found_from_record_files(wm_drake, reference, machine):
    planted = damping_numbers(reference).parameters_at(
        np.array([28.7, np.rad2deg(0.087)])
    )  # N s/m, N m s/rad: 0.0287 N s/mm, 87 N mm s/deg
    records = {load: run_of(machine, planted, load) for load in ("middle", "counter")}
    records["middle"].to_netcdf("middle.nc")
    in_mm = 1e3 * records["counter"].displacement.to_pandas()
    in_mm.rename_axis(index="time_s").to_csv("counter.csv")
    files = "--record middle=middle.nc --record counter=counter.csv"
    ended = wm_drake(f"study gasket-damping {files} --out out --json")
    assert (ended.code, "virtual" in ended.err) == (0, False)
    printed = json.loads(ended.out)
    values = [row["value"] for row in printed["estimates"]]
    assert values == pytest.approx([0.0287, 87.0], rel=0.005)
    assert "planted" not in printed["estimates"][0]
    assert "virtual experiment" not in Path("out/report.html").read_text()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("planted", "rounds", "off"),
    [((28.7, 0.087), 4, (-0.020, 0.006)), ((12.0, 0.14), 2, (0.042, 0.071))],
)
def test_the_rule_of_the_paper_ends_beside_the_planted_damping(
    reference, machine, planted, rounds, off
):
    """Repeat the figures of docs/theory/fits.md, which `--paper-mesh` prints."""
    truth = np.array([planted[0], np.rad2deg(planted[1])])  # N s/m, N m s/rad
    numbers = damping_numbers(reference).parameters_at(truth)
    records = {load: run_of(machine, numbers, load).displacement for load in ("middle", "counter")}
    grids = grid_of_paper(envelope_model(machine, records).problem(), None)
    assert grids["round"].max() == rounds
    best = grids.isel(point=int(grids.objective.argmin("point")))
    found = np.array([best.C_L.item(), best.C_T.item()])
    assert np.abs(found / truth - 1.0) == pytest.approx(np.abs(off), abs=1e-3)


def run_of(machine, parameters, load):
    """Return the record of a run of the built machine with other numbers."""
    cases = [Case(load, parameters.loads[load], parameters.profile, parameters=parameters)]
    ended = []
    simulate_many(machine, cases, histories=True, finished=ended.append)
    return ended[0].record
