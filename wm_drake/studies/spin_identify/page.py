"""Page of an identification from a spin cycle."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from wm_drake.parameters import machine_yaml
from wm_drake.parameters.units import Unit
from wm_drake.report.formatting import MISSING, number
from wm_drake.report.page import Picture, Section, SectionedPage, picture
from wm_drake.report.table import Column, Table, line, table_of
from wm_drake.report.terminal import Printed
from wm_drake.simulation.records import versions
from wm_drake.studies.fitting.page import estimate_rows, search_facts, undetermined_sentences
from wm_drake.studies.spin_cycle.figures import bars_figure, profile_figure
from wm_drake.studies.spin_cycle.measured import rms_table
from wm_drake.studies.spin_cycle.page import case_description
from wm_drake.studies.spin_cycle.study import average_errors, region_errors
from wm_drake.studies.spin_cycle.tables import missing_warnings
from wm_drake.studies.spin_identify.study import KNOWN, SpinIdentification, identified_machine
from wm_drake.studies.study import Facts, Result

VIRTUAL = (
    "This is a virtual experiment: nothing was measured. A machine with randomly planted values "
    "was simulated in place of a real one, and the search did not use these values. "
)
"""First sentences of the summary of a virtual experiment."""


@dataclass(frozen=True)
class SpinIdentifyResult(Result):
    """An identification, as it is shown."""

    identification: SpinIdentification
    float_formats: ClassVar[Mapping[str, str]] = {"parameters": "%.7g"}

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return the unknowns, and measured and computed RMS displacements."""
        return {
            "parameters": values_table(self.identification),
            "measured": rms_table(self.identification.measured),
            "rms": rms_table(self.identification.after),
        }

    def texts(self) -> dict[str, str]:
        """Return the result machine."""
        return {"result.yaml": machine_yaml(identified_machine(self.identification))}

    def as_json(self) -> dict[str, Any]:
        """Return the result for JSON."""
        result = self.identification
        shown = result.fit.as_dict()
        entries = zip(result.sought, shown["unknowns"].values(), strict=True)
        for k, (sought, entry) in enumerate(entries):
            value, identifiable = result.fit.estimates[k].value, result.identifiable[k]
            entry |= {"keys": list(sought.keys), "found": value, "identifiable": identifiable}
            if result.planted is not None and result.recovered is not None:
                entry |= {"planted": float(result.planted[k]), "error": float(result.recovered[k])}
        return {
            "machine": result.parameters.name,
            "virtual_experiment": result.planted is not None,
            "cases": [case.name for case in result.cases],
            "average_error_before": float(average_errors(result.before, result.measured).mean()),
            "average_error_after": result.error_after,
            "verdict": result.verdict,
            **shown,
        }

    def terminal(self) -> Printed:
        """Return summary, values, and what the data do not determine."""
        return terminal_lines(self.identification)

    def page(self, facts: Facts) -> str:
        """Return the page."""
        return spin_identify_page(self.identification, facts)


def spin_identify_page(result: SpinIdentification, facts: Facts) -> str:
    """Return the page as text of one self-contained HTML file."""
    bars = tuple(_bars(result, index) for index in range(len(result.cases)))
    sections = [
        Section("comparison", "Measured and fitted", bars),
        Section("profile", "Spin profile", (_profile_picture(result),)),
        Section(
            "unknowns",
            "Values found",
            tables=(unknowns(result),),
            text=" ".join(undetermined_sentences(result.fit)),
        ),
        Section("errors", "Errors", tables=(errors(result),)),
    ]
    return SectionedPage(
        f"Parameters of machine {result.parameters.name} identified from a spin cycle",
        summary(result),
        sections,
        _facts(result, facts),
        result.parameters,
        [*facts.warnings, *warnings_of(result)],
    ).html()


def terminal_lines(result: SpinIdentification) -> list[str]:
    """Return summary, values and undetermined directions for the terminal.

    Each key has a line of its own, so that no terminal breaks it.
    """
    table = unknowns(result)
    rows = [table.header[2:], *(tuple(map(str, g.rows[0].cells[1:])) for g in table.shown)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    heads, *values = ["  " + "  ".join(map(str.rjust, row, widths)) for row in rows]
    lines = [summary(result), *warnings_of(result), f"\n{heads}"]
    for sought, text in zip(result.sought, values, strict=True):
        lines += ["\n= ".join(sought.keys), text]
    return [*lines, "", *undetermined_sentences(result.fit)]


def summary(result: SpinIdentification) -> str:
    """Return one paragraph about what the data determine and how well the machine agrees."""
    count, known = len(result.sought), sum(result.identifiable)
    begin, end = (
        100.0 * float(average_errors(values, result.measured).mean())
        for values in (result.before, result.after)
    )
    opening = ("" if result.planted is None else VIRTUAL) + f"{judged(result)} "
    unknowns_were = f"{count} unknown{'s were' if count > 1 else ' was'}"
    cases = f"{len(result.cases)} case{'s' if len(result.cases) > 1 else ''}"
    text = (
        f"{opening}{unknowns_were} fitted to the RMS displacements of {cases}. The data determine "
        f"{known} of {count} to within ±{number(100 * KNOWN, 0)} % (95 % confidence interval)."
    )
    if result.recovered is not None and known:
        worst = np.max(np.abs(result.recovered[np.array(result.identifiable)]))
        text += (
            " The determined unknowns differ from their planted values by at most "
            f"{number(100 * worst, 2)} %."
        )
    text += (
        f" The search reduced the average error of an RMS displacement from {number(begin)} % to "
        f"{number(end)} %."
    )
    left = [
        s.unknown.name
        for s, fine in zip(result.sought, result.identifiable, strict=True)
        if not fine
    ]
    if left:
        text += f" Not determined to this accuracy: {', '.join(left)}."
    return text


def judged(result: SpinIdentification) -> str:
    """Return the verdict on the fit as a sentence."""
    text = (
        f"{result.verdict.capitalize()} fit: the computed RMS displacements miss the measured ones "
        f"by {number(100.0 * result.error_after)} % on average."
    )
    if result.verdict == "poor":
        text += " The machine does not describe the measurement: do not use the values identified."
    return text


def warnings_of(result: SpinIdentification) -> list[str]:
    """Return a warning for a fit that is not good and for each search that ended at a bound."""
    warnings = [] if result.verdict == "good" else [judged(result)]
    warnings += missing_warnings(result.after, result.measured)
    return warnings + [
        f"The search for {e.name} ended at its {e.at_bound} bound. Widen the range, or check "
        "whether the model is right."
        for e in result.fit.estimates
        if e.at_bound
    ]


def unknowns(result: SpinIdentification) -> Table:
    """Return the value of each unknown before the search, planted and found, with its interval."""
    rows = []
    for k, (sought, estimate) in enumerate(zip(result.sought, result.fit.estimates, strict=True)):
        unit, half = sought.unknown.unit, 100.0 * float(result.uncertainty[k])
        row = {
            "unknown": sought.keys[0],
            "set to the same value": ", ".join(key.rsplit(".", 1)[-1] for key in sought.keys[1:]),
            "before": _with_unit(sought.unknown.start, unit),
        }
        if result.planted is not None:
            row["planted"] = _with_unit(float(result.planted[k]), unit)
        row["found"] = _with_unit(estimate.value, unit)
        row["95 % interval, ±%"] = number(half, 2) if np.isfinite(half) else "not determined"
        if result.recovered is not None:
            row["error, %"] = number(100.0 * float(result.recovered[k]), 2)
        rows.append(row)
    caption = (
        "Values of the unknowns. Bold: determined to within "
        f"±{number(100 * KNOWN, 0)} % (95 % confidence interval)."
    )
    kinds = ["ours" if identifiable else "other" for identifiable in result.identifiable]
    shown = table_of(pd.DataFrame(rows).replace("", MISSING), caption, kinds=kinds)
    return replace(shown, text_columns=2)


def values_table(result: SpinIdentification) -> pd.DataFrame:
    """Return the unknowns as numbers in their unit, one row for each key."""
    rows = []
    for k, (sought, row) in enumerate(zip(result.sought, estimate_rows(result.fit), strict=True)):
        unit, estimate = sought.unknown.unit, result.fit.estimates[k]
        start = np.nan if sought.unknown.start is None else unit.from_si(sought.unknown.start)
        numbers = {name: value for name, value in row.items() if name != "unknown"}
        numbers |= {"identifiable": result.identifiable[k], "at_bound": estimate.at_bound}
        if result.planted is not None and result.recovered is not None:
            numbers["planted"] = unit.from_si(float(result.planted[k]))
            numbers["error_percent"] = 100.0 * float(result.recovered[k])
        rows += [{"unknown": key, "before": start, **numbers} for key in sought.keys]
    return pd.DataFrame(rows)


def _with_unit(value: float | None, unit: Unit) -> str:
    return MISSING if value is None else unit.reading(value, 5)


def errors(result: SpinIdentification) -> Table:
    """Return the relative error, [A] Eq. (9), of each case before and after the search."""
    both = [region_errors(v, result.measured).mean("region") for v in (result.before, result.after)]
    rows = (
        line(
            f"{case.name}: {case_description(case)}",
            [100.0 * float(error.sel(case=case.name)) for error in both],
        )
        for case in result.cases
    )
    caption = (
        "Relative error, [A] Eq. (9), with norms over sensors and axes: mean over the regions, "
        "before and after the search."
    )
    columns = ("case", Column("before", "%", 2), Column("after", "%", 2))
    return Table(caption, columns, tuple(rows))


def _profile_picture(result: SpinIdentification) -> Picture:
    return picture(
        profile_figure(result.profile),
        "Spin profile with its regions.",
        "Drum speed over time. Shaded areas: regions.",
    )


def _bars(result: SpinIdentification, index: int) -> Picture:
    case = result.cases[index]
    measured, after = (values.sel(case=case.name) for values in (result.measured, result.after))
    title = f"Case {case.name}: {case_description(case)}"
    return picture(
        bars_figure(after, None, measured),
        f"{title}.",
        f"{title}. RMS displacement per region, computed with the values found and measured.",
    )


def _facts(result: SpinIdentification, facts: Facts) -> list[tuple[str, str]]:
    return [
        ("Machine", result.parameters.name),
        ("SDF model", Path(result.parameters.model).name),
        *search_facts(result.fit),
        ("Runs of a point", str(len(result.cases))),
        (
            "Objective",
            "root mean square of |measured − computed|, divided by the norm of the measured values "
            "of the same case and region, [A] Eq. (9)",
        ),
        ("Versions", ", ".join(f"{name} {text}" for name, text in versions().items())),
        *facts.rows(),
    ]
