"""Laws that only compiled code calls: without machine code, kept on disk, refused to Python."""

import os
import subprocess
import sys
from collections import namedtuple
from pathlib import Path

import numpy as np
import pytest

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
x = np.full(WIDTH, 6.0)
divide(x, Parts(np.arange(3), 1))
print(*x)
for inner in (share, count):
    print(*[type(compiled.library).__name__ for compiled in inner.overloads.values()])
"""


def test_law_for_lanes_is_part_of_its_caller_only(tmp_path):
    """Check that the caller is right, and that none of the two laws has machine code.

    A new process without compiled code on disk compiles all three.
    """
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    folders = [str(Path(__file__).parent), *sys.path]
    environment["PYTHONPATH"] = os.pathsep.join(folders)
    command = [sys.executable, "-c", LIBRARIES]
    printed = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    quotients, *libraries = printed.stdout.splitlines()
    assert quotients.split() == ["2.0"] * WIDTH
    assert libraries == ["InlinedLibrary"] * 2


def test_python_call_of_such_a_law_is_refused():
    """A call from Python raises a TypeError in place of jumping to code that is not there."""
    parts = Parts(np.arange(3), 1)
    divide(np.full(WIDTH, 6.0), parts)
    with pytest.raises(TypeError):
        count(parts)
    assert count.py_func(parts) == 3


def test_another_caller_reads_the_law_from_disk(tmp_path):
    """Compile another loop in a second process, with the law of the first one."""
    (tmp_path / "spring.py").write_text(SCRIPT, encoding="utf-8")
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    environment["PYTHONPATH"] = os.pathsep.join(sys.path)
    printed = [
        subprocess.run(
            [sys.executable, tmp_path / "spring.py", loop],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        ).stdout.split()
        for loop in ("once", "twice")
    ]
    assert printed == [["-3.0", "0"], ["9.0", "1"]]
