"""Words and sizes that the source of wm_drake keeps to.

`FUNCTIONS_LEFT` is what older code has still. It only becomes smaller.
"""

import ast
import re
from pathlib import Path

import pytest

import wm_drake

ROOT = Path(wm_drake.__file__).parent
EMPTY_WORDS = {"told", "found", "own", "wanted", "beside", "alone", "nothing"}
"""Words that do not say what a name holds."""

MOST_ARGUMENTS = 5
FORMULAS = (
    "laws/", "elements/", "engines/compiled/", "export/page_", "solid/",
    "rigs/heavy_sponge.py",
)  # fmt: skip
"""Files whose functions may have many arguments.

laws/, rigs/heavy_sponge.py: physical formulas, each quantity an argument with its unit.
elements/, engines/compiled/, export/, solid/: compiled functions on flat arrays. An object would be packed and
unpacked at each call from Python, and each of its types compiles another form.
"""

FUNCTIONS_LEFT = 26


def sources():
    """Yield path and syntax tree of each module."""
    for path in sorted(ROOT.rglob("*.py")):
        yield path.relative_to(ROOT).as_posix(), ast.parse(path.read_text())


def names_in(tree):
    """Yield line and name of each function, class, argument, variable and attribute."""
    for node in ast.walk(tree):
        match node:
            case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef():
                yield node.lineno, node.name
            case ast.arg():
                yield node.lineno, node.arg
            case ast.Name(ctx=ast.Store()):
                yield node.lineno, node.id
            case ast.Attribute(ctx=ast.Store()):
                yield node.lineno, node.attr


def words_of(name):
    """Return the words of a name in snake_case, CamelCase or capitals."""
    return set(re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name))


def arguments_of(function):
    """Return the names of all arguments of a function but `self`."""
    arguments = function.args
    names = [each.arg for each in arguments.posonlyargs + arguments.args + arguments.kwonlyargs]
    return [name for name in names if name not in ("self", "cls")]


def test_words_of_a_name_are_those_that_a_reader_sees():
    assert words_of("_own_outputs") == {"own", "outputs"}
    assert words_of("BesideOthers") == {"Beside", "Others"}
    assert words_of("OWN_OUTPUTS2") == {"OWN", "OUTPUTS"}


def test_names_say_what_they_hold():
    empty = [
        f"{file}:{line}: {name}"
        for file, tree in sources()
        for line, name in names_in(tree)
        if EMPTY_WORDS & {word.lower() for word in words_of(name)}
    ]
    assert not empty, "\n".join(empty)


def conditions_as_factors(tree):
    """Yield the line of each product with a condition, as in `"alarm" * is_late`.

    Arrays of conditions are masks, so a comparison is a condition only beside a text.
    """
    for node in ast.walk(tree):
        if not (isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult)):
            continue
        for text, factor in ((node.left, node.right), (node.right, node.left)):
            is_text = isinstance(text, ast.JoinedStr) or isinstance(getattr(text, "value", 0), str)
            match factor:
                case ast.UnaryOp(op=ast.Not()) | ast.Call(func=ast.Name("bool")):
                    yield node.lineno
                case ast.Compare() | ast.BoolOp() if is_text:
                    yield node.lineno
                case ast.Name(name) | ast.Attribute(attr=name) if is_text:
                    if name.startswith(("is_", "has_")):
                        yield node.lineno


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ("'ours' * is_nearest", 1),
        ("'s' * (count > 1)", 1),
        ("text * bool(pictures)", 1),
        ("(not pictures) * text", 1),
        ("'*' * len(labels)", 0),
        ("values * (values > 0)", 0),
    ],
)
def test_a_planted_product_with_a_condition_is_found(source, found):
    assert len([*conditions_as_factors(ast.parse(source))]) == found


def test_a_condition_is_no_factor():
    assert [(file, line) for file, tree in sources() for line in conditions_as_factors(tree)] == []


SHARED_NAMES = {
    *("Accelerometer", "Bushing", "Damper", "Sensor", "Spring", "TelescopicDamper"),
}
"""Public names with two homes: parts of a machine file, and the same parts in the description that
`machine show --json` prints, whose schema has these names."""


def homes():
    """Return the modules in which each public class or alias is defined, by its name."""
    places = {}
    for file, tree in sources():
        for node in tree.body:
            match node:
                case ast.ClassDef(name):
                    places.setdefault(name, []).append(file)
                case ast.AnnAssign(ast.Name(name), ast.Name("TypeAlias")):
                    places.setdefault(name, []).append(file)
    return {name: files for name, files in places.items() if not name.startswith("_")}


def test_a_class_or_alias_has_one_home():
    several = {name: files for name, files in homes().items() if len(files) > 1}
    assert {name: files for name, files in several.items() if name not in SHARED_NAMES} == {}
    assert set(several) >= SHARED_NAMES


def test_functions_have_few_arguments():
    many = [
        f"{file}:{node.lineno}: {node.name} has {len(arguments_of(node))} arguments"
        for file, tree in sources()
        if not file.startswith(FORMULAS)
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) and len(arguments_of(node)) > MOST_ARGUMENTS
    ]
    assert len(many) <= FUNCTIONS_LEFT, "\n".join(many)


def test_one_module_imports_private_parts_of_numba():
    private = [
        file
        for file, tree in sources()
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("numba.core")
    ]
    assert set(private) == {"compiler/numba_internals.py"}
