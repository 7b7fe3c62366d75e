"""Describe a machine: its numbers in SI units, its equilibrium and its natural modes.

Enters: a built machine. Leaves: plain data that a user can rebuild the machine from, its JSON
schema, and `Modes`. May import: `model` and the rooms before it.
"""
