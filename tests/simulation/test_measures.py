"""Measures on signals of known answer."""

import numpy as np
import pytest
import xarray as xr
from scipy.signal import find_peaks

import wm_drake as wm
from wm_drake.parameters import SpinProfile
from wm_drake.simulation.displacements import (
    envelopes,
    filtered_displacement,
    largest_motion,
    local_maxima,
    moment_of_largest_amplitude,
    peak_line,
    percent_difference,
    smooth_envelope,
)
from wm_drake.simulation.measures import measure

RATE = 200.0  # Hz, as records are sampled


def record_of(displacement, drum_speed=None):
    """Return a record with one sensor, at rest but for its displacement."""
    n = len(displacement)
    zeros = np.zeros((n, 3))
    axes = {
        "axis": list("xyz"),
        "angle": ["roll", "pitch", "yaw"],
        "sensor": ["Xr"],
        "bushing": ["gasket", "other"],
        "spring": ["left"],
    }
    force = np.zeros((n, 2, 3))
    force[n // 2, 0] = (-3.0, 2.0, 1.0)
    force[n // 3, 1] = 50.0
    profile = SpinProfile(time=(0.0, n / RATE), speed=(0.0, 40.0))
    return xr.Dataset(
        {
            "displacement": (("time", "sensor"), np.asarray(displacement)[:, None]),
            "detergent_displacement": (("time", "axis"), zeros - [0.001, 0.0, 0.002]),
            "bushing_force": (("time", "bushing", "axis"), force),
            "bushing_moment": (("time", "bushing", "axis"), 0.1 * force),
            "drum_speed": (
                ("time",),
                np.linspace(0.0, 40.0, n) if drum_speed is None else drum_speed,
            ),
            "drum_angle": (("time",), np.linspace(0.0, 9.0, n)),
            "tub_angle": (("time", "angle"), zeros),
            "tub_position": (("time", "axis"), zeros),
            "spring_tension": (("time", "spring"), np.linspace(150.0, 60.0, n)[:, None]),
            "motor_torque": (("time",), np.full(n, 0.5)),
        },
        {"time": np.arange(n) / RATE, **axes},
        {"rest_pose": np.zeros(6), "profile": profile.model_dump_json()},
    )


def test_a_record_shorter_than_the_filter_has_no_amplitude():
    assert np.isnan(filtered_displacement(record_of(np.zeros(20)))).all()
    assert np.isnan(measure(record_of(np.zeros(20))).amplitude).all()
    assert np.isnan(measure(record_of(np.zeros(20))).critical_speed).all()


@pytest.mark.parametrize("levels", [2, 4, 1000])
def test_local_maxima_are_those_of_scipy(levels):
    signal = np.random.default_rng(1).integers(0, levels, 5000).astype(float)
    for part in (signal, -signal, signal[:2], signal[:1], signal[:0], np.zeros(9)):
        assert local_maxima(part).tolist() == find_peaks(part)[0].tolist()


def test_peak_line_goes_from_peak_to_peak():
    time = np.arange(7.0)
    signal = np.array([0.0, 2.0, 0.0, 1.0, 0.0, 4.0, 0.0])
    assert peak_line(time, signal).tolist() == [2.0, 2.0, 1.5, 1.0, 2.5, 4.0, 4.0]
    assert peak_line(time, time).tolist() == time.tolist()


def test_envelopes_of_a_growing_and_decaying_oscillation_follow_its_size():
    time = np.arange(8000) / RATE
    size = 0.01 * np.exp(-(((time - 20.0) / 6.0) ** 2))
    both = envelopes(record_of(size * np.sin(2 * np.pi * 3.0 * time)))
    np.testing.assert_allclose(both.upper.isel(sensor=0), size, atol=1e-4)
    np.testing.assert_allclose(both.lower.isel(sensor=0), -size, atol=1e-4)


def test_smooth_envelope_is_the_size_of_an_oscillation_and_of_a_beat():
    time = np.arange(8000) / RATE
    size = 0.01 * np.exp(-(((time - 20.0) / 6.0) ** 2))
    first, second = np.sin(2 * np.pi * 3.0 * time), np.sin(2 * np.pi * 4.0 * time)
    smooth = smooth_envelope(record_of(size * first)).isel(sensor=0)
    np.testing.assert_allclose(smooth, size, atol=5e-5)
    beat = smooth_envelope(record_of(size * (first + second))).isel(sensor=0)
    np.testing.assert_allclose(beat, 2.0 * size * abs(np.cos(np.pi * time)), atol=2e-4)


def test_small_peaks_do_not_make_the_smooth_envelope_jump():
    """Add a second harmonic, which has peaks of its own above half of the fundamental."""
    time = np.arange(8000) / RATE
    first, second = np.sin(2 * np.pi * 2.0 * time), np.sin(2 * np.pi * 4.0 * time)

    def change(envelope, share, step=0.002):
        both = (0.01 * (first + x * second) for x in (share, share + step))
        before, after = (np.asarray(envelope(record_of(signal))) for signal in both)
        return np.abs(after - before)[2000:6000].max()

    shares = np.arange(0.4, 0.6, 0.002)
    smooth = [change(smooth_envelope, share) for share in shares]
    lines = [change(lambda record: envelopes(record).upper, share) for share in shares]
    assert max(smooth) <= 0.01 * 0.002 * 1.01  # the size of the change itself
    assert max(lines) > 1e-3


def test_measures_read_amplitude_speed_and_forces():
    time = np.arange(8000) / RATE
    size = 0.01 * np.exp(-(((time - 20.0) / 6.0) ** 2))
    measures = measure(record_of(size * np.sin(2 * np.pi * 3.0 * time)))
    assert float(measures.amplitude[0]) == pytest.approx(0.01, rel=5e-3)
    assert float(measures.critical_speed[0]) == pytest.approx(20.0, abs=0.2)
    assert measures.detergent_displacement.values.tolist() == [0.001, 0.0, 0.002]
    # the other bushing does not count
    assert measures.gasket_force.values.tolist() == [3.0, 2.0, 1.0]
    assert measures.gasket_moment.values == pytest.approx([0.3, 0.2, 0.1])
    assert measures.smallest_gap is None


def test_percent_difference_is_equation_1_of_B():
    with_gasket, without = xr.DataArray([29.1, 8.0]), xr.DataArray([23.6, 1.1])
    assert percent_difference(with_gasket, without).values == pytest.approx([23.3, 627.3], abs=0.05)


def test_moment_of_largest_amplitude_is_that_of_the_amplitudes():
    """Add a slow drift far outside of the band: it is larger, but it is no amplitude."""
    time = np.arange(8000) / RATE
    burst = 0.01 * np.exp(-(((time - 25.0) / 2.0) ** 2)) * np.sin(2.0 * np.pi * 3.0 * time)
    record = record_of(burst + 0.1 * np.sin(2.0 * np.pi * 0.01 * time))
    at = moment_of_largest_amplitude(record)
    assert time[at] == pytest.approx(25.0, abs=0.2)
    speed = measure(record).critical_speed.values
    assert record.drum_speed.values[at] == speed[0]
    assert moment_of_largest_amplitude(record_of([0.0, -2.0, 1.0])) == 1  # too short to filter


def test_replay_shows_the_stretch_around_the_largest_motion():
    time = np.arange(8000) / RATE
    times, positions = largest_motion(record_of(0.01 * np.exp(-(((time - 20.0) / 2.0) ** 2))))
    assert times[0] == pytest.approx(16.0)
    assert times[-1] == pytest.approx(24.0, abs=0.05)
    assert positions.shape == (len(times), 7)
    assert np.diff(times).max() < 0.04  # s
    alone, _ = largest_motion(record_of([0.0]))
    assert alone.tolist() == [0.0]


def test_measures_are_a_table_in_units_for_reading(machine):
    measures = measure(wm.simulate(machine, "middle"))
    rows = measures.to_dataframe().set_index(["measure", "of"])
    assert rows.value["amplitude", "Xr"] == 1e3 * measures.amplitude.sel(sensor="Xr")
    assert rows.unit["amplitude", "Xr"] == "mm"
    shown = measures._repr_html_()
    assert "<td>Xr</td>" in shown
    assert "smallest gap needs wm.measure(record, wm.Scene(parameters))" in shown
    assert rows.value.notna().all()
    bars = measures.plot().patches
    assert [bar.get_height() for bar in bars] == pytest.approx(1e3 * measures.amplitude.values)
