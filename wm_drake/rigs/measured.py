"""From a recorded loop to the motion of the bench: frequency, amplitude, phase of each sample."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from wm_drake.errors import input_error
from wm_drake.parameters.loop_files import MeasuredLoop
from wm_drake.parameters.types import FloatArray
from wm_drake.rigs.bench import Harmonic

LARGEST_DISTORTION = 0.2
"""Largest root mean square of what is neither fundamental nor drift in the displacement, in
amplitudes."""


WHOLE_PERIOD = 0.97
"""Part of a period that counts as a whole one: its samples end a step before its end."""


@dataclass(frozen=True, eq=False)
class MeasuredMotion:
    """A measured loop on the clock of its own motion.

    Attributes:
        loop: The recorded loop.
        motion: The fundamental of the displacement.
        phase: Phase of each sample, 0 at an upward passage through the middle, from 0 to 2 pi (n,).
            [rad]
        baseline: Columns (n, 1 or 2): offset of an instrument and, where two periods or more
            separate it from the loop, its drift.
    """

    loop: MeasuredLoop
    motion: Harmonic
    phase: FloatArray
    baseline: FloatArray


def measured_motion(loop: MeasuredLoop) -> MeasuredMotion:
    """Return the harmonic motion of a bench by least squares; offset and drift are removed.

    The middle of the motion counts as the component's zero.

    Raises:
        InputError: The loop covers less than a period, or the motion is not harmonic.
    """
    time = loop.time - loop.time[0]
    length = float(time[-1])
    guess = _guessed_frequency(time, loop.displacement)
    found = minimize_scalar(
        lambda f: _projected(time, loop.displacement, f)[1],
        bounds=(max(guess - 0.6 / length, 0.05 / length), guess + 0.6 / length),
        method="bounded",
        options={"xatol": 1e-9 * guess},
    )
    frequency = float(found.x)
    if frequency * length < WHOLE_PERIOD:
        raise input_error(
            f"covers {frequency * length:.2f} of a period; a loop needs at least one",
            where=loop.path,
        )
    amounts, error = _projected(time, loop.displacement, frequency)
    amplitude = float(np.hypot(amounts[0], amounts[1]))
    distortion = float(np.sqrt(error / len(time))) / amplitude if amplitude > 0.0 else np.inf
    if distortion > LARGEST_DISTORTION:
        raise input_error(
            f"displacement is not harmonic: {100.0 * distortion:.0f} % of its amplitude is not at "
            f"{frequency:.3g} Hz; allowed is {100.0 * LARGEST_DISTORTION:.0f} %",
            where=loop.path,
        )
    phase = np.mod(2.0 * np.pi * frequency * time + np.arctan2(amounts[1], amounts[0]), 2.0 * np.pi)
    columns = [np.ones_like(time)]
    if frequency * length >= 2.0:
        columns.append(time / length - 0.5)
    return MeasuredMotion(loop, Harmonic(frequency, amplitude), phase, np.stack(columns, axis=1))


def _projected(time: FloatArray, values: FloatArray, frequency: float) -> tuple[FloatArray, float]:
    """Return the amounts of sine, cosine, offset (and drift), and the square sum they leave."""
    angle = 2.0 * np.pi * frequency * time
    columns = [np.sin(angle), np.cos(angle), np.ones_like(time)]
    if frequency * time[-1] >= 2.0:
        columns.append(time / time[-1])
    matrix = np.stack(columns, axis=1)
    amounts = np.linalg.lstsq(matrix, values, rcond=None)[0]
    return amounts, float(np.sum(np.square(values - matrix @ amounts)))


def _guessed_frequency(time: FloatArray, values: FloatArray) -> float:
    """Return the peak of the spectrum, with the samples on an even grid. [Hz]"""
    count = min(max(4 * len(time), 256), 1 << 17)
    even = np.linspace(0.0, time[-1], count)
    straight = np.polynomial.Polynomial.fit(time, values, 1)
    level = np.interp(even, time, values - (straight(time) if np.ptp(values) else values))
    spectrum = np.abs(np.fft.rfft(level * np.hanning(count), 8 * count))
    return float((int(np.argmax(spectrum[4:])) + 4) / (8.0 * time[-1] * count / (count - 1)))
