"""Text of files that a user names: regular files of limited size, in UTF-8."""

import stat
from pathlib import Path

from wm_drake.errors import input_error, reason_of

LARGEST_TABLE = 64 << 20
"""Largest size of a table of numbers. [byte]"""


def is_file(path: Path) -> bool:
    """Return whether a path names a file or device; False for a path that cannot exist."""
    try:
        return path.exists() and not path.is_dir()
    except (OSError, ValueError):
        return False


def check_regular(path: Path, *, key: str = "", largest: int = LARGEST_TABLE) -> None:
    """Check that a path names a regular file that is not too large.

    Devices and pipes are refused: they may never end, or wait for input.

    Args:
        path: The file.
        key: Key path for messages.
        largest: Largest size. [byte]

    Raises:
        InputError: the file is missing, is not a regular file, or is too large.
    """
    try:
        status = path.stat()
    except (OSError, ValueError) as error:  # ValueError: the name has a null byte
        raise input_error(reason_of(error), where=str(path), key=key) from None
    if stat.S_ISDIR(status.st_mode):
        raise input_error("is a folder, not a file", where=str(path), key=key)
    if not stat.S_ISREG(status.st_mode):
        raise input_error("is a device or pipe, not a regular file", where=str(path), key=key)
    if status.st_size > largest:
        size = f"{status.st_size / 2**20:.1f} MB"
        message = f"is too large ({size}); allowed are up to {largest >> 20} MB"
        raise input_error(message, where=str(path), key=key)


def read_text(path: Path, *, key: str = "", largest: int = LARGEST_TABLE) -> str:
    """Return the text of a regular file in UTF-8, without a byte order mark.

    Args:
        path: The file.
        key: Key path for messages.
        largest: Largest size. [byte]

    Raises:
        InputError: the file is missing, is not a regular file, is too large, cannot be read, or is
            not text in UTF-8.
    """
    check_regular(path, key=key, largest=largest)
    try:
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise input_error(reason_of(error), where=str(path), key=key) from None
    except UnicodeDecodeError:
        raise input_error("is not text in UTF-8", where=str(path), key=key) from None
