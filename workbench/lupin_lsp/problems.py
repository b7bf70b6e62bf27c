"""Converts findings to an editor's diagnostics: gives them an end, and finds the fix of a misspelt word."""

from __future__ import annotations

import re
from dataclasses import dataclass

from lupin_engine.errors import Diagnostic
from lupin_lsp.scan import Scan

_QUOTED = re.compile(r"'([^']+)'")
_WORD = re.compile(r"\w+|\S")
_MEANT = re.compile(r"did you mean '([^']+)'\?")


@dataclass(frozen=True)
class Problem:
    """A finding for the range from `start` to `end`, which are offsets in the text."""

    start: int
    end: int
    finding: Diagnostic

    @property
    def message(self) -> str:
        """The problem and the hint, without the place."""
        hint = f"; {self.finding.hint}" if self.finding.hint else ""
        return f"{self.finding.problem}{hint}"

    @property
    def unused(self) -> bool:
        """Whether it is about something that could be left out."""
        return self.finding.rule.startswith("unused-")


def problem(scan: Scan, finding: Diagnostic) -> Problem:
    """Return a finding with its range in the present text; a place outside it becomes the nearest one."""
    start = scan.lines.offset(finding.place.line - 1, finding.place.column - 1)
    return Problem(start, max(_end(scan, start, finding.problem), start), finding)


def _end(scan: Scan, start: int, text: str) -> int:
    """Return the end of the name in a finding's text, else of the key or value at its place."""
    for name in _QUOTED.findall(text):
        for quote in ("", "'", '"'):
            if scan.text.startswith(f"{quote}{name}{quote}", start):
                return start + len(name) + 2 * len(quote)
    token = scan.token_at(start)
    if token is not None and token.start == start:
        return token.end
    found = _WORD.match(scan.text, start)
    line_end = scan.lines.end(scan.lines.position(start)[0])
    return min(found.end(), line_end) if found else min(start + 1, line_end)


def spelling(message: str) -> str:
    """Return the spelling that a message suggests; empty when there is none."""
    found = _MEANT.search(message)
    return found.group(1) if found else ""


def corrected(text: str, meant: str) -> str:
    """Return `meant` as the replacement of a misspelt text: in the same quotes, if the text has any."""
    quote = text[0] if text[:1] in ("'", '"') and text[-1:] == text[:1] else ""
    return f"{quote}{meant}{quote}"
