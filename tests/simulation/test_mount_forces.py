"""Forces of the mounts: planted forces give known peaks and RMS values per range of speed."""

import numpy as np
import pytest
import xarray as xr

from wm_drake.parameters import SpinProfile
from wm_drake.parameters.spin import Region
from wm_drake.simulation.mount_forces import SpeedRange, mount_forces, rms_table, speed_ranges
from wm_drake.simulation.mounts import force_measures

RAD_S = np.pi / 30.0
TIME = 5e-3 * np.arange(8000)
"""40 s; the drum speeds up by 10 rpm/s."""


def record(gasket="yes"):
    """Return a record: a spring at 100 N + 20 N sin, a damper of 30 N sgn, a gasket force of 5 N that turns."""
    phase, none = 2.0 * np.pi * 5.0 * TIME, 0.0 * TIME
    spring = np.stack([none, none, -100.0 - 20.0 * np.sin(phase)], axis=1)
    damper = np.stack([18.0 * np.sign(np.sin(phase)), none, 24.0 * np.sign(np.sin(phase))], axis=1)
    turning = np.stack([5.0 * np.cos(phase) - 5.0, none, 5.0 * np.sin(phase)], axis=1)
    return xr.Dataset(
        {
            "mount_force": (("time", "mount", "axis"), np.stack([spring, damper, turning], axis=1)),
            "drum_speed": ("time", 10.0 * RAD_S * TIME),
        },
        {"time": TIME, "mount": ["springs.left", "dampers.rear", "gasket"], "axis": list("xyz")},
        {"gasket": gasket},
    )


def profile(end=400.0, regions=()):
    return SpinProfile(time=(0.0, 40.0), speed=(0.0, end * RAD_S), regions=regions)


def test_peaks_and_values_at_rest():
    spring, damper, gasket = mount_forces(record())
    assert [force.name for force in (spring, damper, gasket)] == [
        "springs.left",
        "dampers.rear",
        "gasket",
    ]
    assert (spring.at_rest, damper.at_rest, gasket.at_rest) == (100.0, 0.0, 0.0)
    assert spring.peak == pytest.approx(120.0, abs=1e-6)
    assert TIME[spring.peak_index] % 0.2 == pytest.approx(0.05)
    assert damper.peak == pytest.approx(30.0)
    assert gasket.peak == pytest.approx(10.0)  # a circle of radius 5 N through zero


def test_rms_is_that_without_the_mean():
    forces, ranges = mount_forces(record()), speed_ranges(record(), profile())
    assert [part.name for part in ranges] == [
        "0 to 100 rpm",
        "100 to 200 rpm",
        "200 to 300 rpm",
        "300 to 400 rpm",
    ]
    assert [part.samples.sum() for part in ranges] == [2000] * 4
    found = rms_table(forces, ranges)
    # the force of the gasket goes round a circle of 5 N about its mean
    expected = np.array([20.0 / np.sqrt(2.0), 30.0, 5.0])
    np.testing.assert_allclose(found, np.repeat(expected[:, None], 4, axis=1), rtol=0.03)
    np.testing.assert_allclose(found[[0, 2]], expected[[0, 2], None] * np.ones(4), rtol=1e-9)


def test_gasket_that_is_taken_out_is_left_out():
    assert [force.name for force in mount_forces(record(gasket="no"))] == [
        "springs.left",
        "dampers.rear",
    ]


def test_regions_of_the_profile_are_used():
    regions = (Region(name="R1", begin=0.0, end=10.0), Region(name="R2", begin=20.0, end=40.0))
    ranges = speed_ranges(record(), profile(regions=regions))
    assert [(part.name, int(part.samples.sum())) for part in ranges] == [("R1", 2000), ("R2", 4000)]


def test_fast_profile_has_few_wide_ranges():
    fast = record().assign(drum_speed=("time", 35.0 * RAD_S * TIME))
    ranges = speed_ranges(fast, profile(1400.0))
    assert [part.name for part in ranges][::6] == ["0 to 200 rpm", "1200 to 1400 rpm"]
    assert sum(part.samples for part in ranges).tolist() == [1] * len(TIME)


def test_range_that_the_run_did_not_reach_is_nan():
    early = record().isel(time=slice(0, 1000))
    found = rms_table(mount_forces(early), speed_ranges(early, profile()))
    assert np.isnan(found).tolist() == [[False, True, True, True]] * 3
    assert mount_forces(record().isel(time=slice(0))) == []


def test_rms_over_the_whole_run_is_the_measure_of_the_json():
    of_run = force_measures(record().mount_force.values)[2]
    everything = [SpeedRange("all", np.ones(len(TIME), dtype=bool))]
    found = rms_table(mount_forces(record()), everything)[:, 0]
    np.testing.assert_allclose(found, of_run, rtol=1e-12)
