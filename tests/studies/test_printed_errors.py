"""Errors that [A] prints stand beside our loops of its test matrices."""

import pytest

import wm_drake as wm
from wm_drake.rigs import MATRICES, bushing_bench, damper_bench
from wm_drake.studies.rig.study import VERDICTS, printed_errors, printed_table

MACHINE = wm.load_machine("free_stroke")


def bench(kind, axis):
    if kind == "damper":
        return damper_bench(MACHINE.damper_types["free_stroke"])
    bushing = MACHINE.gasket if kind == "gasket" else MACHINE.bushing_types["connecting"]
    return bushing_bench(bushing, axis, 0.1 if axis.startswith("about") else 0.0)


@pytest.mark.parametrize(
    ("kind", "axis", "matrix", "first", "last"),
    [
        ("damper", "", "damper", 0.0298, 0.0622),
        ("bushing", "x", "bushing", 0.1172, 0.1267),
        ("bushing", "z", "bushing", 0.1172, 0.1267),
        ("bushing", "y", "bushing", 0.2124, 0.2084),
        ("bushing", "about_x", "bushing about", 0.0124, 0.0252),
        ("gasket", "x", "gasket", 0.0172, 0.0135),
        ("gasket", "y", "gasket", 0.0752, 0.0946),
    ],
)
def test_each_test_of_a_matrix_has_its_error(kind, axis, matrix, first, last):
    errors = printed_errors(kind, bench(kind, axis), MATRICES[matrix]["A"])
    assert (errors[0], errors[-1]) == (first, last)


def test_table_has_all_tests_of_the_matrices_and_no_other():
    tests = printed_table().groupby(["component", "axis"]).size().to_dict()
    assert set(tests) == set(VERDICTS)
    for (kind, axis), count in tests.items():
        matrix = "bushing about" if axis == "rotational" else kind
        assert count == len(MATRICES[matrix]["A"])


def test_page_and_json_have_the_errors(wm_drake, tmp_path):
    options = ("--machine", "free_stroke", "--axis", "y", "--out", str(tmp_path / "out"))
    ended = wm_drake("rig", "gasket", *options, "--matrix", "A")
    assert "RMSE in [A]" in ended.out
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "above 10 % of the largest force, 0.8 in its unit" in page
    plain = wm_drake("rig", "gasket", *options, "--overwrite", "-f", "1 Hz", "-a", "1 mm")
    assert "RMSE in [A]" not in plain.out
