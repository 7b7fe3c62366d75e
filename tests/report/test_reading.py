"""Results in SI or in US units: words, numbers, digits and names follow the quantity."""

import pytest
import xarray as xr

from wm_drake.parameters.reading import US, read_in
from wm_drake.parameters.units import Unit
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import SPEED, Quantity
from wm_drake.studies.answer import Answer, Part
from wm_drake.studies.facts import Facts

LENGTH = Quantity("gap", Unit("m", "mm"), 1)
CASES = [
    (LENGTH, 0.0254, "25.4 mm", "1.000 in", "_in"),
    (Quantity("force", Unit("N", "N"), 1), 4.4482216, "4.4 N", "1.00 lbf", "_lbf"),
    (Quantity("mass", Unit("kg", "kg"), 2), 0.45359237, "0.45 kg", "1.00 lb", "_lb"),
    (Quantity("stiffness", Unit("N/m", "N/mm")), 175.126835, "0.1751 N/mm", "1 lbf/in", "_lbf_per_in"),
    (SPEED, 10.471975512, "100 rpm", "100 rpm", "_rpm"),
]  # fmt: skip


@pytest.mark.parametrize(("quantity", "value", "si", "us", "suffix"), CASES)
def test_a_quantity_is_read_in_either_units(quantity, value, si, us, suffix):
    assert quantity.text(value) == si
    with read_in(US):
        assert quantity.text(value) == us
        assert quantity.suffix == suffix
        assert quantity.reading.to_si(quantity.values(value)) == pytest.approx(value, rel=1e-12)
    assert quantity.text(value) == si


def answer():
    data = xr.Dataset({"gap": LENGTH.variable("run", [0.0254])}, {"run": ["a"]})
    table = LabelledTable("gaps", data, "Gaps", is_in_terminal=True)
    return Answer("Gap", f"{LENGTH.text(0.0254)}.", None, (Part("Gaps", (table,)),))


def shown_by(answer):
    """Return the table of the page of an answer."""
    return answer.page(Facts()).partition("<tbody")[2]


def test_an_answer_keeps_the_units_in_which_it_was_made():
    made_in_si = answer()
    with read_in(US):
        made = answer()
        assert made_in_si.tables()["gaps"].columns.tolist() == ["run", "gap_mm"]
    assert made.answer == "1.000 in."
    assert made.as_json()["gaps"] == [{"run": "a", "gap_in": pytest.approx(1.0)}]
    assert "1.000" in shown_by(made)
    assert "25.4" in shown_by(made_in_si)
