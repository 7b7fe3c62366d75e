"""Uncertain machines and the study, with a function of known answer in place of the runs."""

import numpy as np
import pytest
import xarray as xr
from made_up_runs import made_up
from scipy import stats

from wm_drake.errors import InputError
from wm_drake.parameters.limits import Limit, load_limits
from wm_drake.parameters.vary_file import VARY_FILES, VaryFile, load_vary
from wm_drake.simulation.cases import Case
from wm_drake.simulation.measures import MEASURES
from wm_drake.simulation.measures.responses import Response
from wm_drake.studies.tolerance.page import leading
from wm_drake.studies.tolerance.study import (
    OF_RUNS,
    ToleranceSettings,
    ToleranceTrials,
    judged,
    limits_of,
)
from wm_drake.studies.tolerance.variables import uncertain_machine
from wm_drake.studies.vary import varying_of

SPRING = "spring_types.suspension.stiffness"
GAP = Response("gap", MEASURES["gap"].variables[0])


def uncertain(machine, file):
    """Return the uncertain machine of a file, or of entries in its form."""
    if isinstance(file, dict):
        file = VaryFile.model_validate({"loads": "middle"} | file)
    case = Case("middle", machine.parameters.loads["middle"], machine.parameters.profile)
    return uncertain_machine(varying_of(machine, file.entries(without=())), file, case)


def normal(key, mean="100 %", deviation="5 %", **more):
    return {"keys": (key,), "distribution": "normal", "mean": mean, "deviation": deviation, **more}


def test_percent_value_and_distance_mean_the_same(machine):
    k = machine.parameters.spring_types["suspension"].stiffness
    forms = [("100 %", "5 %"), (f"{k} N/m", f"{0.05 * k} N/m"), ("nominal", f"{0.05 * k} N/m")]
    for mean, deviation in forms:
        found = uncertain(machine, {"vary": {"k": normal(SPRING, mean, deviation)}})
        (case,) = found.cases(np.array([[2.0]]))
        assert case.parameters.spring_types["suspension"].stiffness == pytest.approx(1.1 * k)


def test_one_draw_or_one_each(machine):
    one = uncertain(machine, {"vary": {"k": normal(SPRING)}})
    each = uncertain(machine, {"vary": {"k": normal(SPRING, draws="each")}})
    assert [v.name for v in one.variables] == ["k"]
    assert [v.name for v in each.variables] == ["k.left", "k.right", "k.rear"]
    (case,) = each.cases(np.array([[0.0, 1.0, 0.0]]))
    k = machine.parameters.spring_types["suspension"].stiffness
    types = case.parameters.spring_types
    found = {name: types[s.type].stiffness for name, s in case.parameters.springs.items()}
    assert found == pytest.approx({"left": k, "right": 1.05 * k, "rear": k})


def test_samples_with_the_same_parts_share_a_machine(machine):
    tree = {"vary": {**load_vary("laundry").vary, "k": normal(SPRING)}}
    found = uncertain(machine, tree)
    scores = np.zeros((3, len(found.variables)))
    scores[1, 1:], scores[2, 0] = 0.5, 0.5  # another load; another spring
    first, other_load, other_spring = found.cases(scores)
    assert found.variables[0].name == "k"
    assert first.parameters is other_load.parameters
    assert first.load != other_load.load
    k = [c.parameters.spring_types["suspension"].stiffness for c in (first, other_spring)]
    assert k[1] == pytest.approx(1.025 * k[0])


def test_split_laundry_is_two_lumps(machine):
    found = uncertain(machine, load_vary("laundry"))
    cases = found.cases(np.random.default_rng(0).standard_normal((20, len(found.variables))))
    values = found.joint.values(np.random.default_rng(0).standard_normal((20, 7)))
    for case, (mass, angle, y, radius, share, lead, second_y) in zip(cases, values, strict=True):
        first, second = case.load.unbalances
        assert first.mass + second.mass == pytest.approx(mass)
        assert second.mass == pytest.approx(share * mass)
        assert (first.y, second.y) == pytest.approx((y, second_y))
        assert first.radius == second.radius == pytest.approx(radius)
        assert (first.phase, second.phase) == pytest.approx((angle, angle + lead))
        assert 0.2 <= mass <= 0.6


def test_shipped_files_fit_the_reference_machine(machine):
    for name in set(VARY_FILES.listed()) - {"gasket"}:
        found = uncertain(machine, load_vary(name))
        assert all(variable.entry.source for variable in found.variables)
        found.check(lambda case: None)
        assert name != "laundry_and_parts" or len(found.variables) == 12


def test_correlation_of_an_unknown_quantity_is_refused(machine):
    correlations = {"quantities": ("k", "q"), "matrix": ((1, 0.5), (0.5, 1))}
    with pytest.raises(InputError, match="no quantity 'q'"):
        uncertain(machine, {"vary": {"k": normal(SPRING)}, "correlations": correlations})


def test_negative_mass_is_refused_before_the_study(machine):
    key = "loads.middle.unbalances.0.mass"
    wide = {"vary": {"m": normal(key, "0.1 kg", "50 g")}}
    with pytest.raises(InputError, match=r"lower end is not allowed.*truncate"):
        uncertain(machine, wide).check(lambda case: None)
    wide["vary"]["m"] |= {"low": "0 kg"}
    uncertain(machine, wide).check(lambda case: None)


def gap_of(case, k):
    """Return a gap that is linear in the scores: 30 mm less 10 mm for each deviation. [m]"""
    score = (case.parameters.spring_types["suspension"].stiffness / k - 1.0) / 0.05
    other = (case.parameters.damper_types["friction"].friction_force / 40.0 - 1.0) / 0.1
    return 0.03 - 0.01 * score - 0.002 * other


@pytest.fixture(scope="module")
def study(machine):
    """Return a function that runs a study of two quantities with gaps of closed form."""
    key = "damper_types.friction.friction_force"
    quantities = {"k": normal(SPRING), "f": normal(key, "40 N", "4 N")}
    k = machine.parameters.spring_types["suspension"].stiffness

    def run(cases, shift):
        gaps = np.array([gap_of(case, k) for case in cases]) + shift
        touching = np.where(gaps <= 0.0, gaps, np.nan)
        table = {
            "smallest_gap": ("run", gaps),
            "nearest_pair": ("run", np.ones(len(gaps))),
            "contact_gap": (("run", "pair"), np.column_stack([gaps * np.nan, touching])),
            "diverged": ("run", np.full(len(gaps), "", dtype=object)),
        }
        return xr.Dataset(table, {"pair": ["tub_shell|wall_left", "motor|wall_bottom"]})

    def trials(settings, correlations=None, shift=0.0):
        tree = {"vary": quantities, "correlations": correlations}
        experiment = made_up(lambda cases: run(cases, shift))
        return ToleranceTrials(uncertain(machine, tree), (GAP,), experiment, settings)

    return trials


EXACT = stats.norm.cdf(-0.03 / np.hypot(0.01, 0.002))


def test_study_finds_the_probability_of_contact(study):
    trials = study(ToleranceSettings(2048, 256, 0))
    samples = trials.samples()
    contact = trials.contact(samples)
    assert contact.method == "crude count"
    assert contact.probability_lower < EXACT < contact.probability_upper
    (touching,) = np.flatnonzero(contact.touches)
    assert contact["pair"][touching] == "motor|wall_bottom"
    # linear in independent normals: first and total indices are shares of the variance
    indices = trials.indices(samples).sel(measure="smallest_gap")
    for part in (indices["first"], indices.total):
        np.testing.assert_allclose(part, [100 / 104, 4 / 104], atol=0.02)
    assert leading(trials.indices(samples))["quantity"].values.tolist() == ["k", "f"]


def test_rare_contact_is_found_by_subset_simulation(study):
    trials = study(ToleranceSettings(256, 0, 1000))
    contact = trials.contact(trials.samples())
    assert contact.method == "subset simulation"
    assert contact.probability_lower < EXACT < contact.probability_upper
    assert contact.rare_runs < 5000
    assert contact.rare_touches.sel(pair="motor|wall_bottom") == 1.0
    assert contact.rare_touches.sum() == 1.0


def test_samples_without_contact_give_an_upper_bound(study):
    trials = study(ToleranceSettings(16, 0, 100), shift=1.0)
    contact = trials.contact(trials.samples())
    assert (contact.method, contact.probability) == ("crude count", 0.0)
    assert contact.probability_upper == pytest.approx(1.0 - 0.05 ** (1 / 16))
    assert (contact.rare_runs, contact.sizes["level"]) == (640, 6)
    assert np.isinf(contact.rare_deviation)


def test_correlated_quantities_have_no_sobol_indices(study):
    trials = study(
        ToleranceSettings(64, 64, 0), {"quantities": ("k", "f"), "matrix": ((1, 0.5), (0.5, 1))}
    )
    indices = trials.indices(trials.samples())
    assert not indices
    assert "correlated" in trials.why_missing(indices)


@pytest.mark.parametrize(
    ("limit", "allowed", "word"),
    [("0 mm", "1 %", "pass"), ("3 cm", "10 %", "fail"), ("3 cm", "50 %", "undecided")],
)
def test_verdict_of_a_limit(study, limit, allowed, word):
    wanted = Limit(quantity="gap", at_least=limit, allowed_share=allowed)
    samples = study(ToleranceSettings(512, 0, 0)).samples()
    assert judged(samples, limits_of([wanted], (GAP,))).verdict.values == [word]


def test_limits_that_cannot_be_judged_are_refused(tmp_path):
    for limit, message in (
        (Limit(quantity="gpa", at_least="0 mm", allowed_share="1 %"), "not measured"),
        (Limit(quantity="gap", at_least="0 N", allowed_share="1 %"), "'N'|dimension|fit"),
    ):
        with pytest.raises(InputError, match=message):
            limits_of([limit], (GAP,))
    path = tmp_path / "limits.yaml"
    path.write_text("limits:\n- {quantity: gap, at_least: 0 mm, allowed_share: 3}\n")
    with pytest.raises(InputError, match=r"limits\.yaml:2.*is not a share"):
        load_limits(path)


def test_shares_in_percent():
    shown = [OF_RUNS.text(x) for x in (0.0, 1.25e-6, 7.31e-4, 1.2345e-2, 0.5)]
    assert shown == ["0 %", "0.00013 %", "0.073 %", "1.2 %", "50 %"]
