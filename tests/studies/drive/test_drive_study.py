"""The drive study: closed form of the smallest torque, planted thresholds, planted unbalance."""

import numpy as np
import pytest
import xarray as xr
from made_up_runs import made_up
from motor_machines import isotropic_motor
from simple_machines import DAMPING, MASS, STIFFNESS, unbalance

from wm_drake.errors import InputError
from wm_drake.model.build import build_machine
from wm_drake.parameters import Load, SpinProfile, Unbalance, load_machine
from wm_drake.simulation.cases import Case
from wm_drake.simulation.drive import orders_at_end
from wm_drake.studies.drive.study import (
    MEASURES,
    estimate_unbalance,
    find_thresholds,
    motor_with_limit,
    random_loads,
    torque_map,
)
from wm_drake.studies.experiment import Experiment

PROFILE = SpinProfile(time=(0.0, 60.0, 80.0), speed=(9.0, 18.0, 18.0))


def limit_of(case):
    return case.parameters.drive.torque_limit.torque


def planted(needed):
    """Return a function that runs cases: a drum passes if its limit is as large as its load needs."""

    def run(cases):
        good = np.array([limit_of(case) >= needed[case.name.split()[0]] for case in cases])
        caught = np.where(good, np.nan, 11.0)
        return xr.Dataset(
            {
                "drive_end_speed": ("run", np.where(good, 18.0, 11.0)),
                "drive_caught_speed": ("run", caught),
                "drive_caught_torque": ("run", caught),
            }
        )

    return run


def test_bisection_finds_planted_limits_and_says_what_is_out_of_range():
    machine = load_machine("motor")  # 2.2 N m at most
    needed = {"a": 0.5, "b": 1.37, "always": 1e-3, "never": 5.0}
    cases = [Case(name, Load(unbalances=()), PROFILE) for name in needed]
    found = find_thresholds(made_up(planted(needed), machine, cases))
    for name in ("a", "b"):
        of = found.sel(load=name)
        assert of.caught_below < needed[name] <= of.passes_from
        assert of.passes_from < 1.02 * of.caught_below
        assert of.caught == 11.0
    assert found.caught_below.sel(load="always") == 0.0
    assert found.passes_from.sel(load="always") == pytest.approx(0.022)
    assert found.caught_below.sel(load="never") == 2.2
    assert np.isnan(found.passes_from.sel(load="never"))


def test_the_smallest_torque_is_the_largest_of_the_whirl():
    """Compare with T = c w X^2 of an unbalanced rotor on an isotropic support, see test_drive."""
    machine = build_machine(
        isotropic_motor(
            torque_limit={"torque": 0.2},
            controller={"proportional_gain": 0.02, "integral_gain": 0.02},
        )
    )

    load = Case("c", unbalance(0.5), PROFILE)
    found = find_thresholds(Experiment(machine, MEASURES, loads=(load,)))
    speeds = np.linspace(9.0, 16.0, 7001)
    x = 0.125 * speeds**2 / np.hypot(STIFFNESS - (MASS + 0.5) * speeds**2, DAMPING * speeds)
    largest = np.max(DAMPING * speeds * x**2) / 12.0
    assert found.passes_from.item() == pytest.approx(largest, rel=0.05)
    assert found.caught.item() == pytest.approx(speeds[np.argmax(speeds * x**2)], rel=0.02)


def test_a_map_scales_the_masses():
    needed = {"0.5": 0.3, "1": 0.6}
    found = torque_map(
        made_up(planted(needed), load_machine("motor")),
        Case("c", unbalance(2.0, radius=0.2), PROFILE),
        [0.2, 0.4, 0.8],
        [0.5, 1.0],
    )
    np.testing.assert_allclose(found.sum_of_mass_times_radius, [0.2, 0.4])
    np.testing.assert_array_equal(found.end, [[11.0, 18.0, 18.0], [11.0, 11.0, 18.0]])


def test_unbalance_is_the_part_of_torque_and_acceleration_that_goes_round():
    """Plant J w' = T - m r g sin(phi + phase); the controller answers with any T of order one."""
    inertia, g, rng = 0.4, 9.81, np.random.default_rng(1)
    machine = load_machine("motor").model_copy(update={"gravity": g})
    loads = random_loads(20, 3, unbalance(1.0))
    moments = [
        sum(u.mass * u.radius * np.exp(1j * u.phase) for u in load.unbalances) for load in loads
    ]

    def run(cases):
        torque = rng.normal(size=(len(cases), 2))
        pulls = [(-g * u.imag, -g * u.real) for u in moments]  # -g U sin(phi + phase)
        acceleration = (torque + pulls) / inertia
        return xr.Dataset(
            {
                "drive_torque_order_one": (("run", "order"), torque),
                "drive_acceleration_order_one": (("run", "order"), acceleration),
            }
        )

    found = estimate_unbalance(made_up(run, machine), 9.0, loads, inertia)
    np.testing.assert_allclose(found.planted, np.abs(moments))
    np.testing.assert_allclose(found.estimated, found.planted, rtol=1e-9)


def test_parts_of_order_one_of_a_record():
    time = 5e-3 * np.arange(3001)
    angle = 9.0 * time + 0.02 * np.sin(9.0 * time)
    speed = 9.0 + 0.18 * np.cos(9.0 * time)
    torque = 2.0 + 0.7 * np.cos(angle) - 0.4 * np.sin(angle)
    of_torque, of_acceleration = orders_at_end(time, angle, speed, torque)
    np.testing.assert_allclose(of_torque, [0.7, -0.4], atol=1e-6)
    np.testing.assert_allclose(of_acceleration, [0.0, -9.0 * 0.18], atol=0.03)


def test_random_loads_follow_the_seed_only():
    some, more = random_loads(3, 5, unbalance(1.0)), random_loads(6, 5, unbalance(1.0))
    assert some == more[:3]
    assert random_loads(3, 6, unbalance(1.0)) != some
    assert all(isinstance(u, Unbalance) for load in some for u in load.unbalances)


def test_a_machine_without_motor_or_with_a_table_is_refused():
    with pytest.raises(InputError, match=r"drive\.kind: machine 'reference' has a prescribed"):
        motor_with_limit(load_machine("reference"))
    table = {"speed": (0.0, 100.0), "torque": (2.0, 1.0)}
    with pytest.raises(InputError, match=r"drive\.torque_limit: is a table"):
        motor_with_limit(isotropic_motor(torque_limit=table))
