"""A liquid balancer: a partly filled ring on the drum, whose liquid is pushed aside by a whirl.

Above the critical speeds the liquid gathers opposite to the unbalance, below them beside it. Own
derivation; `docs/theory/liquid-ring.md` shows it: the first-order motion of an inviscid layer that
turns at w, for forces of any direction and frequency. With L = R^2/r_s^2 the liquid of mass M acts
as a rigid mass M L/(L + 1) on the axis of the drum (`mass_on_drum`), and a particle of mass
m = M/(L + 1) at s from the axis. The centre of mass of the liquid is at q = s/(L + 1):

    F = -(m w^2 (s + e(q)) + N) n + m (4 L/(L + 1)) w a x s' - m d/tau - (k y + b u.a) a
    m v' = F + m g
    I w' = I (W - w)/tau + m w (2 (s + e) - 4 L/(L + 1) s) n.s'

n: direction of s; e(q): distance of the centre of a forward whirl whose field holds the liquid at
q, (L - 1) q as long as liquid covers the outer wall and leaves the inner one; N: wall that holds a
pool (`wm_drake.laws.stop`); s': velocity seen from a frame that turns at w; d: velocity against the
drum; a: axis; y, u: place and velocity in T along the axis; R, r_s: radii of the outer wall and of
the surface at rest in the drum; W: rate of the drum. Pressure acts through the axis of the drum,
the drag -m d/tau where the particle is. -F acts on the drum, beside it -I (W - w)/tau about the
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
SMALLEST = 1e-9
"""Distance from the axis below which the direction of the liquid fades out. [m]"""

NUMBERS = PackedLayout(
    "LiquidRingNumbers",
    centre=VECTOR,
    axis=VECTOR,
    top=VECTOR,
    gravity=VECTOR,
    mass=SCALAR,
    ratio=SCALAR,
    coriolis=SCALAR,
    inertia=SCALAR,
    most=SCALAR,
    lag=SCALAR,
    stiffness=SCALAR,
    dashpot=SCALAR,
    wall=CURVE,
    whirl=CURVE,
)
"""Centre of the ring from To, axis of the drum and direction to its top at angle 0, in T; gravity
in W [m/s^2]; m [kg]; L + 1; 4 L/(L + 1); I [kg m^2]; largest s [m]; tau [s]; k [N/m], b [N s/m];
stiffness of the wall [N/m]; e(q) over s [m]."""
read_numbers = NUMBERS.read


class LiquidRing(DrumElement):
    """A liquid balancer: a partly filled ring on the drum. A chamber of a ring is such an element.

    The static equilibrium, and with it the preload of the springs, is that without the liquid.

    Attributes:
        inner_radius, outer_radius: Radii of the chamber.
        width: Width of the chamber along the axis.
        fill: Part of the chamber that is filled.
        density: Density of the liquid.
        lag: Time constant of the drag of baffles and walls on liquid that moves against the drum.
            Walls alone give 1 to 4 s; for baffles nothing is published.
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

        W^2 = g (R + r_s) / (2 R^2), without drag: there the surface, which gravity moves down by
        g (L - 1)/(2 L W^2), touches the bottom of the outer wall.
        """
        return float(
            np.sqrt(0.5 * 9.81 * (self.outer_radius + self.surface_radius)) / self.outer_radius
        )

    @property
    def is_full(self) -> bool:
        """Return whether the liquid has no room to move, and is plain mass."""
        largest = LARGEST_WHIRL * self.outer_radius
        return float(self.offsets(np.array([largest]))[0]) < FULL * self.outer_radius

    @property
    def ratio(self) -> float:
        """Return s/q = L + 1, the whole mass over that of the particle; 1 for a full ring."""
        return 1.0 if self.is_full else (self.outer_radius / self.surface_radius) ** 2 + 1.0

    @property
    def mass_on_drum(self) -> float:
        """Return the part of the mass that moves with the axis of the drum. [kg]"""
        return self.mass * (1.0 - 1.0 / self.ratio)

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
        state: Place q of the centre of mass of the liquid from the centre of the ring, in T [m];
            velocity of the particle in W [m/s]; spin w [rad/s].
        p, at: Packed numbers.
    """
    numbers = read_numbers(p, at)
    axis, mass, spin = numbers.axis, numbers.mass, state.spin
    place = scale(numbers.ratio, (state.place_x, state.place_y, state.place_z))
    velocity = (state.velocity_x, state.velocity_y, state.velocity_z)
    w = rotate_back(motion.rotation, motion.angular_velocity)
    rate = rate_in_tub(motion, add(numbers.centre, place), velocity)
    along, pushed, turning = dot(place, axis), dot(rate, axis), dot(w, axis)
    across = subtract(place, scale(along, axis))
    s = sqrt(dot(across, across) + SMALLEST * SMALLEST)
    outward, ahead = scale(1.0 / s, across), cross(axis, place)
    reach, growth = s + stiffness_force(s, *numbers.whirl), dot(rate, outward)
    wall = stop_force(s - numbers.most, growth, WALL_LOSS, numbers.wall)
    in_plane = subtract(rate, scale(pushed, axis))
    flow = subtract(in_plane, scale(spin - turning, ahead))
    drag = scale(mass / numbers.lag, subtract(in_plane, scale(motion.drum_rate, ahead)))
    guide = scale(numbers.stiffness * along + numbers.dashpot * pushed, axis)
    pressure = subtract(
        scale(mass * spin * spin * reach + wall, outward),
        scale(mass * numbers.coriolis * spin, cross(axis, flow)),
    )
    on_drum = add(add(pressure, guide), drag)
    spinning_up = (motion.drum_rate + turning - spin) / numbers.lag
    excess = 2.0 * reach - numbers.coriolis * s
    spin_rate = spinning_up + mass / numbers.inertia * spin * excess * growth
    dragged = cross(across, add(drag, guide))
    twist = dot(axis, dragged) - numbers.inertia * spinning_up
    gyroscopic = scale(-numbers.inertia * spin, cross(w, axis))
    moment = add(cross(add(numbers.centre, scale(along, axis)), on_drum), dragged)
    moment = add(moment, scale(-numbers.inertia * spinning_up, axis))
    m, f = rotate(motion.rotation, add(moment, gyroscopic)), rotate(motion.rotation, on_drum)
    a = subtract(numbers.gravity, scale(1.0 / mass, f))
    up, side = seen_from_drum(motion, axis, numbers.top, across)
    return (
        (m[0], m[1], m[2], f[0], f[1], f[2], twist),
        (mass * side, 0.0 * up, mass * up, spin),
        (*scale(1.0 / numbers.ratio, rate), a[0], a[1], a[2], spin_rate),
    )


def numbers_of(parameters: LiquidRing, ends: DrumPlace) -> dict[str, Any]:
    """Return the packed numbers by name."""
    mass = parameters.mass - parameters.mass_on_drum
    outer, surface = parameters.outer_radius, parameters.surface_radius
    frequency, ratio = parameters.wall_frequency, parameters.ratio
    most, whirl = _whirl_curve(parameters)
    return {
        "centre": ends.tub_point,
        "axis": ends.tub_rotation[:, 1],
        "top": ends.tub_rotation[:, 2],
        "gravity": ends.gravity,
        "mass": mass,
        "ratio": ratio,
        "coriolis": 4.0 * (ratio - 1.0) / ratio,
        "inertia": 0.5 * parameters.mass * (outer**2 + surface**2),
        "most": ratio * most,
        "lag": parameters.lag,
        "stiffness": mass * frequency**2,
        "dashpot": 2.0 * WALL_DAMPING * mass * frequency,
        "wall": pack_number(mass * frequency**2),
        "whirl": whirl,
    }


def _whirl_curve(parameters: LiquidRing) -> tuple[float, FloatArray]:
    """Return the largest q, 0 for a full ring, and the packed curve e(q) over s. [m]"""
    outer, surface = parameters.outer_radius, parameters.surface_radius
    largest = LARGEST_WHIRL * outer
    free = max(min(outer - surface, surface - parameters.inner_radius), 1e-3 * outer)
    whirl = np.concatenate([[0.0, 0.5 * free], np.geomspace(free, largest, POINTS - 2)])
    q = np.concatenate([[0.0], parameters.offsets(whirl[1:])])
    most = float(q[-1])
    if parameters.is_full:
        q, most = whirl / STIFF, 0.0
    s = parameters.ratio * q
    cubics = monotone_cubics(s, whirl[:, None])[:, :, 0]
    (_, a, b, c), h = cubics[:, -1], s[-1] - s[-2]
    return most, pack_table(s, cubics, a + h * (2.0 * b + h * 3.0 * c))


def placed_ring(ends: DrumPlace, parameters: LiquidRing) -> PlacedElement:
    """Return a ring in its place; at the start its liquid hangs in the field of a steady drum."""
    numbers = numbers_of(parameters, ends)
    start = functools.partial(_at_start, parameters, numbers["most"], ends.gravity)
    return PlacedElement(LIQUID_RING, ends, NUMBERS.pack(**numbers), start)


def _at_start(
    parameters: LiquidRing, most: float, gravity: FloatArray, drum_rate: float
) -> FloatArray:
    """Return the states of a ring whose drum turns at a rate, without drag. (7,)

    A ring that is closed has its liquid above the axis, at q = -g/(2 L W^2); else it is a pool at
    the bottom.
    """
    fall, ratio = float(np.linalg.norm(gravity)), parameters.ratio
    state = np.zeros(7)
    state[6] = drum_rate
    if most and fall:
        closed = drum_rate >= parameters.closes_from
        lift = -fall / (2.0 * (ratio - 1.0) * drum_rate**2) if closed else most / ratio
        state[:3] = lift * gravity / fall
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
