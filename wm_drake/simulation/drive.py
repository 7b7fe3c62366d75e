"""What the drive does in a run: torque, power, energy, speed ripple, and capture at a resonance.

Torques are those of the motor on the drum. A drive with a prescribed speed has them too: it gives
whatever the motion needs.
"""

from dataclasses import dataclass

import numpy as np

from wm_drake.parameters import SpinProfile
from wm_drake.parameters.types import FloatArray

SLOWEST = 2.0 * np.pi
"""Speed from which the ripple is measured: 60 rpm. [rad/s] Below it a turn is mostly start-up."""

CAPTURE_TIME = 5.0
"""Time for which the speed must stay almost the same below the wanted one to be caught. [s]"""

CAPTURE_LAG = 0.1
"""Part of the wanted speed by which a caught drum is slower, at least."""

CAPTURE_DRIFT = 0.02
"""Largest change of the mean speed of a caught drum from one half of `CAPTURE_TIME` to the next, in
parts of it."""

STALL_DRIFT = 0.005
"""The same for a drum that hardly turns or swings, in parts of the wanted speed."""


@dataclass(frozen=True)
class Capture:
    """A drum that stays at a speed below the wanted one, as at a resonance (Sommerfeld effect).

    Attributes:
        begin, end: When it is caught. [s]
        speed: Mean speed in the last half of `CAPTURE_TIME`. [rad/s]
        torque: Mean torque of the motor then. [N m]
    """

    begin: float
    end: float
    speed: float
    torque: float


@dataclass(frozen=True)
class DriveMeasures:
    """Measures of the drive over a run.

    Attributes:
        peak_torque: Largest torque of the motor on the drum, without sign. [N m]
        mean_torque: Largest torque averaged over a revolution; NaN without one. [N m]
        mean_torque_speed: Speed of the drum there. [rad/s]
        peak_power: Largest mechanical power. [W]
        energy: Work of the motor over the run. [J]
        speed_ripple: Largest difference between the highest and the lowest speed in a revolution,
            in parts of the mean speed, without the trend of a ramp (coefficient of fluctuation);
            from `SLOWEST` on. NaN if the drum does not reach it.
        capture: Where the drum was caught; None if it was not.
    """

    peak_torque: float
    mean_torque: float
    mean_torque_speed: float
    peak_power: float
    energy: float
    speed_ripple: float
    capture: Capture | None


def drive_measures(
    time: FloatArray, angle: FloatArray, speed: FloatArray, torque: FloatArray, profile: SpinProfile
) -> DriveMeasures:
    """Return the measures of the drive over a run.

    Args:
        time: (n,) evenly spaced. [s]
        angle, speed: (n,) Angle and speed of the drum against the tub. [rad, rad/s]
        torque: (n,) Torque of the motor on the drum. [N m]
        profile: Speed that is wanted.
    """
    if len(time) < 2:
        nan = float("nan")
        return DriveMeasures(nan, nan, nan, nan, nan, nan, None)
    mean = over_revolutions(time, angle, torque)
    nan = not np.isfinite(mean).any()
    largest = 0 if nan else int(np.nanargmax(np.abs(mean)))
    power = torque * speed
    return DriveMeasures(
        peak_torque=float(np.abs(torque).max()),
        mean_torque=float(mean[largest]),
        mean_torque_speed=float(over_revolutions(time, angle, speed)[largest]),
        peak_power=float(np.abs(power).max()),
        energy=float(np.trapezoid(power, time)),
        speed_ripple=speed_ripple(time, angle, speed),
        capture=capture(time, speed, torque, profile),
    )


def over_revolutions(time: FloatArray, angle: FloatArray, values: FloatArray) -> FloatArray:
    """Return the average of a signal over the revolution of the drum around each sample.

    Args:
        time, angle, values: (n,) [s, rad, any]

    Returns:
        (n,), NaN in the first and the last half revolution.
    """
    turned = np.maximum.accumulate(angle)  # a weak drive may turn back a little
    distinct = np.append(True, np.diff(turned) > 0.0)
    steps = 0.5 * (values[1:] + values[:-1]) * np.diff(time)
    integral = np.append(0.0, np.cumsum(steps))
    ends = [
        np.interp(angle + side, turned[distinct], time[distinct], left=np.nan, right=np.nan)
        for side in (-np.pi, np.pi)
    ]
    sums = [np.interp(end, time, integral) for end in ends]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray((sums[1] - sums[0]) / (ends[1] - ends[0]))


def speed_ripple(time: FloatArray, angle: FloatArray, speed: FloatArray) -> float:
    """Return the largest coefficient of fluctuation of the speed, see `DriveMeasures`."""
    mean = over_revolutions(time, angle, speed)
    good = mean >= SLOWEST  # false for NaN
    if not good.any():
        return float("nan")
    revolution = np.floor(angle[good] / (2.0 * np.pi))
    begins = np.flatnonzero(np.append(True, np.diff(revolution) != 0.0))
    deviation = (speed - mean)[good]
    spread = np.maximum.reduceat(deviation, begins) - np.minimum.reduceat(deviation, begins)
    return float((spread / mean[good][begins]).max())


def capture(
    time: FloatArray, speed: FloatArray, torque: FloatArray, profile: SpinProfile
) -> Capture | None:
    """Return where the drum is caught; None if it is not.

    It is caught when its mean speed hardly changes from one half of `CAPTURE_TIME` to the next,
    while it is slower than the wanted speed by more than `CAPTURE_LAG`, which does not fall.
    """
    half = round(0.5 * CAPTURE_TIME / float(time[1] - time[0]))
    if len(time) <= 2 * half:
        return None
    reference = np.asarray(profile.speed_at(time))

    def means(signal: FloatArray) -> FloatArray:
        sums = np.append(0.0, np.cumsum(signal))
        return np.asarray((sums[half:] - sums[:-half]) / half)

    fast, at, load = means(reference), means(speed), means(torque)
    before, now = at[:-half], at[half:]  # windows that end where the next one begins
    slow = now < (1.0 - CAPTURE_LAG) * fast[half:]
    allowed = np.maximum(CAPTURE_DRIFT * np.abs(now), STALL_DRIFT * np.abs(fast[half:]))
    steady = np.abs(now - before) <= allowed
    falls = fast[half:] < (1.0 - CAPTURE_DRIFT) * fast[:-half]
    caught = np.flatnonzero(slow & steady & ~falls)
    if not len(caught):
        return None
    # the last uninterrupted stretch
    gaps = np.flatnonzero(np.diff(caught) > 1)
    first = caught[gaps[-1] + 1] if len(gaps) else caught[0]
    last = caught[-1]
    return Capture(
        float(time[first]), float(time[last + 2 * half - 1]), float(now[last]),
        float(load[half + last]),
    )  # fmt: skip


def measured_drive(
    time: FloatArray, angle: FloatArray, speed: FloatArray, torque: FloatArray, profile: SpinProfile
) -> list[FloatArray]:
    """Return the numbers of the measure `drive`, in its order.

    Args:
        time, angle, speed, torque, profile: As for `drive_measures`.
    """
    drive = drive_measures(time, angle, speed, torque, profile)
    caught = drive.capture
    end = angle >= angle[-1] - 2.0 * np.pi if len(angle) else np.zeros(0, dtype=bool)
    numbers = (
        drive.peak_torque,
        drive.mean_torque,
        drive.mean_torque_speed,
        drive.peak_power,
        drive.energy,
        drive.speed_ripple,
        float(np.mean(speed[end])) if end.any() else np.nan,
        caught.speed if caught else np.nan,
        caught.torque if caught else np.nan,
    )
    return list(map(np.array, numbers))
