"""Formats the line of a finding with carets under its place, cut to the width of the terminal."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from pathlib import Path

from lupin_engine.errors import Place

#: A token: a quoted text, a word, a dotted name, else one character.
_TOKEN = re.compile(r"\"(?:[^\"\\]|\\.)*\"|'[^']*'|[\w.]+|\S")
_TAB = 8
_CUT = "..."


class Sources:
    """The files that findings are about, each read once."""

    def __init__(self) -> None:
        self._lines: dict[str, list[str]] = {}

    def lines(self, file: str) -> Sequence[str]:
        """Return the lines of a file; none when it cannot be read."""
        if file not in self._lines:
            self._lines[file] = _read(file)
        return self._lines[file]

    def line(self, place: Place) -> str | None:
        """Return the line of a place; None when the file cannot be read or has no such line."""
        lines = self.lines(place.file)
        return lines[place.line - 1] if place.line <= len(lines) else None


def _read(file: str) -> list[str]:
    """Return the lines of a file as places count them."""
    try:
        return Path(file).read_text(encoding="utf-8-sig", errors="replace").splitlines()
    except OSError:
        return []


def token_length(line: str, column: int) -> int:
    """Return the length of the token at `column`, counted from 1; at least 1."""
    match = _TOKEN.match(line, column - 1)
    return match.end() - match.start() if match else 1


def excerpt(line: str, column: int, width: int) -> tuple[str, str]:
    """Return the line as it is shown in `width` cells, and the carets to put under it.

    A line that is too long is cut on either side of the place. Tabs and control characters
    are replaced, and wide characters count as two cells, so that the carets stand in the right column.
    """
    shown = _shown(line.rstrip())
    first = min(column - 1, len(shown))
    last = min(first + token_length(line, column), len(shown))
    begin, end = _window(shown, first, width)
    before = _CUT if begin else ""
    after = _CUT if end < len(shown) else ""
    indent = len(before) + sum(map(_cells, shown[begin:first]))
    carets = max(1, sum(map(_cells, shown[first : min(last, end)])))
    return before + "".join(shown[begin:end]) + after, " " * indent + "^" * carets


def _shown(line: str) -> list[str]:
    """Return the visible text of each character."""
    found: list[str] = []
    cell = 0
    for char in line:
        visible = char if char.isprintable() else "\N{REPLACEMENT CHARACTER}"
        found.append(" " * (_TAB - cell % _TAB) if char == "\t" else visible)
        cell += _cells(found[-1])
    return found


def _cells(text: str) -> int:
    return sum(_width(char) for char in text)


def _width(char: str) -> int:
    if unicodedata.combining(char):
        return 0
    return 2 if unicodedata.east_asian_width(char) in "WF" else 1


def _window(shown: list[str], first: int, width: int) -> tuple[int, int]:
    """Return the range of a line that fits and contains `first`."""
    sizes = [_cells(text) for text in shown]
    if sum(sizes) <= width:
        return 0, len(shown)
    room = max(1, width - 2 * len(_CUT))
    begin, used = first, 0
    while begin and used + sizes[begin - 1] <= room // 3:
        begin -= 1
        used += sizes[begin]
    end = begin
    used = 0
    while end < len(shown) and used + sizes[end] <= room:
        used += sizes[end]
        end += 1
    while begin and used + sizes[begin - 1] <= room:
        begin -= 1
        used += sizes[begin]
    return begin, end
