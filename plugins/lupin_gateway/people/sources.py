"""Makes notifications of the mission's steps, of nodes' diagnostics, and of pages' stops.

Pure: times are in seconds since 1970; for nodes also of a steady clock.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from lupin_gateway.people.notifications import ERROR, WARNING, Notifications

#: A node that was heard once a second and is silent for so long is lost, in seconds.
SILENT_S = 5.0
#: Levels of a diagnostic_msgs/DiagnosticStatus: all is well, and ended by itself.
OK, STALE = 0, 3
#: The end of the name of a status about a machine.
MACHINE = ": machine"


class StepNotices:
    """Notifies of codes with a severity of warning or above, and of questions that wait for an answer."""

    def __init__(self, notifications: Notifications) -> None:
        self._notifications = notifications
        #: The last step that was taken notice of: the boot of its orchestrator, and its number.
        self.seen = ("", -1)
        #: The open questions, by the states that ask them.
        self.asked: Mapping[str, str] = {}

    def take(self, record: Mapping[str, Any]) -> None:
        """Take a record of the topic of steps; ones of the same session with an old number are ignored."""
        step, boot, at = record["step"], str(record["boot"]), float(record["wall_ns"]) * 1e-9
        if boot == self.seen[0] and step["sequence"] <= self.seen[1]:
            return
        self.seen = (boot, int(step["sequence"]))
        codes = () if self._is_stop_of_a_page(step) else step.get("codes", ())
        for code in codes:
            if code["severity"] >= WARNING:
                text = ": ".join(filter(None, [code["label"], code["detail"]]))
                about = f"{code['code']} {code['target']}".strip()
                self._notifications.add("code", about, min(code["severity"], ERROR), text, at)
        asked = self.asked = {one["state"]: one["question"] for one in record["view"].get("asking", ())}
        for state in self._notifications.lasting("question"):
            if state not in asked:
                self._notifications.end("question", state, at)
        for state, question in asked.items():
            if state not in self._notifications.lasting("question"):
                self._notifications.add("question", state, WARNING, question, at)

    def _is_stop_of_a_page(self, step: Mapping[str, Any]) -> bool:
        """Return whether a step only repeats a stop of a page, which is notified already."""
        engages = step.get("event") == "value" and step.get("data", {}).get("value") is True
        held = any(note.startswith("hold ") for note in step.get("notes", ()))
        return engages and held and bool(self._notifications.lasting("stop"))


class NodeNotices:
    """Notifies of nodes that are silent, and of machines with a warning (such as a low disk)."""

    def __init__(self, notifications: Notifications) -> None:
        self._notifications = notifications
        self._heard: dict[str, float] = {}

    def take(self, status: Mapping[str, Any], at: float, now: float) -> None:
        """Take a status of /diagnostics, `now` of the steady clock; those of nodes and of machines count."""
        name, level, machine = str(status["name"]), int(status["level"]), str(status["hardware_id"])
        if not name.startswith("/"):
            return
        if name.endswith(MACHINE):
            if level in (OK, STALE):
                self._notifications.end("machine", machine, at)
            elif machine not in self._notifications.lasting("machine"):
                self._notifications.add("machine", machine, WARNING, str(status["message"]), at)
            return
        if ": " in name:  # a trouble of a node, which the mission's codes report
            return
        self._notifications.end("node", name, at)
        if level == STALE:
            self._heard.pop(name, None)
        else:
            self._heard[name] = now

    def look(self, at: float, now: float) -> None:
        """Notify of nodes that were silent for `SILENT_S`."""
        for name, heard in list(self._heard.items()):
            if now - heard > SILENT_S:
                del self._heard[name]
                silent_since = at - (now - heard)
                self._notifications.add("node", name, ERROR, f"{name} is not heard any more", silent_since)


class StopNotices:
    """Notifies of engaged stops, by the names of the pages that engaged them."""

    def __init__(self, notifications: Notifications) -> None:
        self._notifications = notifications
        self._before: frozenset[str] = frozenset()

    def take(self, engaged: Collection[str], at: float) -> None:
        """Take the names of the stops that are engaged now."""
        now = frozenset(engaged)
        for name in sorted(now - self._before - set(self._notifications.lasting("stop"))):
            self._notifications.add("stop", name, ERROR, f"stopped by {name}", at)
        for name in self._notifications.lasting("stop"):
            if name not in now:
                self._notifications.end("stop", name, at)
        self._before = now
