"""Describe each component once: geometry, law, packed layout, wrench.

Enters: parameters of a component and the frames it acts between. Leaves: flat arrays of numbers,
and compiled functions that return the forces at a motion. Systems, compiled engine and rigs use
them. May import: `parameters`, `laws`, `compiler` and `errors`; no pydrake.
"""
