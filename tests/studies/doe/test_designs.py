"""Designs: efficiency by an independent library and by brute force, optimality, strength, files."""

import io
import itertools
import sys
import time

import numpy as np
import oapackage
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wm_drake.errors import InputError, InputNotice
from wm_drake.studies.doe.coding import efficiency, level_matrix
from wm_drake.studies.doe.design import make_design, read_design, read_levels
from wm_drake.studies.doe.exchange import d_optimal_levels
from wm_drake.studies.doe.orthogonal import orthogonal_levels

NAMES = ("C_L", "C_T", "K_Lx", "K_Ly", "K_Lz", "K_Tx", "K_Ty", "K_Tz")


@pytest.fixture(scope="module")
def d_optimal():
    begin = time.perf_counter()
    design = make_design("d-optimal", NAMES)
    return design, time.perf_counter() - begin


def test_thousand_trials_are_efficient_different_and_quickly_found(d_optimal):
    design, wall_s = d_optimal
    assert design.trials == 1000
    assert design.efficiency() >= 99.6
    assert len(np.unique(design.levels, axis=0)) == 1000
    assert set(np.unique(design.levels)) == {-1, 0, 1}
    assert wall_s < 20.0  # about 2 s on an idle computer


def test_design_for_main_effects_is_nearly_perfect():
    design = make_design("d-optimal", NAMES, model="main")
    assert design.efficiency() > 99.99


def test_design_depends_on_the_seed_only():
    first, again, other = (d_optimal_levels(5, 80, "main+2fi", seed) for seed in (0, 0, 1))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_a_design_is_searched_for_once(monkeypatch):
    first = d_optimal_levels(4, 70, "main+2fi", 3)
    monkeypatch.setattr("wm_drake.studies.doe.exchange._exchanged", None)
    np.testing.assert_array_equal(d_optimal_levels(4, 70, "main+2fi", 3), first)


def oapackage_array(levels):
    return oapackage.array_link(np.ascontiguousarray(levels + 1, dtype=np.int32))


@pytest.mark.parametrize("factors", [5, 6, 7, 8])
@pytest.mark.parametrize(("trials", "least"), [(243, 4), (729, 5)])
def test_arrays_have_their_strength_by_oapackage(trials, least, factors):
    levels = orthogonal_levels(factors, trials)
    assert len(np.unique(levels, axis=0)) == len(levels) == min(trials, 3**factors)
    assert oapackage_array(levels).strength() >= least
    assert efficiency(levels, "main+2fi") == pytest.approx(100.0, abs=1e-9)


@pytest.mark.parametrize(("model", "columns"), [("main", 17), ("main+2fi", 129)])
def test_efficiency_by_oapackage(d_optimal, model, columns):
    """Compare with the model matrices of oapackage.

    oapackage scales each column over the given array; here all have the scale of a balanced one.
    Only its matrix with interactions is used, which begins with the main effects: its matrix of
    main effects alone (mode m) is sometimes wrong.
    """

    def matrix(levels):
        array = oapackage_array(levels)
        return np.array(oapackage.array2modelmatrix(array, "i"))[:, :columns]

    balanced = np.abs(matrix(orthogonal_levels(8, 243))).max(axis=0)
    for levels in (d_optimal[0].levels, orthogonal_levels(8, 729)):
        x = matrix(levels)
        x *= balanced / np.abs(x).max(axis=0)
        expected = 100.0 * np.exp(np.linalg.slogdet(x.T @ x / len(x))[1] / x.shape[1])
        assert efficiency(levels, model) == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize("factors", [4, 8])
def test_array_of_27_trials_has_the_mean_of_the_full_factorial_for_interactions_of_two(factors):
    rng = np.random.default_rng(3)
    linear, pairs = rng.normal(size=factors), rng.normal(size=(factors, factors))

    def mean(levels):
        x = levels.astype(float)
        return np.mean(x @ linear + np.einsum("ij,ni,nj->n", pairs, x, x), axis=0)

    small, full = orthogonal_levels(factors, 27), level_matrix(factors)
    assert len(small) == 27
    assert oapackage_array(small).strength() == 2
    assert mean(small) == pytest.approx(mean(full), abs=1e-12)


def test_small_design_is_the_best_of_all():
    # all 84 of them
    best = max(
        efficiency(level_matrix(2)[list(rows)], "main")
        for rows in itertools.combinations(range(9), 6)
    )
    found = max(efficiency(d_optimal_levels(2, 6, "main", seed), "main") for seed in range(5))
    assert found == pytest.approx(best)


@given(st.integers(0, 2**32 - 1))
def test_no_design_exceeds_the_bound(seed):
    rng = np.random.default_rng(seed)
    levels = rng.integers(-1, 2, size=(rng.integers(1, 120), 4)).astype(np.int8)
    assert 0.0 <= efficiency(levels, "main+2fi") <= 100.0 + 1e-9


def test_few_trials_and_large_grids():
    # as many trials as coefficients
    assert make_design("d-optimal", NAMES[:4], trials=33).efficiency() > 0.0
    assert make_design("d-optimal", NAMES[:3], trials=27).efficiency() == pytest.approx(100.0)
    ten = make_design("d-optimal", tuple("abcdefghij"), trials=100, model="main")
    assert ten.efficiency() > 95.0
    assert len(np.unique(ten.levels, axis=0)) == 100


FAULTS = {
    "kind": ({"kind": "d-optmal"}, "no design 'd-optmal' (did you mean 'd-optimal'?"),
    "model": ({"kind": "full", "model": "quadratic"}, "no model 'quadratic'"),
    "too few": ({"kind": "d-optimal", "trials": 100}, "100 trials cannot determine the 129 coefficients"),
    "too many": ({"kind": "d-optimal", "trials": 6562}, "6561 different trials"),
    "full of another size": ({"kind": "full", "trials": 1000}, "has 6561 trials, not 1000"),
    "no such array": ({"kind": "orthogonal", "trials": 1000}, "orthogonal designs have 27, 243 or 729"),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_impossible_designs_are_refused(fault):
    options, message = FAULTS[fault]
    with pytest.raises(InputError) as caught:
        make_design(factors=NAMES, **options)
    assert message in str(caught.value)


def test_nine_factors_have_no_array():
    with pytest.raises(InputError, match="at most 8"):
        make_design("orthogonal", tuple("abcdefghi"))


def test_written_design_is_read_back(tmp_path):
    design = make_design("d-optimal", NAMES, trials=150, seed=3)
    table = pd.DataFrame(design.levels, columns=list(design.factors))
    table.to_csv(tmp_path / "design.csv", index_label="trial")
    read = read_design(tmp_path / "design.csv", NAMES)
    np.testing.assert_array_equal(read.levels, design.levels)
    table = pd.read_csv(tmp_path / "design.csv")
    assert list(table.columns) == ["trial", *NAMES]
    table[[*reversed(NAMES)]].to_csv(tmp_path / "other.csv", index=False)
    np.testing.assert_array_equal(read_design(tmp_path / "other.csv", NAMES).levels, design.levels)


ROWS = [(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1)]
PLAIN = "".join(f"{a},{b}\n" for a, b in ("ab", *ROWS))
SIGNS, LEVEL_WORDS = ("-", "0", "+"), ("Low", "mid", "high")
MINITAB = "StdOrder,RunOrder,PtType,Blocks, A ,B\n" + "".join(
    f"{n},{10 - n},1,1,{a},{b}\n" for n, (a, b) in enumerate([*ROWS, (0, 0)], 1)
)
JMP = "Pattern\ta\tb\tY\n" + "".join(
    f"{SIGNS[a + 1]}{SIGNS[b + 1]}\t{a}\t{b}\t.\n" for a, b in ROWS
).replace("\t-1", "\t\N{MINUS SIGN}1")
OF_PROGRAMS = {
    "Excel": PLAIN.replace(",", ";").replace("-1", "-1,0").encode("utf-8-sig"),
    "Excel, sep": ("sep=;\n" + PLAIN.replace(",", ";")).replace("\n", "\r\n").encode(),
    "Excel, empty rows": (PLAIN + ",\r\n,\r\n").encode(),
    "Excel, Unicode": PLAIN.replace(",", "\t").encode("utf-16"),
    "Minitab": MINITAB.encode(),
    "JMP": JMP.encode(),
    "R": "".join(f'"{n or ""}",{a},{b}\n' for n, (a, b) in enumerate([("a", "b"), *ROWS])).encode(),
    "remarks": ('"# by A, today",\n' + PLAIN.replace("-", "\N{EN DASH}")).encode("utf-16"),
    "words": "".join(
        ["a,b\n", *(f"{LEVEL_WORDS[a + 1]},{LEVEL_WORDS[b + 1]}\n" for a, b in ROWS)]
    ).encode(),
}


@pytest.mark.parametrize("program", [*OF_PROGRAMS, "workbook"])
@pytest.mark.filterwarnings("ignore::wm_drake.errors.InputNotice")
def test_tables_of_programs_are_read(tmp_path, program):
    path = tmp_path / "design.csv"
    if program == "workbook":
        pytest.importorskip("openpyxl")
        path = tmp_path / "design.xlsx"
        pd.read_csv(io.BytesIO(OF_PROGRAMS["Minitab"])).to_excel(path, index=False)
    else:
        path.write_bytes(OF_PROGRAMS[program])
    levels = read_design(path, ("a", "b"), "main").levels
    assert list(map(tuple, levels.tolist())) == ROWS


def value_in_mm(_, text):
    return float(text.removesuffix(" mm"))


def test_a_decimal_comma_is_one_unless_it_may_separate_thousands(tmp_path):
    path = tmp_path / "design.csv"
    path.write_text("a [mm];b\n0,500;-1\n1,250;1\n")
    assert read_levels(path, ("a", "b"), value_in_mm).tolist() == [[0.5, -1.0], [1.25, 1.0]]
    path.write_text("a [mm];b\n1,500;-1\n1,250;1\n")
    with pytest.raises(ValueError, match="1,500"):
        read_levels(path, ("a", "b"), value_in_mm)


def test_numbers_that_are_neither_levels_nor_have_a_unit_are_refused(tmp_path):
    path = tmp_path / "design.csv"
    for numbers in ("1,2,3", "0,1,2", "0.2,0.3,0.4"):
        path.write_text("\n".join(["a", *numbers.split(",")]))
        with pytest.raises(InputError, match=r"a: has numbers from .* need a unit"):
            read_levels(path, ("a",), value_in_mm)


def test_the_first_sheet_with_cells_is_read_and_named(tmp_path):
    pytest.importorskip("openpyxl")
    path = tmp_path / "design.xlsx"
    with pd.ExcelWriter(path) as book:
        pd.DataFrame().to_excel(book, sheet_name="empty", index=False)
        pd.DataFrame(ROWS, columns=["a", "b"]).to_excel(book, sheet_name="design", startrow=2)
        pd.DataFrame({"who": ["A"]}).to_excel(book, sheet_name="notes")
    with pytest.warns(InputNotice, match="sheet 'design' is read, not 'notes'; move another"):
        levels = read_design(path, ("a", "b"), "main").levels
    assert list(map(tuple, levels.tolist())) == ROWS


def test_a_workbook_has_a_way_out(tmp_path, monkeypatch):
    (tmp_path / "design.xlsx").write_bytes(b"PK")
    for missing, words in {
        False: "is no workbook",
        True: "pip install 'wm-drake\\[excel\\]'",
    }.items():
        if missing:
            monkeypatch.setitem(sys.modules, "openpyxl", None)
        with pytest.raises(InputError, match=f"{words}.*save the sheet as CSV"):
            read_design(tmp_path / "design.xlsx", ("a", "b"), "main")


FAULTY_FILES = {
    "other columns": ("a,c\n0,0\n", "needs the columns a,b"),
    "level": ("a,b\n0,0\n1,2\n", "csv:3: b: '2' is not a level"),
    "word": ("a,b\n0,lov\n", "csv:2: b: 'lov' is not a level"),
    "a response": ("a,b,Dx\n0,0,3.1\n", "remove Dx"),
    "a factor twice": ("a,b,B\n0,0,0\n", "needs the columns a,b"),
    "cells beyond the head": ("a,b\n-1,0,1,0\n", "csv:2: has 4 values but the header has 2"),
    "title": ("Design of A\na,b\n0,0\n", "begin remarks above it with #"),
    "unknown unit": ("a [xyz],b\n0,0\n", "'a [xyz]' has no known unit"),
    "renamed workbook": ("PK\x03\x04\0", "save the sheet as CSV"),
    "nothing": ("a,b\n", "do not determine the 5 coefficients"),
    "too few": ("a,b\n0,0\n1,1\n-1,-1\n", "these 3 trials do not determine the 5 coefficients"),
    "one level missing": ("a,b\n0,0\n1,0\n0,1\n1,1\n0,-1\n1,-1\n", "do not determine"),
    "no text": ("\x00\x01", "design.csv"),
}


@pytest.mark.parametrize("fault", FAULTY_FILES)
def test_faulty_files_are_refused(tmp_path, fault):
    text, message = FAULTY_FILES[fault]
    (tmp_path / "design.csv").write_text(text)
    with pytest.raises(InputError) as caught:
        read_design(tmp_path / "design.csv", ("a", "b"), "main")
    assert message in str(caught.value)
    assert "design.csv" in str(caught.value)
