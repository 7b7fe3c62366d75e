"""Names and participation of modes, and how near each mode brings the tub to the housing."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from wm_drake.engines.trajectory import COORDINATES
from wm_drake.model.scene import Gap, Scene
from wm_drake.parameters.types import ComplexArray, FloatArray
from wm_drake.report.formatting import shape_name
from wm_drake.studies.modes.linearisation import Spectrum
from wm_drake.studies.modes.quantities import AMPLITUDE, SMALLEST_GAP, UNDAMPED

NAMES = {
    "roll": "roll",
    "pitch": "pitch",
    "yaw": "yaw",
    "x": "sway",
    "y": "fore-aft",
    "z": "bounce",
}
"""Name of a motion by its coordinate.

Angles about x, y, z as in records; sway to the sides, fore-aft along the drum axis, bounce up and
down."""

FORWARD, BACKWARD = "forward whirl", "backward whirl"
"""Names of roll and yaw together as the drum turns: its axis goes round with the drum or against
it. A fast drum has no other: forward whirl rises with the speed (nutation), backward whirl falls
(precession)."""

WHIRL = 0.5
"""Least part of roll and yaw together in a whirl, of the smaller one in the larger, and of the area
of their ellipse in that of a circle."""

ANGLE_ARM = 0.25
"""Length that converts angles to displacements in a mode shape: about the radius of the tub. [m]"""

_POSITIONS, _VELOCITIES = slice(0, 6), slice(6, 12)
"""Tub's positions and velocities among the free numbers of the state."""


@dataclass(frozen=True)
class Mode:
    """Natural mode.

    Attributes:
        name: Of its motion, one of `NAMES`; no two modes of a linearisation have the same.
        frequency_hz: Natural frequency |lambda| / (2 pi), with the eigenvalue lambda [1/s]. [Hz]
        damping_ratio: -Re(lambda) / |lambda|.
        shape: Motion of T: roll, pitch, yaw, x, y, z. The largest component is 1 after angles are
            multiplied by `ANGLE_ARM`. (6,) complex [rad, m]
        participation: Of each coordinate of the tub, as in `shape`; the sum is 1. (6,)
        strain_energy, dissipation: Part of each element. The sum is 1; of the dissipation of an
            undamped mode, 0. Preload may make the energy of a spring negative. (elements,)
    """

    name: str
    frequency_hz: float
    damping_ratio: float
    shape: ComplexArray
    participation: FloatArray
    strain_energy: FloatArray
    dissipation: FloatArray

    @property
    def is_damped(self) -> bool:
        """Return whether the damping is more than errors of rounding."""
        return abs(self.damping_ratio) > UNDAMPED

    @property
    def real_shape(self) -> FloatArray:
        """Return the shape at the phase of its largest component. (6,) [rad, m]"""
        return np.asarray(self.shape.real)


def modes_of(spectrum: Spectrum, wrench_slopes: FloatArray) -> list[Mode]:
    """Return named modes.

    Args:
        wrench_slopes: Slopes of the wrench of each element on the tub. (elements, 6, n)
    """
    shares = participation(spectrum)
    names = names_of(shares)
    modes = []
    for index, value in enumerate(spectrum.values):
        vector = spectrum.right[:, index]
        strain, dissipated = energies(value, vector, wrench_slopes)
        modes.append(
            Mode(
                names[index],
                float(spectrum.frequency_hz[index]),
                float(spectrum.damping_ratio[index]),
                shape_of(vector),
                shares[index],
                _share(strain),
                _share(dissipated * (abs(spectrum.damping_ratio[index]) > UNDAMPED)),
            )
        )
    return modes


def shape_of(vector: ComplexArray) -> ComplexArray:
    """Return the motion of the tub in an eigenvector; the largest component becomes 1. (6,)"""
    weight = np.repeat([ANGLE_ARM, 1.0], 3)
    tub = vector[_POSITIONS]
    largest = int(np.argmax(np.abs(tub * weight)))
    return np.asarray(tub / (tub[largest] * weight[largest]))


def participation(spectrum: Spectrum) -> FloatArray:
    """Return the part of each coordinate of the tub in each mode. (modes, 6)

    It is the participation factor |left x right| of the coordinate and its rate (Perez-Arriaga,
    Verghese and Schweppe 1982). It does not depend on the units of the coordinates.
    """
    both = np.abs(spectrum.left.T * spectrum.right)
    shares = (both[_POSITIONS] + both[_VELOCITIES]).T
    return np.asarray(shares / shares.sum(axis=1, keepdims=True))


def names_of(shares: FloatArray) -> list[str]:
    """Return a name for each mode such that the named coordinates participate most overall.

    Args:
        shares: Participation of the six coordinates in up to six modes. (modes, 6)
    """
    count = len(shares)
    choices = np.array(list(permutations(range(len(COORDINATES)), count)), dtype=int)
    best = np.argmax(shares[np.arange(count), choices].sum(axis=1))
    return [NAMES[COORDINATES[coordinate]] for coordinate in choices[best]]


def names_at_speed(spectrum: Spectrum) -> list[str]:
    """Return a name for each mode of a turning drum, from its shape at this speed.

    A mode has the name of a coordinate, as at standstill, or is a whirl of roll and yaw.
    """
    shares = participation(spectrum)
    names = names_of(shares)
    for index, (roll, _, yaw, *_) in enumerate(shares):
        circular = _circularity(spectrum.right[0, index], spectrum.right[2, index])
        is_whirl = roll + yaw > WHIRL and min(roll, yaw) > WHIRL * max(roll, yaw)
        if is_whirl and abs(circular) > WHIRL:
            names[index] = FORWARD if circular > 0.0 else BACKWARD
    return names


def _circularity(roll: complex, yaw: complex) -> float:
    """Return the area of the ellipse of roll and yaw over time, 1 for a circle with the drum.

    The drum turns from z to x, so that on a forward circle the roll follows the yaw by a quarter of
    a turn.
    """
    size = abs(roll) ** 2 + abs(yaw) ** 2
    return float(2.0 * np.imag(roll.conjugate() * yaw) / size) if size else 0.0


def energies(
    value: complex, vector: ComplexArray, wrench_slopes: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the strain energy of each element and the energy that it dissipates. (elements,)

    An element with stiffness K and damping C has the complex force F = -(K + lambda C) U on the
    displacement U of the tub. With a = -Re(F* U) / 2, b = -Re(F* V) / 2, V = lambda U:

        k = U* K U / 2 = (a |lambda|^2 - Re(lambda) b) / Im(lambda)^2
        c = U* C U / 2 = (b - Re(lambda) a) / Im(lambda)^2        own derivation

    They are the peak of the strain energy, and the dissipated power divided by |lambda|^2.
    """
    forces = wrench_slopes @ vector
    velocity = vector[_VELOCITIES]
    displacement = velocity / value
    a = -0.5 * np.real(np.conj(forces) @ displacement)
    b = -0.5 * np.real(np.conj(forces) @ velocity)
    square = value.imag**2
    stored = (a * abs(value) ** 2 - value.real * b) / square
    dissipated = (b - value.real * a) / square
    return np.asarray(stored), np.asarray(dissipated)


def _share(values: FloatArray) -> FloatArray:
    total = float(values.sum())
    return np.asarray(values / total) if total else values


PHASES = 72
"""Number of poses over the cycle of a mode."""


@dataclass(frozen=True)
class Nearness:
    """Smallest gaps between tub and housing over the cycle of each mode.

    All modes are compared at one amplitude.

    Attributes:
        amplitude: Largest component of the motion, with angles times `ANGLE_ARM`. [m]
        at_rest: Gap at the equilibrium.
        of_mode: Gap over the cycle of each mode, by its name.
    """

    amplitude: float
    at_rest: Gap
    of_mode: dict[str, Gap]

    @property
    def nearest(self) -> str:
        """Return the name of the mode with the smallest gap."""
        return min(self.of_mode, key=lambda name: self.of_mode[name].distance)


def nearness(
    scene: Scene, rest_pose: FloatArray, modes: Sequence[Mode], amplitude: float
) -> Nearness | None:
    """Return how near the modes bring the tub to the housing; None without shapes to measure.

    Args:
        rest_pose: Equilibrium: roll, pitch, yaw, x, y, z. (6,) [rad, m]
        amplitude: Amplitude at which they are compared. [m]
    """
    phase = np.linspace(0.0, 2.0 * np.pi, PHASES, endpoint=False)
    turns = np.exp(1j * phase)
    at_rest = scene.smallest_gap(phase[:1], rest_pose[None, :], rest_pose)
    if at_rest is None or not modes:
        return None
    gaps = {}
    for mode in modes:
        weighted = np.abs(mode.shape * np.repeat([ANGLE_ARM, 1.0], 3))
        poses = rest_pose + np.real(np.outer(turns, mode.shape * (amplitude / weighted.max())))
        gap = scene.smallest_gap(phase, poses, rest_pose)
        assert gap is not None  # there are shapes, and poses
        gaps[mode.name] = gap
    return Nearness(amplitude, at_rest, gaps)


def about_nearness(near: Nearness) -> str:
    """Return the sentence that says which mode brings the tub to the housing."""
    gap = near.of_mode[near.nearest]
    left, rest = (SMALLEST_GAP.text(one.distance) for one in (gap, near.at_rest))
    ends = (
        f"leaves {left} of the {rest} at rest, between {parts(gap)}"
        if gap.distance > 0.0
        else f"makes them touch ({parts(gap)}; {rest} apart at rest)"
    )
    return (
        f"At an amplitude of {AMPLITUDE.text(near.amplitude)} with sliding friction, "
        f"{near.nearest} brings the tub nearest to the housing: it {ends}."
    )


def parts(gap: Gap) -> str:
    """Return the two parts of a gap in words."""
    return f"{shape_name(gap.moving)} and {shape_name(gap.fixed)}"
