"""Quantities and labelled tables: one declaration gives file, JSON, page and terminal."""

import json

import numpy as np
import pytest
import xarray as xr

from wm_drake.parameters.units import PureNumber, Share, Unit
from wm_drake.report.chart import panel
from wm_drake.report.labelled import LabelledTable
from wm_drake.report.quantity import SPEED, TIME, Quantity, quantity_of, shown, text_of
from wm_drake.simulation.measures import MEASURES
from wm_drake.studies.answer import Answer, Part
from wm_drake.studies.facts import Facts

LENGTH = Quantity("gap", Unit("m", "mm"), 1)
STIFFNESS = Quantity("stiffness", Unit("N/m", "N/mm"))
PASSED = Quantity("passed", Share())


def dataset():
    return xr.Dataset(
        {
            "gap": LENGTH.variable(("load", "sensor"), [[1e-3, 2e-3], [np.nan, 4e-3]]),
            "mass": Quantity("mass", Unit("kg", "kg")).variable("load", [1.0, 0.5]),
            "hidden": STIFFNESS.hidden("load", [2e3, 3e3]),
            "is_worst": ("load", [False, True]),
        },
        {"load": ["middle", "back"], "sensor": ["Zf", "Xr"]},
    )


@pytest.mark.parametrize(
    ("quantity", "value", "text", "suffix"),
    [
        (LENGTH, 0.01234, "12.3 mm", "_mm"),
        (LENGTH, -0.001, "−1.0 mm", "_mm"),
        (STIFFNESS, 2500.0, "2.5 N/mm", "_N_per_mm"),
        (SPEED, np.pi, "30 rpm", "_rpm"),
        (PASSED, 0.123, "12.3 %", "_percent"),
        (Quantity("ratio", PureNumber(), form="{:g}×".format), 2.0, "2×", ""),
        (LENGTH, np.nan, "– mm", "_mm"),
    ],
)
def test_a_value_is_text_in_its_unit_for_reading(quantity, value, text, suffix):
    assert quantity.text(value) == text
    assert quantity.suffix == suffix
    np.testing.assert_allclose(quantity.reading.to_si(quantity.values(value)), value)


def test_a_variable_carries_its_quantity_through_selection_and_concatenation():
    data = dataset()
    joined = xr.concat([data, data], "load").isel(load=3)
    assert quantity_of(joined.gap) is LENGTH
    assert text_of(joined.gap.sel(sensor="Xr")) == "4.0 mm"
    np.testing.assert_allclose(shown(data.gap)[0], [1.0, 2.0])


def test_a_variable_of_a_table_of_runs_has_the_quantity_of_its_measure():
    (variable,) = (v for v in MEASURES["amplitudes"].variables if v.name == "amplitude")
    quantity = quantity_of(xr.DataArray([1.0], name="amplitude"))
    assert (quantity.words, quantity.unit) == (variable.kind, variable.unit)


def test_file_and_json_have_a_row_for_each_place_with_a_value():
    table = LabelledTable("gaps", dataset()[["gap"]])
    frame = table.frame()
    assert frame.columns.tolist() == ["load", "sensor", "gap_mm"]
    assert frame["sensor"].tolist() == ["Zf", "Xr", "Xr"]
    assert frame["gap_mm"].tolist() == pytest.approx([1.0, 2.0, 4.0])
    assert json.loads(json.dumps(table.records()))[2]["gap_mm"] == pytest.approx(4.0)


def test_a_dimension_becomes_columns_in_its_own_order():
    table = LabelledTable("gaps", dataset(), across="sensor", words={"Xr": "rear"})
    assert table.frame().columns.tolist() == [
        "load", "mass_kg", "hidden_N_per_mm", "is_worst", "Zf_mm", "Xr_mm",
    ]  # fmt: skip
    shown_table = LabelledTable(
        "gaps", dataset(), "Gaps", "Why.", across="sensor", marked=("is_worst", "alarm")
    ).table()
    assert shown_table.header == ("load", "mass, kg", "Zf, mm", "Xr, mm")
    rows = [
        (group.heading, row.cells, row.kind) for group in shown_table.shown for row in group.rows
    ]
    assert rows == [("middle", ("1", "1.0", "2.0"), ""), ("back", ("0.5", "–", "4.0"), "alarm")]


def test_several_varying_variables_keep_their_names():
    data = dataset()[["gap"]].assign(mean=2.0 * dataset().gap)
    data["mean"].attrs = LENGTH.named("mean").attributes()
    table = LabelledTable("gaps", data, across="sensor", words={"Zf": "front"})
    assert table.frame().columns.tolist() == [
        "load", "gap_Zf_mm", "mean_Zf_mm", "gap_Xr_mm", "mean_Xr_mm",
    ]  # fmt: skip
    assert table.table().header[1:3] == ("gap, front, mm", "mean, front, mm")


def test_single_numbers_are_one_row():
    table = LabelledTable("one", xr.Dataset({"gap": LENGTH.variable((), 2e-3)}))
    assert table.records() == [{"gap_mm": 2.0}]


def test_the_part_in_short_is_a_box_of_the_page_and_lines_of_the_terminal():
    table = LabelledTable("gaps", dataset()[["gap"]])
    short = Part("In short", (table,), facts=[("Capacity", "all of it")], body=lambda: "<b/>")
    answer = Answer("Title", "The answer.", None, (), short=short)
    assert answer.terminal() == ["The answer.", "Capacity: all of it"]
    box = answer.page(Facts()).partition('<div class="answer">')[2].partition("</div>")[0]
    assert "In short" in box
    assert "all of it" in box
    assert "<b/>" in box or "&lt;b/&gt;" in box
    assert list(answer.tables()) == ["gaps"]


def test_a_long_table_is_in_files_only_and_a_warning_on_page_and_terminal():
    table = LabelledTable("gaps", dataset()[["gap"]], is_in_json=False)
    answer = Answer("Title", "The answer.", None, (Part("", (table,)),), warned=("Careful.",))
    assert answer.as_json() == {"title": "Title", "answer": "The answer."}
    assert list(answer.tables()) == ["gaps"]
    assert answer.warned == ("Careful.",)
    assert "Careful." in answer.page(Facts())


def test_a_chart_takes_words_units_and_labels_from_the_data():
    amplitude = Quantity("amplitude", Unit("m", "mm")).variable(
        ("time", "sensor"), [[1e-3, 2e-3], [3e-3, 4e-3]]
    )
    coordinates = {"time": TIME.variable("time", [0.0, 1.0]), "sensor": ["Xr", "Yr"]}
    drawn = panel(
        xr.Dataset({"amplitude": amplitude}, coordinates), "time", ["amplitude"], by="sensor"
    )
    assert [(line.key, list(line.y)) for line in drawn.marks] == [
        ("sensor Xr", [1.0, 3.0]),
        ("sensor Yr", [2.0, 4.0]),
    ]
    assert (drawn.x.label, drawn.y.label) == ("time, s", "amplitude, mm")


def test_a_number_without_its_quantity_does_not_enter_a_table():
    published = dataset().assign(published=("load", [13.72, 9.1]))
    with pytest.raises(TypeError, match="published: no Quantity says the unit"):
        LabelledTable("gaps", published)
