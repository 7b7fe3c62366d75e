"""Loops of the bench against closed forms, limits and, for the dampers' systems, Drake's integrator."""

import functools

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from machines_of_each_kind import damper_of
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput, Multiplexer, Sine
from simple_machines import SPONGES

from wm_drake.elements.damper_law import packed_damper_law
from wm_drake.elements.friction_damper import FrictionDamperParameters
from wm_drake.errors import InputError
from wm_drake.laws.damper import mstv_damper
from wm_drake.parameters import (
    CoulombDamper,
    EndBushing,
    ForceTable,
    HavsinDamper,
    MstvDamper,
    StvDamper,
    StvSpongeDamper,
    load_machine,
)
from wm_drake.rigs import (
    AXES,
    MATRICES,
    Harmonic,
    bushing_bench,
    damper_bench,
    force_loop,
    force_loops,
    measures_of,
)
from wm_drake.rigs.loops import steady_deformations
from wm_drake.rigs.run import stroke_points
from wm_drake.systems.element_system import element_system

MSTV = damper_of("mstv", friction_damping=0.0)  # fit of [C]; f_max assumed
SPONGE = ForceTable(  # assumed
    displacement=(-0.02, -0.01, -0.004, 0.004, 0.01, 0.02),
    force=(-120.0, -40.0, 0.0, 0.0, 40.0, 120.0),
)
FREE_STROKE = damper_of("free_stroke", sponge=SPONGE)  # [A] Table 1


@functools.cache
def gasket():
    return load_machine("reference").gasket


forces, dampings = st.floats(0.0, 200.0), st.floats(0.0, 1e4)
speeds, motions = (
    st.floats(1e-4, 1.0),
    st.builds(Harmonic, st.floats(0.2, 20.0), st.floats(1e-4, 2e-2)),
)


def energy(bench, motion):
    return measures_of(force_loop(bench, motion)).energy_per_cycle


@given(f_max=st.floats(1.0, 200.0), motion=motions)
def test_coulomb_loop_is_a_rectangle(f_max, motion):
    bench = damper_bench(CoulombDamper(law="coulomb", friction_force=f_max))
    assert energy(bench, motion) == pytest.approx(4.0 * f_max * motion.amplitude, rel=1e-5)


@given(c=st.floats(1.0, 1e4), motion=motions)
def test_viscous_loop_is_an_ellipse(c, motion):
    bench = damper_bench(CoulombDamper(law="coulomb", friction_force=0.0, damping=c))
    measures = measures_of(force_loop(bench, motion))
    expected = np.pi * c * motion.angular_frequency * motion.amplitude**2
    assert measures.energy_per_cycle == pytest.approx(expected, rel=1e-9)
    assert measures.equivalent_damping == pytest.approx(c, rel=1e-9)
    assert measures.loss_angle == pytest.approx(0.5 * np.pi)


@pytest.mark.parametrize("axis", AXES)
def test_voigt_element_has_its_dynamic_stiffness_and_loss_angle(axis):
    motion = Harmonic(4.0, 3e-3)
    kind = "rotational_" if axis.startswith("about") else ""
    letter = axis[-1]
    stiffness, damping = 5e3, 40.0
    voigt = gasket().model_copy(
        update={f"{kind}stiffness_{letter}": stiffness, f"{kind}damping_{letter}": damping}
    )
    measures = measures_of(force_loop(bushing_bench(voigt, axis), motion))
    c_omega = damping * motion.angular_frequency
    assert measures.dynamic_stiffness == pytest.approx(np.hypot(stiffness, c_omega), rel=1e-9)
    assert measures.loss_angle == pytest.approx(np.arctan2(c_omega, stiffness), rel=1e-9)
    assert measures.energy_per_cycle == pytest.approx(
        np.pi * c_omega * motion.amplitude**2, rel=1e-9
    )


def test_a_jig_arm_does_the_work_of_the_moment():
    rubber = gasket().model_copy(update={"rotational_stiffness_x": 70.0, "friction_torque_x": 0.5})
    arm = 0.1  # m, [A] section 2.2
    pushed = force_loop(bushing_bench(rubber, "about_x", arm), Harmonic(5.0, 4e-3))
    assert not pushed.rotates
    angle = np.arcsin(pushed.displacement / arm)
    moment = 70.0 * angle + rubber.rotational_damping_x * pushed.velocity / (arm * np.cos(angle))
    friction = pushed.force * arm * np.cos(angle) - moment
    full = rubber.full_friction_rate_x
    rate = pushed.velocity / (arm * np.cos(angle))
    assert friction == pytest.approx(
        0.5 * np.sin(0.5 * np.pi * np.clip(rate / full, -1.0, 1.0)), abs=1e-9
    )
    turned = force_loop(bushing_bench(rubber, "about_x"), Harmonic(5.0, 0.04))
    assert np.max(np.abs(pushed.force)) * arm == pytest.approx(
        np.max(np.abs(turned.force)), rel=2e-3
    )  # as [A] reckons


@settings(max_examples=25)
@given(
    f_max=forces,
    damping=dampings,
    v=speeds,
    c1=dampings,
    c2=dampings,
    k=st.floats(1e3, 3e5),
    motion=motions,
)
def test_no_damper_gives_energy(f_max, damping, v, c1, c2, k, motion):
    assume(c1 + c2 > 1.0)
    sponge = {
        "friction_force": f_max,
        "sponge_stiffness": k,
        "sponge_damping": c1,
        "slider_damping": c2,
    }
    dampers = [
        CoulombDamper(law="coulomb", friction_force=f_max, damping=damping),
        StvDamper(law="stv", friction_force=f_max, transition_velocity=v, damping=damping),
        HavsinDamper(law="havsin", friction_force=f_max, full_friction_velocity=v, damping=damping),
        MstvDamper(law="mstv", friction_damping=damping, **sponge),
        StvSpongeDamper(law="stv_sponge", transition_velocity=v, **sponge),
        StvSpongeDamper(law="stv_sponge", **sponge),
        FREE_STROKE.model_copy(update={"friction_force": f_max, "friction_damping": damping + 1.0}),
    ]
    for damper in dampers:
        loop = force_loop(damper_bench(damper), motion)
        largest = (np.max(np.abs(loop.force)) + k * motion.amplitude) * motion.amplitude
        assert measures_of(loop).energy_per_cycle >= -1e-6 * largest, damper.law


@settings(max_examples=40)
@given(
    k=st.floats(0.0, 1e6),
    c=dampings,
    p=st.floats(0.0, 10.0),
    v=speeds,
    axis=st.sampled_from(AXES),
    motion=motions,
)
def test_no_bushing_gives_energy(k, c, p, v, axis, motion):
    kind, letter = ("rotational_" if axis.startswith("about") else ""), axis[-1]
    update = {f"{kind}stiffness_{letter}": k, f"{kind}damping_{letter}": c}
    update |= {f"friction_torque_{letter}": p, f"full_friction_rate_{letter}": v}
    bench = bushing_bench(gasket().model_copy(update=update), axis)
    loop = force_loop(bench, motion)
    assert measures_of(loop).energy_per_cycle >= -1e-12 * (
        1.0 + np.max(np.abs(loop.force)) * motion.amplitude
    )


@functools.cache
def mstv_force(mass):
    return force_loop(damper_bench(MSTV, mass), Harmonic(3.0, 1e-3)).force


def largest_difference(mass):
    return np.max(np.abs(mstv_force(mass) - mstv_force(0.0)))


@pytest.mark.parametrize("mass", [0.04, 0.02])  # kg
def test_a_sponge_with_mass_differs_in_proportion_to_it(mass):
    assert 1.8 < largest_difference(mass) / largest_difference(0.5 * mass) < 2.2


def test_ten_grams_of_sponge_change_the_loop_by_less_than_three_parts_in_ten_thousand():
    assert largest_difference(0.01) < 3e-4 * np.max(mstv_force(0.0))


@pytest.mark.parametrize("motion", MATRICES["damper"]["C"], ids=str)
def test_a_sponge_of_a_milligram_is_massless_in_all_tests_of_c(motion):
    """Leave out both reversals: the friction of a massless slider jumps, a mass smooths the jump."""
    heavy, massless = (force_loop(damper_bench(MSTV, m), motion).force for m in (1e-6, 0.0))
    inside = np.delete(np.arange(len(massless)), [len(massless) // 4, 3 * len(massless) // 4])
    assert heavy[inside] == pytest.approx(massless[inside], abs=2e-5 * np.max(massless))
    assert heavy == pytest.approx(massless, abs=2e-3 * np.max(massless))


def test_all_tests_of_c_run_with_a_sponge_of_ten_grams():
    motions = MATRICES["damper"]["C"]
    damper = load_machine(SPONGES).damper_types["friction"]
    loops = {m: force_loops(damper_bench(damper, m), motions) for m in (0.0, 0.01)}
    assert len(loops[0.01]) == 18
    for heavy, massless in zip(loops[0.01], loops[0.0], strict=True):
        # the inertia of 10 g is below 10 g times the largest acceleration of the driven end
        inertia = 0.01 * heavy.motion.angular_frequency**2 * heavy.motion.amplitude
        largest = np.max(np.abs(massless.force))
        mean = np.sqrt(np.mean(np.square(heavy.force - massless.force)))
        assert mean < inertia + 2e-4 * largest


@pytest.mark.parametrize("mass", [0.0, 0.01, 0.5])  # kg
@pytest.mark.parametrize("frequency", [1.0, 10.0, 50.0])  # Hz
def test_heavy_sponge_without_friction_has_its_complex_stiffness(mass, frequency):
    """Solve m X'' + c2 X' = k1 (Y - X) + c1 (Y' - X') in closed form: a complex stiffness."""
    bench = damper_bench(MSTV.model_copy(update={"friction_force": 0.0}), mass)
    motion = Harmonic(frequency, 1e-3)
    s = 1j * motion.angular_frequency
    sponge, slider = 176e3 + 90.0 * s, 400.0 * s + mass * s * s
    expected = sponge * slider / (sponge + slider)
    measures = measures_of(force_loop(bench, motion))
    assert measures.dynamic_stiffness == pytest.approx(abs(expected), rel=1e-5)
    assert measures.loss_angle == pytest.approx(np.angle(expected), abs=1e-5)


def test_coulomb_friction_behind_a_spring_is_masings_loop():
    """Take hardly a dashpot: stick, then slip at f_max; energy 4 f_max (A - f_max / k)."""
    damper = StvSpongeDamper(
        law="stv_sponge", friction_force=60.0, sponge_stiffness=176e3, sponge_damping=1.0
    )
    for amplitude in (0.5e-3, 1e-3, 5e-3):
        expected = 4.0 * 60.0 * (amplitude - 60.0 / 176e3)
        assert energy(damper_bench(damper), Harmonic(0.1, amplitude)) == pytest.approx(
            expected, rel=2e-3
        )


def test_stv_with_sponge_tends_to_coulomb():
    def loop(v_st):
        sponge = {"sponge_stiffness": 176e3, "sponge_damping": 90.0, "slider_damping": 400.0}
        damper = StvSpongeDamper(
            law="stv_sponge", friction_force=60.0, transition_velocity=v_st, **sponge
        )
        return force_loop(damper_bench(damper), Harmonic(3.0, 1e-3)).force

    differences = [np.max(np.abs(loop(v_st) - loop(0.0))) for v_st in (4e-3, 1e-3, 1e-4)]
    assert differences == sorted(differences, reverse=True)
    assert differences[-1] < 0.6  # N, of 60


def test_free_stroke_loop_has_basic_friction_inside_and_sponge_beyond():
    inside, beyond = force_loops(
        damper_bench(FREE_STROKE), [Harmonic(1.0, 3e-3), Harmonic(1.0, 0.01)]
    )
    basic = 10.5 * np.sin(0.5 * np.pi * inside.velocity / 0.09)
    assert inside.force == pytest.approx(basic, abs=1e-9)
    assert 35.0 < np.max(beyond.force) < 40.0 + 10.5


@pytest.mark.parametrize("frequency", [1.0, 3.0, 6.67, 10.0])
def test_mstv_smaller_amplitude_smaller_loop(frequency):
    """Check [C] section 2.3 on its Fig. 6."""
    loops = force_loops(
        damper_bench(MSTV), [Harmonic(frequency, a) for a in (0.3e-3, 0.5e-3, 1e-3, 1.5e-3)]
    )
    areas = [measures_of(loop).energy_per_cycle for loop in loops]
    peaks = [measures_of(loop).peak_force for loop in loops]
    assert areas == sorted(areas)
    assert peaks == sorted(peaks)


def test_motions_side_by_side_are_motions_alone():
    motions = [Harmonic(f, a) for f in (1.0, 10.0) for a in (0.3e-3, 1.5e-3)]
    for together, motion in zip(force_loops(damper_bench(MSTV), motions), motions, strict=True):
        assert together.force == pytest.approx(
            force_loop(damper_bench(MSTV), motion).force, abs=2e-5 * 60.0
        )


@pytest.mark.parametrize(
    "damper", [MSTV, FREE_STROKE, CoulombDamper(law="coulomb", friction_force=60.0, damping=20.0)]
)
def test_the_dampers_system_under_drakes_integrator_gives_the_loop_of_the_bench(damper):
    """Move the tub above an upright damper; rig and system have no code in common."""
    motion = Harmonic(3.0, 9e-3)
    parameters = FrictionDamperParameters(
        np.zeros(3), np.array([0.0, 0.0, -0.3]), EndBushing(), packed_damper_law(damper)
    )
    builder = DiagramBuilder()
    sine = builder.AddSystem(
        Sine(np.eye(7)[5] * motion.amplitude, np.full(7, motion.angular_frequency), np.zeros(7))
    )
    state = builder.AddSystem(Multiplexer([7, 7]))
    system = builder.AddSystem(
        element_system(parameters.kind, parameters.packed(), np.zeros(parameters.state_size))
    )
    builder.Connect(sine.get_output_port(0), state.get_input_port(0))
    builder.Connect(sine.get_output_port(1), state.get_input_port(1))
    builder.Connect(state.get_output_port(), system.GetInputPort("plant_state"))
    period = 1.0 / motion.frequency
    logged = LogVectorOutput(system.GetOutputPort("force"), builder, publish_period=period / 360.0)
    diagram = builder.Build()
    simulator = Simulator(diagram)
    simulator.get_mutable_integrator().set_target_accuracy(1e-7)
    simulator.AdvanceTo(8.0 * period)
    log = logged.FindLog(simulator.get_context())
    force = log.data()[0, -361:-1]
    bench = force_loop(damper_bench(damper), motion).force[::4]
    assert np.max(np.abs(bench)) > 30.0
    turning = np.isclose(
        np.abs(np.sin(np.linspace(0.0, 2.0 * np.pi, 361)[:-1])), 1.0
    )  # a jump of Coulomb friction
    assert force[~turning] == pytest.approx(bench[~turning], abs=2e-3 * np.max(np.abs(bench)))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Harmonic(1.0, -1e-3), "amplitude: is -0.001; allowed is > 0"),
        (lambda: damper_bench(CoulombDamper(law="coulomb", friction_force=60.0), 0.01), "sponge_mass: only the law mstv or free_stroke"),
        (lambda: damper_bench(MSTV, -0.01), "sponge_mass: is -0.01 kg"),
        (lambda: bushing_bench(gasket(), "radial"), "axis: no axis 'radial'; allowed are x, y, z, about_x"),
        (
            lambda: force_loop(bushing_bench(gasket(), "about_x", arm=0.1), Harmonic(1.0, 0.1)),
            "amplitude: is 0.1 m; allowed is less than the arm",
        ),
    ],
)  # fmt: skip
def test_bad_input_is_told(make, message):
    with pytest.raises(InputError) as told:
        make()
    assert str(told.value).startswith(message)


@pytest.mark.parametrize("amplitude", [0.3e-3, 0.5e-3, 1e-3])
def test_mstv_higher_frequency_lower_friction(amplitude):
    """Check [C] section 4.1, Figs. 7 and 12: a faster sponge has less friction and work of it.

    The measured force less the air resistance is the friction on the massless sponge; air resistance itself grows.
    """
    frictions, works = [], []
    for frequency in (1.0, 3.0, 6.67, 10.0):
        motion, bench = Harmonic(frequency, amplitude), damper_bench(MSTV)
        loop = force_loop(bench, motion)
        row = bench.packed[None]
        deformation = steady_deformations(
            bench, row, np.array([amplitude]), np.array([motion.angular_frequency])
        )[0, :-1]
        slider = loop.velocity - np.array(
            [
                mstv_damper(v, d, *bench.packed[1:])[1]
                for v, d in zip(loop.velocity, deformation, strict=True)
            ]
        )
        friction = loop.force - 400.0 * slider
        frictions.append(np.mean(np.abs(friction)))
        works.append(np.mean(friction * slider) / frequency)
    assert frictions == sorted(frictions, reverse=True)
    assert works == sorted(works, reverse=True)


def test_points_of_a_free_stroke_are_where_the_paper_has_them():
    """Check [A] section 2.1, Fig. 5: free stroke from A to B, largest force at C, turn at D."""
    damper = load_machine("free_stroke").damper_types["free_stroke"]
    bench = damper_bench(damper)
    loop = force_loop(bench, Harmonic(1.0, 10e-3))
    a, b, c, d = (stroke_points(bench, loop)[letter] for letter in "ABCD")
    x, force = loop.displacement, loop.force
    assert x[a] < x[b] < x[c] < x[d] == x.max()
    # the sponge leaves its free stroke of 6 mm as far as it slid against the tube
    assert x[b] - x[a] == pytest.approx(6e-3, rel=0.2)
    assert max(abs(force[[a, b]])) <= damper.basic_friction_force + 0.05 * force.max()
    assert force[c] == force.max()
    inside = force_loop(bench, Harmonic(1.0, 1e-3))  # a motion that stays in the free stroke
    assert stroke_points(bench, inside) == {}
    other = damper_bench(load_machine("reference").damper_types["friction"])
    assert stroke_points(other, force_loop(other, Harmonic(1.0, 5e-3))) == {}
