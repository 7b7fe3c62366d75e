"""Files that a user names: shipped ones by name, others by path, of limited size and in UTF-8."""

import codecs
import re
import stat
from dataclasses import dataclass
from pathlib import Path

from wm_drake.errors import input_error, nearest_names, reason_of

DATA = Path(__file__).parents[1] / "data"
"""Folder of the files that the package contains."""

LARGEST_TABLE = 64 << 20
"""Largest size of a table of numbers. [byte]"""


def is_file(path: Path) -> bool:
    """Return whether a path names a file or device; False for a path that cannot exist."""
    try:
        return path.exists() and not path.is_dir()
    except (OSError, ValueError):
        return False


@dataclass(frozen=True)
class ShippedFiles:
    """Files of one kind that the package contains, and others of this kind by path.

    Attributes:
        kind: What one of them is, for messages.
        folder: Their folder.
        pattern: Pattern of their file names.
        prefix: Start of their file names that is not part of their names.
    """

    kind: str
    folder: Path
    pattern: str = "*.yaml"
    prefix: str = ""

    def listed(self) -> dict[str, Path]:
        """Return the shipped files by name."""
        files = sorted(self.folder.glob(self.pattern))
        return {path.stem.removeprefix(self.prefix): path for path in files}

    def path(self, name_or_path: str | Path) -> Path:
        """Return the path of a file, given the name of a shipped one or a path."""
        shipped = self.listed()
        path = shipped.get(str(name_or_path), Path(name_or_path))
        if not is_file(path):
            try:
                reason = "is a folder" if path.is_dir() else "no such file"
            except (OSError, ValueError) as error:
                reason = reason_of(error)
            hint = nearest_names(str(name_or_path), shipped)
            message = f"{reason}, and no shipped {self.kind} of that name{hint}"
            raise input_error(message, where=str(path))
        return path


def check_regular(path: Path, *, key: str = "", largest: int = LARGEST_TABLE) -> None:
    """Check that a path names a regular file that is not too large.

    Devices and pipes are refused: they may never end, or wait for input.

    Args:
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
        key: Key path for messages.
        largest: Largest size. [byte]
    """
    try:
        return _read_bytes(path, key, largest).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise input_error("is not text in UTF-8", where=str(path), key=key) from None


def read_any_text(path: Path, *, key: str = "") -> str:
    """Return the text of a regular file as spreadsheets and loggers write it.

    It is in UTF-8, in UTF-16 with a byte order mark, or in the code page 1252 of Western Windows,
    in which ``µ`` and ``°`` are one byte.

    Args:
        key: Key path for messages.
    """
    content = _read_bytes(path, key, LARGEST_TABLE)
    is_wide = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    for encoding in ("utf-16",) if is_wide else ("utf-8-sig", "cp1252"):
        try:
            text = content.decode(encoding)
        except UnicodeDecodeError:
            continue
        if not _NO_TEXT.search(text):
            return text
    message = "is not text in UTF-8, in UTF-16 with a byte order mark, or in code page 1252"
    if content.startswith((b"PK", b"\xd0\xcf\x11\xe0")):
        message = "is a workbook or an archive, no text; save the sheet as CSV (UTF-8)"
    raise input_error(message, where=str(path), key=key)


_NO_TEXT = re.compile(r"[\x00-\x08\x0e-\x1f]")
"""Characters that no text has."""


def _read_bytes(path: Path, key: str, largest: int) -> bytes:
    check_regular(path, key=key, largest=largest)
    try:
        return path.read_bytes()
    except OSError as error:
        raise input_error(reason_of(error), where=str(path), key=key) from None
