"""Generated hostile input over every door: each is refused with a message, quickly, and nothing is written."""

import json
import os
import queue
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from fuzz.cases import DOORS
from fuzz.faults import SECONDS_LIMIT, faults
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

import wm_drake


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
            return json.loads(self.lines.get(timeout=12.0 * SECONDS_LIMIT))
        except queue.Empty:
            self.end()
            return None

    def end(self):
        if self.process is not None:
            self.process.kill()
            self.process.wait()
            self.process = None


@pytest.fixture(scope="module")
def worker():
    """Yield a process for the cases."""
    worker = Worker()
    yield worker
    worker.end()


PARTS, EXAMPLES = 4, 105


@pytest.mark.parametrize("part", range(PARTS))
def test_420_hostile_inputs(worker, part):
    doors = range(part, len(DOORS), PARTS)

    @settings(
        max_examples=EXAMPLES,
        deadline=None,
        derandomize=True,
        database=None,
        phases=(Phase.generate,),  # a case is its number: there is nothing to shrink
        suppress_health_check=list(HealthCheck),
    )
    @given(st.sampled_from(list(doors)), st.integers(0, 10**6))
    def property_holds(door, seed):
        outcome = worker.outcome(seed * len(DOORS) + door)
        assert outcome is not None, f"{DOORS[door]}, {seed}: took too long, or ended the process"
        about = f"{outcome['arguments']}: {outcome['err'][-600:]}"
        assert not outcome["faults"], f"{DOORS[door]}, {seed}: {outcome['faults']}: {about[:1500]}"

    property_holds()


def test_campaign_sees_what_is_wrong():
    good = {"code": 2, "out": "", "err": "input.yaml:2: gravity: is missing\n", "changed": [], "seconds": 0.1, "names": ["input.yaml"], "keys": ["gravity"]}  # fmt: skip
    assert faults(good) == []
    wrong = {"code": 1, "seconds": 11.0, "changed": ["work/x"], "out": "{}", "keys": ["mass"], "names": ["other.yaml"]}  # fmt: skip
    for name, value in wrong.items():
        assert len(faults({**good, name: value})) == 1, name
    for text in ("Traceback", "np.float64(nan)", "[Errno 2]", "x" * 501, "\x1b[31m"):
        assert len(faults({**good, "err": good["err"] + text})) == 1, text
