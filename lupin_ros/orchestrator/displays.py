"""Serves displays: drawings of the running chart with folded states, and explanations of its elements.

Neither changes the machine. Drawings are made one at a time, on threads of their own: a stop cannot wait for
one.
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
from lupin_engine.missions import LoadedMissions
from lupin_engine.runtime import Clock, explanation
from lupin_ros.adapter.node import RosNode
from lupin_ros.interfaces.definitions import interface_class
from lupin_ros.orchestrator.loop import Loop
from lupin_ros.service import messages
from lupin_ros.service.chart_record import check_chart
from lupin_ros.service.names import DRAW_SERVICE, DRAW_TYPE, EXPLAIN_SERVICE, EXPLAIN_TYPE

#: The limit of drawings that wait or are made; one more is refused.
MOST_WAITING = 8
#: A request for a drawing that is older, in seconds, is refused: nobody waits for it any more.
STALE_AFTER_S = 10.0

_USUAL_INTERVAL = sys.getswitchinterval()


class Displays:
    """The services for displays of what runs in a loop.

    Requests beyond `MOST_WAITING` drawings are refused, and those for a drawing older than `STALE_AFTER_S`.
    """

    def __init__(self, ros: RosNode, clock: Clock, loop: Loop) -> None:
        self._ros = ros
        self._clock = clock
        self._loop = loop
        self._one_at_a_time = threading.Lock()
        self._waiting = 0
        try:
            draw, explain = interface_class(DRAW_TYPE), interface_class(EXPLAIN_TYPE)
        except LupinError as problem:  # a workspace that was built before these types existed
            ros.log.error("displays cannot fold or explain the chart", problem=str(problem))
            return
        ros.serve_later(
            draw, DRAW_SERVICE, self._draw, stale_after=STALE_AFTER_S, refuse=_refuse, in_every_state=True
        )
        ros.serve(explain, EXPLAIN_SERVICE, self._explain, in_every_state=True)

    def _explain(self, request: Any, response: Any) -> Any:
        loaded, machine = self._loop.loaded, self._loop.machine
        response.chart = loaded.hash
        try:
            check_chart(request.chart, loaded)
            explained = explanation(machine, request.element, self._clock.now())
        except LupinError as problem:
            return _refuse(response, str(problem))
        return messages.write(response, {"success": True, "explanation": json.dumps(explained, default=str)})

    def _draw(self, request: Any, response: Any, answer: Callable[[Any], None]) -> None:
        loaded = self._loop.loaded
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
        """Draw, and post the drawing or the problem; runs on a thread of its own."""
        from lupin_engine.diagram import folded_svg

        svg = problem = ""
        try:
            with self._one_at_a_time, short_switch_interval():
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
def short_switch_interval() -> Iterator[None]:
    """Shorten the interpreter's switch interval to a tenth: other threads wait 0.5 ms for it, not 5 ms."""
    sys.setswitchinterval(_USUAL_INTERVAL / 10)
    try:
        yield
    finally:
        sys.setswitchinterval(_USUAL_INTERVAL)


def _refuse(response: Any, reason: str) -> Any:
    response.message = reason
    return response
