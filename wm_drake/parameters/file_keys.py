"""The keys that a machine file may have, read from the types that check it.

`key_groups` lists them for people, `file_schema` describes them as JSON schema for editors.
"""

import inspect
import re
import typing
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import core_schema

from wm_drake.parameters.damper_laws import DamperNumbers
from wm_drake.parameters.element_kinds import ELEMENT_KINDS, OfKind
from wm_drake.parameters.keys import declared_range, models_in, unit_of
from wm_drake.parameters.machine import MachineParameters
from wm_drake.parameters.units import PureNumber, Unit

EXTENDS = "Name or path of another machine; this file then contains only the differences."
SOURCE = "Where the numbers come from: a paper, a measurement, or an assumption with its reason."


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
    for kind in ELEMENT_KINDS.values():
        for path, model in _walk(kind.parameters, "elements.NAME"):
            places.setdefault(model, []).append(path)
    known = list(places)
    return [_group(model, list(dict.fromkeys(paths)), known) for model, paths in places.items()]


def _walk(model: type[BaseModel], path: str) -> Iterator[tuple[str, type[BaseModel]]]:
    yield path, model
    for name, field in model.model_fields.items():
        for suffix, inner in models_in(field.annotation):
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
    return " ".join(_docstring(model).partition("\nAttributes:")[0].split())


def _docstring(model: type) -> str:
    """Return the docstring of a type without its indentation, which Python 3.13 takes away too."""
    return inspect.cleandoc(model.__doc__ or "")


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
            form = f"list in {unit.shown}" if unit.shown else "list of numbers"
        if any(True for _ in models_in(field.annotation)):
            form += ", or a table"
        limits = (f"{sign} {unit.text(end)}" for sign, end in declared_range(field).limits())
        return form, ", ".join(limits).strip()
    choices = _choices(field.annotation)
    if choices:
        return "text", ", ".join(choices)
    if any(True for _ in models_in(field.annotation)):
        return "group", ""
    return ("list of texts" if "tuple" in str(field.annotation) else "text"), ""


def _choices(annotation: Any) -> list[str]:
    if typing.get_origin(annotation) is typing.Literal:
        return [str(choice) for choice in typing.get_args(annotation)]
    return [choice for argument in typing.get_args(annotation) for choice in _choices(argument)]


def meanings_of(model: type[BaseModel]) -> dict[str, str]:
    """Return what the docstrings of a type and of its bases say about each field."""
    texts: dict[str, str] = {}
    for base in reversed(model.__mro__):
        texts |= _attributes(_docstring(base))
    return texts


def _attributes(docstring: str) -> dict[str, str]:
    """Return the section "Attributes" of a Google docstring without indentation: text by name."""
    _, _, section = docstring.partition("Attributes:\n")
    texts: dict[str, str] = {}
    names: list[str] = []
    for line in section.splitlines():
        entry = re.match(r"^ {4}(\w[\w, ]*?):( .*)?$", line)
        if entry:
            names = [name.strip() for name in entry[1].split(",")]
            texts |= dict.fromkeys(names, (entry[2] or "").strip())
        elif line.startswith(" " * 8):
            texts |= {name: f"{texts[name]} {line.strip()}".strip() for name in names}
        elif line.strip():
            break
    # a unit at the end is that of the stored value, not that of the file
    return {name: re.sub(r" \[[^\]]*\]$", "", text) for name, text in texts.items()}


class DocumentedSchema(GenerateJsonSchema):
    """JSON schema with the meaning of each group and key from the docstrings of the types."""

    def model_schema(self, schema: core_schema.ModelSchema) -> JsonSchemaValue:
        """Return the schema of a group."""
        group = super().model_schema(schema)
        meanings = meanings_of(schema["cls"])
        for name, key in group.get("properties", {}).items():
            if name in meanings:
                key["description"] = meanings[name]
        return {**group, "description": _about(schema["cls"])}


class _FileSchema(DocumentedSchema):
    """JSON schema of a file that may extend another one.

    No key is required, any value may be null, which removes it, and each group may have a source. A
    key of another law or kind may be null: it removes that of the extended machine.
    """

    def field_is_required(self, *_: Any, **_named: Any) -> bool:
        """Return False: a file has only what differs from the machine that it extends."""
        return False

    def default_schema(self, schema: core_schema.WithDefaultSchema) -> JsonSchemaValue:
        """Return the schema of a value without its default, which the extended file may have."""
        return self.generate_inner(schema["schema"])

    def tagged_union_schema(self, schema: core_schema.TaggedUnionSchema) -> JsonSchemaValue:
        """Return the alternatives of a value; the key that tells them apart may be missing."""
        return {"anyOf": [self.generate_inner(choice) for choice in schema["choices"].values()]}

    def model_schema(self, schema: core_schema.ModelSchema) -> JsonSchemaValue:
        """Return the schema of a group; of an element that of all registered kinds."""
        if schema["cls"] is OfKind and ELEMENT_KINDS:
            kinds = [kind.parameters for kind in ELEMENT_KINDS.values()]
            return {"anyOf": [self.generate_inner(k.__pydantic_core_schema__) for k in kinds]}
        group = super().model_schema(schema)
        keys = {name: _or_null(value) for name, value in group.get("properties", {}).items()}
        if group.get("additionalProperties") is False:
            group = {**group, "additionalProperties": {"type": "null"}}
        return {**group, "properties": {**keys, **_SOURCE}}

    def dict_schema(self, schema: core_schema.DictSchema) -> JsonSchemaValue:
        """Return the schema of groups by name."""
        names, entries = self.generate_inner(schema["keys_schema"]), schema["values_schema"]
        pattern = names.get("pattern", "^").replace("^", "^(?!source$)", 1)
        return {
            "type": "object",
            "properties": dict(_SOURCE),
            "patternProperties": {pattern: _or_null(self.generate_inner(entries))},
            "additionalProperties": False,
        }


_SOURCE = {"source": {"type": "string", "description": SOURCE}}


def _or_null(schema: dict[str, Any]) -> dict[str, Any]:
    null, described = {"type": "null"}, {}
    if "description" in schema:
        described = {"description": schema["description"]}
    forms = schema.get("anyOf", [{k: v for k, v in schema.items() if k not in described}])
    return {**described, "anyOf": [*(form for form in forms if form != null), null]}


def file_schema() -> dict[str, Any]:
    """Return the JSON schema of a machine file, for the completion and checks of an editor.

    It is less strict than `wm-drake machine check`: it does not know the dimensions of units, nor
    rules between several keys.
    """
    schema = MachineParameters.model_json_schema(schema_generator=_FileSchema)
    del schema["properties"]["sources"], schema["properties"]["source"]
    return {
        **schema,
        "$schema": GenerateJsonSchema.schema_dialect,
        "title": "wm_drake machine file",
        "properties": {
            "extends": {"type": "string", "description": EXTENDS},
            **schema["properties"],
        },
    }
