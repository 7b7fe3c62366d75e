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
from wm_drake.studies.gasket_damping.study import (
    LOWER,
    UPPER,
    EnvelopeDistance,
    as_measured,
    identify_damping,
    with_damping,
)

TRUTH = np.array([28.7, 4.98])  # N s/m, N m s/rad


@pytest.fixture(scope="module")
def fast(reference):
    """The reference machine with five times the rate of its run-up.

    The resonances are between 10 and 20 s; the rest is steady.
    """
    profile = SpinProfile(time=(0.0, 8.0, 25.0, 50.0), speed=(0.0, 8.0, 30.0, 30.0))
    return reference.model_copy(update={"profile": profile})


@pytest.fixture(scope="module")
def distance(fast):
    cases = EnvelopeDistance(fast, {}).profile
    planted = with_damping(fast, TRUTH)
    machine = build_machine(planted)
    records = {
        load: simulate(machine, Case(load, planted.loads[load], cases)).displacement
        for load in ("middle", "counter")
    }
    return EnvelopeDistance(fast, records)


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


@pytest.mark.slow
def test_true_damping_is_found_from_noisy_records(fast, distance):
    rng = np.random.default_rng(1)
    noisy = {
        load: record + rng.normal(scale=1e-4, size=record.shape)
        for load, record in distance.measured.items()
    }
    found = identify_damping(fast, noisy, TRUTH)
    assert found.scipy.best == pytest.approx(
        TRUTH, rel=0.03
    )  # noise widens envelopes, which reads as less damping
    spacing = (UPPER - LOWER) / 4.0 / 2.0 ** (len(found.grid.rounds) - 1)
    assert np.all(np.abs(found.grid.best - TRUTH) <= spacing)
    assert found.scipy.value <= found.grid.value


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
        EnvelopeDistance(short, {})


@pytest.mark.slow
def test_command_recovers_its_virtual_experiment_and_names_it_so(wm_drake):
    ended = wm_drake("study", "gasket-damping", "--out", "out", "--json")
    assert ended.code == 0
    assert "The Drake engine runs a virtual experiment" in ended.err
    printed = json.loads(ended.out)
    assert printed["virtual_experiment"] is True
    assert printed["scipy"]["C_L"] == pytest.approx(printed["planted"]["C_L"], rel=0.05)
    assert printed["scipy"]["C_T"] == pytest.approx(printed["planted"]["C_T"], rel=0.05)
    for name, size in (("C_L", 0.05), ("C_T", 200.0)):
        spacing = size / 4.0 / 2.0 ** (printed["grid"]["rounds"] - 1)
        assert abs(printed["grid"][name] - printed["planted"][name]) <= spacing
        low, high = printed["interval_95"][name]
        assert low < printed["planted"][name] < high
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
    ended = wm_drake(
        "study",
        "gasket-damping",
        "--record",
        "middle=middle.nc",
        "--record",
        "counter=counter.csv",
        "--out",
        "out",
        "--json",
    )
    assert (ended.code, "virtual" in ended.err) == (0, False)
    printed = json.loads(ended.out)
    assert (printed["virtual_experiment"], printed["planted"]) == (False, None)
    assert printed["scipy"]["C_L"] == pytest.approx(0.0287, rel=0.01)
    assert printed["scipy"]["C_T"] == pytest.approx(87.0, rel=0.01)
    assert "virtual experiment" not in Path("out/report.html").read_text()


def run_of(machine, parameters, load):
    """Return the record of a run of the built machine with other numbers."""
    cases = [Case(load, parameters.loads[load], parameters.profile, parameters=parameters)]
    ended = []
    simulate_many(machine, cases, histories=True, finished=ended.append)
    return ended[0].record


def test_faults_of_the_command_are_refused(wm_drake):
    Path("r.csv").write_text("time_s,Xr\n0,1\n")
    for arguments, message in (
        (("--record", "r.csv"), "does not have the form LOAD=FILE with a load of the machine"),
        (("--record", "middle=nosuch.csv"), "no such file 'nosuch.csv'"),
        (("--record", "middle=r.csv"), "r.csv: needs the columns time_s,Xr,Yr"),
        (("--planted-linear", "3 N"), "unit 'N' does not fit"),
    ):
        ended = wm_drake("study", "gasket-damping", "--out", "out", *arguments)
        assert (ended.code, len(ended.messages)) == (2, 1)
        assert message in ended.err
        assert not Path("out").exists()
