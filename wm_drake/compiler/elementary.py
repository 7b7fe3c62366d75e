"""Elementary functions of laws, in place of branches and of the C library: they take any scalar.

A scalar is a float, a lane of several runs (`wm_drake.compiler.lanes`), or one of automatic
differentiation. Compiled, sine and cosine are polynomials without a branch, to the last bit or two
of the C library's, so that lanes can carry them and every machine gives the same digits;
interpreted, they are numpy's.
"""

import numpy as np
from numba.extending import overload

from wm_drake.compiler.compilation import law
from wm_drake.compiler.lanes import (
    WIDTH,
    LanesType,
    MaskType,
    lanes_all,
    lanes_any,
    lanes_floor,
    lanes_select,
    lanes_sqrt,
    number_array,
)


def where(condition, a, b):
    """Return `a` where the condition holds, else `b`. Both are computed; either may be NaN."""
    return a if condition else b


@overload(where)
def _compiled_where(condition, a, b):
    if isinstance(condition, MaskType):
        return lambda condition, a, b: lanes_select(condition, a, b)
    return lambda condition, a, b: a if condition else b


def anywhere(condition):
    """Return whether the condition holds for some lane: to skip a costly alternative of `where`."""
    return condition


@overload(anywhere)
def _compiled_anywhere(condition):
    if isinstance(condition, MaskType):
        return lambda condition: lanes_any(condition)
    return lambda condition: condition


def everywhere(condition):
    """Return whether the condition holds for all lanes."""
    return condition


@overload(everywhere)
def _compiled_everywhere(condition):
    if isinstance(condition, MaskType):
        return lambda condition: lanes_all(condition)
    return lambda condition: condition


def sqrt(x):
    """Return the square root; NaN below zero."""
    return np.sqrt(x)


@overload(sqrt)
def _compiled_sqrt(x):
    if isinstance(x, LanesType):
        return lambda x: lanes_sqrt(x)
    return lambda x: np.sqrt(x)


def floor(x):
    """Return the largest whole number not above x, as a float."""
    return np.floor(x)


@overload(floor)
def _compiled_floor(x):
    if isinstance(x, LanesType):
        return lambda x: lanes_floor(x)
    return lambda x: np.floor(x)


def sine_cosine(x):
    """Return sine and cosine of an angle, |x| < 1e5. [rad]"""
    return np.sin(x), np.cos(x)


@overload(sine_cosine)
def _compiled_sine_cosine(x):
    return _polynomial_sine_cosine


def _polynomial_sine_cosine(x):
    """Reduce to a quarter turn about zero, then use polynomials [Cephes library, sin.c]."""
    sine, cosine = _sine_cosine_near_zero(x)
    if anywhere(abs(x) > 0.25 * np.pi):
        turns = floor(x * (2.0 / np.pi) + 0.5)
        r = (
            (x - turns * 1.57079625129699707031) - turns * 7.54978941586159635336e-8
        ) - turns * 5.39030285815811905290e-15
        s, c = _sine_cosine_near_zero(r)  # zero turns: as before
        quarter = turns - 4.0 * floor(0.25 * turns)
        odd = turns - 2.0 * floor(0.5 * turns) > 0.5
        sine, cosine = where(odd, c, s), where(odd, s, c)
        sine = where(quarter > 1.5, -sine, sine)
        cosine = where((quarter > 0.5) & (quarter < 2.5), -cosine, cosine)
    return sine, cosine


@law
def _sine_cosine_near_zero(r):
    """Return sine and cosine from minimax polynomials, for |r| <= pi/4."""
    z = r * r
    s = 1.58962301576546568060e-10 * z - 2.50507477628578072866e-8
    s = (
        (s * z + 2.75573136213857245213e-6) * z - 1.98412698295895385996e-4
    ) * z + 8.33333333332211858878e-3
    s = r + r * z * (s * z - 1.66666666666666307295e-1)
    c = -1.13585365213876817300e-11 * z + 2.08757008419747316778e-9
    c = (
        (c * z - 2.75573141792967388112e-7) * z + 2.48015872888517045348e-5
    ) * z - 1.38888888888730564116e-3
    return s, 1.0 - 0.5 * z + z * z * (c * z + 4.16666666666665929218e-2)


def angle_of(sine, cosine):
    """Return the angle between 0 and pi from its sine, >= 0, and cosine. [rad]"""
    return np.arctan2(sine, cosine)


@overload(angle_of)
def _compiled_angle_of(sine, cosine):
    return _rational_angle_of


def _rational_angle_of(sine, cosine):
    """Reduce to tangents below 0.66, then evaluate a minimax fraction [Cephes library, atan.c]."""
    size = abs(cosine)
    steep = sine > size
    t = where(steep, size, sine) / where(steep, sine, size)
    high = t > 0.66
    x = where(high, (t - 1.0) / (t + 1.0), t)
    z = x * x
    p = (
        -8.750608600031904122785e-1 * z - 1.615753718733365076637e1
    ) * z - 7.500855792314704667340e1
    p = (p * z - 1.228866684490136173410e2) * z - 6.485021904942025371773e1
    q = (
        (z + 2.485846490142306297962e1) * z + 1.650270098316988542046e2
    ) * z + 4.328810604912902668951e2
    q = (q * z + 4.853903996359136964868e2) * z + 1.945506571482613964425e2
    first = x + x * (z * p / q) + where(high, 0.25 * np.pi, 0.0)
    half = where(steep, 0.5 * np.pi - first, first)
    return where(cosine < 0.0, np.pi - half, half)


@law
def sine_over_angle(angle_squared):
    """Return sin(x) / x from x^2, for |x| <= pi/2: power series, its next term is below 1e-17."""
    z = angle_squared
    # terms of even and of odd power apart: two short chains of operations instead of a long one
    y = z * z
    even = 1.0 / 355687428096000.0 + y * (1.0 / 51090942171709440000.0)
    even = 1.0 / 6227020800.0 + y * even
    even = 1.0 / 362880.0 + y * even
    even = 1.0 / 120.0 + y * even
    odd = 1.0 / 1307674368000.0 + y * (1.0 / 121645100408832000.0)
    odd = 1.0 / 39916800.0 + y * odd
    odd = 1.0 / 5040.0 + y * odd
    odd = 1.0 / 6.0 + y * odd
    return (1.0 + y * even) - z * odd


@law
def decay_factor(x):
    """Return exp(-x) for x >= 0 with an absolute error below 3e-8; beyond x = 64, exp(-64).

    The diagonal Pade approximant of order 2 at x / 32, squared five times: own choice. It has no
    branch, so that lanes can carry it.
    """
    y = where(x < 64.0, x, 64.0 + 0.0 * x) / 32.0
    even, odd = 12.0 + y * y, 6.0 * y
    f = (even - odd) / (even + odd)
    f = f * f
    f = f * f
    f = f * f
    f = f * f
    return f * f


def whole_number(x):
    """Return a number that counts something as an integer, also of lanes and of an AutoDiffXd.

    Laws use it for what is the same in all lanes and has no derivative: number of a law, points of
    a table.
    """
    return int(x.value() if hasattr(x, "value") else x)


@overload(whole_number)
def _compiled_whole_number(x):
    return lambda x: int(x)


def numbers(array):
    """Return an array of floats in the form that laws read fastest; any other array as it is."""
    return array


@overload(numbers)
def _compiled_numbers(array):
    return lambda array: number_array(array)


@law
def in_each_lane(array):
    """Return the numbers of an array, each in every lane; for `lane_array`."""
    copies = np.empty(len(array) * WIDTH)
    for k in range(len(array)):
        copies[k * WIDTH : (k + 1) * WIDTH] = array[k]
    return copies


@law
def rows_to_lanes(rows, begin, numbers):
    """Write `WIDTH` rows of a table, from row `begin`, side by side; past its end, the last row."""
    last = len(rows) - 1
    for k in range(rows.shape[1]):  # in this order, which the compiler makes one loop of vectors
        for lane in range(WIDTH):
            numbers[k * WIDTH + lane] = rows[min(begin + lane, last), k]


@law
def lanes_to_rows(numbers, begin, rows):
    """Write lanes back to rows of a table, the inverse of `rows_to_lanes`."""
    for k in range(rows.shape[1]):
        for lane in range(min(WIDTH, len(rows) - begin)):
            rows[begin + lane, k] = numbers[k * WIDTH + lane]
