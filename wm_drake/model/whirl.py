"""Fastest motion of a drum in a compliant bearing, which limits the step size."""

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context

from wm_drake.elements.bushing import SixComponentBushingParameters
from wm_drake.model.state_layout import StateLayout
from wm_drake.parameters.types import FloatArray


def max_bearing_eigenvalue(
    plant: MultibodyPlant,
    context: Context,
    state_layout: StateLayout,
    bearing: SixComponentBushingParameters,
) -> float:
    """Return the largest modulus of the eigenvalues of tub and drum on the bearing alone. [rad/s]

    The drum does not turn against its carrier here. Gyroscopic moments raise the largest eigenvalue
    of a stiff bearing by about the drum speed at most.

    Args:
        plant, context: The plant and its Context.
        state_layout: State layout of the plant.
        bearing: Bearing of the drum; its stiffnesses are numbers, not tables.
    """
    moving = np.concatenate([state_layout.tub, state_layout.carrier])
    mass = plant.CalcMassMatrix(context)[np.ix_(moving, moving)]
    relative = _relative_motion(bearing)
    rates = np.zeros((24, 24))
    rates[:12, 12:] = np.eye(12)
    rates[12:, :12] = -np.linalg.solve(mass, relative.T @ (bearing.stiffness[:, None] * relative))
    rates[12:, 12:] = -np.linalg.solve(mass, relative.T @ (bearing.damping[:, None] * relative))
    return float(np.max(np.abs(np.linalg.eigvals(rates))))


def _relative_motion(bearing: SixComponentBushingParameters) -> FloatArray:
    """Return the matrix (6, 12) from velocities of tub and carrier to those in the bearing.

    The columns are angular velocity and velocity of the tub, then of the carrier, in W. The rows
    are velocity and angular velocity of the carrier against the tub, in the frame of the bearing
    at the drawn pose.
    """
    x, y, z = bearing.ground_side_point
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])  # p x .
    turn = bearing.ground_side_rotation.T
    of_carrier = np.block([[-turn @ cross, turn], [turn, np.zeros((3, 3))]])
    return np.hstack([-of_carrier, of_carrier])
