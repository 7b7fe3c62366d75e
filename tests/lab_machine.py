"""What a recorder would write of a run, by another route than the package.

Positions of a point come from the pose of the tub by scipy's rotations; velocity and acceleration
are derivatives of splines through them. Gravity is turned into the axes of the tub.
"""

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.spatial.transform import Rotation

GRAVITY = np.array([0.0, 0.0, -9.81])
UNITS = {"displacement": ("mm", 1e3), "velocity": ("mm/s", 1e3), "acceleration": ("g", 1 / 9.80665)}


def spline_signal(record, quantity, point, axis, axes="tub", gravity=True):
    """Return a signal at the samples of a record, in SI.

    Args:
        quantity: displacement, velocity or acceleration.
        point: Position in T. [m]
        axis: Unit vector, in W at rest.
        axes: Whether the axis turns with the tub, or is that of the world.
        gravity: Whether the acceleration of free fall is taken away.
    """
    turn = Rotation.from_euler("xyz", record.tub_angle.values)
    rest = Rotation.from_euler("xyz", record.attrs["rest_pose"][:3])
    time = record.time.values
    moved = record.tub_position.values + turn.apply(point)
    moved -= record.attrs["rest_pose"][3:] + rest.apply(point)
    order = {"displacement": 0, "velocity": 1, "acceleration": 2}[quantity]
    vectors = make_interp_spline(time, moved, k=7).derivative(order)(time) if order else moved
    if quantity == "acceleration" and gravity:
        vectors = vectors - GRAVITY
    if axes == "tub":
        vectors = (rest * turn.inv()).apply(vectors)
    return vectors @ np.asarray(axis)


def recorded_channels(record, points, *, rate=500.0, begin=0.0, end=None, ppm=0.0):
    """Return times and channels in units of instruments, of accelerometers that turn with the tub.

    Args:
        points: Position in T [m] by name of the sensor, whose last letter is its axis.
        rate: Sampling rate. [Hz]
        begin, end: Times of the run between which the recorder runs. [s]
        ppm: By how much its clock is slow.
    """
    run = record.time.values
    unit, factor = UNITS["acceleration"]
    count = int(((end or run[-1]) - begin) * rate / (1.0 + 1e-6 * ppm))
    stamps = np.arange(count) / rate
    at = begin + (1.0 + 1e-6 * ppm) * stamps
    channels = {}
    for name, point in points.items():
        signal = spline_signal(record, "acceleration", point, np.eye(3)["xyz".index(name[-1])])
        values = make_interp_spline(run, signal, k=5)(at.clip(0.0, run[-1]))
        channels[name] = (factor * values, unit)
    return stamps, channels, at
