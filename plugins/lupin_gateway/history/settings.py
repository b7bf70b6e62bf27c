"""Parses the parameter `history`: the topics to record, with their limits."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from lupin_engine.errors import Problems, UsageError

_ENTRY = re.compile(
    r"(?P<name>/\S+) (?P<type>\w+/msg/\w+) (?P<limit>[1-9]\d{0,2}) MB"
    r"(?P<on_change> on change)?(?: every (?P<every>\d+(?:\.\d+)?) s)?"
)


@dataclass(frozen=True)
class HistoryTopic:
    """A topic to record: its type, and its limit in bytes.

    With `every` at most one message is kept in so many seconds (on /tf: of each first child frame). With
    `on_change` every message that differs from the last one is kept; bytes of its header's stamp are ignored.
    """

    name: str
    type: str
    limit: int
    every: float = 0.0
    on_change: bool = False


def history_topics(entries: Sequence[str]) -> list[HistoryTopic]:
    """Return the topics of the parameter `history`.

    Raises:
        UsageError: all wrong entries.
    """
    problems, found = Problems(UsageError), dict[str, HistoryTopic]()
    for entry in entries:
        match = _ENTRY.fullmatch(entry)
        if match is None:
            wanted = "TOPIC TYPE NUMBER MB [on change] [every NUMBER s]"
            example = "/twin/state lupin_msgs/msg/TwinState 8 MB every 5 s"
            problems.add(f"history: {entry!r} is no {wanted}, such as {example}")
        elif match["name"] in found:
            problems.add(f"history: {match['name']} is named twice")
        else:
            limit, every = int(match["limit"]) * 1_000_000, float(match["every"] or 0.0)
            found[match["name"]] = HistoryTopic(
                match["name"], match["type"], limit, every, match["on_change"] is not None
            )
    problems.raise_any()
    return list(found.values())
