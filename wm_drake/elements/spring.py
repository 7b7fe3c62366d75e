"""Suspension spring between a point of the tub and a point of the housing."""

import math
from dataclasses import dataclass

import numpy as np

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import numbers
from wm_drake.compiler.vectors import rotate, scale
from wm_drake.elements.motion import tub_motion
from wm_drake.laws.spring import spring_tension
from wm_drake.laws.strut import strut_line, wrench_at_origin
from wm_drake.parameters.types import FloatArray


@dataclass(frozen=True)
class SpringStrutParameters:
    """A spring in its place: hooks at the rest pose, law, preload."""

    p_ToA_T: FloatArray
    p_WH: FloatArray
    preload: float
    packed_stiffness: FloatArray

    @property
    def rest_length(self) -> float:
        """Distance of the hooks when T coincides with W. [m]"""
        return math.dist(self.p_ToA_T, self.p_WH)

    @property
    def structure(self) -> list[int]:
        """Number of points of its table, 0 without one."""
        return [int(self.packed_stiffness[0])]

    def packed(self) -> FloatArray:
        """Flat: tub hook (T), housing hook (W), rest length, preload, packed stiffness."""
        return np.concatenate(
            [self.p_ToA_T, self.p_WH, [self.rest_length, self.preload], self.packed_stiffness]
        )


@law
def spring_strut_wrench(motion, p, at):
    """Moment about To and force on the tub (six numbers, W), and tension, of a spring strut.

    Args:
        motion: `TubMotion`.
        p, at: Array that holds what `SpringStrutParameters.packed` gives, and where that begins.
    """
    arm = rotate(motion.rotation, (p[at], p[at + 1], p[at + 2]))
    length, _, direction, _, _ = strut_line(motion, arm, (p[at + 3], p[at + 4], p[at + 5]))
    tension = spring_tension(length, p[at + 6], p[at + 7], p, at + 8)
    return wrench_at_origin(arm, scale(-tension, direction), (0.0, 0.0, 0.0)), tension


@law
def evaluate_spring_strut(x, state, p, generalized_force, force, rate):
    """Force of a spring strut; arguments as in `ElementSystem`, parameters as in `SpringStrutParameters.packed`."""
    wrench, tension = spring_strut_wrench(tub_motion(numbers(x)), numbers(p), 0)
    for i in range(6):
        generalized_force[i] = wrench[i]
    generalized_force[6] = 0.0 * tension
    force[0] = tension
