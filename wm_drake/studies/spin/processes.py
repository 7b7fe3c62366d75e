"""Worker processes: one function over many items, each in a new Python interpreter."""

import multiprocessing
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from typing import Any

from wm_drake.errors import WmDrakeError

Function = Callable[[Any, Callable[[float], None]], Any]
"""Function of an item, and of a callable that takes the finished fraction of it."""


class WorkerProcessError(WmDrakeError):
    """A worker process ended before it had sent its result."""


def can_start_processes() -> bool:
    """Return whether this process may start others; a daemon process of Python may not."""
    return not multiprocessing.current_process().daemon


def map_in_processes(
    function: Function, items: Sequence[Any], count: int, progress: Callable[[int, float], None]
) -> list[Any]:
    """Return the value of a function for each item, computed in worker processes.

    The interpreters are new ones, since a fork of a process with threads or with Drake is not
    safe. The workers end with this call, however it ends; other child processes are not touched.

    Args:
        function: Function of a module, called with an item and a callable for its progress.
        items: Arguments, which can be pickled.
        progress: Called here with the index of an item and the fraction of it that is done.

    Raises:
        WorkerProcessError: a worker ended before its time, such as for lack of memory.
    """
    workers = [_Worker(function) for _ in range(min(count, len(items)))]
    try:
        waiting = list(enumerate(items))[::-1]
        for worker in workers:
            worker.send(waiting.pop())
        values: dict[int, Any] = {}
        while len(values) < len(items):
            ready = wait([worker.connection for worker in workers])
            for worker in workers:
                if worker.connection not in ready:
                    continue
                index, fraction, value = worker.received()
                if fraction is not None:
                    progress(index, fraction)
                    continue
                values[index] = value
                if waiting:
                    worker.send(waiting.pop())
        return [values[index] for index in range(len(items))]
    finally:
        for worker in workers:
            worker.end()


class _Worker:
    """A worker process and the connection to it."""

    def __init__(self, function: Function) -> None:
        """Start a process that evaluates a function for each item that it receives."""
        context = multiprocessing.get_context("spawn")
        self.connection, remote = context.Pipe()
        self._process = context.Process(target=_serve, args=(remote, function))
        self._process.start()
        remote.close()  # so that the end of the process is the end of the connection

    def send(self, item: tuple[int, Any]) -> None:
        """Send an index and an item."""
        with suppress(OSError):  # of a process that has ended; `received` raises
            self.connection.send(item)

    def received(self) -> tuple[int, float | None, Any]:
        """Return index, finished fraction (None with the value) and value of a message.

        Raises the error of the function if the function failed.
        """
        try:
            index, fraction, value, error = self.connection.recv()
        except (EOFError, OSError):
            self._process.join()
            raise WorkerProcessError(
                f"a worker process ended before its result, with exit code {self._process.exitcode}"
                '; a script that uses several workers needs `if __name__ == "__main__":`'
            ) from None
        if error is not None:
            raise error
        return index, fraction, value

    def end(self) -> None:
        """End the process; its results have been received or are not needed."""
        self.connection.close()
        self._process.terminate()
        self._process.join()


def _serve(connection: Connection, function: Function) -> None:
    """Evaluate a function for each received item until the connection is closed."""
    try:
        while True:
            index, item = connection.recv()

            def report(fraction: float, index: int = index) -> None:
                connection.send((index, fraction, None, None))

            try:
                value = function(item, report)
            except Exception as error:
                error.add_note(f"In a worker process:\n{traceback.format_exc()}")
                connection.send((index, None, None, error))
            else:
                connection.send((index, None, value, None))
    except (EOFError, OSError, KeyboardInterrupt):
        return
