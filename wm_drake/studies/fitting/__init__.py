"""Identify unknown numbers of any model from measurements, by three methods."""

from wm_drake.studies.fitting.assessment import assess
from wm_drake.studies.fitting.fit import Direction, Estimate, Fit, TestError
from wm_drake.studies.fitting.methods import METHODS, evolution, identify, least_squares
from wm_drake.studies.fitting.problem import (
    Evaluate,
    FitProblem,
    Measurement,
    Progress,
    Unknown,
    point_by_point,
    rmse,
)
from wm_drake.studies.fitting.surfaces import response_surface
from wm_drake.studies.fitting.verdict import Verdict, verdict_of

__all__ = [
    "METHODS",
    "Direction",
    "Estimate",
    "Evaluate",
    "Fit",
    "FitProblem",
    "Measurement",
    "Progress",
    "TestError",
    "Unknown",
    "Verdict",
    "assess",
    "evolution",
    "identify",
    "least_squares",
    "point_by_point",
    "response_surface",
    "rmse",
    "verdict_of",
]
