"""Tables of a calibration: quantities, amplitudes, predictions."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from wm_drake.parameters.measured import EXPERIMENT
from wm_drake.report.table import Column, Table, table_of
from wm_drake.studies.calibrate.prediction import Prediction
from wm_drake.studies.calibrate.response_targets import CONTRIBUTION, TRIALS
from wm_drake.studies.calibrate.solutions import percents_of
from wm_drake.studies.calibrate.study import Calibration
from wm_drake.studies.calibrate.targets import MILLIMETRE


def quantity_table(calibration: Calibration) -> pd.DataFrame:
    """Return a table of the free quantities, each in its unit.

    It has bounds and prior, and for each solution the value, its standard deviation and what
    determines it (see `Solution.verdicts`).
    """
    parameter_map = calibration.parameter_map
    expected, deviation = map(parameter_map.in_units, parameter_map.prior)
    columns: dict[str, Any] = {
        "quantity": parameter_map.names,
        "unit": parameter_map.units,
        "lower": parameter_map.in_units(parameter_map.lower),
        "upper": parameter_map.in_units(parameter_map.upper),
        "expected": expected,
        "deviation": deviation,
    }
    for number, solution in enumerate(calibration.solutions, start=1):
        columns[f"value_{number}"] = parameter_map.in_units(solution.point)
        columns[f"deviation_{number}"] = solution.posterior.spread() * deviation
        columns[f"held_by_{number}"] = solution.verdicts()
    return pd.DataFrame(columns)


QUANTITIES = {
    "quantity": Column("quantity"),
    "held_by_1": Column("determined by"),
    "unit": Column("unit"),
    "value_1": Column("best solution"),
    "deviation_1": Column("± deviation"),
    "expected": Column("expected"),
    "deviation": Column("± deviation"),
}
"""Columns of the quantities on page and terminal."""

BOUNDS = {"lower": Column("lower bound"), "upper": Column("upper bound")}
"""Columns of the quantities on the page alone."""


def quantities_shown(calibration: Calibration, *, is_short: bool = False) -> Table:
    """Return prior and solutions of each free quantity; in the short form the best one alone."""
    others = range(2, len(calibration.solutions) + 1)
    columns = {**QUANTITIES}
    if not is_short:
        columns |= BOUNDS | {f"value_{n}": Column(f"solution {n}") for n in others}
    caption = "Free quantities, with their standard deviations before and after the fit."
    return table_of(quantity_table(calibration)[list(columns)], caption, columns)


def amplitude_rows(calibration: Calibration) -> pd.DataFrame:
    """Return measured amplitudes and those of each solution as one table of amplitudes. [mm]"""
    targets = calibration.targets
    rows = []
    for index, (load, gasket) in enumerate(targets.loads):
        sources = [(EXPERIMENT, targets.amplitude[index])]
        sources += [
            (f"solution {n}", solution.amplitude[index])
            for n, solution in enumerate(calibration.solutions, start=1)
        ]
        for source, values in sources:
            amplitudes = {
                name: MILLIMETRE.from_si(float(v))
                for name, v in zip(targets.sensors, values, strict=True)
            }
            rows.append(
                {"load": load, "gasket": "yes" if gasket else "no", "source": source, **amplitudes}
            )
    return pd.DataFrame(rows)


def response_table(calibration: Calibration) -> pd.DataFrame:
    """Return the targets that are no amplitudes, and those responses of each solution.

    Columns: load, gasket (yes, no), of (machine, design, factor at a level, factor), response,
    unit, target, deviation in percent, and one for each solution.
    """
    rows = [
        {
            "load": target.load,
            "gasket": "yes" if target.gasket else "no",
            "of": target.of,
            "response": target.response.name,
            "unit": "%" if target.statistic == CONTRIBUTION else target.response.unit_text,
            "target": target.value,
            "deviation_percent": 100.0 * target.deviation,
        }
        for target in calibration.targets.responses
    ]
    solutions = enumerate(calibration.solutions, start=1)
    return pd.DataFrame(rows).assign(**{f"solution_{n}": s.responses for n, s in solutions})


RESPONSES = {
    **{name: Column(name) for name in ("load", "gasket", "of", "response", "unit", "target")},
    "solution_1": Column("calibrated machine"),
    "difference": Column("difference", "%", 0),
}
"""Columns of the other responses on the page."""


def responses_shown(calibration: Calibration) -> Table:
    """Return the targets that are no amplitudes, beside those of the best solution."""
    frame = response_table(calibration)
    frame["difference"] = 100.0 * calibration.solutions[0].response_errors
    caption = (
        "Responses that are no amplitudes of sensors. A value of the design is the mean over "
        f"{TRIALS} trials of an orthogonal array of the gasket's factors ([B] section 4); one of a "
        "factor at a level is its effect, with the difference in percent of the mean; one of a "
        "factor alone is its contribution in percent of the variance, with the difference in "
        "points. A response without a difference was not used."
    )
    return table_of(frame[list(RESPONSES)], caption, RESPONSES)


FITS = ("calibrated", "predicted", "seen")
"""Errors of a kind of values in a prediction, by the names of its attributes."""


def prediction_table(predictions: Sequence[Prediction]) -> pd.DataFrame:
    """Return a table with a row for each kind of values of each group of held-out loads.

    Differences are in percent; those of effects in percent of the mean, those of contributions in
    points.
    """
    rows = []
    for prediction in predictions:
        for kind in prediction.kinds():
            row: dict[str, object] = {"held_out": " ".join(prediction.loads), "what": kind.name}
            row["values"] = kind.predicted.size
            for fit in FITS:
                row |= percents_of(getattr(kind, fit)).named(f"{fit}_")
            rows.append(row | {"in_intervals_percent": 100.0 * float(np.mean(kind.is_covered))})
    return pd.DataFrame(rows)


PREDICTIONS = {
    "held_out": Column("held-out loads"),
    "what": Column("values"),
    "values": Column("number", decimals=0),
    **{
        f"{fit}_{error}_percent": Column(f"{fit}: {error}", "%", 1)
        for fit in FITS
        for error in ("mean", "largest")
    },
    "in_intervals_percent": Column("in the 95 % intervals", "%", 0),
}
"""Columns of the predictions."""


def predictions_shown(predictions: Sequence[Prediction]) -> Table:
    """Return the errors of loads when they were used for the calibration and when held out."""
    caption = (
        "Absolute differences from the targets; those of effects in percent of the mean, those of "
        "contributions in points. Calibrated: these loads in the calibration above, which used "
        "them. Predicted: these loads when they were held out. Seen: the remaining loads in the "
        "calibration without them."
    )
    return table_of(prediction_table(predictions), caption, PREDICTIONS)
