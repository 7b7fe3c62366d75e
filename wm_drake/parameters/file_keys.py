"""The keys that a machine file may have, read from the types that check it.

`key_groups` lists them for people, `file_schema` describes them as JSON schema for editors.
"""

import inspect
import re
import typing
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import annotated_types as limits
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from wm_drake.parameters.damper_laws import DamperNumbers
from wm_drake.parameters.keys import unit_of
from wm_drake.parameters.machine import MachineParameters
from wm_drake.parameters.units import PureNumber, Unit

EXTENDS = "Name or path of another machine; this file then contains only the differences."
SOURCE = "Where the numbers come from: a paper, a measurement, or an assumption with its reason."
_SIGNS = (
    ("gt", limits.Gt, ">"),
    ("ge", limits.Ge, ">="),
    ("lt", limits.Lt, "<"),
    ("le", limits.Le, "<="),
)


@dataclass(frozen=True)
class FileKey:
    """A key that a machine file may have.

    Attributes:
        name: The key.
        meaning: One or two sentences, from the docstring of the type.
        form: What a value is: a number with its unit such as ``N/mm``, a text, a group of keys.
        allowed: Range or choices; empty if any value of the form is allowed.
        default: Value if the key is missing; empty if there is none.
        is_required: Whether a machine needs the key, its own or an inherited one.
    """

    name: str
    meaning: str
    form: str
    allowed: str
    default: str
    is_required: bool


@dataclass(frozen=True)
class KeyGroup:
    """A group of keys, which may occur at several places of a file.

    Attributes:
        title: Name of the type in words.
        about: What it is, the first paragraph of the type's docstring.
        places: Key paths of the group; empty for the top of the file. NAME stands for a name of the
            user's choice, N for an index.
        also: Title of another group whose keys are keys of this one too; empty if there is none.
        keys: The keys, without those of `also`.
    """

    title: str
    about: str
    places: tuple[str, ...]
    also: str
    keys: tuple[FileKey, ...]


def key_groups() -> list[KeyGroup]:
    """Return the groups of keys of a machine file, in the order in which they first occur."""
    places: dict[type[BaseModel], list[str]] = {}
    for path, model in _walk(MachineParameters, ""):
        places.setdefault(model, []).append(path)
    known = list(places)
    return [_group(model, list(dict.fromkeys(paths)), known) for model, paths in places.items()]


def _walk(model: type[BaseModel], path: str) -> Iterator[tuple[str, type[BaseModel]]]:
    yield path, model
    for name, field in model.model_fields.items():
        for suffix, inner in _models(field.annotation):
            yield from _walk(inner, f"{path}.{name}{suffix}".lstrip("."))


def _group(model: type[BaseModel], places: list[str], listed: list[type[BaseModel]]) -> KeyGroup:
    base = next((other for other in model.__mro__[1:] if other in listed), None)
    inherited = set(base.model_fields) if base else set()
    meanings = meanings_of(model)
    keys = [
        _entry(name, field, meanings.get(name, ""))
        for name, field in model.model_fields.items()
        if name not in inherited and name != "sources"
    ]
    if model is MachineParameters:
        keys.insert(0, FileKey("extends", EXTENDS, "text", "", "", is_required=False))
    return KeyGroup(
        _title(model),
        _about(model),
        tuple(path for path in places if path),
        _title(base) if base else "",
        tuple(keys),
    )


def _title(model: type[BaseModel]) -> str:
    if issubclass(model, DamperNumbers):
        return f"Damper with the law {_choices(model.model_fields['law'].annotation)[0]}"
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", model.__name__)
    return "Machine" if model is MachineParameters else words.capitalize()


def _about(model: type[BaseModel]) -> str:
    text = inspect.cleandoc(model.__doc__ or "").split("\nAttributes:")[0]
    return " ".join(text.split())


def _entry(name: str, field: FieldInfo, meaning: str) -> FileKey:
    unit = unit_of(field.annotation, field.metadata)
    default = field.get_default(call_default_factory=True)
    is_required = field.is_required()
    shown = ""
    if not is_required and default is not None:
        scalar = unit is not None and not isinstance(default, BaseModel | dict)
        shown = unit.text(default) if scalar and unit is not None else _plain(default)
    return FileKey(name, meaning, *_form(field, unit), shown, is_required=is_required)


def _plain(default: Any) -> str:
    return default if isinstance(default, str) else ""


def _form(field: FieldInfo, unit: Unit | None) -> tuple[str, str]:
    """Return the form of a value and what is allowed."""
    if unit is not None:
        is_list = "tuple" in str(field.annotation)
        form = "number" if isinstance(unit, PureNumber) else f"number in {unit.shown}"
        if is_list:
            form = f"list in {unit.shown}"
        if any(True for _ in _models(field.annotation)):
            form += ", or a table"
        return form, ", ".join(_limits(field, unit))
    choices = _choices(field.annotation)
    if choices:
        return "text", ", ".join(choices)
    if any(True for _ in _models(field.annotation)):
        return "group", ""
    return ("list of texts" if "tuple" in str(field.annotation) else "text"), ""


def _limits(field: FieldInfo, unit: Unit) -> Iterator[str]:
    for item in _metadata(field.annotation, field.metadata):
        for name, kind, sign in _SIGNS:
            if isinstance(item, kind):
                yield f"{sign} {unit.text(float(getattr(item, name)))}".strip()


def _metadata(annotation: Any, metadata: typing.Iterable[Any]) -> Iterator[Any]:
    """Yield the limits of a field, also those that the types of an alternative carry."""
    for item in metadata:
        yield from getattr(item, "metadata", [item])
    for argument in typing.get_args(annotation):
        if hasattr(argument, "__metadata__"):
            yield from _metadata(typing.get_args(argument)[0], argument.__metadata__)


def _choices(annotation: Any) -> list[str]:
    if typing.get_origin(annotation) is typing.Literal:
        return [str(choice) for choice in typing.get_args(annotation)]
    return [choice for argument in typing.get_args(annotation) for choice in _choices(argument)]


def _models(annotation: Any, suffix: str = "") -> Iterator[tuple[str, type[BaseModel]]]:
    """Yield the groups of values in an annotation, each with what its key path adds."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield suffix, annotation
        return
    origin, arguments = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is dict:
        yield from _models(arguments[1], f"{suffix}.NAME")
    elif origin is tuple:
        yield from _models(arguments[0], f"{suffix}.N")
    else:
        for argument in arguments:
            if argument is not type(None) and not isinstance(argument, str):
                yield from _models(argument, suffix)


def meanings_of(model: type[BaseModel]) -> dict[str, str]:
    """Return what the docstrings of a type and of its bases say about each field."""
    found: dict[str, str] = {}
    for base in reversed(model.__mro__):
        found |= _attributes(base.__doc__ or "")
    return found


def _attributes(docstring: str) -> dict[str, str]:
    """Return the section "Attributes" of a Google docstring: text by name."""
    _, _, section = docstring.partition("Attributes:\n")
    found: dict[str, str] = {}
    names: list[str] = []
    for line in section.splitlines():
        entry = re.match(r"^ {8}(\w[\w, ]*?):( .*)?$", line)
        if entry:
            names = [name.strip() for name in entry[1].split(",")]
            found |= dict.fromkeys(names, (entry[2] or "").strip())
        elif line.startswith(" " * 12):
            found |= {name: f"{found[name]} {line.strip()}".strip() for name in names}
        elif line.strip():
            break
    # a unit at the end is that of the stored value, not that of the file
    return {name: re.sub(r" \[[^\]]*\]$", "", text) for name, text in found.items()}


def file_schema() -> dict[str, Any]:
    """Return the JSON schema of a machine file, for the completion and checks of an editor.

    It is less strict than `wm-drake machine check`: a file that extends another one may leave out
    any key, and any value may be null, which removes it.
    """
    schema = MachineParameters.model_json_schema()
    definitions = schema.pop("$defs")
    properties = {
        "extends": {"type": "string", "description": EXTENDS},
        **schema["properties"],
        "profile": {"description": "Spin profile: points, steps, or the name of one."},
    }
    properties.pop("sources")
    meanings = {model.__name__: meanings_of(model) for model in _all_models(MachineParameters)}
    for name, definition in definitions.items():
        definitions[name] = _relaxed(_described(definition, meanings.get(name, {})))
    top = _described({"properties": properties}, meanings_of(MachineParameters))["properties"]
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "wm_drake machine file",
        "type": "object",
        "additionalProperties": False,
        "properties": {name: _or_null(_relaxed(value)) for name, value in top.items()},
        "$defs": definitions,
    }


def _all_models(model: type[BaseModel]) -> Iterator[type[BaseModel]]:
    yield model
    for field in model.model_fields.values():
        for _, inner in _models(field.annotation):
            yield from _all_models(inner)


def _described(definition: dict[str, Any], meanings: dict[str, str]) -> dict[str, Any]:
    properties = {
        name: {**value, "description": meanings.get(name, value.get("description", ""))}
        for name, value in definition.get("properties", {}).items()
    }
    return {**definition, "properties": properties} if properties else definition


def _relaxed(node: Any) -> Any:
    """Return a schema in which no key is required and each group may have a source."""
    if isinstance(node, list):
        return [_relaxed(entry) for entry in node]
    if not isinstance(node, dict):
        return node
    node = {key: value for key, value in node.items() if key not in ("required", "default")}
    properties = node.pop("properties", None)
    node = {key: _relaxed(value) for key, value in node.items() if key != "discriminator"}
    if "oneOf" in node:
        node["anyOf"] = node.pop("oneOf")
    for kind in ("patternProperties", "additionalProperties"):  # groups by name
        if isinstance(node.get(kind), dict):
            node[kind] = _entries_or_null(kind, node[kind])
    if properties is None:
        return node
    own = {name: _or_null(_relaxed(value)) for name, value in properties.items()}
    return {**node, "properties": {**own, "source": {"type": "string", "description": SOURCE}}}


def _entries_or_null(kind: str, entries: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of the entries of a mapping by name; null removes an entry."""
    if kind == "additionalProperties":
        return _or_null(entries)
    return {
        pattern.replace("^", "^(?!source$)", 1): _or_null(entry)
        for pattern, entry in entries.items()
    }


def _or_null(schema: dict[str, Any]) -> dict[str, Any]:
    description = {"description": schema["description"]} if "description" in schema else {}
    return {**description, "anyOf": [schema, {"type": "null"}]}
