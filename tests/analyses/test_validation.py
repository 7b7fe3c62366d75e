"""Verdicts of the validation page on numbers of known answer."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from analysis_tools.validation_page import (
    BEGIN,
    END,
    UNEXPLAINED,
    compared,
    origin,
    renewed,
    verified,
)
from analysis_tools.validation_rows import (
    FITTED,
    MET,
    MISSED,
    OPEN,
    PREDICTED,
    amplitude_rows,
    coulomb_rows,
    counts,
    effect_rows,
    held_out_table_rows,
    mean_rows,
    spin_cycle_rows,
)

from wm_drake.parameters import PublishedTerm
from wm_drake.parameters.units import Unit
from wm_drake.report.quantity import Quantity
from wm_drake.studies.doe.design import make_design
from wm_drake.studies.gasket.screening import run_screening, runs_of


@pytest.fixture
def amplitude_table():
    columns = ["load", "gasket", "source", "Xr", "Yr"]
    return pd.DataFrame(
        [
            ("middle", "yes", "experiment", 10.0, 20.0),
            ("middle", "yes", "Adams model of [B]", 11.0, 18.0),
            ("middle", "yes", "wm_drake", 11.9, 25.0),
            ("back", "yes", "wm_drake", 1.0, 1.0),  # nothing was measured
        ],
        columns=columns,
    )


def test_amplitudes_are_judged_by_their_difference(amplitude_table):
    first, second, mean = amplitude_rows(amplitude_table)
    assert (first.published, first.ours, first.difference) == ("10 mm", "11.9 mm", "+19.0 %")
    assert (first.verdict, second.verdict) == (MET, MISSED)
    assert second.reason == "above 20 %; Adams model of [B]: −10.0 %"
    assert (mean.published, mean.ours, mean.verdict) == ("10.0 %", "22.0 %", MISSED)
    assert {row.kind for row in (first, second, mean)} == {FITTED}


def test_effects_are_judged_by_their_sign():
    nan = np.nan
    change = [0.2, 0.05, -0.04, 0.15, 0.09, 0.01, -0.11, 0.9, nan, 0.02]
    published = [0.5, -0.2, 0.03, 0.03, nan, *[nan] * 5]
    reference = [*[1.0] * 5, 5.0, 1.0, 0.4, nan, 3.0]  # the third steady one is too small to count
    dims, first = ("row", "variant"), np.full(10, nan)
    table = xr.Dataset(
        {
            "value": (dims, np.column_stack([reference, first])),
            "change": (dims, np.column_stack([first, change])),
            "measured_change": (dims, np.column_stack([first, published])),
        },
        {
            "load": ("row", ["middle"] * 10),
            "measure": ("row", ["amplitude"] * 5 + ["steady amplitude at 400 rpm"] * 5),
            "of": ("row", list("abcde") * 2),
        },
    )
    *effects, steady = effect_rows(table)
    assert [row.verdict for row in effects] == [MET, MISSED, MET, MISSED]
    assert (steady.ours, steady.verdict) == ("up to 11.0 %", MISSED)
    assert steady.reason == "limit 10 %; worst: middle, b"
    assert (effects[0].kind, steady.kind) == (FITTED, PREDICTED)


def test_means_are_those_of_the_screening():
    design = make_design("full", ("C_L", "C_T"))
    length = Quantity("displacement", Unit("m", "mm"))
    one = {"Dx": 0.013 + 1e-3 * design.levels[:, 0], "Dy": 5e-3 + 1e-3 * design.levels[:, 1]}
    quantities = dict.fromkeys(one, length)
    screening = run_screening(design, lambda _: runs_of({"middle": one}, quantities))
    known = {
        ("middle", "Dx"): {"constant": PublishedTerm(None, (10.0,))},
        ("middle", "Dy"): {"constant": PublishedTerm(None, (2.0,))},
        ("middle", "Fx"): {"constant": PublishedTerm(None, (2.0,))},
    }
    dx, dy, mean = mean_rows(screening, known)
    assert (dx.difference, dx.verdict) == ("+30.0 %", MET)
    assert (dy.difference, dy.verdict) == ("+150.0 %", MISSED)
    assert (mean.ours, mean.reason) == ("90.0 %", "1 of 2 within 30 %; largest 150 %")


def test_spin_cycle_is_judged_by_what_the_paper_says():
    regions = [f"R{number}" for number in range(1, 9)]
    size = xr.DataArray(
        np.full((3, 8, 3, 3), 0.1),
        {
            "case": ["2", "5", "29"],
            "region": regions,
            "accelerometer": list("abc"),
            "axis": list("xyz"),
        },
        ["case", "region", "accelerometer", "axis"],
    )
    size.loc["2", "R7", "a", "y"] = 1.0
    size.loc["2", "R5", :, "z"] = 1.0
    size.loc["5", "R3", "b", "y"] = 1.0
    size.loc["5", "R2", "b", "y"] = 0.8
    size.loc["29", "R1", "c", "z"] = 0.4
    y, z, rear, less_than_front, less_than_rear, errors = spin_cycle_rows(size)
    assert [row.verdict for row in (y, z, rear, less_than_front)] == [MET, MET, MISSED, MET]
    assert (less_than_rear.verdict, errors.verdict) == (MISSED, OPEN)
    assert (rear.published, rear.ours) == ("R2", "R3")
    assert rear.reason == "R2 has 80 % of the vibration in R3"
    assert less_than_front.ours == "a 0.10, b 0.10, c 0.40"
    assert less_than_rear.ours == "a 1.00, b 1.00, c 4.00"


def test_coulomb_fits_are_judged_by_difference_and_ratio():
    fits = pd.DataFrame(
        {
            "frequency_hz": [1.0, 10.0],
            "amplitude_mm": [0.3, 1.0],
            "k1": [100.0, 100.0],
            "c1": [10.0, 1.0],
            "k1 fitted": [115.0, 130.0],
            "c1 fitted": [4.0, 1.9],
        }
    )
    assert [row.verdict for row in coulomb_rows(fits)] == [MET, MISSED, MISSED, MET]


def test_held_out_tables_of_b_are_judged_by_leading_factors_points_and_intervals():
    numbers = {"calibrated_mean_percent": 5.0, "predicted_largest_percent": 40.0}
    kinds = pd.DataFrame(
        [
            numbers | {"held_out": "counter", "what": "contributions", "values": 13,
                       "predicted_mean_percent": 11.9, "in_intervals_percent": 80.0},
            numbers | {"held_out": "back front", "what": "amplitudes", "values": 12,
                       "predicted_mean_percent": 12.1, "in_intervals_percent": 91.0},
        ]
    )  # fmt: skip
    studies = pd.DataFrame(
        {
            "held_out": ["counter", "counter"],
            "fit": ["calibrated", "predicted"],
            "responses": [9, 9],
            "same_leading_factor": [9, 7],
        }
    )
    table = {row.quantity: row for row in held_out_table_rows(kinds, studies)}
    assert {name: row.verdict for name, row in table.items()} == {
        "counter: leading factors": MISSED,
        "counter: mean difference of 13 contributions": MET,
        "counter: in the 95 % intervals: 13 contributions": OPEN,
        "back and front: mean difference of 12 amplitudes": MISSED,
        "back and front: in the 95 % intervals: 12 amplitudes": MET,
    }
    assert table["counter: leading factors"].ours == "7 of 9"
    assert table["counter: mean difference of 13 contributions"].ours == "11.9 points"


def test_part_counts_and_explains(amplitude_table):
    rows = amplitude_rows(amplitude_table)
    assert counts(rows).iloc[0].tolist() == [1, 2, 0]
    section = rows[0].section
    reasons = {section: "About all.", f"{section} | {rows[1].quantity}": "the spring is soft"}
    reasons[f"{section} | command"] = "wm-drake spin; wm-drake spin --no-gasket"
    text = compared(rows, FITTED, reasons)
    assert "Of 3 fitted results, 2 are missed." in text
    assert f"### {section}\n\nAbout all.\n" in text
    assert "Command: `wm-drake spin`; `wm-drake spin --no-gasket`." in text
    assert "| **missed** | above 20 %; Adams model of [B]: −10.0 %; the spring is soft |" in text
    assert f"; {UNEXPLAINED} |" in text  # the mean, which has no explanation
    assert compared(rows, PREDICTED, reasons).endswith("Nothing was compared.\n")


def test_page_is_renewed_between_its_marks_and_says_how():
    text = origin("python write.py", ["A note."])
    page = renewed(f"before\n{BEGIN}old\n{END}\nafter\n", text)
    assert page == f"before\n{BEGIN}{text}{END}\nafter\n"
    assert "python write.py" in text
    assert "Written 20" in text
    assert "- A note." in text


def test_verification_has_a_row_per_comparison():
    rows = [
        {"what": "a law", "against": "hand values", "agreement": "1e-9", "tests": ["a.py", "b.py"]},
        {"what": "a run", "against": "MuJoCo", "agreement": "1 %", "command": "python c.py"},
    ]
    text = verified({"Laws": rows}, {})
    assert "| a law | hand values | 1e-9 | `a.py`<br>`b.py` |" in text
    assert "| a run | MuJoCo | 1 % | `python c.py` |" in text
    for outcomes, words in (
        ({"a.py": (2, 0), "b.py": (3, 0)}, "5 passed"),
        ({"a.py": (2, 0), "b.py": (3, 1)}, "**1 of 5 failed**"),
        ({"a.py": (2, 0)}, "not run: marked `hours`, or skipped"),
    ):
        ran = verified({"Laws": rows}, outcomes)
        assert f"| `a.py`<br>`b.py` | {words} |" in ran
        assert "| `python c.py` |  |" in ran
