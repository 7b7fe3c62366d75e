"""Planted offsets and clock rates are recovered from a speed, from pulses, and from signals."""

import numpy as np
import pytest
from lab_machine import recorded_channels

from wm_drake.model.build import build_machine
from wm_drake.parameters import SpinProfile, load_machine
from wm_drake.parameters.recorded.pulses import counted
from wm_drake.parameters.recorded_sensors import recorded_test_of
from wm_drake.simulation.alignment import align_pulses, align_signals, align_speed
from wm_drake.simulation.cases import Case
from wm_drake.simulation.recorded_signal import recorded_signal
from wm_drake.simulation.runs import simulate

PPM, BEGIN = 300.0, 2.4
"""Planted: the recorder begins late, and its clock is slow."""


@pytest.fixture(scope="module")
def planted():
    """Return a run, the predicted signals, the recording, and the times of the run of its samples."""
    machine = build_machine(load_machine("reference"))
    profile = SpinProfile(time=(0.0, 25.0, 30.0), speed=(0.0, 32.0, 32.0))
    record = simulate(machine, Case("middle", machine.parameters.loads["middle"], profile))
    points = machine.set_up().accelerometer_points
    sensors = recorded_test_of(machine.parameters).sensors
    names = [f"{name}_{axis}" for name in ("S1", "S2") for axis in "xyz"]
    predicted = np.stack(
        [recorded_signal(record, sensors[name], points[name[:2]]) for name in names], axis=1
    )
    where = {name: points[name[:2]] for name in names}
    time, channels, at = recorded_channels(record, where, begin=BEGIN, ppm=PPM, rate=400.0)
    values = np.stack([values for values, _ in channels.values()], axis=1) * 9.80665
    return record, predicted, time, values, at


def test_from_the_speed(planted):
    record, _, time, _, at = planted
    noise = np.random.default_rng(1).normal(0.0, 0.3, len(at))
    speed = np.interp(at, record.time.values, record.drum_speed.values) + noise
    found = align_speed(time, speed, record)
    assert abs(found.of_run(15.0) - (BEGIN + (1.0 + 1e-6 * PPM) * 15.0)) < 3.0 * found.offset_sd
    assert found.offset_sd < 0.02


def test_from_pulses(planted):
    record, _, time, _, at = planted
    angle = np.interp(at, record.time.values, record.drum_angle.values)
    numbers = np.arange(np.ceil(angle[0] / np.pi), angle[-1] / np.pi)
    pulses = counted(np.interp(numbers * np.pi, angle, time), "Tacho")[0]
    found = align_pulses(pulses, np.pi, record)
    assert found.offset == pytest.approx(BEGIN, abs=1e-3)
    assert found.rate == pytest.approx(1e-6 * PPM, abs=3e-5)


@pytest.mark.parametrize("changes", ["exact", "noise", "reversed and turned"])
def test_from_the_signals_alone(planted, changes):
    record, predicted, time, values, _ = planted
    if changes == "noise":
        values = values + np.random.default_rng(2).normal(0.0, 0.3, values.shape)
    if changes == "reversed and turned":
        values = values * np.array([1.0, -1.0, 1.0, 1.0, 1.0, 1.0])
    found = align_signals(time, values, predicted, record)
    middle = 14.0
    error = found.of_run(middle) - (BEGIN + (1.0 + 1e-6 * PPM) * middle)
    assert abs(error) < 3e-3
    assert found.rate == pytest.approx(1e-6 * PPM, abs=3e-4)
    assert found.source == "signals"


def test_a_constant_speed_leaves_the_offset_open(planted):
    record, predicted, *_ = planted
    held = record.time.values >= 26.0
    time, values = record.time.values[held], predicted[held]
    found = align_signals(time, values, predicted, record)
    assert found.offset_sd > 0.05
