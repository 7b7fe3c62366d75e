"""Equations of docstrings are typeset for the manual, and nothing of them is lost."""

import ast
import html
import importlib.util
import re
import sys
from collections import Counter

import pytest
from documents import CHECKOUT

PATH = CHECKOUT / "docs" / "extensions" / "equations.py"
SPEC = importlib.util.spec_from_file_location("equations", PATH)
sys.modules["equations"] = equations = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(equations)

SHOWN = [  # what pages of the theory show
    *sorted((CHECKOUT / "wm_drake" / "laws").glob("[!_]*.py")),
    CHECKOUT / "wm_drake" / "compiler" / "vectors.py",
    *(
        CHECKOUT / "wm_drake" / "engines" / "compiled" / f"{name}.py"
        for name in ("mechanics", "multistep", "stepping", "step_check", "midpoint")
    ),
]
SECTION = re.compile(r"(Args|Returns|Raises|Attributes|Example):$")
WRITTEN = {  # how the plain text has what MathML shows
    "×": "x", "⋅": "", "−": "-", "≤": "<=", "≥": ">=", "∑": "sum", "′": "'", "∂": "d", "⁡": "",
    "ε": "eps", "π": "pi", "δ": "delta", "μ": "mu", "τ": "tau", "λ": "lambda", "θ": "theta",
}  # fmt: skip


def blocks_of(path):
    """Return the indented blocks before the sections of each docstring of a file."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    nodes = [tree, *(node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef))]
    for node in nodes:
        lines = (ast.get_docstring(node) or "").splitlines()
        end = next((i for i, line in enumerate(lines) if SECTION.match(line)), len(lines))
        text = "\n".join(lines[:end])
        for block in re.findall(r"(?:^ {4}.*\n?)+", text, re.MULTILINE):
            yield pytest.param(block.splitlines(), id=f"{path.stem}.{getattr(node, 'name', '')}")


BLOCKS = [block for path in SHOWN for block in blocks_of(path)]


def letters(text):
    """Return a text without what typesetting replaces by position: brackets, slashes, spaces."""
    text = text.replace("epsilon", "eps")
    return re.sub(r"[\s()/_^*]|\s\.\s", "", text)


@pytest.mark.parametrize("block", BLOCKS)
def test_an_equation_is_typeset_and_nothing_is_lost(block):
    mathml = equations.mathml_of(block)
    assert mathml is not None
    shown = html.unescape(re.sub("<[^>]*>", "", mathml))
    for sign, written in WRITTEN.items():
        shown = shown.replace(sign, written)
    lost = Counter(letters(" ".join(block).replace(" . ", " ")))
    lost.subtract(letters(shown.replace("; ", "")))  # sources stand below, and between them "; "
    assert {sign for sign, number in lost.items() if number} <= {";"}


def test_there_are_equations():
    assert len(BLOCKS) > 30


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("until x_c.", r"until \ *x*\ :sub:`c`\ ."),
        ("F_max (1 + x)^2", r"\ *F*\ :sub:`max`\  (1 + x)\ :sup:`2`\ "),
        ("|v_0|^2", r"|\ *v*\ :sub:`0`\ |\ :sup:`2`\ "),
        ("x_c^2", r"\ *x*\ :sub:`c`\ \ :sup:`2`\ "),
        ("[N s^2/m]", r"[N s\ :sup:`2`\ /m]"),
        ("`x_c` and ``m^2``", "`x_c` and ``m^2``"),
        ("gasket.stiffness_x, p_ToA_T, a.x_c", "gasket.stiffness_x, p_ToA_T, a.x_c"),
    ],
)
def test_indices_and_powers_of_a_sentence_are_typeset(text, shown):
    assert equations.with_indices(text) == shown


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("a/b c", "<mfrac><mrow><mi>a</mi></mrow><mrow><mi>b</mi></mrow></mfrac>"),
        ("a b / (c + d)", "<mrow><mi>c</mi><mo>+</mo><mi>d</mi></mrow></mfrac>"),
        ("a b / c", "<mfrac><mrow><mi>a</mi><mspace width='0.12em'/><mi>b</mi></mrow>"),
        ("f = v_st", "<msub><mi>v</mi><mrow><mtext>st</mtext></mrow></msub>"),
        ("a x b", "<mo>×</mo>"),
        ("sum x n", "<mo>∑</mo><mi>x</mi>"),
    ],
)
def test_a_form_is_read_as_it_is_meant(text, shown):
    assert shown in equations.equations([text])


@pytest.mark.parametrize("text", ['x = wm.load("a")', "a = 1 -> b", "only words"])
def test_what_is_no_equation_stays_text(text):
    assert equations.mathml_of([f"    {text}"]) is None
