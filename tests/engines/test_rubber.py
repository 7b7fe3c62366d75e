"""Bushings of rubber in a running machine: energy, steps of each integrator, the step check."""

import numpy as np
import pytest
from energy_book import EnergyBook, dense_record
from machines_of_each_kind import RUBBER, changed
from upright_springs import with_upright_springs

from wm_drake.engines.compiled.linear import INTERNAL, PATH
from wm_drake.engines.compiled.packing import pack
from wm_drake.engines.compiled.step_check import DIFFERENCE, fastest_motions, linearised
from wm_drake.errors import InputError
from wm_drake.model.build import build_machine
from wm_drake.parameters import SpinProfile, load_machine
from wm_drake.simulation.cases import Case, case_of
from wm_drake.simulation.runs import simulate

pytestmark = pytest.mark.slow
REFERENCE = load_machine("reference")
PEAKS = ("displacement", "bushing_force", "bushing_moment", "branch_stretch", "cabinet_force")


def with_rubber(**numbers):
    return build_machine(changed(gasket=REFERENCE.gasket.model_dump() | numbers))


@pytest.fixture(scope="module")
def rubber():
    return with_rubber(**RUBBER)


def peaks(record):
    return {name: np.abs(record[name]).max("time").values for name in PEAKS}


def test_peaks_at_the_default_step_are_those_of_a_fine_one(rubber):
    case = case_of(rubber.parameters, "middle")
    fine = peaks(simulate(rubber, case, step=2.5e-3 / 16, integrator="runge_kutta"))
    for integrator in ("multistep", "runge_kutta"):
        found = peaks(simulate(rubber, case, integrator=integrator))
        for name in PEAKS:
            np.testing.assert_allclose(found[name], fine[name], atol=3e-4 * fine[name].max())


def test_friction_over_a_short_path_needs_no_short_step():
    """Move the gasket by several times 0.1 mm in a step of 2.5 ms."""
    machine = with_rubber(dahl_force_x=8.0, dahl_displacement_x=1e-4)
    case = case_of(machine.parameters, "middle")
    record = simulate(machine, case, step=2.5e-3 / 16, integrator="runge_kutta")
    assert np.abs(record.tub_velocity.values[:, 0]).max() * 2.5e-3 > 4e-4
    fine = peaks(record)
    for integrator in ("multistep", "runge_kutta"):
        found = peaks(simulate(machine, case, integrator=integrator))
        for name in PEAKS:
            np.testing.assert_allclose(found[name], fine[name], atol=3e-3 * fine[name].max())


def test_energy_of_a_machine_with_rubber_balances(rubber):
    profile = SpinProfile(time=(0.0, 0.75, 1.0), speed=(12.0, 24.0, 24.0))
    load = REFERENCE.loads["middle"]
    setup, record = dense_record(rubber, Case("middle", load, profile), 1.5625e-4)
    book = EnergyBook(setup, load, record)
    work, change, dissipated = book.balance()
    assert abs(work - change - dissipated) / dissipated < 1e-5
    stored, _ = book._branches(rubber.parameters.gasket, *np.zeros((2, len(record.time), 6)))
    assert stored.max() > 1e-2  # the branches count in this balance


def test_the_step_check_sees_branches():
    stiff = with_rubber(dahl_force_x=200.0, dahl_displacement_x=1e-6)  # 200 kN/mm on the tub
    with pytest.raises(InputError, match="too long for the tub, whose fastest motion oscillates"):
        simulate(stiff, "middle")
    fast = with_rubber(maxwell_stiffness_x=1e5, maxwell_damping_x=20.0)  # decays with 5000 1/s
    with pytest.raises(InputError, match="the Maxwell branch of bushing 'gasket'"):
        simulate(fast, "middle")


def test_states_are_named_and_treated_by_kind(rubber):
    assert "the Maxwell branch of bushing 'gasket'" in fastest_motions(rubber.set_up())
    setup = rubber.set_up()
    kinds = linearised(setup, *pack(setup), DIFFERENCE).kinds
    assert list(kinds[-6:]) == [PATH, INTERNAL, PATH, INTERNAL, INTERNAL, PATH]


def test_rubber_at_rest_has_no_force(machine, rubber):
    """Check a machine that rests as drawn, where the gasket is not deflected, and the shipped one.

    There cross-stiffness makes a force from the deflection of springs that lean.
    """
    drawn = with_upright_springs(machine)
    gasket = rubber.parameters.gasket
    upright = drawn.model_copy(update={"gasket": gasket})
    assert np.abs(rubber.set_up(parameters=upright).rest_pose).max() < 1e-9
    np.testing.assert_allclose(rubber.set_up().residual, 0.0, atol=1e-6)
