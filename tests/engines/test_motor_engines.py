"""A drum that a motor turns: the compiled machine against the Drake diagram, the strong drive, the energy."""

import numpy as np
import pytest
from both_engines import LOAD, check_alike, difference
from energy_book import EnergyBook
from motor_machines import isotropic_motor
from moving_cabinet import with_moving_cabinet
from simple_machines import unbalance

from wm_drake.engines.compiled.run import run_compiled
from wm_drake.engines.compiled.step_check import drum_inertia, fastest_motions
from wm_drake.engines.schedule import schedule_of
from wm_drake.errors import InputError
from wm_drake.model.build import build_machine
from wm_drake.parameters import SpinProfile, load_machine, with_values
from wm_drake.simulation.cases import Case
from wm_drake.simulation.records import as_record
from wm_drake.simulation.runs import simulate

RUN_UP = SpinProfile(time=(0.0, 0.501, 1.5), speed=(8.0, 10.0, 22.0))


@pytest.fixture(scope="module")
def driven(shipped):
    return shipped("motor")


def test_they_agree_with_other_numbers_and_with_a_table(driven):
    other = with_values(
        driven.parameters,
        {
            "drive.belt_ratio": 9.0,
            "drive.rotor_inertia": 9e-4,
            "drive.torque_limit.power": 200.0,
            "drive.controller.integral_gain": 0.0,
        },
    )
    assert difference(driven, parameters=other) < 1e-10
    table = with_values(
        driven.parameters,
        {"drive.torque_limit": {"speed": [0.0, 200.0, 900.0], "torque": [2.0, 1.0, 0.1]}},
    )
    machine = build_machine(table)
    assert difference(machine) < 1e-10
    with pytest.raises(InputError, match=r"drive\.torque_limit: .* rebuild the machine"):
        machine.set_up(parameters=driven.parameters)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        pytest.param({"drive.controller.sample_time": 0.01}, marks=pytest.mark.slow),
        pytest.param({"drive.torque_limit.torque": 0.3}, marks=pytest.mark.slow),
    ],
    ids=["continuous", "sampled", "weak"],
)
def test_a_run_moves_as_in_drake(changes):
    machine = build_machine(with_values(load_machine("motor"), changes))
    case = Case("two", LOAD, RUN_UP)
    drake, usual = simulate(machine, case, "drake-accurate"), simulate(machine, case)
    fine = simulate(machine, case, step=2.5e-3 / 16)
    assert usual.attrs["integrator"] == ("runge_kutta" if "sample" in str(changes) else "multistep")
    variables = "displacement", "drum_speed", "drum_angle", "motor_torque"
    check_alike(fine, drake, variables, 3e-4)
    check_alike(usual, fine, variables, 3e-3)
    assert float(np.abs(drake.drum_speed - RUN_UP.speed_at(drake.time)).max()) > 0.1  # it is weak


def test_the_prescribed_speed_is_the_limit_of_strong_drives(machine):
    """Check that twice the controller gain halves the error of the motion: order 1 of the gain."""
    profile, load = SpinProfile(time=(0.0, 2.0), speed=(6.0, 12.0)), unbalance(0.5)
    gains, errors = (0.1, 0.2, 0.4, 0.8), []  # times 144: 14 to 115 N m s/rad at the drum
    expected = simulate(machine, Case("c", load, profile), step=2.5e-3 / 4)
    free = {"torque": 1e6}
    driven = build_machine(
        with_values(
            load_machine("motor"),
            {"drive.torque_limit": free, "drive.bearing_friction.friction_torque": 0.0},
        )
    )
    for gain in gains:
        strong = with_values(
            driven.parameters,
            {"drive.controller.proportional_gain": gain, "drive.controller.integral_gain": 0.0},
        )
        found = simulate(driven, Case("c", load, profile, parameters=strong), step=2.5e-3 / 4)
        last = found.time.values > 1.0  # the start of the ramp is a jump of the acceleration
        lag = np.abs(found.drum_speed - expected.drum_speed).values[last].max()
        errors.append(lag)
    ratios = np.divide(errors[:-1], errors[1:])
    np.testing.assert_allclose(ratios, 2.0, rtol=0.05)
    assert errors[-1] < 0.05  # rad/s, and it goes on falling


def test_the_work_of_the_motor_is_stored_or_dissipated(driven):
    """Use the book of bodies, springs, gasket and dampers; add the friction of the drum here."""
    load = driven.parameters.loads["middle"]
    profile = SpinProfile(time=(0.0, 1.2), speed=(6.0, 20.0))
    setup = driven.set_up(load)
    step = 2.5e-3 / 8
    run = run_compiled(setup, profile, step, lambda done: None, step)
    setup = driven.set_up(load)
    record = as_record(setup, Case("middle", load, profile), run)
    book = EnergyBook(setup, load, record)
    drive = setup.motor
    book.plant.get_joint_actuator(book.plant.GetJointActuatorIndices()[0]).SetRotorInertia(
        book.context, drive.rotor_inertia * (1.0 - 1.0 / drive.belt_ratio)
    )
    work, change, dissipated = book.balance()
    friction, rate = drive.bearing_friction, record.drum_speed.values
    share = np.minimum(np.abs(rate) / friction.full_friction_rate, 1.0)
    dry = friction.friction_torque * np.sin(0.5 * np.pi * share)
    dissipated += book.integral(dry * np.abs(rate) + friction.damping * rate**2)
    assert work > 50.0  # J
    assert work == pytest.approx(change + dissipated, rel=2e-5)


def test_steps_end_at_the_samples_of_a_controller():
    profile = SpinProfile(time=(0.0, 0.0512, 0.2), speed=(0.0, 5.0, 5.0))
    schedule = schedule_of(profile, 2.5e-3, 5e-3, 4e-3)
    begins = np.cumsum(schedule.step) - schedule.step
    np.testing.assert_allclose(begins[schedule.controls], 4e-3 * np.arange(51), atol=1e-12)
    assert not schedule_of(profile, 2.5e-3, 5e-3).controls.any()


def test_a_fast_controller_asks_for_a_shorter_step_and_an_unstable_sample_time_is_refused():
    quick = build_machine(
        isotropic_motor(controller={"proportional_gain": 20.0, "integral_gain": 0.0})
    )
    setup = quick.set_up()
    motion = fastest_motions(setup)["the drum with its motor"]
    # drum of 0.3 and tub of 5 * 0.3 kg m^2, which gives way
    inertia = 1.0 / (1.0 / 0.3 + 1.0 / 1.5)
    assert drum_inertia(setup) == pytest.approx(0.3)
    assert motion.rate == pytest.approx(144.0 * 20.0 / inertia, rel=1e-3)
    case = Case("c", unbalance(0.1), RUN_UP)
    with pytest.raises(InputError, match="too long for the drum with its motor"):
        simulate(quick, case)
    sampled = build_machine(
        isotropic_motor(controller={"proportional_gain": 0.5, "sample_time": 0.02})
    )
    with pytest.raises(InputError, match=r"sample_time: 20 ms is too long .* unstable"):
        simulate(sampled, case)


@pytest.mark.slow
def test_a_run_on_a_cabinet_that_moves_is_as_in_drake():
    """Run motor and cabinet together, at a friction at which the feet slide."""
    machine = build_machine(with_moving_cabinet(load_machine("motor"), friction=0.12))
    case = Case("two", LOAD, SpinProfile(time=(0.0, 0.101, 0.7), speed=(8.0, 12.0, 24.0)))
    drake, usual = simulate(machine, case, "drake-accurate"), simulate(machine, case)
    fine = simulate(machine, case, step=2.5e-3 / 16)
    assert usual.attrs["integrator"] == "multistep"
    assert float(np.abs(drake.foot_slip).max()) > 1e-4
    assert float(np.abs(drake.drum_speed - case.profile.speed_at(drake.time)).max()) > 0.1
    variables = "displacement", "drum_speed", "drum_angle", "motor_torque"
    variables += "floor_force", "cabinet_position", "foot_slip"
    check_alike(fine, drake, variables, 1e-3)
    check_alike(usual, fine, variables, 1e-2)
