"""Identified numbers as a file: a fragment that changes one component, or a component file."""

import io
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from ruamel.yaml import YAML

from wm_drake.parameters import (
    DAMPER_LAWS,
    Component,
    ForceTable,
    TorqueTable,
    quantities,
    shipped_machines,
)
from wm_drake.parameters.units import Unit
from wm_drake.studies.components import Target
from wm_drake.studies.fitting.fit import Fit
from wm_drake.studies.identify.comparison import FittedLaw
from wm_drake.studies.identify.models import ANGLE, FORCE, LENGTH, TORQUE, ComponentModel

FIXED = "fixed by the user in an identification"
"""Source of a number that was not searched."""


@dataclass(frozen=True)
class Destination:
    """Where identified numbers go.

    Attributes:
        target: The component as it was, for the keys of another law that have to go, and its place
            in the machine that the fragment starts from. Without a machine the file is a component
            file that stands alone.
        out: Folder the file goes to, from which a machine file is named.
        changes: Other numbers of the machine that the user changed: text by key path. A number
            inside a list cannot be in a fragment; a comment names it.
    """

    target: Target
    out: Path
    changes: Mapping[str, str] = field(default_factory=dict)


def fragment(
    fit: Fit,
    model: ComponentModel,
    destination: Destination,
    copies: Mapping[str, str] | None = None,
    remarks: Sequence[str] = (),
) -> str:
    """Return the text of a YAML file with identified numbers; comments name the undetermined ones.

    Args:
        copies: Fields that get the value of another, such as z of an axisymmetric bushing from x.
        remarks: Sentences on the fit for the head of the file.
    """
    entries, comments = _entries(fit, model)
    for name, source in (copies or {}).items():
        if source in entries:
            entries[name] = dict(entries[source])
    tests = ", ".join(test.name for test in fit.tests)
    unit = "N m" if any(unknown.unit == TORQUE for unknown in fit.problem.unknowns) else "N"
    head = [
        f"Identified by least RMSE, method {fit.log.method}, seed {fit.log.seed}, from {tests}.",
        f"RMSE {fit.rmse:.4g} {unit} over all tests.",
        *remarks,
        *comments,
    ]
    return written_fragment(entries, head, destination)


def written_fragment(entries: dict[str, Any], head: Sequence[str], destination: Destination) -> str:
    """Return the text of a YAML file with entries of one component.

    Args:
        entries: Values with sources by field.
        head: Lines of the comment at the beginning.
    """
    target = destination.target
    written, left_out = _of_fragment(destination.changes)
    lines = [f"# {line}" for line in head]
    if left_out and target.machine:
        lines.append(f"# Not in this file: --set {', '.join(left_out)}.")
    if not target.machine:
        body: Any = _whole(entries, target.component)
    else:
        body = {"extends": _named_from(target.machine, destination.out)}
        for path, text in written.items():
            *parents, name = path.split(".")
            _node(body, parents)[name] = YAML(typ="safe").load(text)
        _node(body, target.key.split(".")).update(_leaving(entries, target.component))
    stream, yaml = io.StringIO(), YAML()
    yaml.width = 4096
    yaml.dump(body, stream)
    return "\n".join(lines) + "\n" + stream.getvalue()


def _of_fragment(changes: Mapping[str, str]) -> tuple[dict[str, str], list[str]]:
    """Return the changes that a fragment can have, and those inside of a list as KEY=VALUE."""
    inside = [path for path in changes if any(part.isdigit() for part in path.split("."))]
    return (
        {path: text for path, text in changes.items() if path not in inside},
        [f"{path}={changes[path]}" for path in inside],
    )


def _node(tree: Any, path: Sequence[str]) -> Any:
    for part in path:
        tree = tree.setdefault(part, {})
    return tree


def _entries(fit: Fit, model: ComponentModel) -> tuple[dict[str, Any], list[str]]:
    """Return values with sources by field, and comments on what is missing."""
    fields = model.fields(fit.values)
    estimates = {estimate.name: estimate for estimate in fit.estimates}
    units = {unknown.name: unknown.unit for unknown in fit.problem.unknowns}
    units |= {name: unit for name, _, unit in model.fixed_numbers}
    entries: dict[str, Any] = {"law": fields["law"]} if "law" in fields else {}
    comments = []
    source = f"identified from {len(fit.tests)} loops, normalised RMSE {_normalised(fit):.3g}"
    for name, value in fields.items():
        if isinstance(value, dict):
            entries[name] = table_entry(value, source + _fixed_rises(name, model))
            open_ends = [
                e.name for e in fit.estimates if e.name.startswith(f"{name}.") and not e.determined
            ]
            if open_ends:
                comments.append(
                    f"The data do not determine {', '.join(open_ends)}: "
                    "the table's rises there are not to be trusted."
                )
        elif name in model.fixed:
            entries[name] = {"value": _text(units[name], value, 10), "source": FIXED}
        elif name in estimates:
            estimate, unit = estimates[name], units[name]
            if not estimate.determined:
                comments.append(
                    f"The data do not determine {name}; it is left out and stays what it was."
                )
                continue
            text = source
            if estimate.at_bound:
                text += f"; at the {estimate.at_bound} bound of the search"
            elif np.isfinite(estimate.lower):
                lower, upper = unit.from_si(estimate.lower), unit.from_si(estimate.upper)
                text += f"; 95 % interval {lower:.4g} to {upper:.4g} {unit.label}"
            entries[name] = {"value": _text(unit, value, 7), "source": text}
    return entries, comments


def _text(unit: Unit, value: float, digits: int) -> str:
    """Return an SI value as text of a machine file, which is in SI units of the trade."""
    return f"{unit.from_si(value):.{digits}g} {unit.label}".rstrip()


def missing_numbers(fit: Fit, model: ComponentModel, target: Component) -> list[str]:
    """Return the numbers of a new law that the data do not determine: a fragment needs them."""
    fields = model.fields(fit.values)
    if not target.is_damper or _keeps_law(fields, target):
        return []
    undetermined = {e.name for e in fit.estimates if not e.determined}
    known = [name for name in fields if name not in undetermined]
    return [name for name in DAMPER_LAWS[fields["law"]].unknowns if name not in known]


def _keeps_law(entries: Mapping[str, Any], target: Component) -> bool:
    return "law" not in entries or entries["law"] == getattr(target.parameters, "law", None)


def _normalised(fit: Fit) -> float:
    return float(np.sqrt(np.mean([test.normalised**2 for test in fit.tests])))


def _fixed_rises(table: str, model: ComponentModel) -> str:
    """Return a text with the rises of a table that the user fixed; "" if there are none."""
    names = [name.split(".")[1] for name in model.fixed if name.startswith(f"{table}.")]
    return f"; {', '.join(names)} fixed" if names else ""


def table_entry(value: Mapping[str, Sequence[float]], source: str) -> dict[str, str]:
    """Return a table in SI as an entry of a YAML file, with its source."""
    units = {"displacement": LENGTH, "angle": ANGLE, "force": FORCE, "torque": TORQUE}
    shown = {
        name: f"({', '.join(f'{unit.from_si(x):.6g}' for x in given)}) {unit.label}"
        for name, given in value.items()
        for unit in [units[name]]
    }
    return {**shown, "source": source}


def _leaving(entries: dict[str, Any], target: Component) -> dict[str, Any]:
    """Return the entries with null for each number of the component's old law only."""
    if _keeps_law(entries, target):
        return entries
    old = target.parameters.model_fields_set - {"law", "end_bushing"}
    return {**entries, **dict.fromkeys(sorted(old - set(entries)))}


def _whole(entries: dict[str, Any], target: Component) -> dict[str, Any]:
    """Return a component file: identified numbers, and old ones that still belong to it."""
    if not _keeps_law(entries, target):
        return entries
    kept = {
        key: {"value": unit.text(value), "source": target.sources.get(key, "as before")}
        for key, value, unit in quantities(target.parameters)
        if "." not in key and key not in entries
    }
    for name in target.parameters.model_fields_set - set(
        entries
    ):  # tables, which are no single quantity
        table = getattr(target.parameters, name)
        if isinstance(table, ForceTable | TorqueTable):
            kept[name] = {key: unit.text(value) for key, value, unit in quantities(table)}
    return {**entries, **kept}


def _named_from(machine: str, out: Path) -> str:
    if machine in shipped_machines():
        return machine
    return os.path.relpath(Path(machine).resolve(), out.resolve())


@dataclass(frozen=True)
class FittedComponent(Destination):
    """A component whose numbers are identified, and where they go.

    Attributes:
        title: Component, for headings.
        copies: Fields of each law that get the value of another field.
    """

    title: str = ""
    copies: Mapping[str, Mapping[str, str]] = field(default_factory=dict)

    def missing(self, name: str, law: FittedLaw) -> list[str]:
        """Return a sentence that names the numbers that a file lacks, so that it is not written."""
        missing = missing_numbers(law.fit, law.model, self.target.component)
        if not missing:
            return []
        return [
            f"{name} is not written: the data do not determine {', '.join(missing)}, which the law "
            f"{law.model.law} needs and {self.target.component.name} did not have; give a value "
            "with --fix."
        ]
