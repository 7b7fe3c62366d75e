"""Key paths such as ``gasket.stiffness_x``: change numbers, and list all that can be changed."""

import math
import re
import typing
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import annotated_types
from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from wm_drake.errors import InputError, Problem, input_error, nearest_names
from wm_drake.parameters.elements import CurveTable
from wm_drake.parameters.machine import MachineParameters
from wm_drake.parameters.problems import problems_of
from wm_drake.parameters.units import Fraction, Share, Unit

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
            Percents scale a number or the ordinates of a table (``"80 %"``).

    Raises:
        InputError: the key is unknown (the message names similar ones), or the value is not
            allowed.

    Example:
        >>> import wm_drake as wm
        >>> parameters = wm.load_machine("reference")
        >>> worn = wm.with_value(parameters, "damper_types.friction.friction_force", "25 N")
        >>> worn.damper_types["friction"].friction_force
        25.0
        >>> softer = wm.with_value(parameters, "gasket.stiffness_x", "80 %")
        >>> round(softer.gasket.stiffness_x.force[-1], 3)
        89.064
    """
    return with_values(parameters, {key: value})


OF_SDF = ("bodies", "frames")
"""Groups whose entries replace numbers of the SDF, and need not be in the machine file."""

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
        >>> changes = {"gasket.stiffness_x": "80 %", "bodies.motor.mass": "6 kg"}
        >>> changed = wm.with_values(wm.load_machine("reference"), changes)
        >>> changed.bodies["motor"].mass
        6.0
    """
    for key in values:
        if key.count(".") >= DEEPEST_KEY:
            raise input_error(f"has more than {DEEPEST_KEY} parts; no number has", key=key)
    edits = _Edit("", 0)
    for key, value in values.items():
        edits.add(key, value)
    return typing.cast(Tree, edits.applied(parameters))


def is_index(part: str) -> bool:
    """Return whether a part of a key path is the index of an entry of a list."""
    return part.isascii() and part.isdecimal() and len(part) < 9


class _Edit:
    """Changes at one place of a tree: a new value of the whole, then changes inside it.

    Attributes:
        key: Complete key path of the first change here or inside, for messages.
        depth: Number of parts of the key path that lead here.
        whole: New value of the whole, in a list; empty if it is not replaced.
        inside: Edits by the next part of their key paths.
        is_of_numbers: Whether numbers and tables took the place of numbers and tables.
    """

    __slots__ = ("depth", "inside", "is_of_numbers", "key", "whole")

    def __init__(self, key: str, depth: int) -> None:
        self.key, self.depth = key, depth
        self.whole: list[Any] = []
        self.inside: dict[str, _Edit] = {}
        self.is_of_numbers = False

    def add(self, key: str, value: Any) -> None:
        """Add a change; it replaces all earlier ones at this key path and inside it."""
        edit = self
        for depth, part in enumerate(key.split("."), start=1):
            if part not in edit.inside:
                edit.inside[part] = _Edit(key, depth)
            edit = edit.inside[part]
        edit.whole, edit.inside = [value], {}

    def changed(self) -> Iterator[str]:
        """Yield the key paths of all changes."""
        if self.whole:
            yield self.path
        for edit in self.inside.values():
            yield from edit.changed()

    @property
    def path(self) -> str:
        """Key path of this place."""
        return ".".join(self.key.split(".")[: self.depth])

    def applied(self, node: Any, unit: Unit | None = None) -> Any:
        """Return what the changes make of a value.

        Args:
            node: The value.
            unit: Unit of its field, if it is one number. Percents of a share are a value.
        """
        if self.whole:
            new = self.whole[0]
            if _is_number(node) and not isinstance(unit, Fraction):
                new = self._percents_of(node, new)
            self.is_of_numbers = _is_number(new) and _is_number(node)
            node = new
            if not self.inside:
                return node
        if isinstance(node, BaseModel):
            node = self._in_model(node)
        elif isinstance(node, dict):
            node = self._in_mapping(node)
        else:
            node = self._in_list(node)
        self.is_of_numbers = all(edit.is_of_numbers for edit in self.inside.values())
        return node

    def _percents_of(self, node: Any, new: Any) -> Any:
        """Return a number or table times a text such as "80 %"; any other new value as it is."""
        if not isinstance(new, str) or not new.strip().endswith("%"):
            return new
        try:
            factor = Share().number(new)
        except ValueError as error:
            raise input_error(str(error), key=self.path) from None
        return node.scaled(factor) if isinstance(node, CurveTable) else factor * node

    def _in_list(self, node: Any) -> tuple[Any, ...]:
        key = next(iter(self.inside.values())).key
        if node is None:
            message = (
                f"the machine has no '{self.path}'; to add it, write all of it in a machine file"
            )
            raise input_error(message, key=key)
        entries = list(node) if isinstance(node, tuple) else []
        for name, edit in self.inside.items():
            if not (is_index(name) and int(name) < len(entries)):
                allowed = f"allowed are 0 to {len(entries) - 1}"
                if not isinstance(node, tuple):
                    allowed = "the path must end before it"
                raise input_error(f"'{name}' does not exist; {allowed}", key=edit.key)
            entries[int(name)] = edit.applied(entries[int(name)])
            if entries[int(name)] is None:
                raise input_error(
                    "one entry of a list cannot be removed; write the whole list in a machine file",
                    key=edit.key,
                )
        return tuple(entries)

    def _in_mapping(self, node: Mapping[str, Any]) -> dict[str, Any]:
        """Return a mapping with entries replaced; those whose new value is None are removed."""
        entries = dict(node)
        for name, edit in self.inside.items():
            if name not in node:
                raise input_error(f"unknown key '{name}'" + nearest_names(name, node), key=edit.key)
            entries[name] = edit.applied(node[name])
            if entries[name] is None:
                del entries[name]
        return entries

    def _in_model(self, node: BaseModel) -> BaseModel:
        fields = type(node).model_fields
        values = {field: getattr(node, field) for field in node.model_fields_set}
        for name, edit in self.inside.items():
            if name not in fields:
                raise input_error(
                    f"unknown key '{name}'" + nearest_names(name, fields), key=edit.key
                )
            child = getattr(node, name)
            is_of_sdf = name in OF_SDF and not edit.whole
            unit = unit_of(fields[name].annotation, fields[name].metadata)
            values[name] = edit._in_overrides(child) if is_of_sdf else edit.applied(child, unit)
            if values[name] is None:
                del values[name]
        if isinstance(node, MachineParameters) and all(
            edit.is_of_numbers and not edit.whole for edit in self.inside.values()
        ):
            # the part is checked; the rules between parts of a machine are about names and choices
            return node.model_copy(update={name: values[name] for name in self.inside})
        try:
            return type(node).model_validate(values)
        except ValidationError as error:
            keys = list(self.changed())
            raise InputError(
                _with_key_of_change(problem, keys)
                for problem in problems_of(error, type(node), self.path)
            ) from None

    def _in_overrides(self, node: dict[str, Any]) -> dict[str, Any]:
        """Return overrides of the SDF; one is added when a change names it for the first time."""
        added = {name: edit for name, edit in self.inside.items() if name not in node}
        for name, edit in added.items():
            if edit.whole == [None]:
                raise input_error(f"unknown key '{name}'{nearest_names(name, node)}", key=edit.key)
            for key in edit.changed():
                if is_index(key.rpartition(".")[2]):
                    message = "only the SDF has this list; write all of it: '(1, 2, 3) mm'"
                    raise input_error(message, key=key)
            del self.inside[name]
        entries = self.applied(node)
        self.is_of_numbers = self.is_of_numbers and not added
        self.inside |= added
        return {**entries, **{name: edit._as_tree() for name, edit in added.items()}}

    def _as_tree(self) -> Any:
        """Return the changes as nested mappings."""
        tree = {name: edit._as_tree() for name, edit in self.inside.items()}
        return self.whole[0] if self.whole and not tree else {**(self.whole or [{}])[0], **tree}


def _is_number(value: Any) -> bool:
    return isinstance(value, float | int | CurveTable) and not isinstance(value, bool)


def _with_key_of_change(problem: Problem, keys: list[str]) -> Problem:
    """Return a problem of a group of values with the key of the change that caused it.

    Of several changes in the group it is the one that the message names; if it names none of them,
    the key stays that of the group.
    """
    inside = [key for key in keys if key.startswith(problem.key)]
    words = re.findall(r"\w+", problem.message)
    causes = [key for key in inside if key.split(".")[-1] in words]
    causes = causes or (inside if len(inside) == 1 else [])
    return replace(problem, key=causes[0]) if causes else problem


def field_at(parameters: MachineParameters, key: str) -> tuple[Any, FieldInfo | None]:
    """Return the value at a key path, None if only the SDF has it, and its field.

    The field of an entry of a list is that of the list; a name of a mapping has none.
    """
    node: Any = parameters
    field: FieldInfo | None = None
    model: type[BaseModel] | None = None  # type of a group that is not in the machine file
    parts = key.split(".")
    for place, part in enumerate(parts):
        model = type(node) if isinstance(node, BaseModel) else model if node is None else None
        if model is not None and part in model.model_fields:
            field = model.model_fields[part]
            model = next((inner for _, inner in models_in(field.annotation)), None)
            node = None if node is None else getattr(node, part)
        elif isinstance(node, dict) and part in node:
            node, field = node[part], None
        elif isinstance(node, tuple) and is_index(part) and int(part) < len(node):
            node = node[int(part)]
        elif place == 1 and parts[0] in OF_SDF:
            group = type(parameters).model_fields[parts[0]]
            model, node = next(models_in(group.annotation))[1], None
        else:
            known = node if isinstance(node, dict) else model.model_fields if model else []
            raise input_error(f"unknown key '{part}'{nearest_names(part, known)}", key=key)
        if node is None and parts[0] not in OF_SDF:
            raise input_error(f"the machine has no {'.'.join(parts[: place + 1])}", key=key)
    return node, field


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


def models_in(annotation: Any, suffix: str = "") -> Iterator[tuple[str, type[BaseModel]]]:
    """Yield the groups of values in an annotation, each with what its key path adds.

    Args:
        suffix: Start of what the key path adds; NAME stands for a name, N for an index.
    """
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield suffix, annotation
        return
    origin, arguments = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is dict:
        yield from models_in(arguments[1], f"{suffix}.NAME")
    elif origin is tuple:
        yield from models_in(arguments[0], f"{suffix}.N")
    else:
        for argument in arguments:
            if argument is not type(None) and not isinstance(argument, str):
                yield from models_in(argument, suffix)


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


@dataclass(frozen=True)
class AllowedRange:
    """Range of the values that a field accepts, in SI units.

    Attributes:
        low, high: Ends of the range, infinite where there is none.
        low_is_in, high_is_in: Whether the end itself is allowed.
    """

    low: float = -math.inf
    high: float = math.inf
    low_is_in: bool = False
    high_is_in: bool = False

    def holds(self, value: float) -> bool:
        """Return whether a value is in the range."""
        above = value >= self.low if self.low_is_in else value > self.low
        below = value <= self.high if self.high_is_in else value < self.high
        return above and below

    def limits(self) -> Iterator[tuple[str, float]]:
        """Yield sign and value of each end, such as (">=", 0.0)."""
        if math.isfinite(self.low):
            yield ">=" if self.low_is_in else ">", self.low
        if math.isfinite(self.high):
            yield "<=" if self.high_is_in else "<", self.high


def allowed_range(parameters: MachineParameters, key: str) -> AllowedRange:
    """Return the range that the field of a key path allows; unbounded if it declares none.

    Other rules, such as an order of several numbers, are checked when a value is set.
    """
    _, field = field_at(parameters, key)
    return AllowedRange() if field is None else declared_range(field)


def declared_range(field: FieldInfo) -> AllowedRange:
    """Return the range that a field declares, itself or by the types of its alternatives."""
    low, high, low_is_in, high_is_in = -math.inf, math.inf, False, False
    for item in _metadata(field.annotation, field.metadata):
        if isinstance(item, annotated_types.Gt | annotated_types.Ge):
            low_is_in = isinstance(item, annotated_types.Ge)
            low = float(getattr(item, "ge" if low_is_in else "gt"))
        elif isinstance(item, annotated_types.Lt | annotated_types.Le):
            high_is_in = isinstance(item, annotated_types.Le)
            high = float(getattr(item, "le" if high_is_in else "lt"))
    return AllowedRange(low, high, low_is_in, high_is_in)


def _metadata(annotation: Any, metadata: Iterable[Any]) -> Iterator[Any]:
    for item in metadata:
        yield from getattr(item, "metadata", [item])
    for argument in typing.get_args(annotation):
        inner = getattr(argument, "__metadata__", ())
        yield from _metadata(typing.get_args(argument)[0] if inner else argument, inner)
