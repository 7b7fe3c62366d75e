"""Rooms that work without Drake import none of it."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import wm_drake


@pytest.mark.parametrize("room", ["compiler", "laws", "parameters", "elements", "rigs"])
def test_a_room_imports_no_pydrake(room):
    code = (
        f"import sys, importlib, pkgutil, wm_drake.{room} as room\n"
        "for module in pkgutil.iter_modules(room.__path__):\n"
        "    importlib.import_module(room.__name__ + '.' + module.name)\n"
        "print(sorted(name for name in sys.modules if name.startswith('pydrake')))\n"
    )
    ended = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"PYTHONPATH": str(Path(wm_drake.__file__).parents[1])},
        capture_output=True,
        text=True,
        check=True,
    )
    assert ended.stdout.strip() == "[]"
