"""Fit unknown numbers of any model: the room of all optimisers.

Enters: a `Problem`: unknowns with bounds and priors, and a function from points to residuals. A
`FitProblem` compares with measurements, a `PriorProblem` weighs data against priors, a
`NormProblem` adds norms of groups. Leaves: a `Fit` or an `Optimum`. Searches: `methods` (least
squares, evolution), `surfaces`, `kinks` (coarse differences) and `grid` (grids,
simplex). Assessment: `assessment`, `profile`, `posterior`, `jackknife`. `page` has what pages of
fits share.
May import: `parameters`, `report` and `errors`; no machine and no engine.
"""
