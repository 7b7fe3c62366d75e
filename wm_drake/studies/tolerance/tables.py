"""Tables of a tolerance study, for CSV files and JSON."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from wm_drake.studies.gasket.tables import finite
from wm_drake.studies.tolerance.shares import PERCENTILES, percentile_of
from wm_drake.studies.tolerance.study import ToleranceResult
from wm_drake.studies.tolerance.variables import PERCENT, Variable


def shown_values(result: ToleranceResult) -> pd.DataFrame:
    """Return the uncertain quantities of each sample in their units for reading."""
    values = result.machine.joint.values(result.scores)
    columns = {}
    for variable, column in zip(result.machine.variables, values.T, strict=True):
        columns[f"{variable.name} [{unit_text(variable)}]"] = factor_for_reading(variable) * column
    return pd.DataFrame(columns)


def unit_text(variable: Variable) -> str:
    """Return the unit of a quantity for reading; "%" for one relative to the machine's number."""
    if variable.form == PERCENT or variable.unit is None:
        return "%"
    return variable.unit.shown.replace("*", " ")


def factor_for_reading(variable: Variable) -> float:
    """Return the factor from the number of a quantity to its unit for reading."""
    if variable.form == PERCENT or variable.unit is None:
        return 100.0
    return variable.unit.from_si(1.0)


def samples_table(result: ToleranceResult) -> pd.DataFrame:
    """Return quantities and measures of each sample, and the reason if its run failed."""
    table = pd.concat([shown_values(result), result.values], axis=1)
    table.insert(0, "sample", range(1, len(table) + 1))
    table["failed"] = [result.failed.get(i, "") for i in range(len(table))]
    return table


def measures_table(result: ToleranceResult) -> pd.DataFrame:
    """Return mean, deviation and percentiles of each measure, with intervals of the percentiles."""
    rows = []
    for name, column in result.values.items():
        good = column.dropna().to_numpy()
        row: dict[str, Any] = {"measure": name, "mean": np.mean(good), "deviation": np.std(good)}
        for percent in PERCENTILES:
            found = percentile_of(good, percent)
            row |= {
                f"p{percent}": found.value,
                f"p{percent}_lower": found.lower,
                f"p{percent}_upper": found.upper,
            }
        rows.append(row)
    return pd.DataFrame(rows)


def sobol_table(result: ToleranceResult) -> pd.DataFrame:
    """Return the Sobol indices: one row for each measure and quantity."""
    return pd.DataFrame(
        {"measure": name, "quantity": variable.name, **vars(index)}
        for name, indices in result.indices.items()
        for variable, index in zip(result.machine.variables, indices, strict=True)
    )


def contact_table(result: ToleranceResult) -> pd.DataFrame:
    """Return the share of the samples in which each pair of shapes touches or is nearest."""
    contact = result.contact
    names = dict.fromkeys([*contact.pairs, *contact.nearest]) if contact else {}
    assert contact is not None or not names
    rows = []
    for name in names:
        assert contact is not None
        moving, fixed = name.split("|")
        share = contact.pairs.get(name)
        rows.append(
            {
                "moving": moving,
                "fixed": fixed,
                "touches": share.estimate if share else 0.0,
                "lower": share.lower if share else 0.0,
                "upper": share.upper if share else np.nan,
                "nearest_in": contact.nearest.get(name, 0),
            }
        )
    return pd.DataFrame(
        rows, columns=["moving", "fixed", "touches", "lower", "upper", "nearest_in"]
    )


def limits_table(result: ToleranceResult) -> pd.DataFrame:
    """Return the verdict on each limit."""
    return pd.DataFrame(_limits(result))


def _limits(result: ToleranceResult) -> list[dict[str, Any]]:
    return [
        {
            "quantity": v.limit.quantity,
            "side": "at_least" if v.limit.at_least is not None else "at_most",
            "limit": v.limit.text,
            "allowed_share": v.allowed,
            "share": v.broken.estimate,
            "lower": v.broken.lower,
            "upper": v.broken.upper,
            "verdict": v.word,
        }
        for v in result.verdicts
    ]


def write_tables(result: ToleranceResult, folder: Path) -> None:
    """Write the CSV files of a study into a folder."""
    tables = {
        "samples": samples_table(result),
        "measures": measures_table(result),
        "sobol": sobol_table(result),
        "contact": contact_table(result),
        "limits": limits_table(result),
    }
    for name, table in tables.items():
        if len(table.columns):
            table.to_csv(folder / f"{name}.csv", index=False)


def as_plain_data(result: ToleranceResult) -> dict[str, Any]:
    """Return a result as data for JSON."""
    contact = result.contact
    measures = {
        row.pop("measure"): {name: finite(float(value)) for name, value in row.items()}
        for row in measures_table(result).to_dict("records")
    }
    names = [variable.name for variable in result.machine.variables]
    return {
        "samples": result.settings.samples,
        "seed": result.settings.seed,
        "runs": result.runs,
        "failed": len(result.failed),
        "measures": measures,
        "contact_probability": None
        if contact is None
        else {
            "estimate": contact.estimate,
            "lower": contact.lower,
            "upper": contact.upper,
            "method": contact.method,
            "runs": contact.crude.samples,
            "touching": contact.crude.count,
            "pairs": {
                name: {"estimate": s.estimate, "lower": s.lower, "upper": s.upper}
                for name, s in contact.pairs.items()
            },
        },
        "sobol": {
            measure: {
                name: {k: finite(v) for k, v in vars(index).items()}
                for name, index in zip(names, indices, strict=True)
            }
            for measure, indices in result.indices.items()
        },
        "sobol_refused": result.refused,
        "limits": _limits(result),
    }
