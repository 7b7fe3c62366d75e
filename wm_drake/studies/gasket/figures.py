"""Figures of a screening study: contributions, spread, effects, interactions, residuals."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import xarray as xr
from scipy.special import fdtri

from wm_drake.parameters.types import FloatArray
from wm_drake.report import figure as fig
from wm_drake.report.formatting import number
from wm_drake.report.quantity import quantity_of, shown, text_of
from wm_drake.studies.doe.coding import LEVELS
from wm_drake.studies.gasket.screening import (
    CONTRIBUTION,
    LEADING_INTERACTION,
    LEADING_MAIN,
    at,
    is_main,
    mains,
    mean_at,
)
from wm_drake.studies.gasket.surface import mean_half_widths
from wm_drake.studies.gasket.words import Words

LEVEL_COLOURS = (fig.OURS, fig.QUIET, fig.MEASURED)
"""Colours of the levels -1, 0 and 1."""

LEVEL_WORDS = ("low", "middle", "high")
"""Words for the levels -1, 0 and 1."""

LEVEL_MARKS = ("triangle-down", "circle", "triangle-up")
"""Marks of the levels -1, 0 and 1, which stay distinct in grey print."""

SMALLEST_SHARE = 0.01
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


def heat_map_figure(screening: xr.Dataset, words: Words, loads: Sequence[str] = ()) -> fig.Figure:
    """Return the contributions in percent: one row per term, one column per load and response.

    Args:
        screening: As of `screening.run_screening`.
        words: Words of the study.
        loads: Loads to show; all if empty. The rows are those of all loads.
    """
    share = screening.share.fillna(0.0).transpose("term", "load", "response")
    share = share.isel(term=(share.max(["load", "response"]) >= SMALLEST_SHARE).values)
    loads, names = list(loads) or screening["load"].values.tolist(), share.response.values.tolist()
    values = shown(share.sel(load=loads)).reshape(share.sizes["term"], -1)
    rows, columns = values.shape
    longest = max(map(len, names))
    # the square root makes small contributions visible
    scale = fig.Scale(low=0.0, high=100.0, kind="root", shades="Blues", label=" ", ticks=PERCENTS)
    marks: list[fig.Mark] = [fig.Cells(values, range(columns), range(rows), scale=scale)]
    for (row, column), value in np.ndenumerate(values):
        if value >= 0.5:
            color = "#ffffff" if value > 40.0 else fig.MARK
            marks.append(fig.Text(column, row, number(value, 0), color=color))
    rise = 24.0 + (7.0 * longest if longest > 4 else 0.0)
    for index, load in enumerate(loads):
        first = len(names) * index
        middle = first + 0.5 * (len(names) - 1)
        above = fig.Text(
            middle, 1.0, f"load {load}", is_bold=True, in_data=(True, False), up="bottom"
        )
        marks.append(replace(above, size=fig.TITLE, shift=(0.0, rise)))
        if index:
            marks.append(fig.Rule(first - 0.5, "y", color="#ffffff", width=7.0))
    mains_shown = int(is_main(share.term).sum())
    if 0 < mains_shown < rows:
        marks.append(fig.Rule(mains_shown - 0.5, "x", color="#ffffff", width=7.0))
    x = fig.named(names * len(loads))
    # symbols for interactions: their words would take half of a narrow page
    terms = share.term.values.tolist()
    y = fig.named(t.replace(":", " × ") if ":" in t else words.term(t) for t in terms)
    plain = fig.Axis(has_grid=False, has_line=False)
    panel = fig.Panel(
        marks=tuple(marks),
        x=replace(plain, ticks=x, is_far=True, range=(-0.5, columns - 0.5)),
        y=replace(plain, ticks=y, range=(rows - 0.5, -0.5)),
    )
    return fig.Figure(panels=(panel,), height=31.0 * rows)


def spread_figure(screening: xr.Dataset, names: Sequence[str], words: Words) -> fig.Figure:
    """Return all values of responses of one kind, one panel per load, as [B] Figs. 10-12.

    The values are points, with a box from the first to the third quartile.
    """
    rng = np.random.default_rng(0)  # for the horizontal spread, which has no meaning
    values = screening.value.sel(response=list(names))
    smallest = float(values.min())
    first = values.isel(response=0)
    kind = screening.kind.sel(response=names[0]).item()
    ticks = fig.named(map(words.response, names))
    x = fig.Axis(ticks=ticks, range=(-0.6, len(names) - 0.4), has_grid=False)
    y = fig.Axis(
        label=quantity_of(first).named(kind).label, range=(None if smallest < 0.0 else 0.0, None)
    )
    panels = []
    for load in screening["load"].values.tolist():
        every = [_known(shown(values.sel(load=load, response=name))) for name in names]
        marks: list[fig.Mark] = [fig.Rule(0.0, color=fig.MARK)] if smallest < 0.0 else []
        for place, of_name in enumerate(map(_thinned, every)):
            at_x = place + rng.uniform(-0.28, 0.28, len(of_name))
            marks.append(fig.Points(at_x, of_name, size=3.0, opacity=0.35))
        marks += fig.boxes(range(len(names)), every, 0.34, color=fig.MARK)
        panels.append(fig.Panel(title=f"load {load}", marks=tuple(marks), x=x, y=y))
    return fig.Figure(panels=fig.in_grid(panels, len(panels), share="y"), height=260.0)


def pareto_figure(
    screening: xr.Dataset, load: str, words: Words, *, has_thresholds: bool = True
) -> fig.Figure:
    """Return the largest contributions to each response as sorted bars, one panel per response.

    Bars of terms that are not significant are grey. Dashed lines, if wanted: the thresholds of [B]
    for main effects and interactions. Dotted line: where the F test of a main effect is
    significant at 5 %.
    """
    keys = ("main effect", "interaction", "not significant (F test, 5 %)")

    def panel_of(of_label: xr.Dataset, name: str) -> fig.Panel:
        ranked = np.argsort(-of_label.share.fillna(0.0).values, kind="stable")[:PARETO_BARS]
        top = of_label.isel(term=ranked)
        # also of NaN, without degrees of freedom
        kinds = np.where(top.p.values < SIGNIFICANCE, np.where(is_main(top.term), 0, 1), 2)
        percents = np.nan_to_num(shown(top.share))
        marks: list[fig.Mark] = []
        for kind, color in enumerate((fig.OURS, INTERACTION, GREY)):
            at_y = np.flatnonzero(kinds == kind)
            bars = fig.Bars(at_y, percents[at_y], is_across=True, color=color, key=keys[kind])
            marks.append(bars)
        for least in (LEADING_MAIN, LEADING_INTERACTION) if has_thresholds else ():
            value = float(CONTRIBUTION.values(least))
            rule = fig.Rule(value, "y", color=fig.MEASURED, dash="dashed", key="thresholds of [B]")
            marks.append(rule)
        significant = significant_share(of_label)
        if significant is not None:
            key = "significant from here (main effects)"
            value = float(CONTRIBUTION.values(significant))
            marks.append(fig.Rule(value, "y", color=fig.MARK, dash="dotted", key=key))
        ticks = fig.named(term.replace(":", " × ") for term in top.term.values.tolist())
        y = fig.Axis(ticks=ticks, range=(len(ticks) - 0.5, -0.5), has_grid=False)
        x = fig.Axis(label=f"{words.response(name)}, {CONTRIBUTION.unit_text}", range=(0.0, None))
        return fig.Panel(marks=tuple(marks), x=x, y=y)

    return _panels(screening, load, panel_of, 180.0)


def significant_share(of_label: xr.Dataset) -> float | None:
    """Return the contribution at which the F test of a main effect is significant at 5 %.

    It is the same for all main effects of an orthogonal design; of another, this is the median.
    None without degrees of freedom or spread.
    """
    main, df = mains(of_label), of_label.residual_df.item()
    main = main.isel(term=(np.isfinite(main.f) & (main.f > 0.0)).values)
    if not df or not main.sizes["term"]:
        return None
    shares = main.share * fdtri(main.df, df, 1.0 - SIGNIFICANCE) / main.f
    known = shares.values[np.isfinite(shares.values)]
    return float(np.median(known)) if len(known) else None


def main_effects_figure(
    screening: xr.Dataset, load: str, words: Words, models: xr.Dataset
) -> fig.Figure:
    """Return the mean response at the three values of each factor, one panel per response.

    A line of a panel is a factor; its name and its values are at the left end of the row. Bars are
    the 95 % intervals of the means.

    Args:
        screening: As of `screening.run_screening`.
        load: Name of the load.
        words: Words of the study.
        models: As of `surface.models_of`.
    """
    names = list(screening.design.factors)
    titles = fig.named(f"{words.factor(name)}\n{words.span(name)}" for name in names)
    at_y = np.arange(len(names))[:, None] + 0.28 * np.array(LEVELS)
    responses = screening.response.values.tolist()
    loads = screening["load"].values.tolist()
    widths = mean_half_widths(models, LEVELS)[:, :, loads.index(load)]

    def panel_of(of_label: xr.Dataset, name: str) -> fig.Panel:
        number_of_response, quantity = responses.index(name), quantity_of(of_label["mean"])
        marks: list[fig.Mark] = [fig.Rule(float(shown(of_label["mean"])), "y", color=fig.QUIET)]
        means = quantity.values([mean_at(of_label, factor) for factor in names])
        strong = of_label.share.sel(term=names).values >= LEADING_MAIN
        gap = np.full((len(names), 1), np.nan)
        for chosen, color, width in ((~strong, fig.QUIET, 0.8), (strong, fig.MARK, 1.8)):
            x, y = (np.hstack([part[chosen], gap[chosen]]).ravel() for part in (means, at_y))
            marks.append(fig.Line(x, y, color=color, width=width))
        half = quantity.values(widths[..., number_of_response]).ravel()
        ends, places = means.ravel(), at_y.ravel()
        ends_of_bars = (ends - half, places), (ends + half, places)
        marks.append(fig.segments(*ends_of_bars, color=fig.QUIET, width=1.2))
        for column, (color, symbol) in enumerate(zip(LEVEL_COLOURS, LEVEL_MARKS, strict=True)):
            for chosen, size in ((~strong, 4.5), (strong, 7.0)):
                x, y = means[chosen, column], at_y[chosen, column]
                key = f"{LEVEL_WORDS[column]} value"
                marks.append(fig.Points(x, y, symbol=symbol, color=color, size=size, key=key))
        y_axis = fig.Axis(ticks=titles, range=(len(names) - 0.5, -0.5), size=10.5)
        y_axis = replace(y_axis, has_grid=False, has_numbers=number_of_response % COLUMNS == 0)
        return fig.Panel(marks=tuple(marks), x=fig.Axis(label=words.response_axis(name)), y=y_axis)

    return _panels(screening, load, panel_of, 31.0 * len(names) + 10.0)


def interactions_figure(screening: xr.Dataset, load: str, words: Words) -> fig.Figure:
    """Return the strongest interaction of each response, one panel per response.

    A panel shows the mean response over one factor, with one line per level of the other factor.
    """

    def panel_of(of_label: xr.Dataset, name: str) -> fig.Panel:
        pairs = of_label.isel(term=~is_main(of_label.term)).share
        strongest = pairs.isel(term=int(np.argmax(np.nan_to_num(pairs.values))))
        first, second = strongest.term.item().split(":")
        means = quantity_of(of_label["mean"]).values(mean_at(of_label, first, second))
        marks = tuple(
            fig.Line(
                LEVELS,
                means[:, column],
                color=LEVEL_COLOURS[column],
                symbol=LEVEL_MARKS[column],
                key=f"{LEVEL_WORDS[column]} value",
            )
            for column in range(len(LEVELS))
        )
        return _of_pair(marks, (first, second), words, name, f"  {text_of(strongest)}")

    return _panels(screening, load, panel_of, 160.0)


def combinations_figure(screening: xr.Dataset, load: str, words: Words) -> fig.Figure:
    """Return the values at each level combination of two factors, as [B] Fig. 13.

    Each panel uses the two most influential factors of its response.
    """

    def panel_of(of_label: xr.Dataset, name: str) -> fig.Panel:
        first, second = mains(of_label).term.values[:2].tolist()
        columns = [screening.design.factors.index(factor) for factor in (first, second)]
        levels, values = screening.design.levels[:, columns], shown(of_label.value)
        marks: list[fig.Mark] = []
        for column, level in enumerate(LEVELS):
            of_level = [values[(levels[:, 0] == x) & (levels[:, 1] == level)] for x in LEVELS]
            at_x, key = 0.27 * level + np.array(LEVELS), f"{LEVEL_WORDS[column]} value"
            samples = list(map(_known, of_level))
            marks += fig.boxes(at_x, samples, 0.1, color=LEVEL_COLOURS[column], key=key)
        return _of_pair(tuple(marks), (first, second), words, name)

    return _panels(screening, load, panel_of, 160.0)


def residuals_figure(screening: xr.Dataset, load: str, words: Words) -> fig.Figure:
    """Return residuals against fitted values, one panel per response."""

    def panel_of(of_label: xr.Dataset, name: str) -> fig.Panel:
        fitted, residual = (_thinned(_known(shown(of_label[n]))) for n in ("fitted", "residual"))
        points = fig.Points(fitted, residual, size=7.0 if len(fitted) < 100 else 3.0, opacity=0.4)
        y = fig.Axis(label=words.response_axis(name), has_grid=True)
        return fig.Panel(marks=(fig.Rule(0.0, color=fig.QUIET), points), y=y)

    return _panels(screening, load, panel_of, 150.0)


def _of_pair(
    marks: tuple[fig.Mark, ...], factors: tuple[str, str], words: Words, name: str, more: str = ""
) -> fig.Panel:
    """Return a panel of two factors: the first on the axis, the second, by colour, above it.

    Args:
        marks: What it shows.
        factors: Names of both factors.
        words: Words of the study.
        name: Name of the response.
        more: Text after the values of the second factor.
    """
    first, second = factors
    ticks = fig.named((words.number(first, level) for level in LEVELS), LEVELS)
    subtitle = f"{words.factor(second)}:\n{words.values(second)}{more}"
    x = fig.Axis(label=words.axis(first), ticks=ticks, range=(-1.4, 1.4), has_grid=False)
    y = fig.Axis(label=words.response_axis(name))
    return fig.Panel(marks=marks, x=x, y=y, subtitle=subtitle)


def _panels(
    screening: xr.Dataset,
    load: str,
    panel_of: Callable[[xr.Dataset, str], fig.Panel],
    height: float,
) -> fig.Figure:
    """Return one panel per response of a load, three in a row.

    Args:
        screening: As of `screening.run_screening`.
        load: Name of the load.
        panel_of: Function of the part of a response, and its name.
        height: Height of a panel. [px]
    """
    panels = [
        replace(panel_of(at(screening, (load, name)), name), name=name)
        for name in screening.response.values.tolist()
    ]
    return fig.Figure(panels=fig.in_grid(panels, COLUMNS), height=height)


def _known(values: FloatArray) -> FloatArray:
    """Return the values of runs that did not fail."""
    return np.asarray(values[np.isfinite(values)])


def _thinned(values: FloatArray) -> FloatArray:
    """Return every n-th value, so that at most MOST_POINTS remain."""
    step = -(-len(values) // MOST_POINTS) if len(values) else 1
    return values[::step]
