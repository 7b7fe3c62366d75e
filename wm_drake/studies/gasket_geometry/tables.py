"""Tables of the study of drawings: CSV files and plain data for JSON."""

from typing import Any

import numpy as np
import pandas as pd

from wm_drake.report.formatting import plain
from wm_drake.studies.gasket_geometry.study import RESPONSES, GeometryResult


def drawings_table(result: GeometryResult) -> pd.DataFrame:
    """Return each drawing: what it is for, its factors, its responses."""
    values = {
        f"{factor.name} [{factor.unit}]": factor.middle + factor.half * column
        for factor, column in zip(result.factors, result.levels.T, strict=True)
    }
    return pd.DataFrame({"kind": result.kinds, **values, **result.responses})


def contributions_table(result: GeometryResult) -> pd.DataFrame:
    """Return the part of each factor in the variance of each response, and its change over it. [%]

    The change is that of the surface from the low to the high end, others in the middle.
    """
    rows = []
    for name in RESPONSES:
        surface = result.surfaces[name]
        parts = 100.0 * surface.contributions(result.sample)
        row: dict[str, Any] = {"response": name, "mean": float(surface.at(result.sample).mean())}
        for number, factor in enumerate(result.factors):
            ends = np.zeros((2, len(result.factors)))
            ends[:, number] = -1.0, 1.0
            low, high = surface.at(ends)
            row[f"{factor.name}_percent"] = parts[number]
            row[f"{factor.name}_change"] = high - low
        row["pairs_percent"] = parts[-1]
        row["error_on_fresh_percent_of_range"] = result.errors(name)
        rows.append(row)
    return pd.DataFrame(rows)


def as_plain_data(result: GeometryResult) -> dict[str, Any]:
    """Return the result for JSON."""
    shown = {
        "gasket": result.name,
        "loads": list(result.loads),
        "limits": result.limits,
        "keeps_limits": bool(result.keeps_limits),
        "degree": result.surfaces["smallest_gap_mm"].degree,
        "drawings": drawings_table(result).to_dict("records"),
        "contributions": contributions_table(result).to_dict("records"),
    }
    return plain(shown)
