"""Suspension spring that may go slack."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wm_drake.elements.layouts import packed_stiffness
from wm_drake.elements.spring import SLACK_TRANSITION, SpringStrutParameters
from wm_drake.laws.spring import spring_tension
from wm_drake.parameters.elements import ForceTable

K, PRELOAD, DRAWN = 8000.0, 200.0, 0.3  # N/m, N, m: free length 275 mm
FREE = DRAWN - PRELOAD / K
TAUT = K * SLACK_TRANSITION
TABLE = ForceTable(
    displacement=(-0.02, -0.008, 0.0, 0.008, 0.02), force=(-90.0, -20.0, 0.0, 20.0, 120.0)
)
HOOKS = np.zeros(3), np.array([0.0, 0.0, DRAWN])


def tension(length, taut_from=TAUT, stiffness=K, preload=PRELOAD):
    return spring_tension(length, DRAWN, preload, taut_from, (packed_stiffness(stiffness), 0))


def placed(stiffness=K, preload=PRELOAD, pushes=False):
    return SpringStrutParameters(*HOOKS, preload, packed_stiffness(stiffness), pushes)


def test_hand_values():
    assert tension(DRAWN) == PRELOAD
    assert tension(DRAWN + 0.02) == pytest.approx(360.0)
    assert tension(FREE + 0.5 * SLACK_TRANSITION) == pytest.approx(TAUT * 0.25 * 1.5)
    assert tension(FREE + SLACK_TRANSITION) == pytest.approx(TAUT)
    for length in (FREE, FREE - 0.05, 1e-3):
        assert tension(length) == pytest.approx(0.0, abs=1e-18)
        assert not np.signbit(tension(length))


@given(st.floats(0.01, 1.0))
def test_a_taut_spring_has_the_same_bits_as_one_that_pushes(length):
    pushing = tension(length, -math.inf)
    if pushing >= TAUT:
        assert tension(length) == pushing
    else:
        assert 0.0 <= tension(length) <= max(pushing, 0.0)
    assert pushing == PRELOAD + K * (length - DRAWN)


@given(st.floats(-0.02, 0.03), st.sampled_from([K, TABLE]))
def test_tension_and_stiffness_are_continuous(x, stiffness):
    """Check that the slope changes over h by no more than its largest curvature times h.

    The second derivative of the cubic is at most 4 k / transition; that of the tables is far less.
    """
    h, spring = 1e-7, placed(stiffness)
    k = spring.taut_from / SLACK_TRANSITION

    def at(length):
        return tension(length, spring.taut_from, stiffness)

    length = DRAWN + x
    slope = (at(length + h) - at(length - h)) / (2.0 * h)
    later = (at(length + 3.0 * h) - at(length + h)) / (2.0 * h)
    steepest = 1.3334 * (K if stiffness == K else 1e4)
    assert -1e-3 <= slope <= steepest
    assert abs(later - slope) <= 2.0 * h * (4.0 * k / SLACK_TRANSITION + 1e6) * 3.0 + 1e-2


def test_free_length_and_transition_of_number_and_table():
    assert placed().free_length == pytest.approx(FREE)
    assert placed().taut_from == pytest.approx(TAUT)
    curved = placed(TABLE, 60.0)
    assert tension(curved.free_length, -math.inf, TABLE, 60.0) == pytest.approx(0.0, abs=1e-8)
    assert DRAWN - 0.02 < curved.free_length < DRAWN - 0.008
    assert tension(DRAWN, curved.taut_from, TABLE, 60.0) == 60.0


def test_a_spring_of_small_preload_is_taut_as_drawn():
    assert placed(preload=4.0).taut_from == 2.0  # half of the preload, not 8 N
    assert placed(0.0).taut_from > 0.0
    assert placed(0.0).free_length is None
    assert placed(5.0).free_length is None  # it would be negative
    assert placed(pushes=True).taut_from == -math.inf
    assert placed(preload=-400.0, pushes=True).free_length == pytest.approx(0.35)
