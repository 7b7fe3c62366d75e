"""A campaign of generated hostile input over every door: each is refused with a message, quickly, and nothing is written."""

import json
import os
import queue
import re
import subprocess
import sys
import threading
from pathlib import Path

import pytest

import wm_drake

SECONDS_LIMIT = 10.0
LONGEST_LINE = 500
MOST_LINES = 25
PYTHON = re.compile(
    r"Traceback|\[Errno|np\.\w+\(|<class |object at 0x|Error\(|Exception|InertiaMatrix|pydantic|ruamel|pandas|numpy|NoneType"
)
"""Python shows through in a message."""


class Worker:
    """The process that runs the cases; it is started again when a case kills it."""

    def __init__(self):
        self.process = None

    def start(self):
        root = Path(wm_drake.__file__).parents[1]
        paths = [str(root), str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")]
        self.process = subprocess.Popen(
            [sys.executable, "-m", "fuzz.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))},
        )
        self.lines = queue.Queue()
        process, lines = self.process, self.lines
        threading.Thread(
            target=lambda: [lines.put(line) for line in process.stdout], daemon=True
        ).start()
        assert self.lines.get(timeout=240) == "ready\n"

    def outcome(self, number):
        """Return the outcome of a case, or None if it took too long or killed the process."""
        if self.process is None:
            self.start()
        self.process.stdin.write(f"{number}\n")
        self.process.stdin.flush()
        try:
            return json.loads(self.lines.get(timeout=SECONDS_LIMIT + 10.0))
        except queue.Empty:
            self.end()
            return None

    def end(self):
        if self.process is not None:
            self.process.kill()
            self.process.wait()
            self.process = None


def faults(outcome):
    """Return what is wrong with the outcome of a case, one text each."""
    found = []
    code, err = outcome["code"], outcome["err"]
    lines = err.splitlines()
    if code not in (0, 2):
        found.append(f"exit code {code}")
    if outcome["seconds"] > SECONDS_LIMIT:
        found.append(f"took {outcome['seconds']:.1f} s")
    if match := PYTHON.search(err):
        found.append(f"'{match[0]}' in the message")
    outside = [p for p in outcome["changed"] if code != 0 or not p.startswith("work/wm-drake-")]
    if outside:
        found.append(f"wrote {outside[:3]}")
    if any(len(line) > LONGEST_LINE for line in lines) or len(lines) > MOST_LINES:
        found.append(f"{len(lines)} lines, the longest of {max(map(len, lines))} characters")
    if any(not c.isprintable() for line in lines for c in line):
        found.append("control characters in the message")
    return [*found, *(faults_of_refusal(outcome) if code == 2 else [])]


def faults_of_refusal(outcome):
    """Return what is wrong with the way in which a case was refused."""
    found, err = [], outcome["err"]
    if outcome["out"]:
        found.append("standard output")
    if not any(name in err for name in outcome["names"]):
        found.append("names neither file nor option")
    if outcome["keys"] and not any(key in err for key in outcome["keys"]):
        found.append(f"names none of the keys {outcome['keys']}")
    return found


@pytest.fixture(scope="module")
def worker():
    """Yield a process for the cases."""
    worker = Worker()
    yield worker
    worker.end()


def campaign(worker, numbers):
    """Return the faults of cases, by number."""
    bad = {}
    for number in numbers:
        outcome = worker.outcome(number)
        found = ["took too long, or ended the process"] if outcome is None else faults(outcome)
        if found:
            about = (
                outcome and f"{outcome['door']}: {outcome['arguments']}: {outcome['err'][-600:]}"
            )
            bad[number] = "; ".join(found) + "\n" + str(about)[:1500]
    return bad


def report(bad):
    """Return the faults as text."""
    return "\n".join(f"case {number}: {text}" for number, text in bad.items())


@pytest.mark.parametrize("part", range(5))
def test_500_hostile_inputs(worker, part):
    bad = campaign(worker, range(100 * part, 100 * part + 100))
    assert not bad, report(bad)


@pytest.mark.hours
@pytest.mark.parametrize("part", range(10))
def test_5000_hostile_inputs(worker, part):
    bad = campaign(worker, range(1000 + 500 * part, 1500 + 500 * part))
    assert not bad, report(bad)


def test_campaign_sees_what_is_wrong():
    good = {"code": 2, "out": "", "err": "input.yaml:2: gravity: is missing\n", "changed": [], "seconds": 0.1, "names": ["input.yaml"], "keys": ["gravity"]}  # fmt: skip
    assert faults(good) == []
    wrong = {"code": 1, "seconds": 11.0, "changed": ["work/x"], "out": "{}", "keys": ["mass"], "names": ["other.yaml"]}  # fmt: skip
    for name, value in wrong.items():
        assert len(faults({**good, name: value})) == 1, name
    for text in ("Traceback", "np.float64(nan)", "[Errno 2]", "x" * 501, "\x1b[31m"):
        assert len(faults({**good, "err": good["err"] + text})) == 1, text
