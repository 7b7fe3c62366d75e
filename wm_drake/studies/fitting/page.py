"""What the pages of all fits share: values with intervals, what is not determined, the search."""

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np
import xarray as xr

from wm_drake.parameters.units import Unit
from wm_drake.report.figure import Axis, Figure, Line, Panel
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import Quantity, shown
from wm_drake.studies.answer import Part, Plot
from wm_drake.studies.fitting.fit import Assessed, Estimate, Fit
from wm_drake.studies.fitting.problem import Unknown

FixedNumber: TypeAlias = tuple[str, float, Unit]
"""Name, SI value and unit of a number that was not searched."""

MOST_CORRELATED = 20
"""Largest number of unknowns whose correlations a page shows."""

FIXED = "fixed"
"""Remark on a number that was not searched."""


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
    fit: Fit,
    error: Quantity,
    planted: Mapping[str, float] | None = None,
    fixed: Sequence[FixedNumber] = (),
) -> tuple[Part, Part, Part, Part]:
    """Return the parts of an answer that every fit has: search, values, correlations, errors.

    The picture of the search comes first, as pictures do on every page.

    Args:
        error: Quantity of the data, of which the RMSE is one.
        planted: True values of the unknowns, of a virtual experiment. [SI]
        fixed: Numbers that were not searched.
    """
    values = LabelledTable(
        "estimates",
        estimates_of(fit, planted, fixed),
        "Estimated values",
        "Estimated values with 95 % confidence intervals. There is no interval if the value is at "
        "a bound, if the data do not determine it or if it was fixed.",
        is_in_terminal=True,
    )
    of_tests = LabelledTable(
        "errors", errors_of(fit, error), "Errors", "What the fit misses of each measured curve."
    )
    return (
        Part("Search", _history(fit, error) if fit.log.history else ()),
        Part("Estimated values", (values,), remarks=undetermined_sentences(fit)),
        correlations_part(fit),
        Part("Errors of the fit", (of_tests,)),
    )


def correlations_part(fit: Assessed) -> Part:
    """Return the correlations of the errors of the estimates; of many, in the file only."""
    data = correlations_of(fit)
    heading = "Correlations" if len(fit.estimates) <= MOST_CORRELATED else ""
    caption = "Correlations of the errors of the estimates."
    table = LabelledTable("correlations", data, heading, caption, across="with")
    return Part("Correlations", (table,) if fit.estimates else ())


def errors_of(fit: Fit, error: Quantity) -> xr.Dataset:
    """Return `rmse` of each test and `rmse_normalised`, by the largest measured value."""
    normalised = Quantity("RMSE by the largest value", decimals=4)
    return xr.Dataset(
        {
            "rmse": error.named("RMSE").variable("test", [test.rmse for test in fit.tests]),
            "rmse_normalised": normalised.variable("test", [t.normalised for t in fit.tests]),
        },
        {"test": [test.name for test in fit.tests]},
    )


def _history(fit: Fit, error: Quantity) -> tuple[Plot, LabelledTable]:
    """Return the least RMSE after each round of the search."""
    least = error.named("least RMSE")
    rounds = np.arange(1, len(fit.log.history) + 1)
    history = xr.Dataset(
        {"least_rmse": least.variable("round", fit.log.history)}, {"round": rounds}
    )
    curve = Line(rounds, np.maximum(shown(history.least_rmse), 1e-300), symbol="circle", size=5.0)
    x, y = Axis(label="round of the search"), Axis(label=least.label, is_log=True)
    plot = Plot(
        Figure(panels=(Panel(marks=(curve,), x=x, y=y),), height=180.0),
        "Smallest RMSE after each round of the search.",
        "Smallest RMSE that was found up to the end of each round of the search.",
    )
    return plot, LabelledTable("search", history)


def estimates_of(
    fit: Assessed,
    planted: Mapping[str, float] | None = None,
    fixed: Sequence[FixedNumber] = (),
) -> xr.Dataset:
    """Return value, standard deviation, interval, unit, bounds and remark over the unknowns.

    The numbers are in the unit for reading of each unknown, which the variable `unit` names: their
    units differ.

    Args:
        planted: True values of the unknowns. [SI]
        fixed: Numbers that were not searched; they have a value only.
    """
    words = {
        "value": "value",
        "deviation": "± standard deviation",
        "lower_95": "95 % from",
        "upper_95": "95 % to",
        "unit": "unit",
    }
    words |= {"lower_bound": "lower bound", "upper_bound": "upper bound", "remark": "remark"}
    deviations = np.sqrt(np.diag(fit.covariance)).tolist()
    rows = list(map(_row, fit.estimates, fit.unknowns, deviations))
    rows += [
        (unit.from_si(value), *[np.nan] * 3, _unit_text(unit), *[np.nan] * 2, FIXED)
        for _, value, unit in fixed
    ]
    names = [*(e.name for e in fit.estimates), *(name for name, *_ in fixed)]
    columns = zip(words.items(), zip(*rows, strict=True), strict=True)
    data = xr.Dataset(
        {
            name: ("unknown", list(values), Quantity(text).attributes())
            for (name, text), values in columns
        },
        {"unknown": names},
    )
    if planted is not None:
        units = {unknown.name: unknown.unit for unknown in fit.unknowns}
        truth = [units[name].from_si(planted[name]) for name in names]
        data["planted"] = Quantity("planted").variable("unknown", truth)
    return data


def _row(e: Estimate, unknown: Unknown, deviation: float) -> tuple[float | str, ...]:
    """Return value, deviation, interval, unit, bounds and remark of an unknown."""
    values = (e.value if e.determined else np.nan, deviation, e.lower, e.upper)
    bounds = (unknown.lower, unknown.upper)
    unit = unknown.unit
    return (
        *map(unit.from_si, values),
        _unit_text(unit),
        *map(unit.from_si, bounds),
        _remark(e),
    )


def _unit_text(unit: Unit) -> str:
    return unit.shown.replace("*", " ")


def correlations_of(fit: Assessed) -> xr.Dataset:
    """Return the correlations of the errors of the unknowns."""
    deviation = np.sqrt(np.diag(fit.covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = fit.covariance / np.outer(deviation, deviation)
    names = [unknown.name for unknown in fit.unknowns]
    quantity = Quantity("correlation", decimals=2)
    return xr.Dataset(
        {"correlation": quantity.variable(("unknown", "with"), correlation)},
        {"unknown": names, "with": names},
    )
