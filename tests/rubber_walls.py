"""Walls of rubber for tests of `wm_drake.solid`: drawings by numbers, other mirror conditions."""

import numpy as np

from wm_drake.parameters.gasket_drawing import GasketDrawing, MeridianPoint, Rubber

C1 = 0.3e6
SHEAR = 2.0 * C1
"""Shear modulus of a Neo-Hookean rubber of constant C1. [Pa]"""


def drawing(*corners, bulk=500.0 * SHEAR):
    """Return a drawing through corners (radius, y, thickness). [m]"""
    points = (MeridianPoint(radius=r, y=y, thickness=t) for r, y, t in corners)
    return GasketDrawing(meridian=tuple(points), rubber=Rubber(c1=C1, bulk_modulus=bulk))


def antisymmetric(ring):
    """Return the locked directions of half a ring for motions along z: x and y in the plane z = 0."""
    locked = np.zeros_like(ring.locked)
    plane = ring.locked[:, 2]
    locked[plane, 0] = locked[plane, 1] = True
    return locked
