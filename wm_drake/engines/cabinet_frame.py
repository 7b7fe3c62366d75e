"""Sampled motion seen from a cabinet that moves; both engines use it.

A motion has the form of a `CARRIER_STATE`: roll, pitch, yaw and position of a body, its angular
velocity and velocity (n, 12). Accelerations are angular and of the origin (n, 6).
"""

import numpy as np

from wm_drake.compiler.compilation import generic
from wm_drake.compiler.vectors import rotation_from_rpy
from wm_drake.elements.cabinet import motion_in, rates_in
from wm_drake.elements.motion import TubMotion
from wm_drake.parameters.types import FloatArray


def seen_from_cabinet(
    cabinet: FloatArray, cabinet_rates: FloatArray, body: FloatArray, rates: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return motion and accelerations of a body seen from the cabinet, in its frame.

    Args:
        cabinet, cabinet_rates: Motion and accelerations of the cabinet, in W.
        body, rates: The same of the body.
    """
    from scipy.spatial.transform import Rotation  # slow to import: cabinets that move

    moving, of_body = _motion(cabinet), _motion(body)
    relative = generic(motion_in)(moving, of_body)
    accelerations = generic(rates_in)(moving, *_vectors(cabinet_rates), of_body, *_vectors(rates))
    matrices = np.stack(relative.rotation, axis=1).reshape(-1, 3, 3)
    angles = np.full((len(body), 3), np.nan)
    good = np.isfinite(matrices).all(axis=(1, 2))  # a run that diverged has other samples
    if good.any():
        angles[good] = Rotation.from_matrix(matrices[good]).as_euler("xyz")  # space-fixed
    vectors = relative.position, relative.angular_velocity, relative.velocity
    motion = np.column_stack([angles, *(np.stack(vector, axis=1) for vector in vectors)])
    return motion, np.column_stack([np.stack(vector, axis=1) for vector in accelerations])


def _motion(states: FloatArray) -> TubMotion:
    """Return a motion as `TubMotion` of arrays (n,)."""
    angles, position, w, v = _vectors(states)
    return TubMotion(generic(rotation_from_rpy)(*angles), position, w, v)


def _vectors(columns: FloatArray) -> list[tuple[FloatArray, ...]]:
    """Return groups of three columns."""
    return [tuple(columns[:, k : k + 3].T) for k in range(0, columns.shape[1], 3)]
