"""Limits of the machine with damper tubes: energy, massless tubes, spin inertia of the tubes."""

import pytest
from analysis_tools.damper_topology import strut_machine
from telescopic_machine import OUTER_TUBES, RUN_UP, changed, telescopic, with_bushing, with_tubes
from tube_energy import balance

from wm_drake.batch import simulate_many
from wm_drake.model.build import build_machine
from wm_drake.parameters import Load, SpinProfile, Unbalance
from wm_drake.simulation.cases import Case
from wm_drake.simulation.vibration import relative_error

LOAD = Load(unbalances=(Unbalance(mass=0.5, radius=0.24, y=-0.1),))


@pytest.fixture(scope="module")
def built(shipped):
    return shipped("free_stroke")


def regions(machine, step=None, parameters=None, integrator=None):
    case = Case("one", LOAD, RUN_UP, parameters=parameters)
    return (
        simulate_many(machine, [case], measures=["regions"], step=step, integrator=integrator)
        .region_displacement.values[0]
        .reshape(2, -1)
    )


def test_energy_of_a_run_is_balanced(built):
    profile = SpinProfile(time=(0.0, 1.5), speed=(15.0, 26.0))  # no corner, where the torque jumps
    drive, change, dissipated = balance(built, built.set_up(LOAD), LOAD, profile, 2.5e-4)
    assert dissipated > 3.0  # J
    assert abs(drive - change - dissipated) < 1e-5 * dissipated


def test_steps_are_fine_enough(built):
    fine = regions(built, 6.25e-5, integrator="runge_kutta")
    assert relative_error(regions(built, integrator="runge_kutta"), fine).max() < 1e-5
    assert relative_error(regions(built), fine).max() < 2.5e-5  # one derivative a step


def stiffer_and_lighter(built, share):
    """Return the machine with tube masses divided and bushing stiffnesses multiplied by `share`.

    The bushings have friction in bending only, like those of a strut.
    """
    stiff = {f"stiffness_{axis}": 2e5 * share for axis in "xyz"} | {
        f"damping_{axis}": 40.0 for axis in "xyz"
    }
    free = {f"friction_torque_{axis}": 0.0 for axis in "xyz"} | {"rotational_damping_y": 1e-5}
    return with_bushing(with_tubes(telescopic(), built, 0.2 / share, 5e-4 / share), **stiff, **free)


def test_light_tubes_on_stiff_bushings_move_as_the_strut_machine(built, tmp_path):
    struts = build_machine(strut_machine(stiffer_and_lighter(built, 1), tmp_path))
    strut = regions(struts, 2.5e-4)
    errors = []
    for share in (1, 4):
        machine = build_machine(stiffer_and_lighter(built, share))
        errors.append(relative_error(regions(machine, 2.5e-4 / share), strut).max())
    assert errors[1] < 0.3 * errors[0]  # the error is proportional to mass and compliance
    assert errors[1] < 8e-3


@pytest.mark.slow
def test_light_tubes_converge_to_the_strut_machine(built, tmp_path):
    strut = regions(build_machine(strut_machine(stiffer_and_lighter(built, 1), tmp_path)), 2.5e-4)
    machine = build_machine(stiffer_and_lighter(built, 16))
    assert relative_error(regions(machine, 2.5e-4 / 16), strut).max() < 2e-3


def test_larger_spin_inertia_of_the_tubes_changes_little(built):
    """Compare with small explicit steps and the inertia of the SDF.

    analyses/check_spin_of_tubes.py makes the same comparison with an implicit method.
    """
    kept = {name: body for name, body in telescopic().bodies.items() if name not in OUTER_TUBES}
    true = changed(telescopic(), bodies=kept)
    error = relative_error(regions(built), regions(built, 2.5e-5, true))
    assert 0.0 < error.max() < 1e-3
