"""Branches of rubber: Dahl friction in closed form, loops, the complex stiffness of a Maxwell element."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from wm_drake.compiler.compilation import generic
from wm_drake.compiler.elementary import decay_factor
from wm_drake.laws.rubber import (
    dahl_after_path,
    dahl_after_step,
    dahl_rate,
    maxwell_after_step,
    maxwell_rate,
)

X_C = 1.5e-3  # m


def test_the_decay_factor_is_the_exponential_function():
    x = np.concatenate([np.logspace(-9, 0, 50), np.linspace(1.0, 100.0, 100)])
    found = np.array([decay_factor(each) for each in x])
    np.testing.assert_allclose(found, np.exp(-np.minimum(x, 64.0)), atol=3e-8)
    np.testing.assert_allclose(
        (1.0 - found)[x < 1.0], -np.expm1(-x[x < 1.0]), rtol=1e-7, atol=1e-14
    )
    assert generic(decay_factor)(0.7) == decay_factor(0.7)


@given(st.floats(-0.99, 0.99), st.floats(-5.0, 5.0))
def test_the_path_in_closed_form_solves_the_differential_equation(start, path):
    """Integrate dz/dx = 1 - sgn(dx) z / x_c over a path without reversal, at any speed."""
    end = dahl_after_path(start * X_C, path * X_C, X_C)
    sign = np.sign(path)
    expected = sign + (start - sign) * np.exp(-abs(path))
    assert end / X_C == pytest.approx(expected, abs=1e-7)
    assert abs(end) <= X_C
    # twice half the path is the path, and the rate is the slope of it
    half = dahl_after_path(start * X_C, 0.5 * path * X_C, X_C)
    assert dahl_after_path(half, 0.5 * path * X_C, X_C) == pytest.approx(end, abs=1e-7 * X_C)
    slope = (dahl_after_path(start * X_C, 1e-7, X_C) - start * X_C) / 1e-7
    assert dahl_rate(start * X_C, 1.0, X_C) == pytest.approx(slope, abs=1e-3)


def test_a_loop_has_the_force_and_the_area_of_its_closed_form():
    """Check F(A) = F_max tanh(A / x_c), area 4 F_max (A - x_c tanh(A / x_c)) at any frequency."""
    amplitude, force = 4e-3, 25.0
    x = amplitude * np.sin(np.linspace(0.0, 6.0 * np.pi, 6001))
    z = np.zeros_like(x)
    for k in range(1, len(x)):
        z[k] = dahl_after_path(z[k - 1], x[k] - x[k - 1], X_C)
    f = force * z / X_C
    last = slice(4000, 6001)
    corner = force * np.tanh(amplitude / X_C)
    assert np.max(f[last]) == pytest.approx(corner, rel=1e-5)
    area = np.trapezoid(f[last], x[last])
    assert area == pytest.approx(4.0 * (force * amplitude - X_C * corner), rel=1e-4)


@given(
    st.floats(-0.9, 0.9),
    st.floats(-2.0, 2.0),
    st.floats(-2.0, 2.0),
    st.sampled_from([0.2, 1.0, 30.0]),
)
def test_a_step_follows_a_linear_rate_through_a_reversal(start, first, last, length):
    """Solve the plain equation by scipy, at steps too long for an explicit scheme (length 30)."""
    h = length * X_C
    first, last = first, last  # m/s
    expected = solve_ivp(
        lambda t, z: dahl_rate(z[0], first + (last - first) * t / h, X_C),
        (0.0, h), [start * X_C], method="LSODA", rtol=1e-9, atol=1e-13, max_step=h / 200,
    ).y[0, -1]  # fmt: skip
    path = 0.5 * h * (first + last)
    found = dahl_after_step(start * X_C, path, last, h, X_C)
    assert found == pytest.approx(expected, abs=1e-5 * X_C)


def test_friction_takes_energy_out_whatever_the_motion():
    rng = np.random.default_rng(4)
    z, work = 0.0, 0.0
    for step in rng.uniform(-3e-3, 3e-3, 2000):
        for part in np.full(20, step / 20):
            moved = dahl_after_path(z, part, X_C)
            work += 0.5 * (z + moved) / X_C * part
            z = moved
        assert work - 0.5 * z**2 / X_C > -1e-9  # what it stores, it got


def test_a_maxwell_element_has_its_complex_stiffness():
    k, c, w = 3e3, 40.0, 30.0  # N/m, N s/m, rad/s
    h = 1e-4
    t = np.arange(0.0, 2.0, h)
    z = np.zeros(len(t))
    for n in range(len(t) - 1):
        rates = [w * np.cos(w * (t[n] + part * h)) for part in (0.0, 0.5, 1.0)]
        z[n + 1] = maxwell_after_step(z[n], *rates, h, k, c)
    whole = t > t[-1] - 2.0 * np.pi / w
    in_phase, ahead = (
        2.0 * np.mean(k * z[whole] * wave(w * t[whole])) for wave in (np.sin, np.cos)
    )
    tau = c / k
    assert in_phase == pytest.approx(k * (w * tau) ** 2 / (1.0 + (w * tau) ** 2), rel=2e-3)
    assert ahead == pytest.approx(c * w / (1.0 + (w * tau) ** 2), rel=2e-3)
    assert maxwell_rate(1e-3, 0.0, k, c) == pytest.approx(-1e-3 * k / c)
