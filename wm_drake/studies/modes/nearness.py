"""How near each mode shape brings the tub to the housing."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wm_drake.model.scene import Gap, Scene
from wm_drake.parameters.types import FloatArray
from wm_drake.report.formatting import MM_PER_M, number, shape_name
from wm_drake.studies.modes.shapes import ANGLE_ARM, Mode

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
    amplitude, left, rest = (
        number(MM_PER_M * value, 1)
        for value in (near.amplitude, gap.distance, near.at_rest.distance)
    )
    ends = (
        f"leaves {left} mm of the {rest} mm at rest, between {parts(gap)}"
        if gap.distance > 0.0
        else f"makes them touch ({parts(gap)}; {rest} mm apart at rest)"
    )
    return (
        f"At an amplitude of {amplitude} mm with sliding friction, {near.nearest} brings the tub "
        f"nearest to the housing: it {ends}."
    )


def parts(gap: Gap) -> str:
    """Return the two parts of a gap in words."""
    return f"{shape_name(gap.moving)} and {shape_name(gap.fixed)}"
