"""Tables of a design study, for CSV files and JSON, and its machine files."""

from collections.abc import Sequence
from typing import Any

import pandas as pd

from wm_drake.studies.pareto.robust import Promise
from wm_drake.studies.pareto.study import ParetoFront


def front_table(front: ParetoFront) -> pd.DataFrame:
    """Return objectives, constraints and variables of each design of the front."""
    rows = []
    for number in range(len(front.objectives)):
        objectives, constraints = front.goals(number)
        row: dict[str, Any] = {"design": number + 1}
        row |= {goal.key: value for goal, value in objectives}
        row |= {f"{goal.key} (limit)": value for goal, value in constraints}
        for name, value, unit in front.variables(number):
            row[f"{name} [{unit}]" if unit else name] = value
        rows.append(row)
    return pd.DataFrame(rows)


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
    entries = []
    for number in range(len(front.objectives)):
        objectives, constraints = front.goals(number)
        entries.append(
            {
                "objectives": {goal.key: value for goal, value in objectives},
                "constraints": {goal.key: value for goal, value in constraints},
                "variables": {
                    name: {"value": value, "unit": unit} if unit else value
                    for name, value, unit in front.variables(number)
                },
            }
        )
    return entries
