"""Output of findings: for people with line and carets, for programs as JSON, SARIF or annotations."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import click

from lupin_cli.terminal.excerpt import Sources, excerpt
from lupin_engine.errors import Diagnostic, Severity

#: How wide excerpts are where there is no terminal, in cells.
WIDTH = 120
_COLOURS: Mapping[Severity, str] = MappingProxyType(
    {Severity.ERROR: "red", Severity.WARN: "yellow", Severity.INFO: "blue"}
)


@dataclass(frozen=True)
class Checked:
    """The result of a check: the number of missions, and every finding once."""

    missions: int
    found: tuple[Diagnostic, ...]

    def count(self, severity: Severity) -> int:
        """Return the number of findings of a severity."""
        return sum(diagnostic.severity is severity for diagnostic in self.found)

    def exit_code(self, strict: bool) -> int:
        """Return 1 for errors, with `strict` also for warnings, else 0."""
        return 1 if self.count(Severity.ERROR) or (strict and self.count(Severity.WARN)) else 0


def wants_colour() -> bool | None:
    """Whether the output has colours; None: where it is a terminal."""
    if os.environ.get("NO_COLOR"):
        return False
    return True if os.environ.get("FORCE_COLOR") else None


def as_text(checked: Checked, width: int | None = None) -> str:
    """Return the findings for people: a line each, under it the source with carets; last the counts."""
    sources = Sources()
    columns = width or shutil.get_terminal_size((WIDTH, 24)).columns
    lines = [line for diagnostic in checked.found for line in _finding_lines(diagnostic, sources, columns)]
    return "\n".join([*lines, _counts(checked)])


def _finding_lines(diagnostic: Diagnostic, sources: Sources, width: int) -> Iterator[str]:
    """Yield a finding, and the line that it is about."""
    place, colour = diagnostic.place, _COLOURS[diagnostic.severity]
    kind = click.style(diagnostic.kind, fg=colour, bold=True)
    yield f"{click.style(str(place), bold=True)}: {kind}: {_message(diagnostic)}"
    line = sources.line(place)
    if line is None or not line.strip():
        return
    number = f"{place.line:5} | "
    shown, carets = excerpt(line, place.column, width - len(number))
    yield click.style(number, dim=True) + shown
    yield click.style(f"{'|':>7} ", dim=True) + click.style(carets, fg=colour, bold=True)


def _counts(checked: Checked) -> str:
    errors, warnings = checked.count(Severity.ERROR), checked.count(Severity.WARN)
    counts = [
        counted(checked.missions, "mission"),
        counted(errors, "error"),
        counted(warnings, "warning"),
    ]
    if accepted := checked.count(Severity.INFO):
        counts.append(f"{accepted} accepted")
    colour = "red" if errors else "yellow" if warnings else "green"
    return click.style(", ".join(counts), fg=colour)


def counted(count: int, what: str) -> str:
    """Return `3 missions`, `1 mission`, `no missions`."""
    return f"{count or 'no'} {what}{'' if count == 1 else 's'}"


def _as_json(checked: Checked) -> str:
    sources = Sources()
    return json.dumps(
        [
            {
                "file": d.place.file,
                "line": d.place.line,
                "column": d.place.column,
                "severity": d.kind,
                "rule": d.rule,
                "path": d.path,
                "problem": d.problem,
                "hint": d.hint,
                "source": sources.line(d.place),
            }
            for d in checked.found
        ],
        indent=2,
        ensure_ascii=False,
    )


def _as_sarif(checked: Checked) -> str:
    from lupin_cli.terminal.sarif import sarif

    return sarif(checked.found, Path.cwd())


def _as_github(checked: Checked) -> str:
    """Return the workflow commands by which GitHub annotates lines."""
    return "\n".join(
        f"::{'notice' if d.kind == 'note' else d.kind} "
        f"file={_escaped(d.place.file)},line={d.place.line},col={d.place.column},"
        f"title={_escaped(d.rule)}::{_escaped(_message(d), ())}"
        for d in checked.found
    )


def _escaped(text: str, more: Iterable[str] = (":", ",")) -> str:
    for sign in ("%", "\r", "\n", *more):
        text = text.replace(sign, f"%{ord(sign):02X}")
    return text


def _message(diagnostic: Diagnostic) -> str:
    """Return the text of a finding without its place and severity."""
    return str(diagnostic).removeprefix(f"{diagnostic.place}: {diagnostic.kind}: ")


FORMS: Mapping[str, Callable[[Checked], str]] = MappingProxyType(
    {"text": as_text, "json": _as_json, "sarif": _as_sarif, "github": _as_github}
)
