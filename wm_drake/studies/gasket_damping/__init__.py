"""Identify the damping of the gasket from measured envelopes ([B] section 3.1.2).

Enters: a machine and measured displacements of its sensors, or a virtual experiment. Leaves: an
answer with the fitted damping, and, if asked, with the grids of [B].
May import: `batch` and the rooms before it.
"""
