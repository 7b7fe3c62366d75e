"""Stiffness: a number, or a table interpolated monotonically.

In packed form (one flat array of floats) a stiffness is either ``[0, k]`` or ``[n, x_1..x_n, y_1..y_n, m_1..m_n]``: n
points, their ordinates and the slopes there. The slopes come from scipy's PCHIP when the table is packed
(`wm_drake.parameters.stiffness`), which keeps the curve monotone between monotone points.
"""

from wm_drake.laws.compilation import law


@law
def stiffness_force(x, packed, at):
    """Elastic force (or torque) at a displacement (or angle).

    Linear: k x. Table: cubic Hermite between the points [Fritsch and Carlson 1980, through scipy], a straight line with the
    slope of the end point beyond them.

    Args:
        x: Displacement. [m or rad]
        packed: Array that holds the packed stiffness. [N/m; or m and N, or rad and N m]
        at: Index in `packed` where it begins.

    Returns:
        Force in the direction of x (the element resists with its negative). [N or N m]
    """
    n = int(packed[at])
    if n == 0:
        return packed[at + 1] * x
    xs = at + 1
    ys = xs + n
    ms = ys + n
    if x <= packed[xs]:
        return packed[ys] + packed[ms] * (x - packed[xs])
    if x >= packed[xs + n - 1]:
        return packed[ys + n - 1] + packed[ms + n - 1] * (x - packed[xs + n - 1])
    i = 0
    while x > packed[xs + i + 1]:
        i += 1
    return hermite(
        x, packed[xs + i], packed[xs + i + 1], packed[ys + i], packed[ys + i + 1], packed[ms + i], packed[ms + i + 1]
    )


@law
def hermite(x, x0, x1, y0, y1, m0, m1):
    """Cubic through (x0, y0) and (x1, y1) with slopes m0 and m1 there; the standard Hermite form."""
    h = x1 - x0
    t = (x - x0) / h
    s = 1.0 - t
    return s * s * ((1.0 + 2.0 * t) * y0 + t * h * m0) + t * t * ((3.0 - 2.0 * t) * y1 - s * h * m1)


@law
def packed_size(packed, at):
    """Number of entries of the packed stiffness that begins at index `at`."""
    n = int(packed[at])
    return 2 if n == 0 else 1 + 3 * n
