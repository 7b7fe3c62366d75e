"""Figures of the tolerance study."""

from dataclasses import replace

import numpy as np

from wm_drake.report.figure import (
    MARK,
    MEASURED,
    OURS,
    QUIET,
    Axis,
    Bars,
    Figure,
    Line,
    Mark,
    Panel,
    Rule,
    band,
    in_grid,
    named,
    segments,
)
from wm_drake.studies.tolerance.sensitivity import Index
from wm_drake.studies.tolerance.shares import band_of
from wm_drake.studies.tolerance.study import ToleranceResult

MOST_POINTS = 400
"""Largest number of points of a curve."""


def distributions_figure(result: ToleranceResult, names: dict[str, str]) -> Figure:
    """Return the distribution function of each measure with its 95 % band and its limits.

    Args:
        result: Result of the study.
        names: Titles of the measures by their keys.
    """
    panels = []
    for name, title in names.items():
        values = np.sort(result.values[name].dropna().to_numpy())
        kept = np.unique(np.linspace(0, len(values) - 1, MOST_POINTS).astype(int))
        share = (kept + 0.5) / len(values)
        half = band_of(len(values))
        low, high = np.clip(share - half, 0.0, 1.0), np.clip(share + half, 0.0, 1.0)
        x = values[kept]
        marks: list[Mark] = [
            band(x, 100.0 * low, 100.0 * high, opacity=0.25),
            Line(x, 100.0 * share, width=2.0),
        ]
        limits = [verdict.number for verdict in result.verdicts if verdict.key == name]
        marks += [Rule(limit, "y", color=MEASURED, width=1.8, dash="dashed") for limit in limits]
        if name.startswith("smallest_gap") and values[0] < 0.0:
            marks.append(Rule(0.0, "y", color=MARK))
        panels.append(Panel(title=title, marks=tuple(marks), y=Axis(label="runs below, %")))
    return Figure(panels=in_grid(panels, 3, share="y"), height=150.0)


def sobol_figure(indices: list[tuple[str, Index]]) -> Figure:
    """Return first-order and total index of each quantity with their intervals."""
    at = np.arange(len(indices))[::-1]
    marks: list[Mark] = [Rule(0.0, "y", color=QUIET)]
    for shift, color, key, kind in (
        (0.18, OURS, "total: alone and together with others", "total"),
        (-0.18, MEASURED, "first order: alone", "first"),
    ):
        value, low, high = (
            np.array([getattr(index, f"{kind}{side}") for _, index in indices])
            for side in ("", "_lower", "_upper")
        )
        bars = Bars(at + shift, np.maximum(value, 0.0), is_across=True, color=color, key=key)
        ends = (low, at + shift), (high, at + shift)
        marks += [replace(bars, thickness=0.34), segments(*ends, color=MARK, key=key)]
    x = Axis(label="share of the variance", range=(-0.1, 1.1))
    y = Axis(ticks=named((name for name, _ in indices), at), has_grid=False)
    panel = Panel(marks=tuple(marks), x=x, y=y)
    return Figure(panels=(panel,), height=42.0 * len(indices) + 20.0)
