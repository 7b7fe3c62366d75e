"""Show the gasket study: the proposed setting, why, effects, the fitted model, tables."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from markupsafe import Markup

from wm_drake.report.formatting import listed
from wm_drake.report.interactive import packed
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.page import as_json, fragment
from wm_drake.report.quantity import SHARE, each_of, shown
from wm_drake.simulation.measures.responses import GAP
from wm_drake.studies.answer import Answer, Part, Plot
from wm_drake.studies.gasket import figures, tables
from wm_drake.studies.gasket.findings import (
    EFFICIENCY,
    about_check,
    about_residual,
    answer_text,
    level_zero_text,
    load_findings,
    summary,
    warnings,
    why_text,
)
from wm_drake.studies.gasket.screening import is_main
from wm_drake.studies.gasket.study import GasketTrials
from wm_drake.studies.gasket.words import Words
from wm_drake.studies.proposal_page import gaps_text, proposal_part

LEAST_EFFICIENCY = 80.0
"""D-efficiency below which a design is warned of. [%]"""

MOST_FAILED = 5
"""Largest number of failed runs that a warning names."""


@dataclass(frozen=True)
class Comparisons:
    """What is shown next to a screening; datasets without variables are left out.

    Attributes:
        published: As of `screening.published_for`.
        level_zero: As of `study.run_level_zero`.
        check: Chosen settings, as of `surface.run_settings`.
        proposed: Level 0 and the proposed setting with all loads of the machine, likewise.
        proposal: As of `wm_drake.studies.proposal.proposal_of`.
        tables: Treatment of stiffness tables in the study.
        changed: Places of the factors that the proposal changes, by name. [levels]
        is_machine: Whether level 0 is the machine.
    """

    published: xr.Dataset = field(default_factory=xr.Dataset)
    level_zero: xr.Dataset = field(default_factory=xr.Dataset)
    check: xr.Dataset = field(default_factory=xr.Dataset)
    proposed: xr.Dataset = field(default_factory=xr.Dataset)
    proposal: xr.Dataset = field(default_factory=xr.Dataset)
    tables: str = ""
    changed: Mapping[str, float] = field(default_factory=dict)
    is_machine: bool = True


NO_COMPARISONS = Comparisons()
"""A screening with nothing beside it."""


def gasket_answer(
    screening: xr.Dataset,
    models: xr.Dataset,
    trials: GasketTrials,
    compared: Comparisons = NO_COMPARISONS,
) -> Answer:
    """Return the answer of the study.

    Args:
        screening: As of `screening.run_screening`.
        models: As of `surface.models_of`.
        trials: What was run.
        compared: What is shown next to it.
    """
    words, parameters = Words(trials.factors, screening), trials.parameters
    findings = summary(screening, words, compared.published, compared.check)
    if compared.level_zero:
        findings.append(level_zero_text(compared.level_zero, words, compared.tables))
    explorer = partial(_explorer, screening, models, trials, compared.changed)
    loads = screening["load"].values.tolist()
    return Answer(
        f"Gasket study of machine {parameters.name}",
        answer_text(screening, words),
        parameters,
        (
            Part("Findings of the study", remarks=findings, is_folded=True),
            Part("Contributions", _heat_maps(screening, words)),
            Part("Explore: the fitted model", body=explorer),
            *(_load_part(screening, models, load, words) for load in loads),
            Part("Spread of the responses", _spreads(screening, words), is_folded=True),
            *_table_parts(screening, trials, compared, words),
        ),
        (
            ("SDF model", Path(parameters.model).name),
            ("Loads", ", ".join(loads)),
            *_about_responses(screening),
            ("Axes", "seen from the door, x points right, y along the drum axis to the rear, z up"),
            *_other_profile(trials),
            ("Parameters", "those of level 0 of all factors"),
        ),
        warned=(*warnings(screening, words), *_warned(screening)),
        short=_short(screening, compared, words) if compared.proposal else None,
        diverged=tuple(_failed(screening)),
        script=Path(__file__).with_name("explore.js"),
    )


def _short(screening: xr.Dataset, compared: Comparisons, words: Words) -> Part:
    """Return the part in short: what is proposed, why, its costs and its runs."""
    proposal, runs = compared.proposal, compared.proposed
    facts = []
    if GAP in runs.response.values:
        facts.append(("Gap by load", gaps_text(runs.run.sel(response=GAP))))
    if proposal.is_confirmed:
        new = runs.isel(setting=-1)
        facts.append(
            (
                "Verified by runs",
                f"{runs.sizes['setting'] * runs.sizes['load']} runs, {runs.sizes['load']} loads; "
                f"{about_check(new)}",
            )
        )
    every, studied = runs["load"].values.tolist(), screening["load"].values.tolist()
    left_out = [load for load in every if load not in studied]
    text = f"{listed(studied)}: all loads of the machine"
    if left_out:
        text = f"{listed(studied)}; in the runs of the proposal also {listed(left_out)}"
    return proposal_part(
        proposal,
        why_text(screening, proposal, list(compared.changed), words),
        words.labels(),
        [*facts, ("Loads", text)],
        machine="the machine" if compared.is_machine else "level 0",
    )


def _explorer(
    screening: xr.Dataset, models: xr.Dataset, trials: GasketTrials, changed: Mapping[str, float]
) -> str:
    """Return the part of the page that computes predictions of the fitted models."""
    return fragment(
        Path(__file__).with_name("explore.html"),
        models=explorer_data(screening, models, trials, changed),
        has_interactions=models.interactions,
        has_proposed=bool(changed),
    )


def explorer_data(
    screening: xr.Dataset, models: xr.Dataset, trials: GasketTrials, changed: Mapping[str, float]
) -> Markup:
    """Return the fitted models with the words for factors and responses, as JSON.

    Args:
        screening: As of `screening.run_screening`.
        models: As of `surface.models_of`.
        trials: What was run.
        changed: Places of the proposal, as of `Comparisons`, which are shown first.
    """
    words = Words(trials.factors, screening)
    loads, names = models["load"].values.tolist(), models.response.values.tolist()
    each = each_of(screening.value)
    pairs = screening.term.values[~is_main(screening.term)].tolist()
    return as_json(
        {
            "factors": [
                {
                    "name": factor.name,
                    "title": words.factor(factor.name),
                    "unit": words.quantity(factor.name).unit_text,
                    "written": words.quantity(factor.name).reading.shown,
                    "numbers": words.quantity(factor.name).values(words.numbers(factor.name)),
                }
                for factor in trials.factors
            ],
            "loads": loads,
            "responses": [
                {"name": name, "title": words.response(name), "unit": each[name].unit_text}
                for name in names
            ],
            "proposed": [changed.get(f.name, 0.0) for f in trials.factors] if changed else None,
            "interactions": models.interactions,
            "models": {
                load: {
                    name: _model(models.sel(load=load, response=name))
                    | {"percents": dict(zip(pairs, _percents(screening, load, name), strict=True))}
                    for name in names
                }
                for load in loads
            },
            **_inverses(models),
        }
    )


def _model(of_label: xr.Dataset) -> dict[str, Any]:
    return {
        "coefficients": packed(shown(of_label.coefficient)),
        "spread": float(shown(of_label.spread)),
    }


def _percents(screening: xr.Dataset, load: str, name: str) -> list[float]:
    """Return the contributions of the interactions to a response. [%]"""
    share = screening.share.sel(load=load, response=name)
    return [float(value) for value in shown(share.isel(term=~is_main(share.term)))]


def _inverses(models: xr.Dataset) -> dict[str, Any]:
    """Return the different matrices (X' X)^-1, and which of them each load has."""
    different: list[np.ndarray] = []
    of_load = {}
    for load in models["load"].values.tolist():
        inverse = models.inverse.sel(load=load).values
        same = [i for i, other in enumerate(different) if np.array_equal(other, inverse)]
        of_load[load] = same[0] if same else len(different)
        if not same:
            different.append(inverse)
    return {"inverses": [packed(m.ravel()) for m in different], "inverse_of": of_load}


def _table_parts(
    screening: xr.Dataset, trials: GasketTrials, compared: Comparisons, words: Words
) -> list[Part]:
    """Return the folded parts of tables."""
    published, zero, check = compared.published, compared.level_zero, compared.check
    contributions = tables.contribution_tables(screening, words)

    def part(heading: str, *listed_tables: LabelledTable, text: str = "") -> Part:
        return Part(heading, listed_tables, text, has_long_words=True, is_folded=True)

    design = tables.design_table(screening.design), tables.factors_table(trials, words)
    parts = []
    if screening.overlap.notnull().any():
        parts.append(part("Contact", tables.touching_table(screening, trials)))
    if check:
        parts.append(
            part("Check by runs", tables.check_table(check, words), text=about_check(check))
        )
    parts += [
        part(
            "Variance explained",
            tables.variance_table(screening, published, words),
            text=about_residual(screening.design),
        ),
        part("Leading terms", tables.leading_table(screening, published, words)),
        part("All terms", *contributions),
        part("Design", *design, *tables.run_tables(screening, trials)),
    ]
    if zero:
        parts.append(part("Level 0 and the machine", tables.level_zero_table(zero, words)))
    if published:
        parts.append(Part("Published", [tables.published_table(screening, published)]))
    if compared.proposed:
        parts.append(Part("Proposal", [LabelledTable("proposal_runs", compared.proposed)]))
    return parts


def _failed(screening: xr.Dataset) -> list[str]:
    """Return a line for each run that diverged."""
    failed = screening.failed.stack(run=("trial", "load"))
    return [
        f"trial {one.trial.item()}, load {one['load'].item()}: {one.item()}"
        for one in failed.isel(run=(failed != "").values)
    ]


def _warned(screening: xr.Dataset) -> list[str]:
    sentences, failed = [], _failed(screening)
    if failed:
        more = f"; {len(failed) - MOST_FAILED} more" if len(failed) > MOST_FAILED else ""
        sentences.append(
            f"Runs that diverged are left out of the analysis: {'; '.join(failed[:MOST_FAILED])}"
            f"{more}. They are marked in runs.csv, column failed."
        )
    if screening.design.efficiency() < LEAST_EFFICIENCY:
        efficiency = EFFICIENCY.text(screening.design.efficiency())
        sentences.append(
            f"The D-efficiency of the design is only {efficiency}. The design separates the "
            "effects of different terms poorly."
        )
    return sentences


def _other_profile(trials: GasketTrials) -> list[tuple[str, str]]:
    """Return which loads have another spin profile than the machine file, if there are any."""
    other = [case.name for case in trials.loads if case.profile != trials.parameters.profile]
    text = f"differs from the one in the machine file, for {', '.join(other)}"
    return [("Spin profile", text)] if other else []


def _by_kind(screening: xr.Dataset) -> dict[str, list[str]]:
    kinds: dict[str, list[str]] = {}
    for name, kind in zip(screening.response.values.tolist(), screening.kind.values, strict=True):
        kinds.setdefault(str(kind), []).append(name)
    return kinds


def _about_responses(screening: xr.Dataset) -> list[tuple[str, str]]:
    """Return symbols and what is measured, for each kind of response."""
    return [
        (", ".join(names), screening.about.sel(response=names[0]).item())
        for names in _by_kind(screening).values()
    ]


def _heat_maps(screening: xr.Dataset, words: Words) -> list[Plot]:
    """Return the contributions, two loads in a picture: more do not fit on paper."""
    caption = (
        "Contribution of each term to the variance of each response, in percent: main effects "
        "above, interactions below. The symbols of the responses are explained under Run details. "
        f"Terms that contribute less than {SHARE.text(figures.SMALLEST_SHARE)} to every response "
        "are not shown. The colour scale follows the square root of the percentage."
    )
    loads = screening["load"].values.tolist()
    pairs = [loads[i : i + 2] for i in range(0, len(loads), 2)]
    return [
        Plot(
            figures.heat_map_figure(screening, words, pair),
            f"Heat map of contributions, {', '.join(pair)}; the numbers are in the tables below.",
            caption,
        )
        for pair in pairs
    ]


def _spreads(screening: xr.Dataset, words: Words) -> list[Plot]:
    return [
        Plot(
            figures.spread_figure(screening, names, words),
            f"Points and boxes of the {kind} over all trials, by load.",
            f"{kind[:1].upper()}{kind[1:]} of every run ({', '.join(names)}). Box: quartiles and "
            "median. Vertical line: smallest to largest value. The horizontal position of the "
            "points within a column is random and has no meaning.",
        )
        for kind, names in _by_kind(screening).items()
    ]


EFFECTS = (
    "Effect of the most important factors on each response. Percentages are shares of the variance "
    "of the response."
)


def _load_part(screening: xr.Dataset, models: xr.Dataset, load: str, words: Words) -> Part:
    """Return the part of findings and pictures of a load."""
    pictures = [
        Plot(
            figures.pareto_figure(screening, load, words),
            f"Largest contributions to every response, load {load}.",
            f"Pareto chart of the contributions, load {load}: the largest shares of the variance "
            "of each response, in percent. Dashed lines: thresholds of [B] Table 5, 10 % for main "
            "effects and 5 % for interactions. Dotted line and grey bars: F test at 5 % against "
            "the residual. This is a yardstick only: the residual is what the model leaves out, "
            "not noise.",
        ),
        Plot(
            figures.main_effects_figure(screening, load, words, models),
            f"Main effects of every factor on every response, load {load}.",
            f"Main effects, load {load}: mean response at the low, middle and high value of each "
            "factor, averaged over all values of the other factors. Black lines: factors that "
            "contribute 10 % of the variance or more. Vertical line: overall mean. Bars: 95 % "
            "intervals of the means.",
        ),
        *_pairs_of_factors(screening, load, words),
        Plot(
            figures.residuals_figure(screening, load, words),
            f"Residual against fitted value of every run, load {load}.",
            f"Residual against fitted value of every run, load {load}, both in the unit of the "
            "response. A pattern shows that the model lacks terms.",
        ),
    ]
    findings = load_findings(screening, load, words)
    return Part(f"Load {load}", pictures, EFFECTS, remarks=findings, is_folded=True)


def _pairs_of_factors(screening: xr.Dataset, load: str, words: Words) -> Sequence[Plot]:
    """Return the pictures of two factors together; none of a study of one factor."""
    if len(screening.design.factors) < 2:
        return []
    interactions = Plot(
        figures.interactions_figure(screening, load, words),
        f"Strongest interaction of each response, load {load}.",
        f"Strongest interaction of each response, load {load}, with its contribution: mean "
        "response over the values of one factor, with one line per value of the other factor, "
        "named above the panel with its low, middle and high value. Without an interaction the "
        "lines would be parallel.",
    ) if screening.design.model != "main" else None  # fmt: skip
    combinations = Plot(
        figures.combinations_figure(screening, load, words),
        f"Responses at the level combinations of the two most influential factors, load {load}.",
        "Responses at each level combination of the two most influential factors, load "
        f"{load}: quartiles, median, smallest and largest value over the runs ([B] Fig. 13). "
        "Colour: low, middle and high value of the factor named above the panel.",
    )
    return [*([interactions] if interactions else []), combinations]
