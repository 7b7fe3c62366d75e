"""Rubber on the bench: loops with a planted friction, which the plain law cannot follow."""

import numpy as np
import pytest
from synthetic_loops import measured, motions_mm

from wm_drake.errors import InputError
from wm_drake.parameters import load_machine
from wm_drake.parameters.elements import BushingType
from wm_drake.rigs import Harmonic, bushing_bench, force_loop, measures_of
from wm_drake.studies.fitting.methods import identify
from wm_drake.studies.identify.models import TestedAxis, bushing_model
from wm_drake.studies.identify.problem import fit_problem

GASKET = load_machine("reference").gasket
NUMBERS = {
    "stiffness_y": 3000.0,
    "damping_y": 10.0,
    "dahl_force_y": 4.0,
    "dahl_displacement_y": 0.5e-3,
}  # N/m, N s/m, N, m; assumed: [A] prints no friction of its gasket
RUBBER = GASKET.model_copy(update=NUMBERS)
MOTIONS = motions_mm(*((f, a) for f in (1.0, 3.0, 5.0) for a in (1.0, 5.0, 10.0)))  # [A] Table 7


@pytest.fixture(scope="module")
def loops():
    return measured(bushing_bench(RUBBER, "y"), MOTIONS, noise=0.01, seed=3)


def found(law, loops):
    model = bushing_model(law, loops, TestedAxis(GASKET, "y"))
    return identify(fit_problem(model, loops))


def relative_rmse(result, loops):
    """Return the RMSE by the RMS of the measured force, per test."""
    return np.array(
        [
            test.rmse / np.sqrt(np.mean(np.square(m.loop.force - np.mean(m.loop.force))))
            for test, m in zip(result.tests, loops, strict=True)
        ]
    )


def test_voigt_leaves_ten_percent_of_a_planted_friction_and_dahl_finds_it(loops):
    plain = relative_rmse(found("voigt", loops), loops)
    richer = found("voigt_dahl", loops)
    assert np.sqrt(np.mean(plain**2)) > 0.10
    assert np.max(relative_rmse(richer, loops)) < 0.015  # the noise
    for name, truth in NUMBERS.items():
        assert richer[name].value == pytest.approx(truth, rel=0.15 if name == "damping_y" else 0.03)


def test_a_maxwell_branch_is_found_from_its_loops():
    numbers = {
        "stiffness_y": 2000.0,
        "damping_y": 5.0,
        "maxwell_stiffness_y": 1500.0,
        "maxwell_damping_y": 90.0,
    }
    rubber = GASKET.model_copy(update=numbers)
    loops = measured(bushing_bench(rubber, "y"), MOTIONS, noise=0.002, seed=5)
    result = found("voigt_maxwell", loops)
    for name, truth in numbers.items():
        assert result[name].value == pytest.approx(truth, rel=0.1)
    assert (
        relative_rmse(found("voigt", loops), loops).max() > 3.0 * relative_rmse(result, loops).max()
    )


def test_a_loop_of_the_bench_is_that_of_the_closed_form():
    friction = GASKET.model_copy(update=NUMBERS | {"stiffness_y": 0.0, "damping_y": 0.0})
    for frequency in (0.1, 5.0):  # independent of it
        amplitude, x_c, full = 2e-3, 0.5e-3, 4.0
        loop = measures_of(force_loop(bushing_bench(friction, "y"), Harmonic(frequency, amplitude)))
        corner = full * np.tanh(amplitude / x_c)
        assert loop.peak_force == pytest.approx(corner, rel=1e-4)
        assert loop.energy_per_cycle == pytest.approx(
            4.0 * (full * amplitude - x_c * corner), rel=2e-3
        )
    k, c, w = 1500.0, 90.0, 2.0 * np.pi * 3.0
    maxwell = GASKET.model_copy(
        update={
            "stiffness_y": 0.0,
            "damping_y": 0.0,
            "maxwell_stiffness_y": k,
            "maxwell_damping_y": c,
        }
    )
    loop = measures_of(force_loop(bushing_bench(maxwell, "y"), Harmonic(3.0, amplitude)))
    complex_stiffness = 1j * w * c * k / (k + 1j * w * c)
    assert loop.dynamic_stiffness == pytest.approx(abs(complex_stiffness), rel=1e-5)
    assert loop.loss_angle == pytest.approx(np.angle(complex_stiffness), abs=1e-5)


def test_a_bushing_of_tubes_has_no_rubber(loops):
    plain = BushingType(**{name: getattr(GASKET, name) for name in BushingType.model_fields})
    with pytest.raises(InputError, match="branches of rubber"):
        bushing_model("rubber", loops, TestedAxis(plain, "y"))
