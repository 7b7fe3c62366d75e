"""Result folders: complete or not written at all, and written by one run.

A folder belongs to the run that wrote it; `run.json` in the folder names this run and its files. A
second run into the folder is refused, unless `--overwrite` is given or it is the same study again.
Results of another command, and files that no run wrote, are never changed.
"""

import errno
import fcntl
import json
import os
import re
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

from wm_drake.errors import InputError, input_error, reason_of
from wm_drake.report.provenance import command_line, now, source_revision, version
from wm_drake.written_files import try_folder, unwritable

RUN_FILE = "run.json"
"""Name of the file that describes the run that wrote a folder."""

FORMAT = "wm_drake run 1"

LEDGER = "ledger.sqlite"
"""Name of the ledger file in the folder of a study. SQLite adds suffixes for its own files."""

SUFFIX = ".partial"
"""End of the name of a temporary folder."""


class FigureFiles(NamedTuple):
    """Folder of `--figures`, and how its files look, as for `publication.write_figures`."""

    folder: Path
    columns: int = 2
    has_text: bool = False


FIGURES: ContextVar[FigureFiles | None] = ContextVar("figures", default=None)
"""Files of `--figures` for the running command."""

TRIES = 5
"""Number of temporary folders that are tried."""

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


@dataclass(frozen=True)
class CommandRun:
    """The run of a command, as far as its result folder is concerned.

    Attributes:
        command: Name of the command, such as "study gasket".
        overwrite: Whether the results of an earlier run of the same command are replaced.
        identity: Texts that identify the inputs of a study with a ledger, by short names. A run
            with the identity of the earlier one continues or repeats it and may write without
            `overwrite`. Empty if the command has no ledger.
        command_line: Command as a user types it, or Python call.
        options: Options of a study, for `run.json`.
    """

    command: str
    overwrite: bool = False
    identity: Mapping[str, str] = field(default_factory=dict)
    command_line: str = field(default_factory=command_line)
    options: Mapping[str, Any] = field(default_factory=dict)


def check_folder(out: Path, run: CommandRun) -> None:
    """Raise an InputError if a run must not write to a folder: the one rule for all commands."""
    check_is_folder(out)
    earlier = _earlier_run(out)
    if earlier is None:
        _check_has_no_other_files(out, run)
        return
    if earlier["command"] != run.command:
        raise input_error(
            f"holds results of 'wm-drake {earlier['command']}'; 'wm-drake {run.command}' never "
            "replaces those; choose another folder with --out",
            where=str(out),
        )
    same = bool(run.identity) and dict(run.identity) == earlier["identity"]
    if not (run.overwrite or same):
        raise input_error(
            f"{_what_it_holds(earlier, run)}; add --overwrite to replace it, or choose another "
            "folder with --out",
            where=str(out),
        )


def _what_it_holds(earlier: dict[str, Any], run: CommandRun) -> str:
    there, now = earlier["identity"], run.identity
    names = [name for name in {**now, **there} if there.get(name) != now.get(name)]
    if not names:
        return f"holds an earlier run ({earlier['date']})"
    changes = ", ".join(
        f"{name} is '{there.get(name, '')}' there and '{now.get(name, '')}' now" for name in names
    )
    return f"holds another study or version: {changes}"


def check_is_folder(out: Path) -> None:
    """Raise an InputError if a path is a file, or no folder can be made or written to there."""
    try:
        is_other = out.exists() and not out.is_dir()
    except (OSError, ValueError) as error:
        raise input_error(reason_of(error), where=str(out)) from None
    if is_other:
        raise input_error("this path is a file, but a folder is needed", where=str(out))
    try:
        try_folder(out)
    except OSError as error:
        raise unwritable(out, error) from None


def check_folders(out: Path, run: CommandRun) -> None:
    """Raise an InputError if a run must not write to its folder or to that of `--figures`."""
    check_folder(out, run)
    if (of_figures := FIGURES.get()) is not None:
        folder = of_figures.folder
        check_folder(folder, _run_of_figures(folder, out, run))


def prepare_folder(out: Path, run: CommandRun) -> None:
    """Create the folder of a study if it does not exist, so that its ledger can be opened there.

    Raises:
        InputError: the run must not write to `out`, or `out` cannot be written to.
    """
    check_folders(out, run)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise unwritable(out, error) from None


@contextmanager
def result_folder(out: Path, run: CommandRun, kept: str = "") -> Iterator[Path]:
    """Yield a temporary folder for results and, with `--figures`, write the pictures of its pages.

    Args, Raises: as `one_folder`.
    """
    of_figures = FIGURES.get()
    if of_figures is None:
        with one_folder(out, run, kept) as folder:
            yield folder
        return
    from wm_drake.report.publication import collected, write_figures

    place = of_figures.folder
    with (
        one_folder(place, _run_of_figures(place, out, run), kept) as drawn,
        one_folder(out, run, kept) as folder,
    ):
        with collected() as figures:
            yield folder
        write_figures(figures, drawn, columns=of_figures.columns, has_text=of_figures.has_text)


def _run_of_figures(folder: Path, out: Path, run: CommandRun) -> CommandRun:
    """Return the run that writes pictures; raise an InputError if their folder is that of `out`."""
    if folder.resolve() == out.resolve():
        raise input_error("must be another folder than --out", where="--figures")
    return CommandRun(f"{run.command} --figures", run.overwrite, run.identity)


@contextmanager
def one_folder(out: Path, run: CommandRun, kept: str = "") -> Iterator[Path]:
    """Yield a temporary folder beside `out`, and move its files to `out` if the block succeeds.

    If the block fails, `out` keeps its earlier files. If it succeeds, the files of the earlier run
    are removed, and `run.json` describes the new run. Temporary folders of earlier commands that
    were killed are removed first.

    Args:
        kept: What is kept if the results cannot be written, for the message.

    Raises:
        InputError: the run must not write to `out`, or `out` cannot be written to: checked before
            the block, or found when the block writes.
    """
    check_folder(out, run)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        place = out if out.is_dir() else out.parent
        _remove_leftovers(out, place)
        partial, lock = _locked_folder(out, place)
    except OSError as error:
        raise unwritable(out, error, kept) from None
    try:
        yield partial
        check_folder(out, run)  # another run may have ended in the meantime
        _move(partial, out, run)
    except OSError as error:
        if error.errno not in _NOT_WRITTEN:
            raise
        raise unwritable(out, error, kept) from None
    except InputError as error:  # a file of several MB, such as a record, has a message of its own
        raise InputError(
            replace(p, where=p.where.replace(str(partial), str(out))) for p in error.problems
        ) from None
    finally:
        shutil.rmtree(partial, ignore_errors=True)
        os.close(lock)


def _move(partial: Path, out: Path, run: CommandRun) -> None:
    """Move new results to a folder and remove those of the earlier run.

    `run.json` names the files of both runs until all is done, so a run that is killed here leaves a
    folder that the next run can replace.
    """
    out.mkdir(exist_ok=True)
    new = sorted(path.name for path in partial.iterdir())
    old = (_earlier_run(out) or {"files": []})["files"]
    foreign = [name for name in new if name not in old and (out / name).exists()]
    if foreign:
        raise input_error(
            f"holds a file '{foreign[0]}' that no run wrote; choose another folder with --out",
            where=str(out),
        )
    _write_run_file(partial, out, run, sorted({*old, *new}))
    for name in set(old) - set(new):
        (out / name).unlink(missing_ok=True)
    for name in new:
        (partial / name).replace(out / name)
    if set(old) - set(new):
        _write_run_file(partial, out, run, new)


def _write_run_file(partial: Path, out: Path, run: CommandRun, files: list[str]) -> None:
    content = {
        "format": FORMAT,
        "command": run.command,
        "command_line": run.command_line,
        "date": now(),
        "version": version(),
        "revision": source_revision(),
        "identity": dict(run.identity),
        "options": dict(run.options),
        "files": files,
    }
    path = partial / RUN_FILE
    path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    path.replace(out / RUN_FILE)


def _earlier_run(out: Path) -> dict[str, Any] | None:
    """Return the content of `run.json`, or None if the folder does not exist or has none."""
    path = out / RUN_FILE
    try:
        if not path.exists():
            return None
        content = json.loads(path.read_text(encoding="utf-8"))
        texts = [content["command"], content["date"], *content["identity"].values()]
        files = content["files"]
        plain = all(Path(name).name == name for name in files)
    except OSError as error:
        raise unwritable(out, error) from None
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        content = None
    if content is None or not plain or not all(isinstance(text, str) for text in texts):
        raise input_error(
            f"holds a file '{RUN_FILE}' that does not describe a run; choose another folder with "
            "--out",
            where=str(out),
        )
    return dict(content)


def _check_has_no_other_files(out: Path, run: CommandRun) -> None:
    """Raise an InputError for a folder without `run.json` that holds visible files.

    The ledger of an unfinished study is allowed for a command that has one, since the ledger itself
    is checked when it is opened.
    """
    try:
        names = sorted(path.name for path in out.iterdir()) if out.is_dir() else []
    except OSError as error:
        raise unwritable(out, error) from None
    allowed = (".", LEDGER) if run.identity else (".",)
    others = [name for name in names if not name.startswith(allowed)]
    if others:
        what = "an unfinished study" if others[0].startswith(LEDGER) else f"'{others[0]}'"
        raise input_error(
            f"holds {what}, which this command did not write; choose an empty or a new folder with "
            "--out",
            where=str(out),
        )


def _locked_folder(out: Path, place: Path) -> tuple[Path, int]:
    """Return a new temporary folder and the lock that says that this process uses it.

    The system releases the lock when the process ends, however it ends. Another process may remove
    the folder before it is locked, so a few are tried.

    Raises:
        OSError: the file system has no locks.
    """
    for _ in range(TRIES):
        partial = Path(tempfile.mkdtemp(prefix=f".{out.name}-", suffix=SUFFIX, dir=place))
        lock = _locked(partial)
        if lock is not None:
            return partial, lock
        shutil.rmtree(partial, ignore_errors=True)
    raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))


def _remove_leftovers(out: Path, place: Path) -> None:
    """Remove the temporary folders for `out` whose process has ended without removing them."""
    name = re.compile(rf"\.{re.escape(out.name)}-[a-z0-9_]{{8}}{re.escape(SUFFIX)}")
    for path in place.iterdir():
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
