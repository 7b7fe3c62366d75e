"""Tests of the calibration page: its text agrees with the numbers."""

from dataclasses import replace

import numpy as np
import pytest

from wm_drake.parameters import SpinProfile
from wm_drake.parameters.free import load_free
from wm_drake.simulation.cases import Case
from wm_drake.studies.calibrate.page import CalibrateResult, certainty, drawn_page, summary
from wm_drake.studies.calibrate.parameter_map import parameter_map_of
from wm_drake.studies.calibrate.prediction import Prediction
from wm_drake.studies.calibrate.solutions import Solution
from wm_drake.studies.calibrate.study import Calibration, SearchPlan
from wm_drake.studies.calibrate.targets import Targets
from wm_drake.studies.fitting.posterior import Posterior
from wm_drake.studies.modes.natural import natural_modes
from wm_drake.studies.spin.study import run_spin
from wm_drake.studies.study import Facts

FREE = """
quantities:
  friction: {bounds: "(10, 60) N", prior: "(30, 10) N", sets: damper_types.friction.friction_force, source: test}
  motor: {bounds: "(4, 6) kg", prior: "(5, 0.5) kg", sets: bodies.motor.mass, source: test}
  radius: {bounds: "(230, 250) mm", prior: "(240, 5) mm", sets: loads.middle.unbalances.0.radius, source: test}
"""
LOADS = (("middle", False), ("middle", True), ("back", True))


@pytest.fixture(scope="module")
def calibration(machine, tmp_path_factory):
    path = tmp_path_factory.mktemp("free") / "free.yaml"
    path.write_text(FREE)
    parameter_map = parameter_map_of(machine, load_free(path))
    sensors = tuple(machine.parameters.sensors)
    measured = np.full((3, 6), 0.01)
    targets = Targets(LOADS, sensors, measured, np.ones((3, 6)))
    computed = measured.copy()
    computed[1, 4] *= 0.75  # Yf, middle with gasket
    point = np.array([40.0, 4.001, 0.24])
    slopes = np.zeros((18, 3))
    slopes[:2] = [[10.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    coordinates = (point - parameter_map.expected) / parameter_map.deviation
    at, none = Posterior(coordinates, slopes, 18), np.empty(0)
    best = Solution(parameter_map, targets, 0, point, computed, none, 20.0, 2.0, at, 123)
    mirrored = Posterior(-coordinates, slopes, 18)
    other = replace(best, start=1, data_cost=21.0, posterior=mirrored, evaluations=77)
    bad = replace(best, start=2, amplitude=2.0 * computed, data_cost=2000.0, evaluations=55)
    return Calibration(
        parameter_map, targets, SearchPlan(starts=3), (best, other), (best, other, bad)
    )


@pytest.fixture(scope="module")
def page(machine, calibration):
    short = SpinProfile(time=(0.0, 3.0), speed=(5.0, 20.0))
    cases = [Case(name, machine.parameters.loads[name], short, gasket) for name, gasket in LOADS]
    measured, best = calibration.targets.amplitude, calibration.solutions[0]
    seen = calibration.targets.without("back")
    without = replace(best, targets=seen, amplitude=1.04 * seen.amplitude)
    ends = np.array([0.69, 0.5, 1.0])[:, None, None] * measured
    ends[2] += 0.001 * np.array([1, 1, 1, -1, -1, -1])  # of 10 mm
    predictions = [Prediction(("back",), best, without, ends, np.empty((3, 0)), 0.07)]
    modes = [("without gasket", natural_modes(machine, gasket=False))]
    best = run_spin(machine.parameters, cases)
    result = CalibrateResult(calibration, predictions)
    return drawn_page(result, best, modes, Facts("wm-drake calibrate --free 'a<b'"))


def test_summary_has_mean_largest_and_their_place(calibration):
    text = summary(calibration, [])
    assert "compared with 18 measured amplitudes. The mean absolute difference is 1.4 %" in text
    assert "−25 %, at sensor Yf with load middle (with gasket)" in text
    assert "3 searches found 2 distinct good solutions" in text


def test_certainty_sorts_the_quantities(calibration):
    found = dict(certainty(calibration))
    assert found["Determined by the data"] == "friction"
    assert found["At a bound"] == "motor"
    assert found["Determined by data and prior"] == "radius"
    assert found["Determined by the prior only"] == "none"


def test_page_shows_the_intervals_of_held_out_loads(page):
    section = page[page.index('id="prediction"') : page.index('id="quantities"')]
    assert "The intervals contain 50 % of the measured ones" in section
    assert "5.0 to 11.0" in section
    assert "5.0 to 9.0" in section
    assert "a scatter of 7 % of an amplitude" in section
