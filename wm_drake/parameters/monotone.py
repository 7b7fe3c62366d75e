"""Monotone cubic through points (PCHIP), as in scipy, whose import would take half a second."""

import numpy as np

from wm_drake.parameters.types import FloatArray


def monotone_cubics(x: FloatArray, y: FloatArray) -> FloatArray:
    """Return the coefficients of cubics that rise and fall only where their points do.

    The slopes are those of Fritsch and Butland (1984), with the ends of Moler, *Numerical Computing
    with MATLAB* (2004), section 3.6, as in `scipy.interpolate.PchipInterpolator`.

    Args:
        x: Rising abscissas (points,), at least two.
        y: Ordinates (points, curves).

    Returns:
        Coefficients of the powers 0 to 3 of the distance from the left end of each piece, shape
        (4, pieces, curves).
    """
    h = np.diff(x)[:, None]
    m = np.diff(y, axis=0) / h
    slopes = _slopes(h, m)
    t = (slopes[:-1] + slopes[1:] - 2.0 * m) / h
    return np.stack((y[:-1], slopes[:-1], (m - slopes[:-1]) / h - t, t / h))


def _slopes(h: FloatArray, m: FloatArray) -> FloatArray:
    """Return the slope at each point, from lengths and secants of the pieces."""
    if len(m) == 1:
        return np.repeat(m, 2, axis=0)
    before, after = m[:-1], m[1:]
    w_before, w_after = 2.0 * h[1:] + h[:-1], h[1:] + 2.0 * h[:-1]
    is_extreme = (np.sign(before) != np.sign(after)) | (before == 0.0) | (after == 0.0)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        mean = (w_before / before + w_after / after) / (w_before + w_after)
        inner = np.where(is_extreme, 0.0, 1.0 / mean)
    first, last = _end_slope(h[0], h[1], m[0], m[1]), _end_slope(h[-1], h[-2], m[-1], m[-2])
    return np.concatenate((first[None], inner, last[None]))


def _end_slope(h0: FloatArray, h1: FloatArray, m0: FloatArray, m1: FloatArray) -> FloatArray:
    """Return the slope at an end by three points, limited so that the curve stays monotone."""
    slope = ((2.0 * h0 + h1) * m0 - h0 * m1) / (h0 + h1)
    is_steep = (np.sign(m0) != np.sign(m1)) & (np.abs(slope) > 3.0 * np.abs(m0))
    return np.where(np.sign(slope) != np.sign(m0), 0.0, np.where(is_steep, 3.0 * m0, slope))
