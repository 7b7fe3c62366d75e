"""Page and tables of a fit to the loops of a component."""

import json
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from wm_drake.report.page import Section, SectionedPage, picture
from wm_drake.report.table import Column, Table, table_of
from wm_drake.report.terminal import Printed
from wm_drake.rigs.measured import HarmonicMotion, MeasuredMotion, RecordedMotion
from wm_drake.studies.fitting.fit import Fit
from wm_drake.studies.fitting.page import (
    correlations_table,
    estimates_frame,
    history_picture,
    search_facts,
    undetermined_sentences,
    values_table,
)
from wm_drake.studies.identify.comparison import FittedLaw
from wm_drake.studies.identify.figures import loops_figure, motion_text
from wm_drake.studies.identify.fragment import FittedComponent, fragment
from wm_drake.studies.identify.judgement import Judgement, judge, per_cent
from wm_drake.studies.identify.models import ComponentModel
from wm_drake.studies.rig.units import units_of
from wm_drake.studies.study import Facts, Result

METHOD = (
    "The RMSE is that of [A] Eq. (1) and [C] Eq. (5), over all samples of all files. The offset "
    "and drift of each force signal are removed from its residuals. The offset and drift of each "
    "displacement signal are removed from its motion; the middle of the motion is taken as the "
    "zero position of the component. The intervals are valid if the model is right. They take the "
    "correlation of neighbouring residuals into account. Covariance and condition number follow "
    "from the derivatives of the residuals at the end of the search."
)


def identify_page(result: "FitResult", facts: Facts) -> str:
    """Return the page as text of one self-contained HTML file."""
    fit, motions, judgement = result.fit, result.motions, result.judgement
    loops = tuple(
        picture(
            loops_figure(fit, motions, over=over),
            f"Measured samples and the fitted loop, one panel per file, over {over}.",
            f"Force over {over}: measured samples and fitted loop. The offset and drift of the "
            "instrument are removed from both.",
        )
        for over in ("displacement", "velocity")
    )
    unit = units_of(motions[0].loop.rotates).force_unit
    values = values_table(fit, result.model.fixed_numbers)
    undetermined = " ".join(undetermined_sentences(fit))
    correlations = [correlations_table(fit)] if fit.estimates else []
    sections = [
        Section("loops", "Measured and fitted loops", loops),
        Section("search", "Search", [history_picture(fit, unit)] if fit.log.history else []),
        Section("values", "Values", tables=(values,), text=undetermined),
        Section("errors", "Errors", tables=(_errors(fit, motions, judgement),)),
        Section("correlations", "Correlations", tables=correlations),
    ]
    made = [*search_facts(fit), *(("Motion", text) for text in motion_sentences(motions))]
    return SectionedPage(
        f"Identification of {result.title}",
        _summary(fit, motions, judgement),
        sections,
        [*made, *facts.rows()],
        warnings=_warnings(fit, judgement),
        about=f"Fit to {len(motions)} measured loop{'s' if len(motions) > 1 else ''}.",
        method=METHOD,
    ).html()


def errors_table(fit: Fit, motions: Sequence[MeasuredMotion], judgement: Judgement) -> pd.DataFrame:
    """Return the RMSE of each test, as [A] Tables 2, 4, 5 and 7, with noise and lack of fit."""
    rows = []
    for test, measured, judged in zip(fit.tests, motions, judgement.loops, strict=True):
        units = units_of(measured.loop.rotates)
        rows.append(
            {
                "file": measured.loop.path,
                "frequency_hz": frequency_of(measured),
                f"amplitude_{units.unit}": units.factor * measured.stroke,
                f"rmse_{units.in_heads}": test.rmse,
                "rmse_by_largest_force": test.normalised,
                f"noise_{units.in_heads}": judged.noise,
                "lack_of_fit_by_rms_force": judged.missed,
                "work_per_cycle_J": judged.work,
            }
        )
    return pd.DataFrame(rows)


def motion_sentences(motions: Sequence[MeasuredMotion]) -> list[str]:
    """Return a sentence for each test whose own displacement drives the law, on its smoothing."""
    sentences = []
    for m in motions:
        if not isinstance(m, RecordedMotion):
            continue
        units = units_of(m.loop.rotates)
        smoothing = (
            f"smoothed by a cubic spline that halves a motion at {m.cutoff:.3g} Hz; "
            f"{units.factor * m.noise:.2g} {units.unit} (root mean square) is taken out as noise"
            if np.isfinite(m.cutoff)
            else "interpolated by a cubic spline without smoothing"
        )
        begin = (
            "a sponge begins in the steady state of the first period"
            if m.repeats
            else "a sponge begins without deformation"
        )
        sentences.append(
            f"{m.loop.name} is no sine: its displacement drives the law as recorded, {smoothing}; "
            f"{begin}."
        )
    return sentences


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


def _errors(fit: Fit, motions: Sequence[MeasuredMotion], judgement: Judgement) -> Table:
    units = units_of(motions[0].loop.rotates)
    force, in_heads = units.force, units.in_heads
    columns = {
        "file": Column("file"),
        "motion": Column("motion"),
        "samples": Column("samples", decimals=0),
        f"rmse_{in_heads}": Column("RMSE", units.force_unit),
        "rmse_by_largest_force": Column(f"RMSE / largest {force}", decimals=4),
        f"noise_{in_heads}": Column("noise", units.force_unit),
        "lack_of_fit_by_rms_force": Column("lack of fit"),
    }
    frame = errors_table(fit, motions, judgement).assign(
        file=[measured.loop.name for measured in motions],
        motion=[motion_text(measured) for measured in motions],
        samples=[len(measured.position) for measured in motions],
        lack_of_fit_by_rms_force=[per_cent(judged.missed) for judged in judgement.loops],
    )
    caption = (
        "Root mean square error (RMSE) of each test, absolute and relative to the largest measured "
        f"{force}, as [A] Tables 2, 4, 5 and 7. The noise follows from the differences between "
        "samples of nearly the same phase. The lack of fit is what the noise does not explain, "
        f"relative to the root mean square of the measured {force}."
    )
    return table_of(frame[list(columns)], caption, columns)


def _warnings(fit: Fit, judgement: Judgement) -> list[str]:
    # A rise of a monotone curve that is zero means a flat piece, which needs no warning.
    flat = [e.name for e in fit.estimates if ".rise_" in e.name and e.at_bound == "lower"]
    is_good = judgement.verdict == "good"
    warnings = [*judgement.sentences[1 if is_good else 0 :]]
    warnings += [
        f"The value of {e.name} is at its {e.at_bound} bound."
        for e in fit.estimates
        if e.at_bound and e.name not in flat
    ]
    unknown = [e.name for e in fit.estimates if not e.determined]
    if unknown:
        warnings.append(f"The data do not determine {', '.join(unknown)}.")
    return warnings


def _summary(fit: Fit, motions: Sequence[MeasuredMotion], judgement: Judgement) -> str:
    units = units_of(motions[0].loop.rotates)
    name, unit = units.force, units.force_unit
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


@dataclass(frozen=True)
class IdentifiedResult(Result):
    """Result with identified numbers. CSV files have all digits, but for the samples of loops."""

    component: FittedComponent
    float_format: ClassVar[str | None] = None
    float_formats: ClassVar[Mapping[str, str]] = {"loops": "%.7g"}

    @property
    @abstractmethod
    def laws(self) -> Mapping[str, FittedLaw]:
        """Fitted laws by the names of the machine or component files with their numbers."""

    @abstractmethod
    def fit_as_dict(self) -> dict[str, Any]:
        """Return the fit or the comparison for JSON, in SI."""

    @property
    def title(self) -> str:
        """Component, for headings."""
        return self.component.title

    def as_json(self) -> dict[str, Any]:
        """Return the fit or the comparison for JSON, in SI."""
        return {"component": self.title, **self.fit_as_dict()}

    @property
    def missing(self) -> list[str]:
        """Sentences on files that are not written, because their numbers are not complete."""
        return [
            text for name in self.laws for text in self.component.missing(name, self.laws[name])
        ]

    def texts(self) -> dict[str, str]:
        """Return the identified numbers of each law, and the fit as JSON."""
        files = {}
        for name, law in self.laws.items():
            if not self.component.missing(name, law):
                copies = self.component.copies.get(law.model.law)
                remarks = law.judgement.sentences
                files[name] = fragment(law.fit, law.model, self.component, copies, remarks)
        return files | {"fit.json": json.dumps(self.fit_as_dict(), indent=1)}


@dataclass(frozen=True)
class FitResult(IdentifiedResult):
    """Fit of one law."""

    model: ComponentModel
    fit: Fit
    motions: Sequence[MeasuredMotion]
    page = identify_page

    @property
    def title(self) -> str:
        """Component and law, for headings."""
        return f"{self.component.title}, law {self.model.law}"

    @cached_property
    def judgement(self) -> Judgement:
        """Judgement of the fit."""
        return judge(self.fit, self.motions)

    @property
    def laws(self) -> dict[str, FittedLaw]:
        """The fitted law."""
        return {"identified.yaml": FittedLaw(self.model, self.fit, self.judgement)}

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return the values, the error of each test, and all samples."""
        return {
            "parameters": estimates_frame(self.fit, self.model.fixed_numbers),
            "errors": errors_table(self.fit, self.motions, self.judgement),
            "loops": fitted_loops(self.fit, self.motions),
        }

    def fit_as_dict(self) -> dict[str, Any]:
        """Return the fit for JSON, in SI."""
        return {
            **self.fit.as_dict(),
            "fixed": {
                name: {"value": value, "unit": unit.si}
                for name, value, unit in self.model.fixed_numbers
            },
            "judgement": self.judgement.as_dict(),
        }

    def terminal(self) -> Printed:
        """Return the judgement, the values, and remarks."""
        fit, unit = self.fit, units_of(self.motions[0].loop.rotates).force_unit
        title = f"{self.title}: RMSE {fit.rmse:.4g} {unit} by {fit.log.method}"
        table = values_table(fit, self.model.fixed_numbers).terminal(title)
        remarks = [*undetermined_sentences(fit), *fit.log.notes, *self.missing]
        return [*self.judgement.sentences, *motion_sentences(self.motions), table, *remarks]
