"""Tables of a tolerance study: values for CSV files and JSON, and what page and terminal show."""

from typing import Any

import numpy as np
import pandas as pd

from wm_drake.report.formatting import MISSING, shape_name, significant, with_interval
from wm_drake.report.table import Column, Table, line, table_of
from wm_drake.studies.tolerance.shares import PERCENTILES, percentile_of
from wm_drake.studies.tolerance.study import ToleranceResult
from wm_drake.studies.tolerance.words import in_percent, measure_titles, quantity_words

KINDS = {"pass": "ours", "fail": "alarm", "undecided": ""}
"""Style of the row of a limit by its verdict."""


def samples_frame(result: ToleranceResult) -> pd.DataFrame:
    """Return quantities and measures of each sample, and the reason if its run failed."""
    columns: dict[str, Any] = {"sample": range(1, len(result.values) + 1)}
    values = result.machine.joint.values(result.scores)
    for variable, column in zip(result.machine.variables, values.T, strict=True):
        unit = variable.variation.unit
        columns[f"{variable.name} [{unit.label}]"] = unit.from_si(1.0) * column
    failed = [result.failed.get(i, "") for i in range(len(result.values))]
    return pd.concat([pd.DataFrame(columns), result.values], axis=1).assign(failed=failed)


def measures_frame(result: ToleranceResult) -> pd.DataFrame:
    """Return mean, deviation and percentiles of each measure, with intervals of the percentiles."""
    rows = []
    for name, column in result.values.items():
        good = column.dropna().to_numpy()
        row: dict[str, Any] = {"measure": name, "mean": np.mean(good), "deviation": np.std(good)}
        for percent in PERCENTILES:
            percentile = percentile_of(good, percent)
            row[f"p{percent}"] = percentile.value
            row |= {f"p{percent}_{end}": getattr(percentile, end) for end in ("lower", "upper")}
        rows.append(row)
    return pd.DataFrame(rows)


MEASURES = {
    "measure": Column("measure"),
    "unit": Column("unit"),
    "mean": Column("mean"),
    "deviation": Column("deviation"),
    "p5": Column("5 %"),
    "p50": Column("median"),
    "p95": Column("95 %"),
}
"""Columns of the table of measures."""


def measures_table(result: ToleranceResult, *, is_short: bool = False) -> Table:
    """Return the measures with words and unit; the short form has percentiles alone."""
    frame, titles = measures_frame(result), measure_titles(result)
    words = [titles[str(name)] for name in frame["measure"]]
    frame["measure"], frame["unit"] = ([pair[index] for pair in words] for index in (0, 1))
    names = [name for name in MEASURES if not (is_short and name in ("mean", "deviation"))]
    for name in [f"p{percent}" for percent in PERCENTILES if not is_short]:
        ends = frame[[name, f"{name}_lower", f"{name}_upper"]].itertuples(index=False)
        frame[name] = [with_interval(*each) for each in ends]
    caption = "Measures over all samples; percentiles with 95 % intervals of order statistics."
    return table_of(frame[names], caption, MEASURES)


def sobol_frame(result: ToleranceResult) -> pd.DataFrame:
    """Return the Sobol indices: one row for each measure and quantity."""
    return pd.DataFrame(
        {"measure": name, "quantity": variable.name, **vars(index)}
        for name, indices in result.indices.items()
        for variable, index in zip(result.machine.variables, indices, strict=True)
    )


def sobol_table(result: ToleranceResult) -> Table:
    """Return the total Sobol indices, a column for each quantity."""
    names = (quantity_words(variable.name) for variable in result.machine.variables)
    titles = measure_titles(result)
    caption = (
        "Total Sobol indices of all measures. First-order indices and 95 % intervals are in "
        "sobol.csv."
    )
    groups = (
        line(titles[name][0], [index.total for index in indices])
        for name, indices in result.indices.items()
    )
    columns = tuple(Column(name, decimals=2) for name in names)
    return Table(caption, ("measure", *columns), tuple(groups))


def contact_frame(result: ToleranceResult) -> pd.DataFrame:
    """Return the share of the samples in which each pair of shapes touches or is nearest."""
    rows, contact = [], result.contact
    if contact:
        for name in dict.fromkeys([*contact.pairs, *contact.nearest]):
            share = contact.pairs.get(name)
            ends = (share.estimate, share.lower, share.upper) if share else (0.0, 0.0, np.nan)
            rows.append((*name.split("|"), *ends, contact.nearest.get(name, 0)))
    names = ["moving", "fixed", "touches", "lower", "upper", "nearest_in"]
    return pd.DataFrame(rows, columns=names)


def contact_table(result: ToleranceResult) -> Table:
    """Return how often each pair of shapes touches and is nearest."""
    rows = []
    for moving, fixed, share, low, high, count in contact_frame(result).to_numpy().tolist():
        ends = f"{in_percent(low)} to {in_percent(high)}" if share else MISSING
        nearest = 100.0 * count / result.settings.samples
        cells = (shape_name(fixed), in_percent(share), ends, nearest)
        rows.append(line(shape_name(moving), cells))
    caption = (
        "Contact by pair of shapes among the samples. A run may touch at several places. Last "
        "column: share of the runs in which the pair has the smallest gap. Intervals: 95 %, "
        "Clopper and Pearson."
    )
    header = ("moves with the tub", "housing", "touch", "interval")
    return Table(caption, (*header, Column("nearest", "%", 1)), tuple(rows), text_columns=2)


def limits_frame(result: ToleranceResult) -> pd.DataFrame:
    """Return the verdict on each limit."""
    return pd.DataFrame(
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
    )


def limits_table(result: ToleranceResult) -> Table:
    """Return the verdict on each limit with the words of its quantity."""
    titles, rows = measure_titles(result), []
    for v in result.verdicts:
        side = "at least" if v.limit.at_least is not None else "at most"
        ends = " to ".join(significant(100.0 * x, 3) for x in (v.broken.lower, v.broken.upper))
        share = significant(100.0 * v.broken.estimate, 3)
        cells = (f"{side} {v.limit.text}", 100.0 * v.allowed, share, ends, v.word)
        rows.append(line(titles[v.key][0], cells, KINDS[v.word]))
    caption = (
        "Limits: share of the runs that break each one. The verdict is pass if the whole 95 % "
        "interval is allowed, fail if none of it is, else undecided: more samples decide it."
    )
    header = ("quantity", "limit", "allowed, %", "break it, %", "interval, %", "verdict")
    return Table(caption, header, tuple(rows), text_columns=2)


def quantities_table(result: ToleranceResult) -> Table:
    """Return what scatters."""
    rows = (
        line(
            quantity_words(v.name),
            (", ".join(v.variation.keys) or "load", v.text, v.source or MISSING),
        )
        for v in result.machine.variables
    )
    caption = "What scatters. Percents are of the machine's number."
    return Table(
        caption, ("quantity", "keys", "distribution", "source"), tuple(rows), text_columns=4
    )
