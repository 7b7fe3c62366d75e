"""Figures of the tolerance study."""

import numpy as np
from matplotlib.figure import Figure

from wm_drake.report.figures import GRID, MARK, MEASURED, OURS, QUIET, WIDTH, style_axes
from wm_drake.studies.tolerance.sensitivity import Index
from wm_drake.studies.tolerance.shares import band_of
from wm_drake.studies.tolerance.study import ToleranceResult

MOST_POINTS = 400
"""Largest number of points of a curve."""


def distributions_figure(result: ToleranceResult, names: dict[str, str]) -> Figure:
    """Draw the distribution function of each measure with its 95 % band and its limits.

    Args:
        result: Result of the study.
        names: Titles of the measures by their keys.
    """
    rows = -(-len(names) // 3)
    figure = Figure(figsize=(WIDTH, 2.3 * rows + 0.3), layout="constrained")
    panels = figure.subplots(rows, 3, squeeze=False, sharey=True)
    for axes, name in zip(panels.flat, names, strict=False):
        values = np.sort(result.values[name].dropna().to_numpy())
        kept = np.unique(np.linspace(0, len(values) - 1, MOST_POINTS).astype(int))
        share = (kept + 0.5) / len(values)
        band = band_of(len(values))
        low, high = np.clip(share - band, 0.0, 1.0), np.clip(share + band, 0.0, 1.0)
        x = values[kept]
        axes.fill_between(x, 100.0 * low, 100.0 * high, color=OURS, alpha=0.25, linewidth=0.0)
        axes.plot(x, 100.0 * share, color=OURS, linewidth=1.4)
        for verdict in (v for v in result.verdicts if v.key == name):
            axes.axvline(verdict.number, color=MEASURED, linewidth=1.3, linestyle="--")
        if name.startswith("smallest_gap") and values[0] < 0.0:
            axes.axvline(0.0, color=MARK, linewidth=1.0)
        axes.set_title(names[name], fontsize=9.5, loc="left", parse_math=False)
        axes.grid(color=GRID)
        style_axes(axes)
    for axes in panels[:, 0]:
        axes.set_ylabel("runs below, %", fontsize=9)
    for axes in list(panels.flat)[len(names) :]:
        axes.remove()
    return figure


def sobol_figure(found: list[tuple[str, Index]]) -> Figure:
    """Draw first-order and total index of each quantity with their intervals."""
    figure = Figure(figsize=(WIDTH, 0.42 * len(found) + 1.1), layout="constrained")
    axes = figure.add_subplot()
    at = np.arange(len(found))[::-1]
    for shift, colour, label, kind in (
        (0.18, OURS, "total: alone and together with others", "total"),
        (-0.18, MEASURED, "first order: alone", "first"),
    ):
        value = np.array([getattr(index, kind) for _, index in found])
        low = np.array([getattr(index, f"{kind}_lower") for _, index in found])
        high = np.array([getattr(index, f"{kind}_upper") for _, index in found])
        axes.barh(at + shift, np.maximum(value, 0.0), height=0.34, color=colour, label=label)
        axes.hlines(at + shift, low, high, color=MARK, linewidth=1.1)
    axes.set_yticks(at, [name for name, _ in found])
    axes.set_xlim(-0.1, 1.1)
    axes.axvline(0.0, color=QUIET, linewidth=0.6)
    axes.set_xlabel("share of the variance", fontsize=9.5)
    axes.legend(loc="lower right", fontsize=9, frameon=False)
    axes.grid(color=GRID, axis="x")
    style_axes(axes)
    return figure
