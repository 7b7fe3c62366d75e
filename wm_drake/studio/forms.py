"""Forms of studies: fields from their options models, and what a user fills in as arguments."""

import re
import types
import typing
from typing import Any

from pydantic import ValidationError
from pydantic.fields import FieldInfo

from wm_drake.errors import input_error
from wm_drake.studies.run import input_error_of, options_of_driver
from wm_drake.studies.study import STUDIES, Study

NOT_OFFERED = {"machine", "sets", "variant"}
"""Options that the page sets itself, or that need more than a line."""

OFFERED = ("verdict",)
"""Studies with a command of their own that a page may start, beside those of the group study."""

_TEXT = re.compile(r"\w[\w.,+ %=-]*")
"""Form of a text that a page may give: no path and no option."""


def forms() -> dict[str, list[dict[str, Any]]]:
    """Return the fields of the form of each study that a page may start.

    A field has its name, kind (integer, number, boolean, text), description, default, and limits.
    """
    offered = {n: s for n, s in STUDIES.items() if n in OFFERED or s.group == "study"}
    names = sorted(offered, key=lambda name: name not in OFFERED)
    return {name: _fields(offered[name]) for name in names}


def arguments(name: str, given: dict[str, str]) -> list[str]:
    """Return what a user has filled in as arguments of the command of a study.

    Args:
        given: Texts by name of the field.
    """
    offered = forms()
    if name not in offered:
        raise input_error(f"no study '{name}'; allowed are {', '.join(offered)}", key="study")
    names = [field["name"] for field in offered[name]]
    options = _options(STUDIES[name])
    values: dict[str, Any] = {}
    for field, text in given.items():
        if field not in names:
            raise input_error(
                f"no option of 'study {name}' here; allowed are {', '.join(names)}", key=field
            )
        if not _TEXT.fullmatch(text):
            raise input_error(f"'{text}' is not allowed", key=field)
        parts = tuple(part.strip() for part in text.split(","))
        values[field] = parts if _is_repeatable(options[field]) else text
    try:
        STUDIES[name].all_options(**{k: value for k, value in values.items() if k != "quick"})
    except ValidationError as error:
        raise input_error_of(error) from None
    return [word for k, value in values.items() for word in _words(k, options[k], value)]


def _fields(study: Study) -> list[dict[str, Any]]:
    fields = []
    for name, option in _options(study).items():
        kind = _kind(option)
        if kind is None or name in NOT_OFFERED:
            continue
        limits = {
            word: getattr(limit, word)
            for limit in option.metadata
            for word in ("ge", "le")
            if hasattr(limit, word)
        }
        default = "" if option.default in (None, (), False) else str(option.default)
        about = {"name": name, "kind": kind, "description": option.description}
        fields.append({**about, "default": default, **limits})
    return fields


def _options(study: Study) -> dict[str, FieldInfo]:
    """Return the options of a study, and `--quick`."""
    quick = options_of_driver(study).model_fields["quick"]
    return {**study.all_options.model_fields, "quick": quick}


def _kind(option: FieldInfo) -> str | None:
    """Return the kind of a field; None for a path, which a page may not give."""
    kind: Any = option.annotation
    if isinstance(kind, types.UnionType):
        kind = next(part for part in typing.get_args(kind) if part is not type(None))
    if typing.get_origin(kind) is tuple:
        kind = typing.get_args(kind)[0]
    return {int: "integer", float: "number", bool: "boolean", str: "text"}.get(kind)


def _is_repeatable(option: FieldInfo) -> bool:
    return typing.get_origin(option.annotation) is tuple


def _words(name: str, option: FieldInfo, value: Any) -> list[str]:
    """Return the words of an option on the command line."""
    extra = option.json_schema_extra
    flag = str((extra if isinstance(extra, dict) else {}).get("flag", ""))
    if flag == "argument":
        return [value]
    flag = flag or f"--{name.replace('_', '-')}"
    if option.annotation is bool:
        return [flag] if value == "true" else []
    return [f"{flag}={part}" for part in (value if _is_repeatable(option) else [value])]
