"""The drive study: closed form of the smallest torque, planted thresholds."""

import numpy as np
import pytest
import xarray as xr
from made_up_runs import made_up
from motor_machines import isotropic_motor
from simple_machines import DAMPING, MASS, STIFFNESS, unbalance

from wm_drake.errors import InputError
from wm_drake.model.build import build_machine
from wm_drake.parameters import Load, SpinProfile, load_machine
from wm_drake.simulation.cases import Case
from wm_drake.studies.drive.study import (
    MEASURES,
    find_thresholds,
    motor_with_limit,
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


def test_a_machine_without_motor_or_with_a_table_is_refused():
    with pytest.raises(InputError, match=r"drive\.kind: machine 'reference' has a prescribed"):
        motor_with_limit(load_machine("reference"))
    table = {"speed": (0.0, 100.0), "torque": (2.0, 1.0)}
    with pytest.raises(InputError, match=r"drive\.torque_limit: is a table"):
        motor_with_limit(isotropic_motor(torque_limit=table))
