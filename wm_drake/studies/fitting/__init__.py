"""Fit unknown numbers of any model: the room of all optimisers.

Enters: a `FitProblem`: unknowns with bounds, some with priors, measurements, and a function from
points to computed values. Leaves: a `Fit` or an `Optimum`. Searches: `methods` (least squares from
several starts, evolution), `surfaces`, `grid`; `search` has the least squares from one point,
`starts` where they begin. Assessment: `assessment` with `profile`; `left_out` for tests that a fit
has not seen. `page` has what pages of fits share.
May import: `parameters`, `report` and `errors`; no machine and no engine.
"""
