"""Key paths such as ``gasket.stiffness_x``: change numbers, and list all that can be changed."""

import re
import typing
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from pydantic import BaseModel, ValidationError

from wm_drake.errors import InputError, Problem, input_error, nearest_names
from wm_drake.parameters.elements import ForceTable, TorqueTable
from wm_drake.parameters.machine import MachineParameters
from wm_drake.parameters.problems import problems_of
from wm_drake.parameters.units import Unit

Tree = typing.TypeVar("Tree", bound=BaseModel)


def with_value(parameters: Tree, key: str, value: Any) -> Tree:
    """Return a copy of a machine with one value changed.

    Args:
        parameters: The machine, or a part of one such as a damper type.
        key: Names from the top, joined by dots, such as ``gasket.stiffness_x`` or
            ``loads.middle.unbalances.0.mass``. ``bodies.NAME`` and ``frames.NAME`` need not be in
            the machine file.
        value: SI number or text with a unit (``"5 N/mm"``); a mapping for a group of values; None
            removes an element, or sets a number to its default, as null in a machine file.

    Raises:
        InputError: the key is unknown (the message names similar ones), or the value is not
            allowed.

    Example:
        >>> import wm_drake as wm
        >>> parameters = wm.load_machine("reference")
        >>> softer = wm.with_value(parameters, "gasket.stiffness_x", "1.5 N/mm")
        >>> softer.gasket.stiffness_x
        1500.0
    """
    return with_values(parameters, {key: value})


DEEPEST_KEY = 20
"""Largest number of parts of a key path; no number of a machine needs half of them."""


def with_values(parameters: Tree, values: Mapping[str, Any]) -> Tree:
    """Return a copy of a machine with several values changed.

    This takes little more time than changing one value, because each group of values is checked
    once.

    Args:
        parameters: The machine, or a part of one such as a damper type.
        values: Values by key path as in `with_value`. If one key is part of another, the later one
            in the mapping wins.

    Raises:
        InputError: a key is unknown (the message names similar ones), or a value is not allowed.

    Example:
        >>> import wm_drake as wm
        >>> changes = {"gasket.stiffness_x": 1500.0, "bodies.motor.mass": "6 kg"}
        >>> changed = wm.with_values(wm.load_machine("reference"), changes)
        >>> changed.bodies["motor"].mass
        6.0
    """
    for key in values:
        if key.count(".") >= DEEPEST_KEY:
            raise input_error(f"has more than {DEEPEST_KEY} parts; no number has", key=key)
    return typing.cast(
        Tree,
        _replaced(
            parameters, [_Change(key, key.split("."), value) for key, value in values.items()]
        ),
    )


def is_index(part: str) -> bool:
    """Return whether a part of a key path is the index of an entry of a list."""
    return part.isascii() and part.isdecimal() and len(part) < 9


@dataclass(frozen=True)
class _Change:
    """A change of one value in a tree.

    Attributes:
        key: Complete key path, for messages.
        path: Names that lead from the current node to the value.
        value: The new value.
    """

    key: str
    path: list[str]
    value: Any


def _replaced(node: Any, changes: list[_Change]) -> Any:
    last = max((number for number, change in enumerate(changes) if not change.path), default=None)
    if last is not None:  # the whole node is replaced; later changes apply to the new node
        return (
            _replaced(changes[last].value, changes[last + 1 :])
            if changes[last + 1 :]
            else changes[last].value
        )
    parts: dict[str, list[_Change]] = {}
    for change in changes:
        parts.setdefault(change.path[0], []).append(
            _Change(change.key, change.path[1:], change.value)
        )
    if isinstance(node, BaseModel):
        return _replaced_in_model(node, parts)
    if isinstance(node, dict):
        return _replaced_in_mapping(node, parts)
    for name, inner in parts.items():
        if node is None:
            whole = inner[0].key.removesuffix("." + ".".join([name, *inner[0].path]))
            raise input_error(
                f"the machine has no '{whole}'; to add it, write all of it in a machine file",
                key=inner[0].key,
            )
        if not (isinstance(node, tuple) and is_index(name) and int(name) < len(node)):
            allowed = (
                f"allowed are 0 to {len(node) - 1}"
                if isinstance(node, tuple)
                else "the path must end before it"
            )
            raise input_error(f"'{name}' does not exist; {allowed}", key=inner[0].key)
    return tuple(
        _replaced_entry(entry, parts[str(i)]) if str(i) in parts else entry
        for i, entry in enumerate(node)
    )


def _replaced_in_mapping(node: dict[str, Any], parts: dict[str, list[_Change]]) -> dict[str, Any]:
    """Return a mapping with entries replaced; those whose new value is None are removed."""
    for name, inner in parts.items():
        if name not in node:
            raise input_error(f"unknown key '{name}'" + nearest_names(name, node), key=inner[0].key)
    new = {name: _replaced(node[name], inner) for name, inner in parts.items()}
    changed = {**node, **new}
    return {name: changed[name] for name in node if name not in new or new[name] is not None}


def _replaced_entry(entry: Any, changes: list[_Change]) -> Any:
    new = _replaced(entry, changes)
    if new is None:
        raise input_error(
            "one entry of a list cannot be removed; write the whole list in a machine file",
            key=changes[0].key,
        )
    return new


def _replaced_in_model(node: BaseModel, parts: dict[str, list[_Change]]) -> BaseModel:
    fields = type(node).model_fields
    values = {field: getattr(node, field) for field in node.model_fields_set}
    for name, changes in parts.items():
        if name not in fields:
            raise input_error(
                f"unknown key '{name}'" + nearest_names(name, fields), key=changes[0].key
            )
        values[name] = _changed_field(node, name, changes)
        if values[name] is None:
            del values[name]
    if isinstance(node, MachineParameters) and _only_numbers_inside(node, parts):
        # the part is checked; the rules between parts of a machine are about names and choices
        return node.model_copy(update={name: values[name] for name in parts})
    try:
        return type(node).model_validate(values)
    except ValidationError as error:
        changes = [change for inner in parts.values() for change in inner]
        here = ".".join(changes[0].key.split(".")[: -1 - len(changes[0].path)])
        raise InputError(
            _with_key_of_change(problem, changes)
            for problem in problems_of(error, type(node), here)
        ) from None


def _only_numbers_inside(node: BaseModel, parts: dict[str, list[_Change]]) -> bool:
    """Return whether numbers and tables inside the fields of a node take the place of others."""
    return all(
        change.path and _is_number(change.value) and _is_number(_inside(node, name, change.path))
        for name, changes in parts.items()
        for change in changes
    )


def _is_number(value: Any) -> bool:
    return isinstance(value, float | int | ForceTable | TorqueTable) and not isinstance(value, bool)


def _inside(node: Any, name: str, path: list[str]) -> Any:
    """Return the value at a path in a field of a node; None if there is none."""
    for part in (name, *path):
        if isinstance(node, BaseModel):
            node = getattr(node, part, None)
        elif isinstance(node, dict):
            node = node.get(part)
        else:
            known = isinstance(node, tuple) and is_index(part) and int(part) < len(node)
            node = node[int(part)] if known else None
    return node


def _with_key_of_change(problem: Problem, changes: list[_Change]) -> Problem:
    """Return a problem of a group of values with the key of the change that caused it.

    Of several changes in the group it is the one that the message names; if it names none of them,
    the key stays that of the group.
    """
    inside = [change for change in changes if change.key.startswith(problem.key)]
    words = re.findall(r"\w+", problem.message)
    causes = [change for change in inside if change.key.split(".")[-1] in words]
    found = causes or (inside if len(inside) == 1 else [])
    return replace(problem, key=found[0].key) if found else problem


def _changed_field(node: BaseModel, name: str, changes: list[_Change]) -> Any:
    child = getattr(node, name)
    if name not in ("bodies", "frames"):
        return _replaced(child, changes)
    # an override of the SDF is added when a change names it for the first time
    new = [change for change in changes if change.path and change.path[0] not in child]
    known = [change for change in changes if change not in new]
    for change in new:
        if change.value is None:
            name = change.path[0]
            raise input_error(f"unknown key '{name}'{nearest_names(name, child)}", key=change.key)
    kept = _replaced(child, known) if known else child
    return {**(kept or {}), **_nested(new)} if new else kept


def _nested(changes: list[_Change]) -> Any:
    """Return changes as nested mappings."""
    tree: Any = {}
    for change in changes:
        if not change.path:
            return change.value
        tree.setdefault(change.path[0], []).append(
            _Change(change.key, change.path[1:], change.value)
        )
    return {name: _nested(inner) for name, inner in tree.items()}


def unit_of(annotation: Any, metadata: typing.Iterable[Any] = ()) -> Unit | None:
    """Return the unit in the annotation of a field; None for names and groups of values."""
    for item in metadata:
        if isinstance(item, Unit):
            return item
    arguments = typing.get_args(annotation)
    if hasattr(annotation, "__metadata__"):
        return unit_of(arguments[0], annotation.__metadata__)
    if typing.get_origin(annotation) in (dict, tuple):
        return None
    return next((unit for unit in map(unit_of, arguments) if unit is not None), None)


def quantities(node: Any, path: str = "") -> Iterator[tuple[str, Any, Unit]]:
    """Yield key path, SI value and unit of every number in a tree of parameters."""
    if isinstance(node, BaseModel):
        for name, field in type(node).model_fields.items():
            value = getattr(node, name)
            unit = unit_of(field.annotation, field.metadata)
            if unit is not None and value is not None and not isinstance(value, BaseModel):
                yield f"{path}{name}", value, unit
            elif name != "sources":
                yield from quantities(value, f"{path}{name}.")
    elif isinstance(node, dict):
        for name, value in node.items():
            yield from quantities(value, f"{path}{name}.")
    elif isinstance(node, tuple):
        for index, value in enumerate(node):
            yield from quantities(value, f"{path}{index}.")


def source_of(parameters: MachineParameters, key: str) -> str:
    """Return the source of a number, or that of the nearest group around it; empty if none."""
    parts = key.split(".")
    while parts:
        if ".".join(parts) in parameters.sources:
            return parameters.sources[".".join(parts)]
        parts.pop()
    return ""
