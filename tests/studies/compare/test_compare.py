"""Numbers of a comparison against closed forms, and its findings for planted differences."""

import numpy as np
import pytest
import xarray as xr
from scipy.stats import t as student

from wm_drake.parameters import SpinProfile
from wm_drake.parameters.recorded_sensors import RecordedSensor
from wm_drake.report.quantity import SPEED
from wm_drake.simulation.displacements import peak_line
from wm_drake.studies.compare.agreement import agreement_of
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
