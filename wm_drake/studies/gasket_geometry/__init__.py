"""Which drawing of a gasket is best: finite elements, runs of the machine, response surfaces.

Enters: a `GasketDrawing` and a machine. Leaves: stiffness and tub motion of many drawings, what
each factor contributes, surfaces with their error on fresh drawings, the best drawing, verified.
May import: `solid`, `batch` and the rooms before them.
"""
