"""Report of the gasket-damping study: optimum, objective function, search path, envelopes."""

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.figure import Figure

from wm_drake.parameters import MachineParameters
from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.report.figures import GRID, MARK, MEASURED, OURS, QUIET, WIDTH
from wm_drake.report.formatting import MM_PER_M, number, percent, significant
from wm_drake.report.page import Picture, picture, render, versions_of
from wm_drake.report.tables import Group, Row, Table, parameter_table
from wm_drake.simulation.measures import envelopes, percent_difference
from wm_drake.studies.gasket_damping.grid_search import Search
from wm_drake.studies.gasket_damping.study import (
    AGREEMENT,
    LOWER,
    NOISE,
    UNKNOWNS,
    UPPER,
    WINDOW,
    Damping,
)

UNITS = (Unit("N*s/m", "N*s/mm"), Unit("N*m*s/rad", "N*mm*s/deg"))
"""SI units and printed units of C_L and C_T."""


def in_units_of_paper(damping: FloatArray) -> tuple[float, float]:
    """Return C_L and C_T in the units of [B]. [N s/mm, N mm s/deg]"""
    linear, torsional = (
        unit.from_si(float(value)) for unit, value in zip(UNITS, damping, strict=True)
    )
    return linear, torsional


def gasket_damping_report(result: Damping, parameters: MachineParameters, command: str = "") -> str:
    """Return the report as text of one self-contained HTML file.

    Args:
        result: Result of the study.
        parameters: Machine before the search.
        command: Command line of the study, shown on the page.
    """
    record = next(iter(result.at_best.values()))
    facts = [
        ("Machine", parameters.name),
        ("About", parameters.about),
        ("Engine of the search", "compiled"),
    ]
    facts += [("Versions", versions_of(record.attrs)), ("Command", command)]
    return render(
        "gasket_damping/page.html",
        title=f"Gasket damping of machine {parameters.name}",
        about=parameters.about,
        summary=summary(result),
        warnings=_warnings(result),
        optima=_optima(result),
        surface=_surface_picture(result),
        envelopes=[_envelopes_picture(result, load) for load in result.measured],
        amplitudes=_amplitudes(result),
        facts=[(word, text) for word, text in facts if text],
        numbers=parameter_table(parameters),
    )


NAMES = {"grid": "grid search", "scipy": "bounded Nelder-Mead method of SciPy"}
"""Names of the searches for reading."""


def summary(result: Damping) -> str:
    """Return one paragraph: the better optimum, whether both searches agree, the planted values."""
    source = "a virtual experiment" if result.truth is not None else "measured records"
    loads = f"load{'s' if len(result.measured) > 1 else ''} {' and '.join(result.measured)}"
    text = (
        f"The computed envelopes agree best with {source} of {loads} at "
        f"{_damping_text(result.better.best)}, with an envelope distance of "
        f"{number(result.better.value, 2)} mm. {_interval_text(result)} {_agreement(result)}"
    )
    if result.truth is None:
        return text
    errors = [
        f"{number(100.0 * (b - t) / t, 1)} %"
        for b, t in zip(result.better.best, result.truth, strict=True)
        if t
    ]
    return (
        f"{text} The planted values are {_damping_text(result.truth)}; the optimum differs from "
        f"them by {' and '.join(errors)}."
    )


def _agreement(result: Damping) -> str:
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
        f"evaluations; the {NAMES[other[0]]} found {_damping_text(other[1].best)}, with a distance "
        f"of {number(other[1].value, 2)} mm, after {other[1].evaluations}."
    )


def _interval_text(result: Damping) -> str:
    """Return a sentence about the confidence interval."""
    if result.interval is None:
        return "There is no confidence interval: fewer than three curves, or a run diverged."
    low, high = (in_units_of_paper(end) for end in (result.interval.low, result.interval.high))
    return (
        f"95 % intervals: {number(low[0], 4)} to {number(high[0], 4)} N s/mm "
        f"for C_L and {number(low[1], 1)} to {number(high[1], 1)} N mm s/deg for C_T."
    )


def _warnings(result: Damping) -> list[str]:
    found = []
    if not result.searches_agree:
        found.append(
            "The grid search and the Nelder-Mead search found different optima (see the table of "
            "optima). The one with the smaller distance is reported. A finer mesh (--mesh) may "
            "bring them together."
        )
    if result.truth is None:
        return found
    return [
        *found,
        "No measured records were given. The records on this page come from a virtual experiment: "
        f"the Drake engine ran the same machine with {_damping_text(result.truth)}, and noise of "
        f"{number(MM_PER_M * NOISE, 1)} mm was added to each sample. The experiment shows that the "
        "study finds known values. It gives no information about a real gasket.",
    ]


def _damping_text(damping: FloatArray) -> str:
    linear, torsional = in_units_of_paper(damping)
    return f"C_L = {number(linear, 4)} N s/mm and C_T = {number(torsional, 1)} N mm s/deg"


def points_table(result: Damping) -> pd.DataFrame:
    """Return every point of the grid search: round, damping and value of the objective."""
    rows = [
        {
            "round": index,
            "spacing [% of region]": 100.0 * grid.spacing,
            "C_L [N s/mm]": in_units_of_paper(point)[0],
            "C_T [N mm s/deg]": in_units_of_paper(point)[1],
            "objective [mm]": value,
        }
        for index, grid in enumerate(result.grid.rounds, start=1)
        for point, value in zip(grid.points, grid.values, strict=True)
    ]
    return pd.DataFrame(rows)


def _optima(result: Damping) -> Table:
    def line(name: str, search: Search) -> Group:
        name = f"{name} (better)" if search is result.better else name
        linear, torsional = in_units_of_paper(search.best)
        cells = (
            number(linear, 4),
            number(torsional, 1),
            number(search.value, 2),
            str(search.evaluations),
        )
        return Group(name, (Row(cells),))

    groups = [
        line("grid search of [B]", result.grid),
        line("SciPy, bounded Nelder-Mead", result.scipy),
    ]
    if result.interval is not None:
        ends = [in_units_of_paper(end) for end in (result.interval.low, result.interval.high)]
        texts = [f"{number(a, d)} to {number(b, d)}" for a, b, d in zip(*ends, (4, 1), strict=True)]
        groups.append(Group("95 % interval of the better one", (Row((*texts, "", "")),)))
    if result.truth is not None:
        linear, torsional = in_units_of_paper(result.truth)
        groups.append(
            Group("planted", (Row((number(linear, 4), number(torsional, 1), "", ""), "measured"),))
        )
    header = ("found by", "C_L, N s/mm", "C_T, N mm s/deg", "distance, mm", "evaluations")
    caption = (
        "Distance: sum over the loads of the 2-norm of the differences of the upper and lower "
        f"envelopes at all sensors, every 5 ms from {WINDOW[0]:g} to {WINDOW[1]:g} s, [B] Eq. (2), "
        "(3). These envelopes are smooth (magnitude of the analytic signal). The grid of the "
        "search moves to its best point and is halved when it has no better point than its centre, "
        f"until its spacing is at most {_mesh_text(result)}. "
        "The interval shows how much the optimum depends on single curves (one sensor with one "
        "load): each is left out once (jackknife). An error that all curves share, such as a "
        "wrong stiffness of a spring, is not in it."
    )
    return Table(caption, header, tuple(groups))


def _mesh_text(result: Damping) -> str:
    """Return the spacing of the last grid in both unknowns."""
    linear, torsional = in_units_of_paper(result.grid.rounds[-1].spacing * (UPPER - LOWER))
    return f"{significant(linear, 2)} N s/mm and {significant(torsional, 2)} N mm s/deg"


def _surface_picture(result: Damping) -> Picture:
    caption = (
        "Left: points of the grid search, darker in each later round, and the path of the best "
        "point from the first grid on. Right: value of the objective function at these points "
        "([B] Fig. 7)."
    )
    return picture(
        surface_figure(result),
        "Grid points with the path of the search, and the surface of the objective function.",
        caption,
    )


def surface_figure(result: Damping) -> Figure:
    """Draw the grid points and the path of the search, and the surface of the objective."""
    figure = Figure(figsize=(WIDTH, 4.6), layout="constrained")
    axes, space = figure.add_subplot(1, 2, 1), figure.add_subplot(1, 2, 2, projection="3d")
    points = np.array([in_units_of_paper(p) for grid in result.grid.rounds for p in grid.points])
    values = np.concatenate([grid.values for grid in result.grid.rounds])
    finite = np.isfinite(values)
    levels = axes.tricontourf(
        points[finite, 0], points[finite, 1], values[finite], levels=14, cmap="Blues_r", alpha=0.55
    )
    figure.colorbar(levels, ax=axes, label="distance, mm", pad=0.02)
    for index, grid in enumerate(result.grid.rounds):
        own = np.array([in_units_of_paper(p) for p in grid.points]).reshape(-1, 2)
        mark, size = ("o", 5.0) if index == 0 else ("x", 4.0)
        shade = min(1.0, 0.35 + 0.15 * index)
        axes.plot(*own.T, mark, color=MARK, alpha=shade, markersize=size, fillstyle="none")
    path = np.array([in_units_of_paper(grid.best) for grid in result.grid.rounds])
    axes.plot(*path.T, "-", color=MEASURED, linewidth=1.6, zorder=4, label="path of the best point")
    axes.plot(*path[-1], "o", color=MEASURED, markersize=6, zorder=4)
    if result.interval is not None:
        best, *ends = (
            in_units_of_paper(point)
            for point in (result.interval.best, result.interval.low, result.interval.high)
        )
        low, high = ends
        axes.errorbar(
            *best,
            xerr=[[best[0] - low[0]], [high[0] - best[0]]],
            yerr=[[best[1] - low[1]], [high[1] - best[1]]],
            fmt="s",
            color=MARK,
            markersize=4,
            capsize=3,
            linewidth=1.2,
            label="better optimum, 95 % intervals",
        )
    if result.truth is not None:
        axes.plot(
            *in_units_of_paper(result.truth),
            "+",
            color=OURS,
            markersize=14,
            markeredgewidth=2.2,
            label="planted",
        )
    axes.set_xlabel("C_L, N s/mm", fontsize=9.5)
    axes.set_ylabel("C_T, N mm s/deg", fontsize=9.5)
    axes.legend(loc="upper right", fontsize=8.5)
    axes.tick_params(labelsize=9)
    space.plot_trisurf(
        *points[finite].T, values[finite], cmap="Blues_r", linewidth=0.2, edgecolor="white"
    )
    space.set_xlabel("C_L, N s/mm", fontsize=8.5)
    space.set_ylabel("C_T, N mm s/deg", fontsize=8.5)
    # a label of the vertical axis would lie on the colour bar
    space.set_title("distance, mm", fontsize=9.5)
    space.tick_params(labelsize=8)
    # seen from the far corner, because the high corner at little damping would hide the valley
    space.view_init(30, 40)
    return figure


def _envelopes_picture(result: Damping, load: str) -> Picture:
    caption = (
        f"Load {load}: envelopes of the displacement at each sensor in the band 0.5–20 Hz. Shaded "
        f"area: computed at the optimum. Dashed lines: {_source(result)}. The envelopes are "
        f"compared from {WINDOW[0]:g} to {WINDOW[1]:g} s."
    )
    return picture(
        envelopes_figure(result, load),
        f"Computed envelopes at the optimum and {_source(result)}, load {load}.",
        caption,
    )


def _source(result: Damping) -> str:
    return "measured" if result.truth is None else "virtual experiment"


def envelopes_figure(result: Damping, load: str) -> Figure:
    """Draw the envelopes computed at the optimum and the measured ones, one panel per sensor."""
    ours = MM_PER_M * envelopes(result.at_best[load])
    theirs = MM_PER_M * envelopes(xr.Dataset({"displacement": result.measured[load]}))
    sensors = [str(name) for name in ours.sensor.values]
    rows = -(-len(sensors) // 3)
    figure = Figure(figsize=(WIDTH, 2.0 * rows + 0.7), layout="constrained")
    panels = figure.subplots(rows, 3, squeeze=False, sharex=True, sharey=True)
    for axes, name in zip(panels.flat, sensors, strict=False):
        kept = ours.sel(sensor=name).isel(time=slice(None, None, 10))
        axes.fill_between(
            kept.time,
            kept.lower,
            kept.upper,
            color=OURS,
            alpha=0.3,
            linewidth=0.0,
            label="computed",
        )
        other = theirs.sel(sensor=name).isel(time=slice(None, None, 10))
        for side in ("upper", "lower"):
            axes.plot(
                other.time,
                other[side],
                "--",
                color=MEASURED,
                linewidth=1.1,
                label=_source(result) if side == "upper" else None,
            )
        axes.set_title(name, fontsize=10, loc="left", fontweight="bold", parse_math=False)
        axes.axhline(0.0, color=QUIET, linewidth=0.6)
        axes.grid(color=GRID)
        axes.tick_params(labelsize=8.5)
        axes.spines[["top", "right"]].set_visible(False)
    for axes in panels[-1]:
        axes.set_xlabel("time, s", fontsize=9)
    for axes in panels[:, 0]:
        axes.set_ylabel("mm", fontsize=9)
    figure.legend(
        *panels.flat[0].get_legend_handles_labels(),
        loc="outside lower center",
        ncols=2,
        frameon=False,
        fontsize=9,
    )
    return figure


def _amplitudes(result: Damping) -> Table:
    """Return the largest envelope values in the time window with their differences, [B] Table 2."""
    groups = []
    for load, record in result.at_best.items():
        pair = [_largest(record.displacement), _largest(result.measured[load])]
        change = percent_difference(*pair)
        rows = [
            Row((name, *(number(MM_PER_M * float(v)) for v in values)), kind)
            for name, values, kind in (
                ("computed", pair[0], "ours"),
                (_source(result), pair[1], "measured"),
            )
        ]
        rows.append(Row(("difference", *(percent(float(value)) for value in change)), "difference"))
        groups.append(Group(load, tuple(rows)))
    sensors = next(iter(result.at_best.values())).sensor.values
    caption = "Amplitudes in the time window and their differences, [B] Eq. (1) and Table 2."
    header = ("load", "source", *(f"{name}, mm" for name in sensors))
    return Table(caption, header, tuple(groups), text_columns=2)


def _largest(displacement: xr.DataArray) -> xr.DataArray:
    both = envelopes(xr.Dataset({"displacement": displacement})).sel(time=slice(*WINDOW))
    return np.maximum(abs(both.upper), abs(both.lower)).max("time")


__all__ = ["UNKNOWNS", "gasket_damping_report", "in_units_of_paper", "points_table", "summary"]
