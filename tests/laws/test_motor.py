"""Laws of a drive: torque limit over speed, PI controller with anti-windup, friction of the drum."""

from types import SimpleNamespace

import numpy as np
import pytest

from wm_drake.compiler.compilation import generic
from wm_drake.elements.layouts import packed_torque_limit
from wm_drake.elements.motor import MOTOR_STATE, motor_response, packed_motor, sampled_state
from wm_drake.laws.motor import drum_friction, integral_rate, limited, speed_controller
from wm_drake.laws.motor import torque_limit as limit_at
from wm_drake.laws.table import pack_number
from wm_drake.parameters import with_values
from wm_drake.parameters.drive import MotorDrive, TorqueLimitTable

DRIVE = MotorDrive.model_validate(
    {
        "kind": "motor",
        "belt_ratio": 10.0,
        "rotor_inertia": 3e-4,
        "torque_limit": {"torque": 2.0, "power": 500.0},
        "controller": {"proportional_gain": 0.02, "integral_gain": 0.05},
        "bearing_friction": {"friction_torque": 0.4, "full_friction_rate": 2.0, "damping": 0.01},
    }
)


def torque_limit(speed, limit):
    return generic(limit_at)(speed, limit)


def test_the_torque_is_constant_up_to_the_base_speed_and_the_power_beyond():
    limit = SimpleNamespace(torque=2.0, base_speed=250.0, table=(pack_number(0.0), 0))
    for speed in (0.0, 100.0, -249.0):
        assert torque_limit(speed, limit) == 2.0
    for speed in (251.0, -400.0, 1500.0):
        assert torque_limit(speed, limit) * abs(speed) == pytest.approx(500.0)
    constant = SimpleNamespace(torque=2.0, base_speed=np.inf, table=(pack_number(0.0), 0))
    assert torque_limit(0.0, constant) == torque_limit(1e6, constant) == 2.0


def test_a_table_goes_through_its_points_and_is_constant_beyond_the_last():
    table = TorqueLimitTable(speed=(0.0, 100.0, 200.0, 400.0), torque=(2.0, 1.8, 0.9, 0.2))
    limit = SimpleNamespace(torque=0.0, base_speed=np.inf, table=(packed_torque_limit(table), 0))
    for speed, torque in zip(table.speed, table.torque, strict=True):
        assert torque_limit(speed, limit) == pytest.approx(torque)
        assert torque_limit(-speed, limit) == pytest.approx(torque)
    assert torque_limit(1e4, limit) == pytest.approx(0.2)
    between = [torque_limit(speed, limit) for speed in np.linspace(0.0, 400.0, 81)]
    assert np.all(np.diff(between) < 1e-12)  # monotone, as its points


def test_a_demand_is_cut_at_the_limit_in_both_directions():
    found = [limited(demand, 1.5) for demand in (-9.0, -1.5, -0.3, 0.0, 1.2, 1.6)]
    np.testing.assert_array_equal(found, [-1.5, -1.5, -0.3, 0.0, 1.2, 1.5])


def test_the_integral_part_follows_a_limited_torque_instead_of_winding_up():
    """Hold the error e and the limit L: I' = K_i e + (L - K_p e - I) K_i / K_p rests at I = L."""
    controller = SimpleNamespace(proportional_gain=0.02, integral_gain=0.05, tracking_rate=2.5)
    error, limit, integral, step = 50.0, 0.6, 0.0, 1e-3
    for _ in range(int(5.0 / step)):
        demand = speed_controller.py_func(error, integral, controller)
        torque = limited(demand, limit)
        integral += step * integral_rate.py_func(error, demand, torque, controller)
    assert integral == pytest.approx(limit, rel=1e-4)
    # no limit: K_i e
    assert integral_rate.py_func(3.0, 0.1, 0.1, controller) == pytest.approx(0.15)


def test_friction_of_the_drum_opposes_it_and_saturates():
    friction = DRIVE.bearing_friction
    assert drum_friction.py_func(0.0, friction) == 0.0
    assert drum_friction.py_func(5.0, friction) == pytest.approx(-0.4 - 0.05)
    assert drum_friction.py_func(-5.0, friction) == pytest.approx(0.4 + 0.05)
    assert drum_friction.py_func(1.0, friction) == pytest.approx(-0.4 * np.sin(np.pi / 4.0) - 0.01)


def test_all_numbers_of_motor_and_controller_are_those_of_the_motors_shaft():
    """Let the drum lag by 0.5 rad/s: e = 5 rad/s at the motor, T = 10 (0.02 * 5 + I) at the drum."""
    packed = packed_motor(DRIVE)
    state = MOTOR_STATE.unpack(np.array([0.03, 0.0]))
    torque, growth = generic(motor_response)(state, 20.0, 20.5, packed, 0)
    assert torque == pytest.approx(10.0 * (0.1 + 0.03))
    assert growth == pytest.approx(0.05 * 5.0)
    # 1000 rad/s at the motor
    torque, growth = generic(motor_response)(state, 100.0, 300.0, packed, 0)
    assert torque == pytest.approx(10.0 * 500.0 / 1000.0)
    assert growth == pytest.approx(0.05 * 2000.0 + 2.5 * (0.5 - (0.02 * 2000.0 + 0.03)))


def test_a_sampled_controller_holds_its_demand():
    sampled = with_values(DRIVE, {"controller.sample_time": 0.01})
    packed = packed_motor(sampled)
    state = MOTOR_STATE.unpack(np.array([0.03, 0.07]))
    torque, growth = generic(motor_response)(state, 20.0, 20.5, packed, 0)
    assert (torque, growth) == (pytest.approx(0.7), 0.0)
    integral, demand = generic(sampled_state)(state, 20.0, 20.5, packed, 0)
    assert demand == pytest.approx(0.13)
    assert integral == pytest.approx(0.03 + 0.01 * 0.25)
