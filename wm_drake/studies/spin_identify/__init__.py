"""Identify parameters of a machine from RMS displacements of spin cycles ([A] section 4.2).

Enters: a machine, keys of unknown numbers, unbalance cases and measured RMS displacements, or a
virtual experiment. Leaves: a `SpinIdentification` with estimates and confidence intervals.
May import: `studies.fitting`, `studies.spin_cycle`, `simulation` and the rooms before it.
"""
