"""The arrays that lanes point to stay in memory as long as the lanes are used."""

import ast
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import wm_drake
from wm_drake.compiler.compilation import long_running
from wm_drake.compiler.lanes import WIDTH, keep, lane_array, number_array

SIZE = 14 * WIDTH


@long_running
def first_after_new_array():
    """Return a number of an array after another one was made, and the other one."""
    own = np.empty(SIZE)
    numbers, lanes = number_array(own), lane_array(own)
    for k in range(SIZE):
        numbers[k] = 1.0
    lanes[0] = lanes[1]
    other = np.full(SIZE, 2.0)
    first = numbers[0]
    keep(own)
    return first, other


def test_kept_array_is_not_freed_before():
    """Show that without `keep` the other array takes its memory."""
    first, other = first_after_new_array()
    assert first == 1.0
    assert np.all(other == 2.0)


def lanes_of(function: ast.FunctionDef) -> Iterator[str]:
    """Yield the local arrays of a function that it takes the lanes or numbers of."""
    given = {argument.arg for argument in function.args.args}
    for node in ast.walk(function):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            if node.func.id not in ("lane_array", "number_array"):
                continue
            name = node.args[0]
            if isinstance(name, ast.Call):
                yield ast.unparse(name)  # an array without a name cannot be kept
            elif isinstance(name, ast.Name) and name.id not in given:
                yield name.id


def names_to_the_end(function: ast.FunctionDef) -> set[str]:
    """Return the names in the last loop of a function and after it."""
    loops = [k for k, line in enumerate(function.body) if isinstance(line, ast.For)]
    end = function.body[loops[-1] :] if loops else function.body[-1:]
    return {node.id for line in end for node in ast.walk(line) if isinstance(node, ast.Name)}


def test_arrays_of_compiled_loops_are_kept():
    """Check that a local array is used in the last loop, where its lanes are, or kept behind it."""
    freed, found = [], 0
    for source in sorted(Path(wm_drake.__file__).parent.rglob("*.py")):
        for function in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
            if not isinstance(function, ast.FunctionDef):
                continue
            own = set(lanes_of(function))
            found += len(own)
            freed += [f"{function.name}: {name}" for name in own - names_to_the_end(function)]
    assert found > 30
    assert not freed
