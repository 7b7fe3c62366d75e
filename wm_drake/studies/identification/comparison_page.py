"""Page and tables of several laws that were fitted to the same tests."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from wm_drake.report.formatting import MISSING
from wm_drake.report.page import Picture, picture
from wm_drake.report.sections import Section, SectionedPage
from wm_drake.report.table import Group, Row, Table
from wm_drake.rigs.measured import MeasuredMotion
from wm_drake.studies.fitting import Fit
from wm_drake.studies.fitting.page import ESTIMATE_HEADS, estimate_cells, estimates_frame
from wm_drake.studies.identification.comparison import Comparison, LawResult
from wm_drake.studies.identification.figures import (
    MOST_PANELS,
    measured_files,
    motion_text,
    rival_loops_figure,
)
from wm_drake.studies.identification.judgement import per_cent
from wm_drake.studies.identification.page import fixed_numbers, frequency_of, motion_sentences
from wm_drake.studies.rig.figures import force_scale, motion_scale
from wm_drake.studies.study import Facts

if TYPE_CHECKING:
    from wm_drake.studies.identification.study import ComparisonResult

METHOD = (
    "All laws are fitted to the same samples by the least root mean square error. From three tests "
    "on, each test is predicted from the fit to all the others (one Gauss-Newton step away from "
    "the fit to all); a law is as good as the best one if a paired t test of the logarithms of "
    "these errors does not tell them apart (5 %). With fewer tests the Bayesian information "
    "criterion decides, with the independent samples of the best law and a difference of 6 as "
    "limit."
)


def comparison_page(result: "ComparisonResult", facts: Facts) -> str:
    """Return the page as text of one self-contained HTML file."""
    comparison = result.comparison
    count, blind = len(comparison.motions), len(comparison.validation)
    about = f"{_counted(len(comparison.results), 'law')} fitted to {_counted(count, 'test')}"
    about += f", {_counted(blind, 'test')} predicted blind." if blind else "."
    predicted = _pictures(comparison, _predictions(comparison), comparison.validation, "blind")
    fitted = _pictures(comparison, [r.fit for r in comparison.results], comparison.motions, "")
    sections = [Section("blind", "Blind prediction", predicted)] if predicted else []
    sections += [
        Section("fits", "Measured and fitted loops", fitted),
        Section("laws", "Laws compared", tables=(_laws(comparison),)),
        Section("errors", "Errors of each test", tables=(_errors(comparison),)),
        Section("values", "Values", tables=(_estimates(comparison),)),
    ]
    motions = motion_sentences((*comparison.motions, *comparison.validation))
    made = [
        *(
            (f"Search, {r.law}", f"{r.fit.log.method}; {'; '.join(r.fit.log.notes)}")
            for r in comparison.results
        ),
        *(("Motion", text) for text in motions),
        *facts.rows(),
    ]
    return SectionedPage(
        f"Laws of {result.component.title}",
        " ".join(comparison.sentences),
        sections,
        made,
        warnings=_warnings(comparison, result.missing),
        about=about,
        method=METHOD,
    ).html()


def _counted(count: int, word: str) -> str:
    return f"{count} {word}{'' if count == 1 else 's'}"


def _predictions(comparison: Comparison) -> list[Fit]:
    return [r.prediction for r in comparison.results if r.prediction is not None]


def law_header(comparison: Comparison) -> tuple[str, ...]:
    """Return the column heads for the cells of `law_cells`."""
    unit = comparison.unit.replace(" ", "\u00a0")
    return (
        "law",
        "unknowns",
        "not determined",
        "fit",
        f"RMSE, {unit}",
        "lack of fit",
        f"RMSE left out, {unit}",
        "BIC above least",
        *((f"RMSE blind, {unit}", "lack of fit blind") if comparison.validation else ()),
    )


def law_cells(comparison: Comparison) -> list[tuple[str, ...]]:
    """Return the measures of each law as text, from the best to the worst law."""
    least = min(r.criterion for r in comparison.results)
    return [
        (
            r.law,
            str(len(r.model.unknowns)),
            ", ".join(r.undetermined) or "–",
            r.judgement.verdict,
            f"{r.fit.rmse:.4g}",
            per_cent(r.judgement.missed),
            f"{r.left_out_rmse:.4g}" if np.isfinite(r.left_out_rmse) else MISSING,
            f"{r.criterion - least:.4g}",
            *(
                (f"{r.prediction.rmse:.4g}", per_cent(r.predicted.missed))
                if r.prediction and r.predicted
                else ()
            ),
        )
        for r in comparison.order
    ]


def laws_table(comparison: Comparison) -> pd.DataFrame:
    """Return the measures of each law, with units in the column names."""
    unit = comparison.unit.replace(" ", "")
    return pd.DataFrame(
        [
            {
                "law": r.law,
                "unknowns": len(r.model.unknowns),
                "not_determined": " ".join(r.undetermined),
                "verdict": r.judgement.verdict,
                f"rmse_{unit}": r.fit.rmse,
                "lack_of_fit_by_rms_force": r.judgement.missed,
                f"rmse_left_out_{unit}": r.left_out_rmse,
                "bayesian_information_criterion": r.criterion,
                f"rmse_blind_{unit}": r.prediction.rmse if r.prediction else np.nan,
                "lack_of_fit_blind": r.predicted.missed if r.predicted else np.nan,
                "as_good_as_best": r in comparison.as_good,
                "supported": r is comparison.supported,
            }
            for r in comparison.order
        ]
    )


def parameters_by_law(comparison: Comparison) -> pd.DataFrame:
    """Return value, interval and bounds of each unknown of each law, for reading."""
    parts = []
    for r in comparison.results:
        table = estimates_frame(r.fit, fixed_numbers(r.model.fixed))
        table.insert(0, "law", r.law)
        parts.append(table)
    return pd.concat(parts, ignore_index=True)


def errors_by_law(comparison: Comparison) -> pd.DataFrame:
    """Return the RMSE of each test, one column a law; a column says which tests were predicted."""
    return pd.DataFrame(
        [
            *_error_rows(comparison, comparison.motions, [r.fit for r in comparison.results], ""),
            *_error_rows(comparison, comparison.validation, _predictions(comparison), "blind"),
        ]
    )


def _error_rows(
    comparison: Comparison, motions: Sequence[MeasuredMotion], fits: Sequence[Fit], kind: str
) -> list[dict[str, Any]]:
    rows = []
    for index, measured in enumerate(motions):
        factor, _, unit = motion_scale(measured.loop.rotates)
        force = comparison.unit.replace(" ", "")
        row: dict[str, Any] = {
            "file": measured.loop.path,
            "test": kind or "fitted",
            "frequency_hz": frequency_of(measured),
            f"amplitude_{unit}": factor * measured.stroke,
        }
        for r, fit in zip(comparison.results, fits, strict=True):
            row[f"rmse_{force}_{r.law}"] = fit.tests[index].rmse
            if not kind:
                row[f"rmse_left_out_{force}_{r.law}"] = r.left_out[index]
        rows.append(row)
    return rows


def loops_by_law(comparison: Comparison) -> pd.DataFrame:
    """Return the measured force and that of each law at every sample. [SI]"""
    parts = []
    groups = (
        (comparison.motions, [r.fit for r in comparison.results], "fitted"),
        (comparison.validation, _predictions(comparison), "blind"),
    )
    for motions, fits, kind in groups:
        for index, measured in enumerate(motions):
            forces = {
                r.law: fit.computed[fit.problem.slices[index]]
                for r, fit in zip(comparison.results, fits, strict=True)
            }
            parts.append(
                pd.DataFrame(
                    {
                        "file": measured.loop.name,
                        "test": kind,
                        "time_s": measured.loop.time,
                        "measured": measured.loop.force,
                        **forces,
                    }
                )
            )
    return pd.concat(parts, ignore_index=True)


def _laws(comparison: Comparison) -> Table:
    caption = (
        "Laws from the best to the worst. Lack of fit: what the noise does not explain, by the "
        "root mean square of the measured force. RMSE left out: error of each test at the fit to "
        "all the other tests. BIC: Bayesian information criterion with the number of independent "
        "samples. The data support, of the laws that are as good as the best, the one with the "
        "fewest unknowns."
    )
    supported = comparison.supported.law
    groups = tuple(
        Group(cells[0], (Row(cells[1:], "ours" if cells[0] == supported else ""),))
        for cells in law_cells(comparison)
    )
    return Table(caption, law_header(comparison), groups, text_columns=4)


def _estimates(comparison: Comparison) -> Table:
    groups = tuple(
        Group(r.law, tuple(Row(cells) for cells in cells_of) or (Row(("–",) * 5),))
        for r in comparison.order
        for cells_of in [estimate_cells(r.fit, fixed_numbers(r.model.fixed))]
    )
    caption = "Estimated values of each law with 95 % confidence intervals."
    return Table(caption, ("law", *ESTIMATE_HEADS), groups, 6)


def _errors(comparison: Comparison) -> Table:
    tests = (
        *((m, "fitted", k) for k, m in enumerate(comparison.motions)),
        *((m, "blind", k) for k, m in enumerate(comparison.validation)),
    )
    groups = tuple(
        Group(
            m.loop.name,
            (
                Row(
                    (
                        motion_text(m),
                        kind,
                        *(_error(r, kind, index) for r in comparison.results),
                    )
                ),
            ),
        )
        for m, kind, index in tests
    )
    unit = force_scale(comparison.motions[0].loop.rotates)[1].replace(" ", "\u00a0")
    caption = "Root mean square error of each test and law, absolute and by the largest measured."
    heads = (f"{r.law}, {unit}" for r in comparison.results)
    return Table(caption, ("file", "motion", "test", *heads), groups, text_columns=3)


def _error(r: LawResult, kind: str, index: int) -> str:
    fit = r.prediction if kind == "blind" else r.fit
    assert fit is not None
    test = fit.tests[index]
    return f"{test.rmse:.3g} ({per_cent(test.normalised)})"


def _pictures(
    comparison: Comparison, fits: Sequence[Fit], motions: Sequence[MeasuredMotion], kind: str
) -> tuple[Picture, ...]:
    if not motions:
        return ()
    by_law = {r.law: fit for r, fit in zip(comparison.results, fits, strict=True)}
    best = comparison.supported.law
    chosen = measured_files(motions)
    number = (
        f"{len(chosen)} of {len(motions)} tests, evenly chosen; all are in loops.csv. "
        if len(chosen) < len(motions)
        else ""
    )
    what = "blind prediction of tests that no fit has seen" if kind else "fit to the tests"
    assert len(chosen) <= MOST_PANELS
    return tuple(
        picture(
            rival_loops_figure(by_law, motions, chosen, best=best, over=over),
            f"Measured samples and the loop of each law over {over}, {what}.",
            f"Force over {over}, {what} (form of [C] Figs. 13, 15-20). {number}The offset and "
            f"drift that {best} finds for the instrument are removed.",
        )
        for over in ("displacement", "velocity")
    )


def _warnings(comparison: Comparison, missing: Sequence[str]) -> list[str]:
    supported = comparison.supported
    warnings = [*supported.judgement.hints, *missing]
    if supported.judgement.verdict == "poor":
        warnings.insert(0, "None of these laws describes the tests.")
    return [*warnings, *bounds_sentences(comparison)]


def bounds_sentences(comparison: Comparison) -> list[str]:
    """Return a sentence for each value at a bound of its search."""
    return [
        f"{r.law}: the value of {e.name} is at its {e.at_bound} bound; wider --bounds may fit "
        "better."
        for r in comparison.results
        for e in r.fit.estimates
        if e.at_bound and ".rise_" not in e.name
    ]
