"""Check that numbers fit a machine that is built already."""

import functools
import typing
from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel

from wm_drake.elements.motor import motor_structure
from wm_drake.errors import input_error, nearest_names
from wm_drake.parameters import MachineParameters
from wm_drake.parameters.drive import motor_of
from wm_drake.parameters.elements import ForceTable, TorqueTable


def check_same_elements(built: MachineParameters, requested: MachineParameters) -> None:
    """Raise InputError if a machine has other elements, laws or joints than the built one."""
    for key in ("model", "gravity"):
        if getattr(requested, key) != getattr(built, key):
            raise input_error(
                f"{getattr(requested, key)} is not the built machine's {getattr(built, key)}; "
                "rebuild the machine",
                key=key,
            )
    if requested is built:
        return
    _check_names(built, requested)
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
    _check_kinds(built, requested)
    _check_laws(built, requested)
    _check_branches(built, requested)
    _check_tables(built, requested)


def _check_branches(built: MachineParameters, requested: MachineParameters) -> None:
    """Raise InputError if a bushing uses other branches of rubber."""
    others = built.all_bushings()
    for name, bushing in requested.all_bushings().items():
        if bushing is others[name]:
            continue
        if bushing.branches_in_use != others[name].branches_in_use:
            now, before = (", ".join(b.branches_in_use) or "none" for b in (bushing, others[name]))
            raise input_error(
                f"uses other branches of rubber ({now}) than the built machine ({before}); "
                "rebuild the machine",
                key=name if name == "gasket" else f"bushings.{name}",
            )


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


def _check_names(built: MachineParameters, requested: MachineParameters) -> None:
    """Raise InputError if an element is in one of the machines only."""
    for table in ("springs", "dampers", "all_bushings", "telescopic_dampers", "elements"):
        if getattr(built, table) is getattr(requested, table):
            continue
        names = [set(t() if callable(t := getattr(p, table)) else t) for p in (built, requested)]
        if names[0] != names[1]:
            other = sorted(names[0] ^ names[1])[0]
            raise input_error(
                f"'{other}' is not in both machines{nearest_names(other, names[0])}; "
                "rebuild the machine",
                key=table.removeprefix("all_"),
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


def _check_kinds(built: MachineParameters, requested: MachineParameters) -> None:
    """Raise InputError if an element of another package has another kind."""
    for name, element in requested.elements.items():
        if element.kind != built.elements[name].kind:
            raise input_error(
                f"kind '{element.kind}' is not the built machine's "
                f"'{built.elements[name].kind}'; rebuild the machine",
                key=f"elements.{name}",
            )


def _check_laws(built: MachineParameters, requested: MachineParameters) -> None:
    """Raise InputError if a damper has another law or another joint."""
    for table in ("dampers", "telescopic_dampers"):
        for name, damper in getattr(requested, table).items():
            built_damper = getattr(built, table)[name]
            types = built.damper_types[built_damper.type], requested.damper_types[damper.type]
            if damper is built_damper and types[0] is types[1]:
                continue
            built_law, law = (type_.law for type_ in types)
            if law != built_law:
                raise input_error(
                    f"law '{law}' is not the built machine's '{built_law}'; rebuild the machine",
                    key=f"{table}.{name}",
                )
            if getattr(damper, "joint", "") != getattr(built_damper, "joint", ""):
                raise input_error(
                    "is not the built machine's joint; rebuild the machine",
                    key=f"{table}.{name}.joint",
                )


def _check_tables(built: MachineParameters, requested: MachineParameters) -> None:
    """Raise InputError if an element has a table where the other has none or fewer points."""
    others = dict(_types_of_elements(built))
    for key, type_ in _types_of_elements(requested):
        if type_ is others[key]:
            continue
        now, before = _points(type_), _points(others[key])
        if sorted(now.values()) == sorted(before.values()):
            continue  # the packed numbers take as much room
        for field in now.keys() | before.keys():
            if now.get(field, 0) != before.get(field, 0):
                raise input_error(
                    f"{field} has {now.get(field, 0) or 'no'} points, that of the built machine "
                    f"{before.get(field, 0) or 'none'}; rebuild the machine",
                    key=key,
                )


def _types_of_elements(machine: MachineParameters) -> Iterator[tuple[str, BaseModel]]:
    """Yield key path and type of each element whose type may have tables."""
    for name, spring in machine.springs.items():
        yield f"springs.{name}", machine.spring_types[spring.type]
    for name, damper in machine.dampers.items():
        yield f"dampers.{name}", machine.damper_types[damper.type]
    for name, bushing in machine.all_bushings().items():
        yield name if name == "gasket" else f"bushings.{name}", bushing
    for name, element in machine.elements.items():
        yield f"elements.{name}", element
    for name, telescope in machine.telescopic_dampers.items():
        key = f"telescopic_dampers.{name}"
        yield key, machine.damper_types[telescope.type]
        yield f"{key}.tub_bushing", machine.bushing_types[telescope.tub_bushing]
        yield f"{key}.housing_bushing", machine.bushing_types[telescope.housing_bushing]


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
