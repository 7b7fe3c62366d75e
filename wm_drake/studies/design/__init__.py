"""Designs of a machine: the Pareto front of objectives under constraints.

Enters: a machine and a vary file. Leaves: the Pareto front as a dataset, and its answer.
`search` uses no machine. May import: `simulation` and the rooms before it, `studies.tolerance` and
the responses of `studies.gasket`.
"""
