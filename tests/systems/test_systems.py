"""Force systems: ports against a plainer second derivation, AutoDiff against finite differences, parameters in the Context."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from element_ports import own_outputs
from machines_of_each_kind import damper_of
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RollPitchYaw, RotationMatrix
from scipy.interpolate import PchipInterpolator

from wm_drake.elements.bushing import (
    SIX_COMPONENT_BUSHING,
    SixComponentBushingParameters,
    packed_bushing_law,
)
from wm_drake.elements.damper_law import packed_damper_law
from wm_drake.elements.friction_damper import FRICTION_DAMPER_STRUT, FrictionDamperParameters
from wm_drake.elements.layouts import packed_stiffness
from wm_drake.elements.mount import mounts_at
from wm_drake.elements.spring import SPRING, SPRING_STRUT, SpringStrutParameters
from wm_drake.elements.state_map import StateMap, sponge_part, tub_part
from wm_drake.parameters import SpinProfile
from wm_drake.parameters.elements import Bushing, EndBushing, ForceTable
from wm_drake.simulation.histories import output_history
from wm_drake.systems.element_system import element_system
from wm_drake.systems.speed_source import REFLECTED_INERTIA, MotorTorque, SpeedSource
from wm_drake.systems.spin_profile_source import SpinProfileSource
from wm_drake.systems.tub_force import TubForce

# m, N
SPRING_CURVE = ForceTable(
    displacement=(-0.03, -0.01, 0.0, 0.01, 0.04), force=(-200.0, -50.0, 0.0, 60.0, 300.0)
)
# N m/rad, N m s/rad, N m
END_BUSHING = EndBushing(stiffness=6.0, damping=0.2, friction_torque=0.4, full_friction_rate=0.8)
GASKET = Bushing(
    tub_frame="tub_front",
    housing_frame="housing_front",
    stiffness_x=8e3,  # N/m
    stiffness_y=ForceTable(
        displacement=(-0.02, -0.005, 0.004, 0.02), force=(-90.0, -10.0, 9.0, 80.0)
    ),
    stiffness_z=5e3,
    rotational_stiffness_x=73.0,  # N m/rad
    rotational_stiffness_y=890.0,
    rotational_stiffness_z=150.0,
    damping_x=50.0,  # N s/m
    damping_y=10.0,
    damping_z=40.0,
    rotational_damping_x=3.0,  # N m s/rad
    rotational_damping_y=5.0,
    rotational_damping_z=4.0,
    friction_torque_x=3.7,  # N m
    friction_torque_y=1.7,
    friction_torque_z=2.7,
    full_friction_rate_x=1.5,  # rad/s
    full_friction_rate_y=0.6,
    full_friction_rate_z=0.9,
)
DAMPERS = {
    law: damper_of(law, end_bushing=END_BUSHING)
    for law in ("coulomb", "stv", "havsin", "mstv", "free_stroke")
}
every_damper = pytest.mark.parametrize("damper", DAMPERS.values(), ids=DAMPERS)


def spring_parameters(stiffness=5200.0, preload=240.0):
    return SpringStrutParameters(
        np.array([0.2, -0.05, 0.22]),
        np.array([0.28, -0.05, 0.4]),
        preload,
        packed_stiffness(stiffness),
    )


def damper_parameters(damper, end_bushing=None, engaged=1.0):
    ends = np.array([0.15, 0.08, -0.24]), np.array([0.25, 0.1, -0.42])  # m
    return FrictionDamperParameters(
        *ends, end_bushing or damper.end_bushing, packed_damper_law(damper), engaged
    )


def bushing_parameters(engaged=1.0):
    R_TB, R_WG = (
        RotationMatrix(RollPitchYaw(rpy)).matrix()
        for rpy in ([0.02, -0.03, 0.5], [-0.01, 0.02, 0.52])
    )
    return SixComponentBushingParameters(
        np.array([0.01, -0.16, 0.02]),
        R_TB,
        np.array([0.0, -0.17, 0.015]),
        R_WG,
        packed_bushing_law(GASKET),
        engaged,
    )


def random_plant_states(count, seed):
    """Draw poses within 0.1 rad and 10 mm, rates of 1 rad/s and 0.3 m/s, any drum motion."""
    rng = np.random.default_rng(seed)
    sizes = [0.1] * 3 + [0.01] * 3 + [3.0] + [1.0] * 3 + [0.3] * 3 + [40.0]
    return rng.uniform(-1.0, 1.0, (count, 14)) * sizes


def tub_motion(x, p_ToA_T):
    """Return rotation of the tub, arm from To to A, position and velocity of A, all in W."""
    R_WT = RotationMatrix(RollPitchYaw(x[0:3])).matrix()
    arm = R_WT @ p_ToA_T
    return R_WT, arm, x[3:6] + arm, x[10:13] + np.cross(x[7:10], arm)


def context_of(system, x, state=()):
    context = system.CreateDefaultContext()
    system.GetInputPort("plant_state").FixValue(context, x)
    if len(state):
        context.SetContinuousState(state)
    return context


def port(system, context, name):
    return system.GetOutputPort(name).Eval(context)


@dataclass(frozen=True)
class Element:
    """A force element in its place, with some state of its own."""

    kind: Any
    packed: np.ndarray
    state: tuple[float, ...] = ()

    def system(self, packed=None):
        packed = self.packed if packed is None else packed
        return element_system(self.kind, packed, self.state)


ELEMENTS = {
    "spring": Element(SPRING_STRUT, spring_parameters().packed()),
    "spring with a table": Element(SPRING_STRUT, spring_parameters(SPRING_CURVE).packed()),
    "spring that is nearly slack": Element(SPRING_STRUT, SPRING.replaced(spring_parameters().packed(), taut_from=2000.0)),
    "bushing": Element(SIX_COMPONENT_BUSHING, bushing_parameters().packed()),
}  # fmt: skip
SPONGE_STATES = {"mstv": (2.3e-4,), "free_stroke": (0.012,)}  # m
for _name, _damper in DAMPERS.items():
    _packed = damper_parameters(_damper).packed()
    ELEMENTS[_name] = Element(FRICTION_DAMPER_STRUT, _packed, SPONGE_STATES.get(_name, ()))
every_element = pytest.mark.parametrize("element", ELEMENTS.values(), ids=ELEMENTS)


@pytest.mark.parametrize("stiffness", [5200.0, SPRING_CURVE])  # N/m
def test_a_spring_pulls_its_hooks_together(stiffness):
    placed = spring_parameters(stiffness)
    spring = element_system(SPRING_STRUT, placed.packed())
    curve = PchipInterpolator(SPRING_CURVE.displacement, SPRING_CURVE.force)
    for x in random_plant_states(10, seed=21):
        _, arm, p_WA, v_WA = tub_motion(x, placed.p_ToA_T)
        line = p_WA - placed.p_WH
        length = np.linalg.norm(line)
        stretch = length - np.linalg.norm(placed.p_ToA_T - placed.p_WH)
        # N
        tension = 240.0 + (stiffness * stretch if isinstance(stiffness, float) else curve(stretch))
        force = -tension * line / length
        context = context_of(spring, x)
        assert port(spring, context, "force") == pytest.approx([tension])
        generalized_force = port(spring, context, "generalized_force")
        assert generalized_force == pytest.approx([*np.cross(arm, force), *force, 0.0])
        elongation_rate = line @ v_WA / length
        assert generalized_force @ x[7:14] == pytest.approx(-tension * elongation_rate)


def line_of(damper, x):
    """Return arm, direction, length, elongation rate of a damper, tub end velocity, tub rotation."""
    R_WT, arm, p_WA, v_WA = tub_motion(x, damper.p_ToA_T)
    line = p_WA - damper.p_WH
    length = np.linalg.norm(line)
    return arm, line / length, length, line @ v_WA / length, v_WA, R_WT


@pytest.mark.parametrize(
    ("name", "full_force", "transition"),
    [("coulomb", 60.0, lambda q: np.sign(q)), ("stv", 60.0, lambda q: np.clip(q, -1, 1)),
     ("havsin", 60.0, lambda q: np.sin(np.pi / 2 * np.clip(q, -1, 1)))],
)  # fmt: skip
def test_a_damper_without_sponge_resists_its_elongation_rate(name, full_force, transition):
    placed = damper_parameters(DAMPERS[name], EndBushing())
    damper = element_system(FRICTION_DAMPER_STRUT, placed.packed())
    for x in random_plant_states(10, seed=22):
        arm, e, _, rate, _, _ = line_of(placed, x)
        tension = 20.0 * rate + full_force * transition(rate / 0.2)  # N
        context = context_of(damper, x)
        assert context.num_continuous_states() == 0
        assert port(damper, context, "force") == pytest.approx([tension])
        assert port(damper, context, "generalized_force") == pytest.approx(
            [*np.cross(arm, -tension * e), *(-tension * e), 0.0]
        )


@every_damper
def test_end_bushings_bend_back_a_strut_and_their_moments_are_balanced(damper):
    placed = damper_parameters(damper)
    state = [0.0] * int(placed.has_sponge)
    bent, free = (
        element_system(FRICTION_DAMPER_STRUT, p.packed(), state)
        for p in (placed, damper_parameters(damper, EndBushing()))
    )
    axis = placed.p_ToA_T - placed.p_WH
    axis /= np.linalg.norm(axis)
    for x in random_plant_states(10, seed=25):
        arm, e, length, _, v_WA, R_WT = line_of(placed, x)
        w_strut = np.cross(e, v_WA) / length
        moments = []  # on the strut, at the tub and at the housing
        for body_axis, w_body in ((R_WT @ axis, x[7:10]), (axis, np.zeros(3))):
            bend = np.cross(body_axis, e)
            angle = bend / np.linalg.norm(bend) * np.arcsin(np.linalg.norm(bend))
            rate = (np.eye(3) - np.outer(e, e)) @ (w_strut - w_body)
            speed = np.linalg.norm(rate)
            moments.append(
                -6.0 * angle
                - 0.2 * rate
                - 0.4 * np.sin(np.pi / 2 * min(speed / 0.8, 1.0)) * rate / speed
            )
        couple = np.cross(sum(moments), e) / length
        # balance of the strut
        np.testing.assert_allclose(sum(moments) + np.cross(length * e, -couple), 0.0, atol=1e-13)
        with_bushings, without = (
            port(d, context_of(d, x, state), "generalized_force") for d in (bent, free)
        )
        extra = with_bushings - without
        np.testing.assert_allclose(
            extra, [*(np.cross(arm, couple) - moments[0]), *couple, 0.0], rtol=1e-9, atol=1e-11
        )
        power = moments[0] @ (w_strut - x[7:10]) + moments[1] @ w_strut  # of the bushings, W
        assert extra @ x[7:14] == pytest.approx(power)


def test_a_bushing_acts_at_its_tub_side_point_along_the_axes_of_its_housing_frame():
    placed = bushing_parameters()
    bushing = element_system(SIX_COMPONENT_BUSHING, placed.packed())
    curve = PchipInterpolator(GASKET.stiffness_y.displacement, GASKET.stiffness_y.force)
    R_WG = placed.ground_side_rotation
    for x in random_plant_states(10, seed=26):
        R_WT, arm, p_WB, v_WB = tub_motion(x, placed.tub_side_point)
        d, d_rate, w = R_WG.T @ (p_WB - placed.ground_side_point), R_WG.T @ v_WB, R_WG.T @ x[7:10]
        rotation = AngleAxis(R_WG.T @ R_WT @ placed.tub_side_rotation)
        r = rotation.angle() * rotation.axis()
        # rate of the rotation vector and the moment that does its work, through the 3 x 3 matrix of the Bortz equation
        angle, cross_r = rotation.angle(), np.cross(np.eye(3), r)
        B = (
            np.eye(3)
            - 0.5 * cross_r
            + (1.0 / angle**2 - 0.5 / (angle * np.tan(0.5 * angle))) * cross_r @ cross_r
        )
        r_rate = B @ w
        friction = [3.7, 1.7, 2.7] * np.sin(np.pi / 2 * np.clip(r_rate / [1.5, 0.6, 0.9], -1, 1))
        force = -np.array([8e3 * d[0], curve(d[1]), 5e3 * d[2]]) - [50.0, 10.0, 40.0] * d_rate
        moment = B.T @ (-np.array([73.0, 890.0, 150.0]) * r - [3.0, 5.0, 4.0] * r_rate - friction)
        context = context_of(bushing, x)
        expected = [*(np.cross(arm, R_WG @ force) + R_WG @ moment), *(R_WG @ force), 0.0]
        np.testing.assert_allclose(
            port(bushing, context, "generalized_force"), expected, rtol=1e-9, atol=1e-10
        )
        np.testing.assert_allclose(
            own_outputs(bushing, context), [*-force, *-moment], rtol=1e-9, atol=1e-10
        )


@every_element
def test_readings_repeat_the_force_port_row_by_row(element):
    system = element.system()
    states = random_plant_states(11, seed=28)  # more than go side by side, and not a multiple
    sponges = np.outer(np.linspace(0.5, 1.5, len(states)), element.state or [0.0])
    kinds = {
        "springs": SPRING_STRUT,
        "dampers": FRICTION_DAMPER_STRUT,
        "bushings": SIX_COMPONENT_BUSHING,
    }
    begins = {name: [0] for name, kind in kinds.items() if element.kind is kind}
    mounts = mounts_at(begins, [], [], StateMap.of([tub_part(), sponge_part("")]))
    forces = np.empty((len(states), 6 if element.kind is SIX_COMPONENT_BUSHING else 1))
    output_history(np.hstack([states, sponges]), np.empty(0), element.packed, mounts, forces)
    for x, sponge, force in zip(states, sponges[:, : len(element.state)], forces, strict=True):
        assert np.array_equal(own_outputs(system, context_of(system, x, sponge)), force)


def computed(system, context):
    """Return all that a system computes as one array: generalized force, own outputs, rate of its state."""
    rate = (
        system.EvalTimeDerivatives(context).CopyToVector()
        if context.num_continuous_states()
        else []
    )
    return np.array(
        [*port(system, context, "generalized_force"), *own_outputs(system, context), *rate]
    )


@every_element
def test_autodiff_gives_the_same_values_and_the_derivatives_of_finite_differences(element):
    system, differentiable = element.system(), element.system().ToAutoDiffXd()
    steps = np.array([1e-6] * 14 + [1e-6 * own for own in element.state])  # rad, m, rad/s, m/s, m

    def values(xs):
        return computed(system, context_of(system, xs[:14], xs[14:]))

    for x in random_plant_states(3, seed=29):
        xs = np.array([*x, *element.state])
        duals = InitializeAutoDiff(xs).ravel()
        answer = computed(
            differentiable, context_of(differentiable, duals[:14], duals[14:])
        ).reshape(-1, 1)
        np.testing.assert_allclose(ExtractValue(answer).ravel(), values(xs), rtol=1e-12, atol=1e-12)
        expected = np.column_stack(
            [(values(xs + step) - values(xs - step)) / 2.0 for step in np.diag(steps)]
        )
        size = np.max(np.abs(expected), axis=1, keepdims=True) + 1e-7 * np.abs(values(xs))[:, None]
        assert np.max(np.abs(ExtractGradient(answer) * steps - expected) / (size + 1e-15)) < 1e-6


def moved_on_the_tub(element):
    """Return packed parameters with the point on the tub, their first three, elsewhere. [m]"""
    return element.packed + np.pad([0.01, -0.02, 0.03], (0, len(element.packed) - 3))


@every_element
def test_numbers_set_in_a_context_act_there_only_and_go_with_it_to_autodiff(element):
    system, x = element.system(), random_plant_states(1, seed=30)[0]
    moved = moved_on_the_tub(element)
    changed, unchanged = (context_of(system, x, element.state) for _ in range(2))
    system.set_parameters(changed, moved)
    rebuilt = element.system(moved)
    assert np.array_equal(
        computed(system, changed), computed(rebuilt, context_of(rebuilt, x, element.state))
    )
    assert not np.array_equal(computed(system, unchanged), computed(system, changed))
    differentiable = system.ToAutoDiffXd()
    context = differentiable.CreateDefaultContext()
    context.SetTimeStateAndParametersFrom(changed)
    differentiable.GetInputPort("plant_state").FixValue(context, InitializeAutoDiff(x).ravel())
    answer = ExtractValue(computed(differentiable, context).reshape(-1, 1)).ravel()
    np.testing.assert_allclose(answer, computed(system, changed), rtol=1e-12, atol=1e-12)


@every_element
def test_the_ports_follow_what_changes_in_a_context(element):
    system, (x, y) = element.system(), random_plant_states(2, seed=31)
    context = context_of(system, x, element.state)
    first = computed(system, context)
    system.GetInputPort("plant_state").FixValue(context, y)
    second = computed(system, context)
    assert not np.array_equal(first, second)
    assert np.array_equal(second, computed(system, context_of(system, y, element.state)))
    if element.state:
        doubled = 2.0 * np.array(element.state)
        context.SetContinuousState(doubled)
        third = computed(system, context)
        assert np.array_equal(third, computed(system, context_of(system, y, doubled)))
        assert not np.array_equal(second, third)


@every_element
def test_parameters_of_another_length_are_refused(element):
    system = element.system()
    system.set_name("left")
    with pytest.raises(ValueError, match="left: a table has another number of points"):
        system.set_parameters(system.CreateDefaultContext(), np.append(element.packed, 0.0))


@pytest.mark.parametrize("damper", [None, *DAMPERS.values()], ids=["bushing", *DAMPERS])
def test_a_disengaged_element_exerts_nothing_at_all(damper):
    if damper is None:
        system, state = (
            element_system(SIX_COMPONENT_BUSHING, bushing_parameters(engaged=0.0).packed()),
            (),
        )
    else:
        placed = damper_parameters(
            damper, EndBushing(), engaged=0.0
        )  # its end bushings would act on
        state = [2e-3] if placed.has_sponge else []  # m
        system = element_system(FRICTION_DAMPER_STRUT, placed.packed(), np.zeros(placed.state_size))
    context = context_of(system, random_plant_states(1, seed=32)[0], state)
    assert not np.any(port(system, context, "generalized_force"))
    assert not np.any(own_outputs(system, context))


def test_the_speed_source_actuates_with_its_inertia_times_the_acceleration():
    source = SpeedSource()
    context = source.CreateDefaultContext()
    source.GetInputPort("profile_acceleration").FixValue(context, [0.73])  # rad/s^2: 7 rpm/s
    assert port(source, context, "actuation") == [REFLECTED_INERTIA * 0.73]
    source.GetInputPort("drum_acceleration").FixValue(context, [-2.0])  # takes precedence
    assert port(source, context, "actuation") == [REFLECTED_INERTIA * -2.0]


PROFILE = SpinProfile(time=(0.0, 2.0, 5.0), speed=(1.0, 7.0, 4.0))  # s, rad/s


@pytest.mark.parametrize(
    ("time", "acceleration", "speed"),
    [(0.0, 3.0, 1.0), (1.0, 3.0, 4.0), (2.0, -1.0, 7.0), (4.0, -1.0, 5.0), (9.0, 0.0, 4.0)],
)
def test_the_spin_profile_source_follows_its_profile(time, acceleration, speed):
    source = SpinProfileSource(PROFILE)
    context = source.CreateDefaultContext()
    context.SetTime(time)
    assert port(source, context, "acceleration") == pytest.approx([acceleration])
    assert port(source, context, "speed") == pytest.approx([speed])
    differentiable = source.ToAutoDiffXd()
    copied = differentiable.CreateDefaultContext()
    copied.SetTime(AutoDiffXd(time, [1.0]))
    assert port(differentiable, copied, "speed")[0].derivatives() == pytest.approx([acceleration])


def test_a_profile_set_in_a_context_goes_with_it_to_autodiff():
    source, other = SpinProfileSource(PROFILE), SpinProfile(time=(0.0, 1.0), speed=(0.0, 9.0))
    context = source.CreateDefaultContext()
    source.set_profile(context, other)
    assert port(source, context, "acceleration") == [9.0]
    assert port(source, source.CreateDefaultContext(), "acceleration") == [3.0]
    differentiable = source.ToAutoDiffXd()
    copied = differentiable.CreateDefaultContext()
    copied.SetTimeStateAndParametersFrom(context)
    assert port(differentiable, copied, "acceleration")[0].value() == 9.0


def test_motor_torque_is_what_the_reflected_inertia_does_not_take_up():
    torque = MotorTorque(9, 6)
    context = torque.CreateDefaultContext()
    rates = np.zeros(9)
    rates[6] = 0.5
    torque.GetInputPort("actuation").FixValue(context, [REFLECTED_INERTIA * 0.5 + 3.25])
    torque.GetInputPort("generalized_acceleration").FixValue(context, rates)
    assert port(torque, context, "torque") == [3.25]


@pytest.mark.parametrize("scalar", [float, AutoDiffXd])
def test_the_force_on_the_tub_is_passed_on_or_zero(scalar):
    system = TubForce() if scalar is float else TubForce().ToAutoDiffXd()
    context = system.CreateDefaultContext()
    given = [scalar(value) for value in (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)]
    values = [
        float(v) if scalar is float else v.value()
        for v in port(system, context, "generalized_force")
    ]
    assert values == [0.0] * 7
    system.GetInputPort("tub_force").FixValue(context, given)
    values = [
        float(v) if scalar is float else v.value()
        for v in port(system, context, "generalized_force")
    ]
    assert values == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 0.0]
