"""Show a fit to recordings: values, residuals, and how well the machine then agrees."""

import numpy as np
import xarray as xr

from wm_drake.parameters import machine_yaml
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Share
from wm_drake.report import figure as fig
from wm_drake.report.formatting import listed
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import Quantity
from wm_drake.studies.answer import Answer, Part, Plot, pictures_first
from wm_drake.studies.calibrate.recorded import By
from wm_drake.studies.calibrate.records import MISFIT, RecordModel
from wm_drake.studies.compare.pairs import QUANTITIES
from wm_drake.studies.fitting.fit import Fit, verdict_of
from wm_drake.studies.fitting.page import fit_parts, search_facts

ERROR = Quantity("error", Share(), 1)

MOST_MISFIT = 2.0
"""Largest misfit of a right structure, in standard deviations of noise and repeats. A choice:
planted machines with the right structure stay below it, one without its gasket has 7."""

MOST_DRAWN = 1500
"""Number of places of a picture from which on some are left out."""

WRONG = (
    "This is more than noise and repeats explain: the structure of the model, the load or a sensor "
    "is not that of the test"
)

FITTED = {"history": "signals"}
"""Word for what is fitted, if it is not amplitudes."""

METHOD = (
    "The model predicts the signals as they were recorded. Unknowns of the fit beside those of the "
    "machine are what is not known of the recorder: gain and tilt of each sensor, offset and rate "
    "of each clock, and, if signals over time are fitted, the angle of the drum at the start. Each "
    "has a prior: expected value and standard deviation. Of signals over time, offset and drift "
    "are taken out. Two seconds at both ends of a record are left out. Confidence intervals take "
    "the correlation of neighbouring residuals into account."
)


def records_answer(model: RecordModel, fit: Fit, data: xr.Dataset, title: str, file: str) -> Answer:
    """Return the answer of a fit to recordings.

    Args:
        fit, data: As of `calibrated` in `wm_drake.studies.calibrate.records`.
        title: Title of the page.
        file: Name of the file of the machine with the values found, without suffix.
    """
    files = ", ".join(pair.recording.path.name for pair in model.pairs)
    loads = ", ".join(load.name for load in model.loads)
    search, values, *others = fit_parts(fit, MISFIT)
    parts: list[Part] = []
    for quantity in QUANTITIES:
        names = [n for n, sensor in model.sensors.items() if sensor.quantity == quantity]
        if names:
            parts.append(_compared(data.sel(sensor=names), quantity, model.by))
    machine = model.free.solved(fit, f"calibrated to {files}")
    return Answer(
        title,
        summary(model, fit, data),
        model.experiment.machine.parameters,
        pictures_first([*parts, _residuals(data), _errors(fit, data), search, values, *others]),
        (("Records", files), ("Load", loads), ("Fitted", model.by), *search_facts(fit)),
        METHOD,
        files={f"{file}.yaml": machine_yaml(machine)},
        warned=tuple(warnings_of(model, fit, data)),
    )


def verdict_table(fit: Fit, data: xr.Dataset) -> LabelledTable:
    """Return the verdict, the misfit, and whether the structure of the model is wrong."""
    numbers = xr.Dataset(
        {
            "verdict": ((), verdict_of(_missed(data))),
            "structure": ((), "wrong" if _is_wrong(fit, data) else "not refuted"),
            "misfit": MISFIT.variable((), fit.rmse),
        }
    )
    return LabelledTable("numbers", numbers)


def _is_wrong(fit: Fit, data: xr.Dataset) -> bool:
    return verdict_of(_missed(data)) == "poor" or fit.rmse > MOST_MISFIT


def _missed(data: xr.Dataset) -> float:
    return float(np.sqrt(np.nanmean(data.error_after.values**2)))


def summary(model: RecordModel, fit: Fit, data: xr.Dataset) -> str:
    """Return how well the machine fits, and what the records determine."""
    estimates = fit.estimates[: len(model.free.unknowns)]
    known = [e.name for e in estimates if e.determined]
    others = [e.name for e in estimates if not e.determined]
    before = float(np.sqrt(np.nanmean(data.error_before.values**2)))
    count = len(model.pairs)
    records = "1 record" if count == 1 else f"{count} records"
    text = (
        f"{verdict_of(_missed(data)).capitalize()} fit to {records}: the "
        f"{FITTED.get(model.by, 'amplitudes')} miss the recorded ones by "
        f"{ERROR.text(_missed(data))}, before by {ERROR.text(before)}, or by "
        f"{MISFIT.number(fit.rmse)} standard deviations."
    )
    if verdict_of(_missed(data)) == "poor":
        text += " The machine does not describe the records: do not use the values."
    elif fit.rmse > MOST_MISFIT:
        text += f" {WRONG}; the values make up for it."
    if known:
        text += f" Determined: {listed(known)}."
    return f"{text} Not determined: {listed(others)}." if others else text


def warnings_of(model: RecordModel, fit: Fit, data: xr.Dataset) -> list[str]:
    """Return a warning of a wrong structure, and of each unknown that is at a bound."""
    warnings = (
        [f"{WRONG}; the values are not those of the machine."] if _is_wrong(fit, data) else []
    )
    machine = {unknown.name for unknown in model.free.unknowns}
    for e in fit.estimates:
        if e.at_bound and e.name in machine:
            warnings.append(
                f"The search for {e.name} ended at its {e.at_bound} bound. Widen the range, or "
                "check whether the model is right."
            )
        elif e.at_bound:
            warnings.append(
                f"{e.name.capitalize()} is at its {e.at_bound} bound, which no usual recorder "
                "reaches: check the test file, or whether the model is right."
            )
    return warnings


def _compared(data: xr.Dataset, quantity: str, by: By) -> Part:
    """Return what was recorded and computed of the sensors of a quantity."""
    unit, dims = QUANTITIES[quantity], ("place", "sensor")
    words = {"measured": "recorded", "deviation": "±", "before": "before", "after": "after"}
    shown = xr.Dataset(
        {name: unit.named(text).variable(dims, data[name]) for name, text in words.items()},
        {"place": data.place, "sensor": data.sensor, "block": data.block},
    )
    drawn = _thinned(shown)
    at, x = _axis(drawn)
    panels = []
    for name in data.sensor.values.tolist():
        one = drawn.sel(sensor=name)
        low, high = (unit.values(one.measured + s * 2.0 * one.deviation) for s in (-1.0, 1.0))
        known = np.isfinite(low)
        marks = (
            fig.band(at[known], low[known], high[known], color=fig.MEASURED, key="recorded ± 2 s"),
            fig.Line(at, unit.values(one.before), color=fig.QUIET, dash="dashed", key="before"),
            fig.Line(at, unit.values(one.after), color=fig.OURS, key="after"),
        )
        panels.append(fig.Panel(title=name, marks=marks, x=x, y=fig.Axis(label=unit.unit_text)))
    what = FITTED.get(by, "amplitudes").capitalize()
    plot = Plot(
        fig.Figure(panels=fig.in_grid(panels, 3, share="x"), height=210.0),
        f"Recorded and computed {quantity}.",
        f"{what} before and after the search; band: two standard deviations about the recorded.",
    )
    table = LabelledTable(f"fitted_{quantity}", shown, is_in_json=False)
    return Part(f"{quantity.capitalize()}: recorded and computed", (plot, table))


def _thinned(data: xr.Dataset) -> xr.Dataset:
    """Return some of many places for a picture, evenly chosen."""
    return data.isel(place=slice(None, None, max(1, data.sizes["place"] // MOST_DRAWN)))


def _axis(data: xr.Dataset) -> tuple[FloatArray, fig.Axis]:
    """Return the numbers of the places, and the axis that names some of them."""
    at = np.arange(data.sizes["place"], dtype=float)
    step = max(1, len(at) // 6)
    ticks = fig.named(data.place.values[::step].tolist(), at[::step].tolist())
    return at, fig.Axis(ticks=ticks)


def _residuals(data: xr.Dataset) -> Part:
    drawn = _thinned(data)
    at, x = _axis(drawn)
    colors = fig.COLOURS * (1 + data.sizes["sensor"] // len(fig.COLOURS))
    lines = [
        fig.Line(at, MISFIT.values(drawn.misfit.sel(sensor=name)), color=color, key=name)
        for name, color in zip(data.sensor.values.tolist(), colors, strict=False)
    ]
    panel = fig.Panel(
        marks=(fig.Rule(0.0, color=fig.MARK), *lines),
        x=x,
        y=fig.Axis(label=MISFIT.label),
    )
    plot = Plot(
        fig.Figure(panels=(panel,), height=280.0),
        "Residuals of the fit.",
        "Computed less recorded after the search, in standard deviations.",
    )
    return Part("Residuals", (plot, LabelledTable("residuals", data[["misfit"]], is_in_json=False)))


def _errors(fit: Fit, data: xr.Dataset) -> Part:
    errors = xr.Dataset(
        {
            name: ERROR.named(name).variable("sensor", data[f"error_{name}"])
            for name in ("before", "after")
        },
        {"sensor": data.sensor},
    )
    table = LabelledTable(
        "sensors",
        errors,
        "Errors of the sensors",
        "RMS of the difference, by that of what was recorded.",
        is_in_terminal=True,
    )
    return Part("Errors of the sensors", (table, verdict_table(fit, data)))
