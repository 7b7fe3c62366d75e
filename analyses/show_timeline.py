"""Where does the time of a command go? A row for each command: imports, machine, runs, page.

    python analyses/show_timeline.py --page docs/performance.md

Each command runs in a process of its own, once to compile and then five times. The times of a part
are those on a clock in the main thread, without the imports in it and without other parts in it.
The row of a command is its run of median length. `--page` renews the table on the page.
"""

import argparse
import builtins
import contextlib
import importlib
import json
import re
import shlex
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
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
)
"""Commands that are timed; they are run with --quiet and a folder for results."""
IMPORTS, OTHER = "imports", "other"
PARTS = {
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


def row_of(command: str, repeats: int) -> str:
    """Return the row of a command: its run of median length."""
    runs = []
    for _ in range(repeats + 1):  # the first one compiles
        with tempfile.TemporaryDirectory() as folder:
            out = "" if command.startswith("machine") else " --out out --quiet"
            done = subprocess.run(
                [sys.executable, str(Path(__file__).resolve()), "--time", command + out],
                cwd=folder,
                check=True,
                capture_output=True,
                text=True,
            )
        runs.append(json.loads(done.stdout.splitlines()[-1]))
    times = sorted(runs[1:], key=lambda parts: sum(parts.values()))[repeats // 2]
    cells = [f"{seconds:.2f}" for seconds in (*times.values(), sum(times.values()))]
    return " | ".join([f"| `{command}`", *cells]) + " |"


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
    for command in COMMANDS[:1] if arguments.quick else COMMANDS:
        lines.append(row_of(command, 1 if arguments.quick else 5))
        print(lines[-1], flush=True)
    if arguments.out:
        arguments.out.write_text("\n".join(lines) + "\n", encoding="utf-8")
    if arguments.page:
        page = arguments.page.read_text(encoding="utf-8")
        table = BEGIN + "\n".join(lines) + "\n" + END
        arguments.page.write_text(re.sub(f"{BEGIN}.*?{END}", table, page, flags=re.DOTALL))


if __name__ == "__main__":
    main()
