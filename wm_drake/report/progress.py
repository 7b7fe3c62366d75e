"""Progress of long computations: a bar on a terminal, lines from time to time in a pipe."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import typer
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from wm_drake.report.terminal import Console, is_quiet

LINE_PERIOD = 10.0
"""Time between two lines of progress on a stream that is no terminal. [s]"""


def has_bars(console: Console) -> bool:
    """Return whether a console can show bars: a terminal or a notebook, and not quiet."""
    return not console.quiet and (console.is_terminal or console.is_jupyter)


class ProgressLines:
    """Lines of progress on standard error, where a bar cannot be drawn; silent if it can."""

    def __init__(self) -> None:
        """Start the clock; the first line appears after `LINE_PERIOD`."""
        self._silent = is_quiet() or has_bars(Console(stderr=True))
        self._begin = self._last = time.monotonic()

    def show(self, text: str) -> None:
        """Print a text and the elapsed time, if the last line is old enough."""
        now = time.monotonic()
        if self._silent or now - self._last < LINE_PERIOD:
            return
        self._last = now
        typer.echo(f"{text}, {now - self._begin:.0f} s", err=True)


def _bars(*columns: ProgressColumn) -> Progress:
    console = Console(stderr=True)
    return Progress(*columns, console=console, transient=True, disable=not has_bars(console))


@contextmanager
def progress_bar(total: int, what: str = "runs") -> Iterator[Callable[..., None]]:
    """Show progress on standard error, with the elapsed and the remaining time.

    Args:
        total: Number of steps of the whole computation.
        what: Name of the steps, shown before the bar.

    Yields:
        Function to call with the number of steps that are done, and with words to show beside it.

    Example:
        >>> import wm_drake as wm
        >>> with wm.progress_bar(total=3) as progress:
        ...     for done in range(1, 4):
        ...         progress(done)
    """
    columns = (
        TextColumn(what, markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[note]}", markup=False),
        TimeElapsedColumn(),
        TextColumn("remaining"),
        TimeRemainingColumn(),
    )
    lines = ProgressLines()
    with _bars(*columns) as bar:
        task = bar.add_task(what, total=total, note="")

        def update(done: int, note: str = "") -> None:
            bar.update(task, completed=done, note=note)
            lines.show(", ".join(filter(None, [f"{what}: {done} of {total}", note])))

        yield update


@contextmanager
def progress_bars(names: Sequence[str]) -> Iterator[Callable[[int, float], None]]:
    """Show progress of several computations on standard error, one bar for each.

    Yields:
        Function to call with the number of a computation and the fraction of it that is done.
    """
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeRemainingColumn(),
    )
    lines = ProgressLines()
    with _bars(*columns) as bar:
        tasks = [bar.add_task(name, total=1.0) for name in names]

        def update(index: int, fraction: float) -> None:
            bar.update(tasks[index], completed=fraction)
            lines.show(f"{names[index]}: {100 * fraction:.0f} %")

        yield update
