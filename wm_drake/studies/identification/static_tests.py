"""`identify --static`: force tables with hysteresis from quasi-static tests."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import pandas as pd
from rich.table import Table

from wm_drake.errors import input_error
from wm_drake.parameters import Component, MeasuredLoop
from wm_drake.studies.components import axes_of, target_of
from wm_drake.studies.identification.fragment import Destination, table_entry, written_fragment
from wm_drake.studies.identification.inputs import loops_of
from wm_drake.studies.identification.options import AxisFitOptions, DamperFitOptions
from wm_drake.studies.identification.static import SPONGE, StaticCurve, field_of, static_curve
from wm_drake.studies.identification.static_page import measures_shown, static_page, static_table
from wm_drake.studies.inputs import pairs_of
from wm_drake.studies.run import Executor
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

    def terminal(self) -> list[Table | str]:
        """Return the measures of each axis."""
        return [measures_shown(list(self.curves.values())).terminal("Quasi-static tests")]

    def page(self, facts: Facts) -> str:
        """Return the page."""
        return static_page(self.title, list(self.curves.values()), facts)


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
