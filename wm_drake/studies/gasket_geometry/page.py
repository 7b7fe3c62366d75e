"""Page of the study of drawings of a gasket."""

import numpy as np

from wm_drake.report.figure import MEASURED, OURS, Axis, Figure, Line, Panel, Points, in_grid
from wm_drake.report.formatting import number, significant
from wm_drake.report.page import Picture, picture
from wm_drake.report.sections import Section, SectionedPage
from wm_drake.report.table import Column, Table, line
from wm_drake.studies.gasket_geometry.study import GAP, RESPONSES, GeometryResult
from wm_drake.studies.gasket_geometry.tables import contributions_table
from wm_drake.studies.study import Facts

METHOD = (
    "The drawings are a Latin hypercube of the factors. Finite elements give the curves of each, "
    "and the machine runs all loads with each gasket. The responses are fitted with polynomials of "
    "degree two (degree one if there are few drawings). The error is that on fresh drawings, by "
    "the range of the response in the design. The drawing with the largest gap on the surface, "
    "within the limits, is computed and run too; the best drawing is that with the largest gap of "
    "all that were run and keep the limits. "
    "Folds that touch hold each other off, unless the drawing has contact: false."
)


def geometry_page(result: GeometryResult, facts: Facts) -> str:
    """Return the page as text of one self-contained HTML file."""
    made = [
        ("Drawing", result.name),
        (
            "Drawings",
            f"{result.design} of the design, {len(result.levels) - result.design - 1} fresh",
        ),
        ("Loads", ", ".join(result.loads)),
        ("Limits", _limits_text(result)),
        *facts.rows(),
    ]
    return SectionedPage(
        f"Drawings of gasket {result.name}",
        summary(result),
        [
            Section("curves", "Gap over each factor", (_over_factors(result),)),
            Section("surfaces", "Surface and runs", (_agreement(result),)),
            Section("factors", "What each factor does", tables=(contributions_shown(result),)),
            Section("files", "Files", links=(("best.yaml", "the best drawing"),)),
        ],
        made,
        warnings=(*facts.warnings, *result.warnings()),
        about="Wall, folds, hardness: which drawing leaves the largest gap.",
        method=METHOD,
    ).html()


def summary(result: GeometryResult) -> str:
    """Return the result in a few sentences."""
    best = ", ".join(
        f"{factor.words} {significant(factor.value(level), 3)} {factor.unit}"
        for factor, level in zip(
            result.factors, result.levels[result.best_at].tolist(), strict=True
        )
    )
    gap = result.responses[GAP]
    expected = float(result.surfaces[GAP].at(result.levels[-1:])[0])
    middle = float(result.surfaces[GAP].at(np.zeros((1, len(result.factors))))[0])
    return (
        f"Best drawing that was run: {best}. Its smallest gap is {number(gap[result.best_at], 2)} "
        f"mm. Limits: {_limits_text(result)}. In the middle of the ranges the surface has "
        f"{number(middle, 2)} mm. The drawing with "
        f"the largest gap on the surface, {number(expected, 2)} mm, has {number(gap[-1], 2)} mm "
        f"when it is run. Error of the surface of the gap on fresh drawings: "
        f"{number(result.errors(GAP))} % of the range."
    )


def _limits_text(result: GeometryResult) -> str:
    texts = [f"{RESPONSES[name]} up to {limit:g}" for name, limit in result.limits.items()]
    return "; ".join(texts) or "none"


def _over_factors(result: GeometryResult) -> Picture:
    surface, levels = result.surfaces[GAP], np.linspace(-1.0, 1.0, 41)
    panels = []
    for index, factor in enumerate(result.factors):
        at = np.zeros((len(levels), len(result.factors)))
        at[:, index] = levels
        x = factor.middle + factor.half * levels
        drawn = factor.middle + factor.half * result.levels[:, index]
        marks = (
            Line(x, surface.at(at), key="surface, others in the middle"),
            Points(drawn, result.responses[GAP], color=MEASURED, size=5.0, key="drawings"),
        )
        label = f"{factor.words}, {factor.unit}"
        panels.append(Panel(marks=marks, x=Axis(label=label), y=Axis(label=RESPONSES[GAP])))
    caption = "Smallest gap of all loads over each factor."
    return picture(
        Figure(panels=in_grid(panels, 2, share="y"), height=220.0),
        "Four panels: the smallest gap over each factor.",
        caption,
    )


def _agreement(result: GeometryResult) -> Picture:
    panels = []
    for name, words in RESPONSES.items():
        computed, surface = result.responses[name], result.surfaces[name].at(result.levels)
        ends = np.array([computed.min(), computed.max()])
        at, count = slice(result.design, -1), result.design
        marks = (
            Line(ends, ends, color=MEASURED, width=1.0),
            Points(computed[:count], surface[:count], color=OURS, size=5.0, key="design"),
            Points(computed[at], surface[at], color=MEASURED, symbol="square", key="fresh"),
        )
        panels.append(
            Panel(title=words, marks=marks, x=Axis(label="computed"), y=Axis(label="surface"))
        )
    return picture(
        Figure(panels=in_grid(panels, 3), height=200.0),
        "Response of the surface over the computed one, for each response.",
        "Surface over computed response; squares: drawings that the fit does not know.",
    )


def contributions_shown(result: GeometryResult) -> Table:
    """Return what each factor contributes, in units for reading."""
    groups = []
    for row in contributions_table(result).to_dict("records"):
        cells = [row["mean"]]
        for factor in result.factors:
            cells += [row[f"{factor.name}_percent"], row[f"{factor.name}_change"]]
        cells += [row["pairs_percent"], row["error_on_fresh_percent_of_range"]]
        groups.append(line(RESPONSES[row["response"]], cells))
    columns = [Column("response"), Column("mean", decimals=2)]
    for factor in result.factors:
        columns += [Column(factor.name, "%", 0), Column(f"its change over {factor.name}", "", 2)]
    columns += [Column("pairs", "%", 0), Column("error on fresh", "% of range", 1)]
    caption = (
        "Part of each factor in the variance of a response over the ranges, and the change of the "
        "response from its low to its high end. The response is the worst of all loads."
    )
    return Table(caption, tuple(columns), tuple(groups))
