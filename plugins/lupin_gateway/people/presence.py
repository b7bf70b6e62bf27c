"""Presence: who is connected, and which view each page shows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypedDict

#: Letters of a view's name.
LONGEST_VIEW = 40


@dataclass
class _ConnectedPage:
    page: str
    name: str
    role: str
    browser: str
    since: float
    view: str = ""


class PersonRecord(TypedDict):
    """Who is connected, since so many seconds since 1970; `view` is open there, '' where it is no console."""

    page: str
    name: str
    role: str
    since: float
    view: str


class Presence:
    """All connections, by their numbers."""

    def __init__(self) -> None:
        self._visits: dict[int, _ConnectedPage] = {}
        #: How often anything has changed.
        self.changes = 0

    def joined(self, number: int, page: str, name: str, role: str, browser: str, at: float) -> None:
        """Add a connection, with its time in seconds since 1970."""
        self.changes += 1
        self._visits[number] = _ConnectedPage(page, name, role, browser, at)

    def shows(self, number: int, view: str) -> str:
        """Record the view of a page; return the name of its connection."""
        self.changes += 1
        self._visits[number].view = view[:LONGEST_VIEW]
        return self._visits[number].page

    def gone(self, number: int) -> None:
        """Remove a connection."""
        self.changes += 1
        self._visits.pop(number, None)

    def as_data(self) -> list[PersonRecord]:
        """Return the connections, the oldest first.

        The console's second connection, for its stop, has no view and is left out.
        """
        consoles = {visit.browser for visit in self._visits.values() if visit.view}
        return [
            {
                "page": visit.page,
                "name": visit.name,
                "role": visit.role,
                "since": visit.since,
                "view": visit.view,
            }
            for visit in self._visits.values()
            if visit.view or visit.browser not in consoles
        ]
