"""Walls of rubber for tests of `wm_drake.solid`: drawings by numbers, other mirror conditions."""

import numpy as np

from wm_drake.parameters.gasket_drawing import GasketDrawing, MeridianPoint, Rubber

C1 = 0.3e6
SHEAR = 2.0 * C1
"""Shear modulus of a Neo-Hookean rubber of constant C1. [Pa]"""


def drawing(*corners, bulk=500.0 * SHEAR, fillet=0.0):
    """Return a drawing through corners (radius, y, thickness). [m]"""
    ends = 0, len(corners) - 1
    points = (
        MeridianPoint(radius=r, y=y, thickness=t, fillet=0.0 if number in ends else fillet)
        for number, (r, y, t) in enumerate(corners)
    )
    return GasketDrawing(meridian=tuple(points), rubber=Rubber(c1=C1, bulk_modulus=bulk))


def bush(inner, outer, length, bulk=500.0 * SHEAR):
    """Return a washer bonded at its inner and outer radius: a wall along the radius. [m]"""
    return drawing((inner, 0.0, length), (outer, 0.0, length), bulk=bulk)


def antisymmetric(ring):
    """Return the locked directions of half a ring for motions along z: x and y in the plane z = 0."""
    locked = np.zeros_like(ring.locked)
    plane = ring.locked[:, 2]
    locked[plane, 0] = locked[plane, 1] = True
    return locked
