"""Liquid balancer: geometry, equations in both engines, energy, and motion against closed forms."""

import numpy as np
import pytest
from drum_rings import check_both_engines, with_rings
from element_ports import check_derivatives
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from simple_machines import DAMPING, MASS, STIFFNESS, constant_speed, isotropic_machine, unbalance

import wm_drake as wm
from wm_drake.elements.kind import DrumPlace
from wm_drake.elements.liquid_ring import (
    LIQUID_RING,
    NUMBERS,
    WALL_DAMPING,
    WALL_LOSS,
    LiquidRing,
)
from wm_drake.laws.table import stiffness_force
from wm_drake.parameters import load_machine
from wm_drake.systems.element_system import element_system

RING = {
    "kind": "liquid_ring",
    "y": -0.15,
    "inner_radius": 0.2,
    "outer_radius": 0.25,
    "width": 0.04,
    "fill": 0.5,
    "lag": 0.1,
}
PLACE = DrumPlace(
    np.array([0.01, -0.15, 0.02]),
    Rotation.from_euler("xyz", [0.1, 0.2, 0.3]).as_matrix(),
    np.array([0.0, 0.0, -9.81]),
)
UPRIGHT = DrumPlace(np.zeros(3), np.eye(3), np.array([0.0, 0.0, -9.81]))


def ring_of(**changes):
    return LiquidRing.model_validate(RING | changes)


def sampled(ring, e, count=1500):
    """Return q and the mean square radius of the liquid, which is what is farthest from the whirl.

    Second derivation: points of equal area, sorted by their distance from the centre of the whirl.
    """
    rings = np.sqrt(
        ring.inner_radius**2
        + (np.arange(count) + 0.5) / count * (ring.outer_radius**2 - ring.inner_radius**2)
    )
    turns = 2.0 * np.pi * (np.arange(count) + 0.5) / count
    x, z = np.outer(rings, np.cos(turns)).ravel(), np.outer(rings, np.sin(turns)).ravel()
    filled = int(ring.fill * x.size)
    farthest = np.argpartition((x + e) ** 2 + z**2, -filled)[-filled:]
    return x[farthest].mean(), (x[farthest] ** 2 + z[farthest] ** 2).mean()


@pytest.mark.parametrize("fill", [0.2, 0.5, 0.8])
@pytest.mark.parametrize("inner", [0.0, 0.2])
def test_the_liquid_is_what_is_farthest_from_the_centre_of_the_whirl(fill, inner):
    ring = ring_of(fill=fill, inner_radius=inner)
    whirl = np.array([0.002, 0.02, 0.06, 0.25, 5.0])
    expected = [sampled(ring, e)[0] for e in whirl]
    np.testing.assert_allclose(ring.offsets(whirl), expected, rtol=2e-3, atol=2e-5)


def test_offsets_are_linear_while_the_surface_is_free_and_then_saturate():
    ring = ring_of(inner_radius=0.0)
    r, surface = ring.outer_radius, ring.surface_radius
    small = np.array([1e-3, 0.9 * (r - surface)])
    np.testing.assert_allclose(ring.offsets(small) / small, surface**2 / (r**2 - surface**2))
    half_disc = 4.0 * r / (3.0 * np.pi)
    assert ring.capacity / ring.mass == pytest.approx(half_disc, rel=1e-6)
    assert ring.mass == pytest.approx(1000.0 * 0.04 * np.pi * r**2 / 2.0)


def test_the_moment_of_inertia_falls_by_the_work_of_the_field():
    """Check d(mean square radius) = -2 e dq: the liquid is at rest in the field."""
    ring, whirl = ring_of(), np.array([0.03, 0.04])
    (q, square), (other_q, other_square) = (sampled(ring, e, 3000) for e in whirl)
    assert other_square - square == pytest.approx(-2.0 * whirl.mean() * (other_q - q), rel=0.03)


@pytest.mark.parametrize("fill", [0.02, 0.5, 0.95])
def test_the_packed_curve_is_that_of_the_geometry(fill):
    ring = ring_of(fill=fill)
    packed = LIQUID_RING.place(PLACE, ring).packed()
    curve = NUMBERS.unpack(packed).whirl
    whirl = np.geomspace(1e-4, 0.7, 40)
    s = ring.ratio * ring.offsets(whirl)
    ours = np.array([stiffness_force.py_func(value, *curve) for value in s])
    np.testing.assert_allclose(ours, whirl, rtol=0.04)
    free = whirl < 0.4 * min(0.25 - ring.surface_radius, ring.surface_radius - 0.2)
    np.testing.assert_allclose(ours[free], whirl[free], rtol=1e-6)


def moved(rng, spin=30.0):
    """Return random states of a ring: in the free range, near the wall, and along the axis."""
    place = rng.uniform(-0.16, 0.16, 3) * [1.0, 1e-3, 1.0]
    velocity = np.cross([0.0, spin, 0.0], place) + rng.uniform(-0.5, 0.5, 3)
    return np.array([*place, *velocity, rng.uniform(0.5, 1.5) * spin])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["reference", "motor"])
def test_both_engines_agree_at_random_states(name):
    """Compare the accelerations of tub and drum, prescribed or turned by a motor, and the liquid."""
    full = {**RING, "y": 0.15, "fill": 1.0}
    machine = wm.build_machine(with_rings(load_machine(name), front=RING, rear=full))
    check_both_engines(machine, lambda rng: [moved(rng), moved(rng)])


def system_of(ring, place=PLACE):
    """Return the system of a ring alone, and its context."""
    placed = LIQUID_RING.place(place, ring)
    system = element_system(placed.kind, placed.packed(), np.zeros(placed.state_size))
    return system, system.CreateDefaultContext(), placed


def test_power_and_momentum_balance():
    """Balance what drum and tub give the liquid: stored, lost, and given back."""
    ring, rng = ring_of(), np.random.default_rng(1)
    system, context, placed = system_of(ring)
    n = NUMBERS.unpack(placed.packed())
    mass = ring.mass - ring.mass_on_drum
    axis, k = np.array(n.axis), mass * ring.wall_frequency**2
    touched = 0
    for _ in range(40):
        motion = rng.uniform(-1.0, 1.0, 14) * ([0.3] * 3 + [0.05] * 3 + [9.0] + [2.0] * 6 + [60.0])
        state = moved(rng)
        system.GetInputPort("plant_state").FixValue(context, motion)
        context.SetContinuousState(state)
        force = system.GetOutputPort("generalized_force").Eval(context)
        rates = system.EvalTimeDerivatives(context).CopyToVector()
        s, v, spin, u = n.ratio * state[:3], state[3:6], state[6], n.ratio * rates[:3]
        given = mass * (rates[3:6] - PLACE.gravity)
        np.testing.assert_allclose(force[3:6], -given, atol=1e-9 * np.abs(given).max())
        R = Rotation.from_euler("xyz", motion[:3]).as_matrix()
        w = R.T @ motion[7:10]
        y, y_rate = s @ axis, u @ axis
        across, in_plane = s - y * axis, u - y_rate * axis
        drag = mass / ring.lag * (in_plane - motion[13] * np.cross(axis, s))
        guide = (k * y + 2.0 * WALL_DAMPING * np.sqrt(k * mass) * y_rate) * axis
        spin_rate_up = (motion[13] + w @ axis - spin) / ring.lag
        change = spin_rate_up * axis + spin * np.cross(w, axis)  # of the spin, over I
        on_axis = PLACE.tub_point + y * axis
        arms = np.cross(on_axis, R.T @ -given) + np.cross(across, drag + guide)
        moment = R @ (arms - n.inertia * change)  # pressure acts through the axis of the drum
        np.testing.assert_allclose(force[:3], moment, atol=1e-8 * np.abs(moment).max())
        size = np.linalg.norm(across)
        s_rate = u @ across / size
        field = mass * spin**2 * (size + stiffness_force.py_func(size, *n.whirl))
        overlap = max(size - n.most, 0.0)
        touched += overlap > 0.0
        wall = k * overlap * max(1.0 + WALL_LOSS * s_rate, 0.0) * s_rate
        lost = ring.lag * (drag @ drag / mass + n.inertia * spin_rate_up**2)
        lost += 2.0 * WALL_DAMPING * np.sqrt(k * mass) * y_rate**2
        # spin energy of the liquid, less the potential of the field
        spinning = n.inertia * spin * rates[6] - field * s_rate
        stored = k * y * y_rate + wall + spinning
        supplied = -(force @ motion[7:14]) - given @ v
        assert supplied == pytest.approx(stored + lost, rel=1e-7, abs=1e-7)
    assert 0 < touched < 40


def test_derivatives_of_the_system_are_those_of_differences():
    system, rng = system_of(ring_of())[0], np.random.default_rng(1)
    sizes = np.array([0.2] * 3 + [0.05] * 3 + [2.0] + [0.5] * 6 + [20.0])
    state = np.concatenate([sizes * rng.uniform(-1.0, 1.0, 14), moved(rng)])
    check_derivatives(system, state, ("generalized_force", "moment", "spin"))


def settled(ring, speed, duration, first=0.0):
    """Return the states of a ring after a time, in a tub at rest whose drum turns. (7,)

    The liquid begins as in a drum that turns at another rate, `first`. [rad/s]
    """
    system, context, placed = system_of(ring, UPRIGHT)
    motion = np.zeros(14)

    def rates(time, state):
        motion[[6, 13]] = speed * time, speed
        system.GetInputPort("plant_state").FixValue(context, motion)
        context.SetContinuousState(state)
        return system.EvalTimeDerivatives(context).CopyToVector()

    start = placed.initial(first)
    return solve_ivp(rates, (0.0, duration), start, method="LSODA", rtol=1e-8, atol=1e-10).y[:, -1]


def layer(ring, speed, whirl):
    """Return place of the liquid and force on the wall for a unit field that turns at a rate.

    Second derivation: the potential flow (alpha r + beta/r) of an inviscid layer that turns at a
    speed, from its conditions at wall and surface; the force is the integral of the pressure.
    Complex numbers turn with the field. [rad/s -> m per m/s^2, kg]
    """
    R, r, nu = ring.outer_radius, ring.surface_radius, whirl - speed
    conditions = np.array([
        [1.0, -1.0 / R**2, 0.0],  # nothing flows through the wall
        [1.0, -1.0 / r**2, -1j * nu],  # the surface moves with the liquid
        [-1j * (nu + 2 * speed) * r, 1j * (2 * speed - nu) / r, speed**2 * r],  # no pressure there
    ])  # fmt: skip
    alpha, beta, surface = np.linalg.solve(conditions, [0.0, 0.0, -r])
    pressure = R - 1j * (nu + 2 * speed) * alpha * R + 1j * (2 * speed - nu) * beta / R
    disc = 1000.0 * ring.width * np.pi
    return -surface * r**2 * disc / ring.mass, disc * R * pressure


@pytest.mark.parametrize("whirl", [1.0, -1.0, 0.0, 0.4], ids=["forward", "backward", "gravity", ""])
@pytest.mark.parametrize("fill", [0.3, 0.6])
def test_liquid_moves_and_pushes_as_an_inviscid_layer_in_any_field(fill, whirl):
    """Put the element into the steady motion of the layer, and compare rates and force."""
    ring, speed, e = ring_of(fill=fill, lag=1e9), 40.0, 1e-5
    weightless = DrumPlace(np.zeros(3), np.eye(3), np.zeros(3))
    system, context, _ = system_of(ring, weightless)
    rate = whirl * speed
    field = e * rate**2 if whirl else 1e-4
    place, force = (field * value for value in layer(ring, speed, rate))
    # the tub at e turns about O; without a whirl it accelerates along z, at rest at this time
    moving = 1j * rate * e if whirl else 0.0
    s = ring.ratio * place
    state = np.zeros(7)
    state[[2, 0]], state[6] = (place.real, place.imag), speed
    velocity = moving + 1j * rate * s
    state[[5, 3]] = velocity.real, velocity.imag
    motion = np.zeros(14)
    motion[13], motion[[12, 10]] = speed, (np.real(moving), np.imag(moving))
    system.GetInputPort("plant_state").FixValue(context, motion)
    context.SetContinuousState(state)
    rates = system.EvalTimeDerivatives(context).CopyToVector()
    expected = -field - rate**2 * s  # of the particle: that of the tub, and its own
    scale = abs(expected) + speed**2 * abs(s)
    assert abs(rates[5] + 1j * rates[3] - expected) < 1e-6 * scale
    turning = 1j * rate * place
    assert abs(rates[2] + 1j * rates[0] - turning) < 1e-9 * speed * abs(place)
    assert rates[6] == pytest.approx(0.0, abs=1e-6)  # vorticity is conserved
    pushed = system.GetOutputPort("generalized_force").Eval(context)
    whole = pushed[5] + 1j * pushed[3] + ring.mass_on_drum * field
    assert abs(whole - force) < 1e-6 * abs(force)
    moment = system.GetOutputPort("moment").Eval(context)
    assert abs(moment[2] + 1j * moment[0] - ring.mass * place) < 1e-9 * abs(ring.mass * place)


@pytest.mark.slow
@pytest.mark.parametrize(("lag", "duration"), [(0.02, 15.0), (0.2, 15.0)])
def test_liquid_lies_above_the_axis_and_lags_as_the_closed_form_says(lag, duration):
    """Check a drum at rest in W: without drag q = -g/(2 L W^2), which is above the axis."""
    ring, speed = ring_of(lag=lag), 40.0
    state = settled(ring, speed, duration)
    ratio = (ring.outer_radius / ring.surface_radius) ** 2
    q = -9.81 / (2.0 * ratio * speed**2 + 1j * speed * (ratio + 1.0) / lag)
    found = -state[2] - 1j * state[0]  # from the bottom, positive with the drum
    assert abs(found - q) < 1e-4 * abs(q)
    assert state[6] == pytest.approx(speed, rel=1e-6)


@pytest.mark.slow
def test_below_the_speed_at_which_the_ring_closes_there_is_a_pool():
    ring = ring_of(lag=1.0)
    assert ring.closes_from == pytest.approx(np.sqrt(4.905 * (0.25 + ring.surface_radius)) / 0.25)
    slow, fast = 0.3 * ring.closes_from, 1.2 * ring.closes_from
    pool, closed = settled(ring, slow, 30.0), settled(ring, fast, 30.0, fast)
    largest = ring.capacity / ring.mass
    assert np.hypot(pool[0], pool[2]) == pytest.approx(largest, rel=0.02)
    assert pool[2] < -0.95 * largest  # at the bottom
    first = ring.offsets(np.array([ring.outer_radius - ring.surface_radius]))[0]
    assert np.hypot(closed[0], closed[2]) < first  # liquid covers the whole wall


@pytest.fixture(scope="module")
def whirling():
    return wm.build_machine(with_rings(isotropic_machine(), ring=RING | {"y": 0.0}))


def response(machine, speed, moment, **changes):
    """Return displacement of To [m] and first moment of the liquid [kg m], complex, in D."""
    keys = {f"elements.ring.{name}": value for name, value in changes.items()}
    parameters = wm.with_values(machine.parameters, keys)
    case = wm.Case("", unbalance(moment / 0.25), constant_speed(speed, 45.0), True, parameters)
    record = wm.simulate(machine, case, step=1e-3)
    last = record.isel(time=slice(-200, None))
    turned = np.exp(-1j * last.drum_angle.values)
    place = (last.tub_position.values[:, 2] + 1j * last.tub_position.values[:, 0]) * turned
    liquid = last.liquid_ring_moment.values[:, 0]
    return place.mean(), (liquid[:, 2] + 1j * liquid[:, 0]).mean()


def expected(speed, moment, mass):
    """Return the displacement of a whirling mass on springs. [rad/s, kg m, kg -> m]"""
    return moment * speed**2 / dynamic_stiffness(speed, moment, mass)


def dynamic_stiffness(speed, moment, mass):
    """Return force over displacement of tub, drum, unbalance and a mass. [N/m]"""
    whole = MASS + moment / 0.25 + mass
    return STIFFNESS + 1j * speed * DAMPING - whole * speed**2


@pytest.mark.slow
@pytest.mark.parametrize(("speed", "lag"), [(9.0, 0.1), (20.0, 0.1), (60.0, 0.1)])
@pytest.mark.parametrize("fill", [0.3, 0.6])
def test_a_partly_filled_ring_acts_as_a_full_disc(whirling, speed, lag, fill):
    """Compare with the classical result: the force on the wall is rho pi R^2 b W^2 e.

    The lag does not change a steady whirl; with this one free motions decay.
    """
    ring = ring_of(fill=fill)
    disc = 1000.0 * 0.04 * np.pi * ring.outer_radius**2
    place, liquid = response(whirling, speed, 0.05, fill=fill, lag=lag)
    whole = expected(speed, 0.05, disc)
    assert abs(place - whole) < 2e-3 * abs(whole)
    assert abs(liquid - (disc - ring.mass) * whole) < 3e-3 * abs(liquid)
    assert (liquid.real < 0.0) == (speed > np.sqrt(STIFFNESS / (MASS + 0.2 + disc)))


@pytest.mark.slow
def test_a_full_ring_is_plain_mass(whirling):
    place, liquid = response(whirling, 30.0, 0.05, fill=1.0)
    mass = ring_of(fill=1.0).mass
    plain = expected(30.0, 0.05, mass)
    assert abs(place - plain) < 1e-3 * abs(plain)
    assert abs(liquid) < 0.01 * abs(mass * place)


@pytest.mark.slow
def test_a_saturated_ring_gives_no_more_than_its_capacity(whirling):
    """Whirl by 60 mm: the liquid is where the geometry says, and not where a straight line does."""
    ring, speed, moment = ring_of(), 14.0, 1.0
    place, liquid = response(whirling, speed, moment)
    e = abs(place)
    assert e > 1.5 * (ring.outer_radius - ring.surface_radius)
    q = ring.offsets(np.array([e]))[0]
    assert abs(liquid) == pytest.approx(ring.mass * q, rel=5e-3)
    assert abs(liquid) < ring.capacity
    force = dynamic_stiffness(speed, moment, ring.mass) * place
    assert abs(force - speed**2 * (moment + liquid)) < 5e-3 * abs(force)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"inner_radius": 0.25}, "must be smaller than outer_radius"),
        ({"fill": 0.0}, "fill"),
        ({"fill": 1.1}, "fill"),
        ({"lag": 0.0}, "lag"),
        ({"width": -0.1}, "width"),
    ],
)
def test_rings_that_cannot_be(changes, message):
    with pytest.raises(ValueError, match=message):
        with_rings(load_machine("reference"), front={**RING, **changes})
