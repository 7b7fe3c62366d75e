"""Claims of processes on what they compile, so that no two compile the same at the same time.

A claim is the lock of one byte of a file beside the compiled code; the operating system releases it
when its process ends. A law that calls others is claimed before them, so processes that wait for
each other's laws do not wait in a circle.
"""

import contextlib
import hashlib
import time
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

try:
    import fcntl
except ImportError:  # a system without such locks: processes compile for themselves
    fcntl = None  # type: ignore[assignment]

LONGEST_WAIT = 120.0
"""Longest time to wait for another process, which may have been stopped. [s]"""

PAUSE = 0.02
"""Time between two attempts. [s]"""

FILE = "claims"

_files: dict[str, BinaryIO] = {}
"""The open file of each folder: closing it would release every claim of this process."""


@contextlib.contextmanager
def claimed(folder: Path, name: str) -> Iterator[None]:
    """Hold the claim of a name, after other processes; without it where there are no such locks."""
    byte = int.from_bytes(hashlib.sha256(name.encode()).digest()[:6], "big")
    file = _file_in(folder)
    held = file is not None and _claim(file, byte)
    try:
        yield
    finally:
        if held and file is not None:
            with contextlib.suppress(OSError):
                fcntl.lockf(file, fcntl.LOCK_UN, 1, byte)


def _file_in(folder: Path) -> BinaryIO | None:
    """Return the file of a folder that has the claims; None if there is none."""
    if fcntl is None:
        return None
    path = str(folder / FILE)
    if path not in _files:
        try:
            _files[path] = Path(path).open("ab")  # noqa: SIM115 - open until the process ends
        except OSError:
            return None
    return _files[path]


def _claim(file: BinaryIO, byte: int) -> bool:
    """Return whether a byte could be locked; wait for another process that has it."""
    end = time.monotonic() + LONGEST_WAIT
    while time.monotonic() < end:
        try:
            fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, byte)
        except (BlockingIOError, PermissionError):  # another process has it
            time.sleep(PAUSE)
        except OSError:
            return False
        else:
            return True
    return False
