"""Notifications that stay until a user acknowledges them; at most `MOST`, shared by all pages.

Beyond that, acknowledged ones are dropped first, then the oldest. Pure: times are in seconds since 1970.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

#: Notifications that are kept; the oldest go first, those that are acknowledged before the others.
MOST = 200
#: Letters of a text.
LONGEST = 400
#: Severities, as the table of codes has them.
WARNING, ERROR = 1, 2


@dataclass(frozen=True)
class Notification:
    """A notification: its kind (`code`, `stop`, `node`, ...), subject (`about`) and text.

    `first` and `last` are when it occurred first and last, of so many `times`; `over` is when it ended, None
    while it lasts, or where an end is never reported. `by` is who acknowledged it, `acknowledged` when.
    """

    id: int
    kind: str
    about: str
    severity: int
    text: str
    first: float
    last: float
    times: int = 1
    over: float | None = None
    by: str = ""
    acknowledged: float | None = None


class Notifications:
    """All that are kept, the oldest first."""

    def __init__(self) -> None:
        self._all: dict[int, Notification] = {}
        self._next = 1
        #: How often anything has changed.
        self.changes = 0

    def add(self, kind: str, about: str, severity: int, text: str, at: float) -> None:
        """Add a notification; where the same one is not acknowledged yet, count it once more instead."""
        text = text[:LONGEST]
        self.changes += 1
        before = self._open(kind, about)
        if before is not None:
            again = replace(before, text=text, last=at, times=before.times + 1, over=None)
            self._all[before.id] = again
            return
        self._all[self._next] = Notification(self._next, kind, about, severity, text, at, at)
        self._next += 1
        if len(self._all) > MOST:
            del self._all[min(self._all.values(), key=lambda one: (one.acknowledged is None, one.id)).id]

    def _open(self, kind: str, about: str) -> Notification | None:
        """Return the newest such notification that is not acknowledged; None without one."""
        found = (one for one in reversed(self._all.values()) if (one.kind, one.about) == (kind, about))
        return next((one for one in found if one.acknowledged is None), None)

    def lasting(self, kind: str) -> list[str]:
        """Return the subjects of a kind whose notifications have not ended."""
        return [one.about for one in self._all.values() if one.kind == kind and one.over is None]

    def end(self, kind: str, about: str, at: float) -> None:
        """Mark as ended; it still waits to be acknowledged."""
        for one in list(self._all.values()):
            if (one.kind, one.about) == (kind, about) and one.over is None:
                self.changes += 1
                self._all[one.id] = replace(one, over=at)

    def acknowledge(self, ids: Collection[int], who: str, at: float) -> str:
        """Mark all as acknowledged by a person; return '', or why none is: an unknown id, or no id."""
        unknown = sorted(set(ids) - self._all.keys())
        if unknown or not ids:
            listed = ", ".join(map(str, unknown)) or "nothing was named"
            return f"no such notification: {listed}; nothing was acknowledged"
        self.changes += 1
        for each in ids:
            if self._all[each].acknowledged is None:
                self._all[each] = replace(self._all[each], by=who, acknowledged=at)
        return ""

    def as_data(self) -> list[dict[str, Any]]:
        """Return all as data."""
        return [asdict(one) for one in self._all.values()]

    def restore(self, saved: Iterable[Mapping[str, Any]]) -> None:
        """Replace all by the `as_data` of an earlier gateway.

        Raises:
            TypeError, KeyError, ValueError: the data is not of that form.
        """
        names = [each.name for each in fields(Notification)]
        found = [Notification(**{name: one[name] for name in names}) for one in saved]
        self._all = {int(one.id): one for one in sorted(found, key=lambda one: one.id)}
        self._next = max(self._all, default=0) + 1
        self.changes += 1
