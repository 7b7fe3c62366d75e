"""Struts side by side: what `kernel.mechanics` is written with so that those of one machine may be the lanes of a vector.

A run alone has no other runs to fill lanes with, but its struts are alike: `alone.struts_side_by_side` packs up to four
neighbours of one structure as a strut whose numbers are lanes, behind a weight of 1 for a lane in use and of 0 for an idle one.
So are its three angles. The same source takes struts and angles one after the other, as lanes of several runs; these functions
have nothing to do then.
"""

from numba.extending import overload

from wm_drake.compiler.elementary import sine_cosine
from wm_drake.compiler.lanes import (
    QUAD,
    LaneArrayType,
    LanesType,
    NumberArrayType,
    numbers_of_quad,
    put_quad_at,
    quad_at,
    sum_of_quad,
)


def _is_quads(kind):
    return isinstance(kind, LaneArrayType | LanesType) and kind.width == QUAD


def sines_of_angles(x):
    """Sine and cosine of each of the first three numbers of a state: roll, pitch, yaw."""
    return sine_cosine(x[0]), sine_cosine(x[1]), sine_cosine(x[2])


@overload(sines_of_angles)
def _compiled_sines_of_angles(x):
    if not isinstance(x, NumberArrayType):
        return sines_of_angles

    def at_once(x):  # the fourth lane goes along for nothing
        sines, cosines = sine_cosine(quad_at(x, 0))
        s, c = numbers_of_quad(sines), numbers_of_quad(cosines)
        return (s[0], c[0]), (s[1], c[1]), (s[2], c[2])

    return at_once


def together(wrench, struts, at):
    """Sum of the wrenches of the struts side by side whose packed numbers begin at `at`; that of one strut alone."""
    return wrench


@overload(together)
def _compiled_together(wrench, struts, at):
    if not _is_quads(struts):
        return lambda wrench, struts, at: wrench

    def summed(wrench, struts, at):
        weight = struts[at - 1]
        return (
            sum_of_quad(weight * wrench[0]),
            sum_of_quad(weight * wrench[1]),
            sum_of_quad(weight * wrench[2]),
            sum_of_quad(weight * wrench[3]),
            sum_of_quad(weight * wrench[4]),
            sum_of_quad(weight * wrench[5]),
        )

    return summed


def deformation_at(x, at, struts):
    """Deformation of the damper at `at` in the state; of struts side by side theirs, and what comes behind for idle lanes."""
    return x[at]


@overload(deformation_at)
def _compiled_deformation_at(x, at, struts):
    if _is_quads(struts):
        return lambda x, at, struts: quad_at(x, at)
    return lambda x, at, struts: x[at]


def write_rate(dx, at, rate):
    """Writes the rate of a deformation; of struts side by side, also where idle lanes are, to be overwritten by whose it is."""
    dx[at] = rate


@overload(write_rate)
def _compiled_write_rate(dx, at, rate):
    if _is_quads(rate) and isinstance(dx, NumberArrayType):
        return lambda dx, at, rate: put_quad_at(dx, at, rate)

    def write(dx, at, rate):
        dx[at] = rate

    return write
