"""Report of a gasket study: one self-contained HTML file."""

from dataclasses import dataclass
from pathlib import Path

from wm_drake.parameters.machine import DEFAULT_STEP
from wm_drake.report.formatting import number
from wm_drake.report.gasket import figures, tables
from wm_drake.report.gasket.findings import about_residual, findings, load_findings, summary
from wm_drake.report.page import Picture, picture, render
from wm_drake.report.tables import Table, parameter_table
from wm_drake.simulation.records import versions
from wm_drake.studies.gasket.screening import Screening
from wm_drake.studies.gasket.study import GasketTrials

KINDS = {"D": "displacement", "F": "force", "M": "moment"}
"""Quantity of a response, by the first letter of its name."""


@dataclass(frozen=True)
class LoadView:
    """Section of the page about one load."""

    anchor: str
    title: str
    findings: tuple[str, ...]
    leading: Table
    contributions: Table
    pictures: tuple[Picture, ...]


def gasket_report(
    screening: Screening, trials: GasketTrials, command: str = "", wall_s: float = float("nan")
) -> str:
    """Return the report as text of one self-contained HTML file.

    Args:
        screening: Result of the study.
        trials: Trials that were run.
        command: Command line of the study, shown on the page.
        wall_s: Computing time. [s]
    """
    parameters = trials.parameters
    return render(
        "gasket/page.html",
        title=f"Gasket study of machine {parameters.name}",
        about=parameters.about,
        summary=summary(screening),
        findings=findings(screening),
        warnings=_warnings(screening, trials),
        heat_map=_heat_map(screening),
        variance=tables.variance(screening),
        about_residual=about_residual(screening),
        spreads=_spreads(screening),
        loads=[_load_view(screening, index, load) for index, load in enumerate(screening.loads)],
        design=tables.design(screening),
        factors=tables.factors(trials.factors),
        facts=_facts(trials, command, wall_s),
        numbers=parameter_table(parameters),
    )


def _warnings(screening: Screening, trials: GasketTrials) -> list[str]:
    found = []
    failed = list(screening.responses.failed.items())
    for (trial, load), reason in failed[:5]:
        found.append(
            f"Trial {trial + 1}, load {load}: {reason}. This run is excluded from the analysis."
        )
    if len(failed) > 5:
        found.append(
            f"{len(failed) - 5} more runs diverged and are excluded from the analysis. They are "
            "listed in runs.csv."
        )
    if screening.design.efficiency() < 80.0:
        percent = number(screening.design.efficiency(), 0)
        found.append(
            f"The D-efficiency of the design is only {percent} %. The design separates the effects "
            "of different terms poorly."
        )
    other = [case.name for case in trials.loads if case.profile != trials.parameters.profile]
    if other:
        found.append(
            f"Load {', '.join(other)}: the spin profile differs from the one in the machine file."
        )
    return found


def _facts(trials: GasketTrials, command: str, wall_s: float) -> list[tuple[str, str]]:
    facts = [
        ("Machine", trials.parameters.name),
        ("About", trials.parameters.about),
        ("SDF model", Path(trials.parameters.model).name),
        ("Loads", ", ".join(case.name for case in trials.loads)),
        ("Engine", f"compiled, step {1e3 * DEFAULT_STEP:g} ms"),
        ("Versions", ", ".join(f"{name} {text}" for name, text in versions().items())),
        ("Computing time", f"{number(wall_s)} s, excluding this report"),
        ("Command", command),
    ]
    return [(word, text) for word, text in facts if text]


def _heat_map(screening: Screening) -> Picture:
    caption = (
        "Contribution of each term to the variance of each response, in percent: main effects "
        "above, interactions below. D: largest displacement of the tub point nearest to the "
        "detergent box. F, M: largest force and moment of the gasket on the housing. Terms that "
        f"contribute less than {figures.SMALLEST_PERCENT:g} % to every response are not shown. "
        "The colour scale follows the square root of the percentage."
    )
    return picture(
        figures.heat_map_figure(screening),
        "Heat map of contributions; the numbers are in the tables below.",
        caption,
    )


def _spreads(screening: Screening) -> list[Picture]:
    shown = []
    for letter, what in KINDS.items():
        names = [name for name in screening.names if name.startswith(letter)]
        if names:
            caption = (
                f"Largest {what} of every run ({', '.join(names)}). Box: quartiles and median. "
                "Vertical line: smallest to largest value. The horizontal position of the points "
                "within a column is random and has no meaning."
            )
            figure = figures.spread_figure(screening, names, f"largest {what}")
            shown.append(
                picture(
                    figure,
                    f"Points and boxes of the largest {what} over all trials, by load.",
                    caption,
                )
            )
    return shown


def _load_view(screening: Screening, index: int, load: str) -> LoadView:
    return LoadView(
        anchor=f"load-{index + 1}",
        title=load,
        findings=tuple(load_findings(screening, load)),
        leading=tables.leading(screening, load),
        contributions=tables.contributions(screening, load),
        pictures=tuple(_pictures(screening, load)),
    )


def _pictures(screening: Screening, load: str) -> list[Picture]:
    shown = [
        picture(
            figures.main_effects_figure(screening, load),
            f"Main effects of every factor on every response, load {load}.",
            f"Main effects, load {load}: mean response at the levels −1, 0 and +1 of each factor, "
            "averaged over all levels of the other factors. Blue: factors that contribute 10 % of "
            "the variance or more. Horizontal line: overall mean.",
        )
    ]
    if screening.design.model != "main":
        shown.append(
            picture(
                figures.interactions_figure(screening, load),
                f"Strongest interaction of each response, load {load}.",
                f"Strongest interaction of each response, load {load}, with its contribution: mean "
                "response over the levels of one factor, with one line per level of the other "
                "factor. Without an interaction the lines would be parallel.",
            )
        )
    if len(screening.design.factors) > 1:
        shown.append(
            picture(
                figures.combinations_figure(screening, load),
                "Responses at the level combinations of the two most influential factors, "
                f"load {load}.",
                "Responses at each level combination of the two most influential factors, load "
                f"{load}: quartiles, median, smallest and largest value over the runs ([B] Fig. "
                "13).",
            )
        )
    shown.append(
        picture(
            figures.residuals_figure(screening, load),
            f"Residual against fitted value of every run, load {load}.",
            f"Residual against fitted value of every run, load {load}, both in the unit of the "
            "response. A pattern shows that the model lacks terms.",
        )
    )
    return shown
