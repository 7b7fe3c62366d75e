"""What the pages of all fits share: values with intervals, what is not determined, the search."""

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
import pandas as pd
import xarray as xr

from wm_drake.parameters.units import Unit
from wm_drake.report.figure import Axis, Figure, Line, Numbers, Panel
from wm_drake.report.formatting import MISSING, number
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.page import Picture, picture
from wm_drake.report.quantity import Quantity, quantity_of, shown
from wm_drake.report.table import Table, line
from wm_drake.studies.answer import Part, Plot
from wm_drake.studies.fitting.fit import Estimate, Fit

FixedNumber: TypeAlias = tuple[str, float, Unit]
"""Name, SI value and unit of a number that was not searched."""

FIXED = "fixed"
"""Remark on a number that was not searched."""


def estimate_rows(fit: Fit) -> list[dict[str, Any]]:
    """Return value, interval, unit and bounds of each unknown, in its unit for reading."""
    rows = []
    for e, unknown in zip(fit.estimates, fit.problem.unknowns, strict=True):
        value, lower, upper = (
            unknown.unit.from_si(v) if np.isfinite(v) else np.nan
            for v in (e.value, e.lower, e.upper)
        )
        rows.append(
            {
                "unknown": e.name,
                "value": value if e.determined else np.nan,
                "lower_95": lower,
                "upper_95": upper,
                "unit": unknown.unit.shown,
                "lower_bound": unknown.unit.from_si(unknown.lower),
                "upper_bound": unknown.unit.from_si(unknown.upper),
            }
        )
    return rows


def estimates_frame(fit: Fit, fixed: Sequence[FixedNumber] = ()) -> pd.DataFrame:
    """Return `estimate_rows` with remarks, and the fixed numbers, as a table for a file."""
    return pd.DataFrame(_rows(fit, fixed))


def _rows(fit: Fit, fixed: Sequence[FixedNumber]) -> list[dict[str, Any]]:
    pairs = zip(estimate_rows(fit), fit.estimates, strict=True)
    return [row | {"remark": _remark(e)} for row, e in pairs] + [
        {"unknown": name, "value": unit.from_si(value), "unit": unit.shown, "remark": FIXED}
        for name, value, unit in fixed
    ]


def _remark(e: Estimate) -> str:
    if not e.determined:
        return "not determined by the data"
    return f"at its {e.at_bound} bound" if e.at_bound else ""


def undetermined_sentences(fit: Fit) -> list[str]:
    """Return a sentence for each unknown, or joint change of unknowns, that is not determined."""
    sentences = []
    for direction in fit.undetermined:
        if len(direction.names) == 1:
            sentences.append(
                f"{direction.names[0]} can take any value within its bounds without a visible "
                "change of the computed values."
            )
            continue
        pairs = zip(direction.names, direction.parts, strict=True)
        parts = ", ".join(f"{name} {part:+.2g}" for name, part in pairs)
        sentences.append(
            "These unknowns can change together, by the given fractions of their ranges, without a "
            f"visible change of the computed values: {parts}."
        )
    return sentences


def values_table(fit: Fit, fixed: Sequence[FixedNumber] = ()) -> Table:
    """Return value, interval, unit and remark of each unknown and fixed number."""
    groups = []
    for row in _rows(fit, fixed):
        interval = MISSING
        if np.isfinite(row.get("lower_95", np.nan)):
            interval = f"{row['lower_95']:.5g} to {row['upper_95']:.5g}"
        value = f"{row['value']:.5g}" if np.isfinite(row["value"]) else MISSING
        unit = row["unit"].replace("*", " ")
        groups.append(line(row["unknown"], (value, interval, unit, row["remark"])))
    caption = (
        "Estimated values with 95 % confidence intervals. There is no interval if the value is at "
        "a bound, if the data do not determine it or if it was fixed."
    )
    heads = ("unknown", "value", "95 % interval", "unit", "remark")
    return Table(caption, heads, tuple(groups), text_columns=5)


def correlations_table(fit: Fit) -> Table:
    """Return the standard deviations of the unknowns, and the correlations between them."""
    deviation = np.sqrt(np.diag(fit.covariance))
    correlation = correlations_of(fit).correlation.values
    groups = []
    for u, s, row in zip(fit.problem.unknowns, deviation, correlation, strict=True):
        size = u.unit.reading(s, 3) if np.isfinite(s) else MISSING
        groups.append(line(u.name, [size, *(number(value, 2) for value in row)]))
    caption = "Standard deviations of the unknowns, and the correlations between them."
    names = [u.name for u in fit.problem.unknowns]
    return Table(caption, ("unknown", "standard deviation", *names), tuple(groups), text_columns=2)


def history_picture(fit: Fit, unit: str) -> Picture:
    """Return the smallest RMSE, with its unit, after each round of the search."""
    plot = _history_plot(fit.log.history, f"smallest RMSE, {unit}")
    return picture(plot.figure, plot.alternative, plot.caption)


def search_facts(fit: Fit) -> list[tuple[str, str]]:
    """Return how the search went, as pairs of word and text."""
    return [
        ("Method", fit.log.method),
        ("Seed", str(fit.log.seed)),
        ("Evaluated points", str(fit.log.evaluations)),
        (
            "Condition number",
            f"{fit.condition:.3g} (Jacobian, with each unknown scaled by its range)",
        ),
        *(("Note", note) for note in fit.log.notes),
    ]


def fit_parts(
    fit: Fit, error: Quantity, planted: Mapping[str, float] | None = None
) -> tuple[Part, ...]:
    """Return the parts of an answer that every fit has: search, values, correlations, errors.

    The picture of the search comes first, as pictures do on every page.

    Args:
        error: Quantity of the data, of which the RMSE is one.
        planted: True values of the unknowns, of a virtual experiment. [SI]
    """
    values = LabelledTable(
        "estimates",
        estimates_of(fit, planted),
        "Estimated values",
        "Estimated values with 95 % confidence intervals. There is no interval if the value is at "
        "a bound, or if the data do not determine it.",
        is_in_terminal=True,
    )
    correlations = LabelledTable(
        "correlations", correlations_of(fit), "Correlations", "Correlations of the errors of the "
        "estimates.", across="with"
    )  # fmt: skip
    rmse = error.named("RMSE")
    errors = xr.Dataset(
        {
            "rmse": rmse.variable("test", [test.rmse for test in fit.tests]),
            "rmse_normalised": Quantity("RMSE by the largest value", decimals=4).variable(
                "test", [test.normalised for test in fit.tests]
            ),
        },
        {"test": [test.name for test in fit.tests]},
    )
    of_tests = LabelledTable(
        "errors", errors, "Errors", "What the fit misses of each measured curve."
    )
    history = xr.Dataset(
        {"least_rmse": rmse.named("least RMSE").variable("round", fit.log.history)},
        {"round": np.arange(1, len(fit.log.history) + 1)},
    )
    least, least_label = history.least_rmse, quantity_of(history.least_rmse).label
    return (
        Part(
            "Search", (_history_plot(shown(least), least_label), LabelledTable("search", history))
        ),
        Part("Estimated values", (values,), remarks=undetermined_sentences(fit)),
        Part("Correlations", (correlations,)),
        Part("Errors of the fit", (of_tests,)),
    )


def estimates_of(fit: Fit, planted: Mapping[str, float] | None = None) -> xr.Dataset:
    """Return value, interval, unit, bounds and remark over the unknowns.

    The numbers are in the unit for reading of each unknown, which the variable `unit` names: their
    units differ.
    """
    rows = pd.DataFrame(estimate_rows(fit))
    rows["remark"] = [_remark(estimate) for estimate in fit.estimates]
    rows["unit"] = [text.replace("*", " ") for text in rows["unit"]]
    words = {"value": "value", "lower_95": "95 % from", "upper_95": "95 % to"}
    if planted is not None:
        units = {unknown.name: unknown.unit for unknown in fit.problem.unknowns}
        rows["planted"] = [units[name].from_si(planted[name]) for name in rows["unknown"]]
    data = rows.set_index("unknown").to_xarray()
    for name, text in words.items():
        data[name].attrs = Quantity(text).attributes()
    return data


def correlations_of(fit: Fit) -> xr.Dataset:
    """Return the correlations of the errors of the unknowns."""
    deviation = np.sqrt(np.diag(fit.covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = fit.covariance / np.outer(deviation, deviation)
    names = [unknown.name for unknown in fit.problem.unknowns]
    quantity = Quantity("correlation", decimals=2)
    return xr.Dataset(
        {"correlation": quantity.variable(("unknown", "with"), correlation)},
        {"unknown": names, "with": names},
    )


def _history_plot(least: Numbers, label: str) -> Plot:
    """Return the least RMSE, in the unit of the label, after each round of the search."""
    curve = Line(range(1, len(least) + 1), np.maximum(least, 1e-300), symbol="circle", size=5.0)
    x, y = Axis(label="round of the search"), Axis(label=label, is_log=True)
    return Plot(
        Figure(panels=(Panel(marks=(curve,), x=x, y=y),), height=180.0),
        "Smallest RMSE after each round of the search.",
        "Smallest RMSE that was found up to the end of each round of the search.",
    )
