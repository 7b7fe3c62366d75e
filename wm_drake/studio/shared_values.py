"""Values that several threads need and one of them computes."""

import threading
from collections.abc import Callable, Hashable
from concurrent.futures import Future
from typing import Generic, TypeVar

Value = TypeVar("Value")


class SharedValues(Generic[Value]):
    """A bounded cache for threads: who needs a value that is being computed, waits for it.

    The oldest value is dropped first. An error goes to all that wait, and is not kept.
    """

    def __init__(self, most: int) -> None:
        """Begin empty.

        Args:
            most: Largest number of values that are kept.
        """
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
