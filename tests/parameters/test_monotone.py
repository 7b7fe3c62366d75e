"""Monotone cubics: those of scipy, to the bit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

from wm_drake.parameters.monotone import monotone_cubics

CURVES = {
    "two points": ((0.0, 2.0), ((1.0, 5.0),)),
    "three points, flat": ((-1.0, 0.5, 3.0), ((2.0, 2.0, 2.0), (0.0, 1.0, 1.0))),
    "free stroke": ((-2.0, -1.0, -0.3, 0.3, 1.0, 2.0), ((-13.0, -4.0, 0.0, 0.0, 4.0, 13.0),)),
    "steep end": ((0.0, 1.0, 1.1, 4.0), ((0.0, 0.1, 5.0, 5.1), (0.0, 9.0, 9.0, 10.0))),
    "falling": ((0.0, 1.0, 3.0, 4.0), ((4.0, 3.0, -1.0, -1.5), (0.0, 2.0, -2.0, 2.0))),
}


def check(x, ys):
    ours = monotone_cubics(np.array(x), np.array(ys).T)
    theirs = PchipInterpolator(x, np.array(ys).T).c[::-1]
    assert ours.shape == theirs.shape == (4, len(x) - 1, len(ys))
    np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize("name", CURVES)
def test_coefficients_are_those_of_scipy(name):
    check(*CURVES[name])


@given(st.lists(st.tuples(st.floats(0.01, 9.0), st.floats(-5.0, 5.0)), min_size=2, max_size=9))
def test_coefficients_of_any_points_are_those_of_scipy(steps):
    x, y = np.cumsum(steps, axis=0).T
    check(x, (y, -2.0 * y))
