"""`identify --static`: force tables with hysteresis from quasi-static tests."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd
from rich.table import Table as TerminalTable

from wm_drake.errors import input_error
from wm_drake.parameters import Component, MeasuredLoop
from wm_drake.report.figure import MEASURED, QUIET, Figure, Line, Mark, Panel, in_grid
from wm_drake.report.formatting import MM_PER_M
from wm_drake.report.page import Section, SectionedPage, picture
from wm_drake.report.table import Table, line
from wm_drake.rigs import AXES
from wm_drake.studies.components import axes_of, target_of
from wm_drake.studies.executor import Executor
from wm_drake.studies.identify.fragment import Destination, table_entry, written_fragment
from wm_drake.studies.identify.inputs import loops_of
from wm_drake.studies.identify.options import AxisFitOptions, DamperFitOptions
from wm_drake.studies.identify.static import (
    NOMINAL,
    SPONGE,
    StaticCurve,
    field_of,
    static_curve,
)
from wm_drake.studies.inputs import pairs_of
from wm_drake.studies.rig.figures import loop_panel
from wm_drake.studies.rig.units import units_of
from wm_drake.studies.study import Facts, Result, Task


@dataclass(frozen=True)
class StaticResult(Result):
    """Curves of quasi-static tests.

    Attributes:
        title: Component, for headings.
        curves: One for each tested axis, by all axes that get it.
        knots: Points of a table on each side of zero.
        destination: Where the tables go.
    """

    title: str
    curves: dict[tuple[str, ...], StaticCurve]
    knots: int
    destination: Destination
    float_format: ClassVar[str] = "%.7g"

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return the curves."""
        return {"static": static_table(list(self.curves.values()))}

    def texts(self) -> dict[str, str]:
        """Return the tables for a machine, and the measures of the curves as JSON."""
        entries = {
            field_of(axis): table_entry(curve.table(self.knots), _source(curve))
            for axes, curve in self.curves.items()
            for axis in axes
        }
        head = ["Tables from quasi-static tests: mean of loading and unloading."]
        return {
            "identified.yaml": written_fragment(entries, head, self.destination),
            "static.json": json.dumps(self.as_json(), indent=1),
        }

    def as_json(self) -> dict[str, Any]:
        """Return the measures of each axis for JSON, in SI."""
        axes = [curve.as_dict() for curve in self.curves.values()]
        return {"component": self.destination.target.component.name, "axes": axes}

    def terminal(self) -> list[TerminalTable | str]:
        """Return the measures of each axis."""
        return [measures_shown(list(self.curves.values())).terminal("Quasi-static tests")]

    def page(self, facts: Facts) -> str:
        """Return the page as text of one self-contained HTML file."""
        curves = list(self.curves.values())
        fallen = [
            f"{_name(c)}: the mean of loading and unloading falls by up to {c.fallen:.3g} "
            f"{units_of(c.rotates).force_unit}; a table cannot fall, so it stays level there."
            for c in curves
            if c.fallen > 0.02 * float(np.max(np.abs(c.elastic)))
        ]
        shown = picture(
            static_figure(curves),
            "Force over displacement and moment over angle of each axis.",
            "Force over displacement and moment over angle (form of [B] Fig. 6): samples, loading "
            "and unloading, and their mean, which is the table. The offset of the instrument is "
            "removed.",
        )
        return SectionedPage(
            f"Quasi-static tests of {self.title}",
            summary(curves),
            [
                Section("curves", "Force and hysteresis", (shown,)),
                Section("measures", "Values", tables=(measures_shown(curves),)),
            ],
            [("Files", ", ".join(loop.path for c in curves for loop in c.loops)), *facts.rows()],
            warnings=fallen,
            about=f"{len(curves)} {'axis' if len(curves) == 1 else 'axes'}.",
            method=METHOD,
        ).html()


def _source(curve: StaticCurve) -> str:
    names = ", ".join(loop.name for loop in curve.loops)
    friction = f"{curve.friction:.3g} {'N m' if curve.rotates else 'N'}"
    return f"quasi-static test {names}; half width of hysteresis {friction}"


class StaticTask(Task):
    """Quasi-static tests with checked options."""

    def __init__(self, kind: str, options: AxisFitOptions | DamperFitOptions) -> None:
        """Find the component and read the tests of each axis, or of the sponge of a damper."""
        self.options, self.target = options, target_of(kind, options)
        component = self.target.component
        self.title = kind if component.name == kind else f"{kind} {component.name}"
        if isinstance(options, AxisFitOptions):
            by_axis = _files_by_axis(options.files, options.axis)
        else:
            _check_sponge(component)
            by_axis = {(SPONGE,): list(options.files)}
        self.tests = {axes: _loops(paths, options, axes[0]) for axes, paths in by_axis.items()}

    def run(self, executor: Executor) -> StaticResult:
        """Compute the curve of each axis."""
        curves = {axes: static_curve(axes[0], loops) for axes, loops in self.tests.items()}
        changes = dict(pairs_of(self.options.sets, "--set"))
        destination = Destination(self.target, executor.out or Path(), changes)
        return StaticResult(self.title, curves, self.options.knots, destination)


def _check_sponge(damper: Component) -> None:
    if not hasattr(damper.parameters, SPONGE):
        law = damper.parameters.law  # type: ignore[union-attr]
        raise input_error(
            f"damper {damper.name} has the law {law}, which has no table; a quasi-static test "
            "gives the table of the sponge of the law free_stroke",
            where="--static",
        )


def _files_by_axis(files: Sequence[Path], axis: str | None) -> dict[tuple[str, ...], list[Path]]:
    """Return the files of each axis, of AXIS=FILE or all of one axis."""
    by_axis: dict[tuple[str, ...], list[Path]] = {}
    for path in files:
        word, separator, name = str(path).partition("=")
        if axis is not None:
            word, name = axis, str(path)
        elif not separator:
            raise input_error(
                f"'{path}' names no axis; write for example radial={path}, or --axis", where="FILES"
            )
        by_axis.setdefault(axes_of(word), []).append(Path(name))
    used = [one for axes in by_axis for one in axes]
    for one in used:
        if used.count(one) > 1:
            raise input_error(f"axis {one} is tested under two names", where="FILES")
    return by_axis


def _loops(
    paths: Sequence[Path], options: AxisFitOptions | DamperFitOptions, axis: str
) -> list[MeasuredLoop]:
    loops = loops_of(paths, options)
    if loops[0].rotates != axis.startswith("about"):
        needs = "angles and moments" if axis.startswith("about") else "displacements and forces"
        raise input_error(f"axis {axis} needs {needs}", where=loops[0].path)
    return loops


METHOD = (
    "Each test is split at its reversals into branches. The first 10 % of a branch, in which "
    "friction turns round, do not count. The mean curve is half the sum of loading and unloading. "
    "Near an end, where only the branch that arrives there counts, the half width next to it is "
    "taken off. The mean curve is shifted to zero force at zero displacement, the rest position of "
    "the component."
)


def summary(curves: Sequence[StaticCurve]) -> str:
    """Return stiffness and hysteresis of each axis as one paragraph."""
    sentences = [
        f"Axis {group.heading}: {stiffness} from {reach}, with a hysteresis of ±{friction}."
        for group in measures_shown(curves).groups
        for reach, stiffness, friction, *_ in [group.rows[0].cells]
    ]
    table = "The force table is the mean of loading and unloading, without the instrument's offset."
    return " ".join([*sentences, table])


def static_figure(curves: Sequence[StaticCurve]) -> Figure:
    """Draw samples, branches and table of each axis, translations above rotations."""
    ordered = sorted(curves, key=_place)
    kinds = [[c for c in ordered if c.rotates == kind] for kind in (False, True)]
    columns = max(2, *map(len, kinds))
    panels: list[Panel | None] = []
    for curves_of_kind in filter(None, kinds):
        panels += map(_panel, curves_of_kind)
        panels += [None] * (columns - len(curves_of_kind))
    return Figure(panels=in_grid(panels, columns), height=220.0, widths=(1.0,) * columns)


def _panel(curve: StaticCurve) -> Panel:
    """Return samples, branches and table of an axis."""
    units = units_of(curve.rotates)
    marks: list[Mark] = []
    faint = Line((), (), color=QUIET, opacity=0.6, key="samples")
    marks += [
        replace(faint, x=units.factor * loop.displacement, y=loop.force - curve.offset)
        for loop in curve.loops
    ]
    x = units.factor * curve.position
    for branch in (curve.loading, curve.unloading):
        marks.append(Line(x, branch, color=MEASURED, width=1.8, key="loading and unloading"))
    marks.append(Line(x, curve.elastic, width=2.4, key="mean (table)"))
    return loop_panel(_name(curve), marks, units.label("displacement"), units.force_label)


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


def measures_shown(curves: Sequence[StaticCurve]) -> Table:
    """Return the measures of each axis with units."""
    groups = []
    for c in sorted(curves, key=_place):
        units = units_of(c.rotates)
        low, high = units.factor * c.position[0], units.factor * c.position[-1]
        cells = (
            f"{low:.3g} to {high:.3g} {units.unit}",
            f"{c.stiffness:.4g} N m/rad" if c.rotates else f"{c.stiffness / MM_PER_M:.4g} N/mm",
            f"{c.friction:.3g} {units.force_unit}",
            f"{1e3 * c.energy:.3g} mJ",
            f"{c.offset:.3g} {units.force_unit}",
            f"{units.factor * c.fastest:.3g} {units.unit}/s",
            str(len(c.loops)),
        )
        groups.append(line(_name(c), cells))
    caption = (
        f"Measures of each axis. Nominal stiffness: line through zero, fitted to the first "
        f"{100 * NOMINAL:.0f} % of the mean curve, as in [B] section 4. Half width of hysteresis: "
        "half the difference of loading and unloading, median over the range; a friction that does "
        "not depend on the rate has this force. At the median rate a damping adds to it."
    )
    heads = (
        "axis",
        "range",
        "nominal stiffness",
        "half width of hysteresis",
        "energy per cycle",
        "offset",
        "median rate",
        "tests",
    )
    return Table(caption, heads, tuple(groups), text_columns=8)


def _place(curve: StaticCurve) -> int:
    """Return the place of a curve among the others; a sponge has no others."""
    return AXES.index(curve.axis) if curve.axis in AXES else 0


def _name(curve: StaticCurve) -> str:
    return curve.axis.replace("_", " ")
