"""Runs the event loop (asyncio) on a thread of its own, with a thread-safe queue of callbacks for it."""

from __future__ import annotations

import asyncio
import contextlib
import threading
import time
from collections import deque
from collections.abc import Callable, Coroutine
from typing import Any

#: Seconds that connections have to end in.
END_WITHIN_S = 3.0
#: Seconds of one turn of what is handed over: then what has come from pages is read, such as a stop.
TURN_S = 0.005


class LoopThread:
    """Runs the web side; `ended` is called when that ends, for any reason."""

    def __init__(self, ended: Callable[[], None]) -> None:
        self._loop = asyncio.new_event_loop()
        self._ended = ended
        self._posted: deque[tuple[Callable[..., None], tuple[Any, ...]]] = deque()
        self._is_woken = False
        self._until: asyncio.Future[None] = self._loop.create_future()
        self._thread: threading.Thread | None = None
        #: 1 where the pages' side failed.
        self.exit_code = 0

    def start(self, serve: Callable[[asyncio.Future[None]], Coroutine[Any, Any, None]]) -> None:
        """Run `serve`, which is to end when the future that it gets is done."""
        self._thread = threading.Thread(target=self._run, args=(serve,), name="pages", daemon=True)
        self._thread.start()

    def _run(self, serve: Callable[[asyncio.Future[None]], Coroutine[Any, Any, None]]) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(serve(self._until))
        except BaseException:
            self.exit_code = 1
            raise
        finally:
            self._loop.close()
            self._ended()

    def post(self, callback: Callable[..., None], *arguments: Any) -> None:
        """Schedule a call on the loop, in the order of posting; safe from every thread.

        The loop is woken once for all calls that are queued before it runs. One that fails is reported to the
        loop's exception handler. After the loop has ended none is carried out.
        """
        self._posted.append((callback, arguments))
        if not self._is_woken:
            self._is_woken = True
            with contextlib.suppress(RuntimeError):  # the loop has ended: nobody is there to be told
                self._loop.call_soon_threadsafe(self._run_posted)

    def _run_posted(self) -> None:
        self._is_woken = False
        end = time.monotonic() + TURN_S
        for _ in range(len(self._posted)):
            if time.monotonic() >= end:
                self._is_woken = True
                self._loop.call_soon(self._run_posted)
                return
            callback, arguments = self._posted.popleft()
            try:
                callback(*arguments)
            except Exception as defect:
                self._loop.call_exception_handler(
                    {"message": "a posted callback failed", "exception": defect}
                )

    def close(self) -> None:
        """Release the loop, unless the thread still runs."""
        if self._thread is None or not self._thread.is_alive():
            self._loop.close()

    def stop(self) -> None:
        """End the web side, from another thread; waits up to `END_WITHIN_S`."""
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(self._finish)
        if self._thread is not None:
            self._thread.join(END_WITHIN_S)
        else:
            self._loop.close()

    def _finish(self) -> None:
        if not self._until.done():
            self._until.set_result(None)
