"""What the tolerance study shows: files, JSON, terminal and page."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from wm_drake.report.formatting import plain
from wm_drake.report.page import Picture, picture
from wm_drake.report.sections import Section, SectionedPage
from wm_drake.studies.study import Facts, Result
from wm_drake.studies.tolerance import tables
from wm_drake.studies.tolerance.figures import distributions_figure, gap_figure, sobol_figure
from wm_drake.studies.tolerance.study import ToleranceResult
from wm_drake.studies.tolerance.words import (
    about_loads,
    in_short,
    leading,
    measure_titles,
    quantity_words,
    rare_sentences,
    summary,
    warnings,
)

if TYPE_CHECKING:
    import pandas as pd
    from rich.table import Table

MOST_PANELS = 9
"""Largest number of distributions in one figure."""


@dataclass(frozen=True)
class ToleranceReport(Result):
    """Result of the study.

    Attributes:
        result: Samples and what follows from them.
        about: Description in the tolerance file.
        gaps_of_loads: Smallest gap of each load of the machine. [m]
    """

    result: ToleranceResult
    about: str
    gaps_of_loads: Mapping[str, float] = field(default_factory=dict)

    float_format = None

    def tables(self) -> "dict[str, pd.DataFrame]":
        """Return samples, measures and what else was computed."""
        frames = {
            "samples": tables.samples_frame(self.result),
            "measures": tables.measures_frame(self.result),
            "sobol": tables.sobol_frame(self.result),
            "contact": tables.contact_frame(self.result),
            "limits": tables.limits_frame(self.result),
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
            "measures": tables.measures_frame(result).set_index("measure").to_dict("index"),
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
            "limits": tables.limits_frame(result).to_dict("records"),
        }
        return plain(shown)

    def terminal(self) -> "Iterable[Table | str]":
        """Yield measures, limits and a summary."""
        samples = self.result.settings.samples
        table = tables.measures_table(self.result, is_short=True)
        yield table.terminal(f"Measures of {samples} samples")
        if self.result.verdicts:
            yield tables.limits_table(self.result).terminal("Limits")
        yield from summary(self.result)
        for word, text in facts_of(self.result, self.gaps_of_loads):
            yield f"{word}: {text}"

    def page(self, facts: Facts) -> str:
        """Return the page: distributions, causes, limits, contact, tables."""
        result, settings = self.result, self.result.settings
        machine = result.machine.parameters
        sections = [
            Section("gap", "Smallest gap", _gap_picture(result, self.gaps_of_loads)),
            Section("distributions", "Distributions", _distributions(result)),
            Section(
                "sensitivity", "What causes the scatter", _sobol_picture(result),
                text=result.refused,
            ),
        ]  # fmt: skip
        if result.verdicts:
            shown = (tables.limits_table(result),)
            sections.append(Section("limits", "Limits", tables=shown))
        if result.contact:
            shown = (tables.contact_table(result),)
            text = rare_sentences(result.contact)
            sections.append(Section("contact", "Contact", tables=shown, text=text))
        shown = (tables.measures_table(result),)
        sections.append(Section("measures", "Distributions in numbers", tables=shown))
        if result.indices:
            shown = (tables.sobol_table(result),)
            sections.append(Section("indices", "Sobol indices", tables=shown))
        shown = (tables.quantities_table(result),)
        sections.append(Section("quantities", "Quantities", tables=shown))
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


def facts_of(result: ToleranceResult, gaps: Mapping[str, float]) -> list[tuple[str, str]]:
    """Return the facts below the answer.

    Args:
        gaps: Smallest gap of each load of the machine. [m]
    """
    facts = [*in_short(result), ("Loads of the machine", about_loads(gaps))]
    return [(word, text) for word, text in facts if text]


def _gap_picture(result: ToleranceResult, gaps: Mapping[str, float]) -> tuple[Picture, ...]:
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


def _distributions(result: ToleranceResult) -> tuple[Picture, ...]:
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


def _sobol_picture(result: ToleranceResult) -> tuple[Picture, ...]:
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
