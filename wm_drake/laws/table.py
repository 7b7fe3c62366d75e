"""Stiffness: a number, or a table interpolated monotonically.

In packed form (one flat array of floats) a stiffness is either ``[0, k]`` or ``[n, x_1..x_n, y_1..y_n, m_1..m_n]``: n
points, their ordinates and the slopes there. The slopes come from scipy's PCHIP when the table is packed
(`wm_drake.parameters.stiffness`), which keeps the curve monotone between monotone points.
"""

from wm_drake.laws.compilation import law
from wm_drake.laws.elementary import where


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
    last = n - 1
    x0, x1 = packed[xs], packed[xs + 1]
    y0, y1 = packed[ys], packed[ys + 1]
    m0, m1 = packed[ms], packed[ms + 1]
    for i in range(1, last):
        beyond = x > packed[xs + i]
        x0, x1 = where(beyond, packed[xs + i], x0), where(beyond, packed[xs + i + 1], x1)
        y0, y1 = where(beyond, packed[ys + i], y0), where(beyond, packed[ys + i + 1], y1)
        m0, m1 = where(beyond, packed[ms + i], m0), where(beyond, packed[ms + i + 1], m1)
    inside = hermite(x, x0, x1, y0, y1, m0, m1)
    before = y0 + m0 * (x - x0)  # on the first and last piece, where these are the table's ends
    after = y1 + m1 * (x - x1)
    return where(x <= packed[xs], before, where(x >= packed[xs + last], after, inside))


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
