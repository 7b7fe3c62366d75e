"""Geometry of a massless strut."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from wm_drake.elements.motion import TubMotion
from wm_drake.elements.strut import strut_line, transverse, wrench_at_origin

vectors = st.tuples(*[st.floats(-3.0, 3.0)] * 3)


def turned(a, rotation_vector):
    return Rotation.from_rotvec(rotation_vector).apply(a)


def test_strut_line_gives_length_direction_and_their_rates():
    # m
    arm, p_WT, p_WH = (
        np.array([0.2, -0.1, -0.25]),
        np.array([0.01, -0.02, 0.03]),
        np.array([0.3, -0.1, -0.6]),
    )
    w, v = np.array([0.3, -0.2, 0.5]), np.array([0.4, 0.1, -0.3])  # rad/s, m/s
    length, rate, direction, v_A, inverse_length = strut_line(
        TubMotion((), tuple(p_WT), tuple(w), tuple(v)), tuple(arm), tuple(p_WH)
    )
    line = p_WT + arm - p_WH
    assert length == pytest.approx(np.linalg.norm(line))
    assert inverse_length * length == pytest.approx(1.0, rel=1e-15)
    assert direction == pytest.approx(line / np.linalg.norm(line))
    assert v_A == pytest.approx(v + np.cross(w, arm))
    h = 1e-6  # s

    def length_at(t):
        return np.linalg.norm(p_WT + v * t + turned(arm, w * t) - p_WH)

    assert rate == pytest.approx((length_at(h) - length_at(-h)) / (2.0 * h), rel=1e-8)


def test_wrench_at_origin_is_moment_about_to_then_force():
    arm, force, moment = (0.1, 0.2, -0.3), (5.0, -7.0, 11.0), (0.5, 0.6, 0.7)  # m, N, N m
    assert wrench_at_origin(arm, force, moment) == pytest.approx(
        (*(np.cross(arm, force) + moment), *force)
    )


@given(a=vectors, b=vectors.filter(lambda b: np.linalg.norm(b) > 0.1))
def test_transverse_part_and_part_along_make_the_vector(a, b):
    e = np.asarray(b) / np.linalg.norm(b)
    across = np.array(transverse(a, tuple(e)))
    assert across @ e == pytest.approx(0.0, abs=1e-14)
    assert across + (np.array(a) @ e) * e == pytest.approx(a)
