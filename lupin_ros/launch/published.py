"""What an orchestrator has published last, as plain data; loads without ROS."""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from lupin_ros.adapter.status_socket import read_status

if TYPE_CHECKING:
    from lupin_engine.runtime import OpenQuestion

#: How many of the last steps are kept.
MAX_STEPS = 50


@dataclass
class Published:
    """The last steps, oldest first; the dry run of each request; the mission catalogue. Empty if unknown."""

    steps: deque[dict[str, Any]] = field(default_factory=lambda: deque(maxlen=MAX_STEPS))
    possible: dict[str, Any] = field(default_factory=dict)
    offer: dict[str, Any] = field(default_factory=dict)

    @property
    def missions(self) -> list[dict[str, Any]]:
        """The fields of each mission's request; empty until received."""
        return list(self.offer.get("missions", ()))

    @property
    def now(self) -> float:
        """The time of the orchestrator's loop, as its deadlines have it; there must be a step.

        It is computed by the wall clock, because simulated time is not received here.
        """
        newest = self.steps[-1]
        return float(newest["time"]) + (time.time_ns() - int(newest["wall_ns"])) * 1e-9

    def asked(self) -> list[OpenQuestion]:
        """Return the open questions; there must be a step."""
        from lupin_engine.runtime import open_questions  # a seventh of the time that a pause takes

        return open_questions(self.steps[-1]["view"], self.now)


def published_here() -> Published | None:
    """Return what the orchestrator of this machine and ROS domain has published; None where none answers."""
    found = read_status()
    if found is None or not found["steps"]:  # it is starting
        return None
    return Published(deque(found["steps"], MAX_STEPS), found["possible"], found["missions"])
