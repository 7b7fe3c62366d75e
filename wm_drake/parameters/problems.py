"""Translation of pydantic's validation errors into messages for users."""

import difflib
import types
import typing
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from pydantic import BaseModel, ValidationError

from wm_drake.errors import Problem, nearest_names, shortened
from wm_drake.parameters.damper_laws import DAMPER_LAWS
from wm_drake.parameters.drive import DRIVE_TAGS


class ProblemsInsideError(ValueError):
    """Problems of a part of a model that a validator checked by itself; keys begin at the part."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        """Keep the problems."""
        self.problems = tuple(problems)
        super().__init__("; ".join(map(str, self.problems)))


def problems_of(error: ValidationError, root: type[BaseModel], key: str = "") -> list[Problem]:
    """Return the problems that pydantic found, one for each error.

    Args:
        key: Key path of the model, to which that of each problem is appended.
    """
    problems = []
    for detail in _kinds_first(error.errors(), root):
        path = [str(part) for part in detail["loc"] if part not in _TAGS]
        cause = detail.get("ctx", {}).get("error")
        if isinstance(cause, ProblemsInsideError):
            start = [key] if key else []
            for problem in cause.problems:
                inside = ".".join([*start, *path, problem.key])
                problems.append(replace(problem, key=inside))
            continue
        problems.append(
            Problem("", ".".join(([key] if key else []) + path), _message(detail, root))
        )
    return problems


_KINDS = ("kind", "law")
"""Keys that choose what other keys a group may have."""


def _kinds_first(details: list[Any], root: type[BaseModel]) -> list[Any]:
    """Return the errors without those of groups whose kind is misspelt: they follow from it.

    A group without its kind is read as one of another kind, whose keys are others.
    """
    misspelt = set[tuple[str | int, ...]]()
    unknown = [detail for detail in details if detail["type"] == "extra_forbidden"]
    for detail in unknown:
        *group, name = detail["loc"]
        kinds = set(_KINDS) & _fields_at(root, tuple(group))
        if difflib.get_close_matches(str(name), kinds, n=1, cutoff=0.5):
            misspelt.add(tuple(group))
            detail["of_kind"] = sorted(kinds)
    return [
        detail
        for detail in details
        if "of_kind" in detail
        or not any(detail["loc"][: len(group)] == group for group in misspelt)
    ]


_EXPECTED = {
    "model_type": "a group of keys and values",
    "model_attributes_type": "a group of keys and values",
    "dict_type": "a group of keys and values",
    "tuple_type": "a list",
    "list_type": "a list",
    "string_type": "text",
}
"""What a value must be, by kind of error; pydantic would name its Python class."""

_TAGS = ("[key]", "number", "table", *DRIVE_TAGS, *DAMPER_LAWS)


def _message(detail: Any, root: type[BaseModel]) -> str:
    kind, context, given = detail["type"], detail.get("ctx", {}), detail.get("input")
    shown = shortened(str(given), 60)
    if kind == "value_error":
        return str(context["error"])
    if kind == "missing":
        return "is missing"
    if kind == "extra_forbidden":
        return _unknown_key(detail, root)
    if kind in ("greater_than", "greater_than_equal"):
        sign, limit = (">", context["gt"]) if kind == "greater_than" else (">=", context["ge"])
        return f"'{shown}' is out of range; allowed is {sign} {limit:g}"
    if kind == "string_pattern_mismatch":
        return (
            f"'{shown}' is not a name; allowed are up to 64 letters, digits, _ and -, with a "
            "letter or _ first"
        )
    if kind == "union_tag_invalid":
        key = context["discriminator"].strip("'")
        given, known = shortened(context["tag"], 60), context["expected_tags"]
        return f"{key} '{given}' is not known; allowed are {known}"
    if kind == "union_tag_not_found":
        return f"needs the key {context['discriminator']}"
    if kind in _EXPECTED:
        return f"needs {_EXPECTED[kind]}, is {shortened(repr(given), 60)}"
    if kind == "literal_error":
        return f"'{shown}' is not allowed; allowed are {context['expected']}"
    given = given.get("kind", given) if kind == "drive_kind" else given
    return f"{detail['msg'][0].lower()}{detail['msg'][1:]}, is {shortened(repr(given), 60)}"


def _unknown_key(detail: Any, root: type[BaseModel]) -> str:
    name, group = str(detail["loc"][-1]), detail["loc"][:-1]
    known = detail.get("of_kind") or _fields_at(root, group)
    if name in known:
        return f"key '{name}' does not belong to this kind of {_group_of(group)}"
    return f"unknown key '{name}'{nearest_names(name, known)}"


def _group_of(group: tuple[str | int, ...]) -> str:
    """Return the name of a group of values, without the tags of pydantic."""
    names = [str(part) for part in group if part not in _TAGS]
    return names[-1] if names else "file"


def _fields_at(root: type[BaseModel], path: tuple[str | int, ...]) -> set[str]:
    """Return the names of the fields that a model allows at a path in pydantic's notation."""
    candidates: list[Any] = [root]
    for part in path:
        models = [c for c in candidates if isinstance(c, type) and issubclass(c, BaseModel)]
        tagged = [
            c
            for c in models
            if "law" in c.model_fields and part in typing.get_args(c.model_fields["law"].annotation)
        ]
        stepped = [c.model_fields[str(part)].annotation for c in models if part in c.model_fields]
        entries = [
            typing.get_args(c)[-1 if typing.get_origin(c) is dict else 0]
            for c in candidates
            if typing.get_origin(c)
        ]
        candidates = (
            tagged or [inner for c in stepped + entries for inner in _alternatives(c)] or candidates
        )
    return {
        name
        for c in candidates
        if isinstance(c, type) and issubclass(c, BaseModel)
        for name in c.model_fields
    }


def _alternatives(annotation: Any) -> list[Any]:
    """Return the types that an annotation allows, with unions and Annotated resolved."""
    origin = typing.get_origin(annotation)
    if hasattr(annotation, "__metadata__"):
        return _alternatives(typing.get_args(annotation)[0])
    if origin in (typing.Union, types.UnionType):
        return [inner for member in typing.get_args(annotation) for inner in _alternatives(member)]
    return [annotation]
