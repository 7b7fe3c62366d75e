"""What the gasket study shows: files, JSON, terminal and page."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from markupsafe import Markup

from wm_drake.report.formatting import number
from wm_drake.report.interactive import packed
from wm_drake.report.page import Picture, Section, SectionedPage, as_json, fragment, picture
from wm_drake.report.table import Table
from wm_drake.report.terminal import Console, Printed
from wm_drake.studies.doe.design import write_design
from wm_drake.studies.gasket import figures, tables
from wm_drake.studies.gasket.advice import OTHER_GOALS, advice, answer, before_and_after, in_short
from wm_drake.studies.gasket.findings import (
    about_check,
    about_residual,
    load_findings,
    summary,
    warnings,
)
from wm_drake.studies.gasket.proposal import NOT_COMPARED, Compared
from wm_drake.studies.gasket.screening import Label, Screening, Words
from wm_drake.studies.gasket.study import GasketTrials
from wm_drake.studies.gasket.surface import Surfaces, surfaces
from wm_drake.studies.study import Facts, Result

WIDE = 100
"""Width of a terminal from which on its table has the leading terms. [characters]"""

EFFECTS = (
    "Effect of the most important factors on each response. Percentages are shares of the variance "
    "of the response."
)


@dataclass(frozen=True)
class GasketResult(Result):
    """Result of the study."""

    screening: Screening
    trials: GasketTrials
    compared: Compared = NOT_COMPARED

    # more digits than the results are accurate to
    float_format = "%.9g"

    @cached_property
    def words(self) -> Words:
        """Words for factors and responses."""
        return Words(self.trials.factors, self.screening.responses.meanings)

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return all tables but the design."""
        return tables.all_tables(self.screening, self.trials.factors, self.compared)

    def write(self, folder: Path) -> None:
        """Write the tables and the design. One screening always results in the same bytes."""
        values = tables.physical_values(self.screening.design, self.trials.factors)
        write_design(self.screening.design, folder / "design.csv", values)
        super().write(folder)

    def as_json(self) -> dict[str, Any]:
        """Return the result for JSON."""
        return tables.as_plain_data(self.screening, self.compared)

    def terminal(self) -> Printed:
        """Return percentages of the variance, the check, a summary and the proposed setting."""
        design, published = self.screening.design, self.compared.published
        about = f"{design.kind}, {design.trials} trials, D-efficiency {design.efficiency():.2f} %"
        is_wide = Console().width >= WIDE
        variance = tables.variance(
            self.screening, self.words, published, short=True, has_terms=is_wide
        )
        title = f"Percent of the variance explained ({about})"
        shown: list[Any] = [variance.terminal(title)]
        if published.has_terms:
            shown.append(
                "In parentheses: the published percentage of a leading term;"
                f"{tables.SIGN_MARK} if its effect has another sign."
            )
        if self.compared.check is not None:
            table = tables.check(self.compared.check, self.words, short=True)
            shown.append(table.terminal("Fitted model and runs of --check"))
        shown += summary(self.screening, self.words, self.compared)
        proposal = self.compared.proposal
        if proposal is not None:
            shown.append(answer(proposal, self.words))
            shown += [f"{w}: {t}" for w, t in in_short(proposal, self.screening, self.words)]
        return shown

    def warnings(self) -> list[str]:
        """Return what limits the use of the result."""
        return warnings(self.screening, self.words)

    def failures(self) -> list[str]:
        """Return a line for each run that diverged."""
        failed = self.screening.responses.failed.items()
        return [f"trial {trial + 1}, load {load}: {why}" for (trial, load), why in failed]

    def page(self, facts: Facts) -> str:
        """Return the page: the proposed setting, what to do, effects, the model, tables."""
        screening, words, parameters = self.screening, self.words, self.trials.parameters
        findings = summary(screening, words, self.compared)
        proposal = self.compared.proposal
        models = proposal.check.surfaces if proposal else surfaces(screening)
        return SectionedPage(
            f"Gasket study of machine {parameters.name}",
            answer(proposal, words) if proposal else " ".join(findings),
            [
                self._what_to_do(),
                Section("findings", "Findings of the study", remarks=findings, is_folded=True),
                Section("contributions", "Contributions", _heat_maps(screening, words)),
                Section("explore", "Explore the fitted model", body=self._explorer(models)),
                *self._load_sections(models),
                Section(
                    "spread", "Spread of the responses", _spreads(screening, words), is_folded=True
                ),
                *self._tables(),
            ],
            [
                ("Machine", parameters.name),
                ("SDF model", Path(parameters.model).name),
                ("Loads", ", ".join(case.name for case in self.trials.loads)),
                ("Computing time", f"{number(facts.wall_s)} s, excluding this report"),
                *_about_responses(screening, words),
                *facts.rows(),
            ],
            parameters,
            [*facts.warnings, *self.warnings(), *_warnings(screening, self.trials)],
            advice=self._proposed(),
            numbers_title="Parameters at level 0 of all factors",
            script=Path(__file__).with_name("explore.js"),
        ).html()

    def _proposed(self) -> Section | None:
        """Return the answer in short: the proposed setting with its runs."""
        proposal, screening, words = self.compared.proposal, self.screening, self.words
        if proposal is None:
            return None
        facts = in_short(proposal, screening, words)
        table = before_and_after(proposal, screening, words)
        return Section("", "In short", tables=(table,), facts=facts)

    def _what_to_do(self) -> Section:
        """Return the advice on each factor."""
        table = advice(self.trials.factors, self.screening, self.words, self.compared)
        return Section(
            "what-to-do", "What to do", tables=(table,), text=OTHER_GOALS, has_long_words=True
        )

    def _explorer(self, models: Surfaces) -> str:
        """Return the part of the page that computes predictions of the fitted models."""
        return fragment(
            Path(__file__).with_name("explore.html"),
            models=explorer_data(self.screening, models, self.trials, self.words),
            has_interactions=self.screening.design.model != "main",
        )

    def _load_sections(self, models: Surfaces) -> list[Section]:
        """Return a section of findings and pictures for each load."""
        screening, words = self.screening, self.words
        return [
            Section(
                f"load-{number}",
                f"Load {load}",
                _pictures(screening, load, words, models),
                text=EFFECTS,
                remarks=load_findings(screening, load, words),
                is_folded=True,
            )
            for number, load in enumerate(screening.loads, start=1)
        ]

    def _tables(self) -> list[Section]:
        """Return the sections of tables."""
        screening, words, compared = self.screening, self.words, self.compared
        published, zero, check = compared.published, compared.level_zero, compared.check
        loads, sections = screening.loads, list[Section]()

        def add(anchor: str, heading: str, *shown: Table, text: str = "") -> None:
            section = Section(anchor, heading, (), shown, text, has_long_words=True, is_folded=True)
            sections.append(section)

        if screening.responses.touching:
            add("contact", "Contact", tables.touching(screening, words))
        if check:
            add("check", "Check by runs", tables.check(check, words), text=about_check(check))
        variance = tables.variance(screening, words, published)
        add("variance", "Variance explained", variance, text=about_residual(screening))
        leading = (tables.leading(screening, load, words, published) for load in loads)
        add("leading", "Leading terms", *leading)
        terms = (tables.all_contributions(screening, load, words) for load in loads)
        add("all", "All terms", *terms)
        levels = tables.factors(self.trials.factors, words)
        add("design", "Design", tables.design(screening), levels)
        if zero:
            add("level-zero", "Level 0 and the machine", tables.level_zero(zero, words))
        return sections


def _warnings(screening: Screening, trials: GasketTrials) -> list[str]:
    sentences = []
    failed = list(screening.responses.failed.items())
    for (trial, load), reason in failed[:5]:
        sentences.append(
            f"Trial {trial + 1}, load {load}: {reason}. This run is excluded from the analysis."
        )
    if len(failed) > 5:
        sentences.append(
            f"{len(failed) - 5} more runs diverged and are excluded from the analysis. They are "
            "listed in runs.csv."
        )
    if screening.design.efficiency() < 80.0:
        percent = number(screening.design.efficiency(), 0)
        sentences.append(
            f"The D-efficiency of the design is only {percent} %. The design separates the effects "
            "of different terms poorly."
        )
    other = [case.name for case in trials.loads if case.profile != trials.parameters.profile]
    if other:
        sentences.append(
            f"Load {', '.join(other)}: the spin profile differs from the one in the machine file."
        )
    return sentences


def _about_responses(screening: Screening, words: Words) -> list[tuple[str, str]]:
    """Return symbols and what is measured, for each kind of response."""
    return [
        (", ".join(names), words.meaning(names[0]).about)
        for names in _by_kind(screening, words).values()
    ]


def _by_kind(screening: Screening, words: Words) -> dict[str, list[str]]:
    kinds: dict[str, list[str]] = {}
    for name in screening.names:
        kinds.setdefault(words.meaning(name).kind, []).append(name)
    return kinds


def _heat_maps(screening: Screening, words: Words) -> list[Picture]:
    """Return the contributions, two loads in a picture: more do not fit on paper."""
    caption = (
        "Contribution of each term to the variance of each response, in percent: main effects "
        "above, interactions below. The symbols of the responses are explained under Run details. "
        f"Terms that contribute less than {figures.SMALLEST_PERCENT:g} % to every response are "
        "not shown. The colour scale follows the square root of the percentage."
    )
    pairs = [screening.loads[i : i + 2] for i in range(0, len(screening.loads), 2)]
    return [
        picture(
            figures.heat_map_figure(screening, words, pair),
            f"Heat map of contributions, {', '.join(pair)}; the numbers are in the tables below.",
            caption,
        )
        for pair in pairs
    ]


def _spreads(screening: Screening, words: Words) -> list[Picture]:
    shown = []
    for kind, names in _by_kind(screening, words).items():
        caption = (
            f"{kind} of every run ({', '.join(names)}). Box: quartiles and median. Vertical line: "
            "smallest to largest value. The horizontal position of the points within a column is "
            "random and has no meaning."
        )
        figure = figures.spread_figure(screening, names, kind, words)
        alternative = f"Points and boxes of the {kind} over all trials, by load."
        shown.append(picture(figure, alternative, caption[0].upper() + caption[1:]))
    return shown


def _pictures(screening: Screening, load: str, words: Words, models: Surfaces) -> list[Picture]:
    shown = [
        picture(
            figures.pareto_figure(screening, load, words),
            f"Largest contributions to every response, load {load}.",
            f"Pareto chart of the contributions, load {load}: the largest shares of the variance "
            "of each response, in percent. Dashed lines: thresholds of [B] Table 5, 10 % for main "
            "effects and 5 % for interactions. Dotted line and grey bars: F test at 5 % against "
            "the residual. This is a yardstick only: the residual is what the model leaves out, "
            "not noise.",
        ),
        picture(
            figures.main_effects_figure(screening, load, words, models),
            f"Main effects of every factor on every response, load {load}.",
            f"Main effects, load {load}: mean response at the low, middle and high value of each "
            "factor, averaged over all values of the other factors. Black lines: factors that "
            "contribute 10 % of the variance or more. Vertical line: overall mean. Bars: 95 % "
            "intervals of the means.",
        ),
    ]
    several = len(screening.design.factors) > 1
    if several and screening.design.model != "main":
        shown.append(
            picture(
                figures.interactions_figure(screening, load, words),
                f"Strongest interaction of each response, load {load}.",
                f"Strongest interaction of each response, load {load}, with its contribution: mean "
                "response over the values of one factor, with one line per value of the other "
                "factor, named above the panel with its low, middle and high value. Without an "
                "interaction the lines would be parallel.",
            )
        )
    if several:
        shown.append(
            picture(
                figures.combinations_figure(screening, load, words),
                "Responses at the level combinations of the two most influential factors, "
                f"load {load}.",
                "Responses at each level combination of the two most influential factors, load "
                f"{load}: quartiles, median, smallest and largest value over the runs ([B] Fig. "
                "13). Colour: low, middle and high value of the factor named above the panel.",
            )
        )
    shown.append(
        picture(
            figures.residuals_figure(screening, load, words),
            f"Residual against fitted value of every run, load {load}.",
            f"Residual against fitted value of every run, load {load}, both in the unit of the "
            "response. A pattern shows that the model lacks terms.",
        )
    )
    return shown


def explorer_data(
    screening: Screening, surfaces: Surfaces, trials: GasketTrials, words: Words
) -> Markup:
    """Return the fitted models with the words for factors and responses, as JSON."""
    values = screening.responses.values
    data: dict[str, Any] = {
        "factors": [
            {
                "name": factor.name,
                "title": words.factor(factor.name),
                "unit": words.unit(factor.name),
                "numbers": [float(v) for v in next(iter(factor.numbers.values()))],
            }
            for factor in trials.factors
        ],
        "loads": screening.loads,
        "responses": [
            {
                "name": name,
                "title": words.response(name),
                "unit": screening.responses.units[name],
                "goal": words.meaning(name).goal,
                "low": float(min(frame[name].min() for frame in values.values())),
                "high": float(max(frame[name].max() for frame in values.values())),
            }
            for name in screening.names
        ],
        "interactions": surfaces.interactions,
        "models": {
            load: {name: _model(screening, surfaces, (load, name)) for name in screening.names}
            for load in screening.loads
        },
        **_inverses(surfaces),
    }
    return as_json(data)


def _model(screening: Screening, surfaces: Surfaces, label: Label) -> dict[str, Any]:
    table = screening.tables[label]
    return {
        "coefficients": packed(surfaces.coefficients[label]),
        "spread": surfaces.quantiles[label] * surfaces.deviations[label],
        "r2": table.predicted_r2,
        "percents": {term.name: term.percent for term in table.terms if len(term.factors) == 2},
    }


def _inverses(surfaces: Surfaces) -> dict[str, Any]:
    """Return the different matrices (X' X)^-1, and which of them each load has."""
    different: list[np.ndarray] = []
    of_load = {}
    for load, inverse in surfaces.inverses.items():
        same = [i for i, other in enumerate(different) if other is inverse]
        of_load[load] = same[0] if same else len(different)
        if not same:
            different.append(inverse)
    return {"inverses": [packed(m.ravel()) for m in different], "inverse_of": of_load}
