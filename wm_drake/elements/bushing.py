"""Six-component bushing between a frame of the tub and a frame of the housing; the gasket is one."""

from dataclasses import dataclass

import numpy as np

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import numbers
from wm_drake.compiler.vectors import (
    add,
    compose,
    cross,
    rotate,
    rotate_back,
    rotation_vector,
    scale,
    subtract,
)
from wm_drake.compiler.vectors import transpose as transposed
from wm_drake.elements.motion import tub_motion
from wm_drake.laws.bushing import bushing_force
from wm_drake.laws.strut import wrench_at_origin
from wm_drake.laws.table import packed_size
from wm_drake.parameters.elements import BushingType, packed_stiffnesses
from wm_drake.parameters.types import FloatArray

AXES = ("x", "y", "z")


def packed_bushing_law(bushing: BushingType) -> FloatArray:
    """Parameters in the order of `wm_drake.laws.bushing.bushing_force`."""
    kinds = ("damping", "rotational_damping", "friction_torque", "full_friction_rate")
    constants = [getattr(bushing, f"{kind}_{axis}") for kind in kinds for axis in AXES]
    curves = [
        getattr(bushing, f"{kind}_{axis}")
        for kind in ("stiffness", "rotational_stiffness")
        for axis in AXES
    ]
    return np.concatenate([constants, *packed_stiffnesses(curves)])


@dataclass(frozen=True)
class SixComponentBushingParameters:
    """A bushing in its place: its two frames at the rest pose and its law. `engaged` 0 takes it out of the machine."""

    p_ToB_T: FloatArray
    R_TB: FloatArray
    p_WG: FloatArray
    R_WG: FloatArray
    packed_law: FloatArray
    engaged: float = 1.0

    @property
    def structure(self) -> list[int]:
        """Numbers of points of its six tables, 0 for those that are a number."""
        points, at = [], 12
        for _ in range(6):
            points.append(int(self.packed_law[at]))
            at += packed_size(self.packed_law, at)
        return points

    def packed(self) -> FloatArray:
        """Flat: tub-side point (T) and rotation by rows, housing-side point (W) and rotation by rows, engaged, law."""
        return np.concatenate(
            [
                self.p_ToB_T,
                self.R_TB.ravel(),
                self.p_WG,
                self.R_WG.ravel(),
                [self.engaged],
                self.packed_law,
            ]
        )


@law
def six_component_bushing_wrench(motion, p, at):
    """Moment about To and force on the tub (six numbers, W) of a bushing, and its force and moment on the housing (six, G).

    Args:
        motion: `TubMotion`.
        p, at: Array that holds what `SixComponentBushingParameters.packed` gives, and where that begins.
    """
    r_tub = nine(p, at + 3)
    r_ground = nine(p, at + 15)
    arm = rotate(motion.rotation, (p[at], p[at + 1], p[at + 2]))
    displaced = subtract(add(motion.position, arm), (p[at + 12], p[at + 13], p[at + 14]))
    v_B = add(motion.velocity, cross(motion.angular_velocity, arm))
    relative = compose(transposed(r_ground), compose(motion.rotation, r_tub))
    f, m = bushing_force(
        rotate_back(r_ground, displaced),
        rotate_back(r_ground, v_B),
        rotation_vector(relative),
        rotate_back(r_ground, motion.angular_velocity),
        p,
        at + 25,
    )
    f = scale(p[at + 24], f)
    m = scale(p[at + 24], m)
    return wrench_at_origin(arm, rotate(r_ground, f), rotate(r_ground, m)), (
        -f[0],
        -f[1],
        -f[2],
        -m[0],
        -m[1],
        -m[2],
    )


@law
def six_component_bushing_between(motion, ground, p, at):
    """The same between two bodies that move: its ground side is fixed to the second.

    Args:
        motion, ground: `TubMotion` of the two bodies.
        p, at: As there; the housing-side point and rotation are in the frame of the second body.

    Returns:
        Moment about its origin and force on each body (six numbers, W), and force and moment on the second, in G.
    """
    arm, ground_arm, r_ground, displaced, relative = motion_between(motion, ground, p, at)
    v_B = add(motion.velocity, cross(motion.angular_velocity, arm))
    v_ground = add(ground.velocity, cross(ground.angular_velocity, ground_arm))
    f, m = bushing_force(
        rotate_back(r_ground, displaced),
        rotate_back(r_ground, subtract(v_B, v_ground)),
        rotation_vector(relative),
        rotate_back(r_ground, subtract(motion.angular_velocity, ground.angular_velocity)),
        p,
        at + 25,
    )
    f = scale(p[at + 24], f)
    m = scale(p[at + 24], m)
    force, moment = rotate(r_ground, f), rotate(r_ground, m)
    on_ground = wrench_at_origin(ground_arm, scale(-1.0, force), scale(-1.0, moment))
    return (
        wrench_at_origin(arm, force, moment),
        on_ground,
        (-f[0], -f[1], -f[2], -m[0], -m[1], -m[2]),
    )


@law
def motion_between(motion, ground, p, at):
    """Where the bushing of `six_component_bushing_between` is; arguments as there.

    Returns:
        From the origins of the two bodies to its point on the first, in W [m]; rotation of its frame G on the second;
        displacement of the first's frame from G, in W [m]; rotation of the first's frame in G.
    """
    r_ground = compose(ground.rotation, nine(p, at + 15))
    arm = rotate(motion.rotation, (p[at], p[at + 1], p[at + 2]))
    place = add(motion.position, arm)
    ground_arm = subtract(place, ground.position)
    displaced = subtract(ground_arm, rotate(ground.rotation, (p[at + 12], p[at + 13], p[at + 14])))
    relative = compose(transposed(r_ground), compose(motion.rotation, nine(p, at + 3)))
    return arm, ground_arm, r_ground, displaced, relative


@law
def nine(p, at):
    """A rotation by rows, from where it begins in an array."""
    return (
        p[at],
        p[at + 1],
        p[at + 2],
        p[at + 3],
        p[at + 4],
        p[at + 5],
        p[at + 6],
        p[at + 7],
        p[at + 8],
    )


@law
def evaluate_six_component_bushing(x, state, p, generalized_force, force, rate):
    """Force of a bushing; arguments as in `ElementSystem`, parameters as in `SixComponentBushingParameters.packed`."""
    wrench, on_housing = six_component_bushing_wrench(tub_motion(numbers(x)), numbers(p), 0)
    for i in range(6):
        generalized_force[i] = wrench[i]
        force[i] = on_housing[i]
    generalized_force[6] = 0.0 * wrench[0]
