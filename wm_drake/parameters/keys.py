"""Key paths such as ``gasket.stiffness_x``: the one way to change a number, and the list of all that can be changed."""

import typing
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from pydantic import BaseModel, ValidationError

from wm_drake.errors import InputError, input_error, nearest_names
from wm_drake.parameters.machine import MachineParameters
from wm_drake.parameters.problems import problems_of
from wm_drake.parameters.units import Unit

Tree = typing.TypeVar("Tree", bound=BaseModel)


def with_value(parameters: Tree, key: str, value: Any) -> Tree:
    """A copy with one value changed.

    Args:
        parameters: The machine; any part of one, such as a damper type, does as well.
        key: Path of names from the top, joined by dots: ``gasket.stiffness_x``, ``loads.middle.unbalances.0.mass``.
            ``bodies.NAME`` and ``frames.NAME`` need not be in the machine file.
        value: SI number or text with a unit (``"5 N/mm"``); a mapping for a group of values.

    Raises:
        InputError: unknown key (with the nearest known one) or a value that is not allowed.
    """
    return typing.cast(Tree, _replaced(parameters, key.split("."), value, key))


def _replaced(node: Any, path: list[str], value: Any, key: str) -> Any:
    if not path:
        return value
    name, rest = path[0], path[1:]
    if isinstance(node, BaseModel):
        fields = type(node).model_fields
        if name not in fields:
            raise input_error(f"unknown key '{name}'" + nearest_names(name, fields), key=key)
        values = {field: getattr(node, field) for field in node.model_fields_set | {name}}
        values[name] = _entered(node, name, rest, value, key)
        try:
            return type(node).model_validate(values)
        except ValidationError as error:
            here = ".".join(key.split(".")[: -len(path)])
            problems = problems_of(error, type(node), here)
            raise InputError(replace(p, key=key) if key.startswith(p.key) else p for p in problems) from None
    if isinstance(node, dict):
        if name not in node:
            raise input_error(f"unknown key '{name}'" + nearest_names(name, node), key=key)
        return {**node, name: _replaced(node[name], rest, value, key)}
    if isinstance(node, tuple) and name.isdigit() and int(name) < len(node):
        return tuple(_replaced(v, rest, value, key) if i == int(name) else v for i, v in enumerate(node))
    raise input_error(f"'{name}' leads nowhere: the path ends before it", key=key)


def _entered(node: BaseModel, name: str, rest: list[str], value: Any, key: str) -> Any:
    child = getattr(node, name)
    if name in ("bodies", "frames") and rest:  # overrides of the SDF come into being when they are first named
        entry = child.get(rest[0])
        if entry is None:
            nested: Any = value
            for part in reversed(rest[1:]):
                nested = {part: nested}
            return {**child, rest[0]: nested}
    return _replaced(child, rest, value, key)


def unit_of(annotation: Any, metadata: typing.Iterable[Any] = ()) -> Unit | None:
    """The unit of a field, wherever in its annotation it stands; None for names and groups."""
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
    """Every number of a tree of parameters: key path, SI value, unit."""
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
    """Where a number comes from: its own source, or the nearest one above it; empty if none is given."""
    parts = key.split(".")
    while parts:
        if ".".join(parts) in parameters.sources:
            return parameters.sources[".".join(parts)]
        parts.pop()
    return ""
