"""Design experiments with factors at three levels, and analyse the variance of their responses.

Enters: names of factors and a model, or a design file; for `anova`, levels and responses. Leaves: a
`Design` with its D-efficiency, and a dataset of contributions and effects.
May import: `parameters` (CSV files) and `errors`; it needs no machine.
"""
