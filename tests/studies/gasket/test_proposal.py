"""The proposed setting of a gasket study, on functions whose best setting is known."""

import pytest

from wm_drake.parameters import varying
from wm_drake.parameters.units import Unit
from wm_drake.parameters.vary_file import gasket_entries
from wm_drake.report.quantity import Quantity
from wm_drake.simulation.measures.responses import GAP
from wm_drake.studies.doe.design import make_design
from wm_drake.studies.gasket.proposal import (
    Candidates,
    is_level_zero,
    sets_of,
    settings_of,
    text_at,
)
from wm_drake.studies.gasket.screening import run_screening, runs_of
from wm_drake.studies.gasket.surface import models_of

NAMES = ("C_L", "C_T", "K_Lx", "K_Ly")
LENGTH = Quantity("length", Unit("m", "mm"))
QUANTITIES = {GAP: LENGTH, "Dx": LENGTH}


def best_places(gap, displacement):
    """Return the best setting of two loads whose responses are functions of the four places."""

    def evaluate(design):
        x = design.levels.T.astype(float)
        one = {GAP: gap(*x), "Dx": displacement(*x)}
        other = {name: values + 0.5 for name, values in one.items()}
        return runs_of({"a": one, "b": other}, QUANTITIES, {GAP: "larger", "Dx": "smaller"})

    screening = run_screening(make_design("full", NAMES), evaluate)
    return Candidates(screening, models_of(screening)).best()


@pytest.fixture(scope="module")
def factors(sponges):
    entries = {name: entry for name, entry in gasket_entries().items() if name in NAMES}
    return varying(sponges, entries).every


def test_largest_gap_is_proposed_and_idle_factors_stay():
    best = best_places(lambda a, b, c, d: 8 + 2 * a - c**2 + 0.01 * d, lambda *_: 10 + _[3])
    assert best == (1.0, 0.0, 0.0, 0.0)


def test_a_gain_that_costs_more_than_a_tenth_elsewhere_is_cut():
    # Dx of load b is 10.5 at level 0: it may rise to 11.55, so a may rise to 0.35 and no further
    best = best_places(lambda a, b, c, d: 8 + a, lambda a, *_: 10 + 3 * a)
    assert best is not None
    assert 0.3 <= best[0] <= 0.35


def test_nothing_is_proposed_where_level_zero_is_best():
    best = best_places(lambda a, b, c, d: 8 - a**2 - b**2 - c**2 - d**2, lambda *_: 10 + _[3])
    assert best is None


def test_the_line_sets_what_was_run(sponges, factors):
    damping, _, stiffness, _ = factors
    assert sets_of(damping, text_at(sponges, damping, 1.0)[0]) == {"C_L": "0.0285 N*s/mm"}
    text, place = text_at(sponges, stiffness, -0.5)
    assert sets_of(stiffness, text) == {"K_Lx": "1.64 N/mm"}
    before, after = settings_of({"K_Lx": place}, factors)
    assert (before.places, after.places) == ((0.0,) * 4, (0.0, 0.0, place, 0.0))
    assert is_level_zero(sponges, factors)
