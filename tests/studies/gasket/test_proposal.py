"""The proposed setting of a gasket study, on functions whose best setting is known."""

import numpy as np
import pandas as pd
import pytest

from wm_drake.parameters import GASKET_FACTORS, levels_of, load_factors
from wm_drake.simulation.measures.responses import GAP
from wm_drake.studies.doe.design import make_design
from wm_drake.studies.gasket.proposal import (
    ZERO,
    Aim,
    Proposal,
    best_places,
    change_of,
    is_level_zero,
    settings_of,
)
from wm_drake.studies.gasket.screening import Meaning, Responses, run_screening
from wm_drake.studies.gasket.surface import Check, model_row, model_rows, surfaces

NAMES = ("C_L", "C_T", "K_Lx", "K_Ly")
UNITS = {GAP: "mm", "Dx": "mm"}
MEANINGS = {GAP: Meaning("smallest gap", goal="larger"), "Dx": Meaning("displacement x")}


def aim_of(gap, displacement):
    """Return the aim of a study of two loads whose responses are functions of the four places."""

    def evaluate(design):
        x = design.levels.T.astype(float)
        frame = pd.DataFrame({GAP: gap(*x), "Dx": displacement(*x)})
        return Responses({"a": frame, "b": frame + 0.5}, UNITS, {}, MEANINGS)

    screening = run_screening(make_design("full", NAMES), evaluate)
    return Aim(screening, surfaces(screening))


@pytest.fixture(scope="module")
def factors(sponges):
    return levels_of(sponges, {n: f for n, f in load_factors(GASKET_FACTORS).items() if n in NAMES})


def test_rows_of_many_settings_are_those_of_each():
    places = np.random.default_rng(0).uniform(-1.0, 1.0, (5, 4))
    together = model_rows(places, interactions=True)
    assert np.array_equal(together, [model_row(row, interactions=True) for row in places])


def test_largest_gap_is_proposed_and_idle_factors_stay():
    best = best_places(aim_of(lambda a, b, c, d: 8 + 2 * a - c**2 + 0.01 * d, lambda *_: 10 + _[3]))
    assert best == (1.0, 0.0, 0.0, 0.0)


def test_a_gain_that_costs_more_than_a_tenth_elsewhere_is_cut():
    # Dx of load b is 10.5 at level 0: it may rise to 11.55, so a may rise to 0.35 and no further
    best = best_places(aim_of(lambda a, b, c, d: 8 + a, lambda a, *_: 10 + 3 * a))
    assert best is not None
    assert 0.3 <= best[0] <= 0.35


def test_nothing_is_proposed_where_level_zero_is_best():
    aim = aim_of(lambda a, b, c, d: 8 - a**2 - b**2 - c**2 - d**2, lambda *_: 10 + _[3])
    assert best_places(aim) is None


def test_the_runs_are_beside_the_machine_and_the_line_sets_what_was_run(sponges, factors):
    places = (1.0, 0.0, -0.5, 0.0)
    every = [change_of(sponges, f, x) for f, x in zip(factors, places, strict=True) if x]
    assert [change.sets for change in every] == [{"C_L": "0.0285 N*s/mm"}, {"K_Lx": "1.64 N/mm"}]
    aim = aim_of(lambda a, b, c, d: 8 + a, lambda *_: 10 + _[3])
    settings = settings_of(tuple(every), factors)
    frame = pd.DataFrame({GAP: [8.0, 9.0], "Dx": [10.0, 10.5]})
    responses = Responses({"a": frame, "left out": frame - 1.0}, UNITS, {}, MEANINGS)
    check = Check(tuple(settings), aim.surfaces, responses)
    proposal = Proposal(tuple(every), check, ("a",), is_level_zero(sponges, factors), "")
    assert settings[0].text == ZERO
    assert proposal.is_machine
    assert proposal.left_out == ["left out"]
    assert proposal.gaps("before") == {"a": 8.0, "left out": 7.0}
    assert proposal.gaps("after") == {"a": 9.0, "left out": 8.0}
    assert np.isnan(proposal.frame()["predicted"]).tolist() == [False, False, True, True]
    worst = proposal.worst(aim.screening).set_index("response")
    assert worst.loc[GAP, ["before", "load_before", "after"]].tolist() == [7.0, "left out", 8.0]
