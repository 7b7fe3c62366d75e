"""Does every door refuse hostile input with a message, and do killed studies go on unharmed?

Generated cases (`tests/fuzz`) go through every door of the command line and of the studio: machine
files, SDF, meshes, tables, records, options, requests. A case is bad if it ends with another code
than 0 or 2, takes longer than ten seconds of the processor, shows Python in its message, writes a
file though it is refused, or has a message that is too long or names no place. First, all studies
that can be resumed are killed at random moments and resumed; their tables must be those of a study
that was not killed. The script prints a table of cases per door, and one of kills. On two cores of
their own it takes about half an hour; it needs a checkout.
"""

import argparse
import contextlib
import json
import os
import queue
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

import wm_drake as wm
from wm_drake.cli import main as main_of_command

TESTS = Path(__file__).parents[1] / "tests"
SECONDS = 120.0
"""Time after which a case counts as hanging. [s]"""

CASES_OF_PROCESS = 200
"""Cases until the process is renewed, so that what it keeps in memory stays small. (assumption)"""

STUDIES = (
    ("study", "design", "--evaluations", "32", "--population", "8"),
    ("study", "drive", "--quick", "--load", "middle", "--torques", "3", "--unbalances", "2"),
    ("study", "gasket", "--trials", "100", "--model", "main"),
    ("study", "spin-cycle", "--case", "1", "--case", "2"),
    ("study", "spin-identify", "--quick"),
    ("study", "tolerance", "--quick", "--samples", "64"),
    ("calibrate", "--quick", "--vary", "free.yaml"),
    ("verdict", "--quick"),
    ("study", "balancer", "--quick"),
    ("study", "gasket-geometry", "--quick", "--drawings", "6", "--fresh", "2", "--load", "middle"),
)
"""Studies with a ledger, all that can be resumed, in small sizes; they are killed."""

FREE = """vary:
  spring:
    bounds: (1, 20) N/mm
    prior: (7.5, 2) N/mm
    sets: {spring_types.suspension.stiffness: '1'}
    source: guess
"""
"""File of the quantity that `calibrate` fits."""


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
        if not self.lines.get(timeout=600.0):
            raise RuntimeError("tests/fuzz/worker.py ended before it was ready")

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.put(line)
        self.lines.put("")  # the process has ended

    def outcome(self, number: int) -> dict[str, Any] | None:
        """Return the outcome of a case; None if it hangs or ends the process."""
        assert self.process.stdin is not None
        try:
            self.process.stdin.write(f"{number}\n")
            self.process.stdin.flush()
            return dict(json.loads(self.lines.get(timeout=SECONDS)))
        except (OSError, queue.Empty, json.JSONDecodeError):
            self.process.kill()
            return None


def campaign(numbers: range, doors: tuple[str, ...]) -> Iterator[Tally]:
    """Run cases by their numbers; yield the tally after each."""
    tally = Tally()
    for first in range(numbers.start, numbers.stop, CASES_OF_PROCESS):
        worker = Worker()
        for number in range(first, min(first + CASES_OF_PROCESS, numbers.stop)):
            outcome = worker.outcome(number)
            if outcome is None:
                tally.add(doors[number % len(doors)], number, ["hangs, or ends the process"])
                worker = Worker()
            else:
                tally.add(str(outcome["door"]), number, [str(one) for one in outcome["faults"]])
            yield tally
        worker.process.kill()


def doors_of_tests() -> tuple[str, ...]:
    """Return the names of the doors, in the order in which cases take them."""
    command = "from fuzz.cases import DOORS; import json; print(json.dumps(DOORS))"
    environment = {**os.environ, "PYTHONPATH": f"{TESTS.parent}{os.pathsep}{TESTS}"}
    printed = subprocess.check_output([sys.executable, "-c", command], env=environment, text=True)
    return tuple(json.loads(printed))


def tables(folder: Path) -> dict[str, bytes]:
    """Return the tables of a result folder by name."""
    return {path.name: path.read_bytes() for path in sorted(folder.glob("*.csv"))}


def files_of(folder: Path) -> set[str]:
    """Return the names of all files in a result folder."""
    return {path.name for path in folder.iterdir()}


def warm_up() -> None:
    """Import and compile what the studies need, so that a killed process need not."""
    machine = wm.build_machine(wm.load_machine())
    wm.simulate_many(machine, [wm.case_of(machine.parameters, "middle")], workers=1)


def child(command: tuple[str, ...], out: Path) -> NoReturn:
    """Run a command in a forked process and end the process."""
    code: int | str | None = 0
    try:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
        resume = ["--resume"] if (out / "ledger.sqlite").exists() else []
        sys.argv = ["wm-drake", *command, "--out", str(out), "--quiet", *resume]
        main_of_command()
    except SystemExit as ended:
        code = ended.code
    finally:
        os._exit(code if isinstance(code, int) else 1)


def run(command: tuple[str, ...], out: Path, seconds: float = 600.0) -> bool:
    """Run a study in a forked process; kill it after some time. Return whether it ended by itself.

    A fork of this process needs no seconds to import and compile, so the kill meets the study. This
    process has no other threads.
    """
    process = os.fork()
    if process == 0:
        child(command, out)
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        ended, status = os.waitpid(process, os.WNOHANG)
        if ended:
            assert status == 0, (command, status)
            return True
        time.sleep(0.005)
    os.kill(process, signal.SIGKILL)
    os.waitpid(process, 0)
    return False


def killed_until_finished(command: tuple[str, ...], out: Path, times: list[float]) -> int:
    """Kill a study after each of some times and go on, then let it finish; return the kills."""
    killed = 0
    for seconds in times:
        if run(command, out, seconds) or (out / "report.html").exists():
            break
        killed += 1
    if not (out / "report.html").exists():
        assert run(command, out), command
    return killed


def kills(count: int, top: Path) -> list[str]:
    """Kill studies at random moments, resume them, and return a table of what came out."""
    rows = ["| study | kills | finished | tables differ | files left |", "|---|---|---|---|---|"]
    random_ = random.Random(0)
    Path("free.yaml").write_text(FREE, encoding="utf-8")
    warm_up()
    for number, command in enumerate(STUDIES):
        share = count // len(STUDIES) + (number < count % len(STUDIES))
        whole, out, tally = top / f"whole-{number}", top / "killed", Counter[str]()
        begin = time.monotonic()
        assert run(command, whole), command
        seconds = time.monotonic() - begin
        while tally["kills"] < share:
            times = [random_.uniform(0.05, 1.0) * seconds for _ in range(share - tally["kills"])]
            tally["kills"] += killed_until_finished(command, out, times)
            tally["finished"] += 1
            tally["differ"] += tables(out) != tables(whole)
            tally["left"] += files_of(out) != files_of(whole) or any(top.glob(".killed*"))
            shutil.rmtree(out)
        found = (tally[name] for name in ("kills", "finished", "differ", "left"))
        rows.append(f"| {' '.join(command)} | {' | '.join(map(str, found))} |")
        print(rows[-1], file=sys.stderr, flush=True)
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
    killed = []
    if count:
        # `calibrate` names a file in the folder; kills first: this process has no threads yet
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            killed = ["", *kills(count, Path(folder))]
    text = ""
    for tally in campaign(range(options.first, options.first + cases), doors_of_tests()):
        text = "\n".join([*tally.rows(), "", *tally.faults, *killed]) + "\n"
        if options.out:
            options.out.write_text(text, encoding="utf-8")
    print(text or "\n".join(killed))


if __name__ == "__main__":
    main()
