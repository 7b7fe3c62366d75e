"""Figures of a component identification: measured and fitted loops, progress of the search."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from wm_drake.parameters.types import FloatArray
from wm_drake.report.figure import MEASURED, OURS, Figure, Line, Mark, Panel, Points, in_grid
from wm_drake.rigs.measured import HarmonicMotion, MeasuredMotion
from wm_drake.studies.fitting.fit import Fit
from wm_drake.studies.identify.comparison import TestedLoop
from wm_drake.studies.rig.figures import loop_panel
from wm_drake.studies.rig.quantities import loop_quantities
from wm_drake.studies.rig.study import FREQUENCY

COLUMNS = 4
"""Largest number of panels in a row."""


def motion_text(measured: MeasuredMotion) -> str:
    """Return frequency and amplitude of a measured loop with their units; of another motion, range.

    The range goes from the least to the greatest displacement.
    """
    motion = loop_quantities(measured.loop.rotates)["displacement"]
    if not isinstance(measured, HarmonicMotion):
        ends = [float(side(measured.position)) for side in (np.min, np.max)]
        negligible = 1e-9 * (ends[1] - ends[0])  # rounding of an end at zero
        low, high = (0.0 if abs(end) < negligible else end for end in ends)
        return f"as recorded, {motion.number(low)} to {motion.text(high)}"
    return f"{FREQUENCY.text(measured.motion.frequency)}, {motion.text(measured.motion.amplitude)}"


def loops_figure(fit: Fit, motions: Sequence[MeasuredMotion], *, over: str) -> Figure:
    """Draw measured samples and the fitted loop without offset and drift, one panel per file.

    Args:
        over: Abscissa: displacement or velocity.
    """
    panels = []
    for index, measured in enumerate(motions):
        offset = measured.baseline @ fit.baselines[index]
        computed = fit.computed[fit.problem.slices[index]] - offset
        panels.append(_panel(measured, offset, {"fitted": (OURS, computed)}, over))
    return _figure(panels)


def _figure(panels: list[Panel]) -> Figure:
    columns = min(COLUMNS, max(2, len(panels)))
    lowest = max(0, len(panels) - columns)
    shown = [
        replace(
            panel,
            x=panel.x if index >= lowest else replace(panel.x, label=""),
            y=replace(panel.y, label="") if index % columns else panel.y,
        )
        for index, panel in enumerate(panels)
    ]
    return Figure(panels=in_grid(shown, columns), height=170.0, widths=(1.0,) * columns)


def _panel(
    measured: MeasuredMotion,
    offset: FloatArray,
    lines: Mapping[str, tuple[str, FloatArray]],
    over: str,
) -> Panel:
    """Return the samples of a test and computed lines.

    Args:
        offset: Offset and drift that are taken from its force.
        lines: By entry of the legend: colour and force (n,).
        over: Abscissa: displacement or velocity.
    """
    quantities = loop_quantities(measured.loop.rotates)
    motion, load = quantities[over], quantities["load"]
    x = motion.values(measured.position if over == "displacement" else measured.rate)
    order = drawing_order(measured)
    force = load.values(measured.loop.force - offset)
    samples = Points(x, force, color=MEASURED, size=3.0, opacity=0.4, key="measured")
    marks: list[Mark] = [samples]
    for key, (color, computed) in lines.items():
        y = load.values(computed)[order]
        marks.append(Line(x[order], y, color=color, width=2.0, key=key))
    return loop_panel(motion_text(measured), marks, motion.label, load.label)


MOST_PANELS = 12
"""Largest number of tests in a figure of several laws."""

LAW_COLOURS = ("#0072b2", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#d55e00")
"""Colours of laws, of Okabe and Ito."""


def evenly_chosen(tests: Sequence[TestedLoop]) -> list[TestedLoop]:
    """Return at most `MOST_PANELS` of the tests, evenly chosen."""
    places = np.linspace(0, len(tests) - 1, min(MOST_PANELS, len(tests)))
    return [tests[round(place)] for place in places]


def rival_loops_figure(tests: Sequence[TestedLoop], *, best: str, over: str) -> Figure:
    """Draw measured samples and the loop of each law, one panel per test.

    The offset and drift that the best law finds are taken from the samples and from all laws, so
    that each law lies beside the samples as its error says.

    Args:
        tests: Tests that are drawn, with the fit or the evaluation of each law.
        over: Abscissa: displacement or velocity.
    """
    panels = []
    for tested in tests:
        offset = tested.measured.baseline @ tested.fits[best].baselines[tested.index]
        lines = {
            law: (LAW_COLOURS[k % len(LAW_COLOURS)], force - offset)
            for k, (law, force) in enumerate(tested.forces().items())
        }
        panels.append(_panel(tested.measured, offset, lines, over))
    return _figure(panels)


def drawing_order(measured: MeasuredMotion) -> np.ndarray:
    """Return the order of samples along a line: by phase and closed for a sine, else by time."""
    if not isinstance(measured, HarmonicMotion):
        return np.arange(len(measured.position))
    order = np.argsort(measured.phase)
    return np.append(order, order[0])
