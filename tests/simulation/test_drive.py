"""Measures of the drive: hand-made signals, and capture at the resonance of an unbalanced rotor on a linear support."""

import numpy as np
import pytest
from motor_machines import isotropic_motor
from simple_machines import DAMPING, MASS, STIFFNESS, unbalance

from wm_drake.model.build import build_machine
from wm_drake.parameters import SpinProfile, with_values
from wm_drake.simulation.cases import Case
from wm_drake.simulation.drive import capture, drive_measures, over_revolutions
from wm_drake.simulation.measures import measure
from wm_drake.simulation.runs import simulate

TIME = 5e-3 * np.arange(4001)  # s
HOLD = SpinProfile(time=(0.0, 20.0), speed=(20.0, 20.0))


def test_ripple_and_torques_of_a_speed_that_swings_once_a_revolution():
    """Take w = 20 + 0.4 sin(20 t): a spread of 0.8 in 20; T = 3 + 2 cos(20 t) has the mean 3."""
    speed = 20.0 + 0.4 * np.sin(20.0 * TIME)
    angle = 20.0 * TIME + 0.02 * (1.0 - np.cos(20.0 * TIME))
    torque = 3.0 + 2.0 * np.cos(20.0 * TIME)
    found = drive_measures(TIME, angle, speed, torque, HOLD)
    assert found.speed_ripple == pytest.approx(0.04, rel=2e-3)
    assert found.peak_torque == pytest.approx(5.0, rel=1e-3)
    assert found.mean_torque == pytest.approx(3.0, rel=2e-2)
    assert found.energy == pytest.approx(3.0 * 20.0 * 20.0, rel=1e-2)
    assert found.capture is None


def test_a_ramp_has_no_ripple():
    angle = 10.0 * TIME + 0.5 * TIME**2
    found = drive_measures(TIME, angle, 10.0 + TIME, np.full_like(TIME, 2.0), HOLD)
    assert found.speed_ripple < 2e-3
    mean = over_revolutions(TIME, angle, 10.0 + TIME)
    assert np.nanmax(np.abs(mean - (10.0 + TIME))) < 0.01
    assert np.isnan(mean[[0, -1]]).all()


def test_a_drum_that_stays_below_the_wanted_speed_is_caught_and_a_slow_one_is_not():
    wanted = SpinProfile(time=(0.0, 10.0, 20.0), speed=(5.0, 20.0, 20.0))
    stuck, torque = np.minimum(5.0 + 1.5 * TIME, 12.0), np.full_like(TIME, 1.7)
    found = capture(TIME, stuck, torque, wanted)
    assert found.speed == pytest.approx(12.0)
    assert found.torque == pytest.approx(1.7)
    assert found.end == pytest.approx(20.0)
    assert 3.0 < found.begin < 6.0  # it reaches 12 rad/s at 4.7 s, and is near it before
    assert capture(TIME, 5.0 + 0.6 * TIME, torque, wanted) is None  # behind, but on its way
    assert capture(TIME, wanted.speed_at(TIME), torque, wanted) is None
    swings = capture(TIME, 0.5 * np.sin(9.0 * TIME), torque, wanted)
    assert abs(swings.speed) < 0.1  # it cannot lift the unbalance


MASS_OF_UNBALANCE, RADIUS = 0.5, 0.25


def vibration_torque(speed):
    """Return the mean torque that the whirl of an unbalanced rotor takes at a constant speed. [N m]

    On an isotropic support the rotor's centre moves on a circle of radius X, and the damping force
    c w X takes the power c (w X)^2 = T w:

        T = c w X^2,  X = m r w^2 / |k - M w^2 + i c w|

    This is the vibrational moment of I. I. Blekhman, Vibrational Mechanics (World Scientific 2000),
    on the Sommerfeld effect; at resonance m r w^2 X. For a support that gives way in one direction
    it is half as much: V. O. Kononenko, Vibrating Systems with a Limited Power Supply (1969).
    """
    m, mass = MASS_OF_UNBALANCE, MASS + MASS_OF_UNBALANCE
    x = m * RADIUS * speed**2 / np.hypot(STIFFNESS - mass * speed**2, DAMPING * speed)
    return DAMPING * speed * x**2


@pytest.fixture(scope="module")
def slow_runs():
    """Return the largest vibration torque, its speed, and runs with limits relative to it."""
    speeds = np.linspace(9.0, 16.0, 7001)
    torque = vibration_torque(speeds)
    top, at = torque.max(), speeds[torque.argmax()]
    parameters = isotropic_motor(
        torque_limit={"torque": 1.0}, controller={"proportional_gain": 0.02, "integral_gain": 0.02}
    )
    machine = build_machine(parameters)
    profile = SpinProfile(time=(0.0, 60.0, 90.0), speed=(9.0, 18.0, 18.0))
    runs = {}
    for part in (0.5, 0.8, 0.94, 1.02):
        limit = with_values(parameters, {"drive.torque_limit.torque": part * top / 12.0})
        load = unbalance(MASS_OF_UNBALANCE, RADIUS)
        runs[part] = simulate(machine, Case("c", load, profile, parameters=limit))
    return top, at, runs


def test_a_weak_drive_is_caught_where_the_whirl_takes_all_of_its_torque(slow_runs):
    top, at, runs = slow_runs
    rising = np.linspace(9.0, at, 20001)
    for part in (0.5, 0.8, 0.94):
        found = measure(runs[part]).drive.capture
        expected = np.interp(part * top, vibration_torque(rising), rising)
        assert found.speed == pytest.approx(expected, rel=1e-5)
        assert found.torque == pytest.approx(part * top, rel=1e-6)
        assert found.end == pytest.approx(90.0)


def test_a_drive_passes_if_its_torque_is_above_the_largest_of_the_whirl(slow_runs):
    """Compare with the peak of the closed form: a slow run-up passes at +2 %, not at -6 %."""
    _, _, runs = slow_runs
    assert measure(runs[1.02]).drive.capture is None
    assert float(runs[1.02].drum_speed[-1]) == pytest.approx(18.0, abs=1e-6)
    assert float(runs[0.94].drum_speed[-1]) < 13.0
