"""Liquid balancer: a partly filled ring on the drum, whose liquid is pushed aside by a whirl.

Above the critical speeds the liquid gathers opposite to the unbalance, below them beside it. Own
derivation; `docs/theory/liquid-ring.md` shows it. The liquid turns at w; in the field w^2 r of a
whirl whose centre is at the distance e from the axis, its surface is a circle about that centre.
Its centre of mass is then at q(e) from the axis: linear as long as liquid covers the outer wall and
leaves the inner one, then saturating. The liquid is a particle of mass m at q in T, with the axis a
of the drum, at the velocity v in W:

    F = -(m w^2 (q + e(q)) + N) n - c s - (k y + b u.a) a,    m v' = F + m g
    c = m ((R^2/r_s^2 - 1) tau w^2 + c_0)
    I w' = I (W - w)/tau + 2 m w (q + e) q'

n: direction of q; N: wall that holds a pool (`wm_drake.laws.stop`); s: velocity against the drum;
y, u: place and velocity in T along the axis; R, r_s: outer radius and that of the surface at e = 0;
W: rate of the drum. -F acts on the drum where the particle is, beside it -I (W - w)/tau about the
axis and the gyroscopic moment of I w.
"""

import functools
from collections.abc import Mapping
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, model_validator
from scipy.optimize import brentq

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import sqrt
from wm_drake.compiler.packed import SCALAR, VECTOR, PackedLayout
from wm_drake.compiler.vectors import add, cross, dot, rotate, rotate_back, scale, subtract
from wm_drake.elements.kind import DrumPlace, ElementKind, Output, PlacedElement, RingPicture, State
from wm_drake.elements.on_drum import rate_in_tub, seen_from_drum
from wm_drake.laws.stop import stop_force
from wm_drake.laws.table import CURVE, pack_number, pack_table, stiffness_force
from wm_drake.parameters import units as u
from wm_drake.parameters.element_kinds import DrumElement
from wm_drake.parameters.monotone import monotone_cubics
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit

POINTS = 20
"""Points of the curve e(q)."""
LARGEST_WHIRL = 3.0
"""Largest e of the curve, over the outer radius: there q has 99 % of its largest value or more."""
FULL, STIFF = 0.01, 100.0
"""Largest q, over the outer radius, up to which a ring counts as full, and e/q of a full ring."""
WALL_DAMPING = 0.5
"""Damping ratio along the axis, in which the liquid cannot move; own choice."""
WALL_LOSS = 1.0
"""Loss of the wall that holds a pool, as in `wm_drake.laws.stop`; own choice. [s/m]"""
SLOSH_DAMPING = 0.05
"""Damping ratio of a pool that swings in a ring at rest; own choice."""
SMALLEST = 1e-9
"""Distance from the axis below which the direction of the liquid fades out. [m]"""

NUMBERS = PackedLayout(
    "LiquidRingNumbers",
    centre=VECTOR,
    axis=VECTOR,
    top=VECTOR,
    gravity=VECTOR,
    mass=SCALAR,
    inertia=SCALAR,
    most=SCALAR,
    lag=SCALAR,
    stiffening=SCALAR,
    sloshing=SCALAR,
    stiffness=SCALAR,
    dashpot=SCALAR,
    wall=CURVE,
    whirl=CURVE,
)
"""Centre of the ring from To, axis of the drum and direction to its top at angle 0, in T; gravity
in W [m/s^2]; m [kg]; I [kg m^2]; largest q [m]; tau [s]; R^2/r_s^2 - 1; c_0 [1/s]; k [N/m],
b [N s/m]; stiffness of the wall [N/m]; e(q) [m]."""
read_numbers = NUMBERS.read


class LiquidRing(DrumElement):
    """A liquid balancer: a partly filled ring on the drum. A chamber of a ring is such an element.

    The static equilibrium, and with it the preload of the springs, is that without the liquid.

    Attributes:
        inner_radius, outer_radius: Radii of the chamber.
        width: Width of the chamber along the axis.
        fill: Part of the chamber that is filled.
        density: Density of the liquid.
        lag: Time constant with which the liquid follows the centrifugal field and the speed of the
            drum.
        wall_frequency: Natural frequency of the liquid along the axis, and of a pool on the wall.
            The mass that moves along the axis is too large by the square of spin speed over this
            frequency.
    """

    inner_radius: Annotated[u.Length, Field(ge=0.0)]
    outer_radius: Annotated[u.Length, Field(gt=0.0)]
    width: Annotated[u.Length, Field(gt=0.0)]
    fill: Annotated[u.Ratio, Field(gt=0.0, le=1.0)]
    density: Annotated[float, Unit("kg/m^3", "kg/m^3"), Field(gt=0.0)] = 1000.0
    lag: Annotated[u.Duration, Field(gt=0.0)]
    wall_frequency: Annotated[u.Speed, Field(gt=0.0)] = 200.0 * np.pi

    @model_validator(mode="after")
    def _has_a_chamber(self) -> Self:
        """Check the radii."""
        if self.inner_radius >= self.outer_radius:
            raise ValueError("inner_radius: must be smaller than outer_radius")
        return self

    @property
    def surface_radius(self) -> float:
        """Return the radius of the surface of a liquid that turns about the axis. [m]"""
        outer, inner = self.outer_radius**2, self.inner_radius**2
        return float(np.sqrt(outer - self.fill * (outer - inner)))

    @property
    def mass(self) -> float:
        """Return the mass of the liquid. [kg]"""
        area = np.pi * (self.outer_radius**2 - self.surface_radius**2)
        return float(self.density * self.width * area)

    @property
    def capacity(self) -> float:
        """Return the largest first moment of the liquid, all of it at one side. [kg m]"""
        return self.mass * float(self.offsets(np.array([1e3 * self.outer_radius]))[0])

    @property
    def closes_from(self) -> float:
        """Return the speed from which gravity of 9.81 m/s^2 leaves liquid all around. [rad/s]

        W^2 = g (R + r_s) / R^2, without lag: there the surface touches the top of the outer wall.
        """
        return float(np.sqrt(9.81 * (self.outer_radius + self.surface_radius)) / self.outer_radius)

    def offsets(self, whirl: FloatArray) -> FloatArray:
        """Return q, the distance of the centre of mass from the axis, for e > 0. (n,) [m]"""
        outer, inner = self.outer_radius, self.inner_radius
        empty = (1.0 - self.fill) * np.pi * (outer**2 - inner**2)
        values = []
        for e in whirl.tolist():

            def excess(radius: float, e: float = e) -> float:
                return _in_surface(outer, radius, e)[0] - _in_surface(inner, radius, e)[0] - empty

            radius = brentq(excess, 0.0, e + outer, xtol=1e-15)
            lever = _in_surface(outer, radius, e)[1] - _in_surface(inner, radius, e)[1]
            values.append(e * lever / (self.fill * np.pi * (outer**2 - inner**2)))
        return np.array(values)


def _in_surface(wall: float, surface: float, e: float) -> tuple[float, float]:
    """Return what a circle of the surface cuts out of a circle of a wall. [m^2]

    Args:
        wall, surface: Radii. [m]
        e: Distance of their centres, > 0. [m]

    Returns:
        Area in both circles; and its first moment about the centre of the wall, over e, to the
        centre of the surface.
    """
    if e + surface <= wall:
        return np.pi * surface**2, np.pi * surface**2
    if e + wall <= surface:
        return np.pi * wall**2, 0.0
    if wall + surface <= e:
        return 0.0, 0.0
    to_chord = (e**2 + wall**2 - surface**2) / (2.0 * e)
    half = np.sqrt(max(wall**2 - to_chord**2, 0.0))
    beyond = surface**2 * np.arctan2(half, e - to_chord) - (e - to_chord) * half
    return wall**2 * np.arctan2(half, to_chord) - to_chord * half + beyond, beyond


@law
def liquid_ring(motion, state, p, at):
    """Return the wrench on the tub with the torque on the drum, outputs, and rates of the states.

    Args:
        motion: `DrumMotion`.
        state: Place from the centre of the ring in T [m], velocity in W [m/s], spin w [rad/s].
        p, at: Packed numbers.
    """
    numbers = read_numbers(p, at)
    axis, mass, spin = numbers.axis, numbers.mass, state.spin
    place = (state.place_x, state.place_y, state.place_z)
    velocity = (state.velocity_x, state.velocity_y, state.velocity_z)
    w = rotate_back(motion.rotation, motion.angular_velocity)
    arm = add(numbers.centre, place)
    rate = rate_in_tub(motion, arm, velocity)
    along, pushed = dot(place, axis), dot(rate, axis)
    across = subtract(place, scale(along, axis))
    q = sqrt(dot(across, across) + SMALLEST * SMALLEST)
    outward = scale(1.0 / q, across)
    reach, growth = q + stiffness_force(q, *numbers.whirl), dot(rate, outward)
    wall = stop_force(q - numbers.most, growth, WALL_LOSS, numbers.wall)
    pull = mass * spin * spin * reach + wall
    guide = numbers.stiffness * along + numbers.dashpot * pushed
    slip = subtract(rate, add(scale(pushed, axis), scale(motion.drum_rate, cross(axis, place))))
    drag = mass * (numbers.stiffening * numbers.lag * spin * spin + numbers.sloshing)
    on_drum = add(add(scale(pull, outward), scale(guide, axis)), scale(drag, slip))
    spinning_up = (motion.drum_rate + dot(w, axis) - spin) / numbers.lag
    spin_rate = spinning_up + 2.0 * mass / numbers.inertia * spin * reach * growth
    twist = dot(axis, cross(place, on_drum)) - numbers.inertia * spinning_up
    gyroscopic = scale(-numbers.inertia * spin, cross(w, axis))
    moment = add(cross(arm, on_drum), scale(-numbers.inertia * spinning_up, axis))
    m, f = rotate(motion.rotation, add(moment, gyroscopic)), rotate(motion.rotation, on_drum)
    a = subtract(numbers.gravity, scale(1.0 / mass, f))
    up, side = seen_from_drum(motion, axis, numbers.top, across)
    return (
        (m[0], m[1], m[2], f[0], f[1], f[2], twist),
        (mass * side, 0.0 * up, mass * up, spin),
        (rate[0], rate[1], rate[2], a[0], a[1], a[2], spin_rate),
    )


def numbers_of(parameters: LiquidRing, ends: DrumPlace) -> dict[str, Any]:
    """Return the packed numbers by name."""
    mass, outer = parameters.mass, parameters.outer_radius
    surface, frequency = parameters.surface_radius, parameters.wall_frequency
    most, whirl = _whirl_curve(parameters)
    return {
        "centre": ends.tub_point,
        "axis": ends.tub_rotation[:, 1],
        "top": ends.tub_rotation[:, 2],
        "gravity": ends.gravity,
        "mass": mass,
        "inertia": 0.5 * mass * (outer**2 + surface**2),
        "most": most,
        "lag": parameters.lag,
        "stiffening": (outer / surface) ** 2 - 1.0 if most else 1.0,
        "sloshing": 2.0 * SLOSH_DAMPING * np.sqrt(np.linalg.norm(ends.gravity) / outer),
        "stiffness": mass * frequency**2,
        "dashpot": 2.0 * WALL_DAMPING * mass * frequency,
        "wall": pack_number(mass * frequency**2),
        "whirl": whirl,
    }


def _whirl_curve(parameters: LiquidRing) -> tuple[float, FloatArray]:
    """Return the largest q, 0 for a full ring, and the packed curve e(q). [m]"""
    outer, surface = parameters.outer_radius, parameters.surface_radius
    largest = LARGEST_WHIRL * outer
    free = max(min(outer - surface, surface - parameters.inner_radius), 1e-3 * outer)
    whirl = np.concatenate([[0.0, 0.5 * free], np.geomspace(free, largest, POINTS - 2)])
    q = np.concatenate([[0.0], parameters.offsets(whirl[1:])])
    most = float(q[-1])
    if most < FULL * outer:
        q, most = whirl / STIFF, 0.0
    cubics = monotone_cubics(q, whirl[:, None])[:, :, 0]
    (_, a, b, c), h = cubics[:, -1], q[-1] - q[-2]
    return most, pack_table(q, cubics, a + h * (2.0 * b + h * 3.0 * c))


def placed_ring(ends: DrumPlace, parameters: LiquidRing) -> PlacedElement:
    """Return a ring in its place; at the start its liquid hangs in the field of a steady drum."""
    numbers = numbers_of(parameters, ends)
    start = functools.partial(_hanging, parameters, numbers["most"], ends.gravity)
    return PlacedElement(LIQUID_RING, ends, NUMBERS.pack(**numbers), start)


def _hanging(
    parameters: LiquidRing, most: float, gravity: FloatArray, drum_rate: float
) -> FloatArray:
    """Return the states of a ring whose drum turns at a rate: q + e(q) = g/W^2, no lag. (7,)"""
    fall, largest = float(np.linalg.norm(gravity)), LARGEST_WHIRL * parameters.outer_radius
    state = np.zeros(7)
    state[6] = drum_rate
    if most and fall:
        distance = most
        if fall < (most + largest) * drum_rate**2:

            def excess(e: float) -> float:
                return float(parameters.offsets(np.array([e]))[0]) + e - fall / drum_rate**2

            e = brentq(excess, 1e-12, largest)
            distance = float(parameters.offsets(np.array([e]))[0])
        state[:3] = distance * gravity / fall
    return state


def places_of(ring: LiquidRing, outputs: Mapping[str, FloatArray]) -> FloatArray:
    """Return the place of the centre of mass of the liquid in D, as `RingPicture.places`."""
    return (outputs["moment"] / ring.mass + np.array([0.0, ring.y, 0.0]))[:, None]


LIQUID_RING = ElementKind(
    name="liquid_ring",
    parameters=LiquidRing,
    layout=NUMBERS,
    numbers=numbers_of,
    evaluate=liquid_ring,
    outputs=(
        Output("moment", "kg m", "first moment of the liquid of a ring, in the drum", 3),
        Output("spin", "rad/s", "rate at which the liquid of a ring turns"),
    ),
    states=(
        *(State(f"place_{axis}", "m") for axis in "xyz"),
        *(State(f"velocity_{axis}", "m/s") for axis in "xyz"),
        State("spin", "rad/s"),
    ),
    acts_at_rest=False,
    words="partly filled ring of liquid on the drum",
    picture="points",
    ring=RingPicture(("outer_radius", "inner_radius"), "width", places_of, is_liquid=True),
    place=placed_ring,
)
"""The kind in machine files."""
