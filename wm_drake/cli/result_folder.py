"""Result folders that are either complete or not written at all."""

import errno
import fcntl
import os
import re
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from wm_drake.errors import input_error, reason_of

SUFFIX = ".partial"
"""End of the name of a temporary folder."""

_NOT_WRITTEN = {
    errno.ENOSPC,
    errno.EDQUOT,
    errno.EFBIG,
    errno.EIO,
    errno.EROFS,
    errno.EACCES,
    errno.EPERM,
}
"""Errors of a disk that is full, broken, or not ours to write to."""


@contextmanager
def result_folder(out: Path, kept: str = "") -> Iterator[Path]:
    """Yield a temporary folder beside `out`, and move its files to `out` if the block succeeds.

    If the block fails, `out` keeps its earlier files. Temporary folders of earlier commands that
    were killed are removed first.

    Args:
        out: Folder of the results.
        kept: What is kept if the results cannot be written, for the message.

    Raises:
        InputError: `out` is a file, or it cannot be written to: checked before the block, or found
            when the block writes.
    """
    check_is_folder(out)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        beside = out if out.is_dir() else out.parent
        _remove_leftovers(out, beside)
        partial, lock = _locked_folder(out, beside)
    except OSError as error:
        raise _unwritable(out, error, kept) from None
    try:
        yield partial
        out.mkdir(exist_ok=True)
        for path in sorted(partial.iterdir()):
            path.replace(out / path.name)
    except OSError as error:
        if error.errno not in _NOT_WRITTEN:
            raise
        raise _unwritable(out, error, kept) from None
    finally:
        shutil.rmtree(partial, ignore_errors=True)
        os.close(lock)


def _unwritable(out: Path, error: OSError, kept: str) -> Exception:
    reason = "; ".join(filter(None, [f"cannot be written to: {reason_of(error)}", kept]))
    return input_error(reason, where=str(out))


def _locked_folder(out: Path, beside: Path) -> tuple[Path, int]:
    """Return a new temporary folder and the lock that says that this process uses it.

    The system releases the lock when the process ends, however it ends.
    """
    while True:
        partial = Path(tempfile.mkdtemp(prefix=f".{out.name}-", suffix=SUFFIX, dir=beside))
        lock = _locked(partial)
        if lock is not None:
            return partial, lock


def _remove_leftovers(out: Path, beside: Path) -> None:
    """Remove the temporary folders for `out` whose process has ended without removing them."""
    name = re.compile(rf"\.{re.escape(out.name)}-[a-z0-9_]{{8}}{re.escape(SUFFIX)}")
    for path in beside.iterdir():
        if name.fullmatch(path.name) and path.is_dir() and not path.is_symlink():
            lock = _locked(path)
            if lock is not None:
                shutil.rmtree(path, ignore_errors=True)
                os.close(lock)


def _locked(folder: Path) -> int | None:
    """Return an exclusive lock on a folder, or None if a process has it or the folder is gone."""
    try:
        lock = os.open(folder, os.O_RDONLY)
    except OSError:
        return None
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if folder.is_dir():
            return lock
    except OSError:
        pass
    os.close(lock)
    return None


def check_is_folder(out: Path) -> None:
    """Raise an InputError if the path of a result folder is a file, or cannot exist."""
    try:
        is_other = out.exists() and not out.is_dir()
    except (OSError, ValueError) as error:
        raise input_error(reason_of(error), where=str(out)) from None
    if is_other:
        raise input_error("this path is a file, but a folder is needed", where=str(out))
