"""Identification: unknown numbers of any model from what was measured, by three methods with one kind of result."""

from wm_drake.studies.identification.assessment import assess
from wm_drake.studies.identification.fit import Direction, Estimate, Fit, TestError
from wm_drake.studies.identification.methods import METHODS, evolution, identify, least_squares
from wm_drake.studies.identification.problem import Evaluate, Measurement, Problem, Progress, Unknown, point_by_point, rmse
from wm_drake.studies.identification.surfaces import response_surface

__all__ = [
    "METHODS",
    "Direction",
    "Estimate",
    "Evaluate",
    "Fit",
    "Measurement",
    "Problem",
    "Progress",
    "TestError",
    "Unknown",
    "assess",
    "evolution",
    "identify",
    "least_squares",
    "point_by_point",
    "response_surface",
    "rmse",
]
