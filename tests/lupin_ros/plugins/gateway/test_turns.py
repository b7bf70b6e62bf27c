"""What ROS hands to the pages' side: however much it is, what pages say is heard between."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Awaitable

import pytest

from lupin_gateway.node.loop import LoopThread


def test_a_flood_leaves_turns_to_others() -> None:
    """A stop that comes while a second of work waits is not told a second later."""
    waited, ended = list[float](), threading.Event()
    loop = LoopThread(lambda: None)

    def work() -> None:
        end = time.monotonic() + 0.001
        while time.monotonic() < end:
            pass

    async def serve(until: Awaitable[None]) -> None:
        for _ in range(1000):
            loop.post(work)
        loop.post(ended.set)
        for _ in range(100):
            at = time.monotonic()
            await asyncio.sleep(0)  # one turn of the loop, as one that reads what a page has sent
            waited.append(time.monotonic() - at)
        await until

    loop.start(serve)
    assert ended.wait(30)
    loop.stop()
    loop._loop.close()
    assert max(waited) < 0.5  # all of it at once takes a second


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_pages_side_that_fails_ends_the_process_with_an_error() -> None:
    """The node is told to end, and who supervises it sees that it did not end well."""
    ended = threading.Event()
    loop = LoopThread(ended.set)

    async def serve(_: Awaitable[None]) -> None:
        raise RuntimeError("a part ended by itself")

    loop.start(serve)
    assert ended.wait(30)
    assert loop.exit_code == 1
    loop.stop()
