"""Show a fit to measured values of runs: values, residuals, how well the machine then agrees."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

from wm_drake.parameters import machine_yaml
from wm_drake.parameters.units import Share
from wm_drake.report import chart
from wm_drake.report import figure as fig
from wm_drake.report.formatting import listed
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import Quantity
from wm_drake.studies.answer import Answer, Part, Plot, pictures_first
from wm_drake.studies.calibrate.blocks import BlockModel
from wm_drake.studies.fitting.fit import Fit, verdict_of
from wm_drake.studies.fitting.page import fit_parts, search_facts

ERROR = Quantity("error", Share(), 1)

MOST_DRAWN = 1500
"""Number of places of a picture from which on some are left out."""

WRONG = (
    "This is more than noise and repeats explain: the structure of the model, the load or a sensor "
    "is not that of the test"
)


@dataclass(frozen=True)
class FitWords:
    """Texts of the answer of a fit.

    Attributes:
        title: Title of the page.
        file: Name of the file of the machine with the values found, without suffix.
        data: What was fitted to, such as "2 records".
        fitted: What is compared, such as "amplitudes".
        source: Where the values come from, for the machine file.
        method: What the residuals are, and what is unknown beside the numbers of the machine.
        facts: Facts for the foot of the page.
        notice: First sentences of the answer; empty without any.
    """

    title: str
    file: str
    data: str
    fitted: str
    source: str
    method: str
    facts: tuple[tuple[str, str], ...] = ()
    notice: str = ""


def fit_answer(
    model: BlockModel,
    fit: Fit,
    data: xr.Dataset,
    words: FitWords,
    parts: Sequence[Part],
    truth: Mapping[str, float] | None = None,
    warned: Sequence[str] = (),
) -> Answer:
    """Return the answer of a fit to measured values.

    Args:
        fit, data: As of `calibrated` in `wm_drake.studies.calibrate.blocks`.
        parts: Parts that show what was measured and computed.
        truth: True values of the unknowns of a virtual experiment. [SI]
        warned: Warnings beside those of the fit.
    """
    search, values, *others = fit_parts(fit, model.misfit, truth)
    shown = [*parts, _residuals(data), _errors(model, fit, data, truth), search, values, *others]
    return Answer(
        words.title,
        summary(model, fit, data, words, truth),
        model.experiment.machine.parameters,
        pictures_first(shown),
        (*words.facts, *search_facts(fit)),
        words.method,
        files={f"{words.file}.yaml": machine_yaml(model.free.solved(fit, words.source))},
        warned=(*warned, *warnings_of(model, fit, data)),
    )


def _is_wrong(model: BlockModel, fit: Fit, data: xr.Dataset) -> bool:
    return verdict_of(model.missed(data)["after"]) == "poor" or fit.rmse > model.most_misfit


def summary(
    model: BlockModel,
    fit: Fit,
    data: xr.Dataset,
    words: FitWords,
    truth: Mapping[str, float] | None = None,
) -> str:
    """Return how well the machine fits, and what the data determine."""
    missed = model.missed(data)
    verdict = verdict_of(missed["after"])
    text = (
        f"{words.notice}{verdict.capitalize()} fit to {words.data}: the {words.fitted} miss the "
        f"measured ones by {ERROR.text(missed['after'])}, before by "
        f"{ERROR.text(missed['before'])}, {model.apart(fit.rmse)}."
    )
    if verdict == "poor":
        text += " The machine does not describe what was measured: do not use the values."
    elif fit.rmse > model.most_misfit:
        text += f" {WRONG}; the values make up for it."
    pairs = list(zip(fit.estimates, model.free.unknowns, strict=False))
    values = [f"{e.name} {Quantity('', u.unit).text(e.value)}" for e, u in pairs if e.determined]
    others = [e.name for e, _ in pairs if not e.determined]
    text += f" Determined: {listed(values)}." if values else ""
    text += f" Not determined: {listed(others)}." if others else ""
    known = [e.value / truth[e.name] - 1.0 for e, _ in pairs if e.determined] if truth else []
    if known:
        most = ERROR.text(float(np.abs(known).max()))
        text += f" Values that are determined differ from those planted by at most {most}."
    return text


def warnings_of(model: BlockModel, fit: Fit, data: xr.Dataset) -> list[str]:
    """Return a warning of a wrong structure, and of each unknown that is at a bound."""
    warnings = (
        [f"{WRONG}; the values are not those of the machine."]
        if _is_wrong(model, fit, data)
        else []
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


def compared(data: xr.Dataset, quantity: Quantity, what: str, is_scattered: bool = True) -> Part:
    """Return what was measured and computed of the sensors of a quantity.

    Args:
        what: Word for what is fitted.
        is_scattered: Whether the deviations are those of the measured values.
    """
    dims = "place", "sensor"
    words = {"measured": "recorded", "deviation": "±", "before": "before", "after": "after"}
    shown = xr.Dataset(
        {
            name: quantity.named(text).variable(dims, data[name])
            for name, text in words.items()
            if is_scattered or name != "deviation"
        },
        {"place": data.place, "sensor": data.sensor, "block": data.block},
    )
    drawn, x = _thinned(shown)
    lines: dict[str, dict[str, Any]] = {
        "measured": {"color": fig.MEASURED, "key": "recorded"},
        "before": {"color": fig.QUIET, "dash": "dashed", "key": "before"},
        "after": {"color": fig.OURS, "key": "after"},
    }
    panels = []
    for name in data.sensor.values.tolist():
        one, below = drawn.sel(sensor=name), list[fig.Mark]()
        if is_scattered:
            low, high = (
                quantity.values(one.measured + s * 2.0 * one.deviation) for s in (-1.0, 1.0)
            )
            known, key = np.isfinite(low), "recorded ± 2 s"
            at = one.number.values[known]
            below = [fig.band(at, low[known], high[known], color=fig.MEASURED, key=key)]
        above = {line: lines[line] for line in lines if not below or line != "measured"}
        y = {"label": quantity.unit_text}
        panel = chart.between(below, chart.panel(one, "number", above, x=x, y=y))
        panels.append(replace(panel, title=name))
    band = "; band: two standard deviations about the recorded" if is_scattered else ""
    plot = Plot(
        fig.Figure(panels=fig.in_grid(panels, 3, share="x"), height=210.0),
        f"Recorded and computed {quantity.words}.",
        f"{what.capitalize()} before and after the search{band}.",
    )
    table = LabelledTable(f"fitted_{quantity.words}", shown, is_in_json=False)
    return Part(f"{quantity.words.capitalize()}: recorded and computed", (plot, table))


def _thinned(data: xr.Dataset) -> tuple[xr.Dataset, dict[str, Any]]:
    """Return some of many places for a picture, evenly chosen, and the axis that names some.

    The coordinate `number` counts them.
    """
    drawn = data.isel(place=slice(None, None, max(1, data.sizes["place"] // MOST_DRAWN)))
    at = np.arange(drawn.sizes["place"], dtype=float)
    step = max(1, len(at) // 6)
    ticks = fig.named(drawn.place.values[::step].tolist(), at[::step].tolist())
    return drawn.assign_coords(number=("place", at)), {"label": "", "ticks": ticks}


def _residuals(data: xr.Dataset) -> Part:
    drawn, x = _thinned(data)
    lines = chart.panel(
        drawn, "number", ["misfit"], x=x, by="sensor", key=lambda of, _: of.sensor.values.item()
    )
    panel = chart.between([fig.Rule(0.0, color=fig.MARK)], lines)
    plot = Plot(
        fig.Figure(panels=(panel,), height=280.0),
        "Residuals of the fit.",
        "Computed less measured after the search: what it makes small.",
    )
    return Part("Residuals", (plot, LabelledTable("residuals", data[["misfit"]], is_in_json=False)))


def _errors(
    model: BlockModel, fit: Fit, data: xr.Dataset, truth: Mapping[str, float] | None
) -> Part:
    """Return the errors of the sensors, and the verdict on the fit."""
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
        "RMS of the difference, by that of what was measured.",
        is_in_terminal=True,
    )
    missed = model.missed(data)
    numbers = xr.Dataset(
        {
            "verdict": ((), verdict_of(missed["after"])),
            "structure": ((), "wrong" if _is_wrong(model, fit, data) else "not refuted"),
            "misfit": model.misfit.variable((), fit.rmse),
            **{f"average_error_{n}": ERROR.variable((), value) for n, value in missed.items()},
            "is_virtual_experiment": ((), truth is not None),
        }
    )
    return Part("Errors of the sensors", (table, LabelledTable("numbers", numbers)))
