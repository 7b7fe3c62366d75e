"""Stiffness: a number, or a table interpolated monotonically.

A packed stiffness (`CURVE` in a packed layout) is either ``[0, k]`` or ``[n, x_1, y_1, a_1, b_1,
c_1, x_2, .., c_(n-1), x_n, a_n]``: for each piece between two of the n points its begin and the
cubic y + a t + b t^2 + c t^3 in t = x - x_i, then the last point and the slope there. The cubics
are scipy's PCHIP (`wm_drake.elements.layouts.packed_stiffness`), which keeps the curve monotone
between monotone points.
"""

import numpy as np

from wm_drake.compiler.compilation import law
from wm_drake.compiler.elementary import anywhere, everywhere, where, whole_number
from wm_drake.compiler.packed import SCALAR, PackedLayout, PackedPart

_PIECE = PackedLayout("Piece", begin=SCALAR, y=SCALAR, a=SCALAR, b=SCALAR, c=SCALAR)
"""A piece of a table: its begin and its four coefficients, the constant first."""
_END = PackedLayout("End", x=SCALAR, slope=SCALAR)
"""The last point of a table, behind its pieces."""

read_piece, read_end = _PIECE.read, _END.read
PIECE_SIZE, END_SIZE = _PIECE.fixed_size, _END.fixed_size


@law
def stiffness_force(x, packed, at):
    """Return the elastic force (or torque) at a displacement (or angle).

    Linear: k x. Table: a cubic between two points [Fritsch and Carlson 1980, through scipy], a
    straight line with the slope of the end point beyond them.

    Args:
        x: Displacement. [m or rad]
        packed: Array that holds the packed stiffness. [N/m; or m and N, or rad and N m]
        at: Index in `packed` where it begins.

    Returns:
        Force in the direction of x (the element resists with its negative). [N or N m]
    """
    n = whole_number(packed[at])
    if n == 0:
        return packed[at + 1] * x
    first = at + 1
    last = first + PIECE_SIZE * (n - 1)
    lower, end = read_piece(packed, first), read_end(packed, last)
    before, after = x < lower.begin, x > end.x
    inside = where(before, lower.begin, where(after, end.x, x))
    # motions stay near zero: pieces that all lanes have behind them cost a comparison
    common = 0
    while common < n - 2 and everywhere(inside >= packed[first + PIECE_SIZE * (common + 1)]):
        common += 1
    begin, y, a, b, c = read_piece(packed, first + PIECE_SIZE * common)
    for i in range(common + 1, n - 1):
        beyond = inside >= packed[first + PIECE_SIZE * i]
        if not anywhere(beyond):
            break
        piece = read_piece(packed, first + PIECE_SIZE * i)
        begin, y = where(beyond, piece.begin, begin), where(beyond, piece.y, y)
        a, b, c = where(beyond, piece.a, a), where(beyond, piece.b, b), where(beyond, piece.c, c)
    t = inside - begin
    force = y + t * (a + t * (b + t * c))
    if anywhere(before | after):
        force = force + where(before, lower.a, end.slope) * (x - inside)
    return force


@law
def packed_size(packed, at):
    """Return the number of entries of the packed stiffness that begins at index `at`."""
    n = whole_number(packed[at])
    return 2 if n == 0 else packed_table_size(n)


@law
def packed_table_size(n):
    """Return the number of entries of a packed table of n points."""
    return 1 + PIECE_SIZE * (n - 1) + END_SIZE


def pack_number(stiffness):
    """Return a packed stiffness that is a number. [N/m or N m/rad]"""
    return np.array([0.0, stiffness])


def pack_table(x, cubics, end_slope):
    """Return a packed table.

    Args:
        x: Abscissas (n,).
        cubics: Coefficients (4, n - 1) of the piece that begins at each but the last, the constant
            first.
        end_slope: Slope at the last point.
    """
    pieces = _PIECE.pack_rows(begin=x[:-1], **dict(zip("yabc", cubics, strict=True)))
    return np.concatenate([[len(x)], pieces.ravel(), _END.pack(x=x[-1], slope=end_slope)])


def table_range(packed, at):
    """Return the first and last abscissa of a packed table; infinite for a number. [m or rad]"""
    n = whole_number(packed[at])
    if n == 0:
        return -np.inf, np.inf
    last = at + 1 + PIECE_SIZE * (n - 1)
    return float(read_piece(packed, at + 1).begin), float(read_end(packed, last).x)


def slope_at_zero(packed, at):
    """Return the slope of a packed stiffness at displacement 0. [N/m or N m/rad]"""
    n = whole_number(packed[at])
    if n == 0:
        return packed[at + 1]
    pieces = [read_piece.py_func(packed, at + 1 + PIECE_SIZE * i) for i in range(n - 1)]
    end = read_end.py_func(packed, at + 1 + PIECE_SIZE * (n - 1))
    if end.x < 0.0:
        return end.slope
    if pieces[0].begin > 0.0:
        return pieces[0].a
    piece = [piece for piece in pieces if piece.begin <= 0.0][-1]
    t = -piece.begin
    return piece.a + t * (2.0 * piece.b + t * 3.0 * piece.c)


def scale_to(packed, at, slope):
    """Set a packed stiffness that is a number; scale a table until its slope at 0 is this one.

    Args:
        packed, at: Array that is changed, and where the stiffness begins.
        slope: [N/m or N m/rad]

    Raises:
        ZeroDivisionError: a table has no slope at 0.
    """
    n = whole_number(packed[at])
    if n == 0:
        packed[at + 1] = slope
        return
    factor = slope / slope_at_zero(packed, at)
    last = at + 1 + PIECE_SIZE * (n - 1)
    of_pieces = [k for k in range(at + 1, last) if (k - at - 1) % PIECE_SIZE]  # all but `begin`
    for k in (*of_pieces, last + 1):
        packed[k] = packed[k] * factor


def number_of_points(packed, at):
    """Return how many points a packed stiffness has, 0 for a number, in a list."""
    return [whole_number(packed[at])]


CURVE = PackedPart(packed_size, number_of_points)
"""Kind of a field that holds a packed stiffness."""
