"""Describe a machine: its numbers in SI units, its equilibrium and its natural modes.

Enters: a built machine. Leaves: plain data that a user can rebuild the machine from, its JSON
schema, and the page of `machine check`. May import: `studies.modes` and the rooms before it.
"""
