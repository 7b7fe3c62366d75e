"""Tables of friction and forces of loads for machines by their steady motion.

`steady_motion` has the equations. A run-up is taken for a sequence of steady motions, so that a
largest value is that over the speeds. That of a run is smaller where a resonance is passed quickly.
"""

import numpy as np

from analysis_tools.steady_motion import Friction, bushing_damping, damper_stiffness
from wm_drake.engines.compiled.mechanics import BODIES, mass_properties
from wm_drake.parameters.spin import Unbalance
from wm_drake.parameters.types import ComplexArray, FloatArray

SPEEDS = np.array([*range(66, 258, 12), 270, 300, 330]) * np.pi / 30.0
"""Speeds of the drum: the resonances of the machines of the net are between. [rad/s]"""

AMPLITUDES = np.geomspace(3e-4, 0.04, 7)
"""Amplitudes of the elongation of a damper in its table. [m]"""

TABLE_SPEEDS = np.array([66.0, 140.0, 330.0]) * np.pi / 30.0
RATES = np.geomspace(0.02, 10.0, 10)
"""Amplitudes of the rate of an end bushing in its table. [rad/s]"""


def mass_matrix(packed: FloatArray) -> FloatArray:
    """Return the mass matrix of tub and drum about To at drum angle 0. (6, 6)"""
    bodies, drum = BODIES.unpack(packed), mass_properties(packed, 1.0, 0.0)
    xx, yy, zz, xy, xz, yz = np.add(bodies.tub_inertia, drum.drum_inertia)
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    moment = cross_matrix(np.add(bodies.tub_moment, drum.drum_moment))
    return np.block([[inertia, moment], [-moment, np.eye(3) / bodies.inverse_mass]])


def cross_matrix(vector: FloatArray) -> FloatArray:
    """Return the matrix of the cross product with a vector from the left. (3, 3)"""
    return np.cross(vector, np.eye(3)).T


def unbalance(
    unbalance: Unbalance, radius: FloatArray, y: FloatArray, gravity: float
) -> tuple[FloatArray, ComplexArray]:
    """Return mean mass matrices (n, 6, 6) and generalized forces (n, speed, 6) of an unbalance.

    A mass m at the angle t of the drum is at (r sin t, y, r cos t). Its inertia acts at To with m r
    w^2 along this line, its weight with the moment m g r sin t about y, since the drum turns at a
    given speed against the tub.

    Args:
        unbalance: Its mass and phase.
        radius, y: Its place in each of some machines. (n,) [m]
        gravity: [m/s^2]
    """
    m = unbalance.mass
    turned = m * np.exp(1j * unbalance.phase) * radius[:, None]
    x_force, z_force = -1j * turned * SPEEDS**2, turned * SPEEDS**2
    arm, weight = y[:, None], -1j * gravity * np.broadcast_to(turned, x_force.shape)
    force = np.stack(
        [arm * z_force, weight, -arm * x_force, x_force, np.zeros_like(x_force), z_force], axis=-1
    )
    mass = np.zeros((len(y), 6, 6))
    mass[:, 0, 0] = mass[:, 2, 2] = m * (y**2 + radius**2 / 2.0)
    mass[:, 1, 1] = m * radius**2
    mass[:, 3:, 3:] = m * np.eye(3)
    mass[:, 0, 5] = mass[:, 5, 0] = m * y
    mass[:, 2, 3] = mass[:, 3, 2] = -m * y
    return mass, force


def friction_of(law: FloatArray, friction_torque: float, full_friction_rate: float) -> Friction:
    """Return the tables of dampers with a packed law and of their end bushings. [N m, rad/s]"""
    stiffness = np.empty((len(AMPLITUDES), len(TABLE_SPEEDS)), dtype=complex)
    damper_stiffness(law, AMPLITUDES, TABLE_SPEEDS, stiffness)
    damping = np.empty(len(RATES))
    bushing_damping(RATES, full_friction_rate, friction_torque, damping)
    return Friction(AMPLITUDES, TABLE_SPEEDS, stiffness, RATES, damping)
