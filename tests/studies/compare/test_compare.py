"""Numbers of a comparison against closed forms, and its sentence for planted differences."""

import numpy as np
import pytest
import xarray as xr
from scipy.stats import t as student

from wm_drake.parameters.recorded_sensors import RecordedSensor
from wm_drake.report.quantity import SPEED
from wm_drake.studies.compare.page import summary
from wm_drake.studies.compare.study import (
    LEAST_TOLERANCE,
    agreement_of,
    amplitudes_of,
    envelopes_of,
    in_pieces,
    means_at,
)

COUNT = 40
SENSOR = {"Z": RecordedSensor(quantity="displacement", frame="any", axis="z")}


def repeats(sizes, computed):
    """Return repeats with amplitudes (repeat, place) and computed ones (place,), in SI."""
    sizes, computed = np.asarray(sizes, dtype=float), np.asarray(computed, dtype=float)
    both = np.stack([sizes, np.broadcast_to(computed, sizes.shape)], axis=1)
    envelope = np.stack([both, -both], axis=2)[..., None]
    dims = ("repeat", "source", "side", "place", "sensor")
    coords = {"source": ["measured", "computed"], "side": ["upper", "lower"], "sensor": ["Z"]}
    places = SPEED.variable("place", np.arange(sizes.shape[1], dtype=float))
    return xr.Dataset({"envelope": (dims, envelope)}, {**coords, "place": places})


def sentence(differs, count=5):
    """Return the sentence if the model is 30 % low at some places, between repeats alike."""
    sizes = np.full((count, COUNT), 1e-3)
    computed = np.where(np.isin(np.arange(COUNT), list(differs)), 0.7e-3, 1e-3)
    data = repeats(sizes, computed)
    return summary(agreement_of([amplitudes_of(data, SENSOR, "displacement")], data.place), count)


@pytest.mark.parametrize(
    ("differs", "expected"),
    [
        ([], "Within the scatter of five repeats from 0 rpm to 372 rpm."),
        (range(12), "Within the scatter of five repeats above 115 rpm; below, Z 30 % low at 0 rpm."),
        ([9], "Within the scatter of five repeats from 0 rpm to 372 rpm."),
        ([*range(10), *range(35, COUNT)],
         "Within the scatter of five repeats from 95 rpm to 325 rpm; elsewhere, Z 30 % low at 0 rpm."),
        (range(COUNT),
         "Outside the scatter of five repeats from 0 rpm to 372 rpm; most of all, Z 30 % low at 0 rpm."),
        (range(0, COUNT, 2),
         "Outside the scatter of five repeats from 0 rpm to 372 rpm; most of all, Z 30 % low at 0 rpm."),
    ],
)  # fmt: skip
def test_one_sentence_says_where_they_agree(differs, expected):
    assert sentence(differs) == expected


def test_one_record_has_no_scatter():
    assert sentence([], count=1).startswith("Within 5 % of the one record from ")


def test_a_peak_is_called_a_resonance():
    sizes = np.tile(1e-3 + 2e-3 * np.exp(-0.5 * ((np.arange(COUNT) - 10) / 2.0) ** 2), (3, 1))
    computed = sizes[0] * np.where(np.arange(COUNT) < 15, 0.77, 1.0)
    data = repeats(sizes, computed)
    text = summary(agreement_of([amplitudes_of(data, SENSOR, "displacement")], data.place), 3)
    assert text.endswith("below, Z 23 % low at the resonance of 95 rpm.")


def test_the_tolerance_is_the_range_of_a_further_repeat():
    """At the last place only two of the three repeats have an amplitude."""
    sizes = 1e-3 * np.array([[1.0, 1.0], [1.1, 1.1], [1.2, np.nan]])
    found = amplitudes_of(repeats(sizes, [1e-3, 1e-3]), SENSOR, "displacement").tolerance.values
    three = student.ppf(0.975, 2) * np.std(sizes[:, 0], ddof=1) * np.sqrt(4.0 / 3.0)
    two = student.ppf(0.975, 1) * np.std(sizes[:2, 1], ddof=1) * np.sqrt(1.5)
    np.testing.assert_allclose(found[:, 0], [three, two])
    alike = amplitudes_of(repeats([[1e-3, 5e-4]] * 2, [1e-3, 1e-3]), SENSOR, "displacement")
    np.testing.assert_allclose(alike.tolerance.values[:, 0], LEAST_TOLERANCE * 1e-3)


def test_envelopes_and_means_stop_at_gaps():
    time = np.arange(2000) * 5e-3
    wave = (2.0 * np.sin(2.0 * np.pi * 3.0 * time))[:, None]
    wave[700:900] = np.nan
    upper, lower = envelopes_of(wave, time)
    assert np.isnan(upper[700:900]).all()
    np.testing.assert_allclose(upper[:700], 2.0, rtol=2e-3)
    np.testing.assert_allclose(lower[900:], -2.0, rtol=2e-3)
    numbers = np.minimum(np.arange(2000) // 500, 3)
    means = means_at(np.where(np.isnan(wave), np.nan, 7.0), numbers, 5)
    np.testing.assert_allclose(means[:, 0], [7.0, 7.0, 7.0, 7.0, np.nan])


def test_short_pieces_are_left_out():
    signal = np.ones((100, 1))
    signal[20] = np.nan
    changed = in_pieces(signal, lambda part: 2.0 * part)
    assert np.isnan(changed[:21]).all()
    np.testing.assert_allclose(changed[21:], 2.0)
