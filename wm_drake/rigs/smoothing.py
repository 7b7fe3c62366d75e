"""Smoothing of a measured displacement, and its rate: a cubic smoothing spline.

The spline g has the least sum of (x_i - g(t_i))^2 + lambda times the integral of g''^2. On an even
grid of step h it halves a motion at the frequency f_c with lambda h (2 pi f_c)^4 = 1 and passes
slower ones: its transfer function is 1 / (1 + (f / f_c)^4), without a shift of phase.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.fft import dst
from scipy.interpolate import make_smoothing_spline

from wm_drake.errors import input_error
from wm_drake.parameters.types import FloatArray

LARGEST_NOISE = 0.3
"""Largest part of a displacement, root mean square, that smoothing may take out."""

TRIED = 80
"""Cutoff frequencies among which the smoothing is chosen."""

LOWEST = 0.1
"""Lowest cutoff that may be asked for, in periods within the record."""

FASTEST = 2.0
"""Highest cutoff that is tried, by the sampling rate; there, next to nothing is smoothed."""


@dataclass(frozen=True, eq=False)
class Smoothed:
    """A smoothed displacement.

    Attributes:
        position: At the samples (n,). [m; rad]
        cutoff: Frequency at which a motion is halved; infinite if nothing is smoothed. [Hz]
        noise: Root mean square of what was taken out. [m; rad]
        spline: Displacement over time in mean sample steps.
        step: Mean sample step. [s]
    """

    position: FloatArray
    cutoff: float
    noise: float
    spline: Any
    step: float

    def rate(self, time: FloatArray) -> FloatArray:
        """Return the rate at times (n,), from the first sample on. [s -> m/s; rad/s]"""
        return np.asarray(self.spline(time / self.step, 1) / self.step)


def smoothed(time: FloatArray, values: FloatArray, cutoff: float | None, path: str) -> Smoothed:
    """Return a smoothed signal.

    Args:
        time: From 0 on, rising (n,). [s]
        values: The signal (n,).
        cutoff: Frequency at which a motion is halved; None for generalised cross-validation. [Hz]
        path: File, for messages.

    Raises:
        InputError: The signal is mostly noise at its sampling rate, or nothing of it is below the
            cutoff.
    """
    step = float(time[-1]) / (len(time) - 1)
    clock = time / step
    if cutoff is not None:
        _check_cutoff(cutoff, float(time[-1]), step, path)
    amount = _chosen(clock, values) if cutoff is None else 1.0 / (2.0 * np.pi * cutoff * step) ** 4
    spline = make_smoothing_spline(clock, values, lam=amount)
    position = np.asarray(spline(clock))
    noise = float(np.sqrt(np.mean(np.square(values - position))))
    if noise > LARGEST_NOISE * float(np.std(values)):
        part = 100.0 * noise / float(np.std(values))
        raise input_error(
            f"displacement is not resolved by its samples: {part:.0f} % of it is noise from sample "
            f"to sample; allowed is {100.0 * LARGEST_NOISE:.0f} %",
            where=path,
        )
    cutoff = (1.0 / amount) ** 0.25 / (2.0 * np.pi * step) if amount > 0.0 else np.inf
    return Smoothed(position, cutoff, noise, spline, step)


def _check_cutoff(cutoff: float, duration: float, step: float, path: str) -> None:
    """Raise InputError if a cutoff [Hz] smooths all of a record, or nothing of it."""
    low, high = LOWEST / duration, FASTEST / step
    if not low <= cutoff <= high:
        raise input_error(
            f"a cutoff of {cutoff:g} Hz does not suit a record of {duration:g} s sampled at "
            f"{1.0 / step:g} Hz; allowed are {low:.3g} to {high:.3g} Hz",
            where=path,
        )


def _chosen(clock: FloatArray, values: FloatArray) -> float:
    """Return the smoothing of least generalised cross-validation; 0 if none is the best.

    On an even grid and between its ends, a sine of the frequency f is an eigenvector of the
    smoothing: what it keeps is the transfer function, and a sine transform gives the whole sum.
    """
    count = len(clock)
    even = np.interp(np.arange(count), clock, values)
    amounts = dst(even[1:-1] - np.linspace(even[0], even[-1], count)[1:-1], type=1, norm="ortho")
    power = np.square(amounts)
    frequency = np.arange(1, count - 1) / (2.0 * (count - 1))  # in samples
    cutoffs = np.geomspace(frequency[0], FASTEST, TRIED)
    lost = 1.0 - 1.0 / (1.0 + (frequency / cutoffs[:, None]) ** 4)
    score = np.sum(np.square(lost) * power, axis=1) / np.square(np.sum(lost, axis=1))
    best = int(np.argmin(score))
    if best == TRIED - 1:
        return 0.0
    return float((2.0 * np.pi * cutoffs[best]) ** -4)
