"""Tests of what a calibration shows: its datasets agree with the numbers."""

from dataclasses import replace

import numpy as np
import pytest
from linear_fits import fit_at

from wm_drake.parameters.vary_file import load_vary
from wm_drake.studies.calibrate.page import certainty
from wm_drake.studies.calibrate.parameter_map import parameter_map_of
from wm_drake.studies.calibrate.prediction import Prediction
from wm_drake.studies.calibrate.results import (
    amplitudes_of,
    differences_of,
    intervals_of,
    predictions_of,
    searches_of,
)
from wm_drake.studies.calibrate.solutions import Solution
from wm_drake.studies.calibrate.study import Calibration, SearchPlan
from wm_drake.studies.calibrate.targets import Targets

FREE = """
vary:
  friction: {bounds: "(10, 60) N", prior: "(30, 10) N", sets: damper_types.friction.friction_force, source: test}
  motor: {bounds: "(4, 6) kg", prior: "(5, 0.5) kg", sets: bodies.motor.mass, source: test}
  radius: {bounds: "(230, 250) mm", prior: "(240, 5) mm", sets: loads.middle.unbalances.0.radius, source: test}
"""
LOADS = (("middle", False), ("middle", True), ("back", True))


@pytest.fixture(scope="module")
def calibration(machine, tmp_path_factory):
    path = tmp_path_factory.mktemp("free") / "free.yaml"
    path.write_text(FREE)
    parameter_map = parameter_map_of(machine, load_vary(path))
    sensors = tuple(machine.parameters.sensors)
    measured = np.full((3, 6), 0.01)
    targets = Targets(LOADS, sensors, measured, np.ones((3, 6)))
    computed = measured.copy()
    computed[1, 4] *= 0.75  # Yf, middle with gasket
    point = np.array([40.0, 4.001, 0.24])
    slopes = np.zeros((18, 3))
    slopes[:2] = [[10.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    coordinates = (point - parameter_map.expected) / parameter_map.deviation
    at, mirrored = (
        fit_at(sign * coordinates, slopes, parameter_map.unknowns) for sign in (1.0, -1.0)
    )
    best = Solution(parameter_map, targets, 0, at, computed, np.empty(0), 20.0, 2.0)
    other = replace(best, start=1, data_cost=21.0, fit=mirrored)
    bad = replace(best, start=2, amplitude=2.0 * computed, data_cost=2000.0)
    return Calibration(
        parameter_map, targets, SearchPlan(starts=3), (best, other), (best, other, bad)
    )


def test_certainty_sorts_the_quantities(calibration):
    found = dict(certainty(calibration))
    assert found["Determined by the data"] == "friction"
    assert found["At a bound"] == "motor"
    assert found["Determined by data and prior"] == "radius"
    assert found["Determined by the prior only"] == "none"


def test_intervals_of_held_out_loads_hold_half_of_their_amplitudes(calibration):
    measured, best = calibration.targets.amplitude, calibration.solutions[0]
    seen = calibration.targets.without("back")
    without = replace(best, targets=seen, amplitude=1.04 * seen.amplitude)
    ends = np.array([0.69, 0.5, 1.0])[:, None, None] * measured
    ends[2] += 0.001 * np.array([1, 1, 1, -1, -1, -1])  # of 10 mm
    prediction = Prediction(("back",), best, without, ends, np.empty((3, 0)), 0.07)
    predicted = predictions_of([prediction])
    assert predicted.in_intervals.item() == 0.5
    assert predicted.predicted_mean.item() == pytest.approx(0.31)
    assert predicted.seen_mean.item() == pytest.approx(0.04)
    intervals = intervals_of(calibration, prediction).sel(load="back", gasket="yes")
    assert intervals.sel(source="95 % from").values == pytest.approx(0.005)
    assert intervals.sel(source="95 % to").values == pytest.approx([0.011] * 3 + [0.009] * 3)


def test_differences_are_those_from_the_experiment(calibration):
    differences = differences_of(amplitudes_of(calibration)).sel(source="solution 1")
    of_case = differences.sel(load="middle", gasket="yes")
    assert of_case.difference.sel(sensor="Yf").item() == pytest.approx(-0.25)
    assert of_case.mean_absolute.item() == pytest.approx(0.25 / 6)
    assert np.isnan(differences.difference.sel(load="back", gasket="no")).all()


def test_searches_name_their_solutions(calibration):
    searches = searches_of(calibration)
    assert searches.solution.values == pytest.approx([1.0, 2.0, np.nan], nan_ok=True)
    assert searches.cost.values.tolist() == [22.0, 23.0, 2002.0]
    assert searches.largest.values == pytest.approx([0.25, 0.25, 1.0])
