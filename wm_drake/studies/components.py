"""Component of a bench test: of a machine or of a file, with its axis."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from wm_drake.errors import InputError, Problem, check_known, input_error
from wm_drake.parameters import (
    Component,
    MachineParameters,
    load_component,
    shipped_components,
    source_of,
)
from wm_drake.parameters.text_files import is_file
from wm_drake.parameters.units import Unit
from wm_drake.rigs import AXES
from wm_drake.studies.component_options import ComponentOptions
from wm_drake.studies.inputs import load_parameters, quantities_of, with_sets

AXIS_WORDS = {
    "radial": ("x", "z"),
    "axial": ("y",),
    "tilt": ("about_x", "about_z"),
    "twist": ("about_y",),
}
"""Axes of an axisymmetric bushing: y is its axis; the first of each goes on the bench."""


@dataclass(frozen=True)
class Target:
    """A component, the machine as it was named, and its key there; both "" for a component file."""

    component: Component
    machine: str
    key: str


def target_of(kind: str, options: ComponentOptions) -> Target:
    """Return the component that a command is about.

    Args:
        kind: damper, bushing or gasket.
    """
    if options.component is not None:
        return Target(_of_file(kind, options.component, options.sets), "", "")
    parameters = load_parameters(options.machine, options.sets)
    key = _key_of(kind, parameters, options.name)
    table, _, entry = key.partition(".")
    chosen = getattr(parameters, table)[entry] if entry else getattr(parameters, table)
    sources = {
        field: text
        for field in type(chosen).model_fields
        if (text := source_of(parameters, f"{key}.{field}"))
    }
    return Target(Component(key.split(".")[-1], chosen, sources), options.machine, key)


def _of_file(kind: str, name: str, sets: Sequence[str]) -> Component:
    component = load_component(name)
    if component.is_damper != (kind == "damper"):
        kinds = ("a damper", "a bushing")
        given, needed = kinds if component.is_damper else kinds[::-1]
        raise input_error(f"'{name}' is {given}, needs {needed}", where="--component")
    changed, sources = with_sets(component.parameters, component.sources, sets)
    return replace(component, parameters=changed, sources=sources)


def _key_of(kind: str, parameters: MachineParameters, name: str | None) -> str:
    """Return the key path of a component of a machine; without a name, of the first of its kind."""
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
    message = f"no '{name}' in {' or '.join(tables)} of '{parameters.name}'"
    check_known(name, keys, message, where="--name")
    return keys[name]


def axes_of(word: str) -> tuple[str, ...]:
    """Return the axes that a word means, the one for the bench first."""
    if word in AXIS_WORDS:
        return AXIS_WORDS[word]
    check_known(word, [*AXIS_WORDS, *AXES], f"no axis '{word}'", where="--axis")
    return (word,)


def existing_files(paths: Sequence[Path]) -> list[Path]:
    """Return the paths."""
    problems = [Problem(str(path), "", "no such file") for path in paths if not is_file(path)]
    if problems:
        raise InputError(problems)
    return list(paths)


def mass_of(text: str | None, option: str) -> float:
    """Return the mass of an option, 0 without it. [kg]"""
    if text is None:
        return 0.0
    mass = quantities_of(text, Unit("kg", "kg"), option)[0]
    if mass < 0.0:
        raise input_error(f"is {mass:g} kg; allowed is >= 0", where=option)
    return mass
