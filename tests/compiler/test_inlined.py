"""Laws that only compiled code calls: without machine code, kept on disk, refused to Python."""

import os
import subprocess
import sys
from collections import namedtuple
from pathlib import Path

from wm_drake.compiler.compilation import law, long_running
from wm_drake.compiler.lanes import WIDTH, lane_array

SCRIPT = """
import sys
import numpy as np
from wm_drake.compiler.compilation import law, long_running
from wm_drake.compiler.lanes import WIDTH, lane_array

@law
def spring(x, k):
    return -k * x

@long_running
def once(x):
    lanes = lane_array(x)
    lanes[0] = spring(lanes[0], 3.0)

@long_running
def twice(x):
    lanes = lane_array(x)
    lanes[0] = spring(spring(lanes[0], 3.0), 3.0)

x = np.arange(float(WIDTH))
{"once": once, "twice": twice}[sys.argv[1]](x)
print(x[1], sum(spring.stats.cache_hits.values()))
"""

Parts = namedtuple("Parts", ("begins", "size"))


@law
def share(x, parts):
    """Return x divided by the number of parts."""
    return x / count(parts)


@law
def count(parts):
    """Return the number of parts."""
    return len(parts.begins)


@long_running
def divide(x, parts):
    """Divide the first lanes of an array by the number of parts."""
    lanes = lane_array(x)
    lanes[0] = share(lanes[0], parts)


LIBRARIES = """
from test_inlined import count, divide, share, Parts
import numpy as np
from wm_drake.compiler.lanes import WIDTH
x, parts = np.full(WIDTH, 6.0), Parts(np.arange(3), 1)
divide(x, parts)
print(*x)
try:
    print("called:", count(parts))
except TypeError:
    print("refused", count.py_func(parts))
for inner in (share, count):
    print(*[type(compiled.library).__name__ for compiled in inner.overloads.values()])
print(sum(divide.stats.cache_hits.values()))
"""


def printed(script, cache, *words):
    """Return the lines that a new process prints, which has only the compiled code of a folder."""
    folders = [str(Path(__file__).parent), *sys.path]
    environment = os.environ | {
        "NUMBA_CACHE_DIR": str(cache),
        "PYTHONPATH": os.pathsep.join(folders),
    }
    command = [sys.executable, *script, *words]
    ended = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return ended.stdout.splitlines()


def test_law_for_lanes_is_part_of_its_caller_only(tmp_path):
    """Check that the caller is right, and that Python can call none of the two laws in it.

    The first process compiles all three; the second reads them from disk.
    """
    for hits in ("0", "1"):
        quotients, called, *libraries, found = printed(["-c", LIBRARIES], tmp_path)
        assert quotients.split() == ["2.0"] * WIDTH
        assert called == "refused 3"  # no jump to machine code that is not there
        assert {*libraries} <= {"InlinedLibrary", ""}
        assert hits == "1" or libraries == ["InlinedLibrary"] * 2
        assert found == hits


def test_another_caller_reads_the_law_from_disk(tmp_path):
    """Compile another loop in a second process, with the law of the first one."""
    script = tmp_path / "spring.py"
    script.write_text(SCRIPT, encoding="utf-8")
    lines = [printed([str(script)], tmp_path / "cache", loop) for loop in ("once", "twice")]
    assert lines == [["-3.0 0"], ["9.0 1"]]
