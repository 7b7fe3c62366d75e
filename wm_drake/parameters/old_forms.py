"""Forms that files of numbers that vary had before version 0.3, and the lines to write instead."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ruamel.yaml.comments import CommentedMap

from wm_drake.errors import InputError, Problem
from wm_drake.parameters.files import read_yaml, yaml_text

RENAMED = {"quantities": "a tolerance or free file", "variables": "a design file"}
"""Sections that are `vary` now, by the kind of file that had them."""

FACTOR = {"keys", "low", "high", "middle", "about"}
"""Keys of an entry of a factor file."""


def check_form(path: Path) -> None:
    """Check that a file of numbers that vary does not have the form of an earlier version.

    Raises:
        InputError: it has; each message has a line to write instead.
    """
    tree = read_yaml(path)
    problems = [Problem(f"{path}:{line}", key, message) for line, key, message in _problems(tree)]
    if problems:
        raise InputError(problems)


def _problems(tree: CommentedMap) -> Iterator[tuple[int, str, str]]:
    """Yield line, key and message of each old form in a file."""
    for name, kind in RENAMED.items():
        if name in tree:
            message = f"is of {kind} of an earlier version; write 'vary:' in place of '{name}:'"
            yield _line(tree, name), name, message
    if "load" in tree:
        yield _line(tree, "load"), "load", f"has another name now; write 'loads: {tree['load']}'"
    laundry = tree.get("laundry")
    if isinstance(laundry, CommentedMap):
        for name, entry in laundry.items():
            yield _line(laundry, name), "laundry", _moved(f"laundry.{name}", entry)
    is_entry = [isinstance(e, CommentedMap) and {*e} <= FACTOR for e in tree.values()]
    if tree and "vary" not in tree and all(is_entry):
        for name, entry in tree.items():
            yield _line(tree, name), name, _moved(name, {"low": "50 %", "high": "150 %"} | entry)


def _line(tree: CommentedMap, key: str) -> int:
    return int(tree.lc.key(key)[0]) + 1


def _moved(name: str, entry: Any) -> str:
    """Return a message with the line of an entry in the section `vary`."""
    flow = CommentedMap(entry)
    flow.fa.set_flow_style()
    line = yaml_text({name: flow}).strip()
    return f"is of an earlier version; write below a line 'vary:' the line '  {line}'"
