"""The ledger: results of a long study in a file, so that the study can be killed and resumed.

    identity = {"study": "gasket", "sources": digest}
    with open_ledger(folder / "ledger.sqlite", identity, resume=True) as ledger:
        for item in work_items:
            key = key_of(item=item, sources=digest)  # includes all that determines the result
            if key not in ledger:
                ledger.put(key, {"force": compute(item)})
        ledger.mark_finished()

Each result is one row and is stored as soon as it is finished. A ledger belongs to one study: its
header holds the identity of the study, and opening it with another identity is an error. All
threads of one process can write to it; a second process cannot open it at the same time.

The file is an SQLite database in write-ahead mode. A result is safe against a kill of the process
when `put` has returned. After a power failure, the results of the last seconds may be missing.
"""

import dataclasses
import hashlib
import json
import sqlite3
import threading
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from wm_drake.errors import WmDrakeError, input_error
from wm_drake.parameters.types import FloatArray

FORMAT = "wm_drake ledger 1"
"""Name and version of the table layout, stored in the header."""

KEY_LENGTH = 32
"""Hexadecimal digits of a key; with these 128 bits, accidental collisions are negligible."""

_TABLES = (
    "CREATE TABLE header (name TEXT PRIMARY KEY, text TEXT NOT NULL) WITHOUT ROWID",
    "CREATE TABLE results (number INTEGER PRIMARY KEY, key TEXT NOT NULL UNIQUE, "
    "shapes TEXT NOT NULL, numbers BLOB NOT NULL, note TEXT NOT NULL, checksum INTEGER NOT NULL)",
)


_SQLITE_ERRORS = (sqlite3.Error, UnicodeDecodeError)
"""Errors of SQLite; the second one if its message quotes damaged text."""


class LedgerError(WmDrakeError):
    """A ledger cannot be read or written. Results that were stored before are kept."""


@dataclasses.dataclass(frozen=True)
class LedgerEntry:
    """A finished result: named arrays, and a note (for example, why a run ended early)."""

    values: dict[str, FloatArray]
    note: str = ""


class Ledger:
    """Results by key, stored in a file; see `open_ledger`."""

    def __init__(self, path: Path, connection: sqlite3.Connection) -> None:
        """Wrap an open database whose header has been checked."""
        self.path = path
        self._connection = connection
        self._lock = threading.Lock()

    def __contains__(self, key: str) -> bool:
        """Return whether the ledger has a result with this key."""
        return bool(self._query("SELECT 1 FROM results WHERE key = ?", key))

    def __len__(self) -> int:
        ((count,),) = self._query("SELECT count(*) FROM results")
        return int(count)

    def get(self, key: str) -> LedgerEntry:
        """Return the result with a key.

        Raises:
            KeyError: the ledger has no such result.
            LedgerError: the row of the result is damaged.
        """
        rows = self._query("SELECT shapes, numbers, note, checksum FROM results WHERE key = ?", key)
        if not rows:
            raise KeyError(key)
        shapes, numbers, note, checksum = rows[0]
        kinds = [type(part) for part in (shapes, numbers, note)]
        if kinds != [str, bytes, str] or _checksum(key, shapes, numbers, note) != checksum:
            raise LedgerError(
                f"{self.path}: is damaged: the checksum of result {key} is wrong; {_UNCHANGED}"
            )
        return LedgerEntry(_unpacked(shapes, numbers), note)

    def put(self, key: str, values: Mapping[str, Any], note: str = "") -> None:
        """Store a result; when the call returns, the result is safe against a kill of the process.

        If the ledger has a result with this key already, that result stays and the new one is
        ignored.

        Args:
            key: Key of the result, from `key_of`.
            values: Floats or arrays of floats, by name. NaN and infinity are stored as they are.
            note: Any text.

        Raises:
            LedgerError: the file cannot be written to; earlier results are kept.
        """
        self.put_all(
            {
                key: LedgerEntry(
                    {name: np.asarray(value, dtype=np.float64) for name, value in values.items()},
                    note,
                )
            }
        )

    def put_all(self, results: Mapping[str, LedgerEntry]) -> None:
        """Store several results in one transaction: all or none.

        This is much faster than storing them one by one.

        Args:
            results: Results by key.

        Raises:
            LedgerError: the file cannot be written to; earlier results are kept.
        """
        rows = []
        for key, result in results.items():
            shapes = json.dumps({name: list(array.shape) for name, array in result.values.items()})
            numbers = b"".join(
                np.ascontiguousarray(array, dtype="<f8").tobytes()
                for array in result.values.values()
            )
            rows.append(
                (key, shapes, numbers, result.note, _checksum(key, shapes, numbers, result.note))
            )
        with self._lock, _ledger_errors(self.path, self._connection), self._connection:
            self._connection.execute("BEGIN")
            self._connection.executemany(
                "INSERT OR IGNORE INTO results (key, shapes, numbers, note, checksum) "
                "VALUES (?, ?, ?, ?, ?)",
                rows,
            )

    def mark_finished(self) -> None:
        """Mark the study as finished: the ledger can then be opened again without `resume`."""
        with self._lock, _ledger_errors(self.path, self._connection):
            self._connection.execute("INSERT OR REPLACE INTO header VALUES ('finished', 'yes')")

    def _query(self, statement: str, *values: str) -> list[Any]:
        with self._lock, _ledger_errors(self.path, self._connection):
            return self._connection.execute(statement, values).fetchall()


@contextmanager
def open_ledger(
    path: Path, identity: Mapping[str, str], *, resume: bool = False, replace: bool = False
) -> Iterator[Ledger]:
    """Open the ledger of a study, or create it, with exclusive access for this process.

    Args:
        path: File of the ledger. Its folder must exist.
        identity: Texts that identify the study (kind, machine, design, versions), by short names.
            Messages print the texts that differ, so give the hash of a long text instead.
        resume: Whether an unfinished study may be continued.
        replace: Whether the results of another study of the same kind are deleted. Results of this
            study are kept, and are used as with `resume`.

    Raises:
        InputError: the ledger belongs to another study or version, is in use, is damaged, cannot be
            written to, or is unfinished and `resume` is False. The file is not changed.
    """
    connection = _connected(path)
    try:
        _check_header(path, connection, {"format": FORMAT} | dict(identity), resume, replace)
        with _ledger_errors(path, connection):
            connection.execute("PRAGMA journal_mode = WAL")
            connection.execute("PRAGMA synchronous = NORMAL")
        yield Ledger(path, connection)
    finally:
        connection.close()


def key_of(**parts: Any) -> str:
    """Return the key of a result: a hash of all that determines it.

    Args:
        parts: Numbers (compared to the last digit), texts, mappings, sequences, arrays, data
            classes and pydantic models, by name.

    Raises:
        TypeError: a part has another type.
    """
    text = json.dumps(parts, sort_keys=True, separators=(",", ":"), default=_plain)
    return hashlib.sha256(text.encode()).hexdigest()[:KEY_LENGTH]


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if hasattr(value, "model_dump"):  # a pydantic model
        return value.model_dump(mode="json")
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
    raise TypeError(f"{type(value).__name__} cannot be part of a key")


_UNCHANGED = "the file is unchanged; to start again, move it away or choose another folder"


def _connected(path: Path) -> sqlite3.Connection:
    """Return a connection to the file, which stays locked for this process until it is closed."""
    try:
        connection = sqlite3.connect(
            path, timeout=0.0, isolation_level=None, check_same_thread=False
        )
    except _SQLITE_ERRORS as error:
        raise input_error(f"cannot be written to: {error}", where=str(path)) from None
    try:
        connection.execute("PRAGMA locking_mode = EXCLUSIVE")
        connection.execute("BEGIN IMMEDIATE")
        connection.execute("COMMIT")
        (state,) = connection.execute("PRAGMA integrity_check(1)").fetchone()
    except _SQLITE_ERRORS as error:
        connection.close()
        raise input_error(_reason(error), where=str(path)) from None
    if state != "ok":
        connection.close()
        raise input_error(f"is damaged ({' '.join(state.split())}); {_UNCHANGED}", where=str(path))
    return connection


def _check_header(
    path: Path,
    connection: sqlite3.Connection,
    identity: dict[str, str],
    resume: bool,
    replace: bool,
) -> None:
    try:
        tables = {name for (name,) in connection.execute("SELECT name FROM sqlite_master")}
        if not tables:
            _begin(connection, identity)
            return
        if not {"header", "results"} <= tables:
            raise input_error(f"is a database but not a ledger; {_UNCHANGED}", where=str(path))
        header = dict(connection.execute("SELECT name, text FROM header"))
        (count,) = connection.execute("SELECT count(*) FROM results").fetchone()
    except _SQLITE_ERRORS as error:
        raise input_error(_reason(error), where=str(path)) from None
    finished = header.pop("finished", "") == "yes"
    if header != identity:
        same_kind = all(header.get(name) == identity.get(name) for name in ("format", "study"))
        if same_kind and replace:
            _empty(path, connection, identity)
            return
        names = [name for name in identity | header if identity.get(name) != header.get(name)]
        changes = ", ".join(
            f"{n} is '{header.get(n, '')}' in the ledger and '{identity.get(n, '')}' now"
            for n in names
        )
        raise input_error(
            f"belongs to another study or version: {changes}; {_UNCHANGED}"
            f"{', or add --overwrite to replace it' if same_kind else ''}",
            where=str(path),
        )
    if count and not finished and not (resume or replace):
        raise input_error(
            f"holds {count} finished results of this study; go on from there with --resume, "
            "or choose another folder",
            where=str(path),
        )


def _begin(connection: sqlite3.Connection, identity: dict[str, str]) -> None:
    with connection:
        connection.execute("BEGIN")
        for table in _TABLES:
            connection.execute(table)
        connection.executemany("INSERT INTO header VALUES (?, ?)", list(identity.items()))


def _empty(path: Path, connection: sqlite3.Connection, identity: dict[str, str]) -> None:
    """Delete all results of a ledger, and give it another identity."""
    with _ledger_errors(path, connection), connection:
        connection.execute("BEGIN")
        connection.execute("DELETE FROM results")
        connection.execute("DELETE FROM header")
        connection.executemany("INSERT INTO header VALUES (?, ?)", list(identity.items()))


@contextmanager
def _ledger_errors(path: Path, connection: sqlite3.Connection) -> Iterator[None]:
    """Convert errors of SQLite into a `LedgerError` with a message for the user."""
    try:
        yield
    except _SQLITE_ERRORS as error:
        kept = 0
        with suppress(*_SQLITE_ERRORS):  # no table yet, or it cannot be read
            ((kept,),) = connection.execute("SELECT count(*) FROM results")
        raise LedgerError(f"{path}: {_reason(error, kept)}") from None


def _reason(error: Exception, kept: int = 0) -> str:
    """Return why a ledger cannot be used, and what can be done, with the number of its results."""
    name = getattr(error, "sqlite_errorname", "")
    if name.startswith(("SQLITE_BUSY", "SQLITE_LOCKED")):
        return (
            "is in use by another study that runs now; wait until it ends or choose another folder"
        )
    if name.startswith(("SQLITE_FULL", "SQLITE_IOERR")):
        results = f" Its {kept} results are kept; go on with --resume then." if kept else ""
        return f"cannot be written to ({error}): is the disk full? Free some space.{results}"
    if name.startswith(("SQLITE_READONLY", "SQLITE_CANTOPEN", "SQLITE_PERM", "SQLITE_AUTH")):
        return f"cannot be written to ({error})"
    return f"is damaged ({error}); {_UNCHANGED}"


def _checksum(key: str, shapes: str, numbers: bytes, note: str) -> int:
    return zlib.crc32(numbers, zlib.crc32("\n".join((key, shapes, note)).encode()))


def _unpacked(shapes: str, numbers: bytes) -> dict[str, FloatArray]:
    flat = np.frombuffer(numbers, dtype="<f8").astype(np.float64)
    values, begin = {}, 0
    for name, shape in json.loads(shapes).items():
        end = begin + int(np.prod(shape))
        values[name] = flat[begin:end].reshape(shape)
        begin = end
    return values
