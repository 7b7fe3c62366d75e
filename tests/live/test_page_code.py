"""Compiled code of a page: machines that differ in numbers share it."""

import pytest

import wm_drake as wm
from wm_drake.export.page_second import SecondProcess
from wm_drake.live import page_data


class PlanKnownError(Exception):
    """Ends an export."""


@pytest.fixture
def plans_of(monkeypatch):
    """Return a function that returns what the functions of runs, and all, are compiled for."""
    of_runs = []

    def stop(plan, _names):
        raise PlanKnownError(repr(plan))

    def plans_of(parameters):
        monkeypatch.setattr(page_data, "page_code", stop)
        monkeypatch.setattr(
            SecondProcess, "compile", lambda _second, plan: of_runs.append(repr(plan))
        )
        with pytest.raises(PlanKnownError) as known:
            page_data._page_data(parameters)
        return of_runs[-1], str(known.value)

    return plans_of


def test_a_machine_with_other_numbers_has_the_same_code(plans_of, reference):
    numbers = {"spring_types.suspension.stiffness": 3500.0, "bodies.drum.mass": 11.0}
    before = plans_of(reference)
    assert plans_of(wm.with_values(reference, numbers)) == before
    changed = plans_of(reference.model_copy(update={"gasket": None}))
    assert changed[0] != before[0]
    assert before[0] != before[1]
