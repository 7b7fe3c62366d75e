"""Verification, validation and prediction on their page are those of the program as it is."""

import ast
import re
from dataclasses import replace

import pandas as pd
import pytest
from analysis_tools.validation_page import UNEXPLAINED
from analysis_tools.validation_rows import MISSED, amplitude_rows, amplitude_table
from documents import CHECKOUT, text_of
from ruamel.yaml import YAML

from wm_drake.simulation.cases import Case
from wm_drake.studies.spin.study import run_spin

PAGE = CHECKOUT / "docs" / "validation.md"
SECTIONS = re.split(r"^##+ ", text_of(PAGE), flags=re.MULTILINE)[1:]
GROUPS = YAML(typ="safe").load(CHECKOUT / "analyses" / "verification.yaml")
TESTS = [name for rows in GROUPS.values() for row in rows for name in row.get("tests", ())]


def test_every_row_of_the_verification_is_asserted_by_tests_that_exist():
    for name in TESTS:
        path, _, function = name.partition("::")
        tree = ast.parse((CHECKOUT / path).read_text(encoding="utf-8"))
        functions = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
        assert not function or function in functions, name
    assert all("tests" in row or "command" in row for rows in GROUPS.values() for row in rows)


def test_the_verification_has_these_rows():
    shown = text_of(PAGE)
    for heading, rows in GROUPS.items():
        assert f"### {heading}\n" in shown
        for row in rows:
            assert f"| {row['what']} | {row['against']} | {row['agreement']} |" in shown


def test_every_miss_has_its_reason_and_every_section_its_command():
    assert UNEXPLAINED not in text_of(PAGE)
    assert f"**{MISSED}**" in text_of(PAGE)
    compared = [section for section in SECTIONS if section.startswith("[")]
    assert len(compared) == 7
    for section in compared:
        assert re.search(r"^Command: `(wm-drake|python analyses/)", section, re.M), section[:40]
        assert "\nTolerance: " in section, section[:40]


@pytest.mark.slow
def test_the_amplitudes_on_the_page_are_those_of_the_machine(reference):
    """Run the fast part of analyses/write_validation.py: [B] Tables 1 to 3."""
    cases = [Case(name, load, reference.profile) for name, load in reference.loads.items()]
    both = pd.concat(
        amplitude_table(run_spin(reference, [replace(case, gasket=gasket) for case in cases]))
        for gasket in (False, True)
    )
    (section,) = (text for text in SECTIONS if text.startswith("[B] Tables 1 to 3"))
    rows = (line.strip("| ").split(" | ") for line in section.splitlines() if line[:1] == "|")
    shown = {cells[0]: cells for cells in rows}
    for row in amplitude_rows(both):
        _, published, ours, *_ = shown[row.quantity]
        if row.quantity == "mean difference":
            continue
        assert published == row.published
        assert float(ours.split()[0]) == pytest.approx(float(row.ours.split()[0]), rel=5e-3)
