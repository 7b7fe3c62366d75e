"""Who runs next, one calculation at a time for each page; values that threads compute only once."""

import asyncio
import threading
from collections.abc import Callable, Hashable
from concurrent.futures import Executor, Future
from typing import Any, Generic, TypeVar


class OvertakenError(Exception):
    """A later request of the same page has taken the place of this one."""


class Turns:
    """Calculations of several pages on the threads of an executor.

    Of each page one calculation runs and one waits. A new one replaces the one that waits and keeps
    its place, so a page that asks often does not delay the others. Background work starts only if
    nothing else waits.
    """

    def __init__(self, executor: Executor, workers: int) -> None:
        """Use an executor with some workers."""
        self._executor, self._workers = executor, workers
        self._waiting: dict[str, tuple[Callable[[], Any], asyncio.Future[Any], bool]] = {}
        self._running: set[str] = set()
        self._tasks: set[asyncio.Task[None]] = set()  # the loop itself keeps no task alive

    async def take(
        self, page: str, calculate: Callable[[], Any], *, background: bool = False
    ) -> Any:
        """Return the result of a calculation when it is the turn of its page.

        Args:
            page: Identifier of the page.
            calculate: Called in a thread.
            background: Whether it starts only if no other calculation waits.

        Raises:
            OvertakenError: a later calculation of the page came before this one began.
        """
        future: asyncio.Future[Any] = asyncio.get_running_loop().create_future()
        earlier = self._waiting.get(page)
        if earlier is not None and not earlier[1].done():
            earlier[1].set_exception(OvertakenError())
        self._waiting[page] = calculate, future, background
        self._start()
        return await future

    def place(self, page: str) -> int:
        """Return how many calculations begin before the one that a page waits for; 0 if none."""
        waiting = list(self._waiting)
        return waiting.index(page) + len(self._running) if page in waiting else 0

    def _start(self) -> None:
        while len(self._running) < self._workers:
            page = self._next()
            if page is None:
                return
            calculate, future, _ = self._waiting.pop(page)
            self._running.add(page)
            task = asyncio.ensure_future(self._run(page, calculate, future))
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)

    def _next(self) -> str | None:
        """Return the page whose turn it is: in order, urgent work first; None if none waits."""
        ready = [page for page in self._waiting if page not in self._running]
        urgent = [page for page in ready if not self._waiting[page][2]]
        return next(iter(urgent or ready), None)

    async def _run(
        self, page: str, calculate: Callable[[], Any], future: "asyncio.Future[Any]"
    ) -> None:
        loop = asyncio.get_running_loop()
        try:
            result = await loop.run_in_executor(self._executor, calculate)
        except Exception as error:
            if not future.done():
                future.set_exception(error)
        else:
            if not future.done():
                future.set_result(result)
        finally:
            self._running.discard(page)
            self._start()


Value = TypeVar("Value")


class SharedValues(Generic[Value]):
    """A bounded cache for threads: who needs a value that is being computed, waits for it.

    The oldest value is dropped first. An error goes to all that wait, and is not kept.
    """

    def __init__(self, most: int) -> None:
        """Begin empty."""
        self._most = most
        self._futures: dict[Hashable, Future[Value]] = {}
        self._lock = threading.Lock()

    def get(self, key: Hashable, compute: Callable[[], Value]) -> Value:
        """Return the value of a key; compute it if no thread has. Other keys are not held up."""
        with self._lock:  # not held while a value is computed
            is_new = key not in self._futures
            future = self._futures.setdefault(key, Future())
        if is_new:
            self._compute_into(future, key, compute)
        return future.result()

    def ready(self) -> list[Value]:
        """Return all values that are computed."""
        with self._lock:
            futures = [future for future in self._futures.values() if future.done()]
        return [future.result() for future in futures]

    def _compute_into(
        self, future: "Future[Value]", key: Hashable, compute: Callable[[], Value]
    ) -> None:
        """Compute a value and give it, or the error, to all that wait for it."""
        try:
            future.set_result(compute())
        except BaseException as error:
            with self._lock:
                del self._futures[key]  # the next caller tries again
            if not isinstance(error, Exception):
                future.cancel()  # an interrupt of this thread is not one of those that wait
                raise
            future.set_exception(error)
            return
        with self._lock:
            while len(self._futures) > self._most:
                del self._futures[next(iter(self._futures))]
