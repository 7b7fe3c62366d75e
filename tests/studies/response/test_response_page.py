"""What the page of the steady response leads with, on hand-made branches."""

import numpy as np
import pytest
import xarray as xr
from hand_made_records import harmonic_record

from wm_drake.model.scene import Scene
from wm_drake.studies.response.figures import peaks_of, response_figure
from wm_drake.studies.response.page import largest_table, summary
from wm_drake.studies.response.response import settled_trajectory, steady_response
from wm_drake.studies.response.study import SteadyCase, SteadyStudy, _envelopes

RPM = np.pi / 30.0
SPEEDS = (100.0, 120.0, 140.0, 160.0, 180.0)


def case(gasket, amplitudes_mm, stable=(True,) * 5, gaps_mm=(20.0,) * 5, run_up=None):
    response = xr.Dataset(
        {
            "amplitude": (("point", "sensor"), 1e-3 * np.array([amplitudes_mm]).T),
            "smallest_gap": ("point", 1e-3 * np.array(gaps_mm)),
            "stable": ("point", np.array(stable)),
        },
        {"speed": ("point", RPM * np.array(SPEEDS)), "sensor": ["Xr"]},
    )
    return SteadyCase("middle", gasket, response, run_up, 0.0)


@pytest.fixture
def study(reference):
    """Return a study with a huge unstable motion without gasket, and a stable one in contact."""
    without = case(
        False,
        (5.0, 45.0, 14.0, 203.4, 8.0),
        stable=(True, True, True, False, True),
        gaps_mm=(25.0, -4.5, 16.0, -170.0, 22.0),
    )
    return SteadyStudy(reference, [case(True, (4.0, 6.0, 12.6, 7.0, 5.0)), without], None, 0.0)


def test_summary_leads_with_what_a_machine_reaches(study):
    sentences = summary(study).split(". ")
    most = "the largest steady amplitude that is stable and without contact is"
    assert sentences[:3] == [
        f"With gasket {most} 12.6 mm at sensor Xr with load middle, at 140 rpm",
        f"Without gasket {most} 14.0 mm at sensor Xr with load middle, at 140 rpm",
        "With load middle, without gasket, the tub touches the housing at 120 rpm, with an overlap "
        "of up to 4.5 mm",
    ]
    assert sentences[3] == (
        "Unstable motions, which a machine leaves for another motion: load middle, without gasket, "
        "at 160 rpm, up to 203.4 mm"
    )


def test_table_and_peaks_have_reachable_motions_only(study):
    with_gasket, without = study.cases
    assert without.reachable.tolist() == [True, False, True, False, True]
    shown = str(largest_table(study).groups)
    assert "14.0" in shown
    assert "203.4" not in shown
    assert peaks_of(with_gasket) == [2]
    assert peaks_of(without) == []  # both peaks are out of reach


def test_nothing_reachable_is_said(reference):
    nothing = case(True, (9.0,) * 5, stable=(False,) * 5)
    text = summary(SteadyStudy(reference, [nothing], None, 0.0))
    assert text.startswith("With gasket no steady motion is stable and without contact. Unstable")
    assert "at 100 to 180 rpm, up to 9.0 mm" in text
    assert np.isnan(nothing.largest()).all()


def test_picture_shows_what_is_reached_and_cuts_what_is_not(study):
    (panel,) = response_figure(study.cases).panels
    assert panel.y.range == (0.0, pytest.approx(1.25 * 14.0))
    lines = {mark.key: mark for mark in panel.marks}
    assert np.isfinite(lines["steady, without gasket"].y).tolist() == [1, 0, 1, 0, 1]
    assert np.isfinite(lines["in contact"].y).tolist() == [1, 1, 1, 0, 0]
    assert np.isfinite(lines["unstable"].y).tolist() == [0, 0, 1, 1, 1]


def test_run_is_shown_at_the_speeds_of_the_response(reference):
    record = harmonic_record(reference, "middle", True, 0.02)
    speed = np.linspace(0.0, 1400.0, record.sizes["time"]) * RPM
    record["drum_speed"] = ("time", speed)
    shown = _envelopes(record, RPM * np.array([60.0, 300.0]))
    assert shown.speed.values.min() >= 60.0 * RPM
    assert shown.speed.values.max() <= 300.0 * RPM
    assert shown.sizes["time"] == np.count_nonzero((speed >= 60.0 * RPM) & (speed <= 300.0 * RPM))
    assert _envelopes(record, RPM * np.array([1500.0, 1600.0])) is None


def test_gap_of_a_motion_is_that_of_the_engine(machine):
    speed = 250.0 * RPM
    response = steady_response(machine, "middle", [speed, 1.01 * speed])
    setup = machine.set_up("middle")
    run = settled_trajectory(setup, speed, 128)
    gap = Scene(machine.parameters).smallest_gap(run.time, run.state[:, :6], setup.rest_pose)
    assert float(response.smallest_gap[0]) == pytest.approx(gap.distance, abs=5e-5)
