"""Figures of force loops over displacement, velocity and time, single or overlaid."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from wm_drake.parameters.types import FloatArray
from wm_drake.report import figure as fig
from wm_drake.report.quantity import TIME
from wm_drake.rigs import ForceLoop, RigRun
from wm_drake.rigs.run import slider_friction_curves
from wm_drake.studies.rig.quantities import LINEAR, loop_quantities
from wm_drake.studies.rig.study import FREQUENCY

COLUMNS = 4
"""Largest number of panels in a row."""


def frequency_text(loop: ForceLoop) -> str:
    """Return the frequency of a loop with its unit."""
    return FREQUENCY.text(loop.motion.frequency)


def amplitude_text(loop: ForceLoop) -> str:
    """Return the amplitude of a loop with its unit."""
    return loop_quantities(loop.rotates)["displacement"].text(loop.motion.amplitude)


def overlaid_figure(
    loops: Sequence[ForceLoop],
    panel: Callable[[ForceLoop], str],
    line: Callable[[ForceLoop], str],
    *,
    over: str,
) -> fig.Figure:
    """Draw loops in panels, several per panel, as [C] Figs. 6, 7, 14 and [A] Figs. 5, 8, 12 (B).

    Args:
        panel: Function that returns the title of the panel in which a loop is drawn.
        line: Function that returns the legend text of a loop. It also selects the colour.
        over: Abscissa: displacement or velocity.
    """
    rising = sorted(loops, key=lambda loop: (loop.motion.frequency, loop.motion.amplitude))
    by_amplitude = sorted(loops, key=lambda loop: (loop.motion.amplitude, loop.motion.frequency))
    order = {
        text: index
        for index, text in enumerate(
            [*map(frequency_text, rising), *map(amplitude_text, by_amplitude)]
        )
    }
    panels, lines = (
        sorted({text(loop) for loop in loops}, key=order.__getitem__) for text in (panel, line)
    )
    columns = min(COLUMNS, max(2, len(panels)))
    quantities, shown = loop_quantities(loops[0].rotates), []
    x, y = quantities[over], quantities["load"]
    for title in panels:
        marks: list[fig.Mark] = []
        for loop in (loop for loop in loops if panel(loop) == title):
            values = x.values(getattr(loop, over))
            key = line(loop)
            color = _color(lines.index(key), len(lines))
            marks.append(fig.Line(_closed(values), _closed(loop.force), color=color, key=key))
        shown.append(loop_panel(title, marks, x.label, y.label))
    placed = fig.in_grid(shown, columns, share="y")
    return fig.Figure(panels=placed, height=190.0, widths=(1.0,) * columns, keys=tuple(lines))


def time_figure(loop: ForceLoop, points: Mapping[str, int]) -> fig.Figure:
    """Draw motion and force over one period and the loop, as [A] Figs. 5, 8, 12, [C] Figs. 4, 5.

    Args:
        points: Samples that get a letter on the force, from `stroke_points`.
    """
    quantities = loop_quantities(loop.rotates)
    force = quantities["load"].label
    time = np.append(loop.time, 1.0 / loop.motion.frequency)
    at = list(points.values())
    displacement = quantities["displacement"].values(_closed(loop.displacement))
    motion = fig.Line(time, displacement, color=fig.QUIET, dash="dashed")
    of_time = fig.Line(time, _closed(loop.force), width=2.2, is_second=True)
    reach, largest = (1.13 * float(np.abs(one.y).max()) or 1.0 for one in (motion, of_time))
    panels = [
        fig.Panel(
            marks=(
                fig.Rule(0.0, color=fig.QUIET),
                motion,
                of_time,
                *_letters(points, loop.time[at], loop.force[at], is_second=True),
            ),
            x=fig.Axis(label=TIME.label),
            y=fig.Axis(
                label=f"{quantities['displacement'].label} (dashed)",
                color=fig.QUIET,
                range=(-reach, reach),
            ),
            second=fig.Axis(label=force, color=fig.OURS, range=(-largest, largest)),
        )
    ]
    for over in ("displacement", "velocity"):
        quantity = quantities[over]
        x = quantity.values(getattr(loop, over))
        curve = fig.Line(_closed(x), _closed(loop.force), width=2.2)
        letters = _letters(points, x[at], loop.force[at])
        panels.append(loop_panel("", [curve, *letters], quantity.label, force))
    return fig.Figure(panels=fig.in_grid(panels, 3), height=220.0)


def _letters(
    points: Mapping[str, int], x: FloatArray, y: FloatArray, *, is_second: bool = False
) -> list[fig.Mark]:
    """Return a dot and a letter at each point."""
    if not points:
        return []
    marks: list[fig.Mark] = [fig.Points(x, y, color=fig.MARK, size=6.0, is_second=is_second)]
    for letter, a, b in zip(points, x.tolist(), y.tolist(), strict=True):
        above = fig.Text(a, b, letter, is_bold=True, across="right", up="bottom", shift=(-5.0, 3.0))
        below = replace(above, across="left", up="top", shift=(5.0, -3.0))
        if not is_second:  # D lies close to C
            marks.append(below if letter == "D" else above)
    return marks


def friction_law_figure(run: RigRun) -> fig.Figure | None:
    """Draw friction over slider velocity at constant deformation rates, as [C] Fig. 12.

    The result is None for a law without MSTV friction.
    """
    rates = (0.001, 0.005, 0.02, 0.06)
    w = np.concatenate([-np.geomspace(0.08, 1e-5, 200), np.geomspace(1e-5, 0.08, 200)])
    curves = slider_friction_curves(run.bench, rates, w)
    if curves is None:
        return None
    marks = [
        fig.Line(
            LINEAR["velocity"].values(w),
            curve,
            color=_color(k, len(rates)),
            width=2.0,
            key=f"deformation rate of the sponge {LINEAR['velocity'].text(rate)}",
        )
        for k, (rate, curve) in enumerate(zip(rates, curves, strict=True))
    ]
    x = LINEAR["velocity"].named("sliding velocity of the sponge on the tube").label
    y = LINEAR["load"].named("friction force on the sponge").label
    return fig.Figure(panels=(loop_panel("", marks, x, y),), height=240.0)


def loop_panel(title: str, marks: Sequence[fig.Mark], x: str, y: str) -> fig.Panel:
    """Return a panel with a zero line. `x`, `y`: labels."""
    shown = (fig.Rule(0.0, color=fig.QUIET, width=0.8), *marks)
    return fig.Panel(title=title, marks=shown, x=fig.Axis(label=x), y=fig.Axis(label=y))


def _closed(values: Any) -> FloatArray:
    return np.append(values, values[0])


def _color(index: int, count: int) -> str:
    """Return a colour of the scale from blue to yellow; for one or two lines a fixed colour."""
    return (fig.OURS, fig.MEASURED)[index] if count <= 2 else fig.shade(0.88 * index / (count - 1))
