"""Fit unknown numbers of any model: the room of all optimisers.

Enters: a `Problem`: unknowns with bounds and priors, and a function from points to residuals. A
`FitProblem` compares with measurements, a `PriorProblem` weighs data against priors, a
`NormProblem` adds norms of groups. Leaves: a `Fit` or an `Optimum`. Searches: `methods` (least
squares, evolution), `surfaces`, `kinks` (coarse differences, hops, CMA-ES) and `grid` (grids,
simplex). Assessment: `assessment`, `profile`, `posterior`, `jackknife`. `page` has what pages of
fits share.
May import: `parameters`, `report` and `errors`; no machine and no engine.
"""

from wm_drake.studies.fitting.assessment import assess, evaluated, left_out_errors
from wm_drake.studies.fitting.fit import Direction, Estimate, Fit, TestError, Verdict, verdict_of
from wm_drake.studies.fitting.methods import METHODS, evolution, identify, least_squares, refined
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
    "evaluated",
    "evolution",
    "identify",
    "least_squares",
    "left_out_errors",
    "point_by_point",
    "refined",
    "response_surface",
    "rmse",
    "verdict_of",
]
