"""The page of outcomes of a mission of one's own: made from the graph of a proof, or compared with it.

A cell is what follows at once from a cause (a request, a change of a live value, an answer of a server) in a
state, while some holds are engaged. Where situations of that state differ, it has several texts. A proof
collects them as what its property `outcomes` is about. A page that was written so is known by its first line.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import groupby, product
from pathlib import Path
from typing import NamedTuple

from lupin_engine.chart import Chart, Expression
from lupin_engine.errors import Place
from lupin_engine.machine import Act, Cancel, EvaluationScope, Report, Start
from lupin_engine.plugin import Publish
from lupin_engine.properties import NOT_ABOUT, Passage, Property, Remembered, Verdict
from lupin_verify.outcomes import OUTCOMES, OutcomePage, lines_of, read_page

#: In place of a page: collect the outcomes, and compare them with none.
NEW = Path("new")
_MARK = "<!-- written by: lupin prove "
_SAYS = "In each state, each cause leads to what the page of outcomes says."
_EITHER, _AND, _NOT_HELD = "<br>", ", ", "not held"
_ENDS = {"attempt.done": "succeeds", "attempt.failed": "fails", "timer.timeout": "takes too long"}
_GONE, _LACKING = "is on the page, but never follows", "follows, but is not on the page"
_SAME = "="
_SECTIONS = ("Requests", "Live values", "Operations")
#: The most differences that are listed.
_LISTED = 20


class CauseOutcome(NamedTuple):
    """One text of a cell: what follows from a cause in a state (a row) under some holds (a column)."""

    cause: str
    row: str
    column: str
    text: str


@dataclass(frozen=True)
class OutcomeTable:
    """Collects the outcomes of a chart; those of a page are `expected`, each with its place."""

    chart: Chart
    file: Path = NEW
    expected: Mapping[CauseOutcome, Place] = field(default_factory=dict)
    #: No condition of a page that was written so reads anything.
    conditions: tuple[Expression, ...] = ()

    @property
    def is_new(self) -> bool:
        """Whether there is no page yet, to compare with."""
        return self.file == NEW

    @property
    def watched(self) -> Property:
        """The property that records the outcome of each step; an outcome that the page lacks breaks it."""
        return Property(OUTCOMES, _SAYS, self._watch, remembers=False)

    def in_words(self, met: Iterable[str]) -> list[str]:
        """Return how much was collected, as a sentence."""
        return [f"{len(collected(met)):,} outcomes were collected."]

    def _watch(self, state: Remembered, passage: Passage) -> tuple[Remembered, Verdict]:
        if passage.was is None:
            return state, NOT_ABOUT
        was = passage.was()
        causes = [] if was.memory.deferred else list(_causes(passage, was))
        if not causes:
            return state, NOT_ABOUT
        row, column = (
            _row(self.chart, was.memory.configuration),
            _AND.join(sorted(was.memory.held)) or _NOT_HELD,
        )
        text = "; ".join(self._parts(row, passage, was)) or "nothing"
        found = [CauseOutcome(cause, row, column, text) for cause in causes]
        new = [one for one in found if not self.is_new and one not in self.expected]
        return state, Verdict(
            True, _difference(new[0], _LACKING) if new else "", tuple(map("\t".join, found))
        )

    def _parts(self, row: str, passage: Passage, was: EvaluationScope) -> Iterator[str]:
        """Yield the parts of a cell."""
        step = passage.step
        if step.refusal is not None:
            yield f"✗ {_reason(step.event.name, step.refusal.text)}"
            return
        there = _row(self.chart, passage.after.configuration)
        before, after = was.memory.held, passage.after.held
        own = step.event.data.get("code")
        said = {
            "→": [there] if there != row else [],
            "releases": [name for name in before if name not in after],
            "engages": [name for name in after if name not in before],
            "cancels": [c.operation for c in step.commands if isinstance(c, Cancel)],
            "starts": [c.operation for c in step.commands if isinstance(c, Start)],
            "does": [c.action for c in step.commands if isinstance(c, Act)],
            "closes as": [c.status for c in step.commands if isinstance(c, Publish)],
            "reports": ["its code" if code.code == own else code.code for code in step.codes],
        }
        yield from (f"{word} {_AND.join(dict.fromkeys(names))}" for word, names in said.items() if names)
        if any(isinstance(c, Report) for c in step.commands):
            yield "summary"
        if passage.after.deferred:
            yield "waits for the release"

    def differences(self, found: Iterable[CauseOutcome]) -> list[str]:
        """Return the outcomes that only the page has, and those that it lacks, as lines with their places."""
        if self.is_new:
            return []
        known = set(found)
        near: dict[tuple[str, ...], Place] = {(): Place(str(self.file), 1, 1)}
        for one, place in self.expected.items():
            near.setdefault(one[:2], place)
            near.setdefault(one[:1], place)
        lines = [(place, one, _GONE) for one, place in self.expected.items() if one not in known]
        for one in known - self.expected.keys():
            keys = (one[:2], one[:1], ())
            lines += [(next(near[key] for key in keys if key in near), one, _LACKING)]
        texts = [f"{place.shown}: {_difference(one, what)}" for place, one, what in sorted(lines)]
        more = f"and {len(texts) - _LISTED} more; --outcomes new writes the page anew"
        return texts if len(texts) <= _LISTED else [*texts[:_LISTED], more]


def read_outcomes(file: Path, chart: Chart) -> OutcomeTable | OutcomePage:
    """Read a page of outcomes, one that a proof has written or another one; `NEW`: none, to collect all.

    Raises:
        UsageError: it cannot be read.
    """
    if file == NEW:
        return OutcomeTable(chart)
    if not is_written(file):
        return read_page(file, chart)
    text = file.read_text(encoding="utf-8")
    expected: dict[CauseOutcome, Place] = {}
    for line in lines_of(text, str(file)):
        last = ""
        for column, cell in zip(line.head[1:], line.cells[1:], strict=True):
            last = last if cell in (_SAME, "") else cell
            rows = line.cells[0].split(_AND) if cell and line.head[0] == "State" else []
            for row, one in product(rows, last.split(_EITHER)):
                expected[CauseOutcome(line.title, row, column, one)] = line.place
    return OutcomeTable(chart, file, expected)


def is_written(file: Path) -> bool:
    """Return whether a proof has written a page; a file that cannot be read is none."""
    try:
        return file.read_text(encoding="utf-8").startswith(_MARK)
    except (OSError, UnicodeDecodeError):
        return False


def collected(met: Iterable[str]) -> list[CauseOutcome]:
    """Return the outcomes among the names of what a proof has met."""
    return sorted(CauseOutcome(*name.split("\t")) for name in met if "\t" in name)


def _difference(one: CauseOutcome, what: str) -> str:
    return f"{one.cause}, {one.row}, {one.column}: {one.text!r} {what}"


def _row(chart: Chart, configuration: tuple[str, ...]) -> str:
    """Return the active atomic states, within a mission without the names around it."""
    above = {chart.states[name].parent for name in configuration}
    inside = "|".join(re.escape(mission.state) for mission in chart.missions.values())
    return " + ".join(re.sub(rf"^(?:{inside})\.", "", name) for name in configuration if name not in above)


def _reason(request: str, text: str) -> str:
    """Return a refusal without the request's name and the state's, which the table has."""
    text = text.partition("; ")[0].removeprefix(f"{request.partition('.')[2]} ")
    text = text.removeprefix("refused: ").removeprefix("is ")
    return re.sub(r"possible in [A-Z_ ]+", "possible here ", text).strip().replace("|", "/")


def _causes(passage: Passage, was: EvaluationScope) -> Iterator[str]:
    """Yield what has happened: a request, flags of live values that change, the end of an operation."""
    event = passage.step.event
    if event.is_request:
        yield event.name
    elif event.name == "value":
        for flag in _flags(passage.chart, event.data["name"]):
            now = passage.scope.inputs.holds(flag)
            if now != was.inputs.holds(flag):
                yield f"{flag} becomes {'true' if now else 'false'}"
    elif event.name in _ENDS:
        attempt = was.memory.attempts.get(event.data.get("attempt") or event.data["owner"])
        if attempt is not None and attempt.id in passage.before.speaking:
            yield f"{attempt.operation} {_ENDS[event.name]}"


def _flags(chart: Chart, value: str) -> Iterator[str]:
    """Yield the conditions on a live value: the input itself if it is a truth value, else its levels."""
    for spec in chart.inputs.values():
        if spec.value == value and spec.type.kind == "bool":
            yield f"input.{spec.name}"
        elif spec.value == value:
            yield from (f"input.{spec.name}.{level.name}" for level in spec.levels)


# -- the page ---------------------------------------------------------------------------------------------


def outcome_page(chart: Chart, outcomes: Iterable[CauseOutcome], command: str) -> str:
    """Return the page of some outcomes; `command` is what follows `lupin prove` to write it."""
    title = ", ".join(chart.missions) or chart.name
    by_cause: dict[str, dict[tuple[str, str], list[str]]] = {}
    for one in sorted(outcomes):
        by_cause.setdefault(one.cause, {}).setdefault((one.row, one.column), []).append(one.text)
    lines = [f"{_MARK}{command} -->", f"# What happens when: {title}", "", _HOW_TO_READ]
    for section, causes in groupby(sorted(by_cause, key=_rank), lambda cause: _rank(cause)[0]):
        lines += ["", f"## {_SECTIONS[section]}"]
        for cause in causes:
            lines += ["", f"### {cause}", "", *_table(chart, by_cause[cause])]
    return "\n".join([*lines, ""])


_HOW_TO_READ = """\
Made from every situation that the mission can come to. A row is the active state, a column the holds that are
engaged. A cell says what follows at once: the next state (→), or a refusal with its reason (✗); operations
that are started and cancelled; results and codes. Lines of one cell are of different situations; = is as in
the cell to the left, and an empty one cannot be."""


def _rank(cause: str) -> tuple[int, str]:
    """Return the number of a cause's section, and its place in that."""
    is_value = cause.startswith("input.")
    return (0 if " " not in cause else 1 if is_value else 2), cause


def _table(chart: Chart, cells: Mapping[tuple[str, str], list[str]]) -> Iterator[str]:
    """Yield the lines of a table; rows with the same cells are one."""
    columns = sorted(
        {column for _, column in cells}, key=lambda name: (name.count(_AND), name != _NOT_HELD, name)
    )
    order = [_row(chart, (name,)) for name in chart.states]
    rows = sorted({row for row, _ in cells}, key=lambda row: (order.index(row.split(" + ")[0]), row))
    alike: dict[tuple[str, ...], list[str]] = {}
    for row in rows:
        texts = tuple(_EITHER.join(cells.get((row, column), ())) for column in columns)
        alike.setdefault(texts, []).append(row)
    yield f"| State | {' | '.join(columns)} |"
    yield "|---" * (1 + len(columns)) + "|"
    yield from (f"| {_AND.join(names)} | {' | '.join(_shortened(texts))} |" for texts, names in alike.items())


def _shortened(texts: Iterable[str]) -> Iterator[str]:
    """Yield the texts of a row; one that is as the last one before it is `=`."""
    last = ""
    for text in texts:
        yield _SAME if text and text == last else text
        last = text or last
