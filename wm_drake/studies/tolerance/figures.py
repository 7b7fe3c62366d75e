"""Figures of the tolerance study."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from wm_drake.report import figure as fig
from wm_drake.report.formatting import MM_PER_M
from wm_drake.studies.tolerance.sensitivity import Index
from wm_drake.studies.tolerance.shares import band_of
from wm_drake.studies.tolerance.study import ToleranceStudy

MOST_POINTS = 400
"""Largest number of points of a curve."""

MOST_STEPS = 5
"""Number of heights at which the loads are drawn, so that their names do not overlap."""


def distributions_figure(result: ToleranceStudy, names: dict[str, str]) -> fig.Figure:
    """Return the distribution function of each measure with its 95 % band and its limits.

    Args:
        names: Titles of the measures by their keys.
    """
    panels = [
        fig.Panel(
            title=title, marks=tuple(_distribution(result, name)), y=fig.Axis(label="runs below, %")
        )
        for name, title in names.items()
    ]
    return fig.Figure(panels=fig.in_grid(panels, 3, share="y"), height=150.0)


def _distribution(result: ToleranceStudy, name: str) -> list[fig.Mark]:
    """Return the distribution function of a measure with its 95 % band and its limits."""
    values = np.sort(result.values[name].dropna().to_numpy())
    kept = np.unique(np.linspace(0, len(values) - 1, MOST_POINTS).astype(int))
    share = (kept + 0.5) / len(values)
    half = band_of(len(values))
    low, high = np.clip(share - half, 0.0, 1.0), np.clip(share + half, 0.0, 1.0)
    marks: list[fig.Mark] = [
        fig.band(values[kept], 100.0 * low, 100.0 * high, opacity=0.25),
        fig.Line(values[kept], 100.0 * share, width=2.0),
    ]
    limits = [verdict.number for verdict in result.verdicts if verdict.key == name]
    return marks + [fig.Rule(x, "y", color=fig.MEASURED, width=1.8, dash="dashed") for x in limits]


def gap_figure(result: ToleranceStudy, name: str, loads: Mapping[str, float]) -> fig.Figure:
    """Return the distribution of the smallest gap beside the gaps of the loads of the machine.

    Args:
        name: Key of the smallest gap among the measures.
        loads: Smallest gap by load. [m]
    """
    marks = [*_distribution(result, name), fig.Rule(0.0, "y", color=fig.MARK)]
    ranked = sorted(loads.items(), key=lambda item: item[1])
    if ranked:
        gaps = np.array([MM_PER_M * gap for _, gap in ranked])
        heights = 15.0 + 18.0 * (np.arange(len(gaps)) % MOST_STEPS)
        marks.append(
            fig.Points(gaps, heights, color=fig.MEASURED, size=9.0, key="load of the machine")
        )
        marks += [
            fig.Text(float(gap), float(height), load, across="left", shift=(9.0, 0.0))
            for (load, _), gap, height in zip(ranked, gaps, heights, strict=True)
        ]
    x = fig.Axis(label="smallest gap, mm (0: contact)")
    y = fig.Axis(label="runs below, %", range=(0.0, 100.0))
    return fig.Figure(panels=(fig.Panel(marks=tuple(marks), x=x, y=y),), height=260.0)


def sobol_figure(indices: list[tuple[str, Index]]) -> fig.Figure:
    """Return first-order and total index of each quantity with their intervals."""
    at = np.arange(len(indices))[::-1]
    marks: list[fig.Mark] = [fig.Rule(0.0, "y", color=fig.QUIET)]
    for shift, color, key, kind in (
        (0.18, fig.OURS, "total: alone and together with others", "total"),
        (-0.18, fig.MEASURED, "first order: alone", "first"),
    ):
        value, low, high = (
            np.array([getattr(index, f"{kind}{side}") for _, index in indices])
            for side in ("", "_lower", "_upper")
        )
        bars = fig.Bars(at + shift, np.maximum(value, 0.0), is_across=True, color=color, key=key)
        ends = (low, at + shift), (high, at + shift)
        marks += [replace(bars, thickness=0.34), fig.segments(*ends, color=fig.MARK, key=key)]
    x = fig.Axis(label="share of the variance", range=(-0.1, 1.1))
    y = fig.Axis(ticks=fig.named((name for name, _ in indices), at), has_grid=False)
    panel = fig.Panel(marks=tuple(marks), x=x, y=y)
    return fig.Figure(panels=(panel,), height=42.0 * len(indices) + 20.0)
