"""What the tolerance study shows: files, JSON, terminal, page and their tables."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from wm_drake.report.formatting import MISSING, plain, shape_name, significant, with_interval
from wm_drake.report.page import Picture, Section, SectionedPage, picture
from wm_drake.report.table import Column, Table, line, table_of
from wm_drake.studies.study import Facts, Result
from wm_drake.studies.tolerance.figures import distributions_figure, gap_figure, sobol_figure
from wm_drake.studies.tolerance.shares import PERCENTILES, percentile_of
from wm_drake.studies.tolerance.study import ToleranceStudy
from wm_drake.studies.tolerance.words import (
    about_loads,
    in_percent,
    in_short,
    leading,
    measure_titles,
    quantity_words,
    rare_sentences,
    summary,
    warnings,
)

if TYPE_CHECKING:
    from rich.table import Table as TerminalTable

MOST_PANELS = 9
"""Largest number of distributions in one figure."""


@dataclass(frozen=True)
class ToleranceResult(Result):
    """Result of the study.

    Attributes:
        result: Samples and what follows from them.
        about: Description in the tolerance file.
        gaps_of_loads: Smallest gap of each load of the machine. [m]
    """

    result: ToleranceStudy
    about: str
    gaps_of_loads: Mapping[str, float] = field(default_factory=dict)

    float_format = None

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return samples, measures and what else was computed."""
        frames = {
            "samples": samples_frame(self.result),
            "measures": measures_frame(self.result),
            "sobol": sobol_frame(self.result),
            "contact": contact_frame(self.result),
            "limits": limits_frame(self.result),
        }
        return {name: frame for name, frame in frames.items() if len(frame.columns)}

    def as_json(self) -> dict[str, Any]:
        """Return the result for JSON."""
        result, contact = self.result, self.result.contact
        names = [variable.name for variable in result.machine.variables]
        shown = {
            "samples": result.settings.samples,
            "seed": result.settings.seed,
            "runs": result.runs,
            "failed": len(result.failed),
            "measures": measures_frame(result).set_index("measure").to_dict("index"),
            "contact_probability": contact
            and {
                "estimate": contact.estimate,
                "lower": contact.lower,
                "upper": contact.upper,
                "method": contact.method,
                "runs": contact.crude.samples,
                "touching": contact.crude.count,
                "pairs": {
                    name: {"estimate": s.estimate, "lower": s.lower, "upper": s.upper}
                    for name, s in contact.pairs.items()
                },
            },
            "sobol": {
                measure: dict(zip(names, map(vars, indices), strict=True))
                for measure, indices in result.indices.items()
            },
            "smallest_gap_of_loads_mm": {n: 1e3 * g for n, g in self.gaps_of_loads.items()},
            "sobol_refused": result.refused,
            "limits": limits_frame(result).to_dict("records"),
        }
        return plain(shown)

    def terminal(self) -> "Iterable[TerminalTable | str]":
        """Yield measures, limits and a summary."""
        samples = self.result.settings.samples
        table = measures_table(self.result, is_short=True)
        yield table.terminal(f"Measures of {samples} samples")
        if self.result.verdicts:
            yield limits_table(self.result).terminal("Limits")
        yield from summary(self.result)
        for word, text in facts_of(self.result, self.gaps_of_loads):
            yield f"{word}: {text}"

    def page(self, facts: Facts) -> str:
        """Return the page: distributions, causes, limits, contact, tables."""
        result, settings = self.result, self.result.settings
        machine = result.machine.parameters
        contact = result.contact
        sections = [
            Section("gap", "Smallest gap", _gap_picture(result, self.gaps_of_loads)),
            Section("distributions", "Distributions", _distributions(result)),
            Section(
                "sensitivity", "What causes the scatter", _sobol_picture(result),
                text=result.refused,
            ),
            Section("limits", "Limits", tables=[limits_table(result)] if result.verdicts else ()),
            Section(
                "contact", "Contact", tables=[contact_table(result)] if contact else (),
                text=rare_sentences(contact) if contact else "",
            ),
            Section("measures", "Distributions in numbers", tables=[measures_table(result)]),
            Section(
                "indices", "Sobol indices", tables=[sobol_table(result)] if result.indices else ()
            ),
            Section("quantities", "Quantities", tables=[quantities_table(result)]),
        ]  # fmt: skip
        made = [
            ("Machine", machine.name),
            ("Samples", f"{settings.samples}, scrambled Sobol sequence, seed {settings.seed}"),
            ("Runs", f"{result.runs} in {facts.wall_s:.0f} s"),
            ("Duration of a run", f"{result.machine.case.profile.duration:g} s"),
            *facts.rows(),
        ]
        return SectionedPage(
            f"Tolerances of machine {machine.name}",
            " ".join(summary(result)),
            sections,
            made,
            warnings=[*facts.warnings, *warnings(result)],
            about=self.about,
            advice=Section("", "In short", facts=facts_of(result, self.gaps_of_loads)),
        ).html()

    def warnings(self) -> list[str]:
        """Return what limits the use of the result."""
        return warnings(self.result)

    def failures(self) -> list[str]:
        """Return one line if runs failed."""
        count = len(self.result.failed)
        return [f"{count} of {self.result.settings.samples} runs failed"] if count else []


def facts_of(result: ToleranceStudy, gaps: Mapping[str, float]) -> list[tuple[str, str]]:
    """Return the facts below the answer.

    Args:
        gaps: Smallest gap of each load of the machine. [m]
    """
    facts = [*in_short(result), ("Loads of the machine", about_loads(result, gaps))]
    return [(word, text) for word, text in facts if text]


def _gap_picture(result: ToleranceStudy, gaps: Mapping[str, float]) -> tuple[Picture, ...]:
    """Return the distribution of the smallest gap beside the loads; nothing without a gap."""
    name = next((str(n) for n in result.values if str(n).startswith("smallest_gap")), "")
    if not name or result.values[name].notna().sum() < 2:
        return ()
    caption = (
        "Share of the runs whose smallest gap between tub and housing is below a value; 0 and "
        "below: contact. Shaded: 95 % band for the whole curve. Points: loads of the machine file, "
        "at any height."
    )
    figure = gap_figure(result, name, gaps)
    return (picture(figure, f"Distribution of the smallest gap. {caption}", caption),)


def _distributions(result: ToleranceStudy) -> tuple[Picture, ...]:
    titles = {name: ", ".join(text) for name, text in measure_titles(result).items()}
    names = [str(name) for name in result.values if not str(name).startswith("smallest_gap")]
    caption = (
        "Distribution functions of the measures: share of the runs below a value. Shaded: 95 % "
        "band for the whole curve (Dvoretzky, Kiefer, Wolfowitz). Dashed: limits."
    )
    pictures = []
    for first in range(0, len(names), MOST_PANELS):
        panels = {name: titles[name] for name in names[first : first + MOST_PANELS]}
        words = f"Distribution functions of {'; '.join(panels.values())}."
        pictures.append(picture(distributions_figure(result, panels), words, caption))
    return tuple(pictures)


def _sobol_picture(result: ToleranceStudy) -> tuple[Picture, ...]:
    """Return the indices of the leading measure; nothing if there are none."""
    key, indices = leading(result)
    if not indices:
        return ()
    caption = (
        f"Sobol indices of the {measure_titles(result)[key][0]}. Bars: estimates, lines: 95 % "
        "bootstrap intervals. A total index above the first-order index is an effect together with "
        "other quantities."
    )
    named = [(quantity_words(variable.name), index) for variable, index in indices]
    listed = ", ".join(f"{name} {index.total:.2f}" for name, index in named)
    return (picture(sobol_figure(named), f"Total indices: {listed}.", caption),)


KINDS = {"pass": "ours", "fail": "alarm", "undecided": ""}
"""Style of the row of a limit by its verdict."""


def samples_frame(result: ToleranceStudy) -> pd.DataFrame:
    """Return quantities and measures of each sample, and the reason if its run failed."""
    columns: dict[str, Any] = {"sample": range(1, len(result.values) + 1)}
    values = result.machine.joint.values(result.scores)
    for variable, column in zip(result.machine.variables, values.T, strict=True):
        unit = variable.variation.unit
        columns[f"{variable.name} [{unit.label}]"] = unit.from_si(1.0) * column
    failed = [result.failed.get(i, "") for i in range(len(result.values))]
    return pd.concat([pd.DataFrame(columns), result.values], axis=1).assign(failed=failed)


def measures_frame(result: ToleranceStudy) -> pd.DataFrame:
    """Return mean, deviation and percentiles of each measure, with intervals of the percentiles."""
    rows = []
    for name, column in result.values.items():
        good = column.dropna().to_numpy()
        row: dict[str, Any] = {"measure": name, "mean": np.mean(good), "deviation": np.std(good)}
        for percent in PERCENTILES:
            percentile = percentile_of(good, percent)
            row[f"p{percent}"] = percentile.value
            row |= {f"p{percent}_{end}": getattr(percentile, end) for end in ("lower", "upper")}
        rows.append(row)
    return pd.DataFrame(rows)


MEASURES = {
    "measure": Column("measure"),
    "unit": Column("unit"),
    "mean": Column("mean"),
    "deviation": Column("deviation"),
    "p5": Column("5 %"),
    "p50": Column("median"),
    "p95": Column("95 %"),
}
"""Columns of the table of measures."""


def measures_table(result: ToleranceStudy, *, is_short: bool = False) -> Table:
    """Return the measures with words and unit; the short form has percentiles alone."""
    frame, titles = measures_frame(result), measure_titles(result)
    words = [titles[str(name)] for name in frame["measure"]]
    frame["measure"], frame["unit"] = ([pair[index] for pair in words] for index in (0, 1))
    names = [name for name in MEASURES if not (is_short and name in ("mean", "deviation"))]
    for name in [f"p{percent}" for percent in PERCENTILES if not is_short]:
        ends = frame[[name, f"{name}_lower", f"{name}_upper"]].itertuples(index=False)
        frame[name] = [with_interval(*each) for each in ends]
    caption = "Measures over all samples; percentiles with 95 % intervals of order statistics."
    return table_of(frame[names], caption, MEASURES)


def sobol_frame(result: ToleranceStudy) -> pd.DataFrame:
    """Return the Sobol indices: one row for each measure and quantity."""
    return pd.DataFrame(
        {"measure": name, "quantity": variable.name, **vars(index)}
        for name, indices in result.indices.items()
        for variable, index in zip(result.machine.variables, indices, strict=True)
    )


def sobol_table(result: ToleranceStudy) -> Table:
    """Return the total Sobol indices, a column for each quantity."""
    names = (quantity_words(variable.name) for variable in result.machine.variables)
    titles = measure_titles(result)
    caption = (
        "Total Sobol indices of all measures. First-order indices and 95 % intervals are in "
        "sobol.csv."
    )
    groups = (
        line(titles[name][0], [index.total for index in indices])
        for name, indices in result.indices.items()
    )
    columns = tuple(Column(name, decimals=2) for name in names)
    return Table(caption, ("measure", *columns), tuple(groups))


def contact_frame(result: ToleranceStudy) -> pd.DataFrame:
    """Return the share of the samples in which each pair of shapes touches or is nearest."""
    rows, contact = [], result.contact
    if contact:
        for name in dict.fromkeys([*contact.pairs, *contact.nearest]):
            share = contact.pairs.get(name)
            ends = (share.estimate, share.lower, share.upper) if share else (0.0, 0.0, np.nan)
            rows.append((*name.split("|"), *ends, contact.nearest.get(name, 0)))
    names = ["moving", "fixed", "touches", "lower", "upper", "nearest_in"]
    return pd.DataFrame(rows, columns=names)


def contact_table(result: ToleranceStudy) -> Table:
    """Return how often each pair of shapes touches and is nearest."""
    rows = []
    for moving, fixed, share, low, high, count in contact_frame(result).to_numpy().tolist():
        ends = f"{in_percent(low)} to {in_percent(high)}" if share else MISSING
        nearest = 100.0 * count / result.settings.samples
        cells = (shape_name(fixed), in_percent(share), ends, nearest)
        rows.append(line(shape_name(moving), cells))
    caption = (
        "Contact by pair of shapes among the samples. A run may touch at several places. Last "
        "column: share of the runs in which the pair has the smallest gap. Intervals: 95 %, "
        "Clopper and Pearson."
    )
    header = ("moves with the tub", "housing", "touch", "interval")
    return Table(caption, (*header, Column("nearest", "%", 1)), tuple(rows), text_columns=2)


def limits_frame(result: ToleranceStudy) -> pd.DataFrame:
    """Return the verdict on each limit."""
    return pd.DataFrame(
        {
            "quantity": v.limit.quantity,
            "side": "at_least" if v.limit.at_least is not None else "at_most",
            "limit": v.limit.text,
            "allowed_share": v.allowed,
            "share": v.broken.estimate,
            "lower": v.broken.lower,
            "upper": v.broken.upper,
            "verdict": v.word,
        }
        for v in result.verdicts
    )


def limits_table(result: ToleranceStudy) -> Table:
    """Return the verdict on each limit with the words of its quantity."""
    titles, rows = measure_titles(result), []
    for v in result.verdicts:
        side = "at least" if v.limit.at_least is not None else "at most"
        ends = " to ".join(significant(100.0 * x, 3) for x in (v.broken.lower, v.broken.upper))
        share = significant(100.0 * v.broken.estimate, 3)
        cells = (f"{side} {v.limit.text}", 100.0 * v.allowed, share, ends, v.word)
        rows.append(line(titles[v.key][0], cells, KINDS[v.word]))
    caption = (
        "Limits: share of the runs that break each one. The verdict is pass if the whole 95 % "
        "interval is allowed, fail if none of it is, else undecided: more samples decide it."
    )
    header = ("quantity", "limit", "allowed, %", "break it, %", "interval, %", "verdict")
    return Table(caption, header, tuple(rows), text_columns=2)


def quantities_table(result: ToleranceStudy) -> Table:
    """Return what scatters."""
    rows = (
        line(
            quantity_words(v.name),
            (", ".join(v.variation.keys) or "load", v.text, v.source or MISSING),
        )
        for v in result.machine.variables
    )
    caption = "What scatters. Percents are of the machine's number."
    return Table(
        caption, ("quantity", "keys", "distribution", "source"), tuple(rows), text_columns=4
    )
