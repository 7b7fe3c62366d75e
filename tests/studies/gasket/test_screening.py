"""Screening and the gasket study on functions with a known answer."""

import numpy as np
import pandas as pd
import pytest

from wm_drake.batch import simulate_many
from wm_drake.errors import InputError
from wm_drake.model.build import build_machine
from wm_drake.parameters import (
    GASKET_FACTORS,
    SpinProfile,
    at_levels,
    factor_of_text,
    levels_of,
    load_factors,
)
from wm_drake.simulation.cases import Case
from wm_drake.simulation.measures import measure
from wm_drake.simulation.runs import simulate
from wm_drake.studies.doe import Design, level_matrix, make_design
from wm_drake.studies.gasket.screening import Responses, leading_terms, mean_at, run_screening
from wm_drake.studies.gasket.study import RESPONSES, GasketTrials
from wm_drake.studies.gasket.tables import as_plain_data, to_json, write_tables

NAMES = ("a", "b", "c")
UNITS = {"y": "mm", "z": "N"}


def additive(design):
    """y = 10 + 3 a + b^2 - 2/3, z = a b for load one, twice that for load two."""
    a, b, _ = design.levels.T.astype(float)
    frame = pd.DataFrame({"y": 10.0 + 3.0 * a + b**2 - 2.0 / 3.0, "z": 5.0 + a * b})
    return Responses({"one": frame, "two": 2.0 * frame}, UNITS, {})


@pytest.fixture(scope="module")
def screening():
    return run_screening(make_design("full", NAMES), additive)


def test_known_effects_are_recovered(screening):
    table = screening.tables["two", "y"]
    assert table.constant == pytest.approx(20.0)
    a, b, c = table.terms[:3]
    assert a.effects == pytest.approx({(-1,): -6.0, (0,): 0.0, (1,): 6.0})
    assert b.effects == pytest.approx({(-1,): 2.0 / 3.0, (0,): -4.0 / 3.0, (1,): 2.0 / 3.0})
    assert c.percent == pytest.approx(0.0, abs=1e-12)
    assert a.percent == pytest.approx(100.0 * 6.0 / (6.0 + 2.0 / 9.0))
    assert screening.tables["one", "z"].interaction_percent == pytest.approx(100.0)


def test_leading_terms_are_those_above_the_thresholds(screening):
    assert [term.name for term in leading_terms(screening.tables["one", "y"])] == ["a"]
    assert [term.name for term in leading_terms(screening.tables["one", "z"])] == ["a:b"]


def test_mean_at_levels_is_the_mean_over_the_others(screening):
    values = additive(screening.design).values["one"]["z"]
    levels = screening.design.levels
    means = mean_at(screening, ("one", "z"), ["b", "a"])
    for (b, a), mean in means.items():
        assert mean == pytest.approx(values[(levels[:, 0] == a) & (levels[:, 1] == b)].mean())


def test_tables_are_the_same_bytes_each_time(screening, tmp_path):
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
        write_tables(screening, tmp_path / name)
    files = {path.name: path.read_bytes() for path in (tmp_path / "first").iterdir()}
    assert files == {path.name: path.read_bytes() for path in (tmp_path / "second").iterdir()}
    assert set(files) == {
        "design.csv",
        "runs.csv",
        "variance.csv",
        "contributions.csv",
        "effects.csv",
        "leading_terms.csv",
    }
    variance = pd.read_csv(tmp_path / "first" / "variance.csv").set_index(["load", "response"])
    assert variance.loc[
        ("two", "y"), ["constant", "smallest", "largest"]
    ].tolist() == pytest.approx([20.0, 38 / 3, 80 / 3])
    assert len(pd.read_csv(tmp_path / "first" / "runs.csv")) == 54


def test_plain_data_have_the_documented_form(screening):
    data = as_plain_data(screening)
    to_json(data)
    assert {"design", "trials", "d_efficiency", "responses"} <= set(data)
    response = data["responses"]["two"]["y"]
    assert {"mean", "main_percent", "interaction_percent", "residual_percent", "terms"} <= set(
        response
    )
    first = response["terms"][0]
    assert (first["term"], first["effects"]) == (
        "a",
        pytest.approx({"-1": -6.0, "0": 0.0, "1": 6.0}),
    )
    assert response["terms"][3]["effects"].keys() == {
        f"{i}:{j}" for i in (-1, 0, 1) for j in (-1, 0, 1)
    }


def failing(trials):
    def evaluate(design):
        responses = additive(design)
        for trial in trials:
            responses.values["two"].loc[trial] = np.nan
        return Responses(responses.values, UNITS, {(trial, "two"): "diverged" for trial in trials})

    return evaluate


def test_failed_runs_are_omitted_if_the_others_determine_the_effects():
    design = make_design("full", NAMES)
    screening = run_screening(design, failing([3, 20]))
    assert screening.tables["two", "y"].terms[0].effects[(1,)] == pytest.approx(6.0)
    assert len(screening.tables["two", "y"].residual) == 25
    with pytest.raises(InputError, match="load two: 20 of 27 runs failed"):
        run_screening(design, failing(range(20)))


SHORT = SpinProfile(time=(0.0, 2.0), speed=(5.0, 12.0))


def test_cases_of_trials_have_their_levels(reference):
    texts = ("K_Lx", "loads.middle.unbalances.0.mass=80 %..120 %")
    known = load_factors(GASKET_FACTORS)
    factors = levels_of(reference, dict(factor_of_text(text, known) for text in texts))
    middle = at_levels(reference, factors, [0, 0])
    machine = build_machine(middle)
    loads = [Case(name, reference.loads[name], SHORT) for name in ("middle", "counter")]
    trials = GasketTrials(middle, factors, loads)
    design = Design("own", texts, level_matrix(2), "main")
    responses = trials.responses(
        design, lambda cases: simulate_many(machine, cases, measures=("extremes",))
    )
    assert list(responses.values) == ["middle", "counter"]
    assert list(responses.values["middle"].columns) == RESPONSES == list(responses.units)
    heavy = list(trials.cases(design))[2 * 5]  # levels 0, 1: heavier, middle load
    assert heavy.load.unbalances[0].mass == pytest.approx(1.2)
    measures = measure(simulate(machine, heavy))
    expected = [
        *(1e3 * measures.detergent_displacement.values),
        *measures.gasket_force.values,
        *measures.gasket_moment.values,
    ]
    assert list(responses.values["middle"].loc[5]) == pytest.approx(expected, rel=1e-9)
    assert (
        responses.values["counter"].loc[3, "Dx"] == responses.values["counter"].loc[5, "Dx"]
    )  # its own masses stay
