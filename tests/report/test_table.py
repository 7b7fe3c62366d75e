"""Tests of tables: one declaration gives the page and the terminal."""

import io

import numpy as np
import pandas as pd
import pytest
from rich.console import Console

from wm_drake.report.table import Column, Group, Row, Table, line, table_of


@pytest.fixture
def table():
    columns = ("load", "sensor", Column("largest", "mm", 1), Column("share"), Column("ends"))
    return Table(
        "Sizes.",
        columns,
        (
            Group("middle", (Row(("Xr", -1.25, 0.123456, True)), Row(("Yr", np.nan, None, False)))),
            line("back", ["Xr", 2.0, 12345.6, "none"], "alarm"),
        ),
        text_columns=2,
    )


def test_values_are_texts_on_a_page(table):
    assert table.header == ("load", "sensor", "largest, mm", "share", "ends")
    rows = [row.cells for group in table.shown for row in group.rows]
    assert rows == [
        ("Xr", "−1.2", "0.1235", "yes"),
        ("Yr", "–", "–", "no"),
        ("Xr", "2.0", "12350", "none"),
    ]
    assert table.shown[1].rows[0].kind == "alarm"


def test_terminal_has_every_cell(table):
    console = Console(file=io.StringIO(), width=100)
    console.print(table.terminal("Title"))
    text = console.file.getvalue()
    cells = [cell for g in table.shown for r in g.rows for cell in (g.heading, *r.cells)]
    assert all(cell in text for cell in ("Title", *table.header, *cells))


def test_frame_becomes_a_table_with_words_at_the_left():
    frame = pd.DataFrame({"load": ["a", "b"], "gasket": ["yes", "no"], "Xr": [1.04, np.nan]})
    made = table_of(frame, columns={"Xr": Column("Xr", "mm", 1)})
    assert made.text_columns == 2
    assert [row.cells for g in made.shown for row in g.rows] == [("yes", "1.0"), ("no", "–")]


def test_number_in_the_first_column_stays_a_number():
    made = table_of(pd.DataFrame({"mass": [0.25], "Xr": [1.0]}))
    assert made.shown[0].heading == "0.25"


def test_row_of_another_length_is_refused(table):
    short = Table("", table.columns, (line("middle", ["Xr", 1.0]),))
    with pytest.raises(ValueError, match="argument"):
        assert short.shown


def test_neighbours_with_the_same_first_cell_become_one_group():
    frame = pd.DataFrame({"load": ["a", "a", "b"], "Xr": [1.0, 2.0, 3.0]})
    made = table_of(frame, columns={"Xr": Column("Xr", form="{:.0f} mm".format)}, grouped=True)
    shown = [(g.heading, [row.cells for row in g.rows]) for g in made.shown]
    assert shown == [("a", [("1 mm",), ("2 mm",)]), ("b", [("3 mm",)])]
