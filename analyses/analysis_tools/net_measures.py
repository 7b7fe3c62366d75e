"""Measures of a run at many places of the tub, for a search that places sensors after the runs.

For small rotations the displacement of a point p of the tub is d + r x p, with displacement d of
To and rotation r. So one motion gives the amplitudes at all places where a sensor may be.
"""

import numpy as np

from wm_drake.parameters.types import FloatArray
from wm_drake.parameters.units import Unit
from wm_drake.simulation.band import pass_band
from wm_drake.simulation.displacements import filtered
from wm_drake.simulation.measures import Measure, each_run, register_measure
from wm_drake.simulation.measures.kind import detail
from wm_drake.simulation.measures.labels import LABELS
from wm_drake.simulation.measures.run import Run

EVERY = 2
"""Only every second sample is used; at 5 Hz and 5 ms that is 20 samples a period."""

SENSORS = ("Xr", "Yr", "Zr", "Xf", "Yf", "Zf")
REAR_Y, FRONT_Y = np.array([0.10, 0.15, 0.20]), np.array([-0.23, -0.15, -0.07])
"""Depths at which sensors along x and z may be. [m]"""

ACROSS = np.linspace(-0.25, 0.25, 9)
"""Heights of sensors along x, and places across of those along z. [m]"""

REAR_PLANE, FRONT_PLANE = np.linspace(-0.185, 0.185, 7), np.linspace(-0.245, 0.245, 7)
"""Places across and heights of the sensors along y. [m]"""

CORNERS = np.stack(
    np.meshgrid(
        [-0.29, -0.22, -0.15, 0.15, 0.22, 0.29],
        [-0.27, -0.18, -0.09],
        [0.05, 0.13, 0.21, 0.29],
        indexing="ij",
    ),
    axis=-1,
).reshape(-1, 3)
"""Points of the tub that may be nearest to the detergent box. (corner, 3) [m]"""


def places_of(sensor: str) -> tuple[FloatArray, FloatArray]:
    """Return the values of the two coordinates on which a sensor depends, first and second. [m]

    They are y and z of a sensor along x, y and x of one along z, x and z of one along y.
    """
    rear = sensor.endswith("r")
    if sensor.startswith("Y"):
        plane = REAR_PLANE if rear else FRONT_PLANE
        return plane, plane
    return (REAR_Y if rear else FRONT_Y), ACROSS


def arms_of(sensor: str) -> FloatArray:
    """Return the weights of tx, ty, tz, rx, ry, rz in the displacement of a sensor. (6, place)"""
    first, second = (grid.ravel() for grid in np.meshgrid(*places_of(sensor), indexing="ij"))
    arms = np.zeros((6, len(first)))
    match sensor[0]:
        case "X":
            arms[0], arms[4], arms[5] = 1.0, second, -first
        case "Y":
            arms[1], arms[5], arms[3] = 1.0, first, -second
        case _:
            arms[2], arms[3], arms[4] = 1.0, first, -second
    return arms


ARMS = {sensor: arms_of(sensor) for sensor in SENSORS}
SLICES = dict(
    zip(
        SENSORS,
        [
            slice(end - arms.shape[1], end)
            for end, arms in zip(
                np.cumsum([a.shape[1] for a in ARMS.values()]), ARMS.values(), strict=True
            )
        ],
        strict=True,
    )
)
"""Where the places of each sensor are in the variable `place_amplitude`."""


def _motion(run: Run) -> FloatArray:
    """Return tx, ty, tz, rx, ry, rz from the state of rest. (n, 6) [m, rad]"""
    motion = run.tub_motion[:, :6] - run.tub_motion[0, :6]
    return np.hstack([motion[:, 3:], motion[:, :3]])


def _place_amplitudes(run: Run) -> list[FloatArray]:
    signals = filtered(_motion(run), run.period, pass_band(run.profile, run.period))[::EVERY]
    return [np.concatenate([np.abs(signals @ arms).max(axis=0) for arms in ARMS.values()])]


def _corner_displacements(run: Run) -> list[FloatArray]:
    motion = _motion(run)[::EVERY]
    sizes = np.empty((len(CORNERS), 3))
    x, y, z = CORNERS.T
    for axis, (lever, back) in enumerate((((4, z), (5, -y)), ((5, x), (3, -z)), ((3, y), (4, -x)))):
        moved = motion[:, [axis]] + np.outer(motion[:, lever[0]], lever[1])
        sizes[:, axis] = np.abs(moved + np.outer(motion[:, back[0]], back[1])).max(axis=0)
    return [sizes]


LABELS["place"] = lambda machine, profile: [f"{k}" for k in range(SLICES["Zf"].stop)]
LABELS["corner"] = lambda machine, profile: [f"{k}" for k in range(len(CORNERS))]

PLACES = register_measure(
    Measure(
        "amplitudes at places",
        (
            detail(
                "place_amplitude",
                ("place",),
                Unit("m", "mm"),
                "amplitude",
                "largest filtered displacement at each place where a sensor may be",
            ),
        ),
        each_run(_place_amplitudes),
        ("tub",),
        has_table=False,
    )
)

AT_CORNERS = register_measure(
    Measure(
        "displacements at corners",
        (
            detail(
                "corner_displacement",
                ("corner", "axis"),
                Unit("m", "mm"),
                "displacement",
                "largest displacement of each point that may be nearest to the detergent box",
            ),
        ),
        each_run(_corner_displacements),
        ("tub",),
        has_table=False,
    )
)
