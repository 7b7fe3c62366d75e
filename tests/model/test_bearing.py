"""What must hold of a drum that whirls in its bearing: closed forms, limits, energy, runs side by side, refusals."""

import numpy as np
import pytest
from element_ports import own_outputs
from machine_with_bearing import BEARING, stiffer, with_bearing
from side_by_side import check_runs_alone
from simple_machines import DAMPING, STIFFNESS, constant_speed, isotropic_machine, unbalance
from tube_energy import Motion, dense_run, energies_of_bodies, energy_of_bushings, still

from wm_drake.batch import simulate_many
from wm_drake.engines.compiled.step_check import fastest_motion
from wm_drake.errors import InputError
from wm_drake.model.build import build_machine
from wm_drake.parameters import (
    Bearing,
    Load,
    MachineParameters,
    SpinProfile,
    Unbalance,
    load_machine,
    machine_yaml,
    with_value,
)
from wm_drake.simulation.cases import Case
from wm_drake.simulation.runs import simulate
from wm_drake.studies.modes.natural import natural_modes

RUN_UP = SpinProfile(time=(0.0, 3.0), speed=(5.0, 30.0))
RADIAL, TILTING = 2e5, 5e3  # N/m, N m/rad
DRUM, TUB = 7.0, 35.0  # kg: one of six balls, and the others
SIX_BALLS = {
    "radial_stiffness": RADIAL,
    "tilting_stiffness": TILTING,
    "radial_damping": 120.0,
    "tilting_damping": 6.0,
    "y": 0.0,
}


@pytest.fixture(scope="module")
def whirling():
    return build_machine(with_bearing(load_machine("reference")))


@pytest.fixture(scope="module")
def balls():
    """Return tub and drum with centres of mass and bearing on To; the drum is slimmer across."""
    tree = isotropic_machine().model_dump()
    drum = tree["bodies"]["drum"] | {"inertia": {"xx": 0.2, "yy": 0.3, "zz": 0.2}}
    damped = {f"rotational_damping_{axis}": 40.0 for axis in "xyz"}
    tree |= {"bodies": tree["bodies"] | {"drum": drum}, "gasket": tree["gasket"] | damped}
    return build_machine(
        with_bearing(MachineParameters.model_validate(tree), step=5e-4, **SIX_BALLS)
    )


def drum_weight_and_depth(machine, setup):
    drum = machine.plant.GetBodyByName("drum")
    depth = drum.CalcCenterOfMassInBodyFrame(setup.plant_context)[1]
    return drum.get_mass(setup.plant_context) * setup.parameters.gravity, depth


def test_the_drum_sags_by_its_weight_over_the_stiffness(whirling, upright):
    setup = whirling.set_up(parameters=with_bearing(upright))
    weight, depth = drum_weight_and_depth(whirling, setup)
    own = own_outputs(whirling.bearing, whirling.bearing.GetMyContextFromRoot(setup.context))
    # m
    np.testing.assert_allclose(
        own[:3], [0.0, 0.0, -weight / BEARING["radial_stiffness"]], atol=1e-12
    )
    moment = weight * (BEARING["y"] - depth)  # its centre of mass hangs in front of the bearing
    np.testing.assert_allclose(
        own[3:6], [moment / BEARING["tilting_stiffness"], 0.0, 0.0], rtol=1e-6, atol=1e-12
    )
    np.testing.assert_allclose(own[6:], [0.0, 0.0, -weight, moment, 0.0, 0.0], rtol=1e-6, atol=1e-9)


def test_preloads_balance_the_machine_with_its_drum_sagged(whirling, machine, upright):
    setup = whirling.set_up(parameters=with_bearing(upright))
    perfect = machine.set_up(parameters=upright)
    assert np.abs(setup.residual).max() < 1e-9
    assert np.abs(setup.rest_pose).max() < 1e-12
    for name, spring in setup.springs.items():
        assert spring.preload == pytest.approx(perfect.springs[name].preload, rel=1e-3)
    whirling.set_drum_acceleration(setup.context, 0.0)
    assert np.abs(whirling.diagram.EvalTimeDerivatives(setup.context).CopyToVector()).max() < 1e-9


def response(record, values, along, across):
    """Return the complex amplitude of what turns with the drum: parts as cosine and as sine."""
    angle = record.drum_angle.values
    basis = np.column_stack([np.cos(angle), np.sin(angle), np.ones(len(angle))])
    in_phase, ahead, _ = np.linalg.lstsq(basis, values.sel(axis=along).values, rcond=None)[0]
    assert np.linalg.lstsq(basis, values.sel(axis=across).values, rcond=None)[0][
        1
    ] == pytest.approx(in_phase, rel=1e-3)
    return in_phase - 1j * ahead


def two_bodies(mass, stiffness, damping, inner, inner_stiffness, inner_damping, speed, force):
    """Return the complex amplitude of the inner body in the outer one, which hangs on a spring."""
    own, between = stiffness + 1j * speed * damping, inner_stiffness + 1j * speed * inner_damping
    matrix = [[own + between - mass * speed**2, -between], [-between, between - inner * speed**2]]
    outer, moved = np.linalg.solve(matrix, [0.0, force])
    return moved - outer


@pytest.mark.parametrize("ratio", [0.3, 0.9, 1.1, 1.6])
def test_whirl_is_that_of_a_rotor_on_two_springs(balls, ratio):
    critical = np.sqrt(RADIAL * (1.0 / DRUM + 1.0 / TUB))  # rad/s
    speed, mass = ratio * critical, 0.02
    record = simulate(balls, Case("one", unbalance(mass), constant_speed(speed, 22.0))).sel(
        time=slice(20.0, None)
    )
    expected = two_bodies(
        TUB, STIFFNESS, DAMPING, DRUM + mass, RADIAL, 120.0, speed, mass * 0.25 * speed**2
    )
    # phase 0 points up and turns towards the right
    found = response(record, record.drum_displacement, "z", "x")
    assert found == pytest.approx(expected, rel=2e-4)
    assert abs(record.drum_displacement.sel(axis="y")).max() < 1e-9
    # above its critical speed the drum turns about its centre
    assert np.angle(expected) < (-1.5 if ratio > 1.0 else 0.0)


@pytest.mark.parametrize("speed", [60.0, 300.0])
def test_a_couple_tilts_the_drum_as_its_gyroscopic_moment_lets_it(balls, speed):
    mass, depth = 0.005, 0.15
    ends = (
        Unbalance(mass=mass, radius=0.25, y=depth),
        Unbalance(mass=mass, radius=0.25, y=-depth, phase=np.pi),
    )
    record = simulate(balls, Case("two", Load(unbalances=ends), constant_speed(speed, 6.0))).sel(
        time=slice(4.0, None)
    )
    # kg m^2, means
    across, about = (0.2 + 2 * mass * (depth**2 + 0.25**2 / 2), 0.3 + 2 * mass * 0.25**2)
    couple = 2 * mass * 0.25 * depth * speed**2
    # a body that turns about its axis resists circular tilting with J_across - J_about
    expected = two_bodies(5 * 0.3, 4000.0, 40.0, across - about, TILTING, 6.0, speed, couple)
    angle = record.drum_angle.values
    basis = np.column_stack([np.cos(angle), np.sin(angle), np.ones(len(angle))])
    cosine, sine, _ = np.linalg.lstsq(basis, record.drum_tilt.sel(axis="x").values, rcond=None)[0]
    assert cosine - 1j * sine == pytest.approx(expected, rel=4e-3)
    assert abs(cosine - 1j * sine) < 0.9 * abs(couple / TILTING) or speed < 100.0


CLEARANCE, CONTACT, SOFT = 5e-5, 1e6, 1e3  # m, N/m, N/m
LOOSE = SIX_BALLS | {
    "radial_stiffness": SOFT,
    "radial_damping": 100.0,
    "clearance": CLEARANCE,
    "contact_stiffness": CONTACT,
    "contact_damping": 300.0,
}
SLOW, MASS = 25.0, 0.3  # rad/s, far below all modes of the bearing; kg


def loose_machine(gravity):
    """Return tub and drum as `balls` has them, the drum with play in its bearing."""
    tree = isotropic_machine().model_dump() | {"gravity": gravity}
    parameters = MachineParameters.model_validate(tree)
    return build_machine(with_bearing(parameters, step=2.5e-4, **LOOSE))


@pytest.fixture(scope="module")
def loose():
    return loose_machine(gravity=9.81)


def across(record):
    """Return the displacement of the drum across its axis as complex numbers, z + i x. [m]"""
    return record.drum_displacement.sel(axis="z").values + 1j * (
        record.drum_displacement.sel(axis="x").values
    )


def last_turns(record):
    return record.sel(time=slice(float(record.time[-1]) - 2.0, None))


def test_at_rest_the_drum_lies_at_the_bottom_of_its_clearance(loose):
    setup = loose.set_up()
    sag = setup.rest_pose[5] - setup.carrier_rest[5]
    pressed = (DRUM * 9.81 - SOFT * CLEARANCE) / (SOFT + CONTACT)
    assert sag == pytest.approx(CLEARANCE + pressed, rel=1e-4)  # the tub tilts a little
    assert np.abs(setup.residual).max() < 1e-8


@pytest.mark.parametrize("ratio", [0.5, 0.85, 1.2, 2.0])
def test_the_drum_is_pulled_out_where_the_rotating_force_exceeds_its_weight(loose, ratio):
    # at a speed far below the modes of the bearing the drum lies where the force on it points
    inner, weight = DRUM + MASS, (DRUM + MASS) * 9.81
    tub = STIFFNESS + 1j * SLOW * DAMPING - (inner + TUB) * SLOW**2
    moved_with_tub = abs(1.0 + inner * SLOW**2 / tub)
    radius = ratio * weight / (MASS * SLOW**2 * moved_with_tub)
    case = Case("one", unbalance(MASS, radius), constant_speed(SLOW, 14.0))
    record = last_turns(simulate(loose, case))
    moved = across(record)
    turns = np.ptp(np.unwrap(np.angle(moved))) / (2.0 * np.pi)
    assert (turns > 6.0) if ratio > 1.0 else (turns < 0.5)
    if 0.5 < ratio < 2.0:
        return  # near that speed the force vanishes once a turn, and the drum flies a part of it
    time, place = record.time.values, record.tub_position
    tub_path = place.sel(axis="z").values + 1j * place.sel(axis="x").values
    acceleration = np.gradient(np.gradient(tub_path, time), time)
    unbalanced = MASS * radius * SLOW**2 * np.exp(1j * record.drum_angle.values)
    force = unbalanced - weight - inner * acceleration
    size = (np.abs(force) + CONTACT * CLEARANCE) / (SOFT + CONTACT)
    wrong = np.abs(moved - size * force / np.abs(force))[2:-2]  # no differences at the ends
    # inertia and damping of the drum's motion in the bearing: 2 N of 70 to 210
    assert wrong.max() < 0.03 * size.max()


def test_without_gravity_the_orbit_is_a_circle_of_closed_form():
    machine, speed = loose_machine(gravity=0.0), 80.0
    mass, radius = 0.05, 0.25
    record = last_turns(
        simulate(machine, Case("one", unbalance(mass), constant_speed(speed, 14.0)))
    )
    # inner body: (N - u w^2) / (m w^2); outer body: N / (K + i w D - M w^2); N = k rho - k_c c
    k, m, u = SOFT + CONTACT, DRUM + mass, mass * radius
    tub = STIFFNESS - TUB * speed**2
    slope = 1.0 / (m * speed**2) - 1.0 / tub
    rho = (slope * CONTACT * CLEARANCE + u / m) / (k * slope - 1.0)
    found = np.abs(across(record))
    assert found == pytest.approx(abs(rho), rel=5e-3)
    assert abs(rho) > CLEARANCE


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ({"clearance": 1e-4}, "a clearance needs the stiffness of the contact beyond it"),
        ({"contact_stiffness": 1e7}, "belong to a clearance above 0"),
        ({"clearance": -1e-4, "contact_stiffness": 1e7}, "greater than or equal to 0"),
    ],
)
def test_a_clearance_and_its_contact_belong_together(numbers, message):
    with pytest.raises(ValueError, match=message):
        Bearing(**BEARING | numbers)


def test_amplitudes_tend_to_those_of_a_perfect_joint_with_the_give(machine, reference):
    load = reference.loads["front"]
    perfect = simulate(machine, Case("front", load, RUN_UP), step=2.5e-4).displacement.values
    apart = []
    for share in (0.25, 1.0, 4.0):
        parameters = with_bearing(reference, **stiffer(share))
        moved = simulate(build_machine(parameters), Case("front", load, RUN_UP)).displacement.values
        apart.append(np.abs(moved - perfect).max())
    assert 1e-6 < apart[0] < 1e-3  # m
    # first order
    np.testing.assert_allclose([apart[0] / apart[1], apart[1] / apart[2]], 4.0, rtol=0.1)


def test_energy_of_a_run_is_balanced():
    parameters = with_bearing(
        isotropic_machine(), **SIX_BALLS | {"y": 0.1, "torsional_damping": 3.0}
    )
    machine = build_machine(parameters)
    load, profile = unbalance(0.5, y=-0.1), SpinProfile(time=(0.0, 2.0), speed=(30.0, 120.0))
    setup = machine.set_up(load)
    run = dense_run(setup, profile, 1e-4)
    time, motion, carrier, torque = run.time, run.state, run.carrier, run.motor_torque
    tub, drum = Motion(motion), Motion(np.insert(carrier, (6, 12), 0.0, axis=1))
    bearing = (parameters.imperfections.bearing.as_bushing(), drum, setup.bearing, tub)
    gasket = (parameters.gasket, tub, setup.bushings["gasket"], still(len(time)))
    stored, power = energy_of_bushings([gasket, bearing])
    of_bearing = energy_of_bushings([bearing])[1]
    states = [(motion[k], np.insert(carrier[k], (6, 12), 0.0)) for k in (0, -1)]
    bodies = energies_of_bodies(machine, parameters, load, states)
    drive = np.trapezoid(torque * motion[:, 13], time)
    dissipated = np.trapezoid(power, time)
    assert np.trapezoid(of_bearing, time) > 0.3 * dissipated > 1.0  # J; the bearing's share
    change = bodies[1] - bodies[0] + stored[-1] - stored[0]
    assert abs(drive - change - dissipated) < 1e-5 * dissipated


@pytest.mark.parametrize("name", ["reference", pytest.param("free_stroke", marks=pytest.mark.slow)])
def test_runs_side_by_side_are_those_of_simulate(name):
    parameters = with_bearing(load_machine(name))
    whirling = build_machine(parameters)
    cases = [
        Case(
            f"{load} {k:g}",
            parameters.loads[load],
            RUN_UP,
            parameters=with_value(parameters, key, k),
        )
        for load in list(parameters.loads)[-2:]
        for key, k in (
            ("imperfections.bearing.radial_stiffness", 2e6),
            ("imperfections.residual_imbalance.mass", 0.1),
        )
    ]
    table = check_runs_alone(whirling, cases)
    assert table.amplitude.values[0] != pytest.approx(table.amplitude.values[1], rel=1e-6)


def test_modes_of_the_tub_hardly_change(whirling, machine):
    np.testing.assert_allclose(
        natural_modes(whirling).frequency, natural_modes(machine).frequency, rtol=5e-3
    )


def test_machines_with_and_without_do_not_mix(whirling, machine, reference):
    with pytest.raises(
        InputError,
        match=r"imperfections.bearing: is compliant; the built machine has a rigid bearing: rebuild",
    ):
        machine.set_up(parameters=whirling.parameters)
    with pytest.raises(
        InputError,
        match=r"imperfections.bearing: is rigid; the built machine has a compliant bearing: rebuild",
    ):
        whirling.set_up(parameters=reference)
    cases = [
        Case("one", reference.loads["front"], RUN_UP, parameters=p)
        for p in (reference, whirling.parameters)
    ]
    with pytest.raises(InputError, match=r"case 1 'one'.*imperfections.bearing"):
        simulate_many(machine, cases)


def test_the_fastest_motion_of_two_bodies_on_a_spring_is_the_closed_form(balls):
    axial = np.sqrt(BEARING["axial_stiffness"] * (1.0 / DRUM + 1.0 / TUB))
    # rad/s; the stiffest direction
    assert fastest_motion(balls.set_up()).rate == pytest.approx(axial, rel=1e-4)


def test_the_fastest_motion_counts_the_contact_though_the_drum_hangs_within_its_clearance():
    numbers = LOOSE | {"contact_stiffness": 1e8, "clearance": 1e-3}
    parameters = MachineParameters.model_validate(isotropic_machine().model_dump())
    floating = build_machine(with_bearing(parameters, step=2.5e-5, **numbers))  # no gravity
    radial = np.sqrt((1e8 + SOFT) * (1.0 / DRUM + 1.0 / TUB))  # rad/s
    assert fastest_motion(floating.set_up()).rate == pytest.approx(radial, rel=0.02)


@pytest.mark.parametrize(("pieces", "allowed"), [(5, "1 ms"), (7, "0.7143 ms, such as 0.625 ms")])
def test_a_step_too_long_for_the_bearing_is_refused_with_the_longest_one(
    whirling, reference, pieces, allowed
):
    # of a bearing that 5 ms over almost as many pieces would just follow
    share = ((pieces - 0.1) / 5e-3 / fastest_motion(whirling.set_up()).rate) ** 2
    parameters = with_bearing(reference, **stiffer(share))
    case = Case("front", reference.loads["front"], RUN_UP, parameters=parameters)
    told = rf"step: 2.5 ms is too long for the drum in its bearing, whose fastest motion oscillates at [\d.]+ Hz; allowed are up to {allowed}$"
    with pytest.raises(InputError, match=f"^{told}"):
        simulate(whirling, case, step=2.5e-3)
    with pytest.raises(InputError, match=f"^case 0 'front': {told}"):
        simulate_many(whirling, [case], step=2.5e-3)
    if pieces == 5:  # the longest one holds in both engines
        records = [
            simulate(whirling, case, engine, step=1e-3) for engine in ("compiled", "drake-accurate")
        ]
        assert [record.attrs["diverged"] for record in records] == ["", ""]
        np.testing.assert_allclose(records[0].displacement, records[1].displacement, atol=3e-6)  # m


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("radial_stiffness", "-1 N/mm", "'-1 N/mm' is out of range; allowed is > 0"),
        ("tilting_damping", "-1 N m s/rad", "allowed is >= 0"),
        ("axial_stiffness", "5 N m", "unit 'N m' does not fit"),
        ("radial_stifness", "5 N/mm", "did you mean 'radial_stiffness'"),
    ],
)
def test_wrong_numbers_are_refused(whirling, key, value, message):
    with pytest.raises(InputError, match=rf"imperfections.bearing.{key}: .*{message}"):
        with_value(whirling.parameters, f"imperfections.bearing.{key}", value)


def test_a_number_of_a_bearing_that_is_not_there_is_refused(reference):
    with pytest.raises(
        InputError,
        match=r"the machine has no 'imperfections.bearing'; to add it, write all of it in a",
    ):
        with_value(reference, "imperfections.bearing.radial_stiffness", "5 N/mm")


def test_a_bearing_that_cannot_hold_the_drum_is_refused(whirling):
    soft = with_value(whirling.parameters, "imperfections.bearing.radial_stiffness", 3e3)
    with pytest.raises(
        InputError,
        match=r"imperfections.bearing: cannot hold the drum: at rest it would sag by more than 20 mm",
    ):
        whirling.set_up(parameters=soft)


FILE = """
extends: reference
name: whirling
step: 0.5 ms
imperfections:
  bearing:
    radial_stiffness: {value: 10 N/mm, source: assumption}
    axial_stiffness: 8 kN/mm
    tilting_stiffness: 100 kN m/rad
    radial_damping: 1 N s/mm
    axial_damping: 1 N s/mm
    tilting_damping: 10 N m s/rad
    y: 150 mm
"""


def test_a_bearing_is_written_in_a_machine_file_and_back(tmp_path):
    (tmp_path / "mine.yaml").write_text(FILE)
    parameters = load_machine(tmp_path / "mine.yaml")
    bearing = parameters.imperfections.bearing
    assert (bearing.radial_stiffness, bearing.axial_stiffness, bearing.y) == pytest.approx(
        (1e4, 8e6, 0.15)
    )
    kind = bearing.as_bushing()
    assert kind.rotational_stiffness_y == kind.rotational_stiffness_x == 1e5
    assert parameters.sources["imperfections.bearing.radial_stiffness"] == "assumption"
    (tmp_path / "again.yaml").write_text(machine_yaml(parameters))
    assert load_machine(tmp_path / "again.yaml").imperfections == parameters.imperfections
