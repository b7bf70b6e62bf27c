"""What displays ask the orchestrator about the chart that runs: drawings of it, and why something can happen.

Nothing changes by either. A drawing is made on a thread of its own, one after the other, because it takes
longer than a stop may wait.
"""

from __future__ import annotations

import json
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

from lupin_engine.errors import LupinError
from lupin_engine.machine import Machine
from lupin_engine.missions import LoadedMissions
from lupin_engine.runtime import Clock, explanation
from lupin_ros.adapter.node import RosNode
from lupin_ros.interfaces.definitions import interface_class
from lupin_ros.service import messages
from lupin_ros.service.chart_record import check_chart
from lupin_ros.service.names import DRAW_SERVICE, DRAW_TYPE, EXPLAIN_SERVICE, EXPLAIN_TYPE

#: Drawings that may be asked for at once; who asks for another one is told so.
MOST_WAITING = 8
#: A drawing that was asked for longer ago, in seconds, is not made: nobody waits for it any more.
STALE_AFTER_S = 10.0

_USUAL_INTERVAL = sys.getswitchinterval()


class Displays:
    """The services for displays. `running` gives what runs now: the missions and their machine."""

    def __init__(
        self, ros: RosNode, clock: Clock, running: Callable[[], tuple[LoadedMissions, Machine]]
    ) -> None:
        self._ros = ros
        self._clock = clock
        self._running = running
        self._pencil = threading.Lock()
        self._waiting = 0
        try:
            draw, explain = interface_class(DRAW_TYPE), interface_class(EXPLAIN_TYPE)
        except LupinError as problem:  # a workspace that was built before there were these
            ros.log.error("displays cannot fold or explain the chart", problem=str(problem))
            return
        ros.serve_later(draw, DRAW_SERVICE, self._draw, stale_after=STALE_AFTER_S, refuse=_refuse)
        ros.serve(explain, EXPLAIN_SERVICE, self._explain)

    def _explain(self, request: Any, response: Any) -> Any:
        loaded, machine = self._running()
        response.chart = loaded.hash
        try:
            check_chart(request.chart, loaded)
            told = explanation(machine, request.element, self._clock.now())
        except LupinError as problem:
            return _refuse(response, str(problem))
        return messages.write(response, {"success": True, "explanation": json.dumps(told, default=str)})

    def _draw(self, request: Any, response: Any, answer: Callable[[Any], None]) -> None:
        loaded, _ = self._running()
        response.chart = loaded.hash
        try:
            check_chart(request.chart, loaded)
            if self._waiting >= MOST_WAITING:
                raise LupinError(f"{MOST_WAITING} drawings are asked for already; wait for a moment")
        except LupinError as problem:
            answer(_refuse(response, str(problem)))
            return
        self._waiting += 1
        drawn = partial(self._drawn, response, answer)
        target = partial(self._make, loaded, frozenset(request.folded), drawn)
        threading.Thread(target=target, name="drawing", daemon=True).start()

    def _make(
        self, loaded: LoadedMissions, folded: frozenset[str], drawn: Callable[[str, str], None]
    ) -> None:
        """Draw; on a thread of its own, which the start of the node does not wait for."""
        from lupin_engine.diagram import folded_svg

        svg = problem = ""
        try:
            with self._pencil, giving_way():
                svg = folded_svg(loaded.chart, folded)
        except LupinError as wrong:
            problem = str(wrong)
        except Exception as wrong:
            problem = f"the chart cannot be drawn: {wrong!r}"
        self._ros.post(lambda: drawn(svg, problem))

    def _drawn(self, response: Any, answer: Callable[[Any], None], svg: str, problem: str) -> None:
        self._waiting -= 1
        answer(messages.write(response, {"success": bool(svg), "message": problem, "svg": svg}))


@contextmanager
def giving_way() -> Iterator[None]:
    """Let other threads wait for the interpreter a tenth as long as they usually do: 0.5 ms, not 5 ms."""
    sys.setswitchinterval(_USUAL_INTERVAL / 10)
    try:
        yield
    finally:
        sys.setswitchinterval(_USUAL_INTERVAL)


def _refuse(response: Any, reason: str) -> Any:
    response.message = reason
    return response
