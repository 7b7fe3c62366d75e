"""Ball balancer: a ring of balls that roll in a race on the drum, each a particle of its own.

Above the critical speeds the balls settle opposite to the unbalance, below them beside it. Own
derivation; `docs/theory/ball-ring.md` shows it, and says why the race has a stiffness. In the frame
T of the tub, for a ball at q from the centre of the race, with the axis a of the drum:

    y = q . a,   r = |q - y a|,   n = (q - y a)/r,   t = a x n,   u = q'
    F = -(k (r - R) + c u.n) n - (k y + c u.a) a - (d s/R^2 - f) t
    s = u.t - r phi',    N = k (r - R) + c u.n,    m v' = F + F_contact + m g

v: velocity in W; phi': rate of the drum; s: velocity of the ball's centre against the race; f:
rolling resistance (`wm_drake.laws.rolling`). The centre of the race turns with the drum at its
eccentricity from the axis. The force -F acts on the drum where the ball is. Neighbours touch at the
distance D:

    F_contact = (k/s_0) max(0, o (o + tau o')) along the line of centres,  o = max(0, D - distance)
"""

import functools
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, model_validator

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import angle_of, sqrt, where
from wm_drake.compiler.packed import SCALAR, VECTOR, PackedLayout, generated
from wm_drake.compiler.vectors import add, cross, dot, rotate, scale, subtract
from wm_drake.elements.kind import DrumPlace, ElementKind, Output, PlacedElement, RingPicture, State
from wm_drake.elements.on_drum import rate_in_tub, seen_from_drum, turned_with_drum
from wm_drake.laws.rolling import rolling_bristle_rate, rolling_resistance
from wm_drake.parameters import units as u
from wm_drake.parameters.element_kinds import DrumElement
from wm_drake.parameters.types import FloatArray

MOST_BALLS = 16
"""Largest number of balls in a ring: the compiled code grows with it."""
DAMPING_RATIO = 0.5
"""Damping ratio of a ball on the elastic race: the bounce decays within a period; own choice."""
FULL_CONTACT = 0.01
"""Overlap of two balls, as part of their diameter, at which their contact is as stiff as the race;
own choice."""

NUMBERS = PackedLayout(
    "BallRingNumbers",
    centre=VECTOR,
    axis=VECTOR,
    top=VECTOR,
    gravity=VECTOR,
    mass=SCALAR,
    diameter=SCALAR,
    radius=SCALAR,
    damping=SCALAR,
    rolling=SCALAR,
    full_friction=SCALAR,
    rolling_distance=SCALAR,
    runout_up=SCALAR,
    runout_side=SCALAR,
    stiffness=SCALAR,
    dashpot=SCALAR,
)
"""Point of the drum axis from To, axis of the drum and direction to its top at angle 0, in T;
gravity in W [m/s^2]; m [kg]; D, R [m]; d [N m s/rad]; mu; v_t [m/s]; x_c [m]; centre of the race
from the axis, to the top and to the side of the drum [m]; k [N/m], c [N s/m]."""
read_numbers = NUMBERS.read


class BallRing(DrumElement):
    """A ball balancer: a ring of equal balls that roll in a race on the drum.

    The static equilibrium, and with it the preload of the springs, is that without the balls.

    Attributes:
        balls: Number of balls.
        ball_mass: Mass of a ball.
        ball_diameter: Distance of the centres of two balls that touch.
        race_radius: Radius of the circle on which the centres of the balls move.
        damping: Viscous torque about the drum axis on a ball, per rate against the drum.
        rolling_resistance: Rolling friction over the force of the race on a ball.
        full_friction_velocity: Velocity against the race above which the resistance is that of a
            rolling ball; far below it the ball hangs on its contact and may park.
        rolling_distance: Way of a parked ball after which its resistance is 63 % of its full value.
        eccentricity: Distance of the centre of the race from the axis of the drum.
        eccentricity_phase: Its angle from the top of the drum.
        race_frequency: Natural frequency of a ball on its elastic race. The radius of the balls is
            too large by the square of spin speed over this frequency. A quarter of a millisecond is
            a step that follows 500 Hz.
        start_angles: Angle of each ball from the top of the drum at the start, rising within a
            turn. None: side by side at the bottom.
    """

    balls: Annotated[int, Field(ge=1, le=MOST_BALLS)]
    ball_mass: Annotated[u.Mass, Field(gt=0.0)]
    ball_diameter: Annotated[u.Length, Field(gt=0.0)]
    race_radius: Annotated[u.Length, Field(gt=0.0)]
    damping: Annotated[u.RotationalDamping, Field(ge=0.0)]
    rolling_resistance: Annotated[u.Ratio, Field(ge=0.0)] = 0.0
    full_friction_velocity: Annotated[u.Velocity, Field(gt=0.0)] = 0.01
    rolling_distance: Annotated[u.Length, Field(gt=0.0)] = 10e-6
    eccentricity: Annotated[u.Length, Field(ge=0.0)] = 0.0
    eccentricity_phase: u.Angle = 0.0
    race_frequency: Annotated[u.Speed, Field(gt=0.0)] = 1000.0 * np.pi
    start_angles: u.Angles | None = None

    @model_validator(mode="after")
    def _balls_have_room(self) -> Self:
        """Check that the balls do not overlap."""
        apart = 2.0 * np.arcsin(min(1.0, 0.5 * self.ball_diameter / self.race_radius))
        if self.balls * apart > 2.0 * np.pi:
            raise ValueError(f"{self.balls} balls do not fit in the race")
        angles = self.start_angles
        if angles is not None:
            if len(angles) != self.balls:
                raise ValueError(f"start_angles: needs {self.balls} angles; has {len(angles)}")
            gaps = np.diff([*angles, angles[0] + 2.0 * np.pi])
            if self.balls > 1 and gaps.min() < (1.0 - 1e-6) * apart:
                raise ValueError(
                    "start_angles: must rise within a turn, and balls must not overlap"
                )
        return self

    @property
    def first_angles(self) -> FloatArray:
        """Return the angle of each ball from the top of the drum at the start. [rad]"""
        if self.start_angles is not None:
            return np.array(self.start_angles)
        apart = 2.0 * np.arcsin(0.5 * self.ball_diameter / self.race_radius)
        return np.asarray(np.pi + apart * (np.arange(self.balls) - 0.5 * (self.balls - 1)))


@law
def on_ball(motion, numbers, centre, place, velocity, bristle):
    """Return the force of the race on a ball, in T, and the rates of its place and its bristle.

    Args:
        motion: `DrumMotion`.
        numbers: Numbers of `NUMBERS` by name.
        centre: Centre of the race from the axis, in T. [m]
        place: Place of the ball from the axis, in T. [m]
        velocity: Velocity of the ball in W. [m/s]
        bristle: State of `rolling_bristle_rate`.
    """
    axis, radius = numbers.axis, numbers.radius
    rate = rate_in_tub(motion, add(numbers.centre, place), velocity)
    in_race = subtract(place, centre)
    moving = subtract(rate, scale(motion.drum_rate, cross(axis, centre)))
    along = dot(in_race, axis)
    across = subtract(in_race, scale(along, axis))
    distance = sqrt(dot(across, across))
    outward = scale(1.0 / distance, across)
    ahead = cross(axis, outward)
    sliding = dot(moving, ahead) - distance * motion.drum_rate
    push = numbers.stiffness * (distance - radius) + numbers.dashpot * dot(moving, outward)
    guide = numbers.stiffness * along + numbers.dashpot * dot(moving, axis)
    rolling = rolling_resistance(
        abs(push), sliding, bristle, numbers.rolling, numbers.full_friction
    )
    drag = numbers.damping / (radius * radius) * sliding - rolling
    force = add(scale(push, outward), add(scale(guide, axis), scale(drag, ahead)))
    bristle_rate = rolling_bristle_rate(
        sliding, bristle, numbers.rolling_distance, numbers.full_friction
    )
    return scale(-1.0, force), rate, bristle_rate


@law
def contact(numbers, first, first_rate, second, second_rate):
    """Return the force on the first of two balls from the second, in T. [N]

    Args:
        numbers: Numbers of `NUMBERS` by name.
        first, first_rate, second, second_rate: Places of the balls in T, and their rates.
    """
    apart = subtract(first, second)
    distance = sqrt(dot(apart, apart))
    line = scale(1.0 / distance, apart)
    zero = 0.0 * distance
    overlap = where(distance < numbers.diameter, numbers.diameter - distance, zero)
    closing = -dot(subtract(first_rate, second_rate), line)
    stiffness = numbers.stiffness / (FULL_CONTACT * numbers.diameter)
    size = stiffness * overlap * (overlap + numbers.dashpot / numbers.stiffness * closing)
    return scale(where(size > 0.0, size, zero), line)


@law
def ball_angle(motion, numbers, place):
    """Return the angle of a ball from the top of the drum, within half a turn, and its place.

    Args:
        motion, numbers, place: As for `on_ball`.

    Returns:
        Angle [rad]; places of the ball to the top and to the side, in D [m].
    """
    c, s = seen_from_drum(motion, numbers.axis, numbers.top, place)
    size = sqrt(c * c + s * s)
    angle = angle_of(abs(s) / size, c / size)
    return where(s < 0.0, -angle, angle), c, s


LAWS = {
    "read_numbers": read_numbers,
    "on_ball": on_ball,
    "contact": contact,
    "ball_angle": ball_angle,
    "add": add,
    "cross": cross,
    "dot": dot,
    "rotate": rotate,
    "scale": scale,
    "subtract": subtract,
    "turned_with_drum": turned_with_drum,
}
"""Names in the source of the law of a ring."""


def numbers_of(parameters: BallRing, ends: DrumPlace) -> dict[str, Any]:
    """Return the packed numbers by name."""
    stiffness = parameters.ball_mass * parameters.race_frequency**2
    return {
        "centre": ends.tub_point,
        "axis": ends.tub_rotation[:, 1],
        "top": ends.tub_rotation[:, 2],
        "gravity": ends.gravity,
        "mass": parameters.ball_mass,
        "diameter": parameters.ball_diameter,
        "radius": parameters.race_radius,
        "damping": parameters.damping,
        "rolling": parameters.rolling_resistance,
        "full_friction": parameters.full_friction_velocity,
        "rolling_distance": parameters.rolling_distance,
        "runout_up": parameters.eccentricity * np.cos(parameters.eccentricity_phase),
        "runout_side": parameters.eccentricity * np.sin(parameters.eccentricity_phase),
        "stiffness": stiffness,
        "dashpot": 2.0 * DAMPING_RATIO * parameters.ball_mass * parameters.race_frequency,
    }


def placed_ring(ends: DrumPlace, parameters: BallRing) -> PlacedElement:
    """Return a ring in its place; at the start its balls turn with the drum."""
    numbers, angles = numbers_of(parameters, ends), parameters.first_angles
    side, axis, top = ends.tub_rotation.T
    places = parameters.race_radius * (
        np.outer(np.sin(angles), side) + np.outer(np.cos(angles), top)
    )
    places += numbers["runout_side"] * side + numbers["runout_up"] * top
    start = functools.partial(_turning, places, axis)
    return PlacedElement(ring_of(parameters.balls), ends, NUMBERS.pack(**numbers), start)


def places_of(ring: BallRing, outputs: Mapping[str, FloatArray]) -> FloatArray:
    """Return the places of the balls in D, as `RingPicture.places`, of a race about the axis."""
    angle, radius = outputs["angle"][:, : ring.balls], ring.race_radius
    height = np.full_like(angle, ring.y)
    return np.stack([radius * np.sin(angle), height, radius * np.cos(angle)], axis=-1)


def _turning(places: FloatArray, axis: FloatArray, drum_rate: float) -> FloatArray:
    """Return the states of balls (balls, 3) that turn with the drum. (7 balls,)"""
    velocities = drum_rate * np.cross(axis, places)
    return np.hstack([places, velocities, np.zeros((len(places), 1))]).ravel()


def _lines(balls: int) -> Sequence[str]:
    """Return the source of the law of a ring."""
    letters = "xyz"
    lines = [
        f"def ball_ring_{balls}(motion, state, p, at):",
        "    numbers = read_numbers(p, at)",
        "    zero = 0.0 * motion.drum_rate",
        "    force, moment, first = (zero, zero, zero), (zero, zero, zero), (zero, zero, zero)",
        "    twist, share = zero, numbers.mass",
        "    up, side = numbers.runout_up, numbers.runout_side",
        "    centre = turned_with_drum(motion, numbers.axis, numbers.top, up, side)",
    ]
    for i in range(balls):
        place, velocity = (
            ", ".join(f"state.{kind}_{axis}_{i}" for axis in letters)
            for kind in ("place", "velocity")
        )
        lines += [
            f"    q_{i}, v_{i} = ({place}), ({velocity})",
            f"    f_{i}, u_{i}, z_{i} = on_ball("
            f"motion, numbers, centre, q_{i}, v_{i}, state.bristle_{i})",
            f"    force = subtract(force, f_{i})",
            f"    moment = subtract(moment, cross(add(numbers.centre, q_{i}), f_{i}))",
            f"    twist = twist - dot(numbers.axis, cross(q_{i}, f_{i}))",
            f"    angle_{i}, up, side = ball_angle(motion, numbers, q_{i})",
            "    first = add(first, (share * side, zero, share * up))",
        ]
    for i in range(balls if balls > 2 else balls - 1):
        j = (i + 1) % balls
        lines += [
            f"    c = contact(numbers, q_{i}, u_{i}, q_{j}, u_{j})",
            f"    f_{i}, f_{j} = add(f_{i}, c), subtract(f_{j}, c)",
        ]
    rates = list[str]()
    for i in range(balls):
        pull = f"rotate(motion.rotation, scale(1.0 / numbers.mass, f_{i}))"
        lines.append(f"    w_{i} = add(numbers.gravity, {pull})")
        rates += [f"{vector}_{i}[{k}]" for vector in "uw" for k in range(3)] + [f"z_{i}"]
    angles = ", ".join(f"angle_{i}" for i in range(balls))
    lines += [
        "    m, f = rotate(motion.rotation, moment), rotate(motion.rotation, force)",
        "    wrench = (m[0], m[1], m[2], f[0], f[1], f[2], twist)",
        f"    return wrench, (first[0], first[1], first[2], {angles}), ({', '.join(rates)},)",
    ]
    return lines


@functools.cache
def ring_of(balls: int) -> ElementKind:
    """Return the kind of rings with a number of balls, which have seven states each.

    The states of a ball are its place from the axis in T and its velocity in W, so that no
    acceleration of the tub enters its equations, and the bristle of its rolling resistance.
    """
    each = [(f"place_{axis}", "m") for axis in "xyz"]
    each += [*((f"velocity_{axis}", "m/s") for axis in "xyz"), ("bristle", "")]
    states = [State(f"{name}_{i}", unit) for i in range(balls) for name, unit in each]
    return ElementKind(
        name="ball_ring",
        parameters=BallRing,
        layout=NUMBERS,
        numbers=numbers_of,
        evaluate=generated(f"ball_ring_{balls}", "\n".join(_lines(balls)) + "\n", LAWS),
        outputs=(
            Output("moment", "kg m", "first moment of the balls of a ring, in the drum", 3),
            Output("angle", "rad", "angle of each ball from the top of the drum", balls, "ball"),
        ),
        states=tuple(states),
        acts_at_rest=False,
        frictionless={"rolling": 0.0},
        words="ring of balls in a race on the drum",
        picture="points",
        ring=RingPicture(("race_radius",), "ball_diameter", places_of),
        place=placed_ring,
    )


BALL_RING = ring_of(2)
"""The kind in machine files; `placed_ring` takes the number of balls of each ring."""
