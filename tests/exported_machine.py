"""An exported page that runs in node: the engine of JavaScript of Chromium, without its start.

A page computes without a document, in workers; here the code of its worker runs alone.
"""

import base64
import json
import re
import shutil
import subprocess
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

RUNNER = Path(__file__).parent / "live" / "page_runner.mjs"
UNBALANCE = ("mass", "phase", "y", "radius")


def data_of(path):
    """Return what a page knows of its machine."""
    text = path.read_text(encoding="utf-8")
    return json.loads(re.search(r'id="machine-data">(.*?)</script>', text, re.DOTALL)[1])


def changes_of_load(data, name):
    """Return the changes of the array of an instance for a load."""
    at, load = data["model"]["at"], data["loads"][name]
    return [
        *(
            [at["unbalances"] + len(UNBALANCE) * k + i, mass[field]]
            for k, mass in enumerate(load["unbalances"])
            for i, field in enumerate(UNBALANCE)
        ),
        *([at["of_load"] + k, value] for k, value in enumerate(load["harmonics"])),
    ]


def moved_value(number, part=0.3):
    """Return the value of a number when its slider is moved up by a part of the way. [SI]"""
    shown = number["value"] + part * (number["high"] - number["value"])
    return shown * number["units"][number["unit"]]


def movable(data):
    """Return the numbers of the machine file that the page can move."""
    return [n for n in data["machine"]["numbers"] if n["key"] in data["model"]["places"]]


@dataclass
class PageRun:
    """Answer of a page: displacements before the filter (n, sensors), amplitudes, gap [m]; frame.

    The frame is that of the smallest gap.
    """

    moved: Any
    sizes: Any
    gap: float | None
    status: float
    diverged: float | None
    bands: Any
    frame: dict | None = None


def page_run(data, found):
    """Return the answer of a worker; displacements are base64."""
    points, sensors = data["model"]["count"]["points"], data["model"]["count"]["sensors"]
    moved = np.frombuffer(base64.b64decode(found["moved"])).reshape(points, -1)[:sensors].T
    gap = found.get("gap") and found["gap"]["distance"]
    sizes = np.array(found["sizes"], dtype=float)
    frame = found.get("gap") and found["gap"].get("frame")
    diverged, bands = found.get("diverged"), found.get("bands")
    return PageRun(moved, sizes, gap, found["status"], diverged, bands, frame)


@dataclass
class NodePage:
    """A page that runs in node."""

    path: Path
    data: dict = field(init=False)

    def __post_init__(self):
        """Start node; skip the test where there is none."""
        if shutil.which("node") is None:
            pytest.skip("no node: install Debian's nodejs")
        self.data = data_of(self.path)
        self._process = subprocess.Popen(
            ["node", RUNNER, self.path], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def run(self, load, changes=(), **job):
        """Return the answer for a load with some numbers [place, SI] changed."""
        job["changes"] = [*changes, *changes_of_load(self.data, load)]
        self._process.stdin.write(f"{json.dumps(job)}\n")
        self._process.stdin.flush()
        return page_run(self.data, json.loads(self._process.stdout.readline()))

    def close(self):
        """End node."""
        self._process.stdin.close()
        self._process.wait()
