"""From a recorded test to the motion of the bench: a sine where it is one, else as recorded."""

import warnings
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import minimize_scalar

from wm_drake.errors import InputNotice, Problem, input_error
from wm_drake.parameters.loop_files import FEWEST, MeasuredLoop
from wm_drake.parameters.types import FloatArray
from wm_drake.rigs.bench import Harmonic
from wm_drake.rigs.smoothing import Smoothed, smoothed

if TYPE_CHECKING:
    from collections.abc import Iterable

LARGEST_DISTORTION = 0.03
"""Largest root mean square of what is neither fundamental nor drift in the displacement of a sine,
in amplitudes."""

LARGEST_OVERTONES = 0.05
"""Largest root sum of squares of the overtones in the velocity of a sine, by the fundamental. A
triangle has 0.44. Noise of 1 % in 400 samples has 0.02."""

OVERTONES = range(2, 10)

WHOLE_PERIOD = 0.97
"""Part of a period that counts as a whole one: its samples end a step before its end."""

REPEATS, MOSTLY = 0.05, 0.8
"""Largest difference between the rates of the first and of a later period of a motion that repeats
itself, by the root mean square rate; and the part of the samples for which it holds."""

STEPS_PER_STROKE = 100
"""Least number of integration steps in which a recorded motion passes its stroke."""

MOST_STEPS = 50
"""Most integration steps between two samples."""


@dataclass(frozen=True, eq=False)
class MeasuredMotion:
    """A measured test with the motion that drives the law.

    Attributes:
        position, rate: Displacement or angle of the driven end from its zero, and its rate, at the
            samples (n,). [m, m/s; rad, rad/s]
        baseline: Columns (n, 1 or 2): offset of an instrument and, where two periods or more
            separate it from the loop, its drift.
    """

    loop: MeasuredLoop
    position: FloatArray
    rate: FloatArray
    baseline: FloatArray

    @property
    def stroke(self) -> float:
        """Largest distance from the zero of the motion. [m; rad]"""
        return float(np.max(np.abs(self.position)))

    @property
    def fastest(self) -> float:
        """Largest absolute rate. [m/s; rad/s]"""
        return float(np.max(np.abs(self.rate)))

    @property
    def order(self) -> tuple[float, float, float]:
        """Key by which tests are sorted: sines by frequency and amplitude, then other motions."""
        return (1.0, self.fastest, self.stroke)


@dataclass(frozen=True, eq=False)
class HarmonicMotion(MeasuredMotion):
    """A measured loop on the clock of its own sine.

    Attributes:
        motion: The fundamental of the displacement.
        phase: Phase of each sample, 0 at an upward passage through the middle, from 0 to 2 pi (n,).
            [rad]
    """

    motion: Harmonic
    phase: FloatArray

    @property
    def stroke(self) -> float:
        """Amplitude. [m; rad]"""
        return self.motion.amplitude

    @property
    def fastest(self) -> float:
        """Amplitude of the rate. [m/s; rad/s]"""
        return self.motion.amplitude * self.motion.angular_frequency

    @property
    def order(self) -> tuple[float, float, float]:
        """Key by which tests are sorted."""
        return (0.0, round(self.motion.frequency, 2), self.motion.amplitude)


@dataclass(frozen=True, eq=False)
class RecordedMotion(MeasuredMotion):
    """A measured test whose own smoothed displacement drives the law.

    Attributes:
        cutoff: Frequency at which the smoothing halves a motion; infinite if nothing is smoothed.
            [Hz]
        noise: Root mean square of what the smoothing takes out of the displacement. [m; rad]
        step: Steps of the integration: durations (k,). [s]
        step_rate: Rates at the ends of the steps (k + 1,). [m/s; rad/s]
        samples: Index of the end of a step at each sample (n,).
        repeats: Number of steps of the first period of a motion that repeats itself, else 0. A
            sponge then begins in the steady state of that period, else without deformation.
    """

    cutoff: float
    noise: float
    step: FloatArray
    step_rate: FloatArray
    samples: np.ndarray
    repeats: int


def measured_motion(loop: MeasuredLoop, cutoff: float | None = None) -> MeasuredMotion:
    """Return the motion of a bench.

    A displacement that is a sine becomes one by least squares; its offset and drift are removed and
    its middle counts as the component's zero. Any other displacement drives the law as it was
    recorded: a cubic smoothing spline interpolates and differentiates it, and its own zero counts.

    Args:
        cutoff: Frequency at which the smoothing of a recorded motion halves it; None to choose it
            by generalised cross-validation. With a cutoff, every motion is taken as recorded. [Hz]

    Raises:
        InputError: The displacement is noise at its sampling rate.
    """
    if cutoff is None:
        sine = _sine(loop)
        if sine is not None:
            return sine
    return _recorded(loop, cutoff)


def inertia_force(motion: MeasuredMotion, mass: float) -> FloatArray:
    """Return the force that accelerates a mass at the driven end, at the samples (n,). [N]

        M Y'' of [C] Eq. (2), m_o xo'' of [A] Eq. (6)

    Args:
        motion: The motion: a sine, or as recorded, whose smoothed rate is differentiated.
        mass: Mass of jig and outer tube. [kg]
    """
    if isinstance(motion, HarmonicMotion):
        return -mass * motion.motion.angular_frequency**2 * motion.position
    time = motion.loop.time
    return np.asarray(mass * np.gradient(motion.rate, time))


def inertia_share(motion: MeasuredMotion, mass: float) -> tuple[float, float]:
    """Return the largest force of inertia [N], and its share of half the measured range of force.

    Arguments as for `inertia_force`.
    """
    largest = float(np.max(np.abs(inertia_force(motion, mass))))
    return largest, largest / (0.5 * float(np.ptp(motion.loop.force)))


def without_inertia(motion: MeasuredMotion, mass: float) -> MeasuredMotion:
    """Return a measured test less the inertia of a mass at its driven end; see `inertia_force`."""
    force = motion.loop.force - inertia_force(motion, mass)
    return replace(motion, loop=replace(motion.loop, force=force))


def _sine(loop: MeasuredLoop) -> HarmonicMotion | None:
    """Return the motion as a sine; None if it is none, or covers less than a period."""
    time = loop.time - loop.time[0]
    length, frequency = float(time[-1]), _frequency(time, loop.displacement)
    if frequency * length < WHOLE_PERIOD:
        return None
    amounts, left = _projected(time, loop.displacement, frequency)
    amplitude = float(np.hypot(amounts[0], amounts[1]))
    if not amplitude > 0.0 or float(np.sqrt(np.mean(np.square(left)))) > (
        LARGEST_DISTORTION * amplitude
    ):
        return None
    if _overtones(time, left, frequency) > LARGEST_OVERTONES * amplitude:
        return None
    phase = np.mod(2.0 * np.pi * frequency * time + np.arctan2(amounts[1], amounts[0]), 2.0 * np.pi)
    motion = Harmonic(frequency, amplitude)
    return HarmonicMotion(
        loop,
        amplitude * np.sin(phase),
        amplitude * motion.angular_frequency * np.cos(phase),
        _baseline(time, frequency),
        motion,
        phase,
    )


def _baseline(time: FloatArray, frequency: float) -> FloatArray:
    """Return the columns of offset and, from two periods on, of drift."""
    columns = [np.ones_like(time)]
    if frequency * time[-1] >= 2.0:
        columns.append(time / time[-1] - 0.5)
    return np.stack(columns, axis=1)


def _longest_piece(loop: MeasuredLoop) -> MeasuredLoop:
    """Return the longest part of a loop without a gap, with a notice if there are several."""
    if not len(loop.gaps):
        return loop
    ends = [loop.time[0], *loop.gaps.ravel(), loop.time[-1]]
    begin, end = max(zip(ends[::2], ends[1::2], strict=True), key=lambda one: one[1] - one[0])
    inside = (loop.time >= begin) & (loop.time <= end)
    message = (
        f"its motion is no sine and has {len(loop.gaps)} gap{'s' if len(loop.gaps) > 1 else ''}; "
        f"used is the longest part without one, {begin:.6g} to {end:.6g} s"
    )
    warnings.warn(str(Problem(loop.path, "", message)), InputNotice, stacklevel=2)
    if np.sum(inside) < FEWEST:
        raise input_error(
            f"its longest part without a gap has {np.sum(inside)} samples; a loop needs at least "
            f"{FEWEST}",
            where=loop.path,
        )
    return replace(
        loop,
        time=loop.time[inside],
        displacement=loop.displacement[inside],
        force=loop.force[inside],
        gaps=loop.gaps[:0],
    )


def _recorded(loop: MeasuredLoop, cutoff: float | None) -> RecordedMotion:
    """Return the motion as recorded, smoothed."""
    loop = _longest_piece(loop)
    time = loop.time - loop.time[0]
    curve = smoothed(time, loop.displacement, cutoff, loop.path)
    rate = curve.rate(time)
    stroke = 0.5 * float(np.ptp(curve.position))
    per_sample = np.abs(np.diff(curve.position)) * STEPS_PER_STROKE / max(2.0 * stroke, 1e-300)
    counts = np.clip(np.ceil(per_sample), 1, MOST_STEPS).astype(int)
    samples = np.concatenate([[0], np.cumsum(counts)])
    places = np.interp(np.arange(samples[-1] + 1), samples, time)
    period = _period(time, curve)
    return RecordedMotion(
        loop,
        curve.position,
        rate,
        _baseline(time, 1.0 / period) if period else np.ones((len(time), 1)),
        curve.cutoff,
        curve.noise,
        np.diff(places),
        curve.rate(places),
        samples,
        int(np.searchsorted(places, period)) if period else 0,
    )


def _period(time: FloatArray, curve: Smoothed) -> float:
    """Return the period of a motion that repeats itself for two periods; 0 for another. [s]"""
    frequency = _frequency(time, curve.position)
    if frequency * time[-1] < 1.0 + WHOLE_PERIOD:
        return 0.0
    later = time[time >= 1.0 / frequency]
    now, first = curve.rate(later), curve.rate(np.mod(later, 1.0 / frequency))
    size = float(np.sqrt(np.mean(np.square(now))))
    # a triangle reverses within a sample or two, where rates differ
    alike = float(np.quantile(np.abs(now - first), MOSTLY)) <= REPEATS * size
    return 1.0 / frequency if alike else 0.0


def _frequency(time: FloatArray, values: FloatArray) -> float:
    """Return the frequency of the sine that is nearest to a signal. [Hz]"""
    length, guess = float(time[-1]), _guessed_frequency(time, values)
    minimum = minimize_scalar(
        lambda f: float(np.sum(np.square(_projected(time, values, f)[1]))),
        bounds=(max(guess - 0.6 / length, 0.05 / length), guess + 0.6 / length),
        method="bounded",
        options={"xatol": 1e-9 * guess},
    )
    return float(minimum.x)


def _projected(
    time: FloatArray, values: FloatArray, frequency: float
) -> tuple[FloatArray, FloatArray]:
    """Return the amounts of sine, cosine, offset (and drift), and what they leave."""
    angle = 2.0 * np.pi * frequency * time
    columns = [np.sin(angle), np.cos(angle), np.ones_like(time)]
    if frequency * time[-1] >= 2.0:
        columns.append(time / time[-1])
    matrix = np.stack(columns, axis=1)
    amounts = np.linalg.lstsq(matrix, values, rcond=None)[0]
    return amounts, values - matrix @ amounts


def _overtones(time: FloatArray, left: FloatArray, frequency: float) -> float:
    """Return the root sum of squares of the overtones, each times its order."""
    slowest = np.max(np.diff(time))
    seen = [k for k in OVERTONES if 2.0 * k * frequency * slowest < 1.0 and 4 * k < len(time)]
    return float(np.sqrt(sum((k * _amplitude(time, left, k * frequency)) ** 2 for k in seen)))


def _amplitude(time: FloatArray, values: FloatArray, frequency: float) -> float:
    angle = 2.0 * np.pi * frequency * time
    matrix = np.stack([np.sin(angle), np.cos(angle), np.ones_like(time)], axis=1)
    amounts = np.linalg.lstsq(matrix, values, rcond=None)[0]
    return float(np.hypot(amounts[0], amounts[1]))


def _guessed_frequency(time: FloatArray, values: FloatArray) -> float:
    """Return the peak of the spectrum, with the samples on an even grid. [Hz]"""
    count = min(max(4 * len(time), 256), 1 << 17)
    even = np.linspace(0.0, time[-1], count)
    straight = np.polynomial.Polynomial.fit(time, values, 1)
    level = np.interp(even, time, values - (straight(time) if np.ptp(values) else values))
    spectrum = np.abs(np.fft.rfft(level * np.hanning(count), 8 * count))
    return float((int(np.argmax(spectrum[4:])) + 4) / (8.0 * time[-1] * count / (count - 1)))


def sines_of(motions: "Iterable[MeasuredMotion]") -> list[HarmonicMotion]:
    """Return those of some motions that are sines."""
    return [motion for motion in motions if isinstance(motion, HarmonicMotion)]
