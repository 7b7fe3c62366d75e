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
from wm_drake.studies.fitting.search import Optimum
from wm_drake.studies.gasket_damping.page import summary
from wm_drake.studies.gasket_damping.study import (
    LOWER,
    NOISE,
    UPPER,
    EnvelopeModel,
    GasketDamping,
    as_measured,
    damping_problem,
    identify_damping,
    run_up_of,
    with_damping,
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
    planted = with_damping(fast, TRUTH)
    machine = build_machine(planted)
    return {
        load: simulate(machine, Case(load, planted.loads[load], profile)).displacement
        for load in ("middle", "counter")
    }


@pytest.fixture
def distance(fast, records, monkeypatch):
    """Return the distance at points (k, 2). [N s/m, N m s/rad -> mm]"""
    shorten(monkeypatch)
    problem = damping_problem(EnvelopeModel(build_machine(fast), records))
    return lambda points: problem.costs(problem.evaluate(np.array(points)), np.array(points))


def test_distance_is_zero_at_the_true_damping_and_grows_away_from_it(distance):
    steps = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [0.0, 0.2], [0.0, 0.4]])
    here, *others = distance([TRUTH + step for step in steps])
    assert here == pytest.approx(0.0, abs=1e-6)
    near_linear, far_linear, near_torsional, far_torsional = others
    assert 0.1 < near_linear < far_linear
    assert 0.1 < near_torsional < far_torsional


def test_value_does_not_depend_on_the_other_points(distance):
    points = [LOWER, UPPER, TRUTH + 1.0]
    assert distance(points)[2] == pytest.approx(distance([points[2]])[0], rel=1e-9)


def si(pair):
    """Return C_L and C_T in SI units. [N s/m, N m s/rad]"""
    return np.array([1e3 * pair[0], 1e-3 * np.rad2deg(pair[1])])


def with_noise(records, seed):
    rng = np.random.default_rng(seed)
    return {
        load: record + rng.normal(scale=NOISE, size=record.shape)
        for load, record in records.items()
    }


def test_both_searches_find_the_true_damping(fast, records, monkeypatch):
    """Repeat with one pair, one load and the resonances only."""
    shorten(monkeypatch)
    one = {"counter": records["counter"]}
    result = identify_damping(build_machine(fast), with_noise(one, 1), TRUTH, 0.002)
    assert result.searches_agree
    assert result.better.cost == min(result.grid.cost, result.scipy.cost)
    assert result.better.point == pytest.approx(TRUTH, rel=0.02)
    assert result.grid.point == pytest.approx(TRUTH, rel=0.02)


def test_better_search_is_reported_and_disagreement_is_stated(reference):
    near, far = Optimum(si((0.019, 60.0)), 0.02, 60), Optimum(si((0.025, 50.0)), 95.7, 33)
    result = GasketDamping(reference, far, near, {"middle": None}, (), near.point)
    assert result.better is near
    assert not result.searches_agree
    text = summary(result)
    assert text.index("C_L = 0.0190 N s/mm and C_T = 60.0 N mm s/deg") < text.index("0.0250")
    assert "disagree" in text
    assert GasketDamping(reference, near, far, {"middle": None}).better is near
    close = Optimum(near.point + 0.009 * (UPPER - LOWER), 0.5, 10)
    assert GasketDamping(reference, near, close, {"middle": None}).searches_agree


def test_measured_records_are_interpolated_to_samples_every_5_ms():
    time = np.arange(0.0, 60.0, 0.002)
    record = xr.DataArray(
        np.column_stack([time, 2.0 * time]),
        {"time": time, "sensor": ["a", "b"]},
        ["time", "sensor"],
    )
    put = as_measured(record, ["b", "a"], "file")
    assert np.diff(put.time.values) == pytest.approx(0.005)
    assert put.sel(sensor="b").values == pytest.approx(2.0 * put.time.values)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda r: r.isel(time=slice(0, 100)), "must cover 10 to 50 s"),
        (lambda r: r.where(r.time != 20.0), "not a finite number"),
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
    ended = wm_drake("study", "gasket-damping", "--out", "out", "--json")
    assert ended.code == 0
    assert "The Drake engine runs a virtual experiment" in ended.err
    printed = json.loads(ended.out)
    assert printed["virtual_experiment"] is True
    assert printed["scipy"]["C_L"] == pytest.approx(printed["planted"]["C_L"], rel=0.05)
    assert printed["scipy"]["C_T"] == pytest.approx(printed["planted"]["C_T"], rel=0.05)
    assert printed["searches_agree"] is True
    assert printed["best"]["objective_mm"] == min(
        printed[name]["objective_mm"] for name in ("grid", "scipy")
    )
    assert printed["grid"]["mesh_percent"] <= 0.1
    for name in ("C_L", "C_T"):
        assert printed["grid"][name] == pytest.approx(printed["planted"][name], rel=0.02)
        low, high = printed["interval_95"][name]
        # the records have no noise, so the interval is narrower than the difference of the engines
        planted = printed["planted"][name]
        assert low < planted * (1.0 + ENGINES)
        assert high > planted * (1.0 - ENGINES)
        assert low < printed["scipy"][name] < high
    page = Path("out/report.html").read_text()
    assert "virtual experiment" in page
    assert len(pd.read_csv("out/objective.csv")) == printed["grid"]["evaluations"]


@pytest.mark.slow
def test_damping_is_found_from_record_files(wm_drake, reference, machine):
    planted = with_damping(
        reference, np.array([28.7, np.rad2deg(0.087)])
    )  # N s/m, N m s/rad: 0.0287 N s/mm, 87 N mm s/deg
    records = {load: run_of(machine, planted, load) for load in ("middle", "counter")}
    records["middle"].to_netcdf("middle.nc")
    in_mm = 1e3 * records["counter"].displacement.to_pandas()
    in_mm.rename_axis(index="time_s").to_csv("counter.csv")
    files = "--record middle=middle.nc --record counter=counter.csv"
    ended = wm_drake(f"study gasket-damping {files} --mesh 20 --out out --json")
    assert (ended.code, "virtual" in ended.err) == (0, False)
    printed = json.loads(ended.out)
    assert (printed["virtual_experiment"], printed["planted"]) == (False, None)
    assert printed["best"]["C_L"] == pytest.approx(0.0287, rel=0.005)
    assert printed["best"]["C_T"] == pytest.approx(87.0, rel=0.005)
    assert printed["scipy"]["C_L"] == pytest.approx(0.0287, rel=0.01)
    assert printed["scipy"]["C_T"] == pytest.approx(87.0, rel=0.01)
    assert "virtual experiment" not in Path("out/report.html").read_text()


def run_of(machine, parameters, load):
    """Return the record of a run of the built machine with other numbers."""
    cases = [Case(load, parameters.loads[load], parameters.profile, parameters=parameters)]
    ended = []
    simulate_many(machine, cases, histories=True, finished=ended.append)
    return ended[0].record
