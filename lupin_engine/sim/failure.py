"""A failed expectation as people read it: expected against actual, the lines of both files, the story around.

Nothing here knows colours: `Failure.lines` names what each line is, and whoever prints decides.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from lupin_engine.errors import Place

#: What a line of a failure is.
KINDS = ("head", "source", "caret", "expected", "actual", "chart", "story", "marked")
HEAD, SOURCE, CARET, EXPECTED, ACTUAL, CHART, STORY, MARKED = KINDS


@dataclass(frozen=True)
class Failure:
    """One expectation that was not met.

    Args:
        place: where it is written.
        concerned: pieces of the chart that it is about, each with what it is.
        story: what happened around it, and `marked` which of these lines it is about.
    """

    place: Place
    what: str
    expected: str
    actual: str
    concerned: tuple[tuple[str, Place], ...] = ()
    story: tuple[str, ...] = ()
    marked: int | None = None

    def __str__(self) -> str:
        return "\n".join(text for _, text in self.lines())

    def lines(self) -> Iterator[tuple[str, str]]:
        """Yield the lines of the report, each with what it is."""
        yield from self.about()
        yield from self.told()

    def about(self) -> Iterator[tuple[str, str]]:
        """Yield what differs, and the lines of both files."""
        yield HEAD, f"{shown(self.place)}: {self.what}"
        yield EXPECTED, f"    expected: {self.expected}"
        yield ACTUAL, f"    actual:   {self.actual}"
        yield from excerpt(self.place)
        for what, place in self.concerned:
            yield CHART, f"  {shown(place)}: {what}"
            yield from excerpt(place)

    def told(self) -> Iterator[tuple[str, str]]:
        """Yield the story around it."""
        for index, line in enumerate(self.story):
            marked = index == self.marked
            yield (MARKED if marked else STORY), f"    {'>' if marked else '|'} {line}"


def report(failures: Iterable[Failure]) -> Iterator[tuple[str, str]]:
    """Yield the lines of several failures of one run; a story that was just told is not told again."""
    before: Failure | None = None
    for failure in failures:
        yield from failure.about()
        if before is None or (failure.story, failure.marked) != (before.story, before.marked):
            yield from failure.told()
        before = failure


def shown(place: Place) -> str:
    """Return a place as it can be clicked on: relative to the current folder where the file lies below it."""
    return f"{near(place.file)}:{place.line}:{place.column}"


def near(file: str) -> str:
    """Return a file's name relative to the current folder, when it lies below it."""
    return file.removeprefix(os.path.join(os.getcwd(), ""))


def excerpt(place: Place) -> Iterator[tuple[str, str]]:
    """Yield the line of a place and a caret below it; nothing when the file cannot be read any more."""
    try:
        lines = Path(place.file).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return
    if place.line <= len(lines):
        yield SOURCE, f"{place.line:>7} | {lines[place.line - 1]}"
        yield CARET, f"{'':>7} | {'':>{place.column - 1}}^"
