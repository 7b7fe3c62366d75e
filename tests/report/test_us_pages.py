"""`--units us`: no page, picture or table of a command has a number in a unit that the US replaces."""

import html
import re

import numpy as np
import pandas as pd
import pytest
from every_page import KINDS, write_page
from pages import data_of, without_scripts

from wm_drake.parameters import load_machine, quantities, shipped_machines
from wm_drake.parameters.reading import CUSTOMARY
from wm_drake.parameters.units import Unit, registry
from wm_drake.report.quantity import Quantity
from wm_drake.simulation.measures import MEASURES

REPLACED = [Quantity("", Unit(unit, unit)) for unit in CUSTOMARY]
ANY = "|".join(sorted((re.escape(q.unit_text) for q in REPLACED), key=len, reverse=True))
NUMBER = re.compile(rf"[\d.][ \u00a0](?:{ANY})(?![\w/²³·])")
LABEL = re.compile(rf".*, (?:{ANY})")
CODE = re.compile(r"<code\b.*?</code>", re.DOTALL)
TABLE = re.compile(r"<table>.*?</table>", re.DOTALL)
LAST_CELL = re.compile(r"<td[^>]*>[^<]*</td>\s*</tr>")
SUFFIXES = tuple(q.suffix for q in REPLACED)

SAME = {"", "%", "percent", "ppm", "dimensionless", "s", "ms", "Hz", "rpm", "rpm/s", "deg", "rad"}
SAME |= {"deg/s", "rad/s", "rad/s^2", "W", "1/s"}
"""Display units that are the same in the US."""

WORDS_OF_FILES = (
    "Laundry of 200 to 600 g", "0.1 to 2 kg in one lump", "--clearance '10 mm'", "320 mm at the housing", "wall of 2.5 mm"
)  # fmt: skip
"""Words of shipped files, and an example of an option."""

SOON = ("identify_static", "rig_gasket")
"""Kinds of pages that take a few seconds."""

MOST_VARIED = ("spin", "gasket", "calibration", "compare")
"""Kinds of pages that have most of the quantities; the others differ in few."""


def _marks(kind):
    """Return the marks of a kind of pages. CI tries the pages with most quantities."""
    if kind in SOON:
        return []
    return [pytest.mark.slow if kind in MOST_VARIED else pytest.mark.hours]


KINDS_ = [
    pytest.param(name, marks=_marks(name))
    for name in KINDS
    if name != "machine"  # it shows a file
]


def test_each_display_unit_is_replaced_or_the_same():
    machines = map(load_machine, shipped_machines())
    units = {unit.shown for machine in machines for _, _, unit in quantities(machine)}
    units |= {v.unit.shown for measure in MEASURES.values() for v in measure.variables}
    assert units - CUSTOMARY.keys() <= SAME


@pytest.mark.parametrize("name", KINDS_)
def test_a_page_has_numbers_in_us_units_only(name, tmp_path):
    page = write_page(name, tmp_path, "--units", "us").read_text(encoding="utf-8")
    shown = TABLE.sub(_without_source, CODE.sub("", without_scripts(page)))
    text = html.unescape(re.sub(r"<[^>]+>", " ", shown))
    for words in WORDS_OF_FILES:
        text = text.replace(words, "")
    assert [text[max(0, m.start() - 40) : m.end()] for m in NUMBER.finditer(text)] == []
    labels = [label for data in data_of(page) for label in _texts(data)]
    assert [label for label in labels if LABEL.fullmatch(label)] == []
    for path in (tmp_path / "out").glob("*.csv"):
        columns = pd.read_csv(path, nrows=1).columns
        assert [name for name in columns if name.endswith(SUFFIXES)] == [], path.name


FACTORS = {unit: registry().Quantity(1.0, us).to(unit).magnitude for unit, us in CUSTOMARY.items()}
ENDS = {Quantity("", Unit(u, u)).suffix: (Quantity("", Unit(v, v)).suffix, FACTORS[u])
        for u, v in CUSTOMARY.items()}  # fmt: skip
OF_ROWS = {q.reading.label: FACTORS[q.unit.si] for q in REPLACED}
VALUED = [pytest.param(p.values[0], marks=p.marks) for p in KINDS_ if "spin" not in p.values[0]]


@pytest.mark.parametrize("name", VALUED)
def test_numbers_of_files_are_those_in_si(name, tmp_path):
    for units in ("si", "us"):
        (tmp_path / units).mkdir()
        write_page(name, tmp_path / units, "--units", units)
    paths = [path for path in (tmp_path / "si/out").glob("*.csv") if "loop_" not in path.name]
    assert paths
    for path in paths:
        si, us = pd.read_csv(path), pd.read_csv(tmp_path / "us/out" / path.name)
        of_rows = si["unit"].map(OF_ROWS).fillna(1.0).to_numpy() if "unit" in si else 1.0
        for column in si.select_dtypes("number").columns.drop("wall_s", errors="ignore"):
            end = max((e for e in ENDS if column.endswith(e)), key=len, default="")
            end_us, factor = ENDS.get(end, ("", 1.0))
            one, other = si[column], us[column.removesuffix(end) + end_us]
            is_same = [np.allclose(one, f * other, 1e-6, 1e-12, equal_nan=True)
                       for f in ((factor,) if end else (1.0, of_rows))]  # fmt: skip
            assert any(is_same), f"{path.name}: {column}"


def _without_source(table):
    """Return a table without its last column if that has sources: words of a machine file."""
    is_source = re.search(r">source</th>\s*</tr>", table.group())
    return LAST_CELL.sub("</tr>", table.group()) if is_source else table.group()


def _texts(data):
    """Yield all texts in JSON data."""
    if isinstance(data, str):
        yield data
    elif isinstance(data, (list, dict)):
        for one in data.values() if isinstance(data, dict) else data:
            yield from _texts(one)
