"""Callbacks of ports and events that do not keep their system, and so its diagram, alive.

Drake holds a callback in C++, where Python's garbage collector cannot see it. If the callback
holds the system, both live for ever (Drake 1.51). A class of a system also needs the line
``__slots__ = NO_SLOTS``: without it Python 3.11 visits the dictionary of the system twice, and
then takes it for one that is still in use.
"""

import weakref
from collections.abc import Callable
from typing import Any

NO_SLOTS: tuple[str, ...] = ()
"""`__slots__` of the class of a system: a system has the dictionary of Drake's class."""


def callback(method: Callable[..., Any], *more: Any) -> Callable[..., Any]:
    """Return a function that calls a bound method and does not hold the object of the method.

    Args:
        method: The bound method.
        more: Further arguments of each call.
    """
    system: Any = weakref.ref(method.__self__)  # type: ignore[attr-defined]
    function: Any = method.__func__  # type: ignore[attr-defined]

    def call(*arguments: Any) -> Any:
        return function(system(), *arguments, *more)

    return call
