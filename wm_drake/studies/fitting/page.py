"""What the pages of all fits share: values with intervals, what is not determined, the search."""

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
import xarray as xr

from wm_drake.parameters.units import Unit
from wm_drake.report.chart import panel
from wm_drake.report.figure import Figure
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import Quantity
from wm_drake.studies.answer import Part, Plot
from wm_drake.studies.fitting.fit import Estimate, Fit

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


def correlations_part(fit: Fit) -> Part:
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
    x, y = {"label": "round of the search"}, {"is_log": True}
    # a logarithm has no 0
    above = history.clip(min=least.reading.to_si(1e-300), keep_attrs=True)
    curve = panel(above, "round", ["least_rmse"], x=x, y=y, symbol="circle", size=5.0)
    plot = Plot(
        Figure(panels=(curve,), height=180.0),
        "Smallest RMSE after each round of the search.",
        "Smallest RMSE that was found up to the end of each round of the search.",
    )
    return plot, LabelledTable("search", history)


def estimates_of(
    fit: Fit,
    planted: Mapping[str, float] | None = None,
    fixed: Sequence[FixedNumber] = (),
) -> xr.Dataset:
    """Return value, standard deviation, interval, bounds and remark over the unknowns.

    Each number carries the unit of its unknown. [SI]

    Args:
        planted: True values of the unknowns. [SI]
        fixed: Numbers that were not searched; they have a value only.
    """
    units = {unknown.name: unknown.unit for unknown in fit.unknowns}
    units |= {name: unit for name, _, unit in fixed}
    estimates = fit.estimates
    columns = {
        "value": ("value", [e.value if e.determined else np.nan for e in estimates]),
        "deviation": ("± standard deviation", np.sqrt(np.diag(fit.covariance)).tolist()),
        "lower_95": ("95 % from", [e.lower for e in estimates]),
        "upper_95": ("95 % to", [e.upper for e in estimates]),
        "lower_bound": ("lower bound", [unknown.lower for unknown in fit.unknowns]),
        "upper_bound": ("upper bound", [unknown.upper for unknown in fit.unknowns]),
    }
    if planted is not None:
        columns["planted"] = "planted", [planted[e.name] for e in estimates]
    given = {"value": [value for _, value, _ in fixed]}
    data = {
        name: of_unknowns(words, units, [*values, *given.get(name, [np.nan] * len(fixed))])
        for name, (words, values) in columns.items()
    }
    remarks = [*map(_remark, estimates), *[FIXED] * len(fixed)]
    remark = xr.Variable("unknown", remarks, Quantity("remark").attributes())
    return xr.Dataset({**data, "remark": remark}, {"unknown": list(units)})


def of_unknowns(
    words: str, units: Mapping[str, Unit], values: Any, dims: str | Sequence[str] = "unknown"
) -> xr.Variable:
    """Return numbers over unknowns, each in the unit of its unknown. [SI]

    Args:
        units: Unit of each unknown.
        dims: Dimensions of the numbers.
    """
    each = {name: Quantity(words, unit) for name, unit in units.items()}
    return Quantity(words).of_each("unknown", each, dims, values)


def correlations_of(fit: Fit) -> xr.Dataset:
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
