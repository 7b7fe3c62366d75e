"""Campbell diagram: modes over the speed of the drum, tracked, and critical speeds.

Modes at neighbouring speeds are joined by their modal assurance criterion in its bi-orthogonal form

    MAC_ij = |l_i(1) r_j(2)| |l_j(2) r_i(1)|

with left and right eigenvectors l and r of the two speeds. It is 1 for equal modes, 0 for different
modes of one matrix, and does not depend on the units of the state. Two frequencies that cross keep
their modes, because the shapes do not cross. If no joining is clear, the speed between is looked at
first.
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wm_drake.parameters.types import ComplexArray, FloatArray
from wm_drake.studies.modes.linearisation import Spectrum

CLEAR_MAC = 0.8
"""Least MAC of a joining that is clear."""

MOST_HALVINGS = 8
"""Largest number of times that a step between two speeds is halved."""


@dataclass(frozen=True)
class Campbell:
    """Modes over the speed of the drum, each a curve without jumps.

    Where two curves come near each other and part again, the shapes change over from one to the
    other: the shape of a curve at one speed says nothing about another speed.

    Attributes:
        speed: (s,) rising. [rad/s]
        spectra: Modes at each speed; number k is on the same curve at all speeds. NaN behind the
            end of a curve.
        mac: MAC of each mode with the one of its curve at the speed before; 1 at the first. (s, m)
    """

    speed: FloatArray
    spectra: tuple[Spectrum, ...]
    mac: FloatArray

    @property
    def value(self) -> ComplexArray:
        """Return the eigenvalues. (s, m) complex [1/s]"""
        return np.array([spectrum.values for spectrum in self.spectra])

    @property
    def frequency_hz(self) -> FloatArray:
        """Return the natural frequencies |lambda| / (2 pi). (s, m) [Hz]"""
        return np.asarray(np.abs(self.value) / (2.0 * np.pi))

    @property
    def damping_ratio(self) -> FloatArray:
        """Return the damping ratios. (s, m)"""
        return np.asarray(-self.value.real / np.abs(self.value))


@dataclass(frozen=True)
class CriticalSpeed:
    """Speed at which an order of the drum's speed equals a natural frequency.

    Attributes:
        order: Multiple of the drum's speed.
        mode: Number of the curve.
        speed: [rad/s]
        damping_ratio: Of the mode there.
    """

    order: float
    mode: int
    speed: float
    damping_ratio: float


def mac(before: Spectrum, after: Spectrum) -> FloatArray:
    """Return the modal assurance criterion of each mode before with each mode after. (m, k)"""
    forth = np.abs(before.left @ after.right)
    back = np.abs(after.left @ before.right)
    return np.asarray(forth * back.T)


def campbell(spectrum_at: Callable[[float], Spectrum], speeds: FloatArray, count: int) -> Campbell:
    """Follow modes over the speed.

    Args:
        spectrum_at: Returns the eigenvalues at a speed. [rad/s]
        speeds: Rising. [rad/s]
        count: Number of modes to follow, the slowest at the first speed.
    """
    here = spectrum_at(float(speeds[0])).first(count)
    spectra = [here]
    macs: list[FloatArray] = [np.ones(len(here.values))]
    for before, after in itertools.pairwise(speeds):
        here, least = _joined(spectrum_at, float(before), float(after), here, MOST_HALVINGS)
        spectra.append(here)
        macs.append(least)
    return Campbell(np.asarray(speeds), tuple(spectra), np.array(macs))


def _joined(
    spectrum_at: Callable[[float], Spectrum],
    before: float,
    after: float,
    here: Spectrum,
    halvings: int,
) -> tuple[Spectrum, FloatArray]:
    """Return the same modes at the next speed, and the least MAC on the way of each."""
    from scipy.optimize import linear_sum_assignment  # slow to import: modes over the speed

    there = spectrum_at(after)
    table = mac(here, there)
    modes, partners = linear_sum_assignment(-table)
    sizes = table[modes, partners]
    if len(partners) == len(here.values) and (sizes.min() >= CLEAR_MAC or not halvings):
        chosen = Spectrum(there.values[partners], there.right[:, partners], there.left[partners])
        return chosen, sizes
    if not halvings:  # a mode has become overdamped: it ends here
        lost = np.setdiff1d(np.arange(len(here.values)), modes)
        values, right, left = here.values.copy(), here.right.copy(), here.left.copy()
        values[modes] = there.values[partners]
        right[:, modes], left[modes] = there.right[:, partners], there.left[partners]
        values[lost] = np.nan
        every = np.zeros(len(values))
        every[modes] = sizes
        return Spectrum(values, right, left), every
    middle = 0.5 * (before + after)
    half, first = _joined(spectrum_at, before, middle, here, halvings - 1)
    end, second = _joined(spectrum_at, middle, after, half, halvings - 1)
    return end, np.minimum(first, second)


def critical_speeds(
    diagram: Campbell, orders: tuple[float, ...] = (1.0, 2.0)
) -> list[CriticalSpeed]:
    """Return the speeds at which orders cross modes, in rising order.

    Between two speeds of the diagram the frequency is interpolated by a cubic through four.
    """
    from scipy.interpolate import CubicSpline

    crossings = []
    for order in orders:
        for mode, values in enumerate(diagram.value.T):
            excess = np.abs(values) - order * diagram.speed
            good = np.isfinite(excess)
            if good.sum() < 4:
                continue
            speeds = diagram.speed[good]
            curve = CubicSpline(speeds, excess[good])
            ratio = CubicSpline(speeds, diagram.damping_ratio[good, mode])
            crossings += [
                CriticalSpeed(order, mode, float(speed), float(ratio(speed)))
                for speed in curve.roots(extrapolate=False)
                if speed > 0.0
            ]
    return sorted(crossings, key=lambda critical: critical.speed)
