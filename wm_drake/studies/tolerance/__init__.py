"""Tolerances: how a machine and its laundry scatter, how often it touches, and why.

Enters: a machine and a vary file. Leaves: distributions of all measures, the probability of
contact, Sobol indices and verdicts on limits. `distributions`, `rare`, `sensitivity` and `shares`
use no machine. May import: `simulation` and the rooms before it.
"""
