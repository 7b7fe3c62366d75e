"""A ledger: finished results of a long study on disk, one row each, from the moment they end; so it can be killed and resumed.

    with open_ledger(folder / "ledger.sqlite", {"study": "gasket", "sources": digest}, resume=True) as ledger:
        for item in work_items:
            key = key_of(item=item, sources=digest)  # of all that determines the result
            if key not in ledger:
                ledger.put(key, {"force": compute(item)})
        ledger.mark_finished()

A ledger belongs to one study: its header holds the study's identity, and another one is refused. It can be filled from any
thread of one process; a second process is refused while the first has it open. It is an SQLite file in write-ahead mode: what
`put` has returned from survives a kill of the process (after a power failure, the last seconds may be missing).
"""

import dataclasses
import hashlib
import json
import sqlite3
import threading
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from wm_drake.errors import WmDrakeError, input_error

FORMAT = "wm_drake ledger 1"
"""First line of the header; another one is another layout of the tables."""

KEY_LENGTH = 32
"""Hexadecimal digits of a key: 128 bits, so that no two of any number of results share one by chance."""

PackedParameters: TypeAlias = np.ndarray[tuple[int, ...], np.dtype[np.float64]]

_TABLES = (
    "CREATE TABLE header (name TEXT PRIMARY KEY, text TEXT NOT NULL) WITHOUT ROWID",
    "CREATE TABLE results (number INTEGER PRIMARY KEY, key TEXT NOT NULL UNIQUE, shapes TEXT NOT NULL, numbers BLOB NOT NULL, "
    "note TEXT NOT NULL, checksum INTEGER NOT NULL)",
)


class LedgerError(WmDrakeError):
    """The file of a ledger failed; what had been put in before is kept."""


@dataclasses.dataclass(frozen=True)
class Result:
    """A finished result: named numbers or arrays of them, and a note (say, why a run ended early)."""

    values: dict[str, PackedParameters]
    note: str = ""


class Ledger:
    """Results by key. From `open_ledger`."""

    def __init__(self, path: Path, connection: sqlite3.Connection) -> None:
        """For an open file whose header has been checked."""
        self.path = path
        self._connection = connection
        self._lock = threading.Lock()
        self._keys = {key for (key,) in self._ask("SELECT key FROM results")}

    def __contains__(self, key: str) -> bool:
        """Whether there is a result of this key."""
        return key in self._keys

    def __len__(self) -> int:
        return len(self._keys)

    def get(self, key: str) -> Result:
        """The result of a key.

        Raises:
            KeyError: there is none.
            LedgerError: its row is damaged.
        """
        rows = self._ask("SELECT shapes, numbers, note, checksum FROM results WHERE key = ?", key)
        if not rows:
            raise KeyError(key)
        shapes, numbers, note, checksum = rows[0]
        if _checksum(key, shapes, numbers, note) != checksum:
            raise LedgerError(
                f"{self.path}: is damaged: the row of result {key} is not what was written; {_LEFT}"
            )
        return Result(_unpacked(shapes, numbers), note)

    def put(self, key: str, values: Mapping[str, Any], note: str = "") -> None:
        """Keeps a result, and returns when it is safe. A key that is there already keeps its result.

        Args:
            key: From `key_of`.
            values: Floats, or arrays of them, by name. NaN and infinity are kept.
            note: Any text.

        Raises:
            LedgerError: the file cannot be written to; earlier results are kept.
        """
        self.put_all(
            {
                key: Result(
                    {name: np.asarray(value, dtype=np.float64) for name, value in values.items()},
                    note,
                )
            }
        )

    def put_all(self, results: Mapping[str, Result]) -> None:
        """Keeps several results at once, all or none: thousands a second faster than one by one."""
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
        with self._lock, _said(self.path):
            with self._connection:
                self._connection.execute("BEGIN")
                self._connection.executemany(
                    "INSERT OR IGNORE INTO results (key, shapes, numbers, note, checksum) VALUES (?, ?, ?, ?, ?)",
                    rows,
                )
            self._keys.update(results)

    def mark_finished(self) -> None:
        """Notes that the study has all its results: opening it again needs no `resume`."""
        with self._lock, _said(self.path):
            self._connection.execute("INSERT OR REPLACE INTO header VALUES ('finished', 'yes')")

    def _ask(self, question: str, *values: str) -> list[Any]:
        with self._lock, _said(self.path):
            return self._connection.execute(question, values).fetchall()


@contextmanager
def open_ledger(
    path: Path, identity: Mapping[str, str], *, resume: bool = False
) -> Iterator[Ledger]:
    """Opens the ledger of a study, or begins one, for this process alone.

    Args:
        path: Its file; its folder must be there.
        identity: What makes the study this one and no other (kind, machine, design, versions), by short names; differences
            are named in messages, so long things go in as a hash.
        resume: Whether results of an unfinished study may be gone on with.

    Raises:
        InputError: another study's or version's, in use, damaged, not writable, or unfinished and `resume` is False. The file
            is left as it is.
    """
    connection = _connected(path)
    try:
        _check_header(path, connection, {"format": FORMAT} | dict(identity), resume)
        with _said(path):
            connection.execute("PRAGMA journal_mode = WAL")
            connection.execute("PRAGMA synchronous = NORMAL")
        yield Ledger(path, connection)
    finally:
        connection.close()


def key_of(**parts: Any) -> str:
    """A key from all that determines a result: numbers to the last digit, texts, mappings, sequences, arrays, parameters."""
    text = json.dumps(parts, sort_keys=True, separators=(",", ":"), default=_plain)
    return hashlib.sha256(text.encode()).hexdigest()[:KEY_LENGTH]


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if hasattr(value, "model_dump"):  # of pydantic
        return value.model_dump(mode="json")
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
    raise TypeError(f"{type(value).__name__} cannot be part of a key")


_LEFT = "the file was left as it is; move it away, or choose another folder, to begin anew"


def _connected(path: Path) -> sqlite3.Connection:
    """The file, locked for this process until the connection ends, however it ends."""
    try:
        connection = sqlite3.connect(
            path, timeout=0.0, isolation_level=None, check_same_thread=False
        )
    except sqlite3.Error as error:
        raise input_error(f"cannot be written to: {error}", where=str(path)) from None
    try:
        connection.execute("PRAGMA locking_mode = EXCLUSIVE")
        connection.execute("BEGIN IMMEDIATE")
        connection.execute("COMMIT")
        (state,) = connection.execute("PRAGMA quick_check(1)").fetchone()
    except sqlite3.Error as error:
        connection.close()
        raise input_error(_reason(error), where=str(path)) from None
    if state != "ok":
        connection.close()
        raise input_error(f"is damaged ({' '.join(state.split())}); {_LEFT}", where=str(path))
    return connection


def _check_header(
    path: Path, connection: sqlite3.Connection, identity: dict[str, str], resume: bool
) -> None:
    try:
        tables = {name for (name,) in connection.execute("SELECT name FROM sqlite_master")}
        if not tables:
            _begin(connection, identity)
            return
        if not {"header", "results"} <= tables:
            raise input_error(f"is a database, but no ledger; {_LEFT}", where=str(path))
        header = dict(connection.execute("SELECT name, text FROM header"))
        (count,) = connection.execute("SELECT count(*) FROM results").fetchone()
    except sqlite3.Error as error:
        raise input_error(_reason(error), where=str(path)) from None
    finished = header.pop("finished", "") == "yes"
    if header != identity:
        names = [name for name in identity | header if identity.get(name) != header.get(name)]
        changes = ", ".join(
            f"{n} is '{header.get(n, '')}' there and '{identity.get(n, '')}' here" for n in names
        )
        raise input_error(
            f"belongs to another study or version: {changes}; {_LEFT}", where=str(path)
        )
    if count and not finished and not resume:
        message = f"holds {count} finished results of this study; go on from there with --resume, or choose another folder"
        raise input_error(message, where=str(path))


def _begin(connection: sqlite3.Connection, identity: dict[str, str]) -> None:
    with connection:
        connection.execute("BEGIN")
        for table in _TABLES:
            connection.execute(table)
        connection.executemany("INSERT INTO header VALUES (?, ?)", list(identity.items()))


@contextmanager
def _said(path: Path) -> Iterator[None]:
    """Turns what SQLite says into a message for a user."""
    try:
        yield
    except sqlite3.Error as error:
        raise LedgerError(f"{path}: {_reason(error)}") from None


def _reason(error: sqlite3.Error) -> str:
    name = getattr(error, "sqlite_errorname", "")
    if name.startswith(("SQLITE_BUSY", "SQLITE_LOCKED")):
        return (
            "is in use by another study that runs now; wait for its end, or choose another folder"
        )
    if name.startswith(("SQLITE_FULL", "SQLITE_IOERR")):
        return f"cannot be written to ({error}): is the disk full? Earlier results are kept; make room, then go on with --resume"
    if name.startswith(("SQLITE_READONLY", "SQLITE_CANTOPEN", "SQLITE_PERM", "SQLITE_AUTH")):
        return f"cannot be written to ({error})"
    return f"is damaged ({error}); {_LEFT}"


def _checksum(key: str, shapes: str, numbers: bytes, note: str) -> int:
    return zlib.crc32(numbers, zlib.crc32("\n".join((key, shapes, note)).encode()))


def _unpacked(shapes: str, numbers: bytes) -> dict[str, PackedParameters]:
    flat = np.frombuffer(numbers, dtype="<f8").astype(np.float64)
    values, begin = {}, 0
    for name, shape in json.loads(shapes).items():
        end = begin + int(np.prod(shape))
        values[name] = flat[begin:end].reshape(shape)
        begin = end
    return values
