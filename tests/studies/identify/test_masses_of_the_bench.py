"""Masses of the bench in an identification: jig and outer tube at the driven end, sponge."""

import numpy as np
import pytest
from synthetic_loops import measured, motions_mm

from wm_drake.errors import InputError
from wm_drake.parameters import MeasuredLoop, load_component
from wm_drake.rigs import damper_bench
from wm_drake.rigs.measured import inertia_share, measured_motion, without_inertia
from wm_drake.studies.fitting.methods import identify
from wm_drake.studies.identify.models import Given, damper_model
from wm_drake.studies.identify.problem import fit_problem

MSTV = load_component("mstv_damper").parameters
MOTIONS = motions_mm((3.0, 3.0), (6.67, 1.5), (10.0, 1.5))
TRUTH = {
    name: getattr(MSTV, name)
    for name in ("friction_force", "sponge_stiffness", "sponge_damping", "slider_damping")
}
JIG = 4.0  # kg


def test_numbers_are_found_only_without_the_inertia_of_the_jig():
    raw = measured(damper_bench(MSTV, 0.0, JIG), MOTIONS)
    found = identify(fit_problem(damper_model("mstv", raw), raw))
    loops = [without_inertia(motion, JIG) for motion in raw]
    right = identify(fit_problem(damper_model("mstv", loops), loops))
    for name, truth in TRUTH.items():
        assert right[name].value == pytest.approx(truth, rel=0.02)
    assert right.rmse < 0.02 * found.rmse
    inertia, share = inertia_share(raw[2], JIG)
    expected = JIG * 1.5e-3 * (2.0 * np.pi * 10.0) ** 2
    assert inertia == pytest.approx(expected, rel=1e-2)
    assert share == pytest.approx(expected / (0.5 * np.ptp(raw[2].loop.force)), rel=1e-2)


def test_inertia_of_a_recorded_motion_is_that_of_its_second_derivative():
    t = np.linspace(0.0, 2.0, 2001)
    y = 4e-3 * np.sin(2.0 * np.pi * 3.0 * t) + 1e-3 * np.sin(2.0 * np.pi * 6.0 * t)
    acceleration = -4e-3 * (6.0 * np.pi) ** 2 * np.sin(6.0 * np.pi * t) - 1e-3 * (
        12.0 * np.pi
    ) ** 2 * np.sin(12.0 * np.pi * t)
    loop = MeasuredLoop("two sines", "two.csv", t, y, JIG * acceleration, rotates=False)
    left = without_inertia(measured_motion(loop), JIG).loop.force
    inside = slice(20, -20)
    assert np.abs(left[inside]).max() < 1e-3 * JIG * np.abs(acceleration).max()


@pytest.mark.slow
def test_a_sponge_with_mass_is_followed_in_a_fit():
    """Move 10 g at 10 Hz, which changes the loop little, and 1 kg, which is seen."""
    loops = measured(damper_bench(MSTV, 1.0), MOTIONS[2:])
    kept = {name: value for name, value in TRUTH.items() if name != "friction_force"}
    with_mass = damper_model("mstv", loops, Given(fixed=kept), sponge_mass=1.0)
    result = identify(fit_problem(with_mass, loops))
    assert result["friction_force"].value == pytest.approx(TRUTH["friction_force"], rel=2e-3)
    plain = identify(fit_problem(damper_model("mstv", loops, Given(fixed=kept)), loops))
    assert plain.rmse > 5.0 * result.rmse


def test_a_law_without_sponge_refuses_its_mass():
    loops = measured(damper_bench(MSTV), MOTIONS[:1])
    with pytest.raises(InputError, match="has no sponge that can have a mass; allowed are mstv"):
        damper_model("coulomb", loops, sponge_mass=0.01)
