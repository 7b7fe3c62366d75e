"""Description of the elements on the tub in SI units, complete enough to rebuild them.

Each type declares keys, units and meaning, from which its JSON schema follows, and `of` fills it.
The suffix of a key is the frame of a point or direction: W housing, T tub.
"""

from typing import Any, Literal, Self, TypeAlias

import numpy as np
from pydantic import ConfigDict, Field

from wm_drake.compiler.compilation import generic
from wm_drake.compiler.vectors import rotation_from_rpy
from wm_drake.model.equilibrium import tensions_at
from wm_drake.model.machine import Setup
from wm_drake.model.sdf_names import tubes_of
from wm_drake.parameters import BushingType
from wm_drake.parameters import units as u
from wm_drake.parameters.elements import EndBushing, Frozen, Stiffness
from wm_drake.parameters.rubber import RubberBranches
from wm_drake.parameters.types import FloatArray

Vector: TypeAlias = tuple[float, float, float]
Rotation: TypeAlias = tuple[Vector, Vector, Vector]


class Open(Frozen):
    """A part with further keys, which its kind has in the machine file."""

    model_config = ConfigDict(extra="allow")


class Pose(Frozen):
    """Pose of a frame in W: R = Rz(yaw) Ry(pitch) Rx(roll), then the position of its origin."""

    roll: u.Angle
    pitch: u.Angle
    yaw: u.Angle
    x: u.Length
    y: u.Length
    z: u.Length

    @classmethod
    def of(cls, values: FloatArray) -> Self:
        """Return the pose of six numbers in the order of the fields."""
        return cls.model_validate(dict(zip(cls.model_fields, values.tolist(), strict=True)))


class Strut(Frozen):
    """Line from the housing end to the tub end.

    Drawn means that T coincides with W. The rest pose may differ slightly from it.
    """

    tub_point_T: u.Position
    housing_point_W: u.Position
    length_at_rest: u.Length
    direction_at_rest_W: Vector


def line_of(setup: Setup, element: Any) -> dict[str, Any]:
    """Return ends, length and direction of a strut at the rest pose, the fields of `Strut`.

    The direction points from the housing end to the tub end.
    """
    rotation = np.reshape(generic(rotation_from_rpy)(*setup.rest_pose[:3]), (3, 3))
    line = setup.rest_pose[3:] + rotation @ element.p_ToA_T - element.p_WH
    length = float(np.linalg.norm(line))
    return {
        "tub_point_T": element.p_ToA_T.tolist(),
        "housing_point_W": element.p_WH.tolist(),
        "length_at_rest": length,
        "direction_at_rest_W": (line / length).tolist(),
    }


class Spring(Strut):
    """A spring: h = preload + F(length - length_at_preload), F = k x or a table.

    The tension is h from `taut_from` on, 0 where h <= 0, and between them w s^2 (2 - s) with w =
    taut_from and s = h / w. A tension-compression spring has the tension h everywhere.
    """

    action: Literal["tension-only", "tension-compression"]
    stiffness: Stiffness
    length_at_preload: u.Length = Field(description="Length as drawn.")
    preload: u.Force = Field(description="Tension as drawn.")
    tension_at_rest: u.Force
    taut_from: u.Force | None = Field(description="None for tension-compression.")
    free_length: u.Length | None = Field(
        description="Length at which h is 0; None if there is none."
    )

    @classmethod
    def of(cls, setup: Setup, name: str) -> Self:
        """Return a spring of a machine."""
        kind = setup.parameters.spring_types[setup.parameters.springs[name].type]
        placed = setup.springs[name]
        return cls(
            **line_of(setup, placed),
            action=kind.action,
            stiffness=kind.stiffness,
            length_at_preload=placed.rest_length,
            preload=placed.preload,
            tension_at_rest=tensions_at(setup.elements, setup.rest_pose)[name],
            taut_from=None if placed.pushes else placed.taut_from,
            free_length=placed.free_length,
        )


class Damper(Strut):
    """A friction damper on a massless strut; the other keys are the numbers of its law, in SI."""

    model_config = ConfigDict(extra="allow")
    law: str = Field(description="Name of the law, key of `laws`.")
    end_bushing: EndBushing
    neutral_direction: Vector = Field(
        description="Direction as drawn. Both end bushings are neutral when the strut has this "
        "direction in W (housing end) and in T (tub end)."
    )

    @classmethod
    def of(cls, setup: Setup, name: str) -> Self:
        """Return a friction damper of a machine."""
        kind = setup.parameters.damper_types[setup.parameters.dampers[name].type]
        placed = setup.dampers[name]
        line = placed.p_ToA_T - placed.p_WH
        neutral = (line / np.linalg.norm(line)).tolist()
        return cls(**line_of(setup, placed), neutral_direction=neutral, **dict(kind))


class Bushing(BushingType):
    """A bushing between tub and housing; its law holds along the axes of the housing-side frame."""

    tub_point_T: u.Position
    tub_rotation_T: Rotation
    housing_point_W: u.Position
    housing_rotation_W: Rotation
    rubber: dict[str, float] | None = Field(
        description="Friction, Maxwell branches and cross-stiffness by key of the machine file, as "
        "far as they are not 0; in SI (N, m, N m, rad, s). Their stretches are 0 at the start of a "
        "run. None without them."
    )

    @classmethod
    def of(cls, setup: Setup, name: str) -> Self:
        """Return a bushing of a machine, such as its gasket."""
        placed, numbers = setup.bushings[name], dict(setup.parameters.all_bushings()[name])
        rubber = {key: numbers[key] for key in RubberBranches.model_fields if numbers.get(key)}
        return cls(
            tub_point_T=placed.tub_side_point.tolist(),
            tub_rotation_T=placed.tub_side_rotation.tolist(),
            housing_point_W=placed.ground_side_point.tolist(),
            housing_rotation_W=placed.ground_side_rotation.tolist(),
            rubber=rubber or None,
            **{key: numbers[key] for key in BushingType.model_fields},
        )


class TelescopicDamper(Open):
    """Two tubes as bodies, each on a bushing; the other keys are the numbers of the law along them.

    O is the link frame of the outer tube, which coincides with T as drawn.
    """

    law: str = Field(description="Name of the law, key of `laws`.")
    outer_tube: str
    inner_tube: str
    axis_outer_tube: Vector = Field(description="Direction of extension, in O.")
    tub_point_T: u.Position = Field(description="Tub bushing, on the tub.")
    outer_point_outer_tube: u.Position = Field(description="Tub bushing, on the outer tube.")
    inner_point_outer_tube: u.Position = Field(
        description="Housing bushing, on the inner tube, in O at extension 0."
    )
    housing_point_W: u.Position = Field(description="Housing bushing, on the housing.")
    tub_bushing: BushingType
    housing_bushing: BushingType
    tub_bushing_on_tub_rotation_T: Rotation
    tub_bushing_law_rotation_outer_tube: Rotation = Field(
        description="Frame, in O, along whose axes the law of the tub bushing holds."
    )
    housing_bushing_on_inner_tube_rotation_outer_tube: Rotation
    housing_bushing_law_rotation_W: Rotation = Field(
        description="Frame, in W, along whose axes the law of the housing bushing holds."
    )
    outer_tube_rest_pose: Pose
    extension_at_rest: u.Length

    @classmethod
    def of(cls, setup: Setup, name: str) -> Self:
        """Return a telescopic damper of a machine."""
        parameters, placed = setup.parameters, setup.telescopes[name]
        damper = parameters.telescopic_dampers[name]
        outer, inner = (body.name() for body in tubes_of(setup.machine.plant, damper.joint))
        rest = setup.tube_rest[list(setup.telescopes).index(name)]
        at_tub, at_housing = placed.tub_bushing, placed.housing_bushing
        numbers = parameters.damper_types[damper.type].model_dump(exclude={"end_bushing"})
        return cls(
            outer_tube=outer,
            inner_tube=inner,
            axis_outer_tube=placed.axis.tolist(),
            tub_point_T=at_tub.tub_side_point.tolist(),
            outer_point_outer_tube=at_tub.ground_side_point.tolist(),
            inner_point_outer_tube=at_housing.tub_side_point.tolist(),
            housing_point_W=at_housing.ground_side_point.tolist(),
            tub_bushing=parameters.bushing_types[damper.tub_bushing],
            housing_bushing=parameters.bushing_types[damper.housing_bushing],
            tub_bushing_on_tub_rotation_T=at_tub.tub_side_rotation.tolist(),
            tub_bushing_law_rotation_outer_tube=at_tub.ground_side_rotation.tolist(),
            housing_bushing_on_inner_tube_rotation_outer_tube=(
                at_housing.tub_side_rotation.tolist()
            ),
            housing_bushing_law_rotation_W=at_housing.ground_side_rotation.tolist(),
            outer_tube_rest_pose=Pose.of(rest[:6]),
            extension_at_rest=float(rest[6]),
            **numbers,
        )


class OtherElement(Open):
    """An element of a kind of another package, or on the drum, such as a ring of balls.

    The other keys are its parameters and its further points and frames, in SI.
    """

    kind: str = Field(description="Name of the kind in machine files.")
    law: str = Field(description="What it is, in words.")
    tub_point_T: u.Position = Field(description="Of an element on the drum a point of its axis.")
    tub_rotation_T: Rotation = Field(
        description="Of an element on the drum: y is the drum axis, z points to the top of the "
        "drum."
    )

    @classmethod
    def of(cls, setup: Setup, name: str) -> Self:
        """Return an element of a machine with its parameters and its points."""
        placed, element = setup.elements.others[name], setup.parameters.elements[name]
        ends = placed.ends._asdict().items()
        points = {f"{e}_{'T' if e.startswith('tub') else 'W'}": at.tolist() for e, at in ends}
        numbers = element.model_dump(exclude={"tub_frame", "housing_frame"})
        return cls(law=placed.kind.words, **points, **numbers)
