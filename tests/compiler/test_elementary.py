"""Functions that any scalar can carry, against numpy's; lanes against floats, bit for bit."""

import numba
import numpy as np
import pytest

from wm_drake.compiler.elementary import (
    angle_of,
    anywhere,
    floor,
    sine_cosine,
    sine_over_angle,
    sqrt,
    where,
)
from wm_drake.compiler.lanes import WIDTH, align_stack, lane_array

ULP = np.finfo(float).eps
compiled = numba.njit(error_model="numpy")


@compiled
def sine_cosine_of(x):
    return sine_cosine(x)


@compiled
def angle_from(sine, cosine):
    return angle_of(sine, cosine)


# rad; a quarter of pi is 0.78540
@pytest.mark.parametrize("reach", [1e-8, 0.5, 0.7853, 0.7855, 2.0, 100.0, 5e4])
def test_compiled_sine_and_cosine_are_numpys_to_two_bits(reach):
    for x in np.linspace(-reach, reach, 4001):
        assert sine_cosine_of(x) == pytest.approx((np.sin(x), np.cos(x)), rel=0.0, abs=2.0 * ULP)
        assert sine_cosine_of(-x) == (-sine_cosine_of(x)[0], sine_cosine_of(x)[1])


@pytest.mark.parametrize(
    "angle",
    [0.0, 1e-9, 0.3, 0.583, 0.584, 0.7853, 0.7855, 1.0, 1.5707, 1.5709, 2.0, 3.0, 3.14159, np.pi],
)
def test_compiled_angle_is_numpys_to_two_bits(angle):
    sine, cosine = np.sin(angle), np.cos(angle)
    assert angle_from(sine, cosine) == pytest.approx(np.arctan2(sine, cosine), rel=2.0 * ULP)


def test_sine_over_angle_is_exact_to_rounding_up_to_a_right_angle():
    x = np.linspace(1e-6, np.pi / 2, 2001)
    found = np.array([sine_over_angle(value * value) for value in x])
    np.testing.assert_allclose(found, np.sin(x) / x, rtol=3.0 * ULP)
    assert sine_over_angle(0.0) == 1.0


@pytest.mark.parametrize("function", [sine_cosine, floor, sqrt])
def test_interpreted_they_are_numpys(function):
    by_numpy = {
        "sine_cosine": lambda x: (np.sin(x), np.cos(x)),
        "floor": np.floor,
        "sqrt": np.sqrt,
    }[function.__name__]
    assert function(2.7) == by_numpy(2.7)


@compiled
def everything(x, y, out):
    """Return each operation that lanes know, one result a line."""
    a, b = x[0], x[1]
    out[0], out[1], out[2], out[3], out[4] = a + b, a - b, a * b, a / b, -a
    out[5], out[6], out[7] = abs(a), floor(a), sqrt(abs(a))
    out[8] = where(a < b, a, b) + where(a <= b, 1.0, 2.0) * where((a > b) & (a >= 0.5), a, 3.0)
    out[9] = where((a > 1.0) | (b > 1.0), 2.0 + a, 3 * b)
    out[10], out[11] = sine_cosine(a)
    out[12] = angle_of(abs(a), b)
    total = 0.0
    for i in range(int(y[0])):  # the same in all lanes
        total = total + a * i
    if anywhere(a > 2.0):
        total = where(a > 2.0, -total, total)
    out[13] = total
    out[14] = sine_over_angle(0.1 * abs(a))


@compiled
def everything_in_lanes(x, y, out):
    align_stack()
    everything(lane_array(x), lane_array(y), lane_array(out))


@pytest.mark.parametrize("seed", range(5))
def test_lanes_are_floats_side_by_side(seed):
    x = np.random.default_rng(seed).normal(0.0, 1.5, (2, WIDTH))
    x[:, 0] = (0.0, -0.0)
    x[0, 1] = np.nan
    x[0, 2] = np.inf
    y = np.full((1, WIDTH), 3.0)
    out = np.empty((15, WIDTH))
    everything_in_lanes(x.ravel(), y.ravel(), out.ravel())
    for lane in range(WIDTH):
        alone = np.empty(15)
        everything(x[:, lane].copy(), y[:, lane].copy(), alone)
        np.testing.assert_array_equal(out[:, lane], alone)


def test_a_mixture_the_compiler_cannot_carry_is_refused():
    @compiled
    def add_mask(x):
        lanes = lane_array(x)
        return int(lanes[0] + (lanes[0] < 1.0))

    with pytest.raises(numba.TypingError):
        add_mask(np.zeros(WIDTH))

    @compiled
    def other_layout(x):
        return int(lane_array(x)[0])

    with pytest.raises(numba.TypingError):
        other_layout(np.zeros((WIDTH, 2))[:, 0])
