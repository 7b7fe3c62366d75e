"""Fit unknown numbers of any model: the room of all optimisers.

Enters: a problem: unknowns with bounds and priors, and a function from points to residuals. A
`FitProblem` compares with measurements, a `PriorProblem` weighs data against priors. Leaves: a
`Fit` or an `Optimum`. `search` has the least squares of both. Searches: `methods` (least squares
from several starts, evolution), `surfaces`, `grid`; `starts` draws random starts. Assessment:
`assessment`, `profile`, `posterior`. `page` has what pages of fits share.
May import: `parameters`, `report` and `errors`; no machine and no engine.
"""
