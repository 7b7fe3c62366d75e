"""Compiled code of a page: machines that differ in numbers share it."""

import pytest

import wm_drake as wm
from wm_drake.live import page_data


class PlanKnownError(Exception):
    """Ends an export."""


@pytest.fixture
def plan_of(monkeypatch):
    """Return a function that returns what the functions of a page are compiled for."""

    def stop(plan, _names):
        raise PlanKnownError(repr(plan))

    def plan_of(parameters):
        monkeypatch.setattr(page_data, "page_code", stop)
        with pytest.raises(PlanKnownError) as known:
            page_data._page_data(parameters)
        return str(known.value)

    return plan_of


def test_a_machine_with_other_numbers_has_the_same_code(plan_of, reference):
    numbers = {"gasket.stiffness_x": 4000.0, "bodies.drum.mass": 15.0}
    before, after = plan_of(reference), plan_of(wm.with_values(reference, numbers))
    assert before == after
    assert plan_of(reference.model_copy(update={"gasket": None})) != before
