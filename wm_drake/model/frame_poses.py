"""Elements in their places: frames of the SDF, under the overrides of a machine file -> what each element is packed from."""

import math
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context

from wm_drake.elements.bushing import SixComponentBushingParameters, packed_bushing_law
from wm_drake.elements.damper_law import packed_damper_law
from wm_drake.elements.friction_damper import FrictionDamperParameters
from wm_drake.elements.layouts import packed_stiffness
from wm_drake.elements.spring import SpringStrutParameters
from wm_drake.elements.telescopic_damper import TelescopicDamperParameters
from wm_drake.errors import input_error
from wm_drake.parameters import FrameOverride, MachineParameters
from wm_drake.parameters.types import FloatArray

SHORTEST_STRUT = 1e-3
"""Springs and dampers shorter than this when drawn have no direction to speak of. [m]"""


class FramePoses:
    """Where frames are in a body's frame, under one set of overrides; each is asked of the plant once."""

    def __init__(
        self, plant: MultibodyPlant, frames: dict[str, FrameOverride], context: Context
    ) -> None:
        """Of a plant whose Context has these overrides in it."""
        self.frames, self.context, self._plant = frames, context, plant
        self._known: dict[tuple[str, str], tuple[FloatArray, FloatArray]] = {}

    def __call__(self, body: str, frame: str) -> tuple[FloatArray, FloatArray]:
        """Origin and rotation of a frame; the Context must have the overrides in it. [m]"""
        if (body, frame) not in self._known:
            carrier = self._plant.GetBodyByName(body).body_frame()
            pose = self._plant.CalcRelativeTransform(
                self.context, carrier, self._plant.GetFrameByName(frame)
            )
            self._known[body, frame] = (
                np.array(pose.translation()),
                np.array(pose.rotation().matrix()),
            )
        return self._known[body, frame]


def ends(places: FramePoses, element: Any) -> tuple[FloatArray, FloatArray]:
    """Tub end in T and housing end in W of an element."""
    return places("tub", element.tub_frame)[0], places("world", element.housing_frame)[0]


def strut_ends(places: FramePoses, element: Any, key: str) -> tuple[FloatArray, FloatArray]:
    """Ends of an element that acts along the line between them."""
    tub_end, housing_end = ends(places, element)
    if not math.dist(tub_end, housing_end) > SHORTEST_STRUT:
        raise input_error(
            f"frames '{element.tub_frame}' and '{element.housing_frame}' are at the same place: it has no line",
            key=key,
        )
    return tub_end, housing_end


def placed_springs(
    places: FramePoses, parameters: MachineParameters
) -> dict[str, SpringStrutParameters]:
    """Without preload yet."""
    return {
        name: SpringStrutParameters(
            *strut_ends(places, spring, f"springs.{name}"),
            0.0,
            packed_stiffness(parameters.spring_types[spring.type].stiffness),
        )
        for name, spring in parameters.springs.items()
    }


def placed_dampers(
    places: FramePoses, parameters: MachineParameters
) -> dict[str, FrictionDamperParameters]:
    """Massless struts with friction."""
    placed = {}
    for name, damper in parameters.dampers.items():
        kind = parameters.damper_types[damper.type]
        ends = strut_ends(places, damper, f"dampers.{name}")
        placed[name] = FrictionDamperParameters(*ends, kind.end_bushing, packed_damper_law(kind))
    return placed


def placed_bushings(
    places: FramePoses, parameters: MachineParameters
) -> dict[str, SixComponentBushingParameters]:
    """Between tub and housing, the gasket among them."""
    placed = {}
    for name, bushing in parameters.all_bushings().items():
        tub_point, housing_point = ends(places, bushing)
        r_tub = places("tub", bushing.tub_frame)[1]
        r_housing = places("world", bushing.housing_frame)[1]
        placed[name] = SixComponentBushingParameters(
            tub_point, r_tub, housing_point, r_housing, packed_bushing_law(bushing)
        )
    return placed


def placed_telescopes(
    plant: MultibodyPlant, places: FramePoses, parameters: MachineParameters
) -> dict[str, TelescopicDamperParameters]:
    """To be asked for while all joints are at zero."""
    placed = {}
    for name, damper in parameters.telescopic_dampers.items():
        joint = plant.GetJointByName(damper.joint)
        outer = joint.parent_body().name()
        X_OF = joint.frame_on_parent().GetFixedPoseInBodyFrame()
        laws = [
            packed_bushing_law(parameters.bushing_types[kind])
            for kind in (damper.tub_bushing, damper.housing_bushing)
        ]
        ends = [
            (*places("tub", damper.tub_frame), *places(outer, damper.outer_frame)),
            (*places(outer, damper.inner_frame), *places("world", damper.housing_frame)),
        ]
        at_tub, at_housing = (
            SixComponentBushingParameters(*end, law) for end, law in zip(ends, laws, strict=True)
        )
        axis, law = (
            X_OF.rotation() @ joint.translation_axis(),
            packed_damper_law(parameters.damper_types[damper.type]),
        )
        placed[name] = TelescopicDamperParameters(axis, at_tub, at_housing, law)
    return placed


def placed_bearing(
    plant: MultibodyPlant, parameters: MachineParameters
) -> SixComponentBushingParameters | None:
    """What the drum's carrier is held by, the tub being its ground side; None for a drum that turns in a perfect joint."""
    bearing = parameters.imperfections.bearing
    if bearing is None:
        return None
    joint = plant.GetJointByName(parameters.drive.joint)
    X_TF = joint.frame_on_parent().GetFixedPoseInBodyFrame()
    axis = X_TF.rotation() @ joint.revolute_axis()
    point = X_TF.translation() + bearing.y * axis
    across = np.eye(3)[int(abs(axis[0]) > 0.9)]  # x, if the axis is not near it
    x = across - (across @ axis) * axis
    x /= np.linalg.norm(x)
    rotation = np.column_stack([x, axis, np.cross(x, axis)])
    return SixComponentBushingParameters(
        point, rotation, point, rotation, packed_bushing_law(bearing.as_bushing())
    )
