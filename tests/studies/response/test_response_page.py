"""What the page of the steady response leads with, on hand-made branches."""

import numpy as np
import pytest
import xarray as xr
from hand_made_records import harmonic_record

from wm_drake.model.scene import Scene
from wm_drake.report.quantity import SPEED
from wm_drake.studies.response.figures import reachable_peaks, response_figure
from wm_drake.studies.response.page import branches_table, largest_table
from wm_drake.studies.response.quantities import AMPLITUDE, RUN_SPEED
from wm_drake.studies.response.response import settled_trajectory, steady_response
from wm_drake.studies.response.study import _run_up, case_of_response, largest_of, peaks_of

RPM = np.pi / 30.0
SPEEDS = (100.0, 120.0, 140.0, 160.0, 180.0)


def case(gasket, amplitudes_mm, stable=(True,) * 5, gaps_mm=(20.0,) * 5):
    response = xr.Dataset(
        {
            "amplitude": AMPLITUDE.variable(
                ("point", "sensor"), AMPLITUDE.unit.to_si(np.array([amplitudes_mm])).T
            ),
            "first_harmonic": (("point", "coordinate", "part"), np.zeros((5, 6, 2))),
            "smallest_gap": ("point", 1e-3 * np.array(gaps_mm)),
            "stable": ("point", np.array(stable)),
        },
        {"speed": SPEED.variable("point", RPM * np.array(SPEEDS)), "sensor": ["Xr"]},
    )
    return case_of_response(response, "middle", gasket)


@pytest.fixture
def cases():
    """Return a huge unstable motion without gasket, and a stable one in contact."""
    without = case(
        False,
        (5.0, 45.0, 14.0, 203.4, 8.0),
        stable=(True, True, True, False, True),
        gaps_mm=(25.0, -4.5, 16.0, -170.0, 22.0),
    )
    return [case(True, (4.0, 6.0, 12.6, 7.0, 5.0)), without]


def test_table_and_peaks_have_reachable_motions_only(reference, cases):
    with_gasket, without = cases
    assert without.reachable.values.tolist() == [True, False, True, False, True]
    frame = largest_table(reference, cases).frame()
    assert frame["Xr_mm"].tolist() == pytest.approx([12.6, 14.0])
    assert frame["speed_rpm"].tolist() == pytest.approx([140.0, 140.0])
    assert reachable_peaks(with_gasket) == [2]
    assert reachable_peaks(without) == []  # both peaks are out of reach


def test_nothing_reachable_is_nan():
    nothing = case(True, (9.0,) * 5, stable=(False,) * 5)
    assert np.isnan([*largest_of(nothing).amplitude, *largest_of(nothing).speed]).all()


def test_peak_of_the_run_is_beside_the_steady_one(cases):
    sizes = AMPLITUDE.unit.to_si(np.array([[-3.0], [-9.45], [-2.0]]))
    lower = xr.DataArray(sizes, dims=("time", "sensor"))
    run = {
        "upper": -0.5 * lower,
        "lower": lower,
        "run_speed": RUN_SPEED.variable("time", (1, 2, 3)),
    }
    peak = peaks_of(cases[0].assign(run)).isel(sensor=0)
    assert AMPLITUDE.values(peak.run_amplitude) == pytest.approx(9.45)
    assert peak.run_speed == 2.0
    assert peak.difference == pytest.approx(-0.25)
    assert np.isnan(peaks_of(cases[1]).run_amplitude).all()


def test_file_has_a_row_for_each_point_of_each_branch(cases):
    frame = branches_table(cases).frame()
    assert frame["gasket"].tolist() == ["yes"] * 5 + ["no"] * 5
    assert frame["speed_rpm"].tolist() == pytest.approx([*SPEEDS, *SPEEDS])
    assert frame["amplitude_Xr_mm"].iloc[8] == pytest.approx(203.4)
    assert frame["reachable"].tolist()[5:] == [True, False, True, False, True]


def test_picture_shows_what_is_reached_and_cuts_what_is_not(cases):
    (panel,) = response_figure(cases).panels
    assert panel.y.range == (0.0, pytest.approx(1.25 * 14.0))
    lines = {mark.key: mark for mark in panel.marks}
    assert np.isfinite(lines["steady, without gasket"].y).tolist() == [1, 0, 1, 0, 1]
    assert np.isfinite(lines["in contact"].y).tolist() == [1, 1, 1, 0, 0]
    assert np.isfinite(lines["unstable"].y).tolist() == [0, 0, 1, 1, 1]


def test_run_is_shown_at_the_speeds_of_the_response(reference):
    record = harmonic_record(reference, "middle", True, 0.02)
    speed = np.linspace(0.0, 1400.0, record.sizes["time"]) * RPM
    record["drum_speed"] = ("time", speed)
    shown = _run_up(record, RPM * np.array([60.0, 300.0]))
    assert shown.run_speed.values.min() >= 60.0 * RPM
    assert shown.run_speed.values.max() <= 300.0 * RPM
    assert shown.sizes["time"] == np.count_nonzero((speed >= 60.0 * RPM) & (speed <= 300.0 * RPM))
    assert not _run_up(record, RPM * np.array([1500.0, 1600.0])).variables


def test_gap_of_a_motion_is_that_of_the_engine(machine):
    speed = 250.0 * RPM
    response = steady_response(machine, "middle", [speed, 1.01 * speed])
    setup = machine.set_up("middle")
    run = settled_trajectory(setup, speed, 128)
    gap = Scene(machine.parameters).smallest_gap(run.time, run.state[:, :6], setup.rest_pose)
    assert float(response.smallest_gap[0]) == pytest.approx(gap.distance, abs=5e-5)
