"""Order maps and frequency maps: planted components are found with their amplitudes."""

import numpy as np
import pytest
from scipy.signal import ShortTimeFFT
from scipy.signal.windows import hann

from wm_drake.simulation.orders import frequency_map, order_map

TIME = 5e-3 * np.arange(14001)
ACCELERATION = 7.0 * np.pi / 30.0
"""7 rpm/s, as in the run-up of [B]. [rad/s^2]"""


@pytest.fixture(scope="module")
def angle():
    """Return the angle of a run-up to 400 rpm that then stays there for 13 s. [rad]"""
    end = 400.0 / 7.0
    run_up = 0.5 * ACCELERATION * np.minimum(TIME, end) ** 2
    return run_up + ACCELERATION * end * np.maximum(TIME - end, 0.0)


def test_planted_orders_are_found(angle):
    signal = 5.0 + 3.0 * np.cos(angle + 0.3) + 0.4 * np.sin(2.5 * angle)
    found = order_map(signal, angle, TIME, period=1.0)
    assert found.dims == ("time", "order")
    np.testing.assert_allclose(found.sel(order=1.0), 3.0, rtol=0.01)
    np.testing.assert_allclose(found.sel(order=2.5), 0.4, rtol=0.01)
    np.testing.assert_allclose(found.sel(order=[1.75, 4.0, 6.0]), 0.0, atol=2e-3)


def test_columns_are_independent_and_keep_their_order(angle):
    both = np.column_stack([np.cos(angle), 7.0 * np.cos(3.0 * angle)])
    found = order_map(both, angle, TIME, period=2.0)
    assert found.dims == ("time", "order", "signal")
    for column in range(2):
        alone = order_map(both[:, column], angle, TIME, period=2.0)
        np.testing.assert_allclose(found.isel(signal=column), alone, atol=1e-12)


def test_speed_belongs_to_the_centre_of_each_window(angle):
    found = order_map(np.cos(angle), angle, TIME, highest=1.0)
    expected = ACCELERATION * np.minimum(found.time, 400.0 / 7.0)
    np.testing.assert_allclose(found.speed, expected, rtol=1e-3)
    # half a window, four revolutions, passes before the first centre and after the last
    assert found.time[0] == pytest.approx(np.sqrt(8.0 * np.pi * 2.0 / ACCELERATION), abs=0.25)
    assert found.time[-1] == pytest.approx(70.0 - 4.0 * 60.0 / 400.0, abs=0.25)


def test_amplitude_between_two_orders_reads_at_most_three_percent_low(angle):
    found = order_map(np.cos((1.0 + 1.0 / 32.0) * angle), angle, TIME, highest=2.0)
    largest = found.max("order")
    assert float(largest.min()) > 0.965
    assert float(largest.max()) < 0.98


def test_backward_turning_drum_has_the_same_orders(angle):
    signal = np.cos(2.0 * angle)
    np.testing.assert_allclose(
        order_map(signal, -angle, TIME, period=2.0),
        order_map(signal, angle, TIME, period=2.0),
        atol=1e-12,
    )


def test_orders_above_half_the_sampling_rate_are_nan(angle):
    found = order_map(np.cos(angle), angle, TIME, highest=20.0, period=4.0)
    fast = found.sel(time=slice(60.0, None))  # 400 rpm: 30 samples a revolution
    assert np.isfinite(fast.sel(order=slice(None, 14.9))).all()
    assert np.isnan(fast.sel(order=slice(15.1, None))).all()


def test_samples_that_are_farther_apart_than_a_window_give_nan():
    angle = 20.0 * np.pi * np.arange(2001)
    assert np.isnan(order_map(np.ones(2001), angle, TIME[:2001])).all()


def test_drum_at_rest_and_short_records_give_no_windows():
    still = order_map(np.ones(len(TIME)), np.zeros(len(TIME)), TIME)
    assert still.sizes["time"] == 0
    assert order_map(np.ones(3), np.arange(3.0), TIME[:3]).sizes["time"] == 0
    assert order_map(np.empty(0), np.empty(0), np.empty(0)).sizes["time"] == 0
    assert frequency_map(np.ones(100), TIME[:100]).sizes["time"] == 0
    assert frequency_map(np.empty(0), np.empty(0)).sizes["time"] == 0


def test_pause_of_the_drum_is_left_out(angle):
    """Turn the drum, rest for 20 s, and turn on."""
    rest = np.full(4000, angle[-1])
    long = np.concatenate([angle, rest, angle[-1] + angle])
    time = 5e-3 * np.arange(len(long))
    found = order_map(np.cos(long), long, time, period=1.0, highest=2.0)
    assert not ((found.time > 70.2) & (found.time < 89.8)).any()
    np.testing.assert_allclose(found.sel(order=1.0), 1.0, rtol=0.01)


def test_planted_frequencies_are_found():
    signal = (
        20.0 + 2.0 * np.cos(2.0 * np.pi * 3.0 * TIME) + 0.3 * np.sin(2.0 * np.pi * 12.25 * TIME)
    )
    found = frequency_map(signal, TIME)
    assert found.dims == ("time", "frequency")
    np.testing.assert_allclose(found.sel(frequency=3.0), 2.0, rtol=0.01)
    np.testing.assert_allclose(found.sel(frequency=12.25), 0.3, rtol=0.01)
    assert float(found.sel(frequency=slice(5.0, 10.0)).max()) < 2e-3
    assert float(found.sel(frequency=0.0).max()) < 1e-9  # the mean is removed
    assert float(found.time[0]) == pytest.approx(2.0, abs=0.01)
    assert float(found.time[-1]) == pytest.approx(68.0, abs=0.25)


def test_frequency_map_shows_when_a_component_is_there():
    signal = np.where(TIME < 35.0, np.cos(2.0 * np.pi * 5.0 * TIME), 0.0)
    found = frequency_map(signal, TIME).sel(frequency=5.0)
    np.testing.assert_allclose(found.sel(time=slice(None, 32.0)), 1.0, rtol=0.01)
    np.testing.assert_allclose(found.sel(time=slice(38.0, None)), 0.0, atol=1e-9)


@pytest.mark.parametrize("samples", [800, 801, 850, 900])
def test_windows_of_a_frequency_map_are_within_the_record(samples):
    time = TIME[:samples]
    found = frequency_map(np.cos(2.0 * np.pi * 5.0 * time), time)
    np.testing.assert_allclose(found.sel(frequency=5.0), 1.0, rtol=0.01)
    assert found.sizes["time"] == 1 + (samples - 800) // 50


@pytest.mark.parametrize("window", [4.0, 4.005])
def test_frequency_map_is_that_of_scipy(window):
    random = np.random.default_rng(3).normal(size=(1777, 2))
    time = TIME[:1777]
    found = frequency_map(random, time, window=window)
    length = round(window / (time[1] - time[0]))
    scipys = ShortTimeFFT(
        hann(length, sym=False),
        50,
        1.0 / (time[1] - time[0]),
        mfft=2 * length,
        fft_mode="onesided2X",
        scale_to="magnitude",
    )
    first, end = scipys.lower_border_end[1], scipys.upper_border_begin(len(random))[1]
    lines = scipys.stft_detrend(random, "constant", p0=first, p1=end, axis=0)
    np.testing.assert_allclose(found, np.abs(np.moveaxis(lines, -1, 0)), atol=1e-13)
    np.testing.assert_allclose(found.time, scipys.t(len(random), first, end), atol=1e-12)
    np.testing.assert_allclose(found.frequency, scipys.f, atol=1e-12)


def test_columns_of_a_frequency_map():
    both = np.column_stack([np.cos(2.0 * np.pi * 5.0 * TIME), np.cos(2.0 * np.pi * 8.0 * TIME)])
    found = frequency_map(both, TIME)
    assert found.dims == ("time", "frequency", "signal")
    np.testing.assert_allclose(found.isel(signal=1), frequency_map(both[:, 1], TIME), atol=1e-12)
