"""A cabinet that moves on its feet: motion of the tub seen from it, reactions, forces of the floor.

The frame C of the cabinet coincides with W at rest. All mounts stand on the cabinet, so their laws
are evaluated with the motion of the tub in C. For a fixed cabinet C is W.
"""

from collections import namedtuple
from dataclasses import dataclass

import numpy as np

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import angle_of, numbers, sqrt, where
from wm_drake.compiler.packed import SCALAR, VECTOR, PackedLayout
from wm_drake.compiler.vectors import (
    add,
    compose,
    cross,
    rotate,
    rotate_back,
    scale,
    subtract,
    transpose,
)
from wm_drake.elements.kind import ElementKind, Output
from wm_drake.elements.motion import (
    GENERALIZED_FORCE_SIZE,
    PLANT_STATE_SIZE,
    TubMotion,
    motion_at,
    read_tree_state,
    tub_motion,
    write_generalized_force,
    write_tree_state,
)
from wm_drake.elements.strut import wrench_at_origin
from wm_drake.laws.foot_contact import pad_friction, pad_normal_force
from wm_drake.parameters.cabinet import Cabinet
from wm_drake.parameters.types import FloatArray

FEET_COUNT = 4
PADS = PackedLayout(
    "PadsNumbers",
    friction=SCALAR,
    vertical_stiffness=SCALAR,
    vertical_damping=SCALAR,
    horizontal_stiffness=SCALAR,
    horizontal_damping=SCALAR,
    damping_growth=SCALAR,
)
"""What the feet have in common: friction coefficient, stiffness [N/m] and damping [N s/m] of a pad,
growth of the share of its vertical damping with the compression [1/m]."""
FOOT = PackedLayout("FootNumbers", position=VECTOR, at_rest=SCALAR)
"""A foot: its position in C, on the floor at rest [m]; compression of its pad at rest [m]."""
FEET_SIZE = PADS.fixed_size + FEET_COUNT * FOOT.fixed_size
"""Packed numbers of the feet: `PADS`, then a `FOOT` for each."""
SLIP_SIZE = 2 * FEET_COUNT
"""States of the feet: for each, how far the end of its pad has slid since the start, x, y. [m]"""
FLOOR_FORCE_SIZE = 3 * FEET_COUNT
"""Own numbers of the feet: force of the floor on each, x, y, z in W. [N]"""
_PADS_SIZE, _FOOT_SIZE = PADS.fixed_size, FOOT.fixed_size

FULL_DAMPING = 0.5
"""Share of the mean compression at rest from which the vertical damping of a pad is full.

Assumption: small motions about rest have the full damping, and a foot that is set down has none."""

read_pads, read_foot = PADS.read, FOOT.read

FootForce = namedtuple("FootForce", ("arm", "force", "slip_rate"))
"""Of a foot: its position from the origin of C in W [m], force of the floor on it in W [N],
velocity of the end of its pad, x and y [m/s]."""


@dataclass(frozen=True)
class CabinetOnFeet:
    """The feet of a cabinet that moves.

    Attributes:
        cabinet: Its parameters.
        at_rest: Normal force of each foot at rest, in the order of `Cabinet.corners`. (4,) [N]
    """

    cabinet: Cabinet
    at_rest: FloatArray

    def packed(self) -> FloatArray:
        """Return the packed numbers of the feet (`FEET_SIZE`,)."""
        pads, cabinet = self.cabinet.foot_type, self.cabinet
        assert pads is not None  # a cabinet that moves has them
        mean = float(np.mean(self.at_rest))
        common = PADS.pack(
            friction=cabinet.friction,
            vertical_stiffness=pads.vertical_stiffness,
            vertical_damping=pads.vertical_damping,
            horizontal_stiffness=pads.horizontal_stiffness,
            horizontal_damping=pads.horizontal_damping,
            damping_growth=pads.vertical_stiffness / (FULL_DAMPING * mean),
        )
        places = [cabinet.feet[name] for name in cabinet.corners]
        feet = [
            FOOT.pack(
                position=(foot.x, foot.y, cabinet.floor), at_rest=force / pads.vertical_stiffness
            )
            for foot, force in zip(places, self.at_rest, strict=True)
        ]
        return np.concatenate([common, *feet])


@law
def foot_force(motion, foot, slip, pads):
    """Return the `FootForce` of a foot.

    Args:
        motion: `TubMotion` of the cabinet.
        foot: Numbers of `FOOT`, by name.
        slip: How far the end of its pad has slid, x and y. [m]
        pads: Numbers of `PADS`, by name.
    """
    arm, at = rotate(motion.rotation, foot.position), foot.position
    place = add(motion.position, arm)
    v = add(motion.velocity, cross(motion.angular_velocity, arm))
    normal = pad_normal_force(
        foot.at_rest - (place[2] - at[2]),
        -v[2],
        pads.vertical_stiffness,
        pads.vertical_damping,
        pads.damping_growth,
    )
    f_x, f_y, w_x, w_y = pad_friction(
        (place[0] - at[0] - slip[0], place[1] - at[1] - slip[1]),
        (v[0], v[1]),
        pads.horizontal_stiffness,
        pads.horizontal_damping,
        pads.friction * normal,
    )
    return FootForce(arm, (f_x, f_y, normal), (w_x, w_y))


@law
def foot_of(x, first, motion, p, at, i):
    """Return the `FootForce` of foot i.

    Args:
        x, first: State, and index in it where the slips of the feet begin.
        motion: `TubMotion` of the cabinet.
        p, at: Array that holds the packed numbers of the feet, and where they begin.
        i: Number of the foot.
    """
    k = first + 2 * i
    foot = read_foot(p, at + _PADS_SIZE + i * _FOOT_SIZE)
    return foot_force(motion, foot, (x[k], x[k + 1]), read_pads(p, at))


@law
def feet_on_floor(x, dx, first, motion, p, at):
    """Return the wrench of the floor on the cabinet; write the rates of the slips.

    Args:
        x, dx, first: State, its derivative, and index in both where the slips of the feet begin.
        motion: `TubMotion` of the cabinet.
        p, at: Array that holds the packed numbers of the feet, and where they begin.

    Returns:
        Moment about the origin of C and force, in W (six numbers). [N m, N]
    """
    zero = 0.0 * x[first]
    moment, force = (zero, zero, zero), (zero, zero, zero)
    for i in range(FEET_COUNT):
        foot = foot_of(x, first, motion, p, at, i)
        force = add(force, foot.force)
        moment = add(moment, cross(foot.arm, foot.force))
        dx[first + 2 * i], dx[first + 2 * i + 1] = foot.slip_rate
    return (moment[0], moment[1], moment[2], force[0], force[1], force[2])


@law
def motion_in(cabinet, body):
    """Return the motion of a body seen from the cabinet, in C; both are `TubMotion` in W."""
    r, w = cabinet.rotation, cabinet.angular_velocity
    away = subtract(body.position, cabinet.position)
    velocity = subtract(subtract(body.velocity, cabinet.velocity), cross(w, away))
    return TubMotion(
        compose(transpose(r), body.rotation),
        rotate_back(r, away),
        rotate_back(r, subtract(body.angular_velocity, w)),
        rotate_back(r, velocity),
    )


@law
def motion_with(cabinet, body):
    """Return the motion in W of a body whose motion in C is given; inverse of `motion_in`."""
    r, w = cabinet.rotation, cabinet.angular_velocity
    away = rotate(r, body.position)
    return TubMotion(
        compose(r, body.rotation),
        add(cabinet.position, away),
        add(w, rotate(r, body.angular_velocity)),
        add(cabinet.velocity, add(cross(w, away), rotate(r, body.velocity))),
    )


@law
def rates_in(cabinet, w_rate_C, v_rate_C, body, w_rate, v_rate):
    """Return the accelerations of a body seen from the cabinet, in C.

        w_rel' = w_B' - w_C' - w_C x (w_B - w_C)
        v_rel' = v_B' - v_C' - w_C' x r - w_C x (w_C x r) - 2 w_C x v_rel

    Args:
        cabinet, body: `TubMotion` in W.
        w_rate_C, v_rate_C: Accelerations of the cabinet, angular and of its origin, in W.
            [rad/s^2, m/s^2]
        w_rate, v_rate: The same of the body.
    """
    r, w = cabinet.rotation, cabinet.angular_velocity
    away = subtract(body.position, cabinet.position)
    swept = cross(w, away)
    v = subtract(subtract(body.velocity, cabinet.velocity), swept)
    angular = cross(w, subtract(body.angular_velocity, w))
    linear = add(add(cross(w_rate_C, away), cross(w, swept)), scale(2.0, cross(w, v)))
    return (
        rotate_back(r, subtract(subtract(w_rate, w_rate_C), angular)),
        rotate_back(r, subtract(subtract(v_rate, v_rate_C), linear)),
    )


@law
def rates_with(cabinet, w_rate_C, v_rate_C, body, w_rate, v_rate):
    """Return the accelerations in W of a body; inverse of `rates_in`.

    Args:
        cabinet, w_rate_C, v_rate_C: As for `rates_in`.
        body, w_rate, v_rate: `TubMotion` and accelerations of the body seen from the cabinet, in C.
    """
    r, w = cabinet.rotation, cabinet.angular_velocity
    away, v = rotate(r, body.position), rotate(r, body.velocity)
    angular = cross(w, rotate(r, body.angular_velocity))
    linear = add(add(cross(w_rate_C, away), cross(w, cross(w, away))), scale(2.0, cross(w, v)))
    return (
        add(add(w_rate_C, rotate(r, w_rate)), angular),
        add(add(v_rate_C, rotate(r, v_rate)), linear),
    )


@law
def wrenches_of_mounts(cabinet, body, wrench):
    """Return the wrenches of mounts on the body that hangs on them, and on the cabinet.

    The forces at the two ends of a massless mount are in equilibrium.

    Args:
        cabinet, body: `TubMotion` in W.
        wrench: Moment about the origin of the body and force on the body, in C (six). [N m, N]

    Returns:
        Moment about its own origin and force on each, in W (six numbers each). [N m, N]
    """
    r = cabinet.rotation
    m, f = (
        rotate(r, (wrench[0], wrench[1], wrench[2])),
        rotate(r, (wrench[3], wrench[4], wrench[5])),
    )
    away = subtract(body.position, cabinet.position)
    on_cabinet = wrench_at_origin(away, scale(-1.0, f), scale(-1.0, m))
    return (m[0], m[1], m[2], f[0], f[1], f[2]), on_cabinet


@law
def signed_angle(sine, cosine):
    """Return the angle between -pi and pi from its sine and cosine, up to a common factor. [rad]"""
    size = angle_of(where(sine < 0.0, -sine, sine), cosine)
    return where(sine < 0.0, -size, size)


@law
def rpy_of(r):
    """Return roll, pitch, yaw of a rotation R, by rows; inverse of `rotation_from_rpy`. [rad]"""
    cosine = sqrt(r[7] * r[7] + r[8] * r[8])
    return signed_angle(r[7], r[8]), signed_angle(-r[6], cosine), signed_angle(r[3], r[0])


@law
def evaluate_tub_in_cabinet(tub, cabinet, seen):
    """Write the state of tub and drum seen from the cabinet.

    Args:
        tub, cabinet: States of two trees of the plant (`TREE_STATE`): tub and drum, cabinet and
            drum.
        seen: `TREE_STATE` with the tub in C, written.
    """
    motion = motion_in(tub_motion(cabinet), tub_motion(tub))
    drum = read_tree_state(tub, 0)
    write_tree_state(
        seen,
        0,
        angles=rpy_of(motion.rotation),
        position=motion.position,
        joint_position=drum.joint_position,
        angular_velocity=motion.angular_velocity,
        velocity=motion.velocity,
        joint_rate=drum.joint_rate,
    )


@law
def evaluate_mounts_on_cabinet(x, on_tub, on_feet, generalized_force):
    """Write the generalized force of all mounts on tub and cabinet, with that of the feet.

    Args:
        x: States of two trees of the plant, one after the other: tub and drum, cabinet and drum.
        on_tub: `GENERALIZED_FORCE` of the mounts on tub and drum, in C.
        on_feet: `GENERALIZED_FORCE` of the floor on the cabinet, in W.
        generalized_force: On both trees, in W, written.
    """
    wrench = (on_tub[0], on_tub[1], on_tub[2], on_tub[3], on_tub[4], on_tub[5])
    body, cabinet = wrenches_of_mounts(motion_at(x, PLANT_STATE_SIZE), tub_motion(x), wrench)
    write_generalized_force(generalized_force, 0, body, on_tub[6])
    write_generalized_force(generalized_force, GENERALIZED_FORCE_SIZE, cabinet, 0.0 * on_tub[6])
    for k in range(GENERALIZED_FORCE_SIZE):
        at = GENERALIZED_FORCE_SIZE + k
        generalized_force[at] = generalized_force[at] + on_feet[k]


@law
def evaluate_feet(x, state, p, generalized_force, floor_forces, rate):
    """Write the force of the floor on the cabinet; arguments as in `ElementSystem`.

    x: state of cabinet and drum; state: slips of the feet; floor_forces: (`FLOOR_FORCE_SIZE`,).
    """
    motion, q = tub_motion(numbers(x)), numbers(p)
    wrench = feet_on_floor(state, rate, 0, motion, q, 0)
    write_generalized_force(generalized_force, 0, wrench, 0.0 * wrench[0])
    for i in range(FEET_COUNT):
        floor_forces[3 * i], floor_forces[3 * i + 1], floor_forces[3 * i + 2] = foot_of(
            state, 0, motion, q, 0, i
        ).force


FEET = ElementKind(
    name="feet",
    parameters=Cabinet,
    layout=PADS,
    outputs=(
        Output("floor_force", "N", "force of the floor on each foot, in W", FLOOR_FORCE_SIZE),
    ),
    words="four feet of a cabinet that moves; the plant state is that of cabinet and drum",
    picture="points",
    on_plant=evaluate_feet,
)
