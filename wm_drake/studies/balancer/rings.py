"""Rings of balls of a machine: free, locked or changed, and what they can balance."""

import numpy as np

from wm_drake.elements.ball_ring import BallRing
from wm_drake.parameters import Load, MachineParameters, Unbalance, with_values
from wm_drake.simulation.balance import in_planes, rings_of


def balls_of(parameters: MachineParameters) -> dict[str, BallRing]:
    """Return the rings of balls of a machine by name."""
    return {n: e for n, e in rings_of(parameters).items() if isinstance(e, BallRing)}


def without_rings(parameters: MachineParameters) -> MachineParameters:
    """Return the machine without its rings of balls and liquid."""
    rings = rings_of(parameters)
    others = {name: e for name, e in parameters.elements.items() if name not in rings}
    return parameters.model_copy(update={"elements": others})


def locked(load: Load, parameters: MachineParameters) -> Load:
    """Return a load with all balls of a machine as point masses, evenly spread in their races."""
    balls = [
        Unbalance(mass=r.ball_mass, radius=r.race_radius, y=r.y, phase=angle)
        for r in balls_of(parameters).values()
        for angle in spread(r)
    ]
    return load.model_copy(update={"unbalances": (*load.unbalances, *balls)})


def spread(ring: BallRing) -> tuple[float, ...]:
    """Return the angles of balls that are evenly spread in their race. [rad]"""
    return tuple((2.0 * np.pi / ring.balls * np.arange(ring.balls)).tolist())


def capacity_of(ring: BallRing) -> float:
    """Return the first moment of the balls of a ring, side by side. [kg m]"""
    touching = 2.0 * np.arcsin(0.5 * ring.ball_diameter / ring.race_radius)
    angles = touching * (np.arange(ring.balls) - 0.5 * (ring.balls - 1))
    return float(ring.ball_mass * ring.race_radius * np.cos(angles).sum())


def capacities_of(parameters: MachineParameters) -> dict[float, float]:
    """Return the first moment of the balls in the planes of the outermost rings. [kg m by m]

    The balls of a ring between them count in both, by the lever rule.
    """
    rings = balls_of(parameters).values()
    planes = np.unique([min(r.y for r in rings), max(r.y for r in rings)])
    total = np.zeros(len(planes))
    for ring in rings:
        moment = np.array([capacity_of(ring), 0.0])
        total += np.abs(in_planes(moment, ring.y * moment, planes)[:, 0])
    return dict(zip(planes.tolist(), total.tolist(), strict=True))


def is_within(capacities: dict[float, float], moment: float, y: float) -> bool:
    """Return whether the share of an unbalance in each plane is below the capacity there.

    Args:
        capacities: As of `capacities_of`.
        moment, y: Mass times radius, and its place. [kg m, m]
    """
    size, planes = np.array([moment, 0.0]), np.array(list(capacities))
    shares = np.abs(in_planes(size, y * size, planes)[:, 0])
    return bool((shares <= list(capacities.values())).all())


def picked_up_from(parameters: MachineParameters) -> float:
    """Return the speed from which the drum carries all balls round, m g R/d. [rad/s]

    Below it, a ball whose drag against the drum is d W stays in the lower half of its race, at
    rest. It is infinite without damping.
    """
    speeds = [
        r.ball_mass * parameters.gravity * r.race_radius / r.damping if r.damping else np.inf
        for r in balls_of(parameters).values()
    ]
    return float(max(speeds))


def with_factors(
    parameters: MachineParameters, ball_mass: float, damping: float
) -> MachineParameters:
    """Return a machine with factors on the mass of all balls and on the damping of all races."""
    values = {
        key: value
        for name, ring in balls_of(parameters).items()
        for key, value in (
            (f"elements.{name}.ball_mass", ball_mass * ring.ball_mass),
            (f"elements.{name}.damping", damping * ring.damping),
        )
    }
    return with_values(parameters, values)
