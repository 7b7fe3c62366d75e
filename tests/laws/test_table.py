"""Stiffness: a number, or a monotone table with straight ends."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

from wm_drake.elements.layouts import packed_stiffness
from wm_drake.laws.table import packed_size, stiffness_force
from wm_drake.parameters.elements import ForceTable, TorqueTable

PROGRESSIVE = ForceTable(
    displacement=(-0.02, -0.012, -0.008, 0.008, 0.012, 0.03),  # m
    force=(-90.0, -20.0, 0.0, 0.0, 25.0, 160.0),  # N; flat zero between -8 mm and 8 mm
)


@st.composite
def tables(draw):
    """Draw rising displacements from -10 mm on, never falling forces, some of them flat."""
    n = draw(st.integers(2, 7))
    steps = draw(st.lists(st.floats(1e-4, 5e-3), min_size=n - 1, max_size=n - 1))  # m
    # N
    rises = draw(st.lists(st.just(0.0) | st.floats(1e-2, 50.0), min_size=n - 1, max_size=n - 1))
    x = np.concatenate([[0.0], np.cumsum(steps)]) - 0.01
    y = np.concatenate([[0.0], np.cumsum(rises)]) - 20.0
    return ForceTable(displacement=tuple(map(float, x)), force=tuple(map(float, y)))


@given(stiffness=st.floats(0.0, 1e6), x=st.floats(-1.0, 1.0))
def test_a_number_is_linear_exactly(stiffness, x):
    assert stiffness_force(x, packed_stiffness(stiffness), 0) == stiffness * x


@given(table=tables(), fraction=st.floats(0.0, 1.0))
def test_inside_a_table_is_the_monotone_cubic_of_scipy(table, fraction):
    x = table.displacement[0] + fraction * (table.displacement[-1] - table.displacement[0])
    expected = PchipInterpolator(table.displacement, table.force)(x)
    span = table.force[-1] - table.force[0]  # N
    assert stiffness_force(x, packed_stiffness(table), 0) == pytest.approx(
        expected, rel=1e-11, abs=1e-11 * span
    )


@given(table=tables(), beyond=st.floats(0.0, 1.0))
def test_outside_a_table_is_a_straight_line_with_the_slope_of_its_end(table, beyond):
    slope = PchipInterpolator(table.displacement, table.force).derivative()
    first, last = table.displacement[0], table.displacement[-1]
    below = table.force[0] - slope(first) * beyond
    above = table.force[-1] + slope(last) * beyond
    assert stiffness_force(first - beyond, packed_stiffness(table), 0) == pytest.approx(
        below, rel=1e-9, abs=1e-9
    )
    assert stiffness_force(last + beyond, packed_stiffness(table), 0) == pytest.approx(
        above, rel=1e-9, abs=1e-9
    )


@pytest.mark.parametrize("x", [-0.008, -0.0031, 0.0, 0.0079, 0.008])  # m
def test_a_flat_zero_zone_stays_zero(x):
    assert stiffness_force(x, packed_stiffness(PROGRESSIVE), 0) == 0.0


def test_force_and_slope_are_continuous_at_the_ends_of_a_flat_zone_and_of_a_table():
    for x in PROGRESSIVE.displacement:
        left, at, right = (
            stiffness_force(x + h, packed_stiffness(PROGRESSIVE), 0) for h in (-1e-7, 0.0, 1e-7)
        )
        # N; a kink of 1 N/mm would show as 1e-4 N
        assert at - left == pytest.approx(right - at, abs=1e-5)


def test_packed_stiffnesses_stand_one_after_another_in_one_array():
    torque = TorqueTable(angle=(-0.1, 0.1), torque=(-3.0, 3.0))  # rad, N m
    packed = np.concatenate(
        [[7.0], packed_stiffness(PROGRESSIVE), packed_stiffness(500.0), packed_stiffness(torque)]
    )
    number = 1 + packed_size(packed, 1)
    last = number + packed_size(packed, number)
    assert stiffness_force(0.012, packed, 1) == pytest.approx(25.0)  # N
    assert stiffness_force(0.012, packed, number) == pytest.approx(6.0)  # N
    assert stiffness_force(0.05, packed, last) == pytest.approx(1.5)  # N m
    assert last + packed_size(packed, last) == len(packed)
