"""Tolerances: how a machine and its laundry scatter, how often it touches, and why.

Enters: a machine and a tolerance file. Leaves: a `ToleranceResult` with distributions of all
measures, the probability of contact, Sobol indices and the verdicts on limits, and its tables.
`distributions`, `rare`, `sensitivity` and `shares` use no machine. May import: `simulation` and the
rooms before it, and the responses of `studies.gasket`.
"""
