"""Datasets of modes where the two linearisations do not have the same modes."""

from types import SimpleNamespace

import numpy as np
import pytest

from wm_drake.report.labelled import LabelledTable
from wm_drake.studies.modes import data
from wm_drake.studies.modes.campbell import critical_speeds, diagram_of
from wm_drake.studies.modes.linearisation import AMPLITUDE, SLIDING, STUCK, Spectrum
from wm_drake.studies.modes.page import natural_modes_table
from wm_drake.studies.modes.shapes import Mode

SPEED = np.array([0.0, np.pi, 2.0 * np.pi])
NAMES = {STUCK: [["sway", "roll"], ["sway", "roll"], ["sway", "yaw"]], SLIDING: [["sway"]] * 3}


def mode(name, hertz, damping=0.1):
    shares = np.full(6, 1.0 / 6.0)
    return Mode(name, hertz, damping, np.ones(6, complex), shares, np.ones(1), np.ones(1))


def diagram(count, names):
    """Return a diagram whose mode number k has k Hz and is undamped at all speeds."""
    values = 2j * np.pi * np.arange(1, count + 1)
    spectrum = Spectrum(values, np.eye(count), np.eye(count))
    return diagram_of(SPEED, [spectrum] * len(SPEED), np.ones((len(SPEED), count)), names)


@pytest.fixture
def over_speed():
    return data.over_speed({STUCK: diagram(2, NAMES[STUCK]), SLIDING: diagram(1, NAMES[SLIDING])})


def test_campbell_diagram_has_a_row_for_each_curve_that_there_is(over_speed):
    frame = LabelledTable("campbell", over_speed).frame()
    assert frame.groupby("linearisation").size().to_dict() == {STUCK: 6, SLIDING: 3}
    second = frame.query("linearisation == 'stuck' and curve == 2")
    assert second.speed_rpm.tolist() == pytest.approx([0.0, 30.0, 60.0])
    assert second["mode"].tolist() == ["roll", "roll", "yaw"]
    assert second.frequency_Hz.tolist() == pytest.approx([2.0] * 3)


def test_critical_speed_has_the_name_of_the_shape_there():
    """Let 1 Hz be met by order 1 at 60 rpm and by order 2 at 30 rpm."""
    speeds = np.pi * np.arange(4.0)
    spectra = [Spectrum(np.array([2j * np.pi]), np.eye(1), np.eye(1))] * 4
    names = [["sway"], ["sway"], ["yaw"], ["yaw"]]
    of_sway = diagram_of(speeds, spectra, np.ones((4, 1)), names)
    frame = LabelledTable("critical", critical_speeds({STUCK: of_sway})).frame()
    assert frame["mode"].tolist() == ["sway", "yaw"]
    assert frame.order.tolist() == [2.0, 1.0]
    assert frame.speed_rpm.tolist() == pytest.approx([30.0, 60.0])
    none = critical_speeds({STUCK: of_sway}, ())
    assert LabelledTable("critical", none).records() == []


def test_a_mode_of_one_linearisation_has_no_values_of_the_others():
    result = SimpleNamespace(
        parameters=SimpleNamespace(name="made"),
        amplitude=5e-3,
        modes={STUCK: [mode("sway", 1.0), mode("roll", 2.0)], SLIDING: [mode("yaw", 3.0, 1e-16)]},
        at_amplitude=data.of_names(["sway", "roll"], [1.5, np.nan], [0.2, np.nan]),
    )
    table = natural_modes_table(result)
    rows = {row["mode"]: row for row in table.records()}
    assert list(rows) == ["sway", "roll", "yaw"]
    assert rows["roll"][f"frequency_{AMPLITUDE}_Hz"] is None
    assert rows["sway"][f"damping_ratio_{AMPLITUDE}"] == 0.2
    assert rows["yaw"]["frequency_sliding_Hz"] == 3.0
    assert rows["yaw"]["frequency_stuck_Hz"] is None
    assert "frequency, 5 mm" in [column.name for column in table.table().columns[1:]]


def test_shares_and_shapes_have_their_units_in_files():
    modes = {STUCK: [mode("sway", 1.0)], SLIDING: [mode("yaw", 3.0)]}
    table = LabelledTable("shapes", data.of_modes(modes, ["gasket"]), across="element")
    stuck, sliding = table.records()
    assert (stuck["linearisation"], sliding["linearisation"]) == (STUCK, SLIDING)
    assert sliding["participation_x_percent"] == pytest.approx(100.0 / 6.0)
    assert sliding["strain_energy_gasket_percent"] == pytest.approx(100.0)
    assert {"shape_roll_real_rad", "shape_x_imag_m"} <= set(stuck)
