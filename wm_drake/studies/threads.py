"""Limit of threads for functions that work on many small matrices."""

import functools
from collections.abc import Callable
from typing import ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

Arguments = ParamSpec("Arguments")
Value = TypeVar("Value")


def on_one_thread(function: Callable[Arguments, Value]) -> Callable[Arguments, Value]:
    """Return a function whose matrix products use one thread: small ones are slower on several."""

    @functools.wraps(function)
    def limited(*arguments: Arguments.args, **options: Arguments.kwargs) -> Value:
        with threadpool_limits(1, "blas"):
            return function(*arguments, **options)

    return limited
