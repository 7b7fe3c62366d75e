"""Numbers that vary, as studies use them: entries of a file or an option for a built machine."""

import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from wm_drake.errors import InputError, InputNotice, Problem
from wm_drake.model.bodies import with_sdf_values
from wm_drake.model.key_patterns import keys_like
from wm_drake.model.machine import Machine
from wm_drake.parameters import MachineParameters, located, with_values
from wm_drake.parameters.variation import Change, changes_of, number_at
from wm_drake.parameters.vary import LAUNDRY, Entry
from wm_drake.parameters.vary_file import VARY_FILES, Known, VaryFile, load_vary
from wm_drake.parameters.varying import Varying, varying

_TYPES = {
    "spring_types": (("springs", "type"),),
    "damper_types": (("dampers", "type"), ("telescopic_dampers", "type")),
    "bushing_types": (
        ("telescopic_dampers", "tub_bushing"),
        ("telescopic_dampers", "housing_bushing"),
    ),
}
"""Tables whose parts name a type, by table of the types, with the key that names it."""


@contextmanager
def in_vary_file(path: Path, file: VaryFile) -> Iterator[None]:
    """Add file and line to the problems that the block raises; those of entries have their names.

    Args:
        path: Path of the file.
        file: Its content.
    """
    try:
        yield
    except InputError as error:
        sections = {name: name for name in type(file).model_fields}
        sections |= {name: f"known.{name}" for name in file.known}
        sections |= {name: f"vary.{name}" for name in file.vary}
        problems = [replace(p, key=sections.get(p.key, p.key)) for p in error.problems]
        raise located(InputError(problems), path) from None


def varying_of(
    machine: Machine,
    entries: Mapping[str, Entry],
    known: Mapping[str, Known] | None = None,
    *,
    tables: str = "scaled",
    parameters: MachineParameters | None = None,
) -> Varying:
    """Return the numbers of a built machine that entries declare.

    An entry of which no pattern with * fits a number of the machine is left out. One that draws
    each number becomes an entry for each, and a type that several parts share one for each part.

    Args:
        machine: The built machine.
        entries: Entries by name, as of `VaryFile.entries`.
        known: As of `varying`.
        tables: As of `varying`.
        parameters: Changed numbers of the machine; None for its own.

    Raises:
        InputError: with one problem for each entry that is wrong; its key is the name of the entry.
    """
    changed, full = parameters or machine.parameters, dict[str, Entry]()
    problems = list[Problem]()
    for name, entry in entries.items():
        keys = tuple(dict.fromkeys(k for key in entry.keys for k in keys_like(machine, key)))
        try:
            changed = with_sdf_values(machine.drawn.plant, changed, [*keys, *entry.sets])
            changed, draws = _draws(changed, name, entry, keys)
            for draw, of_draw in draws.items():
                if entry.sets or (of_draw := _that_vary(changed, draw, of_draw, entry)):
                    full[draw] = entry.model_copy(update={"keys": of_draw})
        except InputError as error:
            problems += [Problem("", name, f"{p.key}: {p.message}") for p in error.problems]
    if problems:
        raise InputError(problems)
    fixed = dict(known or {})
    named = [key for number in fixed.values() for key in number.sets]
    return varying(with_sdf_values(machine.drawn.plant, changed, named), full, fixed, tables)


def ranges_in(machine: Machine, name_or_path: str | Path) -> dict[str, tuple[float, float]]:
    """Return the range that a vary file gives each number of a machine, by key path. [SI]

    The laundry, and numbers that enter sums, have none.
    """
    file = load_vary(name_or_path)
    with in_vary_file(VARY_FILES.path(name_or_path), file):
        every = varying_of(machine, file.entries(without=()), file.known).every
    ends = {}
    for varied in every:
        if {"low", "high"} <= varied.at.keys():
            for number in varied.numbers:
                low, _, high = varied.levels_of(number)
                ends[number.key] = low, high
    return ends


def _draws(
    parameters: MachineParameters, name: str, entry: Entry, keys: tuple[str, ...]
) -> tuple[MachineParameters, dict[str, tuple[str, ...]]]:
    """Return the keys that share a draw, by name of the draw.

    For one draw each, a type that several parts share is replaced by a type for each part.
    """
    if entry.draws == "one" or entry.sets:
        return parameters, {name: keys}
    draws: dict[str, tuple[str, ...]] = {}
    for key in keys:
        table, _, rest = key.partition(".")
        kind, _, field = rest.partition(".")
        if table in _TYPES and field and kind in getattr(parameters, table):
            parameters, types = with_types_apart(parameters, table, kind)
            draws |= {f"{name}.{part}": (f"{table}.{t}.{field}",) for part, t in types.items()}
        else:
            draws[f"{name}.{key}" if len(keys) > 1 else name] = (key,)
    return parameters, draws


def _that_vary(
    parameters: MachineParameters, name: str, keys: tuple[str, ...], entry: Entry
) -> tuple[str, ...]:
    """Return the keys of an entry without those of which it gives percents of 0, with a notice.

    A machine without this damping or stiffness has nothing there that varies.
    """
    kept = []
    for key in keys:
        if key in LAUNDRY:
            kept.append(key)
            continue
        number = number_at(parameters, key)
        change, _ = changes_of(entry.texts, number.unit, key)
        if change is Change.PERCENT and number.nominal == 0.0:
            message = f"{name}: {key} is 0, so percents of it do not vary; left out"
            warnings.warn(message, InputNotice, stacklevel=2)
        else:
            kept.append(key)
    return tuple(kept)


def with_types_apart(
    parameters: MachineParameters, table: str, kind: str
) -> tuple[MachineParameters, dict[str, str]]:
    """Return a machine in which each part has a separate type, and the types by part.

    Args:
        table: spring_types, damper_types or bushing_types.
        kind: Name of the type that is replaced.
    """
    types = dict(getattr(parameters, table))
    changes: dict[str, Any] = {}
    by_part: dict[str, str] = {}
    for parts, field in _TYPES[table]:
        for part, element in getattr(parameters, parts).items():
            if getattr(element, field) == kind:
                label = f"{part}_{field.removesuffix('_bushing')}" if "bushing" in field else part
                by_part[label] = f"{kind}_{label}"[-64:]
                types[by_part[label]] = types[kind]
                changes[f"{parts}.{part}.{field}"] = by_part[label]
    if len(by_part) < 2:
        only = next(iter(by_part), "")
        return parameters, {only: kind} if only else {kind: kind}
    return with_values(with_values(parameters, {table: types}), changes), by_part
