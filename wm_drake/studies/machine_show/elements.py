"""Description of the elements in SI units, complete enough to rebuild them.

It follows from their declarations: the numbers are those of the machine file, with their units and
meaning; in place of the names of frames and types there are the places and numbers that these name.
The kind of an element says what else belongs to it, see `wm_drake.elements.kind.Described`; a kind
of another package is described alike.
"""

from copy import copy
from typing import Annotated, Any, Self, TypeAlias

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, create_model

from wm_drake.compiler.compilation import generic
from wm_drake.compiler.vectors import rotation_from_rpy
from wm_drake.elements.friction_damper import FRICTION_DAMPER_STRUT
from wm_drake.elements.kind import Described, ElementKind
from wm_drake.elements.rubber import SIX_COMPONENT_BUSHING_OF_RUBBER
from wm_drake.elements.spring import SPRING_STRUT
from wm_drake.elements.telescopic_damper import TELESCOPIC_DAMPER_TUBES
from wm_drake.model.equilibrium import tensions_at
from wm_drake.model.machine import Setup
from wm_drake.model.sdf_names import tubes_of
from wm_drake.parameters import BushingType
from wm_drake.parameters import units as u
from wm_drake.parameters.elements import EndBushing, Frozen, SpringType
from wm_drake.parameters.file_keys import meanings_of
from wm_drake.parameters.rubber import RubberBranches
from wm_drake.parameters.sections import SECTIONS
from wm_drake.parameters.types import FloatArray

Vector: TypeAlias = tuple[float, float, float]
Rotation: TypeAlias = tuple[Vector, Vector, Vector]

SHAPES = {(): float, (3,): Vector, (3, 3): Rotation}
"""Type of a described number by its shape."""

NAMES = ("tub_frame", "housing_frame", "outer_frame", "inner_frame")
"""Fields of an element that name frames."""


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


LINE = (
    Described("length_at_rest", "Length at the rest pose.", unit="m"),
    Described("direction_at_rest_W", "From the housing end to the tub end.", shape=(3,)),
)
"""What each strut has at the rest pose."""


def described_type(kind: ElementKind, parameters: type[BaseModel] | None = None) -> Any:
    """Return the type of the described elements of a kind; further keys are allowed.

    Args:
        parameters: Type of its numbers in a machine file, whose fields it has too.
    """
    fields: dict[str, Any] = {}
    meanings = meanings_of(parameters) if parameters else {}
    for name, field in (parameters.model_fields if parameters else {}).items():
        if name not in NAMES:
            about = copy(field)
            about.description = meanings.get(name)
            fields[name] = (field.annotation, about)
    for one in (*kind.described, *(LINE if kind.picture == "strut" else ())):
        form: Any = SHAPES[one.shape]
        unit = u.Unit(one.unit, one.unit) if one.unit else None
        form = Annotated[form, unit] if unit and form is float else form
        words = f"{one.words} [{one.unit}]" if one.shape and one.unit else one.words
        fields[one.name] = (form | None, Field(description=words))
    return create_model(kind.title, __base__=Open, **fields)


_SPRING: Any = described_type(SPRING_STRUT, SpringType)
_DAMPER: Any = described_type(FRICTION_DAMPER_STRUT)
_BUSHING: Any = described_type(SIX_COMPONENT_BUSHING_OF_RUBBER, BushingType)
_TUBES: Any = described_type(TELESCOPIC_DAMPER_TUBES)


class Spring(_SPRING):
    """A spring: h = preload + F(length - length_at_preload), F = k x or a table.

    The tension is h from `taut_from` on, 0 where h <= 0, and between them w s^2 (2 - s) with w =
    taut_from and s = h / w. A tension-compression spring has the tension h everywhere.
    """

    tension_at_rest: u.Force


class Damper(_DAMPER):
    """A friction damper on a massless strut; the other keys are the numbers of its law, in SI."""

    law: str = Field(description="Name of the law, key of `laws`.")
    end_bushing: EndBushing


class Bushing(_BUSHING):
    """A bushing between tub and housing; its law holds along the axes of the housing-side frame.

    The other keys are friction, Maxwell branches and cross-stiffness of rubber by key of the
    machine file, as far as they are not 0. Their stretches are 0 at the start of a run.
    """


class TelescopicDamper(_TUBES):
    """Two tubes as bodies, each on a bushing; the other keys are the numbers of the law along them.

    O is the link frame of the outer tube, which coincides with T as drawn.
    """

    law: str = Field(description="Name of the law, key of `laws`.")
    outer_tube: str
    inner_tube: str
    tub_bushing: BushingType
    housing_bushing: BushingType
    outer_tube_rest_pose: Pose
    extension_at_rest: u.Length


class OtherElement(Open):
    """An element of the section `elements`; the other keys are those of its kind."""

    kind: str = Field(description="Name of the kind in machine files.")
    law: str = Field(description="What it is, in words.")


def described_elements(setup: Setup, section: str) -> dict[str, dict[str, Any]]:
    """Return the elements of a section of the machine file, with their numbers in SI."""
    of_section, elements = SECTIONS[section], setup.elements
    placed: dict[str, Any] = {
        "springs": elements.springs,
        "dampers": elements.dampers,
        "bushings": elements.bushings,
        "telescopic_dampers": elements.telescopes,
        "elements": elements.others,
    }
    described = {}
    for name, element in of_section.elements(setup.parameters).items():
        numbers: dict[str, Any] = {}
        for field, part in of_section.parts(setup.parameters, element).items():
            values = _numbers(part, without=(*NAMES, *of_section.types))
            if section == "telescopic_dampers":
                values.pop("end_bushing", None)  # it is for dampers without tubes
            numbers |= values if field in ("", "type") else {field: values}
        kind = placed[section][name].kind
        numbers |= {one.name: one.of(placed[section][name]) for one in kind.described}
        if kind.picture == "strut":
            numbers |= _line(setup, numbers)
        described[name] = numbers | _of_section(setup, section, name)
    return described


def _numbers(part: BaseModel, without: tuple[str, ...]) -> dict[str, Any]:
    """Return the numbers of an element or of a type; of rubber those that are not 0."""
    values = part.model_dump(exclude=set(without))
    return {k: v for k, v in values.items() if v or k not in RubberBranches.model_fields}


def _line(setup: Setup, numbers: dict[str, Any]) -> dict[str, Any]:
    """Return length and direction of a strut at the rest pose."""
    rotation = np.reshape(generic(rotation_from_rpy)(*setup.rest_pose[:3]), (3, 3))
    end = setup.rest_pose[3:] + rotation @ numbers["tub_point_T"]
    line = end - numbers["housing_point_W"]
    length = float(np.linalg.norm(line))
    return {"length_at_rest": length, "direction_at_rest_W": (line / length).tolist()}


def _of_section(setup: Setup, section: str, name: str) -> dict[str, Any]:
    """Return what only the elements of one section have."""
    if section == "springs":
        return {"tension_at_rest": tensions_at(setup.elements, setup.rest_pose)[name]}
    if section == "elements":
        return {"law": setup.elements.others[name].kind.words}
    if section != "telescopic_dampers":
        return {}
    joint = setup.parameters.telescopic_dampers[name].joint
    outer, inner = (body.name() for body in tubes_of(setup.machine.plant, joint))
    rest = setup.tube_rest[list(setup.telescopes).index(name)]
    return {
        "outer_tube": outer,
        "inner_tube": inner,
        "outer_tube_rest_pose": Pose.of(rest[:6]),
        "extension_at_rest": float(rest[6]),
    }
