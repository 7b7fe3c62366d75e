"""Draw the cross-section of a friction damper with a sponge from the numbers of its law.

Along the damper, lengths are to scale: the free stroke, and the way from there until the sponge
slides on the inner tube. Across it, and for the length of the sponge, the papers print no number.
"""

from typing import TypeAlias

import numpy as np

from wm_drake.elements.damper_law import law_numbers, law_of
from wm_drake.laws.table import stiffness_force
from wm_drake.parameters.types import FloatArray
from wm_drake.report import figure as fig
from wm_drake.report.quantity import Quantity
from wm_drake.rigs import Bench, DamperBench
from wm_drake.studies.answer import Plot
from wm_drake.studies.rig.quantities import LINEAR

LONGEST = 0.1
"""Deformation of a sponge up to which its curve is searched. [m]"""

NO_FORCE = 1e-3
"""Part of the friction below which the force of a sponge counts as none."""

SPONGE_COLOUR, METAL_COLOUR = "#e8c46a", "#c3c9d4"


def sponge_ways(packed: FloatArray) -> tuple[float, float] | None:
    """Return the free stroke to one side, and the way at which the sponge slides. [m]

    Args:
        packed: Law number and parameters of a damper.

    Returns:
        None for a law without a sponge, or one that does not slide within `LONGEST`.
    """
    law, numbers = law_of(packed), law_numbers(packed)
    if not law.has_sponge:
        return None
    ways = np.linspace(0.0, LONGEST, 20_001)
    if "sponge" in law.curves:
        force = np.array([stiffness_force(way, *numbers.sponge) for way in ways])
    else:
        force = numbers.sponge_stiffness * ways
    slides = np.flatnonzero(force >= numbers.friction_force)
    if not len(slides) or not slides[0]:
        return None
    free = np.flatnonzero(force <= NO_FORCE * numbers.friction_force)[-1]
    has_free_stroke = "sponge" in law.curves
    return float(ways[free]) if has_free_stroke else 0.0, float(ways[slides[0]])


def section_plots(bench: Bench) -> list[Plot]:
    """Return the cross-section of a damper; none for a law without a sponge, and for a bushing."""
    ways = sponge_ways(bench.packed) if isinstance(bench, DamperBench) else None
    if ways is None:
        return []
    way, numbers = LINEAR["displacement"], law_numbers(bench.packed)
    friction = LINEAR["load"].text(numbers.friction_force)
    free, slides = (way.text(value) for value in ways)
    stroke = f"free stroke ± {free}; " if ways[0] else ""
    plot = Plot(
        section_figure(*ways, words=f"{stroke}slides at ± {slides}, {friction}", way=way),
        f"Cross-section of the damper: {stroke}the sponge slides at {slides}.",
        "Cross-section of the damper in its middle position, drawn from its numbers (form of [A] "
        f"Fig. 3 and [C] Fig. 2): {stroke}beyond it the outer tube deforms the sponge, which "
        f"slides on the inner tube at {slides}, where its force is the friction of {friction}. "
        "Lengths along the damper are to scale but for the length of the sponge; those across it "
        "are not published.",
    )
    return [plot]


def section_figure(free: float, slides: float, words: str, way: Quantity) -> fig.Figure:
    """Draw outer tube with its two stops, sponge, and inner tube. [m, m]"""
    gap, end = way.values([free, slides]).tolist()
    half, wall = 1.5 * end, 0.12 * end
    stop = half + gap
    long = 1.5 * stop
    tubes = [
        *_mirrored((-long, long, 1.0, 1.15), METAL_COLOUR, "outer tube with stops"),
        *_mirrored((-stop - wall, -stop, 0.55, 1.0), METAL_COLOUR),
        *_mirrored((stop, stop + wall, 0.55, 1.0), METAL_COLOUR),
        _box((-long - wall, -long, -1.15, 1.15), METAL_COLOUR),
    ]
    inner = [
        *_mirrored((-0.8 * long, 1.5 * long, 0.25, 0.35), fig.QUIET, "inner tube"),
        _box((1.5 * long, 1.5 * long + wall, -0.35, 0.35), fig.QUIET),
    ]
    sponge = _mirrored((-half, half, 0.37, 0.92), SPONGE_COLOUR, "sponge")
    marks = (
        *tubes,
        *inner,
        *sponge,
        fig.Rule(0.0, "x", color=fig.QUIET, width=0.8, dash="long"),
        fig.Text(0.0, 1.4, words, up="bottom"),
    )
    panel = fig.Panel(
        marks=marks,
        x=fig.Axis(label=way.named("place along the damper").label),
        y=fig.Axis(has_numbers=False, has_grid=False, has_line=False, range=(-1.4, 1.9)),
    )
    return fig.Figure(panels=(panel,), height=260.0)


Corners: TypeAlias = tuple[float, float, float, float]
"""Left, right, lower and upper end of a box."""


def _box(corners: Corners, color: str, key: str = "") -> fig.Area:
    left, right, low, top = corners
    x, y = [left, right, right, left, left], [low, low, top, top, low]
    return fig.Area(x, y, color=color, edge=fig.MARK, width=0.8, key=key)


def _mirrored(corners: Corners, color: str, key: str = "") -> list[fig.Mark]:
    """Return a box above the axis of the damper and the same one below it."""
    left, right, low, top = corners
    return [_box(corners, color, key), _box((left, right, -top, -low), color)]
