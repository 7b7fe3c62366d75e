"""What a user sees while and after a long piece of work: a progress bar; result folders, complete or not there."""

import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from wm_drake.errors import input_error


@contextmanager
def progress_bar(total: int, what: str = "runs") -> Iterator[Callable[[int], None]]:
    """A bar on standard error with the time that is left; gives the function to call with how many are done."""
    columns = (
        TextColumn(what),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=total)
        yield lambda done: bar.update(task, completed=done)


@contextmanager
def result_folder(out: Path) -> Iterator[Path]:
    """Gives a temporary folder beside `out` to write in; its files move to `out` only if the block ends well.

    Raises:
        InputError: `out` is a file, or its place cannot be written to (found out before the block runs).
    """
    if out.exists() and not out.is_dir():
        raise input_error("is a file, needs to be a folder", where=str(out))
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        partial = Path(
            tempfile.mkdtemp(prefix=f".{out.name}-", dir=out if out.is_dir() else out.parent)
        )
    except OSError as error:
        raise input_error(f"cannot be written to: {error.strerror}", where=str(out)) from None
    try:
        yield partial
        try:
            out.mkdir(exist_ok=True)
            for path in sorted(partial.iterdir()):
                path.replace(out / path.name)
        except OSError as error:
            raise input_error(f"cannot be written to: {error.strerror}", where=str(out)) from None
    finally:
        shutil.rmtree(partial, ignore_errors=True)
