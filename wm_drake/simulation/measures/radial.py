"""Largest radial displacement of points of the tub in each region: the radius of their orbits."""

from collections.abc import Sequence

import numpy as np

from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.simulation.measures.kind import Measure, detail, each_run
from wm_drake.simulation.measures.regions import DIMS
from wm_drake.simulation.measures.run import Run
from wm_drake.simulation.outputs import point_displacements
from wm_drake.simulation.vibration import region_samples


def _radial(run: Run) -> Sequence[FloatArray]:
    points = run.accelerometer_points
    moved = point_displacements(np.ascontiguousarray(run.tub_motion), points, run.rest_pose)
    radius = np.hypot(moved[..., 0], moved[..., 2])
    radii = np.full((len(run.profile.regions), len(points)), np.nan)
    for row, part in enumerate(region_samples(run.profile, run.period, len(run.time))):
        if part.start < part.stop:
            radii[row] = radius[part].max(axis=0)
    return [radii]


RADIAL = Measure(
    "radial displacements",
    (
        detail(
            "region_radius",
            DIMS[:2],
            Unit("m", "mm"),
            "radial displacement",
            "largest distance across the drum axis from the point's place at rest, without a "
            "filter, in each region of the spin profile",
        ),
    ),
    each_run(_radial),
    ("tub",),
)
