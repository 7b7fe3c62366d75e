"""Make commands of typer from declared studies and their options models."""

import inspect
import json
import types
import typing
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from wm_drake.cli.common import JsonOption, folder_of
from wm_drake.report.provenance import command_line
from wm_drake.report.terminal import Console, say
from wm_drake.studies.facts import Facts
from wm_drake.studies.study import Study

if TYPE_CHECKING:  # slow to import, and not for commands without a study
    from wm_drake.studies.answer import Answer

MOST_NAMED = 6
"""Largest number of result files that are named on the terminal."""


def command_of(study: Study) -> Callable[..., None]:
    """Return the function of the command of a study, with a signature that typer understands."""
    # slow to import, and not for commands without a study
    from wm_drake.studies.run import execute, options_of_driver, order_of

    def run(context: typer.Context, as_json: bool, **given: Any) -> None:
        chosen = {name: value for name, value in given.items() if _is_set(context, name)}
        chosen["out"] = given["out"]
        order = order_of(study, chosen, command_line())
        result, facts, files = execute(order)
        _print(result, facts, as_json)
        if not as_json:
            say(f"Results in {given['out']}: {_listed(files)}")
        for text in result.warned:
            say(f"warning: {text}", err=True)
        for text in result.diverged:
            typer.echo(text, err=True)
        if result.diverged:
            raise typer.Exit(1)

    keyword = inspect.Parameter.KEYWORD_ONLY
    parameters = [
        inspect.Parameter("context", keyword, annotation=typer.Context),
        *parameters_of(study.all_options),
        *parameters_of(
            options_of_driver(study), out=Path(study.folder or f"wm-drake-{study.name}")
        ),
        inspect.Parameter("as_json", keyword, default=False, annotation=JsonOption),
    ]
    described: Any = run
    described.__signature__ = inspect.Signature(parameters)
    described.__annotations__ = {p.name: p.annotation for p in parameters}
    described.__doc__ = study.about
    return run


def with_options(command: Any, model: type[BaseModel]) -> Any:
    """Return a command whose `**` arguments are the fields of a model, as typer understands it."""
    signature = inspect.signature(command)
    named = [p for p in signature.parameters.values() if p.kind is not p.VAR_KEYWORD]
    both = [p.replace(kind=p.KEYWORD_ONLY) for p in (*named, *parameters_of(model))]
    command.__signature__ = inspect.Signature(both)
    command.__annotations__ = {p.name: p.annotation for p in both}
    return command


def _is_set(context: typer.Context, name: str) -> bool:
    """Return whether the user has set an option, which then counts more than `--quick`."""
    source = context.get_parameter_source(name)
    return source is not None and source.name not in ("DEFAULT", "DEFAULT_MAP")


def parameters_of(model: type[BaseModel], **defaults: Any) -> Iterator[inspect.Parameter]:
    """Yield the parameters of a command for the fields of a model."""
    for name, field in model.model_fields.items():
        extra = field.json_schema_extra
        shown: dict[str, Any] = dict(extra) if isinstance(extra, dict) else {}
        options: dict[str, Any] = {"help": field.description, "metavar": shown.get("metavar")}
        options |= _limits(field)
        default = defaults.get(name, field.default)
        if field.is_required():
            default = inspect.Parameter.empty
        kind, is_repeatable = _typer_type(field.annotation)
        if is_repeatable:
            kind = list[kind] if field.is_required() else list[kind] | None  # type: ignore[valid-type]
            default = default if field.is_required() else list(default) or None
        if name in ("out", "figures"):
            options["parser"] = folder_of(f"--{name}")
        flag = shown.get("flag", "")
        if flag == "argument":
            declared: Any = typer.Argument(**options)
        else:
            # a flag has a name of its own, or typer adds --no-flag
            is_named = flag or kind is bool
            names = (flag or f"--{name.replace('_', '-')}").split() if is_named else []
            declared = typer.Option(*names, **options)
        yield inspect.Parameter(
            name,
            inspect.Parameter.KEYWORD_ONLY,
            default=default,
            annotation=Annotated[kind, declared],
        )


def _typer_type(annotation: Any) -> tuple[Any, bool]:
    """Return the type of an option, and whether it is repeatable."""
    if typing.get_origin(annotation) is tuple:
        return typing.get_args(annotation)[0], True
    if isinstance(annotation, types.UnionType) and Path in typing.get_args(annotation):
        return Path | None, False
    return annotation, False


def _limits(field: FieldInfo) -> dict[str, float]:
    """Return the limits of a number in the words of typer."""
    words = {"ge": "min", "le": "max"}
    return {
        word: getattr(limit, name)
        for limit in field.metadata
        for name, word in words.items()
        if hasattr(limit, name)
    }


def _print(result: "Answer", facts: Facts, as_json: bool) -> None:
    """Print a result as one JSON object, or as tables and sentences."""
    if as_json:
        shown = {"runs": facts.runs, **result.as_json(), "wall_s": facts.wall_s}
        typer.echo(json.dumps(shown, allow_nan=False))
        return
    for part in result.terminal():
        if isinstance(part, str):
            say(part)
        else:
            Console().print(part)


def _listed(files: tuple[str, ...]) -> str:
    """Return names of files as text; of many, the first ones."""
    rest = len(files) - MOST_NAMED
    return ", ".join([*files[:MOST_NAMED], *([f"and {rest} more"] if rest > 0 else [])])
