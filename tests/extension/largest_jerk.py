"""A measure of a user: the largest jerk at each sensor, third derivative of the displacement."""

import numpy as np

from wm_drake.parameters.units import Unit
from wm_drake.simulation.measures import Measure, Run, Variable, each_run


def largest_jerk(run: Run) -> list[np.ndarray]:
    """Return the largest absolute jerk at each sensor, by differences. (sensors,) [m/s^3]"""
    jerk = np.diff(run.filtered, 3, axis=0) / run.period**3
    return [np.abs(jerk).max(axis=0) if len(jerk) else np.full(jerk.shape[1], np.nan)]


LARGEST_JERK = Measure(
    "largest_jerk",
    (
        Variable(
            "largest_jerk",
            ("sensor",),
            Unit("m/s^3", "m/s^3"),
            "largest jerk",
            "largest jerk of the filtered displacement at each sensor",
        ),
    ),
    each_run(largest_jerk),
    needs=("sensors",),
)
