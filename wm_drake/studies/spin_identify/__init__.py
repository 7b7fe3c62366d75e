"""Identify parameters of a machine from RMS displacements of spin cycles ([A] section 4.2).

Enters: a machine, keys of unknown numbers, unbalance cases and measured RMS displacements, or a
virtual experiment. Leaves: estimates with confidence intervals, and their answer.
May import: `studies.fitting`, `studies.spin_cycle`, `simulation` and the rooms before it.
"""
