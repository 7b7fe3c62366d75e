"""How fast a drum moves in a bearing that gives: what the integration step has to follow."""

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
    """Largest modulus of the eigenvalues of tub and drum on the bearing alone. [rad/s]

    The drum does not turn against its carrier here; gyroscopic moments raise the fastest frequency of a stiff bearing by no
    more than about the drum's speed.

    Args:
        plant, context: The plant and its Context.
        state_layout: Of the plant.
        bearing: Of the drum; its stiffnesses are numbers.
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
    """From angular velocity and velocity of tub and carrier to velocity and angular velocity in the bearing, when drawn."""
    x, y, z = bearing.ground_side_point
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])  # p x .
    turn = bearing.ground_side_rotation.T
    of_carrier = np.block([[-turn @ cross, turn], [turn, np.zeros((3, 3))]])
    return np.hstack([-of_carrier, of_carrier])
