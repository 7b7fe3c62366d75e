"""Figures of the tolerance study."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from wm_drake.report import figure as fig
from wm_drake.report.quantity import SHARE, quantity_of, shown
from wm_drake.studies.tolerance.shares import band_of

MOST_POINTS = 400
"""Largest number of points of a curve."""

MOST_STEPS = 5
"""Number of heights at which the loads are drawn, so that their names do not overlap."""

BELOW = SHARE.named("runs below")


def distributions_figure(measures: xr.Dataset, limits: Mapping[str, Sequence[float]]) -> fig.Figure:
    """Return the distribution function of each measure with its 95 % band and its limits.

    Args:
        measures: Measures over the samples.
        limits: Limits by measure. [SI]
    """
    panels = [
        fig.Panel(
            title=quantity_of(column).label,
            marks=tuple(_distribution(column, limits.get(str(name), ()))),
            y=fig.Axis(label=BELOW.label),
        )
        for name, column in measures.items()
    ]
    return fig.Figure(panels=fig.in_grid(panels, 3, share="y"), height=150.0)


def _distribution(column: xr.DataArray, limits: Sequence[float]) -> list[fig.Mark]:
    """Return the distribution function of a measure with its 95 % band and its limits."""
    values = np.sort(shown(column)[np.isfinite(column.values)])
    kept = np.unique(np.linspace(0, len(values) - 1, MOST_POINTS).astype(int))
    share, half = (kept + 0.5) / len(values), band_of(len(values))
    low, high = (BELOW.values(np.clip(share + side, 0.0, 1.0)) for side in (-half, half))
    marks: list[fig.Mark] = [
        fig.band(values[kept], low, high, opacity=0.25),
        fig.Line(values[kept], BELOW.values(share), width=2.0),
    ]
    places = quantity_of(column).values(limits)
    return marks + [
        fig.Rule(float(x), "y", color=fig.MEASURED, width=1.8, dash="dashed") for x in places
    ]


def gap_figure(
    gaps: xr.DataArray, limits: Sequence[float], loads: xr.DataArray | None
) -> fig.Figure:
    """Return the distribution of the smallest gap beside the gaps of the loads of the machine.

    Args:
        gaps: Over the samples. [m]
        limits: Limits of the gap. [m]
        loads: Smallest gap over `load` [m]; None without.
    """
    marks = [*_distribution(gaps, limits), fig.Rule(0.0, "y", color=fig.MARK)]
    if loads is not None and loads.notnull().any():
        ranked = loads.dropna("load").sortby(loads.dropna("load"))
        places = shown(ranked)
        heights = 15.0 + 18.0 * (np.arange(len(places)) % MOST_STEPS)
        marks.append(
            fig.Points(places, heights, color=fig.MEASURED, size=9.0, key="load of the machine")
        )
        marks += [
            fig.Text(float(x), float(height), load, across="left", shift=(9.0, 0.0))
            for load, x, height in zip(ranked["load"].values.tolist(), places, heights, strict=True)
        ]
    x = fig.Axis(label=f"{quantity_of(gaps).label} (0: contact)")
    y = fig.Axis(label=BELOW.label, range=(0.0, 100.0))
    return fig.Figure(panels=(fig.Panel(marks=tuple(marks), x=x, y=y),), height=260.0)


def sobol_figure(indices: xr.Dataset, names: Sequence[str]) -> fig.Figure:
    """Return first-order and total index of each quantity with their intervals.

    Args:
        indices: Indices of a measure over `quantity`.
        names: Words of the quantities.
    """
    at = np.arange(len(names))[::-1]
    marks: list[fig.Mark] = [fig.Rule(0.0, "y", color=fig.QUIET)]
    for shift, color, key, kind in (
        (0.18, fig.OURS, "total: alone and together with others", "total"),
        (-0.18, fig.MEASURED, "first order: alone", "first"),
    ):
        value, low, high = (indices[f"{kind}{side}"].values for side in ("", "_lower", "_upper"))
        bars = fig.Bars(at + shift, np.maximum(value, 0.0), is_across=True, color=color, key=key)
        ends = (low, at + shift), (high, at + shift)
        marks += [replace(bars, thickness=0.34), fig.segments(*ends, color=fig.MARK, key=key)]
    x = fig.Axis(label="share of the variance", range=(-0.1, 1.1))
    y = fig.Axis(ticks=fig.named(names, at), has_grid=False)
    panel = fig.Panel(marks=tuple(marks), x=x, y=y)
    return fig.Figure(panels=(panel,), height=42.0 * len(names) + 20.0)
