"""RMS displacements of the accelerometers in the regions of the spin profile."""

from collections.abc import Sequence

import numpy as np

from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.simulation.measures.kind import Measure, Variable, each_run
from wm_drake.simulation.measures.run import Run
from wm_drake.simulation.vibration import (
    displacement_of,
    region_displacements,
    region_rms,
    specific_forces,
)

DIMS = ("region", "accelerometer", "axis")


def _regions(run: Run) -> Sequence[FloatArray]:
    motion = np.ascontiguousarray(run.tub_motion)
    at_points = run.accelerometer_points, run.rest_pose, run.period, run.profile
    return region_displacements(motion, run.tub_acceleration, *at_points)


REGIONS = Measure(
    "regions",
    (
        Variable(
            "region_displacement",
            DIMS,
            Unit("m", "mm"),
            "RMS displacement",
            "RMS displacement in each region of the spin profile",
            is_in_spin=False,
            studio=None,
        ),
        Variable(
            "region_displacement_integrated",
            DIMS,
            Unit("m", "mm"),
            "RMS displacement from acceleration",
            "RMS displacement in each region, from the acceleration integrated twice",
            is_in_spin=False,
            studio=None,
        ),
    ),
    each_run(_regions),
    ("tub",),
)


def _recorded(run: Run) -> Sequence[FloatArray]:
    motion, points = np.ascontiguousarray(run.tub_motion), run.accelerometer_points
    about = run.rest_pose, run.gravity
    signals = specific_forces(motion, run.tub_acceleration, points, *about)
    moved = [displacement_of(signals[:, k], run.period) for k in range(len(points))]
    return (np.stack([region_rms(one, run.period, run.profile) for one in moved], axis=1),)


RECORDED = Measure(
    "recorded regions",
    (
        Variable(
            "region_displacement_recorded",
            DIMS,
            Unit("m", "mm"),
            "RMS displacement as recorded",
            "RMS displacement in each region that accelerometers with gravity, which turn with the "
            "tub, tell by integration",
            is_in_spin=False,
            studio=None,
        ),
    ),
    each_run(_recorded),
    ("tub",),
)
