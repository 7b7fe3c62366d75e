"""Identify the damping of the gasket from measured envelopes ([B] section 3.1.2).

Enters: a machine and measured displacements of its sensors, or a virtual experiment. Leaves: a
`Damping` with the optimum of two searches. `grid_search` uses no machine.
May import: `batch` and the rooms before it.
"""
