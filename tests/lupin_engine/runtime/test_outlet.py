"""What plugins report becomes events of the loop."""

from __future__ import annotations

from typing import Any

from lupin_engine.machine.event import Event
from lupin_engine.runtime.engine import MAX_DETAIL, EngineOutlet


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


def test_what_a_server_says_is_cut_where_it_comes_in() -> None:
    """A megabyte of it would stand in the log, in every record of the step, and in the published state."""
    queue = Queue()
    outlet = EngineOutlet(queue, lambda: None)  # type: ignore[arg-type]
    outlet.failed("1", "jammed", "x" * 1_000_000)
    outlet.progress("1", "x" * 1_000_000)
    outlet.failed("1", "jammed", "x" * MAX_DETAIL)
    cut = "x" * MAX_DETAIL + "..."
    assert [event.data["detail"] for event in queue.posted] == [cut, cut, "x" * MAX_DETAIL]
