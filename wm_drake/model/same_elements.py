"""Check that numbers fit a machine that is built already."""

import functools
import typing
from typing import Any

from pydantic import BaseModel

from wm_drake.elements.motor import motor_structure
from wm_drake.errors import InputError, input_error, nearest_names
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.drive import motor_of
from wm_drake.parameters.elements import ForceTable, TorqueTable
from wm_drake.parameters.sections import SECTIONS, FileSection

BUILT_IN = {
    "kind": "kind",
    "law": "law",
    "joint": "joint",
    "branches_in_use": "branches of rubber",
    "balls": "number of balls",
}
"""What a built machine keeps of an element or its type, beside the size of tables, in words."""


def check_same_elements(
    built: MachineParameters, requested: MachineParameters, checked: MachineParameters | None = None
) -> None:
    """Check that a machine has the elements, laws and joints of the built one.

    Args:
        built: Machine that was built.
        requested: Machine whose numbers are to be set in it.
        checked: A machine that was checked already; what the requested one shares with it is not
            looked at again.

    Raises:
        InputError: they differ; the machine must be built again.
    """
    for key in ("model", "gravity"):
        if getattr(requested, key) != getattr(built, key):
            raise input_error(
                f"{getattr(requested, key)} is not the built machine's {getattr(built, key)}; "
                "rebuild the machine",
                key=key,
            )
    if requested is built or requested is checked:
        return
    _check_frames(built, requested)
    if (requested.imperfections.bearing is None) != (built.imperfections.bearing is None):
        kinds = ("compliant", "rigid")
        now, before = kinds if requested.imperfections.bearing else kinds[::-1]
        raise input_error(
            f"is {now}; the built machine has a {before} bearing: rebuild the machine to make it "
            f"{now}",
            key="imperfections.bearing",
        )
    _check_drive(built, requested)
    if requested.cabinet_moves != built.cabinet_moves:
        kinds = ("moves", "does not")
        now, before = kinds if requested.cabinet_moves else kinds[::-1]
        raise input_error(
            f"this cabinet {now}, that of the built machine {before}; rebuild the machine",
            key="cabinet.moves",
        )
    for section in SECTIONS.values():
        for known in (checked or built, built):
            if all(getattr(known, t) is getattr(requested, t) for t in section.tables):
                break
        else:
            _check_section(section, built, requested)


def _check_section(
    section: FileSection, built: MachineParameters, requested: MachineParameters
) -> None:
    """Raise InputError if the elements of a section have other names, or are built otherwise."""
    others, elements = section.elements(built), section.elements(requested)
    if elements.keys() != others.keys():
        other = sorted(elements.keys() ^ others.keys())[0]
        raise input_error(
            f"'{other}' is not in both machines{nearest_names(other, set(others))}; "
            "rebuild the machine",
            key=section.name,
        )
    for name, element in elements.items():
        parts, of_built = section.parts(requested, element), section.parts(built, others[name])
        for field, part in parts.items():
            if part is not of_built[field]:
                at = "" if field == "type" else field  # a type is part of the element itself
                key = ".".join(filter(None, [section.key(name), at]))
                _check_part(of_built[field], part, key)


def _check_part(built: BaseModel, requested: BaseModel, key: str) -> None:
    """Raise InputError if an element or a type is not built as another one."""
    for field in _built_in(type(requested)) | _built_in(type(built)):
        now, before = getattr(requested, field, None), getattr(built, field, None)
        if now != before:
            raise _not_as_built(f"has {BUILT_IN[field]} {_words(now)}", _words(before), key)
    now, before = (_points(part) for part in (requested, built))
    if sorted(now.values()) == sorted(before.values()):
        return  # the packed numbers take as much room
    for field in now.keys() | before.keys():
        if now.get(field, 0) != before.get(field, 0):
            points = now.get(field, 0) or "no"
            raise _not_as_built(f"{field} has {points} points", before.get(field, 0) or "none", key)


@functools.cache
def _built_in(kind: type[BaseModel]) -> frozenset[str]:
    """Return the names in `BUILT_IN` that a type has."""
    return frozenset(name for name in BUILT_IN if name in kind.model_fields or hasattr(kind, name))


def _not_as_built(now: str, before: object, key: str) -> InputError:
    """Return the error for a part of a machine that is not as it was built."""
    return input_error(f"{now}, that of the built machine {before}; rebuild the machine", key=key)


def _words(value: Any) -> str:
    """Return a name in quotes, or the names of a tuple."""
    return (", ".join(value) or "none") if isinstance(value, tuple) else f"'{value}'"


def _check_drive(built: MachineParameters, requested: MachineParameters) -> None:
    """Raise InputError if a drive is of another kind, on another joint or with another sampling."""
    drives = built.drive, requested.drive
    if drives[0] is drives[1]:
        return
    if drives[0].kind != drives[1].kind or drives[0].joint != drives[1].joint:
        texts = [f"{drive.kind} at '{drive.joint}'" for drive in drives]
        raise input_error(
            f"is {texts[1]}; the built machine has {texts[0]}: rebuild the machine", key="drive"
        )
    motors = [motor for motor in map(motor_of, drives) if motor]
    if len({tuple(motor_structure(motor)) for motor in motors}) > 1:
        raise input_error(
            "has another number of points than the built machine's; rebuild the machine",
            key="drive.torque_limit",
        )
    if len({motor.controller.sample_time for motor in motors}) > 1:
        raise input_error(
            "is not the built machine's; rebuild the machine", key="drive.controller.sample_time"
        )


def _check_frames(built: MachineParameters, requested: MachineParameters) -> None:
    """Raise InputError if a new frame is on another link, turned, or in one machine only."""
    if built.frames is requested.frames:
        return
    added = [
        {name: (f.attached_to, f.angles) for name, f in p.frames.items() if f.attached_to}
        for p in (built, requested)
    ]
    for name in {**added[0], **added[1]}:
        if added[0].get(name) != added[1].get(name):
            raise input_error(
                "is not a new frame of the built machine, on the same link with the same angles; "
                "rebuild the machine",
                key=f"frames.{name}",
            )


def _points(type_: BaseModel) -> dict[str, int]:
    """Return the number of points of each table of a type, by its field."""
    values = ((name, getattr(type_, name)) for name in _fields_of_tables(type(type_)))
    return {
        name: len(value.curve[0])
        for name, value in values
        if isinstance(value, ForceTable | TorqueTable)
    }


@functools.cache
def _fields_of_tables(kind: type[BaseModel]) -> tuple[str, ...]:
    """Return the names of the fields of a type that may be tables."""
    fields = kind.model_fields.items()
    return tuple(name for name, field in fields if _may_be_table(field.annotation))


def _may_be_table(annotation: Any) -> bool:
    return annotation in (ForceTable, TorqueTable) or any(
        map(_may_be_table, typing.get_args(annotation))
    )
