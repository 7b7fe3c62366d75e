"""Check that recordings are like what their sensors should record."""

from collections.abc import Mapping, Sequence

import numpy as np

from wm_drake.errors import input_error
from wm_drake.parameters.recorded_sensors import RecordedSensor
from wm_drake.studies.compare.pairs import QUANTITIES, Pair, order_one

REVERSED = -0.5
"""Correlation of order 1 below which a sensor is taken to have the other sign."""

LEAST_CORRELATION = 0.2
"""Largest correlation of signals that have nothing in common: an assumption."""


def check_pair(pair: Pair, sensors: Mapping[str, RecordedSensor]) -> None:
    """Check that a recording is like its prediction.

    Raises:
        InputError: a sensor has the other sign, or none is like its
            prediction.
    """
    _check_signs(pair, sensors)


def _check_signs(pair: Pair, sensors: Mapping[str, RecordedSensor]) -> None:
    """Check that no sensor has the other sign, and that the signals have something in common.

    Signs are told by the correlations of order 1, or by gravity. The angle of the drum at the start
    is unknown, so a single sensor without gravity can have either sign.

    Raises:
        InputError: a sensor has the other sign, or no signal is like its prediction.
    """
    path = str(pair.recording.path)
    correlations = order_one(pair).correlation
    for name, sensor in sensors.items():
        k = list(sensors).index(name)
        if _has_opposite_gravity(pair, sensor, k):
            raise _reversed(path, name, "its mean has the other sign than gravity")
        value = float(correlations.sel(sensor=name))
        if value < REVERSED:
            text = f"its order 1 has the correlation {value:.2f} with the prediction"
            raise _reversed(path, name, text)
    if len(sensors) and float(np.abs(correlations).max()) < LEAST_CORRELATION:
        raise input_error(
            f"no signal is like its prediction: the largest correlation of order 1 is "
            f"{float(np.abs(correlations).max()):.2f}; is it the load, the profile and the machine "
            "of the test? A channel of the drum speed would align it",
            where=path,
        )


LEAST_GRAVITY = 3.0
"""Smallest mean of an accelerometer that tells its sign. [m/s^2]"""


def _has_opposite_gravity(pair: Pair, sensor: RecordedSensor, k: int) -> bool:
    if not sensor.shows_gravity:
        return False
    measured, predicted = (float(np.nanmean(signal[:, k])) for signal in pair.both)
    return measured * predicted < 0.0 and min(abs(measured), abs(predicted)) > LEAST_GRAVITY


def _reversed(path: str, name: str, why: str) -> Exception:
    return input_error(
        f"has the other sign than its sensor is declared with: {why}; turn its axis, or set "
        "polarity (negative for a signal of the other sign)",
        where=path,
        key=name,
    )


def gravity_warnings(pairs: Sequence[Pair], sensors: Mapping[str, RecordedSensor]) -> list[str]:
    """Return a warning of each accelerometer that does not show the gravity that it should."""
    warnings = []
    for k, (name, sensor) in enumerate(sensors.items()):
        if not sensor.shows_gravity:
            continue
        measured, predicted = (
            float(np.mean([np.nanmean(pair.both[side][:, k]) for pair in pairs])) for side in (0, 1)
        )
        unit = QUANTITIES["acceleration"]
        if abs(measured - predicted) > 1.0:
            warnings.append(
                f"{name}: its mean is {unit.text(measured)}, with gravity it would be "
                f"{unit.text(predicted)}. If it is AC-coupled or without gravity, say so: "
                "ac_coupling, or gravity: removed."
            )
    return warnings
