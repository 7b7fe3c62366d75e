"""Figures of a screening study: contributions, spread, effects, interactions, residuals."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.special import fdtri

from wm_drake.parameters.types import FloatArray
from wm_drake.report import figure as fig
from wm_drake.report.formatting import number
from wm_drake.studies.doe.anova import AnovaTable, Term
from wm_drake.studies.doe.coding import LEVELS
from wm_drake.studies.gasket.screening import (
    LEADING_INTERACTION_PERCENT,
    LEADING_MAIN_PERCENT,
    Label,
    Screening,
    Words,
    contributions,
    main_effects,
    mean_at,
)
from wm_drake.studies.gasket.surface import Surfaces

LEVEL_COLOURS = (fig.OURS, fig.QUIET, fig.MEASURED)
"""Colours of the levels -1, 0 and 1."""

LEVEL_WORDS = ("low", "middle", "high")
"""Words for the levels -1, 0 and 1."""

LEVEL_MARKS = ("triangle-down", "circle", "triangle-up")
"""Marks of the levels -1, 0 and 1, which stay distinct in grey print."""

SMALLEST_PERCENT = 1.0
"""Smallest contribution to any response with which a term is shown in the heat map."""

MOST_POINTS = 1500
"""Largest number of points of a scatter plot; of more points, every n-th is drawn."""

COLUMNS = 3
"""Number of panels in a row."""

PARETO_BARS = 8
"""Number of bars of a panel of the Pareto chart."""

SIGNIFICANCE = 0.05
"""Probability below which an F test is called significant."""

INTERACTION, GREY = "#56b4e9", "#b8bec6"
"""Colours of interactions and of terms that are not significant in the Pareto chart."""


PERCENTS = fig.named(("0", "1", "5", "10", "25", "50", "100 %"), (0, 1, 5, 10, 25, 50, 100))
"""Ticks of the colour scale of contributions."""


def heat_map_figure(screening: Screening, words: Words, loads: Sequence[str] = ()) -> fig.Figure:
    """Return the contributions in percent: one row per term, one column per load and response.

    Args:
        loads: Loads to show; all if empty. The rows are those of all loads.
    """
    loads = list(loads) or screening.loads
    table = contributions(screening).fillna(0.0)
    shown = table[table.max(axis=1) >= SMALLEST_PERCENT][loads]
    values, labels = shown.to_numpy(), [label for label in screening.tables if label[0] in loads]
    rows, columns = values.shape
    longest = max(len(name) for _, name in labels)
    # the square root makes small contributions visible
    scale = fig.Scale(low=0.0, high=100.0, kind="root", shades="Blues", label=" ", ticks=PERCENTS)
    marks: list[fig.Mark] = [fig.Cells(values, range(columns), range(rows), scale=scale)]
    for (row, column), value in np.ndenumerate(values):
        if value >= 0.5:
            color = "#ffffff" if value > 40.0 else fig.MARK
            marks.append(fig.Text(column, row, number(value, 0), color=color))
    rise = 24.0 + (7.0 * longest if longest > 4 else 0.0)
    for index, load in enumerate(loads):
        first = len(screening.names) * index
        middle = first + 0.5 * (len(screening.names) - 1)
        above = fig.Text(
            middle, 1.0, f"load {load}", is_bold=True, in_data=(True, False), up="bottom"
        )
        marks.append(replace(above, size=fig.TITLE, shift=(0.0, rise)))
        if index:
            marks.append(fig.Rule(first - 0.5, "y", color="#ffffff", width=7.0))
    mains = sum(":" not in str(name) for name in shown.index)
    if 0 < mains < rows:
        marks.append(fig.Rule(mains - 0.5, "x", color="#ffffff", width=7.0))
    x = fig.named(name for _, name in labels)
    # symbols for interactions: their words would take half of a narrow page
    terms = map(str, shown.index)
    y = fig.named(t.replace(":", " × ") if ":" in t else words.term(t) for t in terms)
    plain = fig.Axis(has_grid=False, has_line=False)
    panel = fig.Panel(
        marks=tuple(marks),
        x=replace(plain, ticks=x, is_far=True, range=(-0.5, columns - 0.5)),
        y=replace(plain, ticks=y, range=(rows - 0.5, -0.5)),
    )
    return fig.Figure(panels=(panel,), height=31.0 * rows)


def spread_figure(
    screening: Screening, names: Sequence[str], what: str, words: Words
) -> fig.Figure:
    """Return all values of some responses, one panel per load, as [B] Figs. 10-12.

    The values are points, with a box from the first to the third quartile.
    """
    rng = np.random.default_rng(0)  # for the horizontal spread, which has no meaning
    smallest = min(v[name].min() for v in screening.responses.values.values() for name in names)
    ticks = fig.named(map(words.response, names))
    x = fig.Axis(ticks=ticks, range=(-0.6, len(names) - 0.4), has_grid=False)
    y = fig.Axis(
        label=f"{what}, {screening.responses.units[names[0]]}",
        range=(None if smallest < 0.0 else 0.0, None),
    )
    panels = []
    for load in screening.loads:
        every = [screening.responses.values[load][name].dropna().to_numpy() for name in names]
        marks: list[fig.Mark] = [fig.Rule(0.0, color=fig.MARK)] if smallest < 0.0 else []
        for place, values in enumerate(map(_thinned, every)):
            at = place + rng.uniform(-0.28, 0.28, len(values))
            marks.append(fig.Points(at, values, size=3.0, opacity=0.35))
        marks += fig.boxes(range(len(names)), every, 0.34, color=fig.MARK)
        panels.append(fig.Panel(title=f"load {load}", marks=tuple(marks), x=x, y=y))
    return fig.Figure(panels=fig.in_grid(panels, len(panels), share="y"), height=260.0)


def pareto_figure(screening: Screening, load: str, words: Words) -> fig.Figure:
    """Return the largest contributions to each response as sorted bars, one panel per response.

    Bars of terms that are not significant are grey. Dashed lines: the thresholds of [B] for main
    effects and interactions. Dotted line: where the F test of a main effect is significant at 5 %.
    """
    keys = ("main effect", "interaction", "not significant (F test, 5 %)")

    def panel_of(label: Label) -> fig.Panel:
        table = screening.tables[label]
        ranked = sorted(table.terms, key=lambda term: -np.nan_to_num(term.percent))[:PARETO_BARS]
        percents = np.nan_to_num([term.percent for term in ranked])
        colors = [_pareto_color(term) for term in ranked]
        marks: list[fig.Mark] = []
        for color, key in zip((fig.OURS, INTERACTION, GREY), keys, strict=True):
            at = [k for k, of_bar in enumerate(colors) if of_bar == color]
            marks.append(fig.Bars(at, percents[at], is_across=True, color=color, key=key))
        for value in (LEADING_MAIN_PERCENT, LEADING_INTERACTION_PERCENT):
            rule = fig.Rule(value, "y", color=fig.MEASURED, dash="dashed", key="thresholds of [B]")
            marks.append(rule)
        significant = significant_percent(table)
        if significant is not None:
            key = "significant from here (main effects)"
            marks.append(fig.Rule(significant, "y", color=fig.MARK, dash="dotted", key=key))
        names = fig.named(term.name.replace(":", " × ") for term in ranked)
        y = fig.Axis(ticks=names, range=(len(ranked) - 0.5, -0.5), has_grid=False)
        x = fig.Axis(label=f"{words.response(label[1])}, %", range=(0.0, None))
        return fig.Panel(marks=tuple(marks), x=x, y=y)

    return _panels(screening, load, panel_of, 180.0)


def _pareto_color(term: Term) -> str:
    if not term.p < SIGNIFICANCE:  # also of NaN, without degrees of freedom
        return GREY
    return fig.OURS if len(term.factors) == 1 else INTERACTION


def significant_percent(table: AnovaTable) -> float | None:
    """Return the contribution at which the F test of a main effect is significant at 5 %.

    It is the same for all main effects of an orthogonal design; of another, this is the median.
    None without degrees of freedom or spread.
    """
    percents = [
        term.percent * float(fdtri(term.df, table.residual_df, 1.0 - SIGNIFICANCE)) / term.f
        for term in table.terms
        if len(term.factors) == 1 and table.residual_df > 0 and np.isfinite(term.f) and term.f > 0.0
    ]
    known = [value for value in percents if np.isfinite(value)]
    return float(np.median(known)) if known else None


def main_effects_figure(
    screening: Screening, load: str, words: Words, surfaces: Surfaces
) -> fig.Figure:
    """Return the mean response at the three values of each factor, one panel per response.

    A line of a panel is a factor; its name and its values are at the left end of the row. Bars are
    the 95 % intervals of the means.
    """
    names = screening.design.factors
    titles = fig.named(f"{words.factor(name)}\n{words.span(name)}" for name in names)
    at = np.arange(len(names))[:, None] + 0.28 * np.array(LEVELS)

    def panel_of(label: Label) -> fig.Panel:
        table = screening.tables[label]
        marks: list[fig.Mark] = [fig.Rule(table.constant, "y", color=fig.QUIET)]
        percents = {t.factors[0]: t.percent for t in table.terms if len(t.factors) == 1}
        means = np.array([list(mean_at(screening, label, [name]).values()) for name in names])
        strong = np.array([percents[name] >= LEADING_MAIN_PERCENT for name in names])
        gap = np.full((len(names), 1), np.nan)
        for chosen, color, width in ((~strong, fig.QUIET, 0.8), (strong, fig.MARK, 1.8)):
            x, y = (np.hstack([part[chosen], gap[chosen]]).ravel() for part in (means, at))
            marks.append(fig.Line(x, y, color=color, width=width))
        half = np.array([surfaces.mean_half_width(label, n, x) for n in names for x in LEVELS])
        ends, places = means.ravel(), at.ravel()
        ends_of_bars = (ends - half, places), (ends + half, places)
        marks.append(fig.segments(*ends_of_bars, color=fig.QUIET, width=1.2))
        for column, (color, symbol) in enumerate(zip(LEVEL_COLOURS, LEVEL_MARKS, strict=True)):
            for chosen, size in ((~strong, 4.5), (strong, 7.0)):
                x, y = means[chosen, column], at[chosen, column]
                key = f"{LEVEL_WORDS[column]} value"
                marks.append(fig.Points(x, y, symbol=symbol, color=color, size=size, key=key))
        is_first = screening.names.index(label[1]) % COLUMNS == 0
        y_axis = fig.Axis(ticks=titles, range=(len(names) - 0.5, -0.5), size=10.5)
        y_axis = replace(y_axis, has_grid=False, has_numbers=is_first)
        return fig.Panel(marks=tuple(marks), x=_axis_of(screening, label, words), y=y_axis)

    return _panels(screening, load, panel_of, 31.0 * len(names) + 10.0)


def interactions_figure(screening: Screening, load: str, words: Words) -> fig.Figure:
    """Return the strongest interaction of each response, one panel per response.

    A panel shows the mean response over one factor, with one line per level of the other factor.
    """

    def panel_of(label: Label) -> fig.Panel:
        pairs = [term for term in screening.tables[label].terms if len(term.factors) == 2]
        strongest = max(pairs, key=lambda term: np.nan_to_num(term.percent))
        first, second = strongest.factors
        means = mean_at(screening, label, [first, second])
        marks = tuple(
            fig.Line(
                LEVELS,
                [means[x, level] for x in LEVELS],
                color=LEVEL_COLOURS[column],
                symbol=LEVEL_MARKS[column],
                key=f"{LEVEL_WORDS[column]} value",
            )
            for column, level in enumerate(LEVELS)
        )
        more = f"  {number(strongest.percent, 1)} %"
        return _of_pair(marks, (first, second), words, _axis_of(screening, label, words), more)

    return _panels(screening, load, panel_of, 160.0)


def combinations_figure(screening: Screening, load: str, words: Words) -> fig.Figure:
    """Return the values at each level combination of two factors, as [B] Fig. 13.

    Each panel uses the two most influential factors of its response.
    """

    def panel_of(label: Label) -> fig.Panel:
        first, second = (term.name for term in main_effects(screening.tables[label])[:2])
        columns = [screening.design.factors.index(name) for name in (first, second)]
        levels = screening.design.levels[:, columns]
        values = screening.responses.values[label[0]][label[1]].to_numpy()
        marks: list[fig.Mark] = []
        for column, level in enumerate(LEVELS):
            of_level = [values[(levels[:, 0] == x) & (levels[:, 1] == level)] for x in LEVELS]
            samples = [sample[np.isfinite(sample)] for sample in of_level]
            at, key = 0.27 * level + np.array(LEVELS), f"{LEVEL_WORDS[column]} value"
            marks += fig.boxes(at, samples, 0.1, color=LEVEL_COLOURS[column], key=key)
        return _of_pair(tuple(marks), (first, second), words, _axis_of(screening, label, words))

    return _panels(screening, load, panel_of, 160.0)


def residuals_figure(screening: Screening, load: str, words: Words) -> fig.Figure:
    """Return residuals against fitted values, one panel per response."""

    def panel_of(label: Label) -> fig.Panel:
        table = screening.tables[label]
        points = fig.Points(_thinned(table.fitted), _thinned(table.residual), size=3.0, opacity=0.4)
        y = replace(_axis_of(screening, label, words), has_grid=True)
        return fig.Panel(marks=(fig.Rule(0.0, color=fig.QUIET), points), y=y)

    return _panels(screening, load, panel_of, 150.0)


def _axis_of(screening: Screening, label: Label, words: Words) -> fig.Axis:
    """Return the axis of a response."""
    return fig.Axis(label=f"{words.response(label[1])}, {screening.responses.units[label[1]]}")


def _of_pair(
    marks: tuple[fig.Mark, ...], factors: tuple[str, str], words: Words, y: fig.Axis, more: str = ""
) -> fig.Panel:
    """Return a panel of two factors: the first on the axis, the second, by colour, above it.

    Args:
        more: Text after the values of the second factor.
    """
    first, second = factors
    ticks = fig.named((words.number(first, level) for level in LEVELS), LEVELS)
    values = ", ".join(words.number(second, level) for level in LEVELS)
    subtitle = f"{words.factor(second)}:\n{values} {words.unit(second)}{more}"
    x = fig.Axis(label=words.axis(first), ticks=ticks, range=(-1.4, 1.4), has_grid=False)
    return fig.Panel(marks=marks, x=x, y=y, subtitle=subtitle)


def _panels(
    screening: Screening, load: str, panel_of: Callable[[Label], fig.Panel], height: float
) -> fig.Figure:
    """Return one panel per response of a load, three in a row.

    Args:
        height: Height of a panel. [px]
    """
    panels = [replace(panel_of((load, name)), name=name) for name in screening.names]
    return fig.Figure(panels=fig.in_grid(panels, COLUMNS), height=height)


def _thinned(values: FloatArray) -> FloatArray:
    """Return every n-th value, so that at most MOST_POINTS remain."""
    step = -(-len(values) // MOST_POINTS) if len(values) else 1
    return values[::step]
