"""The predicted signal of a sensor, against positions differentiated by splines, and closed forms."""

import numpy as np
import pytest
from lab_machine import spline_signal
from scipy.signal import butter, freqs

from wm_drake.model.build import build_machine
from wm_drake.parameters import Load, SpinProfile, load_machine, with_values
from wm_drake.parameters.recorded_sensors import RecordedSensor
from wm_drake.simulation.cases import Case
from wm_drake.simulation.recorded_signal import recorded_signal, turned_signals
from wm_drake.simulation.runs import simulate

POINT = np.array([0.21, -0.17, 0.26])
CASES = [
    ("displacement", "world", True),
    ("velocity", "world", True),
    ("acceleration", "world", True),
    ("acceleration", "tub", True),
    ("acceleration", "tub", False),
    ("displacement", "tub", True),
]


@pytest.fixture(scope="module", params=["compiled", pytest.param("drake", marks=pytest.mark.slow)])
def record(request):
    """Return a run through the resonances, with samples close enough for splines."""
    parameters = with_values(load_machine("reference"), {"output_period": 1.25e-3, "step": 1.25e-3})
    profile = SpinProfile(time=(0.0, 8.0, 12.0), speed=(0.0, 32.0, 42.0))
    case = Case("counter", parameters.loads["counter"], profile)
    return simulate(build_machine(parameters), case, request.param)


@pytest.fixture(scope="module")
def still():
    """Return a run of the empty machine, which stays where it is."""
    parameters = load_machine("reference")
    profile = SpinProfile(time=(0.0, 1.0), speed=(0.0, 1e-6))
    return simulate(build_machine(parameters), Case("none", Load(unbalances=()), profile))


def sensor_of(**fields):
    return RecordedSensor.model_validate({"point": POINT.tolist(), "axis": "z", **fields})


@pytest.mark.parametrize(("quantity", "axes", "gravity"), CASES)
@pytest.mark.parametrize("axis", "xyz")
def test_it_is_what_splines_through_the_positions_give(record, quantity, axes, gravity, axis):
    fields = {"quantity": quantity, "axes": axes, "axis": axis}
    if not gravity:
        fields["gravity"] = "removed"
    signal = recorded_signal(record, sensor_of(**fields), POINT)
    unit = np.eye(3)["xyz".index(axis)]
    expected = spline_signal(record, quantity, POINT, unit, axes, gravity)
    for part in np.array_split(np.arange(40, len(signal) - 40), 8)[1:]:
        vibration = expected[part] - expected[part].mean()
        assert rms(signal[part] - expected[part]) < 1e-3 * rms(vibration)


def rms(values):
    return np.sqrt(np.mean(np.square(values)))


def test_at_rest_it_shows_gravity_along_an_axis_that_points_upwards(still):
    upwards = recorded_signal(still, sensor_of(), POINT)
    level = recorded_signal(still, sensor_of(axis="x"), POINT)
    tilted = recorded_signal(still, sensor_of(axis="x", tilt=(0.0, -0.1, 0.0)), POINT)
    np.testing.assert_allclose(upwards, 9.81, atol=1e-4)
    np.testing.assert_allclose(level, 0.0, atol=1e-4)
    np.testing.assert_allclose(tilted, 9.81 * np.sin(0.1), atol=1e-4)


def test_gain_and_polarity(record):
    plain = recorded_signal(record, sensor_of(), POINT)
    changed = recorded_signal(record, sensor_of(gain=1.02, polarity="negative"), POINT)
    np.testing.assert_allclose(changed, -1.02 * plain)


@pytest.mark.parametrize(
    ("fields", "filtered"),
    [
        ({"ac_coupling": 0.5}, (1, 0.5, "highpass")),
        ({"low_pass": 15.0}, (4, 15.0, "lowpass")),
        ({"low_pass": 300.0, "low_pass_order": 2}, (2, 300.0, "lowpass")),
    ],
)
def test_filters_are_those_of_analog_recorders(record, fields, filtered):
    """Compare with the analog response of a sine, long after the start."""
    order, corner, kind = filtered
    time = record.time.values
    turning = record.copy(deep=True)
    frequency = 6.0
    wave = np.sin(2.0 * np.pi * frequency * time)
    turning["tub_acceleration"].values[:] = 0.0
    turning["tub_acceleration"].values[:, 2] = wave
    for name in ("tub_angular_acceleration", "tub_angular_velocity"):
        turning[name].values[:] = 0.0
    sensor = sensor_of(axes="world", gravity="removed", **fields)
    signal = recorded_signal(turning, sensor, POINT)
    numbers = butter(order, 2.0 * np.pi * corner, kind, analog=True)
    response = freqs(*numbers, worN=[2.0 * np.pi * frequency])[1][0]
    expected = np.abs(response) * np.sin(2.0 * np.pi * frequency * time + np.angle(response))
    late = time > 6.0
    np.testing.assert_allclose(signal[late], expected[late], atol=1e-3)


def test_a_filter_is_settled_at_the_start(still):
    signal = recorded_signal(still, sensor_of(low_pass=50.0), POINT)
    np.testing.assert_allclose(signal, 9.81, atol=1e-4)
    coupled = recorded_signal(still, sensor_of(ac_coupling=0.5), POINT)
    np.testing.assert_allclose(coupled, 0.0, atol=1e-4)


def test_a_sensor_that_is_off_by_small_angles_records_a_sum(record):
    small, sensor = 2e-3, sensor_of(low_pass="100 Hz")
    along, x, y = turned_signals(record, {"a": sensor}, {"a": POINT})[:, 0].T
    for tilt, expected in (
        ([small, 0.0, 0.0], along - small * y),
        ([0.0, small, 0.0], along + small * x),
        ([0.0, 0.0, small], along),
    ):
        turned = sensor.model_copy(update={"tilt": tuple(tilt)})
        found = recorded_signal(record, turned, POINT)
        assert rms(found - expected) < 1e-5 * rms(along)
