"""Figures of a screening study: contributions, spread, effects, interactions, residuals."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import PowerNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from scipy.special import fdtri

from wm_drake.parameters.types import FloatArray
from wm_drake.report.figures import GRID, MARK, MEASURED, OURS, QUIET, WIDTH, name_ticks
from wm_drake.report.formatting import number
from wm_drake.report.gasket.words import LEVELS, Words
from wm_drake.studies.doe.anova import AnovaTable, Term
from wm_drake.studies.gasket.screening import (
    LEADING_INTERACTION_PERCENT,
    LEADING_MAIN_PERCENT,
    Label,
    Screening,
    contributions,
    main_effects,
    mean_at,
)
from wm_drake.studies.gasket.surface import Surfaces

LEVEL_COLOURS = (OURS, QUIET, MEASURED)
"""Colours of the levels -1, 0 and 1."""

LEVEL_WORDS = ("low", "middle", "high")
"""Words for the levels -1, 0 and 1."""

LEVEL_MARKS = ("v", "o", "^")
"""Marks of the levels -1, 0 and 1, which stay distinct in grey print."""

SMALLEST_PERCENT = 1.0
"""Smallest contribution to any response with which a term is shown in the heat map."""

MOST_POINTS = 1500
"""Largest number of points of a scatter plot; of more points, every n-th is drawn."""

CHARACTER = 0.08
"""Width of a character of a label. [in]"""

COLUMNS = 3
"""Number of panels in a row."""

PARETO_BARS = 8
"""Number of bars of a panel of the Pareto chart."""

SIGNIFICANCE = 0.05
"""Probability below which an F test is called significant."""

INTERACTION, GREY = "#56b4e9", "#b8bec6"
"""Colours of interactions and of terms that are not significant in the Pareto chart."""


def heat_map_figure(screening: Screening, words: Words) -> Figure:
    """Draw the contributions in percent: one row per term, one column per load and response."""
    table = contributions(screening).fillna(0.0)
    shown = table[table.max(axis=1) >= SMALLEST_PERCENT]
    values = shown.to_numpy()
    labels = list(screening.tables)
    longest = max(len(name) for _, name in labels)
    is_long = longest > 4
    names_height = 5.0 * longest if is_long else 0.0  # points
    height = 0.27 * len(shown) + 1.5 + names_height / 72.0
    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    axes = figure.subplots()
    # the square root makes small contributions visible
    image = axes.imshow(values, cmap="Blues", norm=PowerNorm(0.5, 0.0, 100.0), aspect="auto")
    for (row, column), value in np.ndenumerate(values):
        if value >= 0.5:
            colour = "white" if value > 40.0 else MARK
            axes.text(
                column, row, number(value, 0), ha="center", va="center", fontsize=8.5, color=colour
            )
    axes.set_yticks(
        range(len(shown)),
        [words.term(str(name)) for name in shown.index],
        fontsize=8.5,
        parse_math=False,
    )
    axes.set_xticks(
        range(len(labels)),
        [name for _, name in labels],
        fontsize=9,
        rotation=90 if is_long else 0,
        parse_math=False,
    )
    axes.xaxis.tick_top()
    axes.tick_params(length=0)
    for index, load in enumerate(screening.loads):
        first = len(screening.names) * index
        middle = first + 0.5 * (len(screening.names) - 1)
        axes.annotate(
            f"load {load}",
            (middle, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(0, 22 + names_height),
            textcoords="offset points",
            ha="center",
            fontsize=10,
            fontweight="bold",
            parse_math=False,
        )
        if index:
            axes.axvline(first - 0.5, color="white", linewidth=5.0)
    mains = sum(":" not in str(name) for name in shown.index)
    if 0 < mains < len(shown):
        axes.axhline(mains - 0.5, color="white", linewidth=5.0)
    for side in axes.spines.values():
        side.set_visible(False)
    bar = figure.colorbar(
        image, ax=axes, fraction=0.025, pad=0.015, ticks=[0, 1, 5, 10, 25, 50, 100]
    )
    bar.ax.set_yticklabels(["0", "1", "5", "10", "25", "50", "100 %"], fontsize=8.5)
    bar.outline.set_visible(False)
    return figure


def spread_figure(screening: Screening, names: Sequence[str], what: str, words: Words) -> Figure:
    """Draw all values of some responses, one panel per load, as [B] Figs. 10-12.

    The values are points, with a box from the first to the third quartile.
    """
    figure = Figure(figsize=(WIDTH, 3.7), layout="constrained")
    panels = figure.subplots(1, len(screening.loads), squeeze=False, sharey=True)[0]
    rng = np.random.default_rng(0)  # for the horizontal spread, which has no meaning
    for axes, load in zip(panels, screening.loads, strict=True):
        boxes: dict[float, FloatArray] = {}
        for place, name in enumerate(names):
            every = screening.responses.values[load][name].dropna().to_numpy()
            values = _thinned(every)
            axes.plot(
                place + rng.uniform(-0.28, 0.28, len(values)),
                values,
                ".",
                color=OURS,
                alpha=0.35,
                markersize=3.0,
                markeredgewidth=0.0,
                rasterized=True,
            )
            boxes[place] = every
        _boxes(axes, boxes, 0.34)
        titles = [words.response(name) for name in names]
        width = WIDTH / len(screening.loads) / len(names) / CHARACTER
        is_long = max(map(len, titles)) > width
        axes.set_xticks(
            range(len(names)), titles, fontsize=9, rotation=90 if is_long else 0, parse_math=False
        )
        axes.set_xlim(-0.6, len(names) - 0.4)
        axes.set_title(
            f"load {load}", fontsize=10.5, loc="left", fontweight="bold", parse_math=False
        )
        _style_panel(axes, "y")
    # after all panels: a limit that is set earlier ends the common scaling with the first panel
    low, high = panels[0].get_ylim()
    smallest = min(v[name].min() for v in screening.responses.values.values() for name in names)
    panels[0].set_ylim(low if smallest < 0.0 else 0.0, high)
    if smallest < 0.0:
        for axes in panels:
            axes.axhline(0.0, color=MARK, linewidth=0.8)
    panels[0].set_ylabel(f"{what}, {screening.responses.units[names[0]]}", fontsize=9.5)
    return figure


def pareto_figure(screening: Screening, load: str, words: Words) -> Figure:
    """Draw the largest contributions to each response as sorted bars, one panel per response.

    Bars of terms that are not significant are grey. Dashed lines: the thresholds of [B] for main
    effects and interactions. Dotted line: where the F test of a main effect is significant at 5 %.
    """

    def draw(axes: Axes, label: Label) -> None:
        table = screening.tables[label]
        ranked = sorted(table.terms, key=lambda term: -np.nan_to_num(term.percent))[:PARETO_BARS]
        places = range(len(ranked))
        axes.barh(
            places,
            [float(np.nan_to_num(term.percent)) for term in ranked],
            color=[_pareto_colour(term) for term in ranked],
            height=0.72,
        )
        for value in (LEADING_MAIN_PERCENT, LEADING_INTERACTION_PERCENT):
            axes.axvline(value, color=MEASURED, linewidth=0.9, linestyle="--")
        significant = significant_percent(table)
        if significant is not None:
            axes.axvline(significant, color=MARK, linewidth=1.0, linestyle=":")
        name_ticks(axes, "y", places, [term.name.replace(":", " × ") for term in ranked])
        axes.set_ylim(len(ranked) - 0.5, -0.5)
        _style_panel(axes, "x")
        axes.tick_params(axis="y", labelsize=8, length=0)

    figure = _panels(screening, load, draw, words, extra=0.75, name_axis="x", unit="%")
    handles = [
        Patch(color=OURS, label="main effect"),
        Patch(color=INTERACTION, label="interaction"),
        Patch(color=GREY, label="not significant (F test, 5 %)"),
        Line2D([], [], color=MEASURED, linestyle="--", linewidth=0.9, label="thresholds of [B]"),
        Line2D([], [], color=MARK, linestyle=":", label="significant from here (main effects)"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=5, frameon=False, fontsize=9)
    return figure


def _pareto_colour(term: Term) -> str:
    if not term.p < SIGNIFICANCE:  # also of NaN, without degrees of freedom
        return GREY
    return OURS if len(term.factors) == 1 else INTERACTION


def significant_percent(table: AnovaTable) -> float | None:
    """Return the contribution at which the F test of a main effect is significant at 5 %.

    It is the same for all main effects of an orthogonal design; of another, this is the median.
    None without degrees of freedom or spread.
    """
    found = [
        term.percent * float(fdtri(term.df, table.residual_df, 1.0 - SIGNIFICANCE)) / term.f
        for term in table.terms
        if len(term.factors) == 1 and table.residual_df > 0 and np.isfinite(term.f) and term.f > 0.0
    ]
    known = [value for value in found if np.isfinite(value)]
    return float(np.median(known)) if known else None


def main_effects_figure(
    screening: Screening, load: str, words: Words, surfaces: Surfaces
) -> Figure:
    """Draw the mean response at the three values of each factor, one panel per response.

    A line of a panel is a factor; its name and its values are at the left end of the row. Bars are
    the 95 % intervals of the means.
    """
    names = screening.design.factors
    titles = [f"{words.factor(name)}\n{words.span(name)}" for name in names]

    def draw(axes: Axes, label: Label) -> None:
        table = screening.tables[label]
        axes.axvline(table.constant, color=QUIET, linewidth=0.8)
        percents = {t.factors[0]: t.percent for t in table.terms if len(t.factors) == 1}
        means = np.array([list(mean_at(screening, label, [name]).values()) for name in names])
        at = np.arange(len(names))[:, None] + 0.28 * np.array(LEVELS)
        strong = np.array([percents[name] >= LEADING_MAIN_PERCENT for name in names])
        gap = np.full((len(names), 1), np.nan)
        for chosen, colour, width in ((~strong, QUIET, 0.6), (strong, MARK, 1.4)):
            lines = [np.hstack([part[chosen], gap[chosen]]).ravel() for part in (means, at)]
            axes.plot(*lines, color=colour, linewidth=width)
        half = np.array([surfaces.mean_half_width(label, n, x) for n in names for x in LEVELS])
        ends = means.ravel()
        axes.hlines(at.ravel(), ends - half, ends + half, color=QUIET, linewidth=0.9)
        for column, (colour, mark) in enumerate(zip(LEVEL_COLOURS, LEVEL_MARKS, strict=True)):
            for chosen, size in ((~strong, 3.0), (strong, 4.5)):
                x, y = means[chosen, column], at[chosen, column]
                axes.plot(x, y, mark, color=colour, markersize=size)
        is_first = axes.get_subplotspec().is_first_col()  # type: ignore[union-attr]
        name_ticks(axes, "y", range(len(names)), titles if is_first else [""] * len(names))
        axes.set_ylim(len(names) - 0.5, -0.5)
        _style_panel(axes, "x")
        axes.tick_params(axis="y", labelsize=7.5, length=0)

    extra = 0.31 * len(names) - 1.1
    figure = _panels(screening, load, draw, words, extra=extra, name_axis="x")
    return _with_level_legend(figure)


def _with_level_legend(figure: Figure) -> Figure:
    """Add the legend of the low, middle and high value below the panels."""
    handles = [
        Line2D(
            [], [], color=colour, marker=mark, markersize=5, linewidth=1.4, label=f"{text} value"
        )
        for colour, mark, text in zip(LEVEL_COLOURS, LEVEL_MARKS, LEVEL_WORDS, strict=True)
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    return figure


def interactions_figure(screening: Screening, load: str, words: Words) -> Figure:
    """Draw the strongest interaction of each response, one panel per response.

    A panel shows the mean response over one factor, with one line per level of the other factor.
    """

    def draw(axes: Axes, label: Label) -> None:
        pairs = [term for term in screening.tables[label].terms if len(term.factors) == 2]
        strongest = max(pairs, key=lambda term: np.nan_to_num(term.percent))
        first, second = strongest.factors
        means = mean_at(screening, label, [first, second])
        for level, colour, mark in zip((-1, 0, 1), LEVEL_COLOURS, LEVEL_MARKS, strict=True):
            line = [means[x, level] for x in (-1, 0, 1)]
            axes.plot((-1, 0, 1), line, color=colour, marker=mark, markersize=5, linewidth=1.4)
        axes.margins(0.12)
        _label_pair(axes, first, second, words, f"  {number(strongest.percent, 1)} %")

    return _with_level_legend(_panels(screening, load, draw, words, extra=0.75))


def combinations_figure(screening: Screening, load: str, words: Words) -> Figure:
    """Draw the values at each level combination of two factors, as [B] Fig. 13.

    Each panel uses the two most influential factors of its response.
    """

    def draw(axes: Axes, label: Label) -> None:
        first, second = two_most_influential(screening, label)
        columns = [screening.design.factors.index(name) for name in (first, second)]
        levels = screening.design.levels[:, columns]
        values = screening.responses.values[label[0]][label[1]].to_numpy()
        for level, colour in zip(LEVELS, LEVEL_COLOURS, strict=True):
            here = {
                x + 0.27 * level: values[(levels[:, 0] == x) & (levels[:, 1] == level)]
                for x in LEVELS
            }
            _boxes(axes, {x: v[np.isfinite(v)] for x, v in here.items()}, 0.1, colour)
        _label_pair(axes, first, second, words)

    figure = _panels(screening, load, draw, words, extra=0.75)
    handles = [
        Line2D([], [], color=colour, linewidth=5, label=f"{text} value")
        for colour, text in zip(LEVEL_COLOURS, LEVEL_WORDS, strict=True)
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    return figure


def two_most_influential(screening: Screening, label: Label) -> tuple[str, str]:
    """Return the factors of the two largest main effects."""
    first, second = main_effects(screening.tables[label])[:2]
    return first.name, second.name


def residuals_figure(screening: Screening, load: str, words: Words) -> Figure:
    """Draw residuals against fitted values, one panel per response."""

    def draw(axes: Axes, label: Label) -> None:
        table = screening.tables[label]
        axes.axhline(0.0, color=QUIET, linewidth=0.8)
        shown: dict[str, Any] = {
            "alpha": 0.4,
            "markersize": 3.0,
            "markeredgewidth": 0.0,
            "rasterized": True,
        }
        axes.plot(_thinned(table.fitted), _thinned(table.residual), ".", color=OURS, **shown)
        _style_panel(axes, "both")

    return _panels(screening, load, draw, words, extra=0.1)


def _label_pair(axes: Axes, first: str, second: str, words: Words, more: str = "") -> None:
    """Label a panel of two factors: the first on the axis, the second, by colour, above it."""
    name_ticks(axes, "x", LEVELS, [words.number(first, level) for level in LEVELS])
    axes.set_xlabel(words.axis(first), fontsize=8.5, parse_math=False)
    values = ", ".join(words.number(second, level) for level in LEVELS)
    axes.set_title(
        f"{words.factor(second)}:\n{values} {words.unit(second)}{more}",
        fontsize=8,
        color=QUIET,
        loc="right",
        parse_math=False,
    )
    _style_panel(axes, "y")


def _panels(
    screening: Screening,
    load: str,
    draw: Callable[[Axes, Label], None],
    words: Words,
    extra: float,
    name_axis: Literal["x", "y"] = "y",
    unit: str = "",
) -> Figure:
    """Make one panel per response of a load, three in a row, each with name and unit.

    Args:
        screening: Result of the study.
        load: Name of the load.
        draw: Function that draws a panel.
        words: Names of the responses.
        extra: Height of a row beyond that of its axes. [in]
        name_axis: Axis that has the values of the response.
        unit: Unit on this axis; "" for that of the response.
    """
    names = screening.names
    rows = -(-len(names) // COLUMNS)
    figure = Figure(figsize=(WIDTH, rows * (1.75 + extra) + 0.4), layout="constrained")
    panels = list(figure.subplots(rows, COLUMNS, squeeze=False).flat)
    for axes, name in zip(panels, names, strict=False):
        draw(axes, (load, name))
        text = f"{words.response(name)}, {unit or screening.responses.units[name]}"
        set_label = axes.set_xlabel if name_axis == "x" else axes.set_ylabel
        set_label(text, fontsize=8.5, parse_math=False)
    for axes in panels[len(names) :]:
        axes.set_visible(False)
    return figure


def _boxes(
    axes: Axes, values: Mapping[float, FloatArray], half_width: float, colour: str = MARK
) -> None:
    """Draw lines from smallest to largest value, boxes between the quartiles, and the medians.

    Args:
        axes: The panel.
        values: Values by the place of their box.
        half_width: Half of the width of a box.
        colour: Colour of all boxes.
    """
    known = {place: np.percentile(v, (0, 25, 50, 75, 100)) for place, v in values.items() if len(v)}
    if not known:
        return
    places, marks = np.array(list(known)), np.array(list(known.values())).T
    low, first, median, third, high = marks
    left, right = places - half_width, places + half_width
    axes.vlines(places, low, high, color=colour, linewidth=0.9)
    corners = [[left, first], [right, first], [right, third], [left, third], [left, first]]
    outline = list(np.moveaxis(np.array(corners), 2, 0))
    axes.add_collection(
        PolyCollection(
            outline, facecolor=(1.0, 1.0, 1.0, 0.45), edgecolor=colour, linewidth=1.2, zorder=3
        )
    )
    axes.hlines(median, left, right, color=colour, linewidth=2.0, zorder=4)


def _thinned(values: FloatArray) -> FloatArray:
    """Return every n-th value, so that at most MOST_POINTS remain."""
    step = -(-len(values) // MOST_POINTS) if len(values) else 1
    return values[::step]


def _style_panel(axes: Axes, grid: str) -> None:
    axes.set_axisbelow(True)
    axes.grid(axis=grid, color=GRID)  # type: ignore[arg-type]
    axes.tick_params(labelsize=8.5)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
