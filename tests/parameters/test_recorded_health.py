"""Health of recorded channels: planted faults are found where they are, healthy records pass."""

import numpy as np
import pytest

from wm_drake.model.build import build_machine
from wm_drake.parameters import SpinProfile, load_machine
from wm_drake.parameters.recorded.health import Channel, examined
from wm_drake.parameters.recorded.pulses import counted
from wm_drake.parameters.recorded.stamps import clock_jumps, with_ticks_spread
from wm_drake.parameters.recorded_sensors import recorded_test_of
from wm_drake.simulation.cases import Case
from wm_drake.simulation.recorded_signal import recorded_signal
from wm_drake.simulation.runs import simulate
from wm_drake.studies.compare.task import sensor_points

PROFILE = SpinProfile(time=(0.0, 2.0, 16.0, 18.0, 20.0), speed=(0.0, 0.0, 45.0, 45.0, 20.0))
MACHINES = ("reference", "free_stroke", "heavy_cabinet", "liquid_rings", "motor", "rodrigues_2010")
"""Six shipped machines, of which the first is tested always."""

RATES = (50.0, 100.0, 200.0, 400.0, 1000.0)
RECORDERS = ((0.0, None), (0.0, 3), (0.01, None), (0.01, 3), (0.05, 2))
"""Noise by the deviation of the signal, and digits of the recorder."""


@pytest.fixture(scope="module")
def recorded(request):
    """Return time, signals of the sensors of a machine by name, and the speed [rpm]."""
    parameters = load_machine(request.param)
    machine, load = build_machine(parameters), next(iter(parameters.loads))
    record = simulate(machine, Case(load, parameters.loads[load], PROFILE))
    test = recorded_test_of(parameters)
    points = sensor_points(machine, test)
    signals = {n: recorded_signal(record, s, points[n]) for n, s in test.sensors.items()}
    signals["speed"] = record.drum_speed.values * 30.0 / np.pi
    return record.time.values, signals


def channel_of(time, values, name="S"):
    kind = "speed" if name == "speed" else "vibration"
    return Channel(name, kind, time, values, np.pi / 30.0 if kind == "speed" else 1.0)


@pytest.mark.parametrize(
    "recorded",
    [MACHINES[0], *(pytest.param(name, marks=pytest.mark.slow) for name in MACHINES[1:])],
    indirect=True,
)
def test_healthy_records_pass_all_checks(recorded):
    """Resample one run: five rates, five recorders, all sensors, and a held speed."""
    time, signals = recorded
    generator = np.random.default_rng(0)
    alarms, count = [], 0
    for rate in RATES:
        stamps = np.arange(0.0, time[-1], 1.0 / rate)
        for noise, digits in RECORDERS:
            for name, signal in signals.items():
                size = np.std(signal)
                values = np.interp(stamps, time, signal)
                values = values + noise * size * generator.standard_normal(len(stamps))
                if digits:
                    digit = 10.0 ** (np.round(np.log10(size)) + 1 - digits)
                    values = np.round(values / digit) * digit
                findings = examined(channel_of(stamps, values, name))[1]
                alarms += [(name, rate, noise, digits, str(each)) for each in findings]
                count += 1
        held = np.repeat(np.interp(stamps, time, signals["speed"])[:: int(rate / 2)], int(rate / 2))
        alarms += map(str, examined(channel_of(stamps, held[: len(stamps)], "speed"))[1])
    assert count >= 250
    assert not alarms


def zeros(of):
    of["S"][550:700] = 0.0


def held(of):
    of["S"][550:700] = of["S"][550]


def straight(of):
    of["S"][700:850] = np.linspace(of["S"][699], of["S"][850], 152)[1:-1]


def straight_and_rounded(of):
    of["S"][1000:1040] = np.round(np.linspace(of["S"][999], of["S"][1040], 42)[1:-1], 3)


def zeros_at_the_end(of):
    of["S"][-150:] = 0.0


def marks(of):
    of["S"][[100, 400, 700]] = -9999.0


def spikes(of):
    of["S"][[300, 301, 800]] += 60.0


def repeated(of):
    of["S"][600:660] = of["S"][540:600]


def clipped(of):
    np.clip(of["S"], None, 9.81 + 0.5 * (of["S"].max() - 9.81), out=of["S"])


def speed_off(of):
    of["speed"][800:950] = 0.1 * (np.arange(150) % 3)


def speed_held(of):
    of["speed"][800:950] = of["speed"][800]


def held_to_a_plateau(of):
    of["speed"][1440:1590] = of["speed"][1440]


def nearly_clipped(of):
    """Clip before a noisy amplifier."""
    limit = 9.81 + 0.5 * (of["S"].max() - 9.81)
    above = np.flatnonzero(of["S"] > limit)
    of["S"][above] = limit + 0.005 * np.sin(np.arange(len(above)))


def small_spikes(of):
    of["S"][[350, 500]] = 9.81 + 1.3 * np.percentile(np.abs(of["S"] - 9.81), 95.0)


def speed_mark(of):
    of["speed"][[700, 900]] = 65535.0


@pytest.mark.parametrize("recorded", MACHINES[:1], indirect=True)
@pytest.mark.parametrize(
    ("plant", "check", "samples"),
    [
        (zeros, "constant spans", 150),
        (held, "constant spans", 150),
        (zeros_at_the_end, "constant spans", 150),
        (straight, "straight spans", 150),
        (straight_and_rounded, "straight spans", 40),
        (marks, "marks of lost samples", 3),
        (spikes, "spikes", 3),
        (repeated, "repeated spans", 60),
        (clipped, "clipping", None),
        (speed_off, "jumps of the speed", 150),
        (speed_held, "constant spans", 150),
        (held_to_a_plateau, "jumps of the speed", 150),
        (nearly_clipped, "clipping", None),
        (small_spikes, "spikes", 2),
        (speed_mark, "marks of lost samples", 2),
    ],
)
def test_planted_faults_are_left_out(recorded, plant, check, samples):
    """Plant at 100 Hz, with noise of 0.02 m/s^2 and three digits."""
    time, signals = recorded
    stamps = np.arange(0.0, time[-1], 0.01)
    generator = np.random.default_rng(1)
    x = np.round(
        np.interp(stamps, time, signals["S1_z"]) + generator.normal(0.0, 0.02, len(stamps)), 3
    )
    speed = np.round(np.interp(stamps, time, signals["speed"]), 1)
    channels = {"S": x.copy(), "speed": speed.copy()}
    plant(channels)
    for name, clean in (("S", x), ("speed", speed)):
        values = channels[name]
        left, findings = examined(channel_of(stamps, values, name))
        changed = values != clean
        assert np.isnan(left[changed]).all()
        assert [each.check for each in findings] == [check] * bool(changed.any())
        if samples and changed.any():
            assert abs(np.isnan(left).sum() - samples) <= 2


@pytest.mark.parametrize("recorded", MACHINES[:1], indirect=True)
@pytest.mark.parametrize("has_speed", [True, False])
def test_a_clock_that_was_set_is_told_from_lost_samples(recorded, has_speed):
    time, signals = recorded
    stamps = np.arange(0.0, time[-1], 0.01)
    names = ["S1_x", "S1_z", "S2_x", *(["speed"] if has_speed else [])]
    columns = {n: np.interp(stamps, time, signals[n]) for n in names}
    set_forward = stamps + 0.5 * (np.arange(len(stamps)) >= 900)
    found = list(clock_jumps([channel_of(set_forward, x, n) for n, x in columns.items()]))
    assert [(f.spans[0][0], f.is_bridged) for f in found] == [(pytest.approx(8.99), False)]
    kept = np.r_[0:900, 950 : len(stamps)]
    lost = [channel_of(stamps[kept], x[kept], n) for n, x in columns.items()]
    assert not list(clock_jumps(lost))


@pytest.mark.parametrize(("tick", "lost"), [(0.05, ()), (1.0, ()), (0.05, range(500, 800))])
def test_ticks_of_a_slow_clock_are_spread(tmp_path, tick, lost):
    true = np.delete(0.01 * np.arange(1500), lost)
    table = np.column_stack([np.floor(true / tick + 1e-9) * tick, true])
    found, remark = with_ticks_spread(tmp_path, table)
    assert "100 Hz" in remark
    shift = found[:, 0] - found[:, 1]
    assert np.ptp(shift) < 0.01
    assert abs(shift.mean()) < tick


@pytest.mark.parametrize("per_turn", [1, 6])
def test_pulses_are_counted_with_missing_and_without_double_ones(per_turn):
    """Plant 12 missing and 12 double pulses in a run-up to 1400 rpm; healthy ones pass."""
    stamps = np.arange(0.0, 60.0, 1e-3)
    angle = np.cumsum(np.interp(stamps, (0, 50, 60), (0, 1400, 1400)) / 60.0) * 1e-3 * per_turn
    true = np.interp(np.arange(1.0, angle[-1]), angle, stamps)
    assert not counted(true, "T")[1]
    generator = np.random.default_rng(3)
    faults = generator.choice(np.arange(20, len(true) - 20, 5), 24, replace=False)
    double = true[faults[12:]] + 0.3 * (true[faults[12:] + 1] - true[faults[12:]])
    pulses, findings = counted(np.sort(np.append(np.delete(true, faults[:12]), double)), "T")
    assert [each.text.split()[0] for each in findings] == ["12", "12"]
    assert np.isin(pulses.times, true).all()
    np.testing.assert_array_equal(true[pulses.counts], pulses.times)
    np.testing.assert_allclose(
        pulses.speed(true[30:-30]), np.interp(true[30:-30], stamps, np.gradient(angle, stamps)),
        rtol=0.02,
    )  # fmt: skip
