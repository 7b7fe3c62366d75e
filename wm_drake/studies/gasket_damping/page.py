"""Page of the gasket-damping study: optimum, objective function, search path, envelopes."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import pandas as pd
import xarray as xr
from scipy.interpolate import griddata

from wm_drake.parameters.types import FloatArray
from wm_drake.report import figure as fig
from wm_drake.report.formatting import MM_PER_M, number, percent, significant
from wm_drake.report.page import Picture, Section, SectionedPage, picture, versions_of
from wm_drake.report.table import Column, Group, Row, Table, line
from wm_drake.report.terminal import Printed
from wm_drake.simulation.displacements import envelopes, percent_difference
from wm_drake.studies.fitting.search import Optimum
from wm_drake.studies.gasket_damping.study import (
    AGREEMENT,
    LOWER,
    NOISE,
    UNKNOWNS,
    UPPER,
    WINDOW,
    GasketDamping,
    in_units_of_paper,
    named,
)
from wm_drake.studies.study import Facts, Result

SHOWN_CELLS = 60
"""Number of columns and of rows of the coloured map of distances."""


@dataclass(frozen=True)
class GasketDampingResult(Result):
    """An identification of C_L and C_T, as it is shown."""

    damping: GasketDamping
    float_format: ClassVar[str] = "%.9g"

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return every point of the grid search with its distance."""
        return {"objective": points_table(self.damping)}

    def as_json(self) -> dict[str, Any]:
        """Return the result for JSON, in the units of [B]."""

        def plain(search: Optimum) -> dict[str, Any]:
            return {
                **named(search.point),
                "objective_mm": search.cost,
                "evaluations": search.evaluations,
            }

        damping, interval = self.damping, self.damping.interval
        ends = [] if interval is None else [named(interval.low), named(interval.high)]
        return {
            "units": {"C_L": "N s/mm", "C_T": "N mm s/deg"},
            "virtual_experiment": damping.truth is not None,
            "planted": None if damping.truth is None else named(damping.truth),
            "best": plain(damping.better)
            | {"search": "grid" if damping.better is damping.grid else "scipy"},
            "searches_agree": damping.searches_agree,
            "grid": plain(damping.grid)
            | {"rounds": len(damping.rounds), "mesh_percent": 100.0 * damping.rounds[-1].spacing},
            "scipy": plain(damping.scipy),
            "interval_95": {name: [end[name] for end in ends] for name in UNKNOWNS}
            if ends
            else None,
        }

    def terminal(self) -> Printed:
        """Return the summary."""
        return [summary(self.damping)]

    def page(self, facts: Facts) -> str:
        """Return the page."""
        return gasket_damping_page(self.damping, facts)


def gasket_damping_page(result: GasketDamping, facts: Facts) -> str:
    """Return the page as text of one self-contained HTML file."""
    envelopes = tuple(_envelopes_picture(result, load) for load in result.measured)
    sections = [
        Section("surface", "Error over both dampings", (_surface_picture(result),)),
        Section("envelopes", "Envelopes at the optimum", envelopes),
        Section("optimum", "Optimum", tables=(_optima(result),)),
        Section("amplitudes", "Amplitudes at the optimum", tables=(_amplitudes(result),)),
    ]
    record = next(iter(result.at_best.values()))
    made = [
        ("Machine before the search", result.parameters.name),
        ("Engine of the search", "compiled"),
        ("Versions", versions_of(record.attrs)),
        *facts.rows(),
    ]
    return SectionedPage(
        f"Gasket damping of machine {result.parameters.name}",
        summary(result),
        sections,
        made,
        result.parameters,
        [*facts.warnings, *_warnings(result)],
    ).html()


NAMES = {"grid": "grid search", "scipy": "bounded Nelder-Mead method of SciPy"}
"""Names of the searches for reading."""


def summary(result: GasketDamping) -> str:
    """Return one paragraph: the better optimum, whether both searches agree, the planted values."""
    source = "a virtual experiment" if result.truth is not None else "measured records"
    loads = f"load{'s' if len(result.measured) > 1 else ''} {' and '.join(result.measured)}"
    text = (
        f"The computed envelopes agree best with {source} of {loads} at "
        f"{_damping_text(result.better.point)}, with an envelope distance of "
        f"{number(result.better.cost, 2)} mm. {_interval_text(result)} {_agreement(result)}"
    )
    if result.truth is None:
        return text
    errors = [
        f"{number(100.0 * (b - t) / t, 1)} %"
        for b, t in zip(result.better.point, result.truth, strict=True)
        if t
    ]
    return (
        f"{text} The planted values are {_damping_text(result.truth)}; the optimum differs from "
        f"them by {' and '.join(errors)}."
    )


def _agreement(result: GasketDamping) -> str:
    """Return sentences on what each search found and whether both agree."""
    first, other = sorted(
        (("grid", result.grid), ("scipy", result.scipy)),
        key=lambda item: item[1] is not result.better,
    )
    verdict = (
        f"The two searches agree within {100.0 * AGREEMENT:g} % of the region."
        if result.searches_agree
        else "The two searches disagree; the better one is reported."
    )
    return (
        f"{verdict} The {NAMES[first[0]]} found this optimum after {first[1].evaluations} "
        f"evaluations; the {NAMES[other[0]]} found {_damping_text(other[1].point)}, with a "
        f"distance of {number(other[1].cost, 2)} mm, after {other[1].evaluations}."
    )


def _interval_text(result: GasketDamping) -> str:
    """Return a sentence about the confidence interval."""
    if result.interval is None:
        return "There is no confidence interval: fewer than three curves, or a run diverged."
    low, high = (in_units_of_paper(end) for end in (result.interval.low, result.interval.high))
    return (
        f"95 % intervals: {number(low[0], 4)} to {number(high[0], 4)} N s/mm "
        f"for C_L and {number(low[1], 1)} to {number(high[1], 1)} N mm s/deg for C_T."
    )


def _warnings(result: GasketDamping) -> list[str]:
    warnings = []
    if not result.searches_agree:
        warnings.append(
            "The grid search and the Nelder-Mead search found different optima (see the table of "
            "optima). The one with the smaller distance is reported. A finer mesh (--mesh) may "
            "bring them together."
        )
    if result.truth is None:
        return warnings
    return [
        *warnings,
        "No measured records were given. The records on this page come from a virtual experiment: "
        f"the Drake engine ran the same machine with {_damping_text(result.truth)}, and noise of "
        f"{number(MM_PER_M * NOISE, 1)} mm was added to each sample. The experiment shows that the "
        "study finds known values. It gives no information about a real gasket.",
    ]


def _damping_text(damping: FloatArray) -> str:
    linear, torsional = in_units_of_paper(damping)
    return f"C_L = {number(linear, 4)} N s/mm and C_T = {number(torsional, 1)} N mm s/deg"


def points_table(result: GasketDamping) -> pd.DataFrame:
    """Return every point of the grid search: round, damping and value of the objective."""
    rows = [
        (index, 100.0 * grid.spacing, *in_units_of_paper(point), value)
        for index, grid in enumerate(result.rounds, start=1)
        for point, value in zip(grid.points, grid.values, strict=True)
    ]
    units = "spacing [% of region]", "C_L [N s/mm]", "C_T [N mm s/deg]", "objective [mm]"
    return pd.DataFrame(rows, columns=["round", *units])


def _optima(result: GasketDamping) -> Table:
    groups = [
        line(
            f"{name} (better)" if search is result.better else name,
            (*in_units_of_paper(search.point), search.cost, search.evaluations),
        )
        for name, search in (
            ("grid search of [B]", result.grid),
            ("SciPy, bounded Nelder-Mead", result.scipy),
        )
    ]
    if result.interval is not None:
        ends = [in_units_of_paper(end) for end in (result.interval.low, result.interval.high)]
        texts = [f"{number(a, d)} to {number(b, d)}" for a, b, d in zip(*ends, (4, 1), strict=True)]
        groups.append(line("95 % interval of the better one", (*texts, "", "")))
    if result.truth is not None:
        groups.append(line("planted", (*in_units_of_paper(result.truth), "", ""), "measured"))
    linear, torsional = in_units_of_paper(result.rounds[-1].spacing * (UPPER - LOWER))
    mesh = f"{significant(linear, 2)} N s/mm and {significant(torsional, 2)} N mm s/deg"
    columns = (
        "found by",
        Column("C_L", "N s/mm", 4),
        Column("C_T", "N mm s/deg", 1),
        Column("distance", "mm", 2),
        "evaluations",
    )
    caption = (
        "Distance: sum over the loads of the 2-norm of the differences of the upper and lower "
        f"envelopes at all sensors, every 5 ms from {WINDOW[0]:g} to {WINDOW[1]:g} s, [B] Eq. (2), "
        "(3). These envelopes are smooth (magnitude of the analytic signal). The grid of the "
        "search moves to its best point and is halved when it has no better point than its centre, "
        f"until its spacing is at most {mesh}. "
        "The interval shows how much the optimum depends on single curves (one sensor with one "
        "load): each is left out once (jackknife). An error that all curves share, such as a "
        "wrong stiffness of a spring, is not in it."
    )
    return Table(caption, columns, tuple(groups))


def _surface_picture(result: GasketDamping) -> Picture:
    caption = (
        "Left: distance over both dampings, points of the grid search, darker in each later round, "
        "and the path of the best point from the first grid on. Right: distance at "
        "these points over the linear damping; colours: torsional damping ([B] Fig. 7)."
    )
    return picture(
        surface_figure(result),
        "Grid points with the path of the search, and the surface of the objective function.",
        caption,
    )


def surface_figure(result: GasketDamping) -> fig.Figure:
    """Return the distance at the points of the grid search, with the path of the search."""
    points = in_units_of_paper(np.concatenate([grid.points for grid in result.rounds]))
    values = np.concatenate([grid.values for grid in result.rounds])
    points, values = points[np.isfinite(values)], values[np.isfinite(values)]
    across, up = (
        np.linspace(*ends, SHOWN_CELLS) for ends in zip(points.min(0), points.max(0), strict=True)
    )
    cells = griddata(points, values, tuple(np.meshgrid(across, up)))
    low, high = float(values.min()), float(values.max())
    scale = fig.Scale(low=low, high=high, shades="-Blues", label="distance, mm")
    marks: list[fig.Mark] = [fig.Cells(cells, across, up, scale=scale, opacity=0.6)]
    for index, grid in enumerate(result.rounds):
        shown, symbol = in_units_of_paper(grid.points), "x-thin" if index else "circle"
        grid_points = fig.Points(*shown.T, symbol=symbol, is_open=True, color=fig.MARK, size=6.0)
        marks.append(replace(grid_points, opacity=min(1.0, 0.35 + 0.15 * index)))
    path = in_units_of_paper(np.array([grid.best for grid in result.rounds]))
    key = "path of the best point"
    marks.append(fig.Line(*path.T, color=fig.MEASURED, width=2.2, key=key))
    marks.append(fig.Points(*path[-1:].T, color=fig.MEASURED, size=8.0, key=key))
    if result.interval is not None:
        ends = (result.interval.best, result.interval.low, result.interval.high)
        best, below, above = map(in_units_of_paper, ends)
        key = "better optimum, 95 % intervals"
        marks.append(fig.Points(*best[:, None], symbol="square", color=fig.MARK, size=6.0, key=key))
        x, y = (np.array([below[0], best[0]]), np.array([best[1], below[1]]))
        to_x, to_y = (np.array([above[0], best[0]]), np.array([best[1], above[1]]))
        marks.append(fig.segments((x, y), (to_x, to_y), color=fig.MARK, key=key))
    if result.truth is not None:
        planted = in_units_of_paper(result.truth)[:, None]
        marks.append(
            fig.Points(*planted, symbol="cross-thin", color=fig.OURS, size=18.0, key="planted")
        )
    linear, torsional = fig.Axis(label="C_L, N s/mm"), fig.Axis(label="C_T, N mm s/deg")
    colors = fig.Scale(
        low=float(points[:, 1].min()), high=float(points[:, 1].max()), label=torsional.label
    )
    over = fig.Points(points[:, 0], values, values=points[:, 1], scale=colors)
    panels = (
        fig.Panel(name="path", marks=tuple(marks), x=linear, y=torsional),
        fig.Panel(name="distance", marks=(over,), x=linear, y=fig.Axis(label="distance, mm")),
    )
    return fig.Figure(panels=fig.in_grid(panels, 2), height=380.0)


def _envelopes_picture(result: GasketDamping, load: str) -> Picture:
    caption = (
        f"Load {load}: envelopes of the filtered displacement at each sensor. Shaded "
        f"area: computed at the optimum. Dashed lines: {_source(result)}. The envelopes are "
        f"compared from {WINDOW[0]:g} to {WINDOW[1]:g} s."
    )
    return picture(
        envelopes_figure(result, load),
        f"Computed envelopes at the optimum and {_source(result)}, load {load}.",
        caption,
    )


def _source(result: GasketDamping) -> str:
    return "measured" if result.truth is None else "virtual experiment"


def envelopes_figure(result: GasketDamping, load: str) -> fig.Figure:
    """Return the envelopes computed at the optimum and the measured ones, one panel per sensor."""
    every = {"time": slice(None, None, 10)}
    computed = (MM_PER_M * envelopes(result.at_best[load])).isel(every)
    measured = xr.Dataset({"displacement": result.measured[load]})
    others = (MM_PER_M * envelopes(measured)).isel(every)
    panels = []
    for name in map(str, computed.sensor.values):
        ours, other = computed.sel(sensor=name), others.sel(sensor=name)
        area = fig.band(ours.time.values, ours.lower.values, ours.upper.values, opacity=0.3)
        lines = [
            fig.Line(other.time.values, other[side].values, color=fig.MEASURED, dash="dashed")
            for side in ("upper", "lower")
        ]
        marks = (
            fig.Rule(0.0, color=fig.QUIET),
            replace(area, key="computed"),
            *(replace(curve, key=_source(result)) for curve in lines),
        )
        panels.append(
            fig.Panel(title=name, marks=marks, x=fig.Axis(label="time, s"), y=fig.Axis(label="mm"))
        )
    return fig.Figure(panels=fig.in_grid(panels, 3, share="both"), height=150.0)


def _amplitudes(result: GasketDamping) -> Table:
    """Return the largest envelope values in the time window with their differences, [B] Table 2."""
    groups = []
    for load, record in result.at_best.items():
        pair = [_largest(record.displacement), _largest(result.measured[load])]
        change = percent_difference(*pair)
        rows = [
            Row((name, *(MM_PER_M * float(v) for v in values)), kind)
            for name, values, kind in (
                ("computed", pair[0], "ours"),
                (_source(result), pair[1], "measured"),
            )
        ]
        rows.append(Row(("difference", *(percent(float(value)) for value in change)), "difference"))
        groups.append(Group(load, tuple(rows)))
    sensors = next(iter(result.at_best.values())).sensor.values
    caption = "Amplitudes in the time window and their differences, [B] Eq. (1) and Table 2."
    columns = (Column(str(name), "mm", 1) for name in sensors)
    return Table(caption, ("load", "source", *columns), tuple(groups), text_columns=2)


def _largest(displacement: xr.DataArray) -> xr.DataArray:
    both = envelopes(xr.Dataset({"displacement": displacement})).sel(time=slice(*WINDOW))
    return np.maximum(abs(both.upper), abs(both.lower)).max("time")
