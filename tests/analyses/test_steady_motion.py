"""Tests of the steady motion of a machine by equivalent linearisation."""

import numpy as np
import pytest
from analysis_tools.steady_model import SPEEDS, mass_matrix
from analysis_tools.steady_motion import STEPS, bushing_damping, damper_stiffness, solve_six

from wm_drake.elements.damper_law import packed_damper_law
from wm_drake.engines.compiled.mechanics import DRUM_RATE
from wm_drake.engines.compiled.slopes import SlopedDerivative
from wm_drake.parameters.damper_laws import CoulombDamper, HavsinDamper, StvSpongeDamper

AMPLITUDES, TURNING = np.array([1e-3, 4e-3, 0.02]), np.array([8.0, 20.0])


def stiffness_of(damper):
    stiffness = np.empty((len(AMPLITUDES), len(TURNING)), dtype=complex)
    damper_stiffness(packed_damper_law(damper), AMPLITUDES, TURNING, stiffness)
    return stiffness


def test_dry_friction_has_the_fundamental_of_a_square_wave():
    damper = CoulombDamper(law="coulomb", friction_force=30.0, damping=50.0)
    expected = 1j * (4.0 * 30.0 / (np.pi * AMPLITUDES[:, None]) + 50.0 * TURNING)
    np.testing.assert_allclose(stiffness_of(damper), expected, rtol=2.0 / STEPS)


def test_smoothed_friction_is_a_dashpot_at_small_rates():
    damper = HavsinDamper(law="havsin", friction_force=30.0, full_friction_velocity=8.0)
    expected = 1j * TURNING * np.pi * 30.0 / (2.0 * 8.0) * np.ones((3, 1))
    np.testing.assert_allclose(stiffness_of(damper), expected, rtol=1e-3)


def test_a_sponge_without_friction_is_two_dashpots_and_a_spring():
    k, c1, c2 = 30e3, 100.0, 60.0
    damper = StvSpongeDamper(
        law="stv_sponge", friction_force=0.0, sponge_stiffness=k, sponge_damping=c1,
        slider_damping=c2, transition_velocity=0.01,
    )  # fmt: skip
    sponge, slider = k + 1j * TURNING * c1, 1j * TURNING * c2
    expected = sponge * slider / (sponge + slider) * np.ones((3, 1))
    np.testing.assert_allclose(stiffness_of(damper), expected, rtol=2e-2)


def test_friction_of_a_bushing_is_a_dashpot_at_small_rates_and_dry_at_large_ones():
    rates, damping = np.array([1e-3, 1e3]), np.empty(2)
    bushing_damping(rates, 2.0, 0.35, damping)
    expected = [np.pi * 0.35 / (2.0 * 2.0), 4.0 * 0.35 / (np.pi * 1e3)]
    np.testing.assert_allclose(damping, expected, rtol=1e-3)


def test_elimination_solves_a_system_that_needs_pivots():
    rng = np.random.default_rng(1)
    matrix = rng.normal(size=(6, 6)) + 1j * rng.normal(size=(6, 6))
    matrix[0, 0] = 0.0
    right = rng.normal(size=6) + 1j * rng.normal(size=6)
    solution = right.copy()
    solve_six(matrix.copy(), solution)
    np.testing.assert_allclose(matrix @ solution, right, rtol=1e-10, atol=1e-10)


@pytest.fixture(scope="module")
def net():
    """Return the net of one damper law."""
    from analysis_tools.net_ledger import nets_of

    return nets_of("havsin")


def drawn(net):
    """Return machines of the net. (machine, quantity)"""
    rng = np.random.default_rng(3)
    return np.array([net.by_runs.drawn(rng) for _ in range(40)])


def rest_of(steady, assembled):
    """Return all rest poses, the machine that is most level, and its largest angle."""
    poses = np.linalg.solve(assembled.stiffness, assembled.rest[..., None])[..., 0]
    turned = np.where(steady.is_possible(assembled), np.abs(poses[:, :3]).max(axis=1), np.inf)
    level = int(np.argmin(turned))
    return poses, level, turned[level]


@pytest.mark.slow
def test_assembled_machines_are_built_ones(net):
    """Compare with the slopes of the compiled right-hand side, for a tub that hangs nearly level.

    What a turn of the rest pose changes is left out of the assembly: it is of the order of its
    angle.
    """
    points = drawn(net)
    assembled = net.steady.assembly(points)
    poses, level, angle = rest_of(net.steady, assembled)
    built = net.by_runs.machine.set_up(
        parameters=net.by_runs.map.parameters_at(points[level]), gasket=False, dampers=False
    )
    derivative = SlopedDerivative(built)
    states = np.tile(derivative.rest, (2, 1))
    states[1, DRUM_RATE] = 30.0
    positions = np.flatnonzero(~derivative.is_velocity)[:6]  # then the states of idle sponges
    velocities = np.flatnonzero(derivative.is_velocity)
    mass = mass_matrix(derivative.packed)
    still, moving = (-mass @ slopes[velocities] for slopes in derivative.jacobian(states))
    expected = {
        "mass": mass,
        "stiffness": still[:, positions],
        "damping": still[:, velocities],
        "gyroscopic": (moving - still)[:, velocities] / 30.0,
    }
    tolerance = 3.0 * angle + 1e-3
    for name, matrix in expected.items():
        found = getattr(assembled, name)[level]
        assert np.abs(found - matrix).max() < tolerance * np.abs(matrix).max(), name
    preloads = [spring.preload for spring in built.springs.values()]
    np.testing.assert_allclose(assembled.preload[level], preloads, rtol=1e-6)
    np.testing.assert_allclose(poses[level], built.rest_pose, atol=0.1 * angle)


@pytest.mark.slow
def test_a_machine_without_friction_moves_as_by_harmonic_balance(net):
    """Compare amplitudes above the resonances, where angles are small.

    They differ by the part of the inertia of the load that turns, and by the rest pose.
    """
    import wm_drake as wm

    steady = net.steady
    names = ("damper_friction", "damper_damping", "end_bushing_friction")
    points = drawn(net)
    points[:, [steady.shape.index[name] for name in names]] = 1e-3, 200.0, 1e-6
    assembled = steady.assembly(points)
    _, level, _ = rest_of(steady, assembled)
    ones = np.ones((1, 6))
    motions, _ = steady.motions(assembled, level, [("middle", False)], (ones, ones))
    parameters = net.by_runs.map.parameters_at(points[level])
    of = slice(7, None, 5)
    exact = wm.steady_response(parameters, "middle", SPEEDS[of], gasket=False, harmonics=3)
    grid = exact.on_grid.values
    sizes = np.abs(motions[0, of] @ steady.sensor_arms(assembled, level).T)
    np.testing.assert_allclose(sizes, exact.amplitude.values[grid], rtol=0.1, atol=3e-4)
