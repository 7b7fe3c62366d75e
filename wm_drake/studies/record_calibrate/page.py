"""Show a calibration to recordings: values, residuals, and how well the machine then agrees."""

from collections.abc import Sequence

import numpy as np
import xarray as xr

from wm_drake.parameters import machine_yaml
from wm_drake.parameters.units import Share
from wm_drake.report import figure as fig
from wm_drake.report.formatting import listed
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import Quantity
from wm_drake.studies.answer import Answer, Part, Plot, pictures_first
from wm_drake.studies.compare.pairs import QUANTITIES, Pair
from wm_drake.studies.fitting.fit import Fit, verdict_of
from wm_drake.studies.fitting.page import fit_parts, search_facts
from wm_drake.studies.record_calibrate.study import MISFIT, RecordModel, calibrated_machine

ERROR = Quantity("error", Share(), 1)


def record_calibrate_answer(model: RecordModel, fit: Fit, data: xr.Dataset) -> Answer:
    """Return the answer of the calibration.

    Args:
        fit, data: As of `calibrated` in `wm_drake.studies.record_calibrate.study`.
    """
    parameters = model.parameters
    files = ", ".join(pair.recording.path.name for pair in model.pairs)
    search, values, *others = fit_parts(fit, MISFIT)
    parts: list[Part] = []
    for quantity in QUANTITIES:
        names = [n for n, sensor in model.sensors.items() if sensor.quantity == quantity]
        if names:
            parts.append(_amplitudes(data.sel(sensor=names), quantity))
    machine = calibrated_machine(parameters, model.sought, fit, files)
    return Answer(
        f"Machine {parameters.name} calibrated to records",
        summary(fit, data, model.pairs),
        parameters,
        pictures_first([*parts, _residuals(data), _errors(data), search, values, *others]),
        (("Records", files), ("Load", model.case.name), ("Fitted", model.by), *search_facts(fit)),
        files={"calibrated.yaml": machine_yaml(machine)},
        warned=tuple(warnings_of(fit, data)),
    )


def _missed(data: xr.Dataset) -> float:
    return float(np.sqrt(np.nanmean(data.error_after.values**2)))


def summary(fit: Fit, data: xr.Dataset, pairs: Sequence[Pair]) -> str:
    """Return how well the machine fits, and what the records determine."""
    known = [e.name for e in fit.estimates if e.determined]
    others = [e.name for e in fit.estimates if not e.determined]
    before = float(np.sqrt(np.nanmean(data.error_before.values**2)))
    records = "1 record" if len(pairs) == 1 else f"{len(pairs)} records"
    text = (
        f"{verdict_of(_missed(data)).capitalize()} fit to {records}: "
        f"the amplitudes miss the recorded ones by {ERROR.text(_missed(data))}, before by "
        f"{ERROR.text(before)}, or by {MISFIT.number(fit.rmse)} standard deviations."
    )
    if verdict_of(_missed(data)) == "poor":
        text += " The machine does not describe the records: do not use the values."
    if known:
        text += f" Determined: {listed(known)}."
    return f"{text} Not determined: {listed(others)}." if others else text


def warnings_of(fit: Fit, data: xr.Dataset) -> list[str]:
    """Return a warning of a poor fit, and of each search that ended at a bound."""
    warnings = []
    if verdict_of(_missed(data)) == "poor":
        warnings.append(
            "Poor fit: the structure of the model, the load or a sensor is not that of the test; "
            "the values are not those of the machine."
        )
    return warnings + [
        f"The search for {e.name} ended at its {e.at_bound} bound. Widen the range, or check "
        "whether the model is right."
        for e in fit.estimates
        if e.at_bound
    ]


def _amplitudes(data: xr.Dataset, quantity: str) -> Part:
    """Return recorded and computed amplitudes of the sensors of a quantity."""
    unit, dims = QUANTITIES[quantity], ("place", "sensor")
    words = {"measured": "recorded", "deviation": "±", "before": "before", "after": "after"}
    shown = xr.Dataset(
        {name: unit.named(text).variable(dims, data[name]) for name, text in words.items()},
        {"place": data.place, "sensor": data.sensor},
    )
    at = np.arange(data.sizes["place"])
    step = max(1, len(at) // 6)
    ticks = fig.named(data.place.values[::step].tolist(), at[::step].tolist())
    panels = []
    for name in data.sensor.values.tolist():
        one = shown.sel(sensor=name)
        low, high = (unit.values(one.measured + s * 2.0 * one.deviation) for s in (-1.0, 1.0))
        known = np.isfinite(low)
        marks = (
            fig.band(at[known], low[known], high[known], color=fig.MEASURED, key="recorded ± 2 s"),
            fig.Line(at, unit.values(one.before), color=fig.QUIET, dash="dashed", key="before"),
            fig.Line(at, unit.values(one.after), color=fig.OURS, key="after"),
        )
        panels.append(
            fig.Panel(
                title=name, marks=marks, x=fig.Axis(ticks=ticks), y=fig.Axis(label=unit.unit_text)
            )
        )
    plot = Plot(
        fig.Figure(panels=fig.in_grid(panels, 3, share="x"), height=210.0),
        f"Recorded and computed amplitudes of {quantity}.",
        "Amplitudes before and after the search; band: two standard deviations about the recorded.",
    )
    table = LabelledTable(f"amplitudes_{quantity}", shown, is_in_json=False)
    return Part(f"{quantity.capitalize()}: recorded and computed", (plot, table))


def _residuals(data: xr.Dataset) -> Part:
    at = np.arange(data.sizes["place"])
    step = max(1, len(at) // 8)
    ticks = fig.named(data.place.values[::step].tolist(), at[::step].tolist())
    colors = fig.COLOURS * (1 + data.sizes["sensor"] // len(fig.COLOURS))
    lines = [
        fig.Line(at, MISFIT.values(data.misfit.sel(sensor=name)), color=color, key=name)
        for name, color in zip(data.sensor.values.tolist(), colors, strict=False)
    ]
    panel = fig.Panel(
        marks=(fig.Rule(0.0, color=fig.MARK), *lines),
        x=fig.Axis(ticks=ticks),
        y=fig.Axis(label=MISFIT.label),
    )
    plot = Plot(
        fig.Figure(panels=(panel,), height=280.0),
        "Residuals of the fit.",
        "Computed less recorded amplitude after the search, in standard deviations.",
    )
    return Part("Residuals", (plot, LabelledTable("residuals", data[["misfit"]], is_in_json=False)))


def _errors(data: xr.Dataset) -> Part:
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
        "RMS of the difference of the amplitudes, by that of the recorded ones.",
        is_in_terminal=True,
    )
    return Part("Errors of the sensors", (table,))
