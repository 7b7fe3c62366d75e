"""The reference machine against the published numbers of [B].

The limits are those that the calibration of this machine reached (analyses/calibrate_reference.py).
It used all 36 amplitudes and all 18 means, so these tests pin a fit; they do not test a prediction.
See docs/theory/fits.md.
"""

import numpy as np
import pytest

from wm_drake.batch import simulate_many
from wm_drake.parameters import measured_amplitudes, published_results
from wm_drake.parameters.measured import DESIGN, NamedValue
from wm_drake.simulation.cases import case_of
from wm_drake.simulation.runs import simulate
from wm_drake.studies.calibration.response_targets import ComputedResponses, response_targets_of
from wm_drake.studies.calibration.targets import targets_of
from wm_drake.studies.spin.gasket_effect import steady_amplitudes, steady_window

R_GASKET = 0.18
"""Radius of the rubber ring. [m] Assumption: openings of 320 to 400 mm."""


@pytest.fixture(scope="module")
def targets(reference):
    return targets_of(reference, measured_amplitudes(reference))


@pytest.fixture(scope="module")
def table(machine, reference, targets):
    cases = [case_of(reference, load, gasket=gasket) for load, gasket in targets.loads]
    return simulate_many(machine, cases, measures=("amplitudes", "gap", "spring tensions"))


def test_amplitudes_are_within_the_limits(table, targets):
    errors = np.abs(table.amplitude.values / targets.amplitude - 1.0)
    assert errors.size == 36
    assert errors.mean() <= 0.078
    assert errors.max() <= 0.20


def test_means_of_the_gasket_study_are_within_the_limits(machine, reference):
    units = {"D": "mm", "F": "N", "M": "N*m"}
    published = {
        key: terms["constant"].effects[0]
        for key, terms in published_results(reference.published).items()
    }
    values = [
        NamedValue(load, True, "[B]", DESIGN, name, value, units[name[0]], "Table 5")
        for (load, name), value in published.items()
    ]
    targets = response_targets_of(reference, values)
    computed = ComputedResponses(machine, targets)([reference])[0]
    errors = dict(zip(published, np.abs(computed / list(published.values()) - 1.0), strict=True))
    assert len(errors) == 18
    assert np.mean(list(errors.values())) <= 0.15
    assert max(errors.values()) <= 0.50
    assert max(error for (_, name), error in errors.items() if name == "My") <= 0.25


def test_gasket_changes_amplitudes_in_the_measured_direction(table, targets):
    measured, computed = (
        targets.gasket_effects(values) for values in (targets.amplitude, table.amplitude.values)
    )
    clear = np.concatenate([np.abs(measured[load]) > 0.05 for load in ("middle", "counter")])
    same = np.concatenate(
        [np.sign(measured[load]) == np.sign(computed[load]) for load in ("middle", "counter")]
    )
    assert clear.sum() == 9
    assert (same & clear).sum() >= 8  # not Xr of the middle load


def test_gasket_is_what_a_rubber_ring_can_be(reference):
    gasket = reference.gasket
    # K_x + K_z is the integral of both stiffnesses per length; the tangential one makes K_Ty
    bound = (gasket.stiffness_x + gasket.stiffness_z) * R_GASKET**2
    assert 0.4 * bound < gasket.rotational_stiffness_y < 0.9 * bound
    tilts = gasket.rotational_stiffness_x + gasket.rotational_stiffness_z
    assert tilts < gasket.stiffness_y * R_GASKET**2


def test_springs_stay_taut_and_the_tub_does_not_touch(table):
    assert (table.smallest_spring_tension > 5.0).all()
    assert (table.smallest_gap > 0.0).all()


@pytest.mark.parametrize("load", ["middle", "counter"])
def test_gasket_hardly_matters_in_the_steady_state(machine, reference, load):
    """Check [B] section 2.2; amplitudes below 1 mm change by less than 0.4 mm."""
    with_it, without = (
        steady_amplitudes(
            simulate(machine, case_of(reference, load, gasket=gasket)),
            steady_window(reference.profile),
        ).values
        for gasket in (True, False)
    )
    large = without >= 1e-3
    assert large.sum() >= 4
    assert with_it[large] == pytest.approx(without[large], rel=0.10)
    assert with_it[~large] == pytest.approx(without[~large], abs=4e-4)
