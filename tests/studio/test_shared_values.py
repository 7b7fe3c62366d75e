"""Values that threads share: computed once, without holding up others, bounded, tried again."""

import threading
from concurrent.futures import CancelledError, ThreadPoolExecutor

import pytest

from wm_drake.studio.turns import SharedValues


def failing(error):
    """Return a computation that raises an error."""

    def compute():
        raise error

    return compute


def test_value_that_is_computed_does_not_hold_up_others():
    values, go_on, computed = SharedValues(4), threading.Event(), []

    def slow():
        assert go_on.wait(20.0)
        computed.append("slow")
        return ["slow"]

    with ThreadPoolExecutor(2) as pool:
        waiting = [pool.submit(values.get, "slow", slow) for _ in range(2)]
        assert values.get("fast", lambda: ["fast"]) == ["fast"]
        assert values.ready() == [["fast"]]
        go_on.set()
        assert waiting[0].result() is waiting[1].result()
    assert computed == ["slow"]


def test_error_is_raised_and_the_value_is_computed_again():
    values = SharedValues(4)
    with pytest.raises(ValueError, match="is wrong"):
        values.get("key", failing(ValueError("is wrong")))
    assert values.ready() == []
    assert values.get("key", lambda: 1) == 1


def test_interrupt_of_one_thread_does_not_interrupt_those_that_wait():
    values, started, go_on = SharedValues(4), threading.Event(), threading.Event()

    def interrupted():
        started.set()
        assert go_on.wait(20.0)
        raise KeyboardInterrupt

    with ThreadPoolExecutor(2) as pool:
        first = pool.submit(values.get, "key", interrupted)
        assert started.wait(20.0)
        second = pool.submit(values.get, "key", lambda: 2)
        go_on.set()
        assert isinstance(first.exception(), KeyboardInterrupt)
        # it waited for the first, or came after it
        assert isinstance(second.exception(), CancelledError) or second.result() == 2
    assert values.get("key", lambda: 3) in (2, 3)


def test_oldest_values_are_dropped():
    values = SharedValues(3)
    for number in range(5):
        values.get(number, lambda number=number: number)
    assert values.ready() == [2, 3, 4]
