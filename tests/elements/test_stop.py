"""Stops: the law against closed forms, the element in both engines, its energy, its place."""

import numpy as np
import pytest
from both_engines import check_alike, difference
from element_ports import check_derivatives
from energy_book import EnergyBook, dense_record, elastic_energy
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from side_by_side import cases_with, check_runs_alone

from wm_drake.elements.kind import Ends
from wm_drake.elements.layouts import packed_stiffness
from wm_drake.elements.stop import NUMBERS, STOP, Stop
from wm_drake.laws.stop import rubbing_force, stop_force
from wm_drake.model.build import build_machine
from wm_drake.model.scene import Scene
from wm_drake.parameters import MachineParameters, SpinProfile, load_machine
from wm_drake.parameters.elements import ForceTable
from wm_drake.simulation.cases import Case
from wm_drake.simulation.runs import simulate
from wm_drake.systems.element_system import element_system

PROGRESSIVE = ForceTable(displacement=(0.0, 0.004, 0.008), force=(0.0, 200.0, 900.0))
FRAMES = {"tub_frame": "damper_left_tub", "housing_frame": "damper_left_housing"}
BUFFER = {"kind": "stop", **FRAMES, "gap": 0.002, "stiffness": 4e4, "loss": 0.4, "friction": 0.3}
FILE = """\
extends: reference
elements:
  left:
    kind: stop
    tub_frame: damper_left_tub
    housing_frame: damper_left_housing
    gap: 2 mm
    stiffness: 40 N/mm
    loss: 0.4 s/m
"""
PROFILE = SpinProfile(time=(0.0, 1.0, 3.0), speed=(5.0, 18.0, 18.0))


def with_stop(**changes):
    tree = load_machine("reference").model_dump(exclude_unset=True)
    return MachineParameters.model_validate(tree | {"elements": {"left": BUFFER | changes}})


def fall(velocity, stiffness, loss, mass=8.0):
    """Return time, compression and rate of a mass that meets a buffer, until it leaves it."""
    packed = packed_stiffness(stiffness), 0

    def rates(_, state):
        return state[1], -stop_force(state[0], state[1], loss, packed) / mass

    def leaves(_, state):
        return state[0]

    leaves.terminal, leaves.direction = True, -1.0
    start = 0.0, velocity
    found = solve_ivp(rates, (0.0, 1.0), start, events=leaves, rtol=1e-10, atol=1e-12)
    assert found.status == 1
    return found.t, *found.y


@pytest.mark.parametrize("velocity", [0.05, 0.4, 1.6])
@pytest.mark.parametrize("stiffness", [3e4, PROGRESSIVE], ids=["linear", "progressive"])
def test_restitution_is_that_of_the_closed_form(stiffness, velocity):
    loss = 0.5
    _, _, rate = fall(velocity, stiffness, loss)

    def balance(w):
        x, y = loss * velocity, loss * w
        return x - np.log1p(x) + y + np.log1p(-y)

    assert -rate[-1] == pytest.approx(brentq(balance, 1e-9, velocity), rel=1e-6)


def test_small_velocities_lose_two_thirds_of_the_loss():
    velocity, loss = 0.02, 0.5
    _, _, rate = fall(velocity, 3e4, loss)
    assert 1.0 + rate[-1] / velocity == pytest.approx(2.0 / 3.0 * loss * velocity, rel=0.02)


def test_without_loss_a_contact_is_half_a_period_and_keeps_the_energy():
    mass, stiffness, velocity = 8.0, 3e4, 0.7
    time, compression, rate = fall(velocity, stiffness, 0.0, mass)
    assert time[-1] == pytest.approx(np.pi * np.sqrt(mass / stiffness), rel=1e-7)
    assert compression.max() == pytest.approx(velocity * np.sqrt(mass / stiffness), rel=1e-3)
    assert -rate[-1] == pytest.approx(velocity, rel=1e-7)


def test_a_buffer_never_pulls():
    packed = packed_stiffness(3e4), 0
    d, v = np.meshgrid(np.linspace(-0.01, 0.01, 21), np.linspace(-6.0, 6.0, 21))
    forces = [stop_force(*state, 0.5, packed) for state in zip(d.ravel(), v.ravel(), strict=True)]
    assert min(forces) == 0.0
    assert [f for f, x in zip(forces, d.ravel(), strict=True) if x <= 0.0 and f != 0.0] == []


def test_rubbing_is_coulombs_beyond_the_smooth_range():
    force = rubbing_force(200.0, (0.3, -0.4, 0.0), 0.25, 1e-4)
    np.testing.assert_allclose(force, (-30.0, 40.0, 0.0), rtol=1e-6)
    at_full = rubbing_force(200.0, (0.01, 0.0, 0.0), 0.25, 0.01)
    assert at_full[0] == pytest.approx(-50.0 / np.sqrt(2.0))


def test_face_is_at_the_gap_and_pushes_the_point_away():
    point, foot = np.array([-0.1, 0.02, -0.2]), np.array([-0.25, 0.03, -0.5])
    ends = Ends(point, np.eye(3), foot, np.eye(3))
    placed = STOP.place(ends, Stop.model_validate({**BUFFER, "gap": 0.03, "friction": 0.0}))
    system = element_system(STOP, placed.packed())
    context = system.CreateDefaultContext()
    axis = (point - foot) / np.linalg.norm(point - foot)

    def force(moved):
        state = np.zeros(14)
        state[3:6] = -moved * axis
        system.GetInputPort("plant_state").FixValue(context, state)
        return system.GetOutputPort("generalized_force").Eval(context)[:6]

    np.testing.assert_array_equal(force(0.0299), np.zeros(6))
    pushed = force(0.032)
    np.testing.assert_allclose(pushed[3:], 4e4 * 0.002 * axis, rtol=1e-9)
    np.testing.assert_allclose(pushed[:3], np.cross(point, pushed[3:]), atol=1e-9)


def test_derivatives_are_those_of_differences():
    point, foot = np.array([-0.1, 0.02, -0.2]), np.array([-0.25, 0.03, -0.5])
    placed = STOP.place(Ends(point, np.eye(3), foot, np.eye(3)), Stop.model_validate(BUFFER))
    system = element_system(STOP, placed.packed())
    state = np.array([0.01, -0.02, 0.03, 0.02, 0.0, 0.03, 0.4, 0.1, -0.2, 0.1, -0.3, 0.2, 0.4, 7.0])
    state[3:6] -= 0.2 * (point - foot)  # deep in the buffer
    context = system.CreateDefaultContext()
    system.GetInputPort("plant_state").FixValue(context, state)
    assert np.abs(system.GetOutputPort("generalized_force").Eval(context)).max() > 100.0
    check_derivatives(system, state)


def test_both_engines_agree_at_random_states():
    assert difference(build_machine(with_stop())) < 1e-10


SHAPES = {"tub_frame": "shape tub_shell", "housing_frame": "shape detergent_box", "gap": None}


def test_bare_shapes_touch_where_their_distance_is_zero():
    machine = build_machine(with_stop(**SHAPES))
    placed, scene = machine.set_up().elements.others["left"], Scene(machine.parameters)
    numbers = NUMBERS.read(placed.packed(), 0)
    axis, point = np.array(numbers.axis), np.array(numbers.point)
    for moved in (0.0, 0.01, 0.02):
        pose = np.concatenate([np.zeros(3), -moved * axis])
        distance, _ = scene.nearest_points(pose, "tub_shell", "detergent_box")
        compression = numbers.reach - axis @ (pose[3:] + point)
        assert distance == pytest.approx(-compression, abs=2e-6)
    assert distance < 0.025
    assert difference(machine) < 1e-10


@pytest.mark.slow
def test_both_engines_move_alike():
    machine = build_machine(with_stop())
    case = Case("middle", machine.parameters.loads["middle"], PROFILE)
    ours, drake = (
        simulate(machine, case, step=2.5e-4),
        simulate(machine, case, "drake-accurate", step=2.5e-4),
    )
    assert ours.stop_force.max() > 30.0
    check_alike(ours, drake, ("displacement", "stop_force", "stop_compression"), 1e-4)


def test_eight_runs_side_by_side_are_single_runs():
    machine = build_machine(with_stop())
    cases = cases_with(machine, "elements.left.gap", 1e-3 * np.arange(1, 9), PROFILE)
    table = check_runs_alone(machine, cases)
    assert len(set(table.gasket_force.sel(axis="x").values)) > 4


@pytest.mark.slow
def test_energy_balances():
    """Store what the buffer holds; dissipate the loss and the friction, from the motion alone."""
    parameters = with_stop()
    stop = parameters.elements["left"]
    case = Case("middle", parameters.loads["middle"], PROFILE)
    setup, record = dense_record(build_machine(parameters), case, 1.5625e-4)
    book = EnergyBook(setup, case.load, record)
    work, change, dissipated = book.balance()
    numbers = NUMBERS.read(setup.elements.others["left"].packed(), 0)
    axis = np.array(numbers.axis)
    arm = book.rotation.apply(numbers.point)
    velocity = book.v + np.cross(book.w, arm)
    compression = numbers.reach - (book.position + arm) @ axis
    closing = -velocity @ axis
    touching = np.where(compression > 0.0, compression, 0.0)
    elastic = stop.stiffness * touching
    force = np.maximum(elastic * (1.0 + stop.loss * closing), 0.0)
    np.testing.assert_allclose(record.stop_force.values[:, 0], force, atol=1e-6)
    along = velocity + closing[:, None] * axis
    size = np.sum(along**2, axis=1)
    rubbed = stop.friction * force * size / np.sqrt(size + stop.full_friction_velocity**2)
    lost = book.integral((force - elastic) * closing + rubbed)
    energy = elastic_energy(stop.stiffness, touching)
    assert lost > 0.05  # J
    assert work - change - dissipated == pytest.approx(lost + energy[-1] - energy[0], rel=1e-2)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("2 mm", "-1 mm", "elements.left.gap: .* out of range"),
        ("2 mm", "2 m", "elements.left.gap: must be smaller than the distance"),
        ("40 N/mm", "40 N", "elements.left.stiffness: unit"),
        (
            "40 N/mm",
            "{displacement: 1 mm, force: 3 N}",
            "elements.left.stiffness",
        ),
        (
            "40 N/mm",
            "{displacement: '(1, 2) mm', force: '(3, 9) N'}",
            "elements.left.*: the first point of the table must be 0 N at 0 mm",
        ),
        ("loss", "los", "unknown key 'los'.*loss"),
        ("damper_left_tub", "shape tub_shell", "elements.left: .* a shape and a frame"),
        (
            f"{FRAMES['tub_frame']}\n    housing_frame: {FRAMES['housing_frame']}",
            "shape tub_shell\n    housing_frame: shape box",
            "elements.left: no pair of shapes 'tub_shell|box'",
        ),
    ],
)
def test_errors_of_a_machine_file_name_the_key(old, new, message, check_refused):
    check_refused(FILE.replace(old, new), message)
