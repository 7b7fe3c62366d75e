"""Measures of the study: orders of the signals in windows of a hold, gaps by drum speed of a spin.

Windows and ranges of speed are the regions of the profiles of their cases.
"""

from collections.abc import Sequence

import numpy as np

from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.simulation.measures import Measure, Run, Variable, each_run
from wm_drake.simulation.measures.kind import detail
from wm_drake.simulation.vibration import region_samples, specific_forces

ORDERS = (1, 2)
"""Orders of the drum that are measured."""

SIGNALS = {
    "torque": ((), "N*m", "torque of the motor on the drum"),
    "speed": ((), "rad/s", "drum speed"),
    "displacement": (("sensor",), "m", "displacement"),
    "acceleration": (("accelerometer", "axis"), "m/s^2", "acceleration with gravity"),
}
"""Dimensions, unit and words of the signals of a run."""


def amplitudes_of_orders(angle: FloatArray, signals: FloatArray) -> FloatArray:
    """Return cosine and sine parts of the orders of signals in a window, by least squares.

        x = a + b t + sum_k (A_k cos k phi + B_k sin k phi)

    Args:
        angle: Drum angle at evenly spaced times. (n,) [rad]
        signals: (n, k)

    Returns:
        (orders, k, 2), A and B; NaN with too few samples.
    """
    parts = [f(order * angle) for order in ORDERS for f in (np.cos, np.sin)]
    time = np.linspace(-1.0, 1.0, len(angle))
    columns = np.column_stack([np.ones_like(time), time, *parts])
    if len(angle) < 2 * columns.shape[1]:
        return np.full((len(ORDERS), signals.shape[1], 2), np.nan)
    solved = np.linalg.solve(columns.T @ columns, columns.T @ signals)
    return np.asarray(np.swapaxes(solved[2:].reshape(len(ORDERS), 2, -1), 1, 2))


def _in_windows(run: Run, signals: FloatArray) -> FloatArray:
    """Return the orders of signals (n, k) in each region. (regions, orders, k, 2)"""
    size, count = len(run.profile.regions), len(run.time)
    values = np.full((size, len(ORDERS), signals.shape[1], 2), np.nan)
    for place, part in enumerate(region_samples(run.profile, run.period, count)):
        if part.stop > part.start:
            values[place] = amplitudes_of_orders(run.drum_angle[part], signals[part])
    return values


def _orders(run: Run) -> Sequence[FloatArray]:
    of_drive = np.column_stack([run.motor_torque, run.drum_speed])
    values = _in_windows(run, np.hstack([of_drive, run.displacement]))
    parts = region_samples(run.profile, run.period, len(run.time))
    mean = [run.drum_speed[p].mean() if p.stop > p.start else np.nan for p in parts]
    each = (values[:, :, 0], values[:, :, 1], values[:, :, 2:])
    return [np.array(mean), *(part[:, k] for part in each for k in range(len(ORDERS)))]


def _accelerations(run: Run) -> Sequence[FloatArray]:
    motion, points = np.ascontiguousarray(run.tub_motion), run.accelerometer_points
    signals = specific_forces(motion, run.tub_acceleration, points, run.rest_pose, run.gravity)
    values = _in_windows(run, signals.reshape(len(signals), -1))
    shape = (len(values), len(ORDERS), len(points), 3, 2)
    return [values.reshape(shape)[:, k] for k in range(len(ORDERS))]


def _gaps(run: Run) -> Sequence[FloatArray]:
    parts = region_samples(run.profile, run.period, len(run.time))
    gaps = [run.scene.smallest_gap(run.time[p], run.poses[p], run.rest_pose) for p in parts]
    return [np.array([np.nan if gap is None else gap.distance for gap in gaps])]


def _variables(names: Sequence[str]) -> list[Variable]:
    return [
        detail(
            f"window_{name}_{order}",
            ("region", *SIGNALS[name][0], "order"),
            Unit(SIGNALS[name][1], SIGNALS[name][1]),
            f"{SIGNALS[name][2]} of order {order}",
            f"{SIGNALS[name][2]} of order {order} in each region, with cosine and sine of the "
            "drum angle",
        )
        for name in names
        for order in ORDERS
    ]


RPM = Unit("rad/s", "rpm")
_MEAN = detail(
    "window_speed", ("region",), RPM, "mean speed", "mean speed of the drum in each region"
)
SIGNALS_OF_HOLD = Measure(
    "orders in regions",
    (_MEAN, *_variables(("torque", "speed", "displacement"))),
    each_run(_orders),
    ("sensors",),
    has_table=False,
)
ACCELERATIONS_OF_HOLD = Measure(
    "orders of accelerations in regions",
    tuple(_variables(("acceleration",))),
    each_run(_accelerations),
    ("tub",),
    has_table=False,
)
GAPS = Measure(
    "gaps in regions",
    (
        detail(
            "region_gap",
            ("region",),
            Unit("m", "mm"),
            "smallest gap",
            "smallest gap in each region of the profile",
            better="larger",
        ),
    ),
    each_run(_gaps),
    ("shapes",),
    has_table=False,
)
