"""Large deformation of rubber rings: from the drawing of a gasket to force over displacement.

Enters: a `GasketDrawing`, read and checked by `parameters.gasket_drawing`.
Leaves: `Curve`, force and moment of the moved rim over its displacement or angle.
May import: `parameters`, `compiler`, `errors`; no Drake, no report.

`rubber` has the material, `element` one element, `mesh` the nodes of a drawing, `equilibrium`
Newton's method, `touching` and `contact` what holds folds off each other, `curves` the motions of
a rim, `deformed` stretch, stress and wrinkles.
"""
