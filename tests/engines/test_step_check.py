"""The check of the step: closed forms of the fastest motion, and what a step too long would do."""

import numpy as np
import pytest
from simple_machines import MASS, constant_speed, isotropic_machine, unbalance

from wm_drake.batch import simulate_many
from wm_drake.engines.compiled.run import run_compiled
from wm_drake.engines.compiled.step_check import (
    LARGEST_DECAY,
    LARGEST_PHASE,
    fastest_motion,
    fastest_motions,
)
from wm_drake.errors import InputError
from wm_drake.model.build import build_machine
from wm_drake.parameters import with_value, with_values
from wm_drake.simulation.cases import Case
from wm_drake.simulation.runs import simulate


def test_a_mass_on_a_spring_oscillates_at_its_natural_frequency():
    # translation is faster than rotation here: 6 bodies of 0.3 kg m^2 on 40 N m/rad
    machine = build_machine(
        isotropic_machine(stiffness=7000.0, damping=0.0, rotational_stiffness=40.0)
    )
    fastest = fastest_motion(machine.set_up())
    assert fastest.rate == pytest.approx(np.sqrt(7000.0 / MASS), rel=1e-5)
    assert fastest.oscillates
    assert fastest.longest_step == pytest.approx(LARGEST_PHASE / fastest.rate)


def test_a_mass_on_a_strong_dashpot_decays():
    machine = build_machine(
        isotropic_machine(stiffness=10.0, damping=9e4, rotational_stiffness=40.0)
    )
    fastest = fastest_motion(machine.set_up())
    assert fastest.rate == pytest.approx(9e4 / MASS, rel=1e-4)
    assert not fastest.oscillates
    assert fastest.longest_step == pytest.approx(LARGEST_DECAY / fastest.rate)


def test_friction_counts_with_its_steepest_slope():
    """Check HAVSIN about x: p pi / (2 v_t) over the moment of inertia of all bodies."""
    parameters = with_values(
        isotropic_machine(stiffness=10.0, damping=0.0, rotational_stiffness=1.0),
        {"gasket.friction_torque_x": 500.0, "gasket.full_friction_rate_x": 0.5},
    )
    machine = build_machine(parameters)
    inertia = 6 * 0.3  # kg m^2
    fastest = fastest_motion(machine.set_up())
    assert fastest.rate == pytest.approx(500.0 * np.pi / (2.0 * 0.5) / inertia, rel=1e-4)


def test_the_sponge_of_a_damper_decays_with_stiffness_over_damping(sponges):
    """Check k1 / (c1 + c2) while it slips, from [C] Eq. (3) without mass."""
    machine = build_machine(sponges)
    kind = machine.parameters.damper_types["friction"]
    expected = kind.sponge_stiffness / (kind.sponge_damping + kind.slider_damping)
    sponges = [m for part, m in fastest_motions(machine.set_up()).items() if "sponge" in part]
    assert max(m.rate for m in sponges) == pytest.approx(expected, rel=0.15)  # the tub gives way


@pytest.mark.parametrize("name", ["reference", "free_stroke"])
def test_shipped_machines_run_at_their_own_step(name):
    from wm_drake.parameters import load_machine

    parameters = load_machine(name)
    fastest = fastest_motion(build_machine(parameters).set_up())
    assert parameters.step < 0.75 * fastest.longest_step


STIFF = {
    "gasket friction": ("gasket.friction_torque_{}", 3000.0, "the tub"),
    "end bushings": ("damper_types.friction.end_bushing.friction_torque", 150.0, "the tub"),
}


@pytest.mark.parametrize(("key", "value", "part"), STIFF.values(), ids=STIFF)
def test_a_stiff_friction_is_refused_with_the_step_that_will_do(
    machine, reference, key, value, part
):
    keys = [key.format(axis) for axis in "xyz"] if "{}" in key else [key]
    parameters = with_values(reference, dict.fromkeys(keys, value))
    case = Case(
        "middle", reference.loads["middle"], constant_speed(20.0, 2.0), parameters=parameters
    )
    with pytest.raises(InputError, match=rf"step: 2.5 ms is too long for {part}, .* 1/s; allowed"):
        simulate(machine, case)
    with pytest.raises(InputError, match=r"case 0 'middle': step: 2.5 ms is too long"):
        simulate_many(machine, [case])
    setup = machine.set_up(case.load, parameters=parameters)
    pieces = int(np.ceil(5e-3 / fastest_motion(setup).longest_step))
    allowed, fine = (
        simulate(machine, case, step=5e-3 / count).displacement for count in (pieces, 8 * pieces)
    )
    largest = float(np.abs(fine).max())
    np.testing.assert_allclose(allowed, fine, atol=2e-2 * largest)  # the step named will do
    motion = run_compiled(setup, case.profile, 5e-3, lambda fraction: None)  # what it prevents
    reference_motion = run_compiled(setup, case.profile, 5e-3 / 64, lambda fraction: None)
    count = len(motion.time)
    error = np.abs(motion.state[:, 3:6] - reference_motion.state[:count, 3:6]).max()
    assert motion.divergence is not None or error > 2e-2 * largest


def test_drakes_engine_controls_its_error_instead(machine, reference):
    parameters = with_value(reference, "damper_types.friction.end_bushing.friction_torque", 150.0)
    case = Case(
        "middle", reference.loads["middle"], constant_speed(20.0, 0.05), parameters=parameters
    )
    assert simulate(machine, case, "drake-accurate").attrs["diverged"] == ""


def test_unbalance_does_not_change_the_step():
    machine = build_machine(isotropic_machine())
    empty, loaded = machine.set_up(), machine.set_up(unbalance(1.0))
    assert fastest_motion(loaded).rate == pytest.approx(fastest_motion(empty).rate, rel=0.05)


def test_a_machine_that_no_step_can_follow_is_refused_at_once(sponges):
    parameters = with_value(sponges, "damper_types.friction.sponge_stiffness", 1e15)
    case = Case("stiff", sponges.loads["middle"], constant_speed(20.0, 1.0), parameters=parameters)
    with pytest.raises(
        InputError, match=r"too long for the sponge of damper .*; allowed are up to"
    ):
        simulate(build_machine(sponges), case)
