"""Rotations of nine scalars and their rotation vectors, against Drake."""

import numpy as np
import pytest
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RollPitchYaw, RotationMatrix

from wm_drake.compiler.vectors import (
    angle_over_sine,
    compose,
    cross,
    dot,
    moment_from_rotation_vector,
    rotate,
    rotate_back,
    rotation_from_rpy,
    rotation_vector,
    rotation_vector_coefficient,
    rotation_vector_rate,
    transpose,
)

ANGLES = [1e-9, 1e-6, 1e-3, 0.00999, 0.01001, 0.0999, 0.1001, 0.5, 1.5, 2.0, 3.0]  # rad


def random_axis(rng):
    axis = rng.normal(size=3)
    return axis / np.linalg.norm(axis)


def matrix_of(r):
    """Return the rotation matrix of a rotation vector."""
    angle = np.linalg.norm(r)
    return AngleAxis(angle, r / angle).rotation()


def coefficient_of(r):
    return rotation_vector_coefficient(float(np.dot(r, r)))


def rows(matrix):
    return tuple(map(float, matrix.ravel()))


def test_rotation_from_rpy_is_that_of_drake():
    rng = np.random.default_rng(1)
    for rpy in rng.uniform(-3.0, 3.0, (50, 3)):  # rad
        np.testing.assert_allclose(
            rotation_from_rpy(*rpy),
            RotationMatrix(RollPitchYaw(rpy)).matrix().ravel(),
            rtol=0.0,
            atol=1e-15,
        )


def test_products_of_vectors_and_rotations_are_those_of_numpy():
    rng = np.random.default_rng(2)
    for _ in range(20):
        a, b = rng.normal(size=(2, 3))
        A, B = (matrix_of(r) for r in rng.normal(size=(2, 3)))
        assert dot(tuple(a), tuple(b)) == pytest.approx(a @ b)
        np.testing.assert_allclose(cross(tuple(a), tuple(b)), np.cross(a, b), atol=1e-15)
        np.testing.assert_allclose(rotate(rows(A), tuple(a)), A @ a, atol=1e-15)
        np.testing.assert_allclose(rotate_back(rows(A), tuple(a)), A.T @ a, atol=1e-15)
        np.testing.assert_allclose(compose(rows(A), rows(B)), (A @ B).ravel(), atol=1e-15)
        assert transpose(rows(A)) == rows(A.T)


@pytest.mark.parametrize("angle", ANGLES)
def test_rotation_vector_is_axis_times_angle(angle):
    rng = np.random.default_rng(3)
    for axis in (*np.eye(3), *(random_axis(rng) for _ in range(10))):
        r = rotation_vector(rows(AngleAxis(angle, axis).rotation()))
        np.testing.assert_allclose(
            r, angle * axis, rtol=0.0, atol=2e-15 / np.sin(angle) * angle + 1e-16
        )


def test_rotation_vector_of_no_rotation_is_zero():
    assert rotation_vector(rows(np.eye(3))) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("angle", [1e-3, 0.05, 0.15, 1.0, 2.5])  # rad
def test_rotation_vector_rate_is_the_finite_difference_under_an_angular_velocity(angle):
    rng = np.random.default_rng(4)
    h = 1e-5  # s
    for _ in range(10):
        r, w = angle * random_axis(rng), rng.normal(size=3)  # rad, rad/s, both in the fixed frame
        R = matrix_of(r)
        after, before = (
            np.array(rotation_vector(rows(matrix_of(step * w) @ R))) for step in (h, -h)
        )
        np.testing.assert_allclose(
            rotation_vector_rate(tuple(r), tuple(w), coefficient_of(r)),
            (after - before) / (2.0 * h),
            rtol=0.0,
            atol=2e-8,
        )


@pytest.mark.parametrize("angle", [0.0, *ANGLES])
def test_moment_does_the_work_of_the_torque_on_the_rotation_vector(angle):
    rng = np.random.default_rng(5)
    for _ in range(10):
        r, w, tau = (
            tuple(angle * random_axis(rng)),
            tuple(rng.normal(size=3)),
            tuple(rng.normal(size=3)),
        )
        k = coefficient_of(r)
        assert dot(moment_from_rotation_vector(r, tau, k), w) == pytest.approx(
            dot(tau, rotation_vector_rate(r, w, k)), abs=1e-13
        )


def test_rotation_about_one_fixed_axis_is_plain():
    r, w = (0.0, 0.7, 0.0), (0.0, 2.0, 0.0)  # rad, rad/s
    k = coefficient_of(r)
    assert rotation_vector_rate(r, w, k) == pytest.approx(w)
    assert moment_from_rotation_vector(r, w, k) == pytest.approx(w)


# rad; series below sin = 0.1
@pytest.mark.parametrize("angle", [1e-4, 0.01, 0.05, 0.0999, 0.1001674, 0.1001675, 0.11])
def test_series_of_angle_over_sine_meets_its_closed_form(angle):
    sine, cosine = np.sin(angle), np.cos(angle)
    assert angle_over_sine(sine * sine, cosine) == pytest.approx(angle / sine, rel=1e-15, abs=0.0)


# rad; series below 0.1
@pytest.mark.parametrize("angle", [0.03, 0.0999, 0.0999999, 0.1000001, 0.11])
def test_series_of_the_rotation_vector_coefficient_meets_its_closed_form(angle):
    closed = (1.0 - 0.5 * angle / np.tan(0.5 * angle)) / angle**2
    rounding = 3e-16 / angle**2  # of the closed form: it subtracts from one
    assert rotation_vector_coefficient(angle * angle) == pytest.approx(
        closed, rel=0.0, abs=rounding
    )
    assert rotation_vector_coefficient(0.0) == 1.0 / 12.0
