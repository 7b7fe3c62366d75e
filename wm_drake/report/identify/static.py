"""Report page and tables of quasi-static tests."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from wm_drake.report.figures import MEASURED, OURS, QUIET, WIDTH
from wm_drake.report.page import picture, render
from wm_drake.report.rig.figures import force_scale, legend_line, motion_scale, style_panel
from wm_drake.report.tables import Group, Row, Table
from wm_drake.rigs import AXES
from wm_drake.studies.identification import StaticCurve
from wm_drake.studies.identification.static import NOMINAL

MM_PER_M = 1e3


def static_report(title: str, curves: Sequence[StaticCurve], command: str = "") -> str:
    """Return the report as text of one self-contained HTML file."""
    fallen = [
        f"{_name(c)}: the mean of loading and unloading falls by up to {c.fallen:.3g} "
        f"{force_scale(c.rotates)[1]}; a table cannot fall, so it stays level there."
        for c in curves
        if c.fallen > 0.02 * float(np.max(np.abs(c.elastic)))
    ]
    return render(
        "identify/static.html",
        title=f"Quasi-static tests of {title}",
        about=f"{len(curves)} {'axis' if len(curves) == 1 else 'axes'}.",
        warnings=fallen,
        summary=summary(curves),
        pictures=[
            picture(
                static_figure(curves),
                "Force over displacement and moment over angle of each axis.",
                "Force over displacement and moment over angle (form of [B] Fig. 6): samples, "
                "loading and unloading, and their mean, which is the table. The offset of the "
                "instrument is removed.",
            )
        ],
        measures=_measures(curves),
        facts=[
            ("Files", ", ".join(loop.path for c in curves for loop in c.loops)),
            ("Command", command),
        ],
    )


def summary(curves: Sequence[StaticCurve]) -> str:
    """Return stiffness and hysteresis of each axis as one paragraph."""
    found = [
        f"Axis {axis}: {stiffness} from {reach}, with a hysteresis of ±{friction}."
        for axis, reach, stiffness, friction, *_ in static_cells(curves)
    ]
    table = "The force table is the mean of loading and unloading, without the instrument's offset."
    return " ".join([*found, table])


def static_figure(curves: Sequence[StaticCurve]) -> Figure:
    """Draw samples, branches and table of each axis, translations above rotations."""
    ordered = sorted(curves, key=lambda c: AXES.index(c.axis))
    kinds = [[c for c in ordered if c.rotates == kind] for kind in (False, True)]
    rows = [row for row in kinds if row]
    columns = max(2, *(len(row) for row in rows))
    figure = Figure(figsize=(WIDTH, 3.0 * len(rows) + 0.4), layout="constrained")
    grid = figure.subplots(len(rows), columns, squeeze=False)
    for row, panels in zip(rows, grid, strict=True):
        for index, axes in enumerate(panels):
            axes.set_visible(index < len(row))
            if index >= len(row):
                continue
            curve = row[index]
            factor, name, unit = motion_scale(curve.rotates)
            for loop in curve.loops:
                axes.plot(
                    factor * loop.displacement,
                    loop.force - curve.offset,
                    color=QUIET,
                    linewidth=0.7,
                    alpha=0.6,
                    rasterized=True,
                )
            x = factor * curve.position
            for branch in (curve.loading, curve.unloading):
                axes.plot(x, branch, color=MEASURED, linewidth=1.3)
            axes.plot(x, curve.elastic, color=OURS, linewidth=1.8)
            axes.set_title(_name(curve), fontsize=10, loc="left", fontweight="bold")
            axes.set_xlabel(f"{name}, {unit}", fontsize=9.5)
            if index == 0:
                axes.set_ylabel(", ".join(force_scale(curve.rotates)), fontsize=9.5)
            style_panel(axes)
    handles = [
        legend_line(QUIET, "samples", linewidth=1.0),
        legend_line(MEASURED, "loading and unloading", linewidth=1.6),
        legend_line(OURS, "mean (table)", linewidth=1.8),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False, fontsize=9.5)
    return figure


def static_table(curves: Sequence[StaticCurve]) -> pd.DataFrame:
    """Return the curves of each axis. [SI]"""
    parts = [
        pd.DataFrame(
            {
                "axis": c.axis,
                "displacement_or_angle": c.position,
                "loading": c.loading,
                "unloading": c.unloading,
                "mean": c.elastic,
                "half_width_of_hysteresis": c.half_width,
            }
        )
        for c in curves
    ]
    return pd.concat(parts, ignore_index=True)


def static_header() -> tuple[str, ...]:
    """Return the column heads for the cells of `static_cells`."""
    return (
        "axis",
        "range",
        "nominal stiffness",
        "half width of hysteresis",
        "energy per cycle, mJ",
        "offset",
        "median rate",
        "tests",
    )


def static_cells(curves: Sequence[StaticCurve]) -> list[tuple[str, ...]]:
    """Return the measures of each axis as text, with units."""
    found: list[tuple[str, ...]] = []
    for c in sorted(curves, key=lambda c: AXES.index(c.axis)):
        factor, _, unit = motion_scale(c.rotates)
        force = force_scale(c.rotates)[1]
        stiffness = (
            f"{c.stiffness:.4g} N m/rad" if c.rotates else f"{c.stiffness / MM_PER_M:.4g} N/mm"
        )
        found.append(
            (
                _name(c),
                f"{factor * c.position[0]:.3g} to {factor * c.position[-1]:.3g} {unit}",
                stiffness,
                f"{c.friction:.3g} {force}",
                f"{1e3 * c.energy:.3g}",
                f"{c.offset:.3g} {force}",
                f"{factor * c.fastest:.3g} {unit}/s",
                str(len(c.loops)),
            )
        )
    return found


def _measures(curves: Sequence[StaticCurve]) -> Table:
    caption = (
        f"Measures of each axis. Nominal stiffness: line through zero, fitted to the first "
        f"{100 * NOMINAL:.0f} % of the mean curve, as in [B] section 4. Half width of hysteresis: "
        "half the difference of loading and unloading, median over the range; a friction that does "
        "not depend on the rate has this force. At the median rate a damping adds to it."
    )
    groups = tuple(Group(cells[0], (Row(cells[1:]),)) for cells in static_cells(curves))
    return Table(caption, static_header(), groups, text_columns=8)


def _name(curve: StaticCurve) -> str:
    return curve.axis.replace("_", " ")
