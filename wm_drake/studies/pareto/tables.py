"""Tables of a design study, for CSV files and JSON, and its machine files."""

from collections.abc import Sequence
from typing import Any

import pandas as pd

from wm_drake.studies.pareto.robust import Promise
from wm_drake.studies.pareto.study import ParetoFront


def front_table(front: ParetoFront) -> pd.DataFrame:
    """Return objectives, constraints and variables of each design of the front."""
    rows = []
    for number, design in enumerate(front.search.designs):
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
    return pd.DataFrame(front.search.history, columns=["evaluations", "hypervolume"])


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


def designs_as_json(front: ParetoFront) -> list[dict[str, Any]]:
    """Return objectives, constraints and variables of each design of the front."""
    designs, entries = front.designs, []
    for number, design in enumerate(front.search.designs):
        shown = [
            (d.name, *d.shown(float(x))) for d, x in zip(designs.dimensions, design, strict=True)
        ]
        values = zip(designs.objectives, front.objectives[number], strict=True)
        limits = zip(designs.constraints, front.constraints[number], strict=True)
        entries.append(
            {
                "objectives": {goal.key: value for goal, value in values},
                "constraints": {goal.key: value for goal, value in limits},
                "variables": {
                    name: {"value": value, "unit": unit} if unit else value
                    for name, value, unit in shown
                },
            }
        )
    return entries
