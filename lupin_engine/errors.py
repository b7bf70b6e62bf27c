"""The error family, and the one form of a problem for people.

A problem with a user's input is a `Diagnostic`; several of them travel in one `ChartError`, because a checker
that stops at the first mistake costs its user one run per mistake. Every error that the user can fix derives
from `LupinError`: the command line prints its text and nothing else. Any other exception is a defect of the
engine.
"""

from __future__ import annotations

import bisect
import contextlib
import difflib
import enum
import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

#: How many names are compared with one that is misspelt, and how many are listed when none is like it.
MAX_COMPARED = 400
MAX_LISTED = 100

#: How many letters of a name are enough to complete it.
MIN_BEGINNING = 3
#: What stands in the declaration of a thing, by the key that holds it.
_DECLARATIONS = {"codes": "label: ...", "context": "type: ..., default: ..."}

#: How many letters of a text from outside are repeated in a message.
MAX_SHOWN = 40


class Severity(enum.IntEnum):
    """How bad a code or a finding is; the numbers are those of the published state."""

    INFO = 0
    WARN = 1
    ERROR = 2


class Place(NamedTuple):
    """A position in a file that a user wrote; line and column count from 1."""

    file: str
    line: int
    column: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"

    @property
    def shown(self) -> str:
        """The place as it can be clicked on: relative to the current folder where the file lies below it."""
        return f"{near(self.file)}:{self.line}:{self.column}"


def near(file: str) -> str:
    """Return a file's name relative to the current folder, when it lies below it."""
    return file.removeprefix(os.path.join(os.getcwd(), ""))


@dataclass(frozen=True)
class Diagnostic:
    """One finding: its place, the problem, and the allowed values or the remedy.

    `stricter` names the row of `chart.strictness` by which an older engine accepted this, '' for none.
    """

    place: Place
    rule: str
    path: str
    problem: str
    hint: str = ""
    severity: Severity = Severity.ERROR
    stricter: str = ""

    @property
    def kind(self) -> str:
        """Its kind: an error, a warning, or a note, which is a warning that its file accepts."""
        return ("note", "warning", "error")[self.severity]

    @property
    def message(self) -> str:
        """The path, the problem and the hint, without the place and the rule."""
        where = f"{self.path}: " if self.path else ""
        hint = f"; {self.hint}" if self.hint else ""
        return f"{where}{self.problem}{hint}"

    def __str__(self) -> str:
        return f"{self.place}: {self.kind}: {self.message} [{self.rule}]"


class LupinError(Exception):
    """A failure that the user can fix; its text is all the user needs."""

    exit_code = 1


class UsageError(LupinError):
    """The command line, or a call of the public interface, names something that does not exist."""

    exit_code = 2


class PluginError(LupinError):
    """A plugin breaks the contract, or two plugins contradict each other."""


class ChartError(LupinError):
    """A mission cannot be used; carries every finding, in file order."""

    def __init__(self, diagnostics: Iterable[Diagnostic]) -> None:
        self.diagnostics = tuple(sorted(diagnostics, key=lambda d: (d.place, d.rule, d.problem)))
        super().__init__("\n".join(str(d) for d in self.diagnostics))

    def __reduce__(self) -> tuple[type[ChartError], tuple[tuple[Diagnostic, ...]]]:
        """Pickle as made: an error that does not unpickle hangs a pool of processes."""
        return type(self), (self.diagnostics,)


class Problems:
    """Collects problems, to be raised together: each once, in the order of finding.

    False while there is none.
    """

    def __init__(self, kind: type[LupinError] = LupinError) -> None:
        """Collect problems that are raised as `kind`."""
        self._kind = kind
        self._texts: dict[str, None] = {}

    def add(self, *texts: str) -> None:
        """Add problems."""
        self._texts.update(dict.fromkeys(texts))

    @contextlib.contextmanager
    def collecting(self) -> Iterator[None]:
        """Add the errors that the body raises, and continue behind it.

        A `ChartError` passes, because its findings have places of their own.
        """
        try:
            yield
        except ChartError:
            raise
        except LupinError as problem:
            self.add(str(problem))

    def raise_any(self) -> None:
        """Raise all of them as one error, each on a line; do nothing without one."""
        if self._texts:
            raise self._kind("\n".join(self._texts))

    def __bool__(self) -> bool:
        return bool(self._texts)


def nearest(name: str, allowed: Iterable[str]) -> str:
    """Return a hint: the most similar name, else the first `MAX_LISTED` allowed names in sorted order."""
    names = sorted(set(allowed))
    guess = meant(name, names)
    if guess:
        return guess
    if not names:
        return "nothing is allowed here"
    more = f" and {len(names) - MAX_LISTED} more" if len(names) > MAX_LISTED else ""
    return "allowed: " + ", ".join(repr(n) for n in names[:MAX_LISTED]) + more


def meant(name: str, allowed: Iterable[str]) -> str:
    """Return a hint with the most similar name; '' where none is similar."""
    guess = guessed(name, allowed)
    return f"did you mean {guess!r}?" if guess else ""


def guessed(name: str, allowed: Iterable[str]) -> str:
    """Return the only one that begins with `name`, else the one that is most like it; '' where none is."""
    names = sorted(set(allowed))
    close = [one for one in names if one.startswith(name)] if len(name) >= MIN_BEGINNING else []
    if len(close) != 1:
        close = difflib.get_close_matches(name, _around(name, names), n=1, cutoff=0.6)
    return close[0] if close else ""


def or_else(hint: str, otherwise: str) -> str:
    """Join a hint, if any, with the other remedy."""
    return f"{hint} Or {otherwise}" if hint.endswith("?") else "; or ".join(filter(None, (hint, otherwise)))


def unknown_field(name: str, allowed: Iterable[str]) -> str:
    """Say that a request has no such field, with the nearest that it has."""
    names = list(allowed)
    return f"unknown field {shortened(name)!r}; {nearest(name, names) if names else 'it has none'}"


def declared_as(family: str, name: str) -> str:
    """Say how something is declared that is used and not declared."""
    return f"declare it under {family}: '{name}: {{{_DECLARATIONS[family]}}}'"


def reason(problem: Exception) -> str:
    """Return the text of an exception, for the middle of a sentence; of a KeyError the key."""
    said = str(problem) or type(problem).__name__
    return f"there is no {said}" if isinstance(problem, KeyError) else said


def shortened(text: str, most: int = MAX_SHOWN) -> str:
    """Return a foreign text for a message: all of a short one, the beginning of a long one."""
    return text if len(text) <= most else f"{text[:most]}..."


def _around(name: str, names: list[str]) -> list[str]:
    """Return the sorted names that begin most like `name`: of thousands, not all are compared by letters."""
    if len(names) <= MAX_COMPARED:
        return names
    first = max(0, bisect.bisect(names, name) - MAX_COMPARED // 2)
    return names[first : first + MAX_COMPARED]
