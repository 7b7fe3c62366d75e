"""Stiffness and damping of a gasket from its drawing: finite elements of the rubber.

Enters: a `GasketDrawing`, ranges of displacement and angle, the machine that gets the gasket.
Leaves: six curves, their checks, a `gasket` section and a machine file.
May import: `solid` and the rooms before it.
"""
