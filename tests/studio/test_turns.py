"""Turns of pages: the latest wish wins, pages come in order, background work comes last."""

import asyncio
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from wm_drake.studio.turns import OvertakenError, Turns


def played(play):
    """Play with one worker that is busy until the event is set; return who ran, in order."""
    done, free = [], threading.Event()

    async def game():
        with ThreadPoolExecutor(1) as pool:
            turns = Turns(pool, 1)

            def ask(page, number, **options):
                calculate = lambda: done.append((page, number)) or number  # noqa: E731
                return asyncio.ensure_future(turns.take(page, calculate, **options))

            busy = asyncio.ensure_future(turns.take("busy", free.wait))
            await asyncio.sleep(0)
            asked = play(ask)
            await asyncio.sleep(0)
            free.set()
            await busy
            return await asyncio.gather(*asked, return_exceptions=True)

    return asyncio.run(game()), done


def test_latest_wish_of_a_page_wins():
    results, done = played(lambda ask: [ask("a", number) for number in range(5)])
    assert [type(result) for result in results[:4]] == [OvertakenError] * 4
    assert results[4] == 4
    assert done == [("a", 4)]


def test_eager_page_does_not_delay_the_others():
    wishes = [("a", 0), ("b", 1), ("a", 2), ("c", 3), ("a", 4)]
    _, done = played(lambda ask: [ask(*wish) for wish in wishes])
    assert done == [("a", 4), ("b", 1), ("c", 3)]


def test_background_work_comes_last():
    _, done = played(lambda ask: [ask("r", 0, background=True), ask("a", 1), ask("b", 2)])
    assert done == [("a", 1), ("b", 2), ("r", 0)]


def test_error_reaches_only_the_page_that_asked():
    async def game():
        with ThreadPoolExecutor(1) as pool:
            turns = Turns(pool, 1)
            with pytest.raises(ZeroDivisionError):
                await turns.take("a", lambda: 1 // 0)
            return await turns.take("a", lambda: "well")

    assert asyncio.run(game()) == "well"
