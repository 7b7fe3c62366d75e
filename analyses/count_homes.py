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
from pathlib import Path

ROOT = Path(__file__).parents[1]
UNIT = re.compile(r"_(mm|rpm|Hz|hz|deg|percent|kg|gm|k?N|k?Nm|Nmm|mJ|MPa|ms|g|m|s|\w*N\w*_per_m*)$")
FACTORS = {"MM_PER_M", "GM_PER_KGM", "MPA_PER_PA", "MS_PER_S", "RPM_PER_RAD_S"}
FACTORS |= {f(n) for n in (1e3, 1e-3, 1e6, 1e-6, 100.0, 60.0, 30.0) for f in (str, "{:g}".format)}
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


def _results(code: Code) -> set[str]:
    """Return the classes that inherit from `Result`, directly or not, but `Answer`."""
    classes = [n for nodes in code.values() for n in nodes if isinstance(n, ast.ClassDef)]
    found = {"Result"}
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
