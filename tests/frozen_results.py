"""Freeze the results of every command, and compare two frozen folders value by value.

    python tests/frozen_results.py write FOLDER              run all commands, keep what they wrote
    python tests/frozen_results.py compare BEFORE AFTER      print each value that differs

The commands are those of `every_page.KINDS` and some that only print. A refactoring must not change
a number: every CSV, JSON and netCDF value is compared bit by bit. Times of day, run times and source
revisions are left out. `write` continues where it was interrupted.
"""

import argparse
import csv
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import xarray as xr

sys.path.insert(0, str(Path(__file__).parent))

from every_page import KINDS, _with_files, _write_inputs

VARIABLE = {
    "wall_s", "date", "revision", "version", "sources", "seconds", "program", "command", "written",
}  # fmt: skip
"""Names of values that differ from run to run."""

PRINTED = {
    "machine_show": ("machine", "show", "reference", "--json"),
    "machine_show_cabinet": ("machine", "show", "heavy_cabinet", "--json"),
    "machine_show_tubes": ("machine", "show", "free_stroke", "--json"),
    "schema": ("machine", "schema"),
    "schema_description": ("machine", "schema", "description"),
    "spin_json": ("spin", "--json"),
    "spin_drake": ("spin", "--load", "middle", "--engine", "drake", "--json"),
    "modes_json": ("study", "modes", "--json"),
    "gasket_json": ("study", "gasket", "--trials", "150", "--response", "amplitude", "--json"),
    "effect_json": ("spin", "--compare-gasket", "--load", "middle", "--json"),
    "cycle_json": ("study", "spin-cycle", "--case", "2", "--json"),
}  # fmt: skip
"""Commands whose standard output is frozen."""


def write(folder: Path, only: list[str] | None) -> None:
    """Run all commands or some, each in a folder of its own below `folder`."""
    for name in only or [*KINDS, *PRINTED]:
        place = folder / name
        if (place / "finished").exists():
            continue
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir(parents=True)
        print(name, flush=True)
        _write_inputs(place)
        commands = [PRINTED[name]] if name in PRINTED else KINDS[name].commands
        with (place / "printed.json").open("w") as printed:
            for words in commands:
                full = words if name in PRINTED else _with_files(words, place)
                run = [sys.executable, "-m", "wm_drake", *full]
                subprocess.run(run, cwd=place, stdout=printed, check=True)
        if name not in PRINTED:
            (place / "printed.json").unlink()
        (place / "finished").touch()


def values_of(path: Path, root: Path) -> dict[str, Any]:
    """Return the values of a result file by place in it; paths below `root` are relative."""
    if path.suffix == ".csv":
        with path.open(newline="") as file:
            return {
                f"{row},{column}": cell.replace(str(root.resolve()), "")
                for row, cells in enumerate(csv.reader(file))
                for column, cell in enumerate(cells)
            }
    if path.suffix == ".nc":
        with xr.open_dataset(path) as data:
            found = {name: variable.values.tobytes() for name, variable in data.variables.items()}
            attributes = {k: str(v) for k, v in data.attrs.items() if k not in VARIABLE}
        return found | attributes
    text = path.read_text(encoding="utf-8")
    try:
        return dict(_leaves(json.loads(text)))
    except json.JSONDecodeError:
        return {"text": text} if path.suffix == ".json" else {}


def _leaves(node: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    entries = node.items() if isinstance(node, dict) else enumerate(node)
    for key, value in entries:
        if key in VARIABLE:
            continue
        if isinstance(value, dict | list):
            yield from _leaves(value, f"{path}{key}.")
        else:
            yield f"{path}{key}", repr(value)


def compare(before: Path, after: Path, only: list[str] | None) -> int:
    """Print what differs between two frozen folders; return the number of files that differ."""
    names = {
        path.relative_to(root)
        for root in (before, after)
        for path in root.rglob("*")
        if path.suffix in (".csv", ".json", ".nc") and path.name != "run.json"
    }
    if only:
        names = {name for name in names if name.parts[0] in only}
    worse = 0
    for name in sorted(names):
        if not ((before / name).exists() and (after / name).exists()):
            print(f"{name}: only {'before' if (before / name).exists() else 'after'}")
            worse += 1
            continue
        one, two = values_of(before / name, before), values_of(after / name, after)
        places = [place for place in one | two if one.get(place) != two.get(place)]
        if places:
            shown = ", ".join(f"{p}: {one.get(p)!r:.40} -> {two.get(p)!r:.40}" for p in places[:3])
            print(f"{name}: {len(places)} of {len(one | two)} values differ: {shown}")
            worse += 1
    print(f"{len(names)} files compared, {worse} differ")
    return worse


def main() -> None:
    """Write or compare, as the command line says."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("what", choices=("write", "compare"))
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--only", action="append", metavar="NAME", help="a command; repeatable")
    arguments = parser.parse_args()
    os.environ["COLUMNS"] = "200"
    if arguments.what == "write":
        write(arguments.folders[0].resolve(), arguments.only)
    else:
        sys.exit(bool(compare(*arguments.folders, arguments.only)))


if __name__ == "__main__":
    main()
