"""Compiled filter and peaks, against those of scipy."""

import numpy as np
import pytest
from scipy.signal import butter, find_peaks, sosfiltfilt

from wm_drake.batch import simulate_many
from wm_drake.parameters import SpinProfile
from wm_drake.simulation.band import band_warnings, pass_band
from wm_drake.simulation.cases import Case
from wm_drake.simulation.displacements import amplitudes, filtered, filtered_displacement
from wm_drake.simulation.records import sample_period
from wm_drake.simulation.runs import simulate

PERIOD, BAND = 0.005, (0.5, 20.0)


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
        assert filtered(walk, PERIOD, BAND) == pytest.approx(theirs, abs=1e-9 * np.abs(walk).max())


def test_filter_of_one_signal_does_not_depend_on_the_others(walks):
    together = filtered(walks[1], PERIOD, BAND)
    for k in (0, 3, 7):
        assert np.array_equal(filtered(walks[1][:, [k]], PERIOD, BAND)[:, 0], together[:, k])


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


@pytest.mark.parametrize(
    ("rpm", "edge"), [(400, 20.0), (-480, 20.0), (1200, 50.0), (1400, 175.0 / 3.0), (9000, 90.0)]
)
def test_band_reaches_to_the_second_order_and_is_that_of_the_profile(rpm, edge):
    profile = SpinProfile(time=(0.0, 9.0), speed=(0.0, np.pi / 30.0 * rpm))
    assert pass_band(profile, PERIOD) == pytest.approx((0.5, edge))
    narrow = profile.model_copy(update={"band": (1.0, 12.0)})
    assert pass_band(narrow, PERIOD) == (1.0, 12.0)
    assert not band_warnings(profile)
    assert bool(band_warnings(narrow)) == (abs(rpm) > 720)


@pytest.mark.parametrize("band", [(0.0, 20.0), (20.0, 0.5), (20.0,)])
def test_band_that_is_no_range_is_refused(band):
    with pytest.raises(ValueError, match="band"):
        SpinProfile(time=(0.0, 9.0), speed=(0.0, 1.0), band=band)


def test_displacement_at_1400_rpm_passes_alike_in_record_and_batch(machine):
    speed = np.pi / 30.0 * 1400.0
    profile = SpinProfile(time=(0.0, 4.0), speed=(speed, speed))
    case = Case("middle", machine.parameters.loads["middle"], profile)
    record = simulate(machine, case)
    shown = filtered_displacement(record)

    def at_drum_frequency(values):
        part = slice(1600, 2800)  # 35 revolutions
        turning = np.exp(-1j * speed * record.time.values[part]) * np.hanning(1200)
        return abs(turning @ values[part])

    raw = at_drum_frequency(record.displacement.values)
    assert at_drum_frequency(shown.values) == pytest.approx(raw, rel=0.01)
    narrow = at_drum_frequency(filtered(record.displacement.values, sample_period(record), BAND))
    assert np.all(narrow < 0.3 * raw)
    (of_batch,) = simulate_many(machine, [case], measures=("amplitudes",)).amplitude.values
    assert of_batch == pytest.approx(amplitudes(shown.values)[0], rel=1e-9)
