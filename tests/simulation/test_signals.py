"""Compiled filter and peaks, against those of scipy."""

import numpy as np
import pytest
from scipy.signal import butter, find_peaks, sosfiltfilt

from wm_drake.simulation.displacements import amplitudes, filtered

PERIOD = 0.005


@pytest.fixture(scope="module")
def walks():
    """Return random walks of three lengths, one longer than its padding, eight columns each."""
    random = np.random.default_rng(3)
    return [np.cumsum(random.standard_normal((n, 8)), axis=0) for n in (60, 900, 2500)]


def test_filter_is_that_of_scipy(walks):
    sections = butter(4, (0.5, 20.0), btype="bandpass", fs=1.0 / PERIOD, output="sos")
    for walk in walks:
        padding = min(1000, len(walk) - 1)
        theirs = sosfiltfilt(sections, walk, axis=0, padtype="even", padlen=padding)
        assert filtered(walk, PERIOD) == pytest.approx(theirs, abs=1e-9 * np.abs(walk).max())


def test_filter_of_one_signal_does_not_depend_on_the_others(walks):
    together = filtered(walks[1], PERIOD)
    for k in (0, 3, 7):
        assert np.array_equal(filtered(walks[1][:, [k]], PERIOD)[:, 0], together[:, k])


def peaks_of_scipy(signal):
    sides = (find_peaks(signal)[0], find_peaks(-signal)[0])
    nodes = np.concatenate([side if len(side) else np.arange(len(signal)) for side in sides])
    at = nodes[np.argmax(np.abs(signal[nodes]))]
    return abs(signal[at]), at


@pytest.mark.parametrize("digits", [9, 0])  # rounded to whole numbers, peaks are flat
def test_largest_peaks_are_those_of_scipy(walks, digits):
    for walk in walks:
        # no two peaks have the same size
        signals = np.round(walk, digits) * np.linspace(1.0, 2.0, len(walk))[:1]
        sizes, samples = amplitudes(signals)
        for k, signal in enumerate(signals.T):
            size, at = peaks_of_scipy(signal)
            assert sizes[k] == size
            assert abs(signal[samples[k]]) == size or digits == 0
            assert samples[k] == at or abs(signal[at]) == abs(signal[samples[k]])


def test_signals_without_a_peak_have_their_largest_value():
    line = np.arange(9.0) - 2.0
    sizes, samples = amplitudes(np.column_stack([line, -line, 0.0 * line, line * np.nan]))
    assert sizes == pytest.approx([6.0, 6.0, 0.0, np.nan], nan_ok=True)
    assert list(samples) == [8, 8, 0, 0]
    assert np.isnan(amplitudes(np.empty((0, 2)))[0]).all()
