"""Records without a fault pass the checks that need several channels, and what explains a record.

Runs of shipped machines are recorded at five rates, with noise; gains, tilts and clocks are a
little off, as those of healthy sensors are.
"""

from pathlib import Path

import numpy as np
import pytest

from wm_drake.model.build import build_machine
from wm_drake.parameters import SpinProfile, load_machine, with_values
from wm_drake.parameters.recorded import Synchronous
from wm_drake.parameters.recorded.health import Channel
from wm_drake.parameters.recorded.stamps import clock_jumps
from wm_drake.parameters.recorded_sensors import SpeedChannel, recorded_test_of
from wm_drake.simulation.alignment import Alignment, at_run
from wm_drake.simulation.cases import Case
from wm_drake.simulation.recorded_signal import recorded_signal
from wm_drake.simulation.runs import simulate
from wm_drake.studies.compare.checks import check_orders
from wm_drake.studies.compare.diagnosis import Suspect, diagnosed
from wm_drake.studies.compare.pairs import Pair, predicted_signals
from wm_drake.studies.compare.recordings import TestRecording as Recorded
from wm_drake.studies.compare.recordings import check_distinct
from wm_drake.studies.compare.task import sensor_points

PROFILE = SpinProfile(time=(0.0, 2.0, 16.0, 18.0, 20.0), speed=(0.0, 0.0, 45.0, 45.0, 20.0))
MACHINES = ("reference", "free_stroke", "heavy_cabinet", "light_cabinet", "motor", "rodrigues_2010")
"""Six shipped machines, of which the first is tested always."""

RATES = (50.0, 100.0, 200.0, 400.0, 1000.0)
NOISES = (0.002, 0.01, 0.05)
"""Noise by the deviation of the signal."""

SPEED = SpeedChannel(channel="Drum", unit="rpm")


class Laboratory:
    """A shipped machine, runs of it, and records of them."""

    def __init__(self, name):
        """Build the machine."""
        self.parameters = load_machine(name)
        self.machine = build_machine(self.parameters)
        test = recorded_test_of(self.parameters)
        self.sensors, self.points = test.sensors, sensor_points(self.machine, test)
        self.load = next(iter(self.parameters.loads))
        self.run = self.run_of()

    def run_of(self, changes=None, load=None, profile=PROFILE):
        """Return a run of the machine with changed numbers, or another load."""
        machine = build_machine(with_values(self.parameters, changes)) if changes else self.machine
        load = load or self.load
        return simulate(machine, Case(load, machine.parameters.loads[load], profile))

    def recorded(self, rate, noise, seed=0, run=None):
        """Return a recording of healthy sensors."""
        run, generator = self.run if run is None else run, np.random.default_rng(seed)
        time = np.arange(0.0, float(run.time[-1]) - 0.01, 1.0 / rate)
        at = 0.005 + (1.0 + 1e-5) * time
        values = {}
        for name, sensor in self.sensors.items():
            tilt = np.deg2rad(1.0) * generator.standard_normal(3)
            tilted = sensor.model_copy(update={"tilt": tuple(tilt.tolist())})
            signal = recorded_signal(run, tilted, self.points[name])
            size = noise * np.std(signal)
            seen = np.interp(at, run.time.values, signal) * generator.normal(1.0, 0.01)
            values[name] = seen + generator.normal(0.0, size, len(time))
        speed = np.interp(at, run.time.values, run.drum_speed.values)
        speed = np.round(speed + generator.normal(0.0, 0.05, len(time)), 2)
        return Recorded(Synchronous(Path(f"{rate}_{noise}_{seed}.csv"), time, values), speed)

    def suspect(self, recording, words="", run=None):
        """Return a recording beside a run."""
        run = self.run if run is None else run
        values = np.stack([*recording.channels.values.values()], axis=1)
        clock = Alignment(0.005, 1e-5)
        measured = at_run(recording.channels.time, values, run.time.values, clock)
        predicted = predicted_signals(run, self.sensors, self.points)
        return Suspect(
            words, Pair(recording, run, clock, measured, predicted), self.sensors, self.points
        )


@pytest.fixture(
    scope="module",
    params=[MACHINES[0], *(pytest.param(name, marks=pytest.mark.slow) for name in MACHINES[1:])],
)
def laboratory(request):
    """Return a machine with its records."""
    return Laboratory(request.param)


def rounded(channels, digits):
    """Return channels with some digits of their deviation."""
    values = {}
    for name, column in channels.values.items():
        digit = 10.0 ** (np.round(np.log10(np.std(column))) + 1 - digits)
        values[name] = np.round(column / digit) * digit
    return Synchronous(Path(f"{digits}_{channels.path}"), channels.time, values)


def test_repeats_are_no_copies_and_the_tacho_has_its_ratio(laboratory):
    for rate in RATES:
        for noise in NOISES:
            repeats = [laboratory.recorded(rate, noise, seed) for seed in range(3)]
            check_distinct([repeat.channels for repeat in repeats])
            for digits in (2, 3):
                check_distinct([rounded(repeat.channels, digits) for repeat in repeats])
            slow = laboratory.recorded(rate / 2.0, noise, 3).channels
            check_distinct([repeats[0].channels, rounded(repeats[1].channels, 3), slow])
            for recording in repeats:
                check_orders(Recorded(recording.channels, recording.speed, about=SPEED))


def test_lost_samples_are_no_jumps_of_a_clock(laboratory):
    """Lose a fifth of a second to three seconds, at several places, with and without a speed."""
    alarms, count = [], 0
    for rate in RATES:
        for noise in NOISES:
            channels = laboratory.recorded(rate, noise).channels
            time, signals = channels.time, dict(channels.values)
            speed = laboratory.recorded(rate, noise).speed * 30.0 / np.pi
            for begin in (3.0, 7.0, 11.0, 15.0, 17.0):
                for gap in (0.3, 1.0, 3.0):
                    kept = (time < begin) | (time > begin + gap)
                    for more in ({}, {"speed": speed}):
                        every = [
                            Channel(
                                n, "speed" if n == "speed" else "vibration", time[kept], x[kept]
                            )
                            for n, x in {**signals, **more}.items()
                        ]
                        found = list(clock_jumps(every))
                        alarms += [(rate, noise, begin, gap, *more, *map(str, found))] * bool(found)
                        count += 1
    assert count == len(RATES) * len(NOISES) * 30
    assert not alarms, (len(alarms), count, alarms[:10])


def test_healthy_records_are_like_their_predictions(laboratory):
    for rate in RATES:
        for noise in NOISES:
            found = diagnosed(laboratory.suspect(laboratory.recorded(rate, noise)))
            assert not found.unlike, (rate, noise, found)
            assert not found.shifted, (rate, noise, found)
