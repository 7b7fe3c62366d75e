"""Rooms that work without Drake import none of it."""

import os
import subprocess
import sys
from pathlib import Path

import wm_drake

CODE = """
import importlib, pkgutil, sys
for name in ("compiler", "laws", "parameters", "elements", "rigs"):
    room = importlib.import_module("wm_drake." + name)
    for module in pkgutil.iter_modules(room.__path__):
        importlib.import_module(room.__name__ + "." + module.name)
    print(name, sorted(name for name in sys.modules if name.startswith("pydrake")))
"""


def test_rooms_import_no_pydrake():
    environment = os.environ | {"PYTHONPATH": str(Path(wm_drake.__file__).parents[1])}
    command = [sys.executable, "-c", CODE]
    ended = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert ended.stdout.split()[1::2] == ["[]"] * 5
