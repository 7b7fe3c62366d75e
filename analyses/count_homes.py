"""How many homes do quantities, results and tables have in the package, and how large is it?

Lines that multiply by a unit factor include those with a plain 30, 60, 100 or 1000.
"""

import argparse
import ast
import re
import shutil
import subprocess
import tempfile
from collections import Counter
from collections.abc import Iterable, Mapping
from itertools import repeat
from pathlib import Path

ROOT = Path(__file__).parents[1]
UNIT = re.compile(r"_(mm|rpm|Hz|hz|deg|percent|kg|gm|k?N|k?Nm|Nmm|mJ|MPa|ms|g|m|s|\w*N\w*_per_m*)$")
FACTORS = {"MM_PER_M", "GM_PER_KGM", "MPA_PER_PA", "MS_PER_S", "RPM_PER_RAD_S"}
FACTORS |= {f(n) for n in (1e3, 1e-3, 1e6, 1e-6, 100.0, 60.0, 30.0) for f in (str, "{:g}".format)}
METHODS = (".attrs.get", ".attrs.update", ".attrs.pop")
OTHER_MARKS = {"Area", "Bars", "Cells", "Span", "Text", "band", "boxes", "segments"}
Code = Mapping[str, list[ast.AST]]  # nodes of the syntax of each module, by its name


def main() -> None:
    """Print the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="no difference: it takes seconds")
    parser.add_argument("--revision", help="count this revision of git in place of the files here")
    parser.add_argument("--out", type=Path, help="also write the result to this file")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if arguments.revision:
            file = f"{folder}/package.tar"
            command = ("git", "archive", "-o", file, arguments.revision, "wm_drake")
            subprocess.run(command, cwd=ROOT, check=True)
            shutil.unpack_archive(file, folder, filter="data")
        texts = _texts(Path(folder) if arguments.revision else ROOT)
    code = {name: list(ast.walk(ast.parse(text))) for name, text in texts.items()}
    lines = Counter[str]()
    for name, text in texts.items():
        lines[f"lines of {'.'.join(name.split('.')[:2])}"] += text.count("\n")
    counts = [*_counts(code), *sorted(lines.items()), ("lines of all", lines.total())]
    result = "\n".join(f"{words:50}{count:7,}" for words, count in counts)
    print(result)
    if arguments.out:
        arguments.out.write_text(f"{result}\n")


def _texts(root: Path) -> dict[str, str]:
    """Return the text of each module by its name."""
    texts = {}
    for path in root.glob("wm_drake/**/*.py"):
        name = ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__")
        texts[name] = path.read_text("utf-8")
    return texts


def _counts(code: Code) -> Iterable[tuple[str, int]]:
    """Return what is counted, and how many there are."""
    studies = {name: nodes for name, nodes in code.items() if name.startswith("wm_drake.studies")}
    every = [node for nodes in code.values() for node in nodes]
    returns = (n.returns for n in every if isinstance(n, ast.FunctionDef) and n.returns)
    returned = [set(re.findall(r"\w+", ast.unparse(node))) for node in returns]
    texts = [n.value for n in every if isinstance(n, ast.Constant) and isinstance(n.value, str)]
    operations = [(m, n) for m in studies for n in studies[m] if isinstance(n, ast.BinOp)]
    products = [(m, n) for m, n in operations if isinstance(n.op, ast.Mult | ast.Div)]
    factors = [(m, n) for m, n in products if FACTORS & {*map(ast.unparse, (n.left, n.right))}]
    yield "classes of results in studies, but Answer", len(_results(studies))
    yield "functions that return a DataFrame", sum("DataFrame" in words for words in returned)
    yield "functions that return a Table", sum("Table" in words for words in returned)
    yield "texts that are names with a unit", sum(bool(UNIT.search(text)) for text in texts)
    yield "lines of studies with a unit factor", len({(m, n.lineno) for m, n in factors})
    yield "modules of studies in circles of imports", len(_in_circles(studies))
    for name in ("SHARE", "MASS", "CHANGE"):
        yield f"quantities named {name}", sum(map(_is_quantity, every, repeat(name)))
    yield "quantities with the words 'smallest gap'", sum(map(_has_words, every))
    yield "decisions by the words of a quantity", sum(map(_reads_words, every))
    lines = {(m, at) for m in studies for n in studies[m] if (at := _line_of_attributes(n))}
    yield "lines of studies with attributes of datasets", len(lines)
    yield "figures of lines and points, mark by mark", sum(map(_draws_lines, every))


def _is_quantity(node: ast.AST, name: str) -> bool:
    """Return whether a statement gives a quantity, or its unit, a name at the top of a module."""
    if not isinstance(node, ast.Assign) or name not in map(ast.unparse, node.targets):
        return False
    return bool(re.match(r"(Quantity|Unit)\(|[A-Z_]+\.named\(", ast.unparse(node.value)))


def _has_words(node: ast.AST) -> bool:
    """Return whether a quantity is made whose words are 'smallest gap'."""
    text = ast.unparse(node) if isinstance(node, ast.Call) else ""
    return text.startswith("Quantity('smallest gap'")


def _reads_words(node: ast.AST) -> bool:
    """Return whether words of a quantity are compared with a text."""
    tests = ("words.startswith", "words.endswith")
    if isinstance(node, ast.Call):
        return ast.unparse(node.func).endswith(tests)
    of_words = isinstance(node, ast.Compare) and ast.unparse(node.left).endswith(".words")
    return of_words and isinstance(node.comparators[0], ast.Constant)


def _line_of_attributes(node: ast.AST) -> int:
    """Return the line in which attributes of a dataset are written or read by name; 0 if none."""
    is_used = (
        (isinstance(node, ast.Attribute) and node.attr == "assign_attrs")
        or (isinstance(node, ast.keyword) and node.arg == "attrs")
        or (isinstance(node, ast.Subscript) and ast.unparse(node.value).endswith(".attrs"))
        or (isinstance(node, ast.AugAssign) and ast.unparse(node.target).endswith(".attrs"))
        or (isinstance(node, ast.Attribute) and ast.unparse(node).endswith(METHODS))
    )
    return getattr(node, "lineno", 0) if is_used else 0


def _draws_lines(node: ast.AST) -> bool:
    """Return whether a function makes a panel of lines and points, each by hand."""
    if not isinstance(node, ast.FunctionDef):
        return False
    calls = (ast.unparse(n.func) for n in ast.walk(node) if isinstance(n, ast.Call))
    made = {name.removeprefix("fig.") for name in calls}
    return "Panel" in made and bool(made & {"Line", "Points"}) and not made & OTHER_MARKS


def _results(code: Code) -> set[str]:
    """Return the classes that inherit from `Result` or `Answer`, directly or not."""
    classes = [n for nodes in code.values() for n in nodes if isinstance(n, ast.ClassDef)]
    found = {"Result", "Answer"}
    while more := {c.name for c in classes if found & {*map(ast.unparse, c.bases)}} - found:
        found |= more
    return found - {"Result", "Answer"}


def _in_circles(code: Code) -> list[str]:
    """Return the modules that import themselves through others, also inside functions."""
    reached = {name: set[str]() for name in code}
    for name, nodes in code.items():
        for node in (node for node in nodes if isinstance(node, ast.ImportFrom)):
            targets = {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
            reached[name] |= targets & code.keys() - {name}
    for through in reached:
        for targets in reached.values():
            targets |= reached[through] if through in targets else set()
    return [name for name, targets in reached.items() if name in targets]


if __name__ == "__main__":
    main()
