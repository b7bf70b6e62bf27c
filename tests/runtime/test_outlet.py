"""What plugins report becomes events of the loop."""

from __future__ import annotations

from typing import Any

from lupin_engine.machine.event import Event
from lupin_engine.runtime.engine import EngineOutlet


class Queue:
    """The part of the loop that an outlet knows."""

    def __init__(self) -> None:
        self.posted: list[Any] = []

    def post(self, event: Event) -> None:
        """Keep an event."""
        self.posted.append(event)


def test_an_event_of_a_plugin_is_posted_under_its_full_name() -> None:
    """With its fields, and whoever owns the loop is woken."""
    queue = Queue()
    outlet = EngineOutlet(queue, lambda: queue.posted.append("woken"))  # type: ignore[arg-type]
    outlet.event("nav.blocked", {"seconds": 4.0})
    assert queue.posted == [Event("nav.blocked", {"seconds": 4.0}), "woken"]
