"""Numbers of a comparison against closed forms, and its findings for planted differences."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scipy.stats import binom
from scipy.stats import t as student

from wm_drake.errors import InputError
from wm_drake.parameters import SpinProfile
from wm_drake.parameters.recorded import Synchronous
from wm_drake.parameters.recorded_sensors import RecordedSensor
from wm_drake.report.quantity import SPEED
from wm_drake.simulation.alignment import Alignment
from wm_drake.simulation.displacements import peak_line
from wm_drake.studies.compare.agreement import agreement_of
from wm_drake.studies.compare.checks import (
    check_pair,
    largest_share_of_noise,
    shares_of_order_one,
)
from wm_drake.studies.compare.pairs import Pair, measured_profile
from wm_drake.studies.compare.recordings import TestRecording as Recorded
from wm_drake.studies.compare.signals import band_passed, envelopes_of, in_pieces, means_at
from wm_drake.studies.compare.study import LEAST_TOLERANCE, amplitudes_of

COUNT = 40
SENSOR = {"Z": RecordedSensor(quantity="displacement", frame="any", axis="z")}


def repeats(sizes, computed):
    """Return repeats with amplitudes (repeat, place) and computed ones (place,), in SI."""
    sizes, computed = np.asarray(sizes, dtype=float), np.asarray(computed, dtype=float)
    both = np.stack([sizes, np.broadcast_to(computed, sizes.shape)], axis=1)[..., None]
    coords = {"source": ["measured", "computed"], "sensor": ["Z"]}
    places = SPEED.variable("place", np.arange(sizes.shape[1], dtype=float))
    dims = ("repeat", "source", "place", "sensor")
    return xr.Dataset({"amplitude": (dims, both)}, {**coords, "place": places})


def agreement(sizes, computed):
    """Return the agreement of the sensor with its repeats, at places numbered from 0."""
    data = repeats(sizes, computed)
    return agreement_of([amplitudes_of(data, SENSOR, "displacement")], data.place)


@pytest.mark.parametrize("count", [1, 5])
@pytest.mark.parametrize(
    ("differs", "agree", "worst"),
    [
        ([], (0, 39), None),
        (range(12), (12, 39), 0),
        ([9], (0, 39), None),  # a single one between places that agree
        ([*range(10), *range(35, COUNT)], (10, 34), 0),
        (range(COUNT), (np.nan, np.nan), 0),
        (range(0, COUNT, 2), (np.nan, np.nan), 0),
    ],
)
def test_the_range_of_places_that_agree(differs, agree, worst, count):
    """Make the model 30 % low at some places."""
    computed = np.where(np.isin(np.arange(COUNT), list(differs)), 0.7e-3, 1e-3)
    found = agreement(np.full((count, COUNT), 1e-3), computed)
    np.testing.assert_equal((found.from_place.item(), found.to_place.item()), agree)
    assert (found.first_place, found.last_place) == (0, COUNT - 1)
    assert found.sensor == ("" if worst is None else "Z")
    if worst is not None:
        assert found["at"] == worst
        assert found.difference == pytest.approx(-0.3)
        assert not found.is_peak


def test_a_peak_that_differs_is_told_from_a_slope():
    sizes = np.tile(1e-3 + 2e-3 * np.exp(-0.5 * ((np.arange(COUNT) - 10) / 2.0) ** 2), (3, 1))
    found = agreement(sizes, sizes[0] * np.where(np.arange(COUNT) < 15, 0.77, 1.0))
    assert (found["at"], found.is_peak) == (10, True)
    assert found.difference == pytest.approx(-0.23)


def test_the_tolerance_is_the_range_of_a_further_repeat():
    """At the last place only two of the three repeats have an amplitude."""
    sizes = 1e-3 * np.array([[1.0, 1.0], [1.1, 1.1], [1.2, np.nan]])
    found = amplitudes_of(repeats(sizes, [1e-3, 1e-3]), SENSOR, "displacement").tolerance.values
    three = student.ppf(0.975, 2) * np.std(sizes[:, 0], ddof=1) * np.sqrt(4.0 / 3.0)
    two = student.ppf(0.975, 1) * np.std(sizes[:2, 1], ddof=1) * np.sqrt(1.5)
    np.testing.assert_allclose(found[:, 0], [three, two])
    alike = amplitudes_of(repeats([[1e-3, 5e-4]] * 2, [1e-3, 1e-3]), SENSOR, "displacement")
    np.testing.assert_allclose(alike.tolerance.values[:, 0], LEAST_TOLERANCE * 1e-3)


def steady(frequency, amplitude=2e-3, noise=0.0, seed=0, seconds=60.0):
    """Return a run at a constant drum speed, and a signal (n, 1) of its frequency with noise."""
    time = np.arange(0.0, seconds, 5e-3)
    angle = 2.0 * np.pi * frequency * time
    profile = SpinProfile(time=(0.0, seconds), speed=(2.0 * np.pi * frequency,) * 2)
    run = xr.Dataset(
        {
            "drum_angle": ("time", angle),
            "drum_speed": ("time", np.full(len(time), 2.0 * np.pi * frequency)),
        },
        {"time": time},
        {"profile": profile.model_dump_json()},
    )
    random = np.random.default_rng(seed).standard_normal(len(time))
    return run, (amplitude * np.sin(angle) + noise * random)[:, None]


def test_envelopes_and_means_stop_at_gaps():
    run, wave = steady(3.0, seconds=10.0)
    wave[700:900] = np.nan
    envelope = envelopes_of(band_passed(wave, run), run)
    assert np.isnan(envelope[700:900]).all()
    for inside in (slice(250, 450), slice(1150, 1750)):  # the filter settles at the ends
        np.testing.assert_allclose(envelope[inside], 2e-3, rtol=0.03)
    numbers = np.minimum(np.arange(2000) // 500, 3)
    means = means_at(np.where(np.isnan(wave), np.nan, 7.0), numbers, 5)
    np.testing.assert_allclose(means[:, 0], [7.0, 7.0, 7.0, 7.0, np.nan])


def test_short_pieces_are_left_out():
    signal = np.ones((100, 1))
    signal[20] = np.nan
    changed = in_pieces(signal, lambda part: 2.0 * part)
    assert np.isnan(changed[:21]).all()
    np.testing.assert_allclose(changed[21:], 2.0)


def test_noise_raises_an_amplitude_as_rice_says():
    """Compare with s^2 / (2 A), and with a line from peak to peak, which noise lowers."""
    size, noise = 2e-3, 1e-3
    run, wave = steady(3.0, size, noise)
    band = 0.5, 20.0  # Hz, of 100 that white noise fills
    inside = noise * np.sqrt((band[1] - band[0]) / 100.0)
    passed = band_passed(wave, run)
    raised = envelopes_of(passed, run).mean() - size
    assert raised == pytest.approx(inside**2 / (2.0 * size), abs=0.01 * size)
    assert 0.0 < raised < 0.04 * size
    assert peak_line(run.time.values, passed[:, 0]).mean() < 0.9 * size


def pair_of(run, measured, predicted):
    """Return a pair whose recording has the clock of the run."""
    channels = {f"a{k}": signal for k, signal in enumerate(measured.T)}
    recording = Recorded(Synchronous(Path("x.csv"), run.time.values, channels))
    return Pair(recording, run, Alignment(), measured, predicted)


@pytest.mark.parametrize(("seconds", "windows"), [(2.4, 1), (60.0, 23)])
def test_noise_exceeds_its_share_of_order_one_as_rarely_as_is_said(seconds, windows):
    run, wave = steady(3.0, seconds=seconds + 0.55)
    noise = np.random.default_rng(3).standard_normal((len(wave), 2000))
    shares, counts = shares_of_order_one(pair_of(run, noise, noise))
    assert set(counts) == {windows}
    assert shares.mean() == pytest.approx(1.0 / 3.0, abs=0.02)
    for probability in (0.2, 0.01):
        alarms = shares > largest_share_of_noise(counts, probability)
        low, high = binom.ppf((1e-4, 1.0 - 1e-4), len(shares), probability) / len(shares)
        assert low <= alarms.mean() <= high


@pytest.mark.parametrize("color", [0.0, 1.0, 2.0])
def test_noise_is_refused(color):
    """Draw noise whose power falls with a power of the frequency."""
    run, wave = steady(3.0)
    generator = np.random.default_rng(4)
    for _ in range(20):
        spectrum = np.fft.rfft(generator.standard_normal((len(wave), 6)), axis=0)
        spectrum[1:] *= np.arange(1.0, len(spectrum))[:, None] ** (-0.5 * color)
        noise = np.fft.irfft(spectrum, len(wave), axis=0)
        with pytest.raises(InputError, match=r"x\.csv: no sensor shows the turning drum"):
            check_pair(pair_of(run, noise, np.tile(wave, 6)))


@pytest.mark.parametrize("frequency", [3.0, 20.0])
def test_a_weak_vibration_is_no_noise(frequency):
    """Hide a vibration in noise, in one of three sensors; the noise has three times its size."""
    for seed in range(10):
        run, wave = steady(frequency, 2e-3, 6e-3, seed)
        noise = 6e-3 * np.random.default_rng([seed, 1]).standard_normal((len(wave), 2))
        predicted = steady(frequency)[1]
        check_pair(pair_of(run, np.hstack([noise, wave]), np.tile(predicted, 3)))


def test_a_record_of_few_revolutions_tells_nothing():
    run, wave = steady(3.0, seconds=2.5)
    with pytest.raises(InputError, match="8 revolutions"):
        check_pair(pair_of(run, wave, wave))


@pytest.mark.parametrize(
    ("first", "slope", "lead"),
    [(2.5, 2.5, 1.0), (0.0, 2.5, 0.0), (20.0, 0.0, 11.0), (100.0, 0.0, 13.0), (25.0, -1.0, 13.0)],
)
def test_a_measured_speed_is_led_to_from_rest(first, slope, lead):
    """Begin while the drum turns: rising from rest, at rest, steady, fast, and falling. [rad/s]"""
    time = 0.01 * np.arange(2000)
    speed = first + slope * (time - 0.125)  # points lie in the middle of a quarter of a second
    recording = Recorded(Synchronous(Path("x.csv"), time, {}), speed)
    profile, alignment, begin = measured_profile(recording, speed)
    assert begin == pytest.approx(lead, abs=0.05)
    assert profile.speed[0] == 0.0
    assert alignment.of_run(0.125) == pytest.approx(begin, abs=0.006)
    at = np.linspace(2.0, 17.0, 50)
    np.testing.assert_allclose(
        profile.speed_at(alignment.of_run(at)), np.interp(at, time, speed), atol=0.03
    )
