"""The rule of proposals that studies share, on responses of known best candidates."""

import numpy as np
import pytest
import xarray as xr

from wm_drake.parameters.units import Unit
from wm_drake.report.quantity import Quantity
from wm_drake.simulation.measures.responses import GAP
from wm_drake.studies.proposal import Aim, compared, is_confirmed, proposal_of
from wm_drake.studies.proposal_page import costs_text, proposal_part, proposal_text

GOALS = {GAP: "larger", "F": "smaller"}
QUANTITIES = {GAP: Quantity("gap", Unit("m", "mm")), "F": Quantity("force", Unit("N", "N"))}
RUNS = np.array([[0.004, 10.0], [0.014, 12.0], [np.nan, np.nan]])
MACHINE = np.array([0.005, 10.0])


@pytest.mark.parametrize(
    ("candidates", "changes", "best"),
    [
        ([[0.006, 10.0], [0.009, 10.0]], [1, 1], 1),
        # 12 N is a fifth more than 10 N
        ([[0.006, 10.0], [0.013, 12.0]], [1, 1], 0),
        # the second one has 95 % of the gain with one change
        ([[0.00900, 10.0], [0.00885, 10.0]], [3, 1], 1),
        # 0.1 mm of a range of 10 mm
        ([[0.0051, 9.0]], [1], None),
        ([[np.nan, 10.0], [0.006, 10.0]], [1, 1], 1),
        ([], [], None),
    ],
)
def test_the_largest_gap_within_the_limit_is_proposed(candidates, changes, best):
    values = np.array(candidates).reshape(-1, 2)
    assert Aim(GOALS, RUNS, MACHINE).proposed(values, changes) == best


def test_without_a_gap_it_is_the_best_of_all_responses():
    aim = Aim(
        {"F": "smaller", "M": "smaller"}, np.array([[8.0, 1.0], [12.0, 3.0]]), np.array([10.0, 2.0])
    )
    # geometric means of the parts: 0.61 and 0.71; the machine has 0.5
    assert aim.value(np.array([[9.0, 2.0], [10.0, 1.0]])) == pytest.approx([0.375**0.5, 0.5**0.5])
    assert aim.proposed(np.array([[9.0, 2.0], [10.0, 1.0]]), [1, 1]) == 1


def test_nothing_is_proposed_for_a_machine_of_which_a_run_failed():
    aim = Aim(GOALS, RUNS, np.array([np.nan, 10.0]))
    assert aim.proposed(np.array([[0.009, 10.0]]), [1]) is None


def runs_with(after):
    """Return the runs of two loads before, and with a gap after a change."""
    values = np.array([[[0.005, 10.0], [0.007, 8.0]], [[0.009, 8.0], [after, 10.5]]])
    dims = ("setting", "load", "response")
    variable = Quantity("run").of_each("response", QUANTITIES, dims, values)
    labels = {"setting": ["before", "after"], "load": ["a", "b"], "response": [GAP, "F"]}
    return compared(xr.DataArray(variable, labels), GOALS)


def test_runs_are_compared_by_the_worst_load_of_each_response():
    runs = runs_with(0.008)
    gap, force = runs.sel(response=GAP), runs.sel(response="F")
    assert (gap.before, gap.after, gap.load_before, gap.load_after) == (0.005, 0.008, "a", "b")
    assert (force.before, force.after, force.load_after) == (10.0, 10.5, "b")
    assert force.change.item() == pytest.approx(0.05)
    assert runs.loss.values == pytest.approx([-0.6, 0.05])


@pytest.mark.parametrize(("after", "is_better"), [(0.008, True), (0.004, False), (np.nan, False)])
def test_only_runs_that_reach_more_confirm(after, is_better):
    assert is_confirmed(Aim(GOALS, RUNS, MACHINE), runs_with(after)) is is_better


def test_the_part_in_short_names_change_gap_and_cost():
    changes = [("stiffness K", "2 N/mm", "a.k")]
    made = proposal_of(runs_with(0.008), changes, is_confirmed=True, command="spin --set K=2")
    text = proposal_text(made)
    assert all(part in text for part in ("stiffness K to 2 N/mm", "8 mm", "load b", "5 mm"))
    assert "F 10 → 10.5 N (+5 %)" in costs_text(made, {})
    part = proposal_part(made, "", {})
    assert dict(part.facts)["Line to copy"] == "spin --set K=2"
    (table, listed, one) = part.tables
    assert table.frame().columns.tolist()[:2] == ["response", "unit"]
    assert listed.records() == [{"changed": "stiffness K", "value": "2 N/mm", "keys": "a.k"}]
    assert one.records() == [{"is_confirmed": True, "line_to_copy": "spin --set K=2"}]
    kept = proposal_of(runs_with(0.004), changes, is_confirmed=False, command="spin --set K=2")
    assert "Line to copy" not in dict(proposal_part(kept, "", {}).facts)
