"""State of a deformed ring: its stretch, its stress, its wrinkles."""

from dataclasses import dataclass

import numpy as np

from wm_drake.parameters.gasket_drawing import Rubber
from wm_drake.parameters.types import FloatArray
from wm_drake.solid.element import GRADIENTS
from wm_drake.solid.mesh import Ring

FIRST_WRINKLE = 4
"""Smallest number of waves around the whole ring that counts as wrinkles, not as the motion."""


@dataclass(frozen=True)
class Deformed:
    """Largest stretch and stress of a deformed ring.

    Attributes:
        stretch: Largest principal stretch at a Gauss point.
        stress: Largest equivalent stress of von Mises there. [Pa]
    """

    stretch: float
    stress: float


def deformed(ring: Ring, rubber: Rubber, u: FloatArray) -> Deformed:
    """Return the largest stretch and stress of a ring.

    The equivalent stress has no part of the pressure: with b = F F^T / J^(2/3) it is the size
    sqrt(3/2) of the deviator of 2 W'(I) b / J.

    Args:
        u: Displacements of the nodes. (nodes, 3) [m]
    """
    moved = np.einsum("eaik,eak->eai", ring.frames, u[ring.nodes])
    jacobian = np.einsum("qna,enb->eqab", GRADIENTS, ring.places)
    gradient = np.einsum("qna,eni->eqia", GRADIENTS, moved)
    F = np.eye(3) + gradient @ np.linalg.inv(jacobian).swapaxes(-1, -2)
    J = np.linalg.det(F)
    b = (F @ F.swapaxes(-1, -2)) * J[..., None, None] ** (-2.0 / 3.0)
    first = np.trace(b, axis1=-2, axis2=-1)
    c1, c2, c3 = rubber.constants
    slope = c1 + (first - 3.0) * (2.0 * c2 + 3.0 * (first - 3.0) * c3)
    deviator = (b - first[..., None, None] / 3.0 * np.eye(3)) * (2.0 * slope / J)[..., None, None]
    stress = np.sqrt(1.5 * np.sum(deviator**2, axis=(-2, -1)))
    stretch = np.sqrt(np.linalg.eigvalsh(F.swapaxes(-1, -2) @ F)[..., -1])
    return Deformed(float(stretch.max()), float(stress.max()))


def wrinkles(ring: Ring, u: FloatArray) -> float:
    """Return the amplitude of wrinkles, in parts of the largest displacement; 0 for a wedge.

    It is the largest coefficient of cos(n θ) with n of `FIRST_WRINKLE` or more in the radial and
    the axial displacement of the middle of the wall, θ the angle about the axis.

    Args:
        u: Displacements of the nodes. (nodes, 3) [m]
    """
    if ring.grid.shape[1] == 1:
        return 0.0
    from scipy.fft import dct

    numbers = ring.grid[:, :, 1]
    x, y, z = np.moveaxis(u[numbers], -1, 0)
    angles = np.linspace(0.0, np.pi, numbers.shape[1])
    waves = dct([x * np.cos(angles) + z * np.sin(angles), y], type=1) / (numbers.shape[1] - 1)
    largest = float(np.linalg.norm(u, axis=-1).max())
    return float(np.abs(waves[..., FIRST_WRINKLE:]).max()) / largest if largest else 0.0
