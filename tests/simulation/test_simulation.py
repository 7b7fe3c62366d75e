"""Run-up of the reference machine in each engine: speed, energy, convergence, symmetry."""

from dataclasses import replace

import numpy as np
import pytest
from energy_book import EnergyBook, dense_record
from pydrake.systems.analysis import Simulator
from simple_machines import BODIES

from wm_drake.batch import simulate_many
from wm_drake.engines.compiled.stepping import Stepping
from wm_drake.engines.drake import advance_to
from wm_drake.errors import InputError
from wm_drake.model.build import build_machine
from wm_drake.parameters import Load, MachineParameters, SpinProfile, Unbalance, with_value
from wm_drake.simulation.cases import Case, case_of
from wm_drake.simulation.measures import measure
from wm_drake.simulation.records import load_record, save_record
from wm_drake.simulation.runs import DivergenceWarning, simulate

RPM = np.pi / 30.0
FAST_RUN_UP = SpinProfile(time=(0.0, 8.0, 9.0), speed=(0.0, 280 * RPM, 280 * RPM))


@pytest.fixture(scope="module", params=["compiled", "drake"])
def engine(request):
    return request.param


@pytest.fixture(scope="module")
def run_up(machine, engine):
    return simulate(machine, fast(machine.parameters, "middle"), engine)


def fast(parameters, load, **changes):
    return Case(load, parameters.loads[load], FAST_RUN_UP, **changes)


def test_run_up_is_sampled_every_5_ms_from_rest(run_up):
    np.testing.assert_allclose(run_up.time, 0.005 * np.arange(1801), atol=1e-9)
    assert np.max(np.abs(run_up.displacement.isel(time=0))) < 1e-9
    assert run_up.attrs["diverged"] == ""
    assert all(run_up[name].attrs["units"] for name in run_up.data_vars)


def test_drum_follows_a_profile_with_corners_off_the_grid(machine, reference, engine):
    profile = SpinProfile(time=(0.0, 0.3333, 1.00017, 1.5), speed=(0.0, 12.0, -5.0, -5.0))
    record = simulate(machine, Case("middle", reference.loads["middle"], profile), engine)
    assert (
        np.max(np.abs(record.drum_speed.values - profile.speed_at(record.time.values))) / RPM < 1e-5
    )


def test_motor_torque_agrees_with_inverse_dynamics(machine, reference, run_up):
    load = reference.loads["middle"]
    setup = machine.set_up(load)
    book = EnergyBook(setup, load, run_up)
    for index in range(130, 1800, 170):
        sample = run_up.isel(time=index)
        state = np.concatenate(
            [
                sample.tub_angle,
                sample.tub_position,
                [sample.drum_angle],
                sample.tub_angular_velocity,
                sample.tub_velocity,
                [sample.drum_speed],
                sample.damper_deformation,
            ]
        )
        setup.context.SetContinuousState(state[: setup.context.num_continuous_states()])
        alpha = FAST_RUN_UP.acceleration()[0 if float(sample.time) < FAST_RUN_UP.time[1] else 1]
        machine.set_drum_acceleration(setup.context, alpha)
        rate = machine.diagram.EvalTimeDerivatives(setup.context).CopyToVector()[7:14]
        elements = machine.plant.get_applied_generalized_force_input_port().Eval(
            setup.plant_context
        )
        # the same bodies without the drive's device
        book.bodies(index)
        inertia = book.plant.CalcMassMatrix(book.context) @ rate + book.plant.CalcBiasTerm(
            book.context
        )
        needed = inertia - book.plant.CalcGravityGeneralizedForces(book.context) - elements
        assert float(sample.motor_torque) == pytest.approx(needed[6], abs=1e-6)  # N m
        np.testing.assert_allclose(needed[:6], 0.0, atol=1e-6)  # the tub's six equations close


def check_energy(machine, case, step):
    setup, record = dense_record(machine, case, step)
    work, change, dissipated = EnergyBook(setup, case.load, record).balance()
    assert dissipated > 1.0  # J
    return abs(work - change - dissipated) / dissipated


@pytest.fixture(scope="module", params=["reference", "sponges"])
def of_each_damper(request):
    """Return a machine with smoothed dampers, and one whose dampers have a sponge."""
    return build_machine(request.getfixturevalue(request.param))


def test_energy_balances_over_a_fast_run_up(of_each_damper):
    # corners of the friction law limit every integrator: the residual falls with the step size
    profile = SpinProfile(time=(0.0, 3.0, 4.0), speed=(12.0, 24.0, 24.0))
    case = Case("middle", of_each_damper.parameters.loads["middle"], profile)
    assert check_energy(of_each_damper, case, 3.125e-4) < 1e-5


def peaks(record):
    return np.concatenate(
        [measure(record).amplitude.values, np.abs(record.bushing_force).max("time").values.ravel()]
    )


def test_peaks_of_a_fast_run_up_hold_at_a_fifth_of_the_step(machine, reference):
    case = fast(reference, "middle")
    np.testing.assert_allclose(
        peaks(simulate(machine, case)), peaks(simulate(machine, case, step=5e-4)), rtol=5e-4
    )


@pytest.mark.slow
@pytest.mark.parametrize("load", ["middle", "counter", "back", "front"])
def test_peaks_of_the_run_up_hold_at_a_tenth_of_the_step(machine, reference, load):
    case = case_of(reference, load)
    np.testing.assert_allclose(
        peaks(simulate(machine, case)), peaks(simulate(machine, case, step=2.5e-4)), rtol=5e-4
    )


def test_error_controlled_integration_agrees(machine, reference):
    case = fast(reference, "middle")
    record = simulate(machine, case)
    setup = machine.set_up(case.load)
    simulator = Simulator(machine.diagram, setup.context)
    integrator = simulator.get_mutable_integrator()  # Drake's default: RK3 with error control
    integrator.set_target_accuracy(1e-6)
    integrator.set_maximum_step_size(5e-3)
    machine.set_profile(setup.context, case.profile, setup.elements)
    advance_to(simulator, case.profile.duration, case.profile)
    assert not integrator.get_fixed_step_mode()
    final = machine.plant.GetPositions(setup.plant_context)
    fixed = np.concatenate([record.tub_angle.values[-1], record.tub_position.values[-1]])
    largest = np.abs(record.tub_position).max().item()
    assert np.max(np.abs(final[3:6] - fixed[3:])) < 5e-4 * largest
    assert final[6] == pytest.approx(record.drum_angle.values[-1], abs=1e-6)


def redrawn(parameters: MachineParameters, move) -> MachineParameters:
    """Return the machine with frames and centres of mass moved by a function of position."""
    setup = build_machine(parameters).set_up()
    plant, context = setup.machine.plant, setup.plant_context
    tree = parameters.model_dump()
    for index in plant.GetFrameIndices(plant.GetBodyByName("tub").model_instance()):
        frame = plant.get_frame(index)
        if frame.name().startswith(("spring_", "damper_", "gasket_", "sensor_", "detergent_")):
            tree["frames"][frame.name()] = {
                "position": tuple(move(frame.CalcPoseInBodyFrame(context).translation()))
            }
    for name in BODIES:
        body = plant.GetBodyByName(name)
        centre = body.CalcCenterOfMassInBodyFrame(context)
        tree["bodies"][name] = {"centre_of_mass": tuple(move(centre))}
        about_centre = body.CalcSpatialInertiaInBodyFrame(context).Shift(centre)
        turn = np.array([move(axis) - move(np.zeros(3)) for axis in np.eye(3)])
        inertia = turn @ about_centre.CalcRotationalInertia().CopyToFullMatrix3() @ turn.T
        tree["bodies"][name]["inertia"] = {
            f"{'xyz'[i]}{'xyz'[j]}": inertia[i, j] for i in range(3) for j in range(i, 3)
        }
    return MachineParameters.model_validate(tree)


def test_mirrored_machine_moves_as_the_mirror_image(machine, reference):
    profile = SpinProfile(time=(0.0, 4.0), speed=(0.0, 24.0))
    backwards = SpinProfile(time=(0.0, 4.0), speed=(0.0, -24.0))
    load = Load(unbalances=(Unbalance(mass=0.7, radius=0.25, y=-0.1, phase=0.4),))
    image = Load(unbalances=(Unbalance(mass=0.7, radius=0.25, y=-0.1, phase=-0.4),))
    record = simulate(machine, Case("one", load, profile))
    reflected = simulate(
        build_machine(redrawn(reference, lambda p: p * np.array([-1.0, 1.0, 1.0]))),
        Case("one", image, backwards),
    )
    np.testing.assert_allclose(
        reflected.tub_position, record.tub_position * np.array([-1, 1, 1]), atol=1e-9
    )
    np.testing.assert_allclose(
        reflected.tub_angle, record.tub_angle * np.array([1, -1, -1]), atol=1e-9
    )
    assert np.max(np.abs(record.tub_position.sel(axis="x"))) > 1e-3


def test_phase_shift_of_the_load_is_a_shift_of_the_start_angle(machine):
    shift = 0.9
    profile = SpinProfile(time=(0.0, 2.0), speed=(8.0, 20.0))
    base = Load(unbalances=(Unbalance(mass=0.7, radius=0.25, y=-0.1),))
    shifted = Load(unbalances=(Unbalance(mass=0.7, radius=0.25, y=-0.1, phase=shift),))
    derivatives = []
    for load, angle in ((base, shift), (shifted, 0.0)):
        setup = machine.set_up(load)
        state = setup.context.get_continuous_state_vector().CopyToVector()
        state[:14] += np.linspace(-0.01, 0.02, 14)
        state[6] = angle
        setup.context.SetContinuousState(state)
        derivatives.append(machine.diagram.EvalTimeDerivatives(setup.context).CopyToVector())
    np.testing.assert_allclose(derivatives[0], derivatives[1], rtol=1e-9, atol=1e-9)
    turned = simulate(machine, Case("one", shifted, profile), "drake")
    assert float(np.abs(turned.displacement).max()) > 1e-4


def test_moving_the_world_moves_the_machine_with_it(machine, upright):
    """Shift a machine along y: it has the same displacements.

    Every frame and centre of mass of tub and housing and the load are shifted by the same amount.
    """
    shift = np.array([0.0, 0.07, 0.0])
    moved = redrawn(upright, lambda p: p + shift)
    profile = SpinProfile(time=(0.0, 3.0), speed=(0.0, 18.0))
    base = Load(unbalances=(Unbalance(mass=0.7, radius=0.25, y=-0.1),))
    shifted = Load(unbalances=(Unbalance(mass=0.7, radius=0.25, y=-0.1 + shift[1]),))
    there = simulate(build_machine(moved), Case("one", shifted, profile))
    here = simulate(machine, Case("one", base, profile, parameters=upright))
    # m; rounding grows at friction's corners, a hundred times more near the resonance
    np.testing.assert_allclose(there.displacement, here.displacement, atol=1e-8)
    np.testing.assert_allclose(there.bushing_force, here.bushing_force, atol=1e-4)  # N
    assert float(np.abs(here.displacement).max()) > 1e-3


def test_diverging_run_stops_keeps_its_record_and_reports_time_and_reason(machine, engine):
    violent = Case(
        "violent", Load(unbalances=(Unbalance(mass=60.0, radius=0.3, y=0.1),)), FAST_RUN_UP
    )
    with pytest.warns(DivergenceWarning, match=r"diverged at .* s: (roll|pitch|yaw|x|y|z) = "):
        record = simulate(machine, violent, engine)
    assert "last good state at" in record.attrs["diverged"]
    assert 0.05 < record.time[-1] < FAST_RUN_UP.duration
    assert np.isfinite(record.displacement).all()
    assert np.max(np.abs(record.tub_position)) <= 0.5


def test_run_that_ends_in_nan_reports_it(sponges, engine, monkeypatch):
    # the sponge is so stiff that the second sample is NaN; Drake reports this itself
    monkeypatch.setattr(
        "wm_drake.simulation.runs.choose_stepping", lambda *_: Stepping("runge_kutta", 2.5e-3)
    )
    parameters = with_value(sponges, "damper_types.friction.sponge_stiffness", 1e15)
    case = Case("stiff", sponges.loads["middle"], FAST_RUN_UP, parameters=parameters)
    why = {"compiled": "roll = nan rad", "drake": "Detected NaN"}[engine]
    with pytest.warns(DivergenceWarning, match=rf"diverged at 0\.00\d s: {why}"):
        record = simulate(build_machine(sponges), case, engine)
    assert record.sizes["time"] == 1
    assert np.isfinite(record.displacement).all()


def test_records_are_reproducible_and_survive_the_disk(machine, reference, engine, tmp_path):
    case = Case(
        "middle",
        reference.loads["middle"],
        SpinProfile(time=(0.0, 1.0), speed=(0.0, 20.0)),
        gasket=False,
    )
    record = simulate(machine, case, engine)
    assert record.identical(simulate(machine, case, engine))
    save_record(record, tmp_path / "record.nc")
    loaded = load_record(tmp_path / "record.nc")
    assert loaded.equals(record)
    assert loaded.attrs["load"] == "middle"
    assert loaded.displacement.attrs["units"] == "m"
    assert not record.bushing_force.any()


def test_changes_of_one_record_do_not_reach_the_next(machine, reference):
    case = Case("middle", reference.loads["middle"], SpinProfile(time=(0.0, 0.1), speed=(0.0, 1.0)))
    record = simulate(machine, case)
    for name in record.coords:
        record[name].attrs["note"] = "mine"
    record = record.assign_coords(sensor=[f"new {name}" for name in record.sensor.values])
    another = simulate(machine, case)
    assert not any("note" in another[name].attrs for name in another.coords)
    assert list(another.sensor.values) == list(reference.sensors)


@pytest.mark.parametrize(
    "arguments", [{"engine": "adams"}, {"step": 3e-3}, {"step": 0.0}, {"step": 1e-2}]
)
def test_unknown_engine_or_unfit_step_is_refused(machine, arguments):
    with pytest.raises(InputError):
        simulate(machine, "middle", **arguments)


def test_a_case_of_changed_parameters_runs_with_them(machine, reference):
    force = tuple(0.5 * f for f in reference.gasket.stiffness_y.force)
    softer = with_value(reference, "gasket.stiffness_y.force", force)
    cases = [replace(case_of(one, "counter"), profile=FAST_RUN_UP) for one in (reference, softer)]
    force = simulate_many(machine, cases).gasket_force.sel(axis="y").values
    assert force[1] < 0.9 * force[0]
    alone = measure(simulate(machine, cases[1])).gasket_force.sel(axis="y")
    assert float(alone) == pytest.approx(force[1], rel=1e-9)
