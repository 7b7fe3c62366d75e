"""Tables of a design study, for CSV files and JSON, and its machine files."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from wm_drake.parameters import machine_yaml
from wm_drake.studies.gasket.tables import finite
from wm_drake.studies.pareto.robust import Promise
from wm_drake.studies.pareto.study import ParetoFront


def front_table(front: ParetoFront) -> pd.DataFrame:
    """Return objectives, constraints and variables of each design of the front."""
    rows = []
    for number, design in enumerate(front.found.designs):
        row: dict[str, Any] = {"design": number + 1}
        row |= _goals(front, number)
        for dimension, place in zip(front.designs.dimensions, design, strict=True):
            value, unit = dimension.shown(float(place))
            row[f"{dimension.name} [{unit}]" if unit else dimension.name] = value
        rows.append(row)
    return pd.DataFrame(rows)


def _goals(front: ParetoFront, number: int) -> dict[str, float]:
    designs = front.designs
    names = [g.key for g in designs.objectives] + [f"{g.key} (limit)" for g in designs.constraints]
    values = (*front.objectives[number], *front.constraints[number])
    return dict(zip(names, map(float, values), strict=True))


def history_table(front: ParetoFront) -> pd.DataFrame:
    """Return the hypervolume after each generation."""
    return pd.DataFrame(front.found.history, columns=["evaluations", "hypervolume"])


def machine_file_name(name: str) -> str:
    """Return the name of the machine file of a chosen design."""
    return f"machine_{name.replace(' ', '_')}.yaml"


def promises_table(kept: Sequence[Promise]) -> pd.DataFrame:
    """Return the check of a robust front on fresh samples."""
    return pd.DataFrame(
        {
            "design": p.design,
            "quantity": p.goal.key,
            "over": p.goal.given.over,
            **{f"promised_{name}": value for name, value in vars(p.promised).items()},
            **{f"fresh_{name}": value for name, value in vars(p.fresh).items()},
            "kept": p.is_kept,
        }
        for p in kept
    )


def write_tables(front: ParetoFront, kept: Sequence[Promise], folder: Path) -> None:
    """Write the CSV files of a study and the machine files of its chosen designs."""
    if kept:
        promises_table(kept).to_csv(folder / "robust.csv", index=False)
    front_table(front).to_csv(folder / "front.csv", index=False)
    history_table(front).to_csv(folder / "history.csv", index=False)
    for name, number in front.chosen.items():
        machine = front.machine(number)
        about = f"Design '{name}' of a design study of machine {machine.name}"
        copy = machine.model_copy(update={"about": about, "measured": ()})
        (folder / machine_file_name(name)).write_text(machine_yaml(copy), encoding="utf-8")


def as_plain_data(front: ParetoFront, kept: Sequence[Promise] = ()) -> dict[str, Any]:
    """Return a result as data for JSON."""
    designs = front.designs
    entries = []
    for number, design in enumerate(front.found.designs):
        shown = [d.shown(float(x)) for d, x in zip(designs.dimensions, design, strict=True)]
        variables = {
            d.name: {"value": value, "unit": unit} if unit else value
            for d, (value, unit) in zip(designs.dimensions, shown, strict=True)
        }
        values = zip(designs.objectives, front.objectives[number], strict=True)
        limits = zip(designs.constraints, front.constraints[number], strict=True)
        entries.append(
            {
                "objectives": {g.key: finite(float(v)) for g, v in values},
                "constraints": {g.key: finite(float(v)) for g, v in limits},
                "variables": variables,
            }
        )
    return {
        "robust": [
            {k: finite(v) if isinstance(v, float) else v for k, v in row.items()}
            for row in promises_table(kept).to_dict("records")
        ],
        "evaluations": front.found.evaluations,
        "front": entries,
        "hypervolume": front.found.hypervolume,
        "chosen": {name: number + 1 for name, number in front.chosen.items()},
        "nominal": {
            g.key: finite(float(v))
            for g, v in zip(designs.objectives, front.nominal_objectives, strict=True)
        },
    }
