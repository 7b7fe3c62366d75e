"""Four feet: weights, rigid blocks, lift-off, and the limit of turning against a linear program."""

import itertools

import numpy as np
import pytest
from scipy.optimize import brentq, linprog, nnls

from wm_drake.laws.feet import (
    least_turning_resistance,
    normal_loads,
    sliding_margin,
    tangential_loads,
    tilting_margin,
    turning_margin,
    turning_margin_bound,
)

SQUARE = (-0.25, 0.25, 0.25, -0.25), (-0.25, -0.25, 0.25, 0.25)
SKEW = (-0.31, 0.22, 0.27, -0.2), (-0.2, -0.26, 0.3, 0.21)


CORNERS = 360
INSCRIBED = np.cos(np.pi / CORNERS)


def load_at(down, x, y, feet=SQUARE):
    """Return the normal loads of a vertical load at a point."""
    return np.array(normal_loads(down, -y * down, x * down, *feet))


def test_weight_at_the_centre_is_shared_equally():
    assert load_at(400.0, 0.0, 0.0) == pytest.approx([100.0] * 4, rel=1e-14)


def test_weight_is_shared_linearly():
    """Check a corner of a square of half side s: it carries W/4 (1 +- x/s +- y/s)."""
    found = load_at(400.0, 0.1, -0.05)
    expected = [100.0 * (1 + 0.4 * i - 0.2 * j) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    assert found == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("feet", [SQUARE, SKEW])
def test_loads_are_those_of_springs_that_do_not_pull(feet):
    """Compare with non-negative least squares, equilibrium as a stiff constraint."""
    equations = np.array([np.ones(4), feet[0], feet[1]])
    rng = np.random.default_rng(3)
    lifted = 0
    for shares in rng.dirichlet(0.6 * np.ones(4), size=60):
        x, y = 400.0 * equations[1:] @ shares
        found = np.array(normal_loads(400.0, -y, x, *feet))
        assert equations @ found == pytest.approx([400.0, x, y], abs=1e-9)
        stiff = 1e5
        expected, _ = nnls(
            np.vstack([stiff * equations, np.eye(4)]),
            np.append([stiff * 400.0, stiff * x, stiff * y], np.zeros(4)),
        )
        assert found == pytest.approx(expected, abs=1e-3)
        lifted += found.min() == 0.0
    assert 10 < lifted < 60


def test_rigid_block_tips_where_the_closed_form_says():
    """Check that a force f at height h tips a block of weight W and half side s at f h = W s."""
    weight, height, s = 600.0, 0.8, 0.25
    threshold = weight * s / height
    for share in (0.5, 0.99, 1.01):
        f = share * threshold
        margin = tilting_margin(weight, 0.0, f * height, *SQUARE)
        assert margin == pytest.approx(weight * s * (1.0 - share), abs=1e-9)
        loads = normal_loads(weight, 0.0, f * height, *SQUARE)
        assert sum(loads) == pytest.approx(weight)
        assert min(loads) >= 0.0
    assert normal_loads(weight, 0.0, threshold, *SQUARE) != pytest.approx([150.0] * 4)
    diagonal = threshold / np.sqrt(2.0)
    m = diagonal * height
    assert tilting_margin(weight, -m, m, *SQUARE) == pytest.approx(weight * s - m)


def test_lifted_cabinet_has_no_loads():
    assert normal_loads(-10.0, 0.0, 0.0, *SQUARE) == (0.0, 0.0, 0.0, 0.0)
    assert tilting_margin(-10.0, 0.0, 0.0, *SQUARE) < 0.0
    assert sliding_margin(3.0, 4.0, (0.0,) * 4) == -5.0
    assert turning_margin(3.0, 4.0, 7.0, (0.0,) * 4, *SQUARE) == -7.0


def test_rigid_block_slides_at_mu_w():
    holding = (0.4 * 150.0,) * 4
    assert sliding_margin(0.6 * 200.0, 0.8 * 200.0, holding) == pytest.approx(40.0)


def test_square_of_feet_turns_at_mu_w_r():
    mu, weight, r = 0.4, 600.0, 0.25 * np.sqrt(2.0)
    holding = (mu * weight / 4.0,) * 4
    full = mu * weight * r
    assert turning_margin(0.0, 0.0, 0.0, holding, *SQUARE) == pytest.approx(full, rel=1e-12)
    assert turning_margin(0.0, 0.0, 60.0, holding, *SQUARE) == pytest.approx(full - 60.0)
    assert turning_margin(0.0, 0.0, -60.0, holding, *SQUARE) == pytest.approx(full - 60.0)


def test_an_eccentric_force_turns_before_it_slides():
    """Check the theorem of Papadopoulos and Papadimitriou: rotational slip comes first."""
    holding = (60.0,) * 4
    first = brentq(lambda f: turning_margin(0.0, f, 0.1 * f, holding, *SQUARE), 1.0, 239.0)
    assert first < 0.95 * 240.0
    assert sliding_margin(0.0, first, holding) > 12.0
    assert brute_force([0.0, first], holding, *SQUARE) == pytest.approx(0.1 * first, abs=0.01)


def test_two_feet_in_closed_form():
    """Load two feet only: a foot is then the centre, with force f across at one end, w there."""
    holding = (50.0, 50.0, 0.0, 0.0)
    # two feet at distance 0.5: pure moment 50 * 0.5; with a force along the line the limit shrinks
    assert least_turning_resistance(0.0, 0.0, holding, *SQUARE) == pytest.approx(25.0)
    # along the line each foot takes f/2, the rest is across: 2 * sqrt(50^2 - 30^2) * 0.25 = 20,
    # and the force of 60 N acts at y = -0.25: moment 0.25 * 60
    found = least_turning_resistance(60.0, 0.0, holding, *SQUARE)
    assert found == pytest.approx(20.0 + 15.0, rel=1e-9)


def brute_force(f, holding, x, y):
    """Return the largest moment that friction can hold beside a force, by a linear program.

    The circle of friction of each foot is replaced by an inscribed polygon, so the result is a
    lower bound; with `holding` larger by 1 / `INSCRIBED` it is an upper bound.
    """
    corners = CORNERS
    angles = 2.0 * np.pi * np.arange(corners) / corners
    t = np.array([np.cos(angles), np.sin(angles)])
    columns, gains = [], []
    for i in range(4):
        columns.append(holding[i] * t)
        gains.append(holding[i] * (x[i] * t[1] - y[i] * t[0]))
    equal = np.hstack(columns)
    at_most = np.kron(np.eye(4), np.ones(corners))
    found = linprog(
        -np.concatenate(gains), A_ub=at_most, b_ub=np.ones(4), A_eq=equal, b_eq=f, method="highs"
    )
    return -found.fun


@pytest.mark.parametrize("feet", [SQUARE, SKEW])
def test_limit_of_turning_is_that_of_the_static_theorem(feet):
    """Check that the least upper bound by motions is the greatest lower bound by forces."""
    rng = np.random.default_rng(8)
    for shares in rng.dirichlet(np.ones(4), size=3):
        holding = tuple(240.0 * shares)
        for size, angle in itertools.product((0.0, 0.4, 0.9, 0.99), rng.uniform(0.0, 6.28, 1)):
            f = 240.0 * size * np.array([np.cos(angle), np.sin(angle)])
            low, high = (
                brute_force(f, [w / radius for w in holding], *feet) for radius in (1.0, INSCRIBED)
            )
            found = least_turning_resistance(*f, holding, *feet)
            assert low - 1e-6 <= found <= high + 1e-6
            assert high - low < 0.1
            for moment in (low - 3.0, low + 1.0):
                margin = turning_margin(*f, moment, holding, *feet)
                assert turning_margin_bound(*f, moment, holding, *feet) <= margin + 1e-9


def test_margin_is_continuous_where_sliding_begins():
    holding = (70.0, 60.0, 50.0, 60.0)
    just = turning_margin(239.99999, 0.0, 5.0, holding, *SKEW)
    beyond = turning_margin(240.00001, 0.0, 5.0, holding, *SKEW)
    assert just == pytest.approx(beyond, abs=0.05)


def test_tangential_loads_balance_in_the_symmetric_case():
    loads = (100.0,) * 4
    assert tangential_loads(30.0, 40.0, 0.0, loads, *SQUARE) == pytest.approx([12.5] * 4)
    r = 0.25 * np.sqrt(2.0)
    assert tangential_loads(0.0, 0.0, 10.0, loads, *SQUARE) == pytest.approx([10.0 / 4.0 / r] * 4)
    assert tangential_loads(3.0, 4.0, 0.0, (0.0, 50.0, 50.0, 50.0), *SQUARE)[0] == 0.0
