"""Regions that a record does not cover: one sample is allowed to be missing, more is said."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from wm_drake.parameters import SpinProfile
from wm_drake.parameters.spin import Region
from wm_drake.simulation.vibration import region_rms, region_samples
from wm_drake.studies.spin_cycle.findings import missing_warnings
from wm_drake.studies.spin_cycle.measured import read_accelerations
from wm_drake.studies.spin_cycle.study import average_errors, largest, missing_regions

PERIOD = 5e-3
PROFILE = SpinProfile(
    time=(0.0, 20.0),
    speed=(10.0, 10.0),
    regions=(Region(name="R1", begin=2.0, end=10.0), Region(name="R2", begin=12.0, end=20.0)),
)
LABELS = {"case": ["1", "2"], "region": ["R1", "R2"], "accelerometer": ["S1"], "axis": list("xyz")}


@pytest.mark.parametrize(
    ("count", "rows"),
    [(4001, 1600), (4000, 1600), (3999, 1599), (3984, 1584), (3983, 0), (2000, 0), (10, 0)],
)
def test_a_region_may_miss_a_sample_or_a_hundredth_at_its_end(count, rows):
    part = region_samples(PROFILE, PERIOD, count)[1]
    assert len(np.zeros(count)[part]) == rows


def test_a_short_region_may_miss_one_sample():
    short = PROFILE.model_copy(update={"regions": (Region(name="R1", begin=1.0, end=1.05),)})
    sizes = [
        len(np.zeros(count)[region_samples(short, PERIOD, count)[0]]) for count in (210, 209, 208)
    ]
    assert sizes == [10, 9, 0]


def test_rms_of_a_record_that_ends_a_sample_early_is_that_of_the_rest():
    signal = np.tile([[3.0], [-3.0]], (2000, 1))
    assert region_rms(signal[:-1], PERIOD, PROFILE) == pytest.approx(3.0)
    cut = region_rms(signal[:-40], PERIOD, PROFILE)
    assert cut == pytest.approx(np.array([[3.0], [np.nan]]), nan_ok=True)


@pytest.mark.parametrize(("rows", "has_last"), [(4000, True), (3999, True), (3900, False)])
def test_measured_record_that_ends_early(tmp_path, rows, has_last):
    time = PERIOD * np.arange(rows)
    wave = np.sin(2.0 * np.pi * 2.0 * time)
    columns = {"time_s": time} | {f"S1_{axis}": wave for axis in "xyz"}
    pd.DataFrame(columns).to_csv(tmp_path / "1.csv", index=False)
    found = read_accelerations(tmp_path, LABELS, PROFILE).sel(case="1")
    size = 1.0 / (2.0 * np.pi * 2.0) ** 2 / np.sqrt(2.0)
    assert found.sel(region="R1").values == pytest.approx(size, rel=0.01)
    assert np.isfinite(found.sel(region="R2").values).all() == has_last


@pytest.fixture
def result():
    """Return displacements; the measurement of case 2 has no value in R2, and is 25 % larger else."""
    computed = xr.DataArray(np.full((2, 2, 1, 3), 8e-3), LABELS, list(LABELS))
    measured = 1.25 * computed
    measured.loc["2", "R2"] = np.nan
    return xr.Dataset({"rms": computed, "measured": measured})


def test_errors_say_which_regions_they_leave_out(result):
    assert missing_regions(result.rms, result.measured) == {"R2": ["2"]}
    (text,) = missing_warnings(result.rms, result.measured)
    assert "R2 in case 2" in text
    np.testing.assert_allclose(average_errors(result.rms, result.measured), 0.2)


def test_complete_measurements_have_no_such_warning(result):
    assert missing_warnings(result.rms, 1.25 * result.rms) == []


def test_a_case_that_was_not_measured_misses_nothing(result):
    only_first = result.measured.copy()
    only_first.loc["2"] = np.nan
    assert missing_regions(result.rms, only_first) == {}


def test_a_run_that_did_not_complete_a_region_leaves_it_out(result):
    stopped = result.rms.copy()
    stopped.loc["1", "R2"] = np.nan
    assert missing_regions(stopped, result.measured) == {"R2": ["1", "2"]}


def test_the_largest_displacement_has_the_labels_of_its_place(result):
    rms = result.rms.copy()
    rms.loc["1", "R2", "S1", "y"] = 9e-3
    rms.loc["2", "R1", "S1", "z"] = np.nan
    worst = largest(rms)
    assert [worst[dim].item() for dim in LABELS] == ["1", "R2", "S1", "y"]
    of_cases = largest(rms, ["case"])
    np.testing.assert_allclose(of_cases, [9e-3, 8e-3])
    assert of_cases.axis.values.tolist() == ["y", "x"]
    assert largest(np.nan * rms).isnull()
