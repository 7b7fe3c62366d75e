"""Page and tables of several laws that were fitted to the same tests."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from wm_drake.report.formatting import MISSING
from wm_drake.report.page import Picture, Section, SectionedPage, picture
from wm_drake.report.table import Column, Group, Row, Table, line, table_of
from wm_drake.report.terminal import Printed
from wm_drake.studies.fitting.page import estimates_frame, values_table
from wm_drake.studies.identify.comparison import Comparison, FittedLaw
from wm_drake.studies.identify.figures import evenly_chosen, motion_text, rival_loops_figure
from wm_drake.studies.identify.judgement import per_cent
from wm_drake.studies.identify.page import IdentifiedResult, frequency_of, motion_sentences
from wm_drake.studies.rig.units import units_of
from wm_drake.studies.study import Facts

METHOD = (
    "All laws are fitted to the same samples by the least root mean square error. From three tests "
    "on, each test is predicted from the fit to all the others (one Gauss-Newton step away from "
    "the fit to all); a law is as good as the best one if a paired t test of the logarithms of "
    "these errors does not tell them apart (5 %). With fewer tests the Bayesian information "
    "criterion decides, with the independent samples of the best law and a difference of 6 as "
    "limit."
)


def comparison_page(result: "IdentifyComparisonResult", facts: Facts) -> str:
    """Return the page as text of one self-contained HTML file."""
    comparison = result.comparison
    count, blind = len(comparison.motions), len(comparison.validation)
    about = f"{_counted(len(comparison.results), 'law')} fitted to {_counted(count, 'test')}"
    about += f", {_counted(blind, 'test')} predicted blind." if blind else "."
    blind_words = "blind prediction of tests that no fit has seen"
    predicted = _pictures(comparison, "blind", blind_words)
    fitted = _pictures(comparison, "fitted", "fit to the tests")
    sections = [
        Section("blind", "Blind prediction", predicted),
        Section("fits", "Measured and fitted loops", fitted),
        Section("laws", "Laws compared", tables=(laws_shown(comparison),)),
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
                f"rmse_blind_{unit}": r.prediction.fit.rmse if r.prediction else np.nan,
                "lack_of_fit_blind": r.prediction.judgement.missed if r.prediction else np.nan,
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
        table = estimates_frame(r.fit, r.model.fixed_numbers)
        table.insert(0, "law", r.law)
        parts.append(table)
    return pd.concat(parts, ignore_index=True)


def errors_by_law(comparison: Comparison) -> pd.DataFrame:
    """Return the RMSE of each test, one column a law; a column says which tests were predicted."""
    units = units_of(comparison.motions[0].loop.rotates)
    rows = []
    for tested in comparison.tested:
        row: dict[str, Any] = {
            "file": tested.measured.loop.path,
            "test": tested.kind,
            "frequency_hz": frequency_of(tested.measured),
            f"amplitude_{units.unit}": units.factor * tested.measured.stroke,
        }
        for r, error in zip(comparison.results, tested.errors().values(), strict=True):
            row[f"rmse_{units.in_heads}_{r.law}"] = error.rmse
            if tested.kind == "fitted":
                row[f"rmse_left_out_{units.in_heads}_{r.law}"] = r.left_out[tested.index]
        rows.append(row)
    return pd.DataFrame(rows)


def loops_by_law(comparison: Comparison) -> pd.DataFrame:
    """Return the measured force and that of each law at every sample. [SI]"""
    parts = [
        pd.DataFrame(
            {
                "file": tested.measured.loop.name,
                "test": tested.kind,
                "time_s": tested.measured.loop.time,
                "measured": tested.measured.loop.force,
                **tested.forces(),
            }
        )
        for tested in comparison.tested
    ]
    return pd.concat(parts, ignore_index=True)


def laws_shown(comparison: Comparison) -> Table:
    """Return the measures of each law for reading, from the best to the worst law."""
    unit, in_heads = comparison.unit, comparison.unit.replace(" ", "")
    columns = {
        "law": Column("law"),
        "not_determined": Column("not determined"),
        "verdict": Column("fit"),
        "unknowns": Column("unknowns", decimals=0),
        f"rmse_{in_heads}": Column("RMSE", unit),
        "lack_of_fit_by_rms_force": Column("lack of fit"),
        f"rmse_left_out_{in_heads}": Column("RMSE left out", unit),
        "bayesian_information_criterion": Column("BIC above least"),
    }
    if comparison.validation:
        columns[f"rmse_blind_{in_heads}"] = Column("RMSE blind", unit)
        columns["lack_of_fit_blind"] = Column("lack of fit blind")
    frame = laws_table(comparison)
    frame["bayesian_information_criterion"] -= frame["bayesian_information_criterion"].min()
    for name in ("lack_of_fit_by_rms_force", "lack_of_fit_blind"):
        frame[name] = list(map(per_cent, frame[name]))
    frame["not_determined"] = frame["not_determined"].str.replace(" ", ", ").replace("", MISSING)
    caption = (
        "Laws from the best to the worst. Lack of fit: what the noise does not explain, by the "
        "root mean square of the measured force. RMSE left out: error of each test at the fit to "
        "all the other tests. BIC: Bayesian information criterion with the number of independent "
        "samples. The data support, of the laws that are as good as the best, the one with the "
        "fewest unknowns."
    )
    kinds = ["ours" if supported else "" for supported in frame["supported"]]
    return table_of(frame[list(columns)], caption, columns, kinds)


def _estimates(comparison: Comparison) -> Table:
    tables = {r.law: values_table(r.fit, r.model.fixed_numbers) for r in comparison.order}
    groups = tuple(
        Group(law, tuple(Row((group.heading, *group.rows[0].cells)) for group in table.groups))
        for law, table in tables.items()
    )
    caption = "Estimated values of each law with 95 % confidence intervals."
    columns = next(iter(tables.values())).columns
    return Table(caption, ("law", *columns), groups, 6)


def _errors(comparison: Comparison) -> Table:
    groups = tuple(
        line(
            tested.measured.loop.name,
            (
                motion_text(tested.measured),
                tested.kind,
                *(f"{e.rmse:.3g} ({per_cent(e.normalised)})" for e in tested.errors().values()),
            ),
        )
        for tested in comparison.tested
    )
    caption = "Root mean square error of each test and law, absolute and by the largest measured."
    laws = (Column(r.law, comparison.unit) for r in comparison.results)
    return Table(caption, ("file", "motion", "test", *laws), groups, text_columns=3)


def _pictures(comparison: Comparison, kind: str, what: str) -> tuple[Picture, ...]:
    every = [tested for tested in comparison.tested if tested.kind == kind]
    if not every:
        return ()
    chosen = evenly_chosen(every)
    number = (
        f"{len(chosen)} of {len(every)} tests, evenly chosen; all are in loops.csv. "
        if len(chosen) < len(every)
        else ""
    )
    best = comparison.supported.law
    return tuple(
        picture(
            rival_loops_figure(chosen, best=best, over=over),
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


@dataclass(frozen=True)
class IdentifyComparisonResult(IdentifiedResult):
    """Several laws that were fitted to the same tests."""

    comparison: Comparison
    page = comparison_page

    @property
    def laws(self) -> dict[str, FittedLaw]:
        """All laws."""
        return {f"identified_{law.law}.yaml": law for law in self.comparison.results}

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return measures, values and errors of the laws, and all samples."""
        return {
            "laws": laws_table(self.comparison),
            "parameters": parameters_by_law(self.comparison),
            "errors": errors_by_law(self.comparison),
            "loops": loops_by_law(self.comparison),
        }

    def fit_as_dict(self) -> dict[str, Any]:
        """Return the comparison for JSON, in SI."""
        return self.comparison.as_dict()

    def terminal(self) -> Printed:
        """Return what the data say about the laws, their measures, and remarks."""
        comparison = self.comparison
        table = laws_shown(comparison).terminal(self.component.title)
        motions = (*comparison.motions, *comparison.validation)
        sentences = (*comparison.sentences, *motion_sentences(motions))
        return [*sentences, table, *bounds_sentences(comparison), *self.missing]
