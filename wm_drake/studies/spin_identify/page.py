"""Show an identification from a spin cycle: values found, and how well they fit."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from wm_drake.parameters import machine_yaml
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Share
from wm_drake.report import figure as fig
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import HIDDEN, Quantity, shown, text_of, units_of
from wm_drake.studies.answer import Answer, Part, Plot
from wm_drake.studies.fitting.fit import Fit, verdict_of
from wm_drake.studies.fitting.page import estimates_of, fit_parts, of_unknowns, search_facts
from wm_drake.studies.fitting.sought import Sought
from wm_drake.studies.spin_cycle.figures import bars_figure
from wm_drake.studies.spin_cycle.findings import case_description, missing_warnings
from wm_drake.studies.spin_cycle.page import profile_plot
from wm_drake.studies.spin_cycle.tables import rms_table
from wm_drake.studies.spin_identify.study import (
    KNOWN,
    RELATIVE_ERROR,
    RESIDUAL,
    SpinModel,
    identified_machine,
)

VIRTUAL = (
    "This is a virtual experiment: nothing was measured. A machine with randomly planted values "
    "was simulated in place of a real one, and the search did not use these values. "
)
"""First sentences of the summary of a virtual experiment."""

WITHIN = f"±{Quantity('', Share(), 0).text(KNOWN)} (95 % confidence interval)"


def spin_identify_answer(
    model: SpinModel, fit: Fit, identified: xr.Dataset, planted: FloatArray | None
) -> Answer:
    """Return the answer of the study.

    Args:
        fit, identified: As of `identify_from_spin` in `wm_drake.studies.spin_identify.study`.
        planted: True numbers of a virtual experiment; None for a real one. [SI]
    """
    is_virtual = planted is not None
    names = [sought.unknown.name for sought in model.sought]
    truth = dict(zip(names, planted, strict=True)) if planted is not None else None
    bars = [_bars(model, identified, index) for index in range(len(model.cases))]
    search, estimates, *parts = fit_parts(fit, RELATIVE_ERROR, truth)
    return Answer(
        f"Parameters of machine {model.parameters.name} identified from a spin cycle",
        summary(model, identified, is_virtual=is_virtual),
        model.parameters,
        (
            Part(
                "Measured and fitted",
                (
                    *bars,
                    rms_table("measured", identified.measured),
                    rms_table("rms", identified.after),
                ),
            ),
            Part("Residuals", residuals_shown(identified)),
            Part("Spin profile", (profile_plot(model.profile),)),
            search,
            Part(
                "Values found",
                (_parameters(model, fit, identified, truth),),
                remarks=estimates.remarks,
            ),
            _errors(model, identified, is_virtual=is_virtual),
            *parts,
        ),
        (
            ("SDF model", Path(model.parameters.model).name),
            *search_facts(fit),
            ("Runs of a point", str(len(model.cases))),
            (
                "Objective",
                "root mean square of |measured − computed|, divided by the norm of the measured "
                "values of the same case and region, [A] Eq. (9)",
            ),
        ),
        files={
            "identified.yaml": machine_yaml(identified_machine(model, fit, is_virtual=is_virtual))
        },
        warned=tuple(warnings_of(fit, identified)),
    )


def summary(model: SpinModel, identified: xr.Dataset, *, is_virtual: bool) -> str:
    """Return one paragraph about what the data determine and how well the machine agrees."""
    is_known = identified.is_identified.values
    count, known = len(is_known), int(is_known.sum())
    unknowns_were = f"{count} unknown{'s were' if count > 1 else ' was'}"
    cases = f"{len(model.cases)} case{'s' if len(model.cases) > 1 else ''}"
    text = (
        f"{VIRTUAL if is_virtual else ''}{judged(identified)} {unknowns_were} fitted to the RMS "
        f"displacements of {cases}. The data determine {known} of {count} to within {WITHIN}."
    )
    if is_virtual and known:
        worst = np.abs(identified.error.values[is_known]).max()
        text += (
            " The determined unknowns differ from their planted values by at most "
            f"{RELATIVE_ERROR.text(worst)}."
        )
    text += (
        " The search reduced the average error of an RMS displacement from "
        f"{text_of(identified.average_error_before)} to {text_of(identified.average_error_after)}."
    )
    left = identified["unknown"].values[~is_known].tolist()
    return f"{text} Not determined to this accuracy: {', '.join(left)}." if left else text


def _verdict(identified: xr.Dataset) -> str:
    """Return whether the machine with the identified numbers fits the measured displacements."""
    return verdict_of(identified.average_error_after.item())


def judged(identified: xr.Dataset) -> str:
    """Return the verdict on the fit as a sentence."""
    verdict = _verdict(identified)
    text = (
        f"{verdict.capitalize()} fit: the computed RMS displacements miss the measured ones by "
        f"{text_of(identified.average_error_after)} on average."
    )
    if verdict == "poor":
        text += " The machine does not describe the measurement: do not use the values identified."
    return text


def warnings_of(fit: Fit, identified: xr.Dataset) -> list[str]:
    """Return a warning for a fit that is not good and for each search that ended at a bound."""
    warnings = [] if _verdict(identified) == "good" else [judged(identified)]
    warnings += missing_warnings(identified.after, identified.measured)
    return warnings + [
        f"The search for {e.name} ended at its {e.at_bound} bound. Widen the range, or check "
        "whether the model is right."
        for e in fit.estimates
        if e.at_bound
    ]


def _parameters(
    model: SpinModel, fit: Fit, identified: xr.Dataset, truth: dict[str, float] | None
) -> LabelledTable:
    """Return the estimates with a row for each key of the machine file."""
    unknowns = [sought.unknown for sought in model.sought]
    units = {unknown.name: unknown.unit for unknown in unknowns}
    starts = [np.nan if unknown.start is None else unknown.start for unknown in unknowns]
    rows = estimates_of(fit, truth).assign(before=of_unknowns("before", units, starts))
    accuracy = [name for name in ("half_width", "error", "is_identified") if name in identified]
    for name in accuracy:
        rows[name] = identified[name].variable
    for name in ("lower_bound", "upper_bound"):
        rows[name].attrs[HIDDEN] = True
    first = ["before", *(["planted"] if truth else []), "value", "lower_95", "upper_95"]
    return LabelledTable(
        "parameters",
        of_keys(rows[[*first, *accuracy, "remark", "lower_bound", "upper_bound"]], model.sought),
        "Values found",
        "Values of the unknowns, each in its unit, with 95 % confidence intervals; keys of one "
        f"unknown have the same value. Bold: determined to within {WITHIN}.",
        marked=("is_identified", "ours"),
        is_in_terminal=True,
    )


def of_keys(estimates: xr.Dataset, sought: Sequence[Sought]) -> xr.Dataset:
    """Return numbers over `unknown` with a line for each key of the machine file."""
    owners = [index for index, one in enumerate(sought) for _ in one.keys]
    units = {key: one.unknown.unit for one in sought for key in one.keys}
    rows = estimates.isel(unknown=owners).assign_coords(unknown=list(units))
    for name, variable in rows.items():
        if units_of(estimates[name]) is not None:
            words = variable.attrs["quantity"].words
            rows[name] = of_unknowns(words, units, variable.values)
            rows[name].attrs |= {HIDDEN: True} if HIDDEN in variable.attrs else {}
    return rows


def residuals_shown(identified: xr.Dataset) -> tuple[Plot, LabelledTable]:
    """Return the residual of each sensor and axis in each region, with a panel for each case."""
    regions, directions = identified.region.values.tolist(), identified.axis.values.tolist()
    x = fig.Axis(ticks=fig.named(regions), range=(-0.6, len(regions) - 0.4), has_grid=False)
    panels = []
    for case in identified.case.values.tolist():
        marks: list[fig.Mark] = [fig.Rule(0.0, color=fig.MARK)]
        for direction, color in zip(directions, fig.COLOURS, strict=False):
            sizes = shown(identified.residual.sel(case=case, axis=direction))  # region, sensor
            at = np.broadcast_to(np.arange(len(regions))[:, None], sizes.shape)
            marks.append(fig.Points(at.ravel(), sizes.ravel(), color=color, key=direction))
        title, y = f"case {case}", fig.Axis(label=RESIDUAL.label)
        panels.append(fig.Panel(title=title, marks=tuple(marks), x=x, y=y))
    caption = (
        "Computed less measured RMS displacement with the values found, by the norm of what was "
        "measured in the case and region: what the search makes small. A point for each sensor."
    )
    figure = fig.Figure(panels=fig.in_grid(panels, 1), height=190.0)
    residuals = identified.residual.rename(accelerometer="sensor").to_dataset(name="residual")
    return Plot(figure, "Residuals of each region.", caption), LabelledTable("residuals", residuals)


def _errors(model: SpinModel, identified: xr.Dataset, *, is_virtual: bool) -> Part:
    """Return the errors of each case, and for files the average error and the verdict."""
    cases = identified[["error_before", "error_after"]].assign(
        about=("case", [case_description(case) for case in model.cases])
    )
    errors = LabelledTable(
        "cases",
        cases[["about", "error_before", "error_after"]],
        "Errors of the cases",
        "Relative error, [A] Eq. (9), with norms over sensors and axes: mean over the regions, "
        "before and after the search.",
    )
    numbers = identified[["average_error_before", "average_error_after"]].assign(
        verdict=((), _verdict(identified)), is_virtual_experiment=((), is_virtual)
    )
    return Part("Errors", (errors, LabelledTable("numbers", numbers)))


def _bars(model: SpinModel, identified: xr.Dataset, index: int) -> Plot:
    case = model.cases[index]
    of_case = identified.sel(case=case.name)
    title = f"Case {case.name}: {case_description(case)}"
    return Plot(
        bars_figure(of_case.after, None, of_case.measured),
        f"{title}.",
        f"{title}. RMS displacement per region, computed with the values found and measured.",
    )
