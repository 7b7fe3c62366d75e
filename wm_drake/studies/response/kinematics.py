"""Which numbers of the state are positions and velocities of bodies, and which spins are free."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from wm_drake.compiler.vectors import rotation_from_sines
from wm_drake.elements.motion import rpy_rates
from wm_drake.elements.state_map import (
    ANGLE,
    ANGULAR_VELOCITY,
    JOINT,
    JOINT_VELOCITY,
    ORDER,
    POSITION,
    TUBES,
    VELOCITY,
)
from wm_drake.engines.compiled.slopes import SlopedDerivative
from wm_drake.model.machine import Setup
from wm_drake.parameters.types import FloatArray

NEUTRAL = 1e-6
"""Largest part of the sum of its terms that the acceleration by a free spin may have."""


@dataclass(frozen=True)
class Kinematics:
    """Indices among the free numbers of the state.

    Attributes:
        turns: Angles of each body (bodies, 3), and their angular velocities.
        shifts: Positions whose time derivative is a number of the state: (k,), and these numbers.
        spins: Damper tubes that nothing holds about their axis.
        count: Number of free numbers.
    """

    turns: tuple[np.ndarray, np.ndarray]
    shifts: tuple[np.ndarray, np.ndarray]
    spins: tuple["Spin", ...]
    count: int

    @cached_property
    def partition(self) -> "Partition":
        """Return positions, velocities and other numbers."""
        positions = np.concatenate([self.turns[0].ravel(), self.shifts[0]])
        velocities = np.concatenate([self.turns[1].ravel(), self.shifts[1]])
        others = np.setdiff1d(np.arange(self.count), velocities)
        return Partition(
            *self.turns,
            positions,
            velocities,
            others,
            np.setdiff1d(np.arange(self.count), positions),
            np.searchsorted(others, positions),
        )

    def spin_rates(self, mean: FloatArray, rates: FloatArray) -> FloatArray:
        """Return the rate of each free spin of a steady motion. (spins,) [rad/s]

        Args:
            mean: Mean of each number over a revolution. (n,)
            rates: Mean of its time derivative, which only a spin can make. (n,)
        """
        directions = [spin.direction(mean) for spin in self.spins]
        return np.array([rates @ d / (d @ d) for d in directions])


class Partition(NamedTuple):
    """Indices among the free numbers of the state, for compiled code.

    Attributes:
        turned, turning: Angles of each body, and their angular velocities. (bodies, 3)
        positions: Angles of all bodies, then other positions. (p,)
        velocities: Angular velocities, then the time derivatives of the other positions. (p,)
        others: All numbers but velocities.
        dynamic: All numbers but positions.
        places: Place of each of the positions in `others`. (p,)
    """

    turned: np.ndarray
    turning: np.ndarray
    positions: np.ndarray
    velocities: np.ndarray
    others: np.ndarray
    dynamic: np.ndarray
    places: np.ndarray


@dataclass(frozen=True)
class Spin:
    """Rotation of a telescopic damper about its axis.

    Attributes:
        name: Of the damper.
        angles, position: Indices of roll, pitch, yaw and of the position of the outer tube.
        axis: Direction of the damper in the frame of the outer tube.
        point: Point of the axis in this frame. [m]
    """

    name: str
    angles: np.ndarray
    position: np.ndarray
    axis: FloatArray
    point: FloatArray

    def direction(self, numbers: FloatArray) -> FloatArray:
        """Return the rates of the free numbers by a spin of 1 rad/s.

        Args:
            numbers: (n,) free numbers of the state.
        """
        angles = [(np.sin(angle), np.cos(angle)) for angle in numbers[self.angles]]
        tube = np.reshape(rotation_from_sines(*angles), (3, 3))
        axis = tube @ self.axis
        direction = np.zeros(len(numbers))
        direction[self.angles] = rpy_rates(tuple(axis), *angles[1:])
        direction[self.position] = -np.cross(axis, tube @ self.point)
        return direction


def kinematics_of(derivative: SlopedDerivative, setup: Setup) -> Kinematics:
    """Return the kinematics of a machine."""
    place = {int(number): index for index, number in enumerate(derivative.free)}
    states = derivative.layout.states

    def places(*roles: str, kinds: Sequence[str] = ORDER) -> list[int]:
        return [place[k] for k in states.indices(*roles, kinds=kinds).tolist()]

    angles, positions = places(ANGLE), places(POSITION)
    rates, velocities = places(ANGULAR_VELOCITY), places(VELOCITY)
    angles_of_tubes = np.reshape(places(ANGLE, kinds=[TUBES]), (-1, 3))
    positions_of_tubes = np.reshape(places(POSITION, kinds=[TUBES]), (-1, 3))
    spins = [
        Spin(
            name,
            angles_of_tubes[i],
            positions_of_tubes[i],
            telescope.axis,
            telescope.tub_bushing.ground_side_point,
        )
        for i, (name, telescope) in enumerate(setup.telescopes.items())
    ]
    return Kinematics(
        (np.reshape(angles, (-1, 3)), np.reshape(rates, (-1, 3))),
        (
            np.array(positions + places(JOINT, kinds=[TUBES])),
            np.array(velocities + places(JOINT_VELOCITY, kinds=[TUBES])),
        ),
        tuple(spin for spin in spins if _is_neutral(spin, derivative)),
        len(derivative.free),
    )


def _is_neutral(spin: Spin, derivative: SlopedDerivative) -> bool:
    """Return whether a spin from rest changes no force."""
    slopes = derivative.jacobian(derivative.rest[None])[0]
    direction = spin.direction(derivative.rest[derivative.free])
    change = np.abs(slopes @ direction)
    return bool(np.all(change <= NEUTRAL * np.max(np.abs(slopes) @ np.abs(direction))))
