"""Campbell diagram: modes over the speed of the drum, tracked, and critical speeds.

Modes at neighbouring speeds are joined by their modal assurance criterion in its bi-orthogonal form

    MAC_ij = |l_i(1) r_j(2)| |l_j(2) r_i(1)|

with left and right eigenvectors l and r of the two speeds. It is 1 for equal modes, 0 for different
modes of one matrix, and does not depend on the units of the state. Two frequencies that cross keep
their modes, because the shapes do not cross. If no joining is clear, the speed between is looked at
first.
"""

import itertools
from collections.abc import Callable, Mapping, Sequence

import numpy as np
import xarray as xr

from wm_drake.parameters.types import FloatArray
from wm_drake.report.labelled import rows_of
from wm_drake.studies.modes import quantities as q
from wm_drake.studies.modes.data import oscillation
from wm_drake.studies.modes.linearisation import Spectrum

CLEAR_MAC = 0.8
"""Least MAC of a joining that is clear."""

MOST_HALVINGS = 8
"""Largest number of times that a step between two speeds is halved."""


def mac(before: Spectrum, after: Spectrum) -> FloatArray:
    """Return the modal assurance criterion of each mode before with each mode after. (m, k)"""
    forth = np.abs(before.left @ after.right)
    back = np.abs(after.left @ before.right)
    return np.asarray(forth * back.T)


def campbell(
    spectrum_at: Callable[[float], Spectrum], speeds: FloatArray, count: int
) -> tuple[list[Spectrum], FloatArray]:
    """Follow modes over the speed, each a curve without jumps.

    Where two curves come near each other and part again, the shapes change over from one to the
    other: the shape of a curve at one speed says nothing about another speed.

    Args:
        spectrum_at: Returns the eigenvalues at a speed. [rad/s]
        speeds: Rising. [rad/s]
        count: Number of modes to follow, the slowest at the first speed.

    Returns:
        Modes at each speed; number k is on the same curve at all speeds, NaN behind the end of a
        curve. MAC of each mode with the one of its curve at the speed before; 1 at the first.
        (speeds, modes)
    """
    here = spectrum_at(float(speeds[0])).first(count)
    spectra = [here]
    macs: list[FloatArray] = [np.ones(len(here.values))]
    for before, after in itertools.pairwise(speeds):
        here, least = _joined(spectrum_at, float(before), float(after), here, MOST_HALVINGS)
        spectra.append(here)
        macs.append(least)
    return spectra, np.array(macs)


def diagram_of(
    speeds: FloatArray,
    spectra: Sequence[Spectrum],
    macs: FloatArray,
    names: Sequence[Sequence[str]],
) -> xr.Dataset:
    """Return a Campbell diagram over `speed` [rad/s] and `curve` from 1 on.

    Args:
        spectra, macs: As of `campbell`.
        names: Name of each curve at each speed, from its shape there.

    Returns:
        `mode`, the name; `frequency` [Hz], `damping_ratio` and `mac`.
    """
    dims = ("speed", "curve")
    frequency = np.array([spectrum.frequency_hz for spectrum in spectra])
    damping = np.array([spectrum.damping_ratio for spectrum in spectra])
    return xr.Dataset(
        {
            "mode": (dims, np.array(names, dtype=object)),
            **oscillation(dims, frequency, damping),
            "mac": q.MAC.variable(dims, macs),
        },
        {"speed": speeds, "curve": np.arange(1, frequency.shape[1] + 1)},
    )


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
    diagrams: Mapping[str, xr.Dataset], orders: Sequence[float] = (1.0, 2.0)
) -> xr.Dataset:
    """Return the speeds at which orders of the drum's speed equal natural frequencies.

    Args:
        diagrams: Diagrams as of `diagram_of`, by linearisation.

    Returns:
        Over `row`, with the labels `linearisation` and `mode`, the name at the nearest speed of the
        diagram: `order`, `speed` [rad/s], rising for each linearisation, and `damping_ratio`.
    """
    rows = [
        (name, *crossing)
        for name, diagram in diagrams.items()
        for crossing in _crossings(diagram, orders)
    ]
    names, modes, order, speed, damping = zip(*rows, strict=True) if rows else ((),) * 5
    return rows_of(
        {"linearisation": names, "mode": modes},
        order=q.ORDER.variable("row", order),
        speed=q.CRITICAL_SPEED.variable("row", speed),
        damping_ratio=q.DAMPING.variable("row", damping),
    )


def _crossings(
    diagram: xr.Dataset, orders: Sequence[float]
) -> list[tuple[str, float, float, float]]:
    """Return mode, order, speed [rad/s] and damping ratio of crossings, in rising order of speed.

    Between two speeds of the diagram the frequency is interpolated by a cubic through four.
    """
    from scipy.interpolate import CubicSpline

    crossings = []
    for order in orders:
        for number in range(diagram.sizes["curve"]):
            curve = diagram.isel(curve=number)
            excess = 2.0 * np.pi * curve.frequency.values - order * diagram.speed.values
            good = np.isfinite(excess)
            if good.sum() < 4:
                continue
            speeds = diagram.speed.values[good]
            ratio = CubicSpline(speeds, curve.damping_ratio.values[good])
            for root in CubicSpline(speeds, excess[good]).roots(extrapolate=False):
                if root > 0.0:
                    name = str(curve.mode.sel(speed=root, method="nearest").item())
                    crossings.append((name, order, float(root), float(ratio(root))))
    return sorted(crossings, key=lambda crossing: crossing[2])
