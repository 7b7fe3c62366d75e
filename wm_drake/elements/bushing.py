"""Six-component bushing between frames of the tub and of the housing; the gasket is one."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import numbers
from wm_drake.compiler.packed import LAYOUT, ROTATION, SCALAR, VECTOR, PackedLayout
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
from wm_drake.elements.kind import FRAMES, ElementKind, Output
from wm_drake.elements.layouts import layout_of, packed_fields, packed_once
from wm_drake.elements.motion import tub_motion, write_generalized_force
from wm_drake.elements.strut import wrench_at_origin
from wm_drake.laws.bushing import bushing_force
from wm_drake.laws.table import stiffness_force
from wm_drake.parameters.elements import Bushing, BushingType
from wm_drake.parameters.types import FloatArray

AXES = ("x", "y", "z")

BUSHING_LAW = layout_of("BushingNumbers", BushingType, tuple(BushingType.model_fields))
"""Numbers of `BushingType` by name: damping, rotational damping, friction torque, full friction
rate of each axis, then the six stiffnesses."""
BUSHING = PackedLayout(
    "SixComponentBushingNumbers",
    tub_side_point=VECTOR,
    tub_side_rotation=ROTATION,
    ground_side_point=VECTOR,
    ground_side_rotation=ROTATION,
    engaged=SCALAR,
    law=LAYOUT(BUSHING_LAW),
)
"""Frame on each side, in the frame of its body, 1 or 0 for a bushing that is taken out, law."""
read_bushing_law, read_bushing = BUSHING_LAW.read, BUSHING.read


def packed_bushing_law(bushing: BushingType) -> FloatArray:
    """Return the numbers of `BUSHING_LAW`."""
    return packed_fields(BUSHING_LAW, bushing)


@dataclass(frozen=True)
class SixComponentBushingParameters:
    """A bushing in its place: its two frames at the rest pose, and its law.

    Attributes:
        tub_side_point, tub_side_rotation: Frame on the tub side, in the frame of the tub-side body:
            T, if that is the tub. [m]
        ground_side_point, ground_side_rotation: Frame G on the ground side, in the frame of the
            ground-side body: W, if that is the housing. The stiffness acts along its axes. [m]
        packed_law: Numbers of `BUSHING_LAW`.
        engaged: 1, or 0 for a bushing that is taken out.
    """

    tub_side_point: FloatArray
    tub_side_rotation: FloatArray
    ground_side_point: FloatArray
    ground_side_rotation: FloatArray
    packed_law: FloatArray
    engaged: float = 1.0

    @property
    def kind(self) -> ElementKind:
        """Return the kind of the element; a compliant bearing of the drum has another one."""
        return SIX_COMPONENT_BUSHING

    @property
    def structure(self) -> list[int]:
        """Numbers of points of its six tables, 0 for those that are a number."""
        return BUSHING_LAW.structure(self.packed_law)

    @property
    def state_size(self) -> int:
        """Number of own states: none without branches of rubber."""
        return 0

    @property
    def damping(self) -> FloatArray:
        """Damping along x, y, z and about them (6,). [N s/m, N m s/rad]"""
        return np.array(self._by_axis("damping"))

    @property
    def stiffness(self) -> FloatArray:
        """Stiffness along x, y, z and about them (6,), if all are numbers. [N/m, N m/rad]"""
        return np.array([stiffness_force(1.0, p, at) for p, at in self._by_axis("stiffness")])

    def _by_axis(self, quantity: str) -> list[Any]:
        named = BUSHING_LAW.unpack(self.packed_law)
        fields = [f"{kind}{quantity}_{axis}" for kind in ("", "rotational_") for axis in AXES]
        return [getattr(named, field) for field in fields]

    def without_friction(self) -> "SixComponentBushingParameters":
        """Return the bushing without friction: what a mode of the machine is made of."""
        frictionless = {f"friction_torque_{axis}": 0.0 for axis in AXES}
        return replace(self, packed_law=BUSHING_LAW.replaced(self.packed_law, **frictionless))

    @packed_once
    def packed(self) -> FloatArray:
        """Return the numbers of `BUSHING`."""
        return self.packed_bushing()

    def packed_bushing(self) -> FloatArray:
        """Return the numbers of `BUSHING`, packed anew."""
        return BUSHING.pack(
            tub_side_point=self.tub_side_point,
            tub_side_rotation=self.tub_side_rotation,
            ground_side_point=self.ground_side_point,
            ground_side_rotation=self.ground_side_rotation,
            engaged=self.engaged,
            law=self.packed_law,
        )


@law
def six_component_bushing_wrench(motion, p, at):
    """Return the wrench of a bushing on the tub, and its force and moment on the housing.

    Args:
        motion: `TubMotion`.
        p, at: Array that holds the numbers of `BUSHING`, and where they begin.

    Returns:
        Moment about To and force on the tub (six numbers, W); force and moment on the housing (six,
        G).
    """
    bushing = read_bushing(p, at)
    r_ground = bushing.ground_side_rotation
    arm = rotate(motion.rotation, bushing.tub_side_point)
    displaced = subtract(add(motion.position, arm), bushing.ground_side_point)
    v_B = add(motion.velocity, cross(motion.angular_velocity, arm))
    relative = compose(transposed(r_ground), compose(motion.rotation, bushing.tub_side_rotation))
    f, m = bushing_force(
        rotate_back(r_ground, displaced),
        rotate_back(r_ground, v_B),
        rotation_vector(relative),
        rotate_back(r_ground, motion.angular_velocity),
        read_bushing_law(*bushing.law),
    )
    f = scale(bushing.engaged, f)
    m = scale(bushing.engaged, m)
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
    """Return the wrenches of a bushing on two bodies; its ground side is fixed to the second.

    Args:
        motion, ground: `TubMotion` of the two bodies.
        p, at: Array that holds the numbers of `BUSHING`, and where they begin; the ground-side
            point and rotation are in the frame of the second body.

    Returns:
        Moment about its origin and force on each body (six numbers, W), and force and moment on the
        second, in G.
    """
    bushing = read_bushing(p, at)
    arm, ground_arm, r_ground, displaced, relative = motion_between(motion, ground, p, at)
    v_B = add(motion.velocity, cross(motion.angular_velocity, arm))
    v_ground = add(ground.velocity, cross(ground.angular_velocity, ground_arm))
    f, m = bushing_force(
        rotate_back(r_ground, displaced),
        rotate_back(r_ground, subtract(v_B, v_ground)),
        rotation_vector(relative),
        rotate_back(r_ground, subtract(motion.angular_velocity, ground.angular_velocity)),
        read_bushing_law(*bushing.law),
    )
    f = scale(bushing.engaged, f)
    m = scale(bushing.engaged, m)
    force, moment = rotate(r_ground, f), rotate(r_ground, m)
    on_ground = wrench_at_origin(ground_arm, scale(-1.0, force), scale(-1.0, moment))
    return (
        wrench_at_origin(arm, force, moment),
        on_ground,
        (-f[0], -f[1], -f[2], -m[0], -m[1], -m[2]),
    )


@law
def motion_between(motion, ground, p, at):
    """Return where the bushing of `six_component_bushing_between` is.

    Args:
        motion, ground, p, at: As for `six_component_bushing_between`.

    Returns:
        From the origins of the two bodies to its point on the first, in W [m]; rotation of its
        frame G on the second; displacement of the first's frame from G, in W [m]; rotation of the
        first's frame in G.
    """
    bushing = read_bushing(p, at)
    r_ground = compose(ground.rotation, bushing.ground_side_rotation)
    arm = rotate(motion.rotation, bushing.tub_side_point)
    place = add(motion.position, arm)
    ground_arm = subtract(place, ground.position)
    displaced = subtract(ground_arm, rotate(ground.rotation, bushing.ground_side_point))
    relative = compose(transposed(r_ground), compose(motion.rotation, bushing.tub_side_rotation))
    return arm, ground_arm, r_ground, displaced, relative


@law
def evaluate_six_component_bushing(x, state, p, generalized_force, force, rate):
    """Write the force of a bushing; arguments as in `ElementSystem`, numbers of `BUSHING`."""
    wrench, on_housing = six_component_bushing_wrench(tub_motion(numbers(x)), numbers(p), 0)
    write_generalized_force(generalized_force, 0, wrench, 0.0 * wrench[0])
    for i in range(6):
        force[i] = on_housing[i]


WRENCH_OUTPUTS = (
    Output("force", "N", "force on the housing, in G", size=3),
    Output("moment", "N m", "moment on the housing at the tub-side point, in G", size=3),
)
"""Outputs of a bushing; G is the frame on the housing, along whose axes the stiffness acts."""

BUSHING_FRAMES = tuple(
    replace(one, path=path) for one, path in zip(FRAMES, BUSHING.fields, strict=False)
)
"""Frames of a bushing in its place; its law holds along the axes of that on the housing."""

SIX_COMPONENT_BUSHING = ElementKind(
    name="six_component_bushing",
    parameters=Bushing,
    layout=BUSHING,
    outputs=WRENCH_OUTPUTS,
    words="six-component bushing between frames of the tub and of the housing",
    described=BUSHING_FRAMES,
    picture="points",
    on_plant=evaluate_six_component_bushing,
)
