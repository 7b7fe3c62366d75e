"""Ball balancer: equations in both engines, energy, and motion against closed forms."""

import numpy as np
import pytest
from drum_rings import check_both_engines, with_rings
from element_ports import check_derivatives
from scipy.spatial.transform import Rotation

import wm_drake as wm
from wm_drake.elements.ball_ring import BALL_RING, DAMPING_RATIO, FULL_CONTACT, BallRing
from wm_drake.elements.kind import DrumPlace
from wm_drake.errors import InputError
from wm_drake.parameters import Load, MachineParameters, SpinProfile, load_machine
from wm_drake.systems.element_system import element_system

RING = {
    "kind": "ball_ring",
    "y": -0.15,
    "balls": 3,
    "ball_mass": 0.05,
    "ball_diameter": 0.022,
    "race_radius": 0.25,
    "damping": 1e-3,
    "rolling_resistance": 2e-3,
}
RIG_RING = {
    "kind": "ball_ring",
    "y": -0.02,
    "balls": 2,
    "ball_mass": 0.44e-3,
    "ball_diameter": 4.76e-3,
    "race_radius": 42.8e-3,
    "damping": 1.41e-5,
    "race_frequency": 3000.0 * np.pi,
    "start_angles": (0.0, 1.0),
}
PLACE = DrumPlace(
    np.array([0.01, -0.15, 0.02]),
    Rotation.from_euler("xyz", [0.1, 0.2, 0.3]).as_matrix(),
    np.array([0.0, 0.0, -9.81]),
)


def moved(balls, rng, ring=RING, place=PLACE):
    """Return states of a ring (7 n,) that is deflected, turns and has two balls in contact."""
    angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, balls))
    if balls > 1:
        angles[1] = angles[0] + 0.95 * ring["ball_diameter"] / ring["race_radius"]
    side, axis, top = place.tub_rotation.T
    places = ring["race_radius"] * (np.outer(np.sin(angles), side) + np.outer(np.cos(angles), top))
    velocities = rng.uniform(20.0, 40.0) * np.cross(axis, places)
    moves = rng.uniform(-1e-4, 1e-4, (balls, 3)), rng.uniform(-0.3, 0.3, (balls, 3))
    bristles = rng.uniform(-1.0, 1.0, (balls, 1))
    return np.hstack([places + moves[0], velocities + moves[1], bristles]).ravel()


@pytest.mark.parametrize("name", ["reference", "motor"])
def test_both_engines_agree_at_random_states(name):
    """Compare the accelerations of tub and drum, prescribed or turned by a motor, and all balls."""
    rings = {"front": RING, "rear": {**RING, "y": 0.15, "balls": 2}}
    upright = DrumPlace(np.zeros(3), np.eye(3), np.zeros(3))
    check_both_engines(
        wm.build_machine(with_rings(load_machine(name), **rings)),
        lambda rng: [moved(n, rng, place=upright) for n in (3, 2)],
    )


def law_at(state, motion, ring):
    """Return generalized force and rates of a ring alone from the state of tub and drum (14)."""
    placed = BALL_RING.place(PLACE, BallRing.model_validate(ring))
    system = element_system(placed.kind, placed.packed(), np.zeros(placed.state_size))
    context = system.CreateDefaultContext()
    system.GetInputPort("plant_state").FixValue(context, motion)
    context.SetContinuousState(state)
    force = system.GetOutputPort("generalized_force").Eval(context)
    return force, system.EvalTimeDerivatives(context).CopyToVector().reshape(-1, 7)


@pytest.mark.parametrize("balls", [1, 2, 5])
def test_power_and_momentum_balance(balls):
    """Balance what drum and tub give the balls, with damping, friction and contact."""
    rng = np.random.default_rng(balls)
    ring = {**RING, "balls": balls, "eccentricity": 5e-3, "eccentricity_phase": 0.5}
    mass, k = ring["ball_mass"], ring["ball_mass"] * (1000.0 * np.pi) ** 2
    for _ in range(20):
        motion = rng.uniform(-1.0, 1.0, 14) * ([0.3] * 3 + [0.05] * 3 + [9.0] + [2.0] * 6 + [60.0])
        states = moved(balls, rng, ring).reshape(-1, 7)
        force, rates = law_at(states.ravel(), motion, ring)
        v, acceleration, u = states[:, 3:6], rates[:, 3:6], rates[:, :3]
        given = mass * (acceleration - PLACE.gravity)
        np.testing.assert_allclose(force[3:6], -given.sum(axis=0), atol=1e-9 * k * 1e-3)
        R = Rotation.from_euler("xyz", motion[:3]).as_matrix()
        arms = (PLACE.tub_point + states[:, :3]) @ R.T
        np.testing.assert_allclose(force[:3], -np.cross(arms, given).sum(axis=0), atol=1e-6)
        supplied = force @ motion[7:14] + np.sum(given * v)
        _, axis, _ = PLACE.tub_rotation.T
        q = states[:, :3]
        side, _, top = PLACE.tub_rotation.T
        at = motion[6] + 0.5  # angle of the eccentricity
        centre = 5e-3 * (np.sin(at) * side + np.cos(at) * top)
        moving = u - motion[13] * np.cross(axis, centre)  # against the centre of the race
        y, y_rate = q @ axis, u @ axis
        across = q - np.outer(y, axis) - centre
        r = np.linalg.norm(across, axis=1)
        out = across / r[:, None]
        r_rate, s = (
            np.sum(moving * out, axis=1),
            np.sum(moving * np.cross(axis, out), axis=1) - r * motion[13],
        )
        elastic = k * np.sum((r - ring["race_radius"]) * r_rate + y * y_rate)
        push = k * (r - ring["race_radius"]) + 2.0 * DAMPING_RATIO * np.sqrt(k * mass) * r_rate
        lost = 2.0 * DAMPING_RATIO * np.sqrt(k * mass) * np.sum(r_rate**2 + y_rate**2)
        lost += np.sum(ring["damping"] / ring["race_radius"] ** 2 * s**2)
        share = (0.01 * states[:, 6] + s) / (0.01 + np.abs(s))
        lost += np.sum(ring["rolling_resistance"] * np.abs(push) * share * s)
        in_contact = 0.0
        for i in range(balls if balls > 2 else balls - 1):
            apart = q[i] - q[(i + 1) % balls]
            closing = -(u[i] - u[(i + 1) % balls]) @ apart / np.linalg.norm(apart)
            o = max(ring["ball_diameter"] - np.linalg.norm(apart), 0.0)
            tau = 2.0 * DAMPING_RATIO * np.sqrt(mass / k)
            stiffness = k / (FULL_CONTACT * ring["ball_diameter"])
            in_contact += closing * max(stiffness * o * (o + tau * closing), 0.0)
        assert (in_contact != 0.0) == (balls > 1)
        total = elastic + lost + in_contact
        # power of the drum and tub on the balls, less what they get, is stored or lost
        assert supplied == pytest.approx(-total, rel=1e-7, abs=1e-7)


def test_derivatives_of_the_system_are_those_of_differences():
    placed = BALL_RING.place(PLACE, BallRing.model_validate({**RING, "balls": 2}))
    system, rng = (
        element_system(placed.kind, placed.packed(), np.zeros(14)),
        np.random.default_rng(1),
    )
    sizes = np.array([0.2] * 3 + [0.05] * 3 + [2.0] + [0.5] * 6 + [20.0])
    state = np.concatenate([sizes * rng.uniform(-1.0, 1.0, 14), moved(2, rng)])
    check_derivatives(system, state, ("generalized_force", "moment", "angle"))


@pytest.fixture(scope="module")
def rig():
    return wm.build_machine(with_rings(load_machine("rodrigues_2010"), abb=RIG_RING))


def at_constant_speed(rig, rpm, moment, duration=8.0, step=1e-4, **changes):
    """Return the record of a rig with an unbalance [kg m] in the plane of the ring, at 115 deg.

    Args:
        changes: Numbers of the ring. [SI]
    """
    speed, unbalance = rpm * np.pi / 30.0, {"moment": moment, "y": -0.02, "phase": 2.0}
    profile = SpinProfile(time=(0.0, duration), speed=(speed, speed))
    load = Load.model_validate({"static": unbalance})
    keys = {f"elements.abb.{name}": value for name, value in changes.items()}
    parameters = wm.with_values(rig.parameters, keys)
    return wm.simulate(rig, wm.Case("", load, profile, True, parameters), step=step)


@pytest.mark.slow
def test_balls_park_while_the_axis_is_near_the_centre_of_rotation(rig):
    """Balls roll only where the axis is more than mu R from the centre, here 86 um."""
    moment, half = 20e-6, np.arccos(20e-6 / (2.0 * 0.44e-3 * 42.8e-3))
    beside = tuple(2.0 + np.pi + half * np.array([-0.8, 0.8]))
    free, parked = (
        at_constant_speed(rig, 4500.0, moment, 2.0, start_angles=beside, rolling_resistance=mu)
        for mu in (0.0, 2e-3)
    )
    mean = [
        record.displacement.values[-2000:].reshape(-1, 2, 2).mean(axis=1)
        for record in (free, parked)
    ]
    radius = [np.hypot(*(each - each.mean(axis=0)).T).max() for each in mean]
    moved = [np.ptp(record.ball_ring_angle.values[:, 0], axis=0).max() for record in (free, parked)]
    assert moved[1] < np.deg2rad(1.5) < 0.3 * moved[0]
    assert radius[0] < 0.2 * radius[1] < 0.2 * 2e-3 * RIG_RING["race_radius"]


@pytest.mark.slow
def test_the_centre_of_an_eccentric_race_becomes_the_centre_of_rotation(rig):
    """Balls take the places at which the axis is as far from the centre as the race, opposite."""
    record = at_constant_speed(rig, 4500.0, 15e-6, 8.0, eccentricity=10e-6, eccentricity_phase=0.7)
    last = record.isel(time=slice(-500, None))
    # the plane of the ring is in the middle of the two housings; sensors measure z and x
    z, x = last.displacement.values.reshape(-1, 2, 2).mean(axis=1).T
    turned = ((z + 1j * x) * np.exp(-1j * last.drum_angle.values)).mean()
    assert abs(turned + 10e-6 * np.exp(0.7j)) < 1e-6


@pytest.mark.parametrize("part", [0.3, 0.6, 0.9])
def test_two_balls_balance_an_unbalance_above_the_critical_speeds(rig, part):
    """Compare with the closed form: balls at phase + pi -+ acos(U / 2 m R)."""
    capacity = 2.0 * RIG_RING["ball_mass"] * RIG_RING["race_radius"]
    record = at_constant_speed(rig, 4500.0, part * capacity)
    turns = np.exp(1j * record.ball_ring_angle.values[-1, 0])
    half = np.arccos(part)
    expected = np.exp(1j * (2.0 + np.pi + np.array([-half, half])))
    either = [np.abs(np.angle(turns / order)).max() for order in (expected, expected[::-1])]
    # gravity moves a ball to and fro by g/(R w^2) = 0.06 deg; the race gives way by 0.3 %
    assert min(either) < np.deg2rad(0.5)
    residual = record.ball_ring_moment.values[-1, 0] + np.array(
        Load.model_validate({"static": {"moment": part * capacity, "phase": 2.0}}).static.vector()
    )
    assert np.hypot(*residual[[0, 2]]) < 5e-3 * capacity


@pytest.mark.slow
def test_balls_add_to_the_unbalance_below_the_critical_speeds():
    """They touch beside the unbalance, and the radius grows by the sum of first moments."""
    moment, ring = 20e-6, {**RIG_RING, "start_angles": (1.4, 2.6)}
    balanced = wm.build_machine(with_rings(load_machine("rodrigues_2010"), abb=ring))
    record = at_constant_speed(balanced, 1100.0, moment, 6.0)
    angles = record.ball_ring_angle.values[-400:, 0]
    touching = 2.0 * np.arcsin(0.5 * ring["ball_diameter"] / ring["race_radius"])
    swing = 9.81 / (ring["race_radius"] * (1100.0 * np.pi / 30.0) ** 2)  # of a ball, by gravity
    gaps = np.ptp(angles, axis=1)
    assert 0.98 * touching < gaps.min() <= gaps.max() < touching + 2.0 * swing
    balls = 2.0 * ring["ball_mass"] * ring["race_radius"] * np.cos(0.5 * touching)
    # the motion lags behind the heavy side by a mean over both axes, and the balls follow it
    stiffness, w = np.array([43000.0, 31600.0]), 1100.0 * np.pi / 30.0
    compliance = 1.0 / (stiffness - 1.28 * w**2)
    lag = (2.5e-4 * w * stiffness * compliance) @ compliance / compliance.sum()
    expected = 2.0 - (1.0 + balls / moment) * lag
    assert angles.mean() == pytest.approx(expected, abs=np.deg2rad(3.0))
    plain = wm.build_machine(load_machine("rodrigues_2010"))
    alone = at_constant_speed(plain, 1100.0, moment, 4.0)

    def radius(record):
        part = record.displacement.values[-1000:, :2]
        return np.hypot(*(part - part.mean(axis=0)).T).max()

    assert radius(record) / radius(alone) == pytest.approx(1.0 + balls / moment, rel=0.02)


@pytest.mark.slow
def test_balls_cannot_pass_each_other():
    """Let three balls fall from different heights, without damping: their order stays.

    The drum is slow. Pendulums without contact would pass each other in half a second. The machine
    has the rings of the next test, so that both run the same compiled code.
    """
    falling = {"damping": 0.0, "rolling_resistance": 0.0, "start_angles": (0.5, 2.5, 4.5)}
    parameters = with_rings(front=RING | falling, rear={**RING, "y": 0.15, "balls": 2})
    profile = SpinProfile(time=(0.0, 3.0), speed=(3.0, 3.0))
    case = wm.Case("", parameters.loads["middle"], profile)
    record = wm.simulate(wm.build_machine(parameters), case, step=2.5e-4)
    angles = record.ball_ring_angle.values[:, 0]
    gaps = np.diff(angles, axis=1, append=np.nan)
    gaps[:, -1] = angles[:, 0] - angles[:, -1]
    gaps = np.mod(gaps, 2.0 * np.pi)
    assert np.allclose(gaps.sum(axis=1), 2.0 * np.pi)
    touching = 2.0 * np.arcsin(0.5 * RING["ball_diameter"] / RING["race_radius"])
    assert (gaps[:, :2].min(axis=0) < touching).all()  # each pair of neighbours has hit


def test_rings_of_different_size_share_the_variables_of_a_record():
    parameters = with_rings(front=RING, rear={**RING, "y": 0.15, "balls": 2})
    profile = SpinProfile(time=(0.0, 0.05), speed=(30.0, 30.0))
    machine = wm.build_machine(parameters)
    record = wm.simulate(machine, wm.Case("", parameters.loads["middle"], profile), step=2.5e-4)
    assert list(record.ball_ring.values) == ["front", "rear"]
    assert record.ball_ring_angle.shape[1:] == (2, 3)
    assert np.isnan(record.ball_ring_angle.values[:, 1, 2]).all()
    assert "elements.front" not in record.mount  # it acts between drum and its balls


def test_a_stiffer_race_changes_the_way_of_a_ball_by_less_than_5_percent(rig):
    """Compare the way of the balls with that on a race of twice the frequency."""
    stiff = {**RIG_RING, "race_frequency": 6000.0 * np.pi}
    other = wm.build_machine(with_rings(load_machine("rodrigues_2010"), abb=stiff))
    angles = [
        np.unwrap(at_constant_speed(each, 4500.0, 20e-6, 1.0, step).ball_ring_angle.values[:, 0, 0])
        for each, step in ((rig, 1e-4), (other, 5e-5))
    ]
    assert np.ptp(angles[0]) > 0.5
    assert np.abs(angles[0] - angles[1]).max() < 0.05 * np.ptp(angles[0])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"balls": 0}, "balls"),
        ({"ball_diameter": 0.6}, "3 balls do not fit in the race"),
        ({"start_angles": (0.0, 1.0)}, "needs 3 angles; has 2"),
        ({"start_angles": (0.0, 0.05, 1.0)}, "balls must not overlap"),
    ],
)
def test_rings_that_cannot_be(changes, message):
    with pytest.raises(ValueError, match=message):
        with_rings(front={**RING, **changes})


def test_a_built_machine_keeps_its_number_of_balls(rig):
    other = with_rings(
        load_machine("rodrigues_2010"), abb={**RIG_RING, "balls": 1, "start_angles": None}
    )
    with pytest.raises(InputError, match="number of balls"):
        rig.set_up(parameters=other)


def test_a_compliant_bearing_is_refused():
    tree = load_machine("reference").model_dump(exclude_unset=True)
    bearing = dict.fromkeys(("radial_stiffness", "axial_stiffness", "tilting_stiffness"), 1e7)
    bearing |= dict.fromkeys(("radial_damping", "axial_damping", "tilting_damping", "y"), 0.1)
    with pytest.raises(ValueError, match=r"elements\.front: acts on the drum"):
        MachineParameters.model_validate(
            tree | {"elements": {"front": RING}, "imperfections": {"bearing": bearing}}
        )
