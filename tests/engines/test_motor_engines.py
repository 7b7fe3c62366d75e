"""A drum that a motor turns: the compiled machine against the Drake diagram, the strong drive, the energy."""

import numpy as np
import pytest
from energy_book import EnergyBook
from motor_machines import isotropic_motor
from moving_cabinet import with_moving_cabinet
from simple_machines import unbalance

from wm_drake.engines.compiled.derivative import StateDerivative
from wm_drake.engines.compiled.run import run_compiled
from wm_drake.engines.compiled.step_check import drum_inertia, fastest_motions
from wm_drake.engines.schedule import schedule_of
from wm_drake.errors import InputError
from wm_drake.model.build import build_machine
from wm_drake.parameters import Load, SpinProfile, Unbalance, load_machine, with_values
from wm_drake.simulation.cases import Case
from wm_drake.simulation.records import as_record
from wm_drake.simulation.runs import simulate

LOAD = Load(
    unbalances=(
        Unbalance(mass=1.3, radius=0.24, y=-0.1, phase=0.7),
        Unbalance(mass=0.4, radius=0.2, y=0.12, phase=2.9),
    )
)
SIZES = np.array([1.0, 1.2, 1.0] + [0.15] * 3 + [30.0] + [8.0] * 3 + [3.0] * 3 + [60.0])
VECTORS = (slice(0, 3), slice(3, 6), slice(6, 7), slice(7, 10), slice(10, 13), slice(13, 14))
CABINET = (slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12))
RUN_UP = SpinProfile(time=(0.0, 0.501, 1.5), speed=(8.0, 10.0, 22.0))


@pytest.fixture(scope="module")
def driven():
    return build_machine(load_machine("motor"))


def worst_difference(machine, setup, count, seed=5):
    """Return the largest relative difference of the time derivatives, per vector, at random states."""
    rng, context = np.random.default_rng(seed), setup.context
    derivative, size = StateDerivative(setup), context.num_continuous_states()
    reference = machine.diagram.GetInputPort("drum_speed_reference")
    sizes = np.concatenate([SIZES, np.full(size - 15, 0.01), [2.0]])
    worst = 0.0
    for _ in range(count):
        state, wanted = rng.uniform(-1.0, 1.0, size) * sizes, rng.uniform(-60.0, 60.0)
        context.SetContinuousState(state)
        reference.FixValue(context, [wanted])
        drake = machine.diagram.EvalTimeDerivatives(context).CopyToVector()
        compiled = derivative(np.append(state, 0.0), rng.uniform(-20.0, 20.0), reference=wanted)
        for part in (*VECTORS, slice(14, size - 1), slice(size - 1, size)):
            scale = np.max(np.abs(drake[part]), initial=1e-3)
            worst = max(worst, np.max(np.abs(drake[part] - compiled[:size][part])) / scale)
    return worst


def test_derivatives_are_those_of_the_diagram_at_1000_random_states(driven):
    assert worst_difference(driven, driven.set_up(LOAD), 1000) < 1e-10


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
    assert worst_difference(driven, driven.set_up(LOAD, parameters=other), 100) < 1e-10
    table = with_values(
        driven.parameters,
        {"drive.torque_limit": {"speed": [0.0, 200.0, 900.0], "torque": [2.0, 1.0, 0.1]}},
    )
    machine = build_machine(table)
    assert worst_difference(machine, machine.set_up(LOAD), 100) < 1e-10
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
    drake, fine, usual = (
        simulate(machine, case, "drake"),
        simulate(machine, case, step=2.5e-3 / 16),
        simulate(machine, case),
    )
    assert usual.attrs["integrator"] == ("runge_kutta" if "sample" in str(changes) else "multistep")
    assert list(drake.data_vars) == list(fine.data_vars)
    for variable in ("displacement", "drum_speed", "drum_angle", "motor_torque"):
        size = float(np.abs(drake[variable]).max())
        np.testing.assert_allclose(fine[variable], drake[variable], atol=3e-4 * size)
        np.testing.assert_allclose(usual[variable], fine[variable], atol=3e-3 * size)
    assert float(np.abs(drake.drum_speed - RUN_UP.speed_at(drake.time)).max()) > 0.1  # it is weak


def test_the_prescribed_speed_is_the_limit_of_strong_drives():
    """Check that twice the controller gain halves the error of the motion: order 1 of the gain."""
    profile, load = SpinProfile(time=(0.0, 2.0), speed=(6.0, 12.0)), unbalance(0.5)
    gains, errors = (0.1, 0.2, 0.4, 0.8), []  # times 144: 14 to 115 N m s/rad at the drum
    prescribed = build_machine(load_machine("reference"))
    expected = simulate(prescribed, Case("c", load, profile), step=2.5e-3 / 4)
    free = {"torque": 1e6}
    machine = build_machine(
        with_values(
            load_machine("motor"),
            {"drive.torque_limit": free, "drive.bearing_friction.friction_torque": 0.0},
        )
    )
    for gain in gains:
        strong = with_values(
            machine.parameters,
            {
                "drive.controller.proportional_gain": gain,
                "drive.controller.integral_gain": 0.0,
            },
        )
        found = simulate(machine, Case("c", load, profile, parameters=strong), step=2.5e-3 / 4)
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
    inertia = 1.0 / (
        1.0 / 0.3 + 1.0 / 1.5
    )  # drum of 0.3 and tub of 5 * 0.3 kg m^2, which gives way
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
    case = Case("two", LOAD, SpinProfile(time=(0.0, 0.301, 1.0), speed=(8.0, 12.0, 20.0)))
    drake, fine, usual = (
        simulate(machine, case, "drake"),
        simulate(machine, case, step=2.5e-3 / 16),
        simulate(machine, case),
    )
    assert usual.attrs["integrator"] == "multistep"
    assert list(drake.data_vars) == list(fine.data_vars)
    assert float(np.abs(drake.foot_slip).max()) > 1e-4
    assert float(np.abs(drake.drum_speed - case.profile.speed_at(drake.time)).max()) > 0.1
    for variable in (
        *("displacement", "drum_speed", "drum_angle", "motor_torque", "floor_force"),
        *("cabinet_position", "foot_slip"),
    ):
        size = float(np.abs(drake[variable]).max())
        np.testing.assert_allclose(
            fine[variable], drake[variable], atol=1e-3 * size, err_msg=variable
        )
        np.testing.assert_allclose(
            usual[variable], fine[variable], atol=1e-2 * size, err_msg=variable
        )


def test_derivatives_agree_with_a_cabinet_that_moves():
    machine = build_machine(with_moving_cabinet(load_machine("motor")))
    setup, rng = machine.set_up(LOAD), np.random.default_rng(7)
    context, derivative = setup.context, StateDerivative(setup)
    reference = machine.diagram.GetInputPort("drum_speed_reference")
    tub, cabinet = machine.state_layout.states()
    body = np.delete(np.arange(14), (6, 13))
    worst = 0.0
    for _ in range(200):
        tree = rng.uniform(-1.0, 1.0, 14) * SIZES
        moving = rng.uniform(-1.0, 1.0, 14) * np.repeat([2e-3, 0.05], 7)
        sponges, slips = rng.uniform(-0.01, 0.01, 3), rng.uniform(-2e-3, 2e-3, 8)
        integral, wanted = rng.uniform(-2.0, 2.0), rng.uniform(-60.0, 60.0)
        state = np.zeros(context.num_continuous_states())
        state[cabinet] = moving
        state[tub] = tree
        state[-12:] = np.concatenate([sponges, slips, [integral]])
        context.SetContinuousState(state)
        reference.FixValue(context, [wanted])
        drake = machine.diagram.EvalTimeDerivatives(context).CopyToVector()
        x = np.concatenate([tree, sponges, [integral, 0.0], moving[body], slips])
        compiled = derivative(x, 3.0, reference=wanted)
        pairs = [(drake[tub][part], compiled[:14][part]) for part in VECTORS]
        pairs += [(drake[cabinet][body][part], compiled[19:31][part]) for part in CABINET]
        pairs += [(drake[-12:-9], compiled[14:17]), (drake[-9:-1], compiled[31:])]
        pairs.append((drake[-1:], compiled[17:18]))
        for its, mine in pairs:
            worst = max(worst, np.max(np.abs(its - mine)) / np.max(np.abs(its), initial=1e-3))
    assert worst < 1e-10
