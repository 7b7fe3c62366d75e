"""Does every door refuse hostile input with a message, and do killed studies go on unharmed?

Generated cases (`tests/fuzz`) go through every door of the command line and of the studio: machine
files, SDF, meshes, tables, records, options, requests. A case is bad if it ends with another code
than 0 or 2, takes longer than ten seconds, shows Python in its message, writes a file though it is
refused, or has a message that is too long or names no place. Then resumable studies are killed at
random moments and resumed; their tables must be those of a study that was not killed. The script
prints a table of cases per door, and one of kills. It takes about 15 minutes and needs a checkout.
"""

import argparse
import json
import os
import queue
import random
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

TESTS = Path(__file__).parents[1] / "tests"
SECONDS = 30.0
"""Time after which a case counts as hanging. [s]"""

STUDIES = (
    ("study", "gasket", "--trials", "200", "--model", "main"),
    ("study", "tolerance", "--samples", "64"),
    ("study", "design", "--evaluations", "48", "--population", "8"),
    ("study", "spin-cycle", "--case", "1", "--case", "2"),
)
"""Resumable studies that are killed."""


@dataclass
class Tally:
    """Cases that were tried and those that were bad.

    Attributes:
        tried, bad: Number of cases by door.
        faults: What was wrong, one text a case.
    """

    tried: Counter[str] = field(default_factory=Counter)
    bad: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)

    def add(self, door: str, number: int, faults: list[str]) -> None:
        """Count a case."""
        self.tried[door] += 1
        self.bad[door] += bool(faults)
        if faults:
            self.faults.append(f"{door}, case {number}: {'; '.join(faults)}")

    def rows(self) -> list[str]:
        """Return the table as lines of Markdown."""
        doors = [f"| {door} | {self.tried[door]} | {self.bad[door]} |" for door in self.tried]
        total = f"| all | {self.tried.total()} | {self.bad.total()} |"
        return ["| door | tried | bad |", "|---|---|---|", *sorted(doors), total]


class Worker:
    """A process of `tests/fuzz` that runs cases by their numbers; it is renewed if one ends it."""

    def __init__(self) -> None:
        """Start the process."""
        environment = {**os.environ, "PYTHONPATH": f"{TESTS.parent}{os.pathsep}{TESTS}"}
        self.process = subprocess.Popen(
            [sys.executable, "-m", "fuzz.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env=environment,
        )
        self.lines: queue.Queue[str] = queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()
        self.lines.get(timeout=600.0)

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.put(line)

    def outcome(self, number: int) -> dict[str, object] | None:
        """Return the outcome of a case; None if it hangs or ends the process."""
        assert self.process.stdin is not None
        try:
            self.process.stdin.write(f"{number}\n")
            self.process.stdin.flush()
            return dict(json.loads(self.lines.get(timeout=SECONDS)))
        except (OSError, queue.Empty):
            self.process.kill()
            return None


def campaign(numbers: range, doors: tuple[str, ...]) -> Tally:
    """Run cases by their numbers."""
    tally, worker = Tally(), Worker()
    for number in numbers:
        outcome = worker.outcome(number)
        if outcome is None:
            tally.add(doors[number % len(doors)], number, ["hangs, or ends the process"])
            worker = Worker()
            continue
        faults = outcome["faults"]
        tally.add(str(outcome["door"]), number, list(map(str, faults)) if faults else [])
    worker.process.kill()
    return tally


def doors_of_tests() -> tuple[str, ...]:
    """Return the names of the doors, in the order in which cases take them."""
    command = "from fuzz.cases import DOORS; import json; print(json.dumps(DOORS))"
    environment = {**os.environ, "PYTHONPATH": f"{TESTS.parent}{os.pathsep}{TESTS}"}
    printed = subprocess.check_output([sys.executable, "-c", command], env=environment, text=True)
    return tuple(json.loads(printed))


def tables(folder: Path) -> dict[str, bytes]:
    """Return the tables of a result folder by name."""
    return {path.name: path.read_bytes() for path in sorted(folder.glob("*.csv"))}


def run(command: tuple[str, ...], out: Path, seconds: float | None = None) -> bool:
    """Run a study, kill it after some time, and return whether it ended by itself."""
    words = [sys.executable, "-m", "wm_drake", *command, "--out", str(out), "--quiet"]
    resume = ["--resume"] if (out / "ledger.sqlite").exists() else []
    process = subprocess.Popen([*words, *resume], stderr=subprocess.DEVNULL)
    try:
        process.wait(seconds)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
        return False
    return process.returncode == 0


def kills(count: int, top: Path) -> list[str]:
    """Kill studies at random moments, resume them, and return a table of what came out."""
    rows = ["| study | kills | tables differ | files left |", "|---|---|---|---|"]
    random_ = random.Random(0)
    for number, command in enumerate(STUDIES):
        share = count // len(STUDIES) + (number < count % len(STUDIES))
        if not share:
            continue
        begin, whole = time.perf_counter(), top / f"whole-{number}"
        assert run(command, whole), command
        seconds, killed, differ, left = time.perf_counter() - begin, 0, 0, 0
        while killed < share:
            out = top / "killed"
            while killed < share and not run(command, out, random_.uniform(0.1, 1.0) * seconds):
                killed += 1
            if not (out / "report.html").exists():
                run(command, out)
            differ += tables(out) != tables(whole)
            names = [{path.name for path in folder.iterdir()} for folder in (out, whole)]
            left += names[0] != names[1] or any(top.glob(".killed-*"))
            shutil.rmtree(out)
        rows.append(f"| {' '.join(command)} | {killed} | {differ} | {left} |")
    return rows


def main() -> None:
    """Run cases and kills, and print their tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=5000, help="number of generated cases")
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--kills", type=int, default=100, help="number of killed studies")
    parser.add_argument("--quick", action="store_true", help="30 cases and no kill")
    parser.add_argument("--out", type=Path, help="also write the tables to this file")
    options = parser.parse_args()
    cases, count = (30, 0) if options.quick else (options.cases, options.kills)
    tally = campaign(range(options.first, options.first + cases), doors_of_tests())
    lines = [*tally.rows(), "", *tally.faults]
    if count:
        with tempfile.TemporaryDirectory() as folder:
            lines += ["", *kills(count, Path(folder))]
    text = "\n".join(lines) + "\n"
    print(text)
    if options.out:
        options.out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
