"""Report of a gasket study: one self-contained HTML file."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from wm_drake.report.formatting import number
from wm_drake.report.page import Picture, picture, render
from wm_drake.report.table import Table, parameter_table
from wm_drake.simulation.records import versions
from wm_drake.studies.gasket import figures
from wm_drake.studies.gasket import page_tables as tables
from wm_drake.studies.gasket.explore import explorer_data
from wm_drake.studies.gasket.findings import (
    about_check,
    about_residual,
    advice,
    load_findings,
    summary,
    warnings,
)
from wm_drake.studies.gasket.published import Published
from wm_drake.studies.gasket.screening import Screening
from wm_drake.studies.gasket.study import GasketTrials
from wm_drake.studies.gasket.surface import Surfaces, surfaces
from wm_drake.studies.gasket.words import Words
from wm_drake.studies.study import Facts

if TYPE_CHECKING:
    from wm_drake.studies.gasket.task import GasketResult


@dataclass(frozen=True)
class LoadView:
    """Section of the page about one load."""

    anchor: str
    title: str
    findings: tuple[str, ...]
    leading: Table
    contributions: Table
    pictures: tuple[Picture, ...]


def gasket_page(result: "GasketResult", made: Facts) -> str:
    """Return the page as text of one self-contained HTML file."""
    screening, trials, compared = result.screening, result.trials, result.compared
    parameters = trials.parameters
    words = Words(trials.factors, screening.responses.meanings)
    models = surfaces(screening)
    return render(
        Path(__file__).with_name("page.html"),
        title=f"Gasket study of machine {parameters.name}",
        about=parameters.about,
        summary=" ".join(summary(screening, words, compared)),
        advice=advice(screening, words),
        warnings=[*made.warnings, *warnings(screening, words), *_warnings(screening, trials)],
        heat_map=_heat_map(screening, words),
        variance=tables.variance(screening, words, compared.published),
        touching=tables.touching(screening, words) if screening.responses.touching else None,
        about_residual=about_residual(screening),
        spreads=_spreads(screening, words),
        loads=[
            _load_view(screening, index, load, words, compared.published, models)
            for index, load in enumerate(screening.loads)
        ],
        level_zero=compared.level_zero and tables.level_zero(compared.level_zero, words),
        models=explorer_data(screening, models, trials, words),
        has_interactions=screening.design.model != "main",
        check=compared.check and tables.check(compared.check, words),
        about_check=compared.check and about_check(compared.check),
        design=tables.design(screening),
        factors=tables.factors(trials.factors, words),
        responses=_about_responses(screening, words),
        facts=_facts(trials, made),
        numbers=parameter_table(parameters),
    )


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


def _facts(trials: GasketTrials, made: Facts) -> list[tuple[str, str]]:
    facts = [
        ("Machine", trials.parameters.name),
        ("About", trials.parameters.about),
        ("SDF model", Path(trials.parameters.model).name),
        ("Loads", ", ".join(case.name for case in trials.loads)),
        ("Engine", f"compiled, step {1e3 * made.step:g} ms, integrator {made.integrator}"),
        ("Versions", ", ".join(f"{name} {text}" for name, text in versions().items())),
        ("Computing time", f"{number(made.wall_s)} s, excluding this report"),
        ("Command", made.command),
    ]
    return [(word, text) for word, text in facts if text]


def _about_responses(screening: Screening, words: Words) -> list[str]:
    """Return a text for each kind of response: symbols, and what is measured."""
    return [
        f"{', '.join(names)}: {words.meaning(names[0]).about}."
        for names in _by_kind(screening, words).values()
        if words.meaning(names[0]).about
    ]


def _by_kind(screening: Screening, words: Words) -> dict[str, list[str]]:
    kinds: dict[str, list[str]] = {}
    for name in screening.names:
        kinds.setdefault(words.meaning(name).kind, []).append(name)
    return kinds


def _heat_map(screening: Screening, words: Words) -> Picture:
    caption = (
        "Contribution of each term to the variance of each response, in percent: main effects "
        "above, interactions below. The symbols of the responses are explained under Run details. "
        f"Terms that contribute less than {figures.SMALLEST_PERCENT:g} % to every response are "
        "not shown. The colour scale follows the square root of the percentage."
    )
    return picture(
        figures.heat_map_figure(screening, words),
        "Heat map of contributions; the numbers are in the tables below.",
        caption,
    )


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


def _load_view(
    screening: Screening,
    index: int,
    load: str,
    words: Words,
    published: Published,
    models: Surfaces,
) -> LoadView:
    return LoadView(
        anchor=f"load-{index + 1}",
        title=load,
        findings=tuple(load_findings(screening, load, words)),
        leading=tables.leading(screening, load, words, published),
        contributions=tables.contributions(screening, load, words),
        pictures=tuple(_pictures(screening, load, words, models)),
    )


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
