"""Show quasi-static tests: force, hysteresis and table of each axis."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import xarray as xr

from wm_drake.parameters import MeasuredLoop
from wm_drake.report.chart import marks_of
from wm_drake.report.figure import MEASURED, OURS, QUIET, Figure, Line, Mark, Panel, in_grid
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import SHARE, hidden, quantity_of, text_of
from wm_drake.rigs import AXES
from wm_drake.studies.answer import Answer, Part, Plot
from wm_drake.studies.identify.fragment import Destination, table_entry, written_fragment
from wm_drake.studies.identify.static import NOMINAL, field_of, is_about, table_of_curve
from wm_drake.studies.rig.figures import loop_panel
from wm_drake.studies.rig.quantities import PREFIXES, loop_quantities

StaticTests = Mapping[tuple[str, ...], Sequence[MeasuredLoop]]
"""Tests of an axis, by all axes that get its table."""

METHOD = (
    "Each test is split at its reversals into branches. The first 10 % of a branch, in which "
    "friction turns round, do not count. The mean curve is half the sum of loading and unloading. "
    "Near an end, where only the branch that arrives there counts, the half width next to it is "
    "taken off. The mean curve is shifted to zero force at zero displacement, the rest position of "
    "the component."
)

NOTICED = 0.02
"""Part of the largest force above which a fall of the mean is told."""


def static_answer(
    title: str,
    tests: StaticTests,
    curves: Mapping[tuple[str, ...], xr.Dataset],
    knots: int,
    destination: Destination,
) -> Answer:
    """Return the answer of quasi-static tests.

    Args:
        title: Component, for headings.
        curves: As of `static_curve` in `wm_drake.studies.identify.static`, by axes as the tests.
        knots: Points of a table on each side of zero.
        destination: Where the tables go.
    """
    entries = {
        field_of(axis): table_entry(table_of_curve(curve, knots), _source(curve, tests[axes]))
        for axes, curve in curves.items()
        for axis in axes
    }
    head = ["Tables from quasi-static tests: mean of loading and unloading."]
    loops = {axes[0]: of_axis for axes, of_axis in tests.items()}
    measured = sorted(curves.values(), key=_place)
    return Answer(
        f"Quasi-static tests of {title}",
        summary(measured),
        None,
        curve_parts(measured, loops),
        (("Files", ", ".join(loop.path for of_axis in tests.values() for loop in of_axis)),),
        METHOD,
        {"identified.yaml": written_fragment(entries, head, destination)},
        tuple(_fallen(curve) for curve in measured if _falls(curve)),
    )


def curve_parts(
    curves: Sequence[xr.Dataset], loops: Mapping[str, Sequence[MeasuredLoop]]
) -> tuple[Part, ...]:
    """Return picture, curves and measures of quasi-static tests.

    Args:
        curves: As of `static_curve` in `wm_drake.studies.identify.static`.
        loops: Tests by axis.
    """
    plot = Plot(
        _figure(curves, loops),
        "Force over displacement and moment over angle of each axis.",
        "Force over displacement and moment over angle (form of [B] Fig. 6): samples, loading and "
        "unloading, and their mean, which is the table. The offset of the instrument is removed.",
    )
    of_kinds = {
        prefix: [curve for curve in curves if is_about(curve.axis) == about]
        for about, prefix in PREFIXES.items()
    }
    kinds = {prefix: of_kind for prefix, of_kind in of_kinds.items() if of_kind}
    tables = [_curves(prefix, of_kind) for prefix, of_kind in kinds.items()]
    return (
        Part("Force and hysteresis", (plot, *tables)),
        Part("Values", [_measures(prefix, of_kind) for prefix, of_kind in kinds.items()]),
    )


def _falls(curve: xr.Dataset) -> bool:
    return bool(curve.largest_fall > NOTICED * abs(curve["mean"]).max())


def _fallen(curve: xr.Dataset) -> str:
    return (
        f"{_name(curve)}: the mean of loading and unloading falls by up to "
        f"{text_of(curve.largest_fall)}; a table cannot fall, so it stays level there."
    )


def _source(curve: xr.Dataset, loops: Sequence[MeasuredLoop]) -> str:
    names = ", ".join(loop.name for loop in loops)
    return f"quasi-static test {names}; half width of hysteresis {text_of(curve.hysteresis)}"


def summary(curves: Sequence[xr.Dataset]) -> str:
    """Return stiffness and hysteresis of each axis as one paragraph."""
    sentences = [
        f"Axis {_name(curve)}: {text_of(curve.stiffness)} from {_range_text(curve)}, with a "
        f"hysteresis of ±{text_of(curve.hysteresis)}."
        for curve in curves
    ]
    table = "The force table is the mean of loading and unloading, without the instrument's offset."
    return " ".join([*sentences, table])


def _range_text(curve: xr.Dataset) -> str:
    motion = quantity_of(curve.position)
    return f"{motion.number(curve.position[0])} to {motion.text(curve.position[-1])}"


def _figure(curves: Sequence[xr.Dataset], loops: Mapping[str, Sequence[MeasuredLoop]]) -> Figure:
    """Return samples, branches and table of each axis, translations above rotations."""
    kinds = [[c for c in curves if is_about(c.axis) == about] for about in (False, True)]
    columns = max(2, *map(len, kinds))
    panels: list[Panel | None] = []
    for of_kind in filter(None, kinds):
        panels += [_panel(curve, loops[curve.axis]) for curve in of_kind]
        panels += [None] * (columns - len(of_kind))
    return Figure(panels=in_grid(panels, columns), height=220.0, widths=(1.0,) * columns)


def _panel(curve: xr.Dataset, loops: Sequence[MeasuredLoop]) -> Panel:
    """Return samples, branches and table of an axis."""
    motion, offset = quantity_of(curve.position), curve.offset.item()
    load = loop_quantities(is_about(curve.axis))["load"]
    faint = Line((), (), color=QUIET, opacity=0.6, key="samples")
    marks: list[Mark] = [
        replace(faint, x=motion.values(loop.displacement), y=load.values(loop.force - offset))
        for loop in loops
    ]
    branch = {"color": MEASURED, "width": 1.8, "key": "loading and unloading"}
    mean = {"color": OURS, "width": 2.4, "key": "mean (table)"}
    marks += marks_of(curve, "position", {"loading": branch, "unloading": branch, "mean": mean})
    return loop_panel(_name(curve), marks, motion.label, load.label)


def _curves(prefix: str, curves: Sequence[xr.Dataset]) -> LabelledTable:
    """Return the curves of some axes."""
    columns = ["position", "loading", "unloading", "mean", "half_width"]
    parts = [
        curve[columns].assign_coords(axis=("place", [curve.axis] * curve.sizes["place"]))
        for curve in curves
    ]
    motion = quantity_of(curves[0].position).words
    data = xr.concat(parts, "place").rename(position=motion)
    return LabelledTable(f"{prefix}static", data, is_in_json=False)


def _measures(prefix: str, curves: Sequence[xr.Dataset]) -> LabelledTable:
    """Return the measures of some axes."""
    names = [name for name, v in curves[0].data_vars.items() if not v.dims]
    data = xr.concat([curve[names] for curve in curves], "axis")
    motion = quantity_of(curves[0].position)
    for name, index in (("to", -1), ("from", 0)):
        ends = motion.named(name).variable("axis", [c.position[index].item() for c in curves])
        data = xr.Dataset({name: ends}).merge(data)
    data = hidden(data, "largest_fall")
    stiffness = quantity_of(data.stiffness).named("nominal stiffness")
    data["stiffness"] = stiffness.on(data.stiffness)
    return LabelledTable(
        f"{prefix}measures",
        data.assign_coords(axis=[curve.axis for curve in curves]),
        f"Measures {'about' if prefix else 'along'} an axis",
        "Nominal stiffness: line through zero, fitted to the first "
        f"{SHARE.text(NOMINAL)} of the mean curve, as in [B] section 4. Half width of hysteresis: "
        "half the difference of loading and unloading, median over the range; a friction that does "
        "not depend on the rate has this force. At the median rate a damping adds to it.",
        words={curve.axis: _name(curve) for curve in curves},
        is_in_terminal=True,
    )


def _place(curve: xr.Dataset) -> int:
    """Return the place of a curve among the others; a sponge has no others."""
    return AXES.index(curve.axis) if curve.axis in AXES else 0


def _name(curve: xr.Dataset) -> str:
    return str(curve.axis).replace("_", " ")
