"""Stiffness: a number, or a table interpolated monotonically.

In packed form (one flat array of floats) a stiffness is either ``[0, k]`` or ``[n, x_1, y_1, a_1, b_1, c_1, x_2, .., c_(n-1),
x_n, a_n]``: for each piece between two of the n points its begin and the cubic y + a t + b t^2 + c t^3 in t = x - x_i, then
the last point and the slope there. The cubics are scipy's PCHIP (`wm_drake.parameters.elements.packed_curve`), which keeps
the curve monotone between monotone points.
"""

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import anywhere, everywhere, where

PIECE_SIZE = 5
"""Numbers of a piece."""


@law
def stiffness_force(x, packed, at):
    """Elastic force (or torque) at a displacement (or angle).

    Linear: k x. Table: a cubic between two points [Fritsch and Carlson 1980, through scipy], a straight line with the slope of
    the end point beyond them.

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
    piece = at + 1
    last = piece + PIECE_SIZE * (n - 1)
    before, after = x < packed[piece], x > packed[last]
    inside = where(before, packed[piece], where(after, packed[last], x))
    common = 0  # motions stay within a few pieces next to zero: those that all lanes have behind them cost a comparison
    while common < n - 2 and everywhere(inside >= packed[piece + PIECE_SIZE * (common + 1)]):
        common += 1
    begin, y, a, b, c = cubic_of_piece(packed, piece + PIECE_SIZE * common)
    for i in range(common + 1, n - 1):
        beyond = inside >= packed[piece + PIECE_SIZE * i]
        if not anywhere(beyond):
            break
        begin_i, y_i, a_i, b_i, c_i = cubic_of_piece(packed, piece + PIECE_SIZE * i)
        begin, y = where(beyond, begin_i, begin), where(beyond, y_i, y)
        a, b, c = where(beyond, a_i, a), where(beyond, b_i, b), where(beyond, c_i, c)
    t = inside - begin
    force = y + t * (a + t * (b + t * c))
    if anywhere(before | after):
        force = force + where(before, packed[piece + 2], packed[last + 1]) * (x - inside)
    return force


@law
def cubic_of_piece(packed, piece):
    """Begin of a piece of a table and its four coefficients, the constant first."""
    return packed[piece], packed[piece + 1], packed[piece + 2], packed[piece + 3], packed[piece + 4]


@law
def packed_size(packed, at):
    """Number of entries of the packed stiffness that begins at index `at`."""
    n = int(packed[at])
    return 2 if n == 0 else packed_table_size(n)


@law
def packed_table_size(n):
    """The same of a table of n points."""
    return PIECE_SIZE * (n - 1) + 3
