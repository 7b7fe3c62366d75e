"""Report page and tables of an identification of a component."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from wm_drake.parameters.units import Unit
from wm_drake.report.formatting import MISSING, number
from wm_drake.report.identify.figures import history_figure, loops_figure, motion_text
from wm_drake.report.page import picture, render
from wm_drake.report.rig.figures import force_scale, motion_scale
from wm_drake.report.tables import Group, Row, Table
from wm_drake.rigs.measured import HarmonicMotion, MeasuredMotion, RecordedMotion
from wm_drake.studies.fitting import Estimate, Fit
from wm_drake.studies.identification import Judgement
from wm_drake.studies.identification.judgement import per_cent
from wm_drake.studies.identification.models import unit_of_field


def identify_report(
    title: str,
    fit: Fit,
    motions: Sequence[MeasuredMotion],
    judgement: Judgement,
    fixed: Mapping[str, float],
    command: str = "",
) -> str:
    """Return the report as text of one self-contained HTML file.

    Args:
        title: Component and law, for the heading.
        fit: Result of the fit.
        motions: Measured motions of the fit.
        judgement: Judgement of the fit.
        fixed: Numbers that were not searched, by name. [SI]
        command: Command line of the identification, shown on the page.
    """
    alternative = "Measured samples and the fitted loop, one panel per file"
    return render(
        "identify/page.html",
        title=f"Identification of {title}",
        about=f"Fit to {len(motions)} measured loop{'s' if len(motions) > 1 else ''}.",
        warnings=_warnings(fit, judgement),
        summary=_summary(fit, motions, judgement),
        estimates=_estimates(fit, fixed),
        undetermined=undetermined_sentences(fit),
        pictures=[
            picture(
                loops_figure(fit, motions, over=over),
                f"{alternative}, over {over}.",
                f"Force over {over}: measured samples and fitted loop. The offset and drift of the "
                "instrument are removed from both.",
            )
            for over in ("displacement", "velocity")
        ],
        errors=_errors(fit, motions, judgement),
        history=picture(
            history_figure(fit, force_scale(motions[0].loop.rotates)[1]),
            "Smallest RMSE after each round of the search.",
            "Smallest RMSE that was found up to the end of each round of the search.",
        )
        if fit.history
        else None,
        correlations=_correlations(fit) if fit.estimates else None,
        facts=[
            ("Method", fit.method),
            ("Seed", str(fit.seed)),
            ("Evaluated points", str(fit.evaluations)),
            ("Condition number", f"{fit.condition:.3g}"),
            *(("Motion", text) for text in motion_sentences(motions)),
            *(("Note", note) for note in fit.notes),
            ("Command", command),
        ],
    )


def estimate_cells(
    fit: Fit, fixed: Mapping[str, float] | None = None
) -> list[tuple[str, str, str, str, str]]:
    """Return name, value, interval, unit and remark of each unknown and fixed number as text."""
    found = []
    for e, unknown in zip(fit.estimates, fit.problem.unknowns, strict=True):
        unit = unknown.unit
        text = f"{unit.from_si(e.value):.5g}" if e.determined else MISSING
        interval = MISSING
        if np.isfinite(e.lower):
            interval = f"{unit.from_si(e.lower):.5g} to {unit.from_si(e.upper):.5g}"
        found.append((e.name, text, interval, unit.shown.replace("*", " "), _remark(e)))
    for name, value, unit in _shown_fixed(fixed or {}):
        found.append((name, f"{value:.5g}", MISSING, unit.shown.replace("*", " "), FIXED))
    return found


FIXED = "fixed"
"""Remark on a number that was not searched."""


def _shown_fixed(fixed: Mapping[str, float]) -> list[tuple[str, float, Unit]]:
    """Return fixed numbers in their unit for reading."""
    units = {name: unit_of_field(name) for name in fixed}
    return [(name, unit.from_si(fixed[name]), unit) for name, unit in units.items() if unit]


def fixed_numbers(fixed: Mapping[str, float]) -> dict[str, dict[str, Any]]:
    """Return fixed numbers for JSON, in SI."""
    return {name: {"value": fixed[name], "unit": unit.si} for name, _, unit in _shown_fixed(fixed)}


def _remark(e: Estimate) -> str:
    if not e.determined:
        return "not determined by the data"
    return f"at its {e.at_bound} bound" if e.at_bound else ""


def undetermined_sentences(fit: Fit) -> list[str]:
    """Return a sentence for each unknown, or joint change of unknowns, that is not determined."""
    found = []
    for direction in fit.undetermined:
        if len(direction.names) == 1:
            found.append(
                f"{direction.names[0]} can take any value within its bounds without a visible "
                "change of the loops."
            )
        else:
            parts = ", ".join(
                f"{name} {part:+.2g}"
                for name, part in zip(direction.names, direction.parts, strict=True)
            )
            found.append(
                "These unknowns can change together, by the given fractions of their ranges, "
                f"without a visible change of the loops: {parts}."
            )
    return found


def estimates_table(fit: Fit, fixed: Mapping[str, float] | None = None) -> pd.DataFrame:
    """Return value, interval and bounds of each unknown, and each fixed number, for reading."""
    rows: list[dict[str, Any]] = []
    for e, unknown in zip(fit.estimates, fit.problem.unknowns, strict=True):
        shown = [
            unknown.unit.from_si(v) if np.isfinite(v) else np.nan
            for v in (e.value, e.lower, e.upper)
        ]
        rows.append(
            {
                "unknown": e.name,
                "value": shown[0] if e.determined else np.nan,
                "lower_95": shown[1],
                "upper_95": shown[2],
                "unit": unknown.unit.shown,
                "lower_bound": unknown.unit.from_si(unknown.lower),
                "upper_bound": unknown.unit.from_si(unknown.upper),
                "remark": _remark(e),
            }
        )
    rows += [
        {"unknown": name, "value": value, "unit": unit.shown, "remark": FIXED}
        for name, value, unit in _shown_fixed(fixed or {})
    ]
    return pd.DataFrame(rows)


def errors_table(fit: Fit, motions: Sequence[MeasuredMotion], judgement: Judgement) -> pd.DataFrame:
    """Return the RMSE of each test, as [A] Tables 2, 4, 5 and 7, with noise and lack of fit."""
    rows = []
    for test, measured, judged in zip(fit.tests, motions, judgement.loops, strict=True):
        factor, _, unit = motion_scale(measured.loop.rotates)
        force = force_scale(measured.loop.rotates)[1].replace(" ", "")
        rows.append(
            {
                "file": measured.loop.path,
                "frequency_hz": frequency_of(measured),
                f"amplitude_{unit}": factor * measured.stroke,
                f"rmse_{force}": test.rmse,
                "rmse_by_largest_force": test.normalised,
                f"noise_{force}": judged.noise,
                "lack_of_fit_by_rms_force": judged.missed,
                "work_per_cycle_J": judged.work,
            }
        )
    return pd.DataFrame(rows)


def motion_sentences(motions: Sequence[MeasuredMotion]) -> list[str]:
    """Return a sentence for each test whose own displacement drives the law, on its smoothing."""
    found = []
    for m in motions:
        if not isinstance(m, RecordedMotion):
            continue
        factor, _, unit = motion_scale(m.loop.rotates)
        smoothing = (
            f"smoothed by a cubic spline that halves a motion at {m.cutoff:.3g} Hz; "
            f"{factor * m.noise:.2g} {unit} (root mean square) is taken out as noise"
            if np.isfinite(m.cutoff)
            else "interpolated by a cubic spline without smoothing"
        )
        begin = (
            "a sponge begins in the steady state of the first period"
            if m.repeats
            else "a sponge begins without deformation"
        )
        found.append(
            f"{m.loop.name} is no sine: its displacement drives the law as recorded, {smoothing}; "
            f"{begin}."
        )
    return found


def frequency_of(measured: MeasuredMotion) -> float:
    """Return the frequency of a sine; NaN for another motion. [Hz]"""
    return measured.motion.frequency if isinstance(measured, HarmonicMotion) else float("nan")


def fitted_loops(fit: Fit, motions: Sequence[MeasuredMotion]) -> pd.DataFrame:
    """Return the measured and the fitted force at every sample. [SI]"""
    parts = [
        pd.DataFrame(
            {
                "file": measured.loop.name,
                "time_s": measured.loop.time,
                "phase_rad": measured.phase if isinstance(measured, HarmonicMotion) else np.nan,
                "measured": measured.loop.force,
                "fitted": fit.computed[where],
            }
        )
        for measured, where in zip(motions, fit.problem.slices, strict=True)
    ]
    return pd.concat(parts, ignore_index=True)


def _estimates(fit: Fit, fixed: Mapping[str, float]) -> Table:
    groups = tuple(
        Group(name, (Row(cells),))
        for name, *cells_ in estimate_cells(fit, fixed)
        for cells in [tuple(cells_)]
    )
    caption = (
        "Estimated values with 95 % confidence intervals. There is no interval if the value is at "
        "a bound, if the data do not determine it or if it was fixed."
    )
    return Table(
        caption, ("unknown", "value", "95 % interval", "unit", "remark"), groups, text_columns=5
    )


def _errors(fit: Fit, motions: Sequence[MeasuredMotion], judgement: Judgement) -> Table:
    unit = force_scale(motions[0].loop.rotates)[1]
    groups = tuple(
        Group(
            measured.loop.name,
            (
                Row(
                    (
                        motion_text(measured),
                        str(len(measured.position)),
                        f"{test.rmse:.4g}",
                        number(test.normalised, 4),
                        f"{judged.noise:.2g}",
                        per_cent(judged.missed),
                    )
                ),
            ),
        )
        for test, measured, judged in zip(fit.tests, motions, judgement.loops, strict=True)
    )
    name = force_scale(motions[0].loop.rotates)[0]
    caption = (
        "Root mean square error (RMSE) of each test, absolute and relative to the largest measured "
        f"{name}, as [A] Tables 2, 4, 5 and 7. The noise follows from the differences between "
        "samples of nearly the same phase. The lack of fit is what the noise does not explain, "
        f"relative to the root mean square of the measured {name}."
    )
    return Table(
        caption,
        (
            "file",
            "motion",
            "samples",
            f"RMSE, {unit}",
            f"RMSE / largest {name}",
            f"noise, {unit}",
            "lack of fit",
        ),
        groups,
        text_columns=2,
    )


def _correlations(fit: Fit) -> Table:
    deviation = np.sqrt(np.diag(fit.covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = fit.covariance / np.outer(deviation, deviation)
    names = [e.name for e in fit.estimates]
    groups = tuple(
        Group(
            name,
            (
                Row(
                    (
                        f"{u.unit.from_si(s):.3g} {u.unit.shown.replace('*', ' ')}"
                        if np.isfinite(s)
                        else MISSING,
                        *(number(value, 2) for value in row),
                    )
                ),
            ),
        )
        for name, u, s, row in zip(names, fit.problem.unknowns, deviation, correlation, strict=True)
    )
    caption = "Standard deviations of the unknowns, and the correlations between them."
    return Table(caption, ("unknown", "standard deviation", *names), groups, text_columns=2)


def _warnings(fit: Fit, judgement: Judgement) -> list[str]:
    # A rise of a monotone curve that is zero means a flat piece, which needs no warning.
    flat = [e.name for e in fit.estimates if ".rise_" in e.name and e.at_bound == "lower"]
    is_good = judgement.verdict == "good"
    found = [*judgement.sentences[1 if is_good else 0 :]]
    found += [
        f"The value of {e.name} is at its {e.at_bound} bound."
        for e in fit.estimates
        if e.at_bound and e.name not in flat
    ]
    unknown = [e.name for e in fit.estimates if not e.determined]
    if unknown:
        found.append(f"The data do not determine {', '.join(unknown)}.")
    return found


def _summary(fit: Fit, motions: Sequence[MeasuredMotion], judgement: Judgement) -> str:
    name, unit = force_scale(motions[0].loop.rotates)
    normalised = [test.normalised for test in fit.tests]
    determined = sum(e.determined for e in fit.estimates)
    least, most = (per_cent(value) for value in (min(normalised), max(normalised)))
    opening = judgement.sentences[0] + " " if judgement.verdict == "good" else ""
    if not fit.estimates:
        ending = "All numbers were given; nothing was searched."
    elif judgement.verdict == "poor":
        ending = (
            f"The data give a best value of {determined} of {len(fit.estimates)} unknowns, but the "
            "law does not describe the loops."
        )
    else:
        ending = f"The data determine {determined} of {len(fit.estimates)} unknowns."
    return (
        f"{opening}The root mean square difference (RMSE) between fitted and measured loops is "
        f"{fit.rmse:.3g} {unit} over all samples. For single tests it is {least} to {most} of "
        f"the largest {name}. {ending}"
    )
