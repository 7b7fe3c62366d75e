"""Closed forms: free oscillation of one mass, response of an unbalanced rotor on linear springs."""

import numpy as np
import pytest
from simple_machines import DAMPING, MASS, STIFFNESS, constant_speed, isotropic_machine, unbalance

from wm_drake.engines.drake import run_drake
from wm_drake.model.build import build_machine
from wm_drake.simulation.cases import Case
from wm_drake.simulation.runs import simulate
from wm_drake.studies.modes.natural import natural_modes

UNBALANCE = 0.02  # kg: so small that the drive torque couples pitch into translation by < 1e-3
RADIUS = 0.25  # m


@pytest.fixture(scope="module")
def machine():
    return build_machine(isotropic_machine())


def natural_frequency():
    return np.sqrt(STIFFNESS / MASS)  # rad/s


def damping_ratio():
    return DAMPING / (2.0 * np.sqrt(STIFFNESS * MASS))


def test_modes_of_one_mass_are_the_closed_form(machine):
    modes = natural_modes(machine)
    translations = np.argsort(np.abs(modes.frequency.values - natural_frequency() / (2 * np.pi)))[
        :3
    ]
    np.testing.assert_allclose(
        modes.frequency.values[translations], natural_frequency() / (2 * np.pi), rtol=1e-9
    )
    np.testing.assert_allclose(modes.damping_ratio.values[translations], damping_ratio(), rtol=1e-9)


def test_free_decay_has_the_closed_form_frequency_and_log_decrement(machine):
    setup = machine.set_up()
    machine.plant.SetPositions(setup.plant_context, [0, 0, 0, 1e-3, -2e-3, 3e-3, 0])
    trajectory = run_drake(setup, constant_speed(0.0, 3.0), 2.5e-4, lambda fraction: None)
    for coordinate in (3, 4, 5):
        x = trajectory.state[:, coordinate]
        # a damped oscillation obeys x[n+1] = a x[n] + b x[n-1] with the poles' images as roots
        (a, b), *_ = np.linalg.lstsq(np.column_stack([x[1:-1], x[:-2]]), x[2:], rcond=None)
        pole = np.log(np.roots([1.0, -a, -b])[0]) / (trajectory.time[1] - trajectory.time[0])
        zeta = damping_ratio()
        assert abs(pole) == pytest.approx(natural_frequency(), rel=1e-6)
        log_decrement = 2 * np.pi * -pole.real / abs(pole.imag)
        assert log_decrement == pytest.approx(2 * np.pi * zeta / np.sqrt(1 - zeta**2), rel=1e-6)


@pytest.mark.parametrize(
    ("ratio", "engine"),
    [
        *((ratio, "compiled") for ratio in (0.5, 0.9, 1.0, 1.1, 2.0)),
        pytest.param(1.0, "drake", marks=pytest.mark.slow),
    ],
)
def test_unbalance_response_equals_the_closed_form(machine, ratio, engine):
    speed = ratio * natural_frequency()
    case = Case("one", unbalance(UNBALANCE, RADIUS), constant_speed(speed, 26.0))
    record = simulate(machine, case, engine).sel(time=slice(20.0, None))
    total = MASS + UNBALANCE
    expected = UNBALANCE * RADIUS * speed**2 / (STIFFNESS - total * speed**2 + 1j * DAMPING * speed)
    turned = np.exp(-1j * record.drum_angle.values)
    # phase 0 points up and turns about +y, up -> right: z ~ cos, x ~ sin
    for axis, quadrature in (("z", 1.0), ("x", 1j)):
        basis = np.column_stack([np.real(1 / turned), -np.imag(1 / turned), np.ones(len(turned))])
        real, imaginary, _ = np.linalg.lstsq(
            basis, record.tub_position.sel(axis=axis).values, rcond=None
        )[0]
        response = (real + 1j * imaginary) * quadrature
        assert abs(response) == pytest.approx(abs(expected), rel=1e-3)
        assert np.angle(response / expected) == pytest.approx(0.0, abs=1e-3)


def test_far_above_resonance_the_amplitude_tends_to_the_eccentricity(machine):
    eccentricity = UNBALANCE * RADIUS / (MASS + UNBALANCE)
    excess = []
    for ratio in (6.0, 12.0):
        case = Case(
            "one", unbalance(UNBALANCE, RADIUS), constant_speed(ratio * natural_frequency(), 16.0)
        )
        x = (
            simulate(machine, case, step=1e-3)
            .tub_position.sel(time=slice(14.0, None))
            .sel(axis="x")
            .values
        )
        excess.append(np.sqrt(2.0) * np.std(x) / eccentricity - 1.0)
    assert 0.0 < excess[1] < excess[0] < 0.04
    assert excess[1] < 1e-2
