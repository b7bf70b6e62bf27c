"""Publishes presence, recent commands and notifications to all pages, and saves notifications for a restart.

All of it runs on the event loop; nothing blocks.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Callable, Mapping
from typing import Annotated, Any, TypedDict

from lupin_gateway.people.notifications import Notification, Notifications
from lupin_gateway.people.presence import PersonRecord, Presence
from lupin_gateway.people.sources import NodeNotices, StepNotices, StopNotices

#: Who is here, and notifications (JSON in a std_msgs/String, latched).
PEOPLE_TOPIC, NOTIFICATIONS_TOPIC = "/lupin/hmi/people", "/lupin/hmi/notifications"
#: Services: which view a page shows, what was commanded, and that notifications are known.
HERE, COMMANDS, ACKNOWLEDGE = "/lupin/hmi/here", "/lupin/hmi/commands", "/lupin/hmi/acknowledge"
#: Commands that are remembered, and letters of what was sent with one.
MOST_COMMANDS, LONGEST_SENT = 200, 400

#: Tells a topic, or keeps a text for the next gateway.
Publish = Callable[[str, str], object]


class PeopleRecord(TypedDict):
    """Who is connected, and how often they commanded something."""

    people: list[PersonRecord]
    commands: int


class NotificationsRecord(TypedDict):
    """All that people are to know of, the oldest first."""

    notifications: list[Annotated[dict[str, Any], Notification]]


def _nobody(_: str, __: str) -> None:
    """Publish nothing."""


class People:
    """The people of one gateway."""

    def __init__(self, publish: Publish = _nobody, keep: Callable[[Any], object] = lambda _: None) -> None:
        """`publish` gets a topic and its JSON; `keep` the state that the next gateway will `restore`."""
        self.presence = Presence()
        self.notifications = Notifications()
        self.steps = StepNotices(self.notifications)
        self.nodes = NodeNotices(self.notifications)
        self.stops = StopNotices(self.notifications)
        self._publish = publish
        self._keep = keep
        self._commands: deque[dict[str, Any]] = deque(maxlen=MOST_COMMANDS)
        self._count = 0
        self._published_here: tuple[int, int] = (-1, -1)
        self._published_changes = -1

    def restore(self, kept: Mapping[str, Any]) -> None:
        """Load the state that an earlier gateway has saved; {} where there is none.

        Raises:
            TypeError, KeyError, ValueError: the data is not such a state.
        """
        if kept:
            boot, sequence = kept["seen"]
            self.notifications.restore(kept["notifications"])
            self.steps.seen = (str(boot), int(sequence))

    def commanded(self, line: Mapping[str, Any]) -> None:
        """Remember a line of the audit log, as one of the last `MOST_COMMANDS`."""
        self._count += 1
        sent = json.dumps(line.get("sent", {}), ensure_ascii=False, default=str)
        short = sent if len(sent) <= LONGEST_SENT else f"{sent[:LONGEST_SENT]}…"
        self._commands.append({**line, "sent": short, "number": self._count})

    def commands(self, arguments: Any) -> Mapping[str, Any]:
        """Return the response of `COMMANDS`: those after the number `since`."""
        since = arguments.get("since", 0) if isinstance(arguments, Mapping) else 0
        is_number = isinstance(since, int) and since <= self._count  # larger: of an earlier gateway
        return {"commands": [one for one in self._commands if one["number"] > (since if is_number else 0)]}

    def acknowledge(self, arguments: Any, who: str, at: float) -> Mapping[str, Any]:
        """Acknowledge the notifications in `ids`; return the response, a refusal for wrong ones."""
        ids = arguments.get("ids") if isinstance(arguments, Mapping) else None
        if not isinstance(ids, list) or not all(isinstance(each, int) for each in ids):
            return {"success": False, "message": "'ids' must be a list of numbers of notifications"}
        refused = self.notifications.acknowledge(ids, who, at)
        return {"success": not refused, "message": refused or f"acknowledged by {who}"}

    def publish_changes(self) -> None:
        """Publish and save all changes."""
        here = (self.presence.changes, self._count)
        if here != self._published_here:
            self._published_here = here
            state: PeopleRecord = {"people": self.presence.as_data(), "commands": self._count}
            self._publish(PEOPLE_TOPIC, json.dumps(state, ensure_ascii=False))
        if self.notifications.changes != self._published_changes:
            self._published_changes = self.notifications.changes
            kept: NotificationsRecord = {"notifications": self.notifications.as_data()}
            self._publish(NOTIFICATIONS_TOPIC, json.dumps(kept, ensure_ascii=False))
            self._keep({**kept, "seen": self.steps.seen})
