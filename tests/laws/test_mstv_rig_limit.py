"""The massless sponge of the machine is the limit m -> 0 of the two-mass rig of [C] Eq. (3)."""

import functools

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from wm_drake.laws.damper import mstv_damper
from wm_drake.laws.friction import mstv_friction

K1, C1, C2 = 176e3, 90.0, 400.0  # N/m, N s/m, N s/m: fit of [C]
F_MAX, EPSILON = 60.0, 1e-6  # N (assumed), m/s
AMPLITUDE, FREQUENCY = 1e-3, 3.0  # m, Hz
OMEGA = 2.0 * np.pi * FREQUENCY
THIRD_PERIOD = (2.0 + np.arange(1000) / 1000.0) / FREQUENCY  # s

# Adaptive solvers chatter or break down if asked for more: while the sponge begins to slip, MSTV friction jumps by
# f_max epsilon/|u| = 6e-3 N. These tolerances, 2e-4 N of spring and 5e-4 N of dashpot force, lie well below what is compared.
SOLVER = {"method": "LSODA", "rtol": 1e-6, "t_eval": THIRD_PERIOD}
ATOL_POSITION, ATOL_VELOCITY = 1e-9, 1e-6  # m, m/s


def driven(t):
    """Position [m] and velocity [m/s] of the driven end."""
    return AMPLITUDE * np.sin(OMEGA * t), AMPLITUDE * OMEGA * np.cos(OMEGA * t)


@functools.cache
def loop_force_of_massless_sponge():
    """Force at the driven end over the third period. [N]"""

    def damper(t, deformation):
        return mstv_damper(driven(t)[1], deformation, F_MAX, 0.0, EPSILON, K1, C1, C2)

    run = solve_ivp(lambda t, s: [damper(t, s[0])[1]], (0.0, THIRD_PERIOD[-1]), [0.0], atol=ATOL_POSITION, **SOLVER)
    return np.array([damper(t, s)[0] for t, s in zip(THIRD_PERIOD, run.y[0], strict=True)])


@functools.cache
def loop_force(mass):
    """The same with the mass of the sponge: m X'' = k1 (Y - X) + c1 (Y' - X') - c2 X' + f_fric. [N]"""

    def rig(t, s):
        (position, velocity), (x, w) = driven(t), s
        friction = mstv_friction(w, velocity - w, F_MAX, 0.0, EPSILON)
        return [w, (K1 * (position - x) + C1 * (velocity - w) - C2 * w + friction) / mass]

    run = solve_ivp(rig, (0.0, THIRD_PERIOD[-1]), [0.0, 0.0], atol=[ATOL_POSITION, ATOL_VELOCITY], **SOLVER)
    assert run.success
    position, velocity = driven(THIRD_PERIOD)
    return K1 * (position - run.y[0]) + C1 * (velocity - run.y[1])


def largest_difference(mass):
    return np.max(np.abs(loop_force(mass) - loop_force_of_massless_sponge()))


def test_the_loop_is_a_friction_loop():
    force = loop_force_of_massless_sponge()
    assert np.max(force) == pytest.approx(-np.min(force), rel=1e-3)
    assert F_MAX < np.max(force) < F_MAX + C2 * AMPLITUDE * OMEGA  # full friction, and less than all the air resistance


@pytest.mark.parametrize("mass", [0.04, 0.02])  # kg
def test_the_difference_shrinks_in_proportion_to_the_mass(mass):
    assert 1.8 < largest_difference(mass) / largest_difference(0.5 * mass) < 2.2


def test_ten_grams_of_sponge_change_the_loop_by_less_than_three_parts_in_ten_thousand():
    assert largest_difference(0.01) < 3e-4 * np.max(loop_force_of_massless_sponge())
