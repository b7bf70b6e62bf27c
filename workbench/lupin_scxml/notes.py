"""Collects an import's notes by line; two exceptions say why something cannot be converted."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

from lupin_scxml.elements import Element


class Note(NamedTuple):
    """A message about a line; `lost` if something is left out, else it is converted with another meaning.

    `to_write` is something that the document leaves open.
    """

    line: int
    text: str
    lost: bool
    to_write: bool = False


class CannotSay(Exception):
    """The language has no equivalent of this."""


class AlwaysFails(Exception):
    """SCXML makes an error of this whenever it is executed, and raises `event`."""

    def __init__(self, text: str, event: str = "error.execution") -> None:
        super().__init__(text)
        self.event = event


class Notes:
    """The notes of one import, each once."""

    def __init__(self) -> None:
        self._notes: set[Note] = set()
        self._once: dict[str, int] = {}

    def sorted(self) -> tuple[Note, ...]:
        """Return all of them, by line."""
        return tuple(sorted({*self._notes, *(Note(line, text, False) for text, line in self._once.items())}))

    def note_once(self, element: Element, text: str) -> None:
        """Note a changed meaning that concerns the whole document, at its first line."""
        self._once[text] = min(element.line, self._once.get(text, element.line))

    def note(self, element: Element, text: str) -> None:
        """Note that something is converted with another meaning."""
        self._notes.add(Note(element.line, text, False))

    def write(self, element: Element, what: str) -> None:
        """Note something that the document leaves open, and an author has to write."""
        self._notes.add(Note(element.line, what, False, True))

    def lose(self, element: Element, what: str) -> None:
        """Note that something is left out."""
        self._notes.add(Note(element.line, f"{what} cannot be said; it is left out", True))

    @contextmanager
    def or_lost(self, element: Element, role: str = "") -> Iterator[None]:
        """Run a block; if it cannot be converted, note that it is left out."""
        try:
            yield
        except CannotSay as problem:
            self.lose(element, f"{problem}{role}")
