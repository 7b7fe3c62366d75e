"""Where does the time of a command go? A row for each command: imports, compilation, runs, page.

    python analyses/show_timeline.py --page docs/performance.md

Each command runs in a process of its own, once to compile and then three times; "first time" is
once, with an empty cache of compiled code. The times of a part are those on a clock in the main
thread, without the imports in it and without other parts in it. Compilation counts loading of
compiled code; what another thread or process compiles meanwhile counts as the part that waits. The
row of a command is its run of median length. `--page` renews the table on the page.
"""

import argparse
import builtins
import contextlib
import importlib
import json
import os
import re
import shlex
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

BEGIN, END = "<!-- timeline: begin -->\n", "<!-- timeline: end -->"
COMMANDS = (
    "machine show reference",
    "spin",
    "study gasket --load middle --load counter",
    "study spin-cycle",
    "study modes",
    "study response",
    "study next",
    "verdict",
)
"""Commands that are timed; they are run with --quiet and a folder for results."""
FIRST = ("spin", "study gasket --load middle --load counter", "verdict")
"""Those that are also timed with an empty cache of compiled code."""
REPEATS = 3
IMPORTS, OTHER = "imports", "other"
PARTS = {
    "compilation": ("numba.core.dispatcher:Dispatcher.compile",),
    "machine": ("wm_drake.studies.run:_machine_of",),
    "runs": ("wm_drake.studies.executor:Executor.simulate", "wm_drake.batch.runs:Runner.run"),
    "page": ("wm_drake.studies.answer:Answer.pages",),
    "files": ("wm_drake.studies.run:_written",),
}
"""Functions whose time is that of a part."""


class Clock:
    """Time of each part in this process, without that of the parts inside it. [s]"""

    def __init__(self) -> None:
        """Begin with the part `OTHER`."""
        self.times = dict.fromkeys([IMPORTS, *PARTS, OTHER], 0.0)
        self._parts, self._since = [OTHER], time.perf_counter()

    @contextlib.contextmanager
    def part(self, name: str) -> Iterator[None]:
        """Count the time inside to a part; imports inside imports are one."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        self.turn()
        self._parts.append(name)
        try:
            yield
        finally:
            self.turn()
            self._parts.pop()

    def turn(self) -> None:
        """Count the time since the last turn to the part at hand."""
        now = time.perf_counter()
        self.times[self._parts[-1]] += now - self._since
        self._since = now

    def counted(self, function: Callable[..., Any], name: str) -> Callable[..., Any]:
        """Return a function whose time counts to a part."""

        def timed(*args: Any, **options: Any) -> Any:
            with self.part(name):
                return function(*args, **options)

        return timed


def time_parts(arguments: list[str]) -> None:
    """Run a command in this process and print the time of each part as JSON."""
    clock = Clock()
    builtins.__import__ = clock.counted(builtins.__import__, IMPORTS)
    importlib.import_module = clock.counted(importlib.import_module, IMPORTS)
    for name, places in PARTS.items():
        for place in places:
            module, path = place.split(":")
            *holders, attribute = path.split(".")
            owner = resolve_name(f"{module}:{'.'.join(holders)}" if holders else module)
            setattr(owner, attribute, clock.counted(getattr(owner, attribute), name))
    from wm_drake.cli import main

    sys.argv = ["wm-drake", *arguments]
    with contextlib.suppress(SystemExit):
        main()
    clock.turn()
    print(json.dumps(clock.times))


def parts_of(command: str, cache: str | None = None) -> dict[str, float]:
    """Return the time of each part of a command, with compiled code in a folder of its own. [s]"""
    environment = os.environ if cache is None else os.environ | {"NUMBA_CACHE_DIR": cache}
    with tempfile.TemporaryDirectory() as folder:
        out = "" if command.startswith("machine") else " --out out --quiet"
        done = subprocess.run(
            [sys.executable, str(Path(__file__).resolve()), "--time", command + out],
            cwd=folder,
            env=environment,
            check=True,
            capture_output=True,
            text=True,
        )
    return dict(json.loads(done.stdout.splitlines()[-1]))


def row_of(command: str, repeats: int) -> str:
    """Return the row of a command: its run of median length."""
    runs = [parts_of(command) for _ in range(repeats + 1)]  # the first one compiles
    times = sorted(runs[1:], key=lambda parts: sum(parts.values()))[repeats // 2]
    return _row(f"`{command}`", times)


def first_row(command: str) -> str:
    """Return the row of a command that compiles."""
    with tempfile.TemporaryDirectory() as cache:
        return _row(f"`{command}`, first time", parts_of(command, cache))


def _row(words: str, times: dict[str, float]) -> str:
    cells = [f"{seconds:.2f}" for seconds in (*times.values(), sum(times.values()))]
    return " | ".join([f"| {words}", *cells]) + " |"


def main() -> None:
    """Time the commands, print their rows and renew the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--page", type=Path, help="page whose table is renewed")
    parser.add_argument("--out", type=Path, help="also write the table to this file")
    parser.add_argument("--quick", action="store_true", help="once, the shortest command")
    parser.add_argument("--time", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.time:
        time_parts(shlex.split(arguments.time))
        return
    columns = ["command, times in s", IMPORTS, *PARTS, OTHER, "whole"]
    lines = ["| " + " | ".join(columns) + " |", "|---" * len(columns) + "|"]
    print("\n".join(lines))
    rows = [partial(row_of, command, REPEATS) for command in COMMANDS]
    rows += [partial(first_row, command) for command in FIRST]
    for row in [partial(row_of, COMMANDS[0], 1)] if arguments.quick else rows:
        lines.append(row())
        print(lines[-1], flush=True)
    if arguments.out:
        arguments.out.write_text("\n".join(lines) + "\n", encoding="utf-8")
    if arguments.page:
        page = arguments.page.read_text(encoding="utf-8")
        table = BEGIN + "\n".join(lines) + "\n" + END
        arguments.page.write_text(re.sub(f"{BEGIN}.*?{END}", table, page, flags=re.DOTALL))


if __name__ == "__main__":
    main()
