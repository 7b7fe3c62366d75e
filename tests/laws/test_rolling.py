"""Rolling resistance: limits, symmetry, and that it gives back no more than its bristle stores."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from wm_drake.laws.rolling import rolling_bristle_rate, rolling_resistance

N, MU, X_C, V_T = 5.0, 2e-3, 1e-5, 0.01
bristles, velocities = st.floats(-1.0, 1.0), st.floats(-3.0, 3.0)


def test_a_fast_ball_meets_full_resistance_and_a_creeping_one_hangs_on_its_bristle():
    for sign in (1.0, -1.0):
        fast = rolling_resistance(N, sign * 1e4, -sign, MU, V_T)
        assert fast == pytest.approx(-sign * MU * N, rel=1e-5)
    assert rolling_resistance(N, 0.0, 0.7, MU, V_T) == pytest.approx(-MU * N * 0.7)


@given(bristles, velocities)
def test_it_is_odd_and_never_more_than_its_coefficient(z, v):
    force = rolling_resistance(N, v, z, MU, V_T)
    assert force == -rolling_resistance(N, -v, -z, MU, V_T)
    assert abs(force) <= MU * N * (1.0 + 1e-12)
    assert abs(rolling_bristle_rate(v, z, X_C, V_T)) <= 2.0 * V_T / X_C


@given(bristles, velocities)
def test_it_gives_back_no_more_than_the_bristle_stores(z, v):
    """Add the power of the force, at constant N, to the rate of mu N x_c z^2 / 2."""
    given_back = rolling_resistance(N, v, z, MU, V_T) * v
    stored = MU * N * X_C * z * rolling_bristle_rate(v, z, X_C, V_T)
    assert given_back + stored <= 1e-12


def test_a_creeping_ball_is_a_dahl_element():
    """Roll a slow way x from rest: the resistance is mu N (1 - exp(-x/x_c))."""
    slow = 1e-3 * V_T
    ends = solve_ivp(
        lambda _, z: [rolling_bristle_rate(slow, z[0], X_C, V_T)],
        (0.0, 2.0 * X_C / slow),
        [0.0],
        rtol=1e-9,
        t_eval=[X_C / slow, 2.0 * X_C / slow],
    ).y[0]
    np.testing.assert_allclose(ends, 1.0 - np.exp([-1.0, -2.0]), rtol=2e-3)
