"""Closed and full streams lose no results, and Ctrl-C ends with one line from the first line on."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

RIG = f"{sys.executable} -m wm_drake rig damper -f '1 Hz' -a '1 mm' --out out"


@pytest.mark.parametrize(
    ("streams", "code"),
    [("<&- >&- 2>&-", 0), (">/dev/full 2>/dev/full", 2), ("| true", 0)],
)
def test_streams_that_are_closed_or_full_lose_no_results(tmp_path, streams, code):
    shell = f"set -o pipefail; {RIG} {streams}"
    ended = subprocess.run(["bash", "-c", shell], cwd=tmp_path, capture_output=True, check=False)
    assert ended.returncode == code
    assert not ended.stderr
    assert {"run.json", "report.html"} <= {path.name for path in (tmp_path / "out").iterdir()}


def test_a_locale_of_a_batch_system_is_no_obstacle(tmp_path):
    plain = {"LC_ALL": "C", "PYTHONUTF8": "0", "PATH": os.environ["PATH"], "HOME": str(tmp_path)}
    words = [sys.executable, "-m", "wm_drake", "machine", "check", "reference"]
    ended = subprocess.run(words, cwd=tmp_path, env=plain, capture_output=True, check=False)
    assert (ended.returncode, ended.stderr) == (0, b"")
    assert b"valid" in ended.stdout


NUMBER = """
import os, sys
from wm_drake.__main__ import open_streams
os.closerange(0, 3)
open_streams()
os._exit(open("ledger", "w").fileno())
"""


def test_no_file_gets_the_number_of_a_closed_stream(tmp_path):
    ended = subprocess.run([sys.executable, "-c", NUMBER], cwd=tmp_path, check=False)
    assert ended.returncode == 3


INTERRUPTED = {
    "an import that swallows it": "import swallows; time.sleep(9)",
    "a callback whose errors Python ignores": """
class Deleted:
    def __del__(self): interrupted()
Deleted(); time.sleep(9)""",
    "C code that clears errors": """
import ctypes
class Key:
    def __hash__(self): interrupted()
look_up = ctypes.pythonapi.PyDict_GetItem
look_up.argtypes = [ctypes.py_object] * 2
look_up({}, Key()); time.sleep(9)""",
    "a clean-up, which ends first": """
try: interrupted()
finally: time.sleep(0.3); open("cleaned", "w").close()""",
    "the end of Python": "import atexit; atexit.register(lambda: (interrupted(), time.sleep(9)))",
    "any other line": "interrupted()",
}
START = """
import os, signal, sys, time, types
def interrupted():
    os.kill(os.getpid(), signal.SIGINT); time.sleep(0.01)
def main():
    exec(sys.argv[1], {"interrupted": interrupted, "time": time})
sys.modules["wm_drake.cli"] = types.ModuleType("cli")
sys.modules["wm_drake.cli"].main = main
from wm_drake.__main__ import main
main()
"""


@pytest.mark.parametrize("place", INTERRUPTED)
def test_an_interrupt_ends_with_one_line_wherever_it_comes(tmp_path, place):
    Path(tmp_path, "swallows.py").write_text(
        "import os, signal, time\ntry:\n    os.kill(os.getpid(), signal.SIGINT); time.sleep(0.2)\n"
        "except BaseException:\n    pass\n"
    )
    ended = subprocess.run(
        [sys.executable, "-c", START, INTERRUPTED[place]],
        cwd=tmp_path,
        capture_output=True,
        check=False,
    )
    assert (ended.returncode, ended.stderr) == (130, b"interrupted\n")
    assert Path(tmp_path, "cleaned").exists() == ("clean-up" in place)


@pytest.mark.parametrize("delay", [0.1, 0.5, 1.0, 2.0])
def test_an_interrupted_command_writes_nothing_half(tmp_path, delay):
    process = subprocess.Popen(
        [sys.executable, "-X", "importtime", "-m", "wm_drake", "machine", "check", "motor", "--page", "m.html"],
        cwd=tmp_path,
        stderr=subprocess.PIPE,
    )  # fmt: skip
    assert process.stderr is not None
    for line in process.stderr:  # our first line runs when this module is imported
        if b"wm_drake" in line:
            break
    time.sleep(delay)
    process.send_signal(signal.SIGINT)
    lines = [line for line in process.stderr.read().splitlines() if b"import time" not in line]
    assert (process.wait(), lines) == (130, [b"interrupted"])
    assert not any(tmp_path.iterdir())
