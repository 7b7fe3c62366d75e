"""Forms that files of numbers that vary had before version 0.3, and the lines to write instead."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from wm_drake.errors import InputError, Problem
from wm_drake.parameters.files import read_yaml, yaml_text

RENAMED = {"quantities": "a tolerance or free file", "variables": "a design file"}
"""Sections that are `vary` now, by the kind of file that had them."""

FACTOR = {"keys", "low", "high", "middle", "about"}
"""Keys of an entry of a factor file."""


def check_form(path: Path) -> None:
    """Check that a file of numbers that vary does not have the form of an earlier version.

    Raises:
        InputError: it has; each message has the lines to write instead.
    """
    tree = read_yaml(path)
    problems = [
        Problem(f"{path}:{tree.lc.key(key)[0] + 1}" if key in tree else str(path), key, message)
        for key, message in _problems(tree)
    ]
    if problems:
        raise InputError(problems)


def _problems(tree: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield the key and the message of each old form in a file."""
    for name, kind in RENAMED.items():
        if name in tree:
            yield name, f"is of {kind} of an earlier version; write 'vary:' in place of '{name}:'"
    if "load" in tree:
        yield "load", f"has another name now; write 'loads: {tree['load']}'"
    laundry = tree.get("laundry")
    if isinstance(laundry, Mapping):
        entries = {f"laundry.{name}": entry for name, entry in laundry.items()}
        yield "laundry", _moved("is a part of vary now", entries)
    entries = {n: e for n, e in tree.items() if isinstance(e, Mapping) and {*e} & {*FACTOR}}
    if entries and "vary" not in tree and all(set(e) <= FACTOR for e in tree.values()):
        first = next(iter(entries))
        full = {n: {"low": "50 %", "high": "150 %"} | dict(e) for n, e in entries.items()}
        yield first, _moved("is of a factor file of an earlier version", full)


def _moved(why: str, entries: Mapping[str, Any]) -> str:
    """Return a message with the lines of entries in the section `vary`."""
    lines = yaml_text({"vary": {name: dict(entry) for name, entry in entries.items()}})
    return f"{why}; write these lines:\n{lines.rstrip()}"
