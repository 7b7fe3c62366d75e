"""Design experiments with factors at three levels, and analyse the variance of their responses.

Enters: names of factors and a model, or a design file; for `anova`, levels and responses. Leaves: a
`Design` with its D-efficiency, and an `AnovaTable` for each response.
May import: `parameters` (CSV files) and `errors`; it needs no machine.
"""
