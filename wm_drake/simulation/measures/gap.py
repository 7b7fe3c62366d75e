"""Smallest gap between tub group and housing, and the shapes that touch."""

from collections.abc import Sequence

import numpy as np

from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.simulation.measures.kind import Measure, Variable, detail, each_run
from wm_drake.simulation.measures.run import Run

MM = Unit("m", "mm")


def _gap(run: Run) -> Sequence[FloatArray]:
    gap = run.gap
    return [np.array(np.nan if gap is None else gap.distance)]


def _contacts(run: Run) -> Sequence[FloatArray]:
    gap, pairs = run.gap, run.scene.pair_names()
    touching: FloatArray = np.full(len(pairs), np.nan)
    if gap is None:
        return np.array(np.nan), np.array(np.nan), touching
    if gap.distance <= 0.0:
        touching = run.scene.contacts(run.time, run.poses, run.rest_pose, run.path)
    nearest = np.array(float(pairs.index(f"{gap.moving}|{gap.fixed}")))
    speed = np.array(np.interp(gap.time, run.time, run.drum_speed))
    return nearest, speed, touching


GAP = Measure(
    "gap",
    (
        Variable(
            "smallest_gap",
            (),
            MM,
            "smallest gap",
            "smallest distance between tub group and housing; the tub touches at 0 and below",
            better="larger",
            group="gap",
            studio=1,
        ),
    ),
    each_run(_gap),
    ("shapes",),
    has_table=False,
)

CONTACTS = Measure(
    "contacts",
    (
        detail(
            "nearest_pair",
            (),
            Unit("", ""),
            "nearest pair",
            "number, along pair, of the two shapes with the smallest gap",
            better="",
        ),
        detail(
            "gap_speed",
            (),
            Unit("rad/s", "rpm"),
            "speed at the smallest gap",
            "speed of the drum at the time of the smallest gap",
            better="",
        ),
        detail(
            "contact_gap",
            ("pair",),
            MM,
            "gap of a pair",
            "smallest distance of each pair of shapes that touches; NaN for the others",
            better="larger",
        ),
    ),
    each_run(_contacts),
    ("shapes",),
)
