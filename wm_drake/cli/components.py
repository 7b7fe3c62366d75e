"""Shared options of `rig` and `identify`: the component, its axis, numbers with units."""

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand

from wm_drake.cli.common import load_parameters, with_sets
from wm_drake.errors import InputError, Problem, input_error, nearest_names

if TYPE_CHECKING:
    from wm_drake.parameters import Component, MachineParameters
    from wm_drake.parameters.units import Unit

NameOption = Annotated[
    str | None,
    typer.Option(
        "--name",
        help="Damper type or bushing of the machine; its first by default.",
        metavar="NAME",
    ),
]
ComponentOption = Annotated[
    str | None,
    typer.Option(
        "--component",
        help="Component file, or a shipped one, in place of one of a machine.",
        metavar="NAME|FILE",
    ),
]
AxisOption = Annotated[
    str,
    typer.Option(
        "--axis",
        help="radial, axial, tilt, twist; or x, y, z, about_x, about_y, about_z.",
        metavar="AXIS",
    ),
]
ArmOption = Annotated[
    str | None,
    typer.Option(
        "--arm",
        help="Radius of the jig through which a rotation is driven, e.g. '100 mm'.",
        metavar="LENGTH",
    ),
]
OuterMassOption = Annotated[
    str | None,
    typer.Option(
        help="Mass of the outer tube, at the driven end ([A] Eq. 6), e.g. '150 g'.", metavar="MASS"
    ),
]
JigMassOption = Annotated[
    str | None,
    typer.Option(
        help="Mass of the jig, at the driven end ([C] Eq. 2), e.g. '2 kg'.", metavar="MASS"
    ),
]

AXIS_WORDS = {
    "radial": ("x", "z"),
    "axial": ("y",),
    "tilt": ("about_x", "about_z"),
    "twist": ("about_y",),
}
"""Axes of an axisymmetric bushing: y is its axis; the first of each goes on the bench."""


class DamperCommand(TyperCommand):
    """A command whose help names the registered damper laws, which take a second to import.

    ``{laws}`` in the help of an option becomes the names of all laws, ``{laws_with_mass}`` the
    names of those whose sponge may have a mass on the bench.
    """

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help with the names of the laws."""
        from wm_drake.parameters import DAMPER_LAWS

        with_mass = [law.name for law in DAMPER_LAWS.values() if law.sponge_with_mass is not None]
        names = {"{laws}": ", ".join(DAMPER_LAWS), "{laws_with_mass}": " or ".join(with_mass)}
        described: list[Any] = [option for option in self.params if getattr(option, "help", None)]
        for option in described:
            for mark, text in names.items():
                option.help = option.help.replace(mark, text)
        super().format_help(ctx, formatter)


class ValidatingCommand(DamperCommand):
    """A command whose option ``--validate`` takes all names that follow it, as a shell expands it.

    Without this, of ``--validate held/*.csv`` only the first file would be held out, and the fit
    would see the others.
    """

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Repeat the option before each name that follows it."""
        spread, follows = list[str](), False
        for word in args:
            if word == "--validate":
                follows = True
                continue
            follows = follows and not word.startswith("-")
            spread += ["--validate", word] if follows else [word]
        if args and args[-1] == "--validate":
            spread.append("--validate")  # click says that its value is missing
        return super().parse_args(ctx, spread)


@dataclass(frozen=True)
class Target:
    """A component, the machine as it was named, and its key there; both "" for a component file."""

    component: "Component"
    machine: str
    key: str


def target_of(
    kind: str, machine: str, name: str | None, component: str | None, sets: list[str] | None
) -> Target:
    """Return the component that a command is about.

    Args:
        kind: damper, bushing or gasket.
        machine, name, component, sets: Options of the command.

    Raises:
        InputError: There is no such component, or it is of another kind.
    """
    if component is not None:
        return Target(_of_file(kind, component, sets), "", "")
    from wm_drake.parameters import Component, source_of

    parameters = load_parameters(machine, sets)
    key = _key_of(kind, parameters, name)
    table, _, entry = key.partition(".")
    chosen = getattr(parameters, table)[entry] if entry else getattr(parameters, table)
    sources = {
        field: text
        for field in type(chosen).model_fields
        if (text := source_of(parameters, f"{key}.{field}"))
    }
    return Target(Component(key.split(".")[-1], chosen, sources), machine, key)


def _of_file(kind: str, component: str, sets: list[str] | None) -> "Component":
    from wm_drake.parameters import load_component

    found = load_component(component)
    if found.is_damper != (kind == "damper"):
        kinds = ("a damper", "a bushing")
        is_one, wanted = kinds if found.is_damper else kinds[::-1]
        raise input_error(f"'{component}' is {is_one}, needs {wanted}", where="--component")
    changed, sources = with_sets(found.parameters, found.sources, sets)
    return replace(found, parameters=changed, sources=sources)


def _key_of(kind: str, parameters: "MachineParameters", name: str | None) -> str:
    """Return the key path of a component of a machine; without a name, of the first of its kind."""
    from wm_drake.parameters import shipped_components

    if kind == "gasket":
        if name is not None:
            raise input_error("a machine has one gasket; leave the name out", where="--name")
        if parameters.gasket is None:
            raise input_error(f"machine '{parameters.name}' has no gasket", where="--machine")
        return "gasket"
    tables = ("damper_types",) if kind == "damper" else ("bushing_types", "bushings")
    keys = {entry: f"{table}.{entry}" for table in tables for entry in getattr(parameters, table)}
    if not keys:
        shipped = ", ".join(shipped_components())
        message = (
            f"'{parameters.name}' has no {tables[0]}; name another machine, or a component file or "
            f"shipped one ({shipped})"
        )
        raise input_error(message, where="--machine")
    name = name or next(iter(keys))
    if name not in keys:
        raise input_error(
            f"no '{name}' in {' or '.join(tables)} of '{parameters.name}'"
            f"{nearest_names(name, keys)}",
            where="--name",
        )
    return keys[name]


def axes_of(word: str) -> tuple[str, ...]:
    """Return the axes that a word means, the one for the bench first."""
    from wm_drake.rigs import AXES

    if word in AXIS_WORDS:
        return AXIS_WORDS[word]
    if word in AXES:
        return (word,)
    raise input_error(
        f"no axis '{word}'{nearest_names(word, [*AXIS_WORDS, *AXES])}", where="--axis"
    )


def quantities_of(text: str, unit: "Unit", option: str) -> tuple[float, ...]:
    """Return numbers with one unit, ``(1, 3, 5) mm`` or ``1,3,5 mm``, in SI."""
    from wm_drake.parameters.units import convert, plain_number

    body = text.strip()
    if not body.startswith("("):
        size = len(_digits(body))
        body = f"({body[:size]}) {body[size:]}"
    numbers, _, written = body[1:].partition(")")
    try:
        values = [plain_number(part) for part in numbers.split(",")]
    except ValueError:
        raise input_error(
            f"'{text}' is not a number with a unit; write for example '1 {unit.shown}'",
            where=option,
        ) from None
    try:
        return tuple(convert(value, written.strip() or None, unit) for value in values)
    except ValueError as error:
        raise input_error(f"'{text}': {error}", where=option) from None


def _digits(text: str) -> str:
    """Return the leading numbers of a text, with the commas between them."""
    match = re.match(
        r"[\s,]*(?:[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?[\s,]*)*", text.strip()
    )
    return match[0] if match else ""


def existing_files(paths: list[Path]) -> list[Path]:
    """Return the paths.

    Raises:
        InputError: A path is no file.
    """
    from wm_drake.parameters.text_files import is_file

    problems = [Problem(str(path), "", "no such file") for path in paths if not is_file(path)]
    if problems:
        raise InputError(problems)
    return paths
