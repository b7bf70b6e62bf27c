"""A decision table as a property: each step has the outcome in the page's cell for its state and event.

The page is Markdown. A heading names an event; the table below it has a row for each state and a column for
each combination of holds; its cells say what follows. A table below another heading, with cells that are
`yes`, lists the combinations that the page covers. Four more define the names:

    | State | Where | About |     the condition of a row, and of the situations of it that the page covers
    | Column | Held | Where |     the active holds, and a condition
    | Event | What | But for |    a request or a condition on live values; a refusal that is not covered
    | Word | Stands for |         operations and actions

Conditions are expressions of the language.
"""

from __future__ import annotations

import re
from collections.abc import Container, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from lupin_engine.chart import ITINERARY, Chart, Expression, Findings, read_guard, scope_of, text_at
from lupin_engine.errors import Place, Problems, UsageError, near, nearest
from lupin_engine.machine import (
    Act,
    Cancel,
    EvaluationScope,
    Phase,
    Refusal,
    Report,
    Start,
    all_holds,
    reads_of,
)
from lupin_engine.plugin import Publish
from lupin_engine.properties import NOT_ABOUT, Passage, Property, Remembered, Verdict

#: The name of the property.
OUTCOMES = "outcomes"
_SEPARATOR = " · "
_REFUSED, _LEADS = "✗ ", "→ "
_STATES, _COLUMNS = ("State", "Where", "About"), ("Column", "Held", "Where")
_EVENTS, _WORDS = ("Event", "What", "But for"), ("Word", "Stands for")
#: The verbs of cells that a list of names follows.
_VERBS = ("engages", "releases", "cancels", "starts", "closes", "last_error")


class _Line(NamedTuple):
    """A row of a table: the heading above it with its place, the table's head, its cells."""

    place: Place
    written: str
    above: Place
    title: str
    head: tuple[str, ...]
    cells: tuple[str, ...]


@dataclass(frozen=True)
class _Case:
    """A row, a column or an event: its condition, the part that the page covers, its holds, its request."""

    where: Expression | None = None
    about: Expression | None = None
    held: frozenset[str] = frozenset()
    request: str = ""
    but_for: str = ""
    is_here: bool = True

    def is_in(self, scope: EvaluationScope, now: float) -> bool:
        """Return whether the condition holds."""
        return self.is_here and (self.where is None or _holds(self.where, scope, now))

    def is_about(self, scope: EvaluationScope, now: float) -> bool:
        """Return whether the page covers it there."""
        return self.is_in(scope, now) and (self.about is None or _holds(self.about, scope, now))


class _Cell(NamedTuple):
    """The text of a cell, and its place."""

    text: str
    place: Place


@dataclass
class OutcomePage:
    """The cells of a page, for one chart.

    `strange` are the rows about states that the chart does not have, `possible` the covered combinations of
    row and column; empty: all.
    """

    file: Path
    chart: Chart
    rows: dict[str, _Case] = field(default_factory=dict)
    columns: dict[str, _Case] = field(default_factory=dict)
    events: dict[str, _Case] = field(default_factory=dict)
    words: dict[str, frozenset[str]] = field(default_factory=dict)
    cells: dict[tuple[str, str, str], _Cell] = field(default_factory=dict)
    strange: set[str] = field(default_factory=set)
    possible: set[tuple[str, str]] = field(default_factory=set)

    @property
    def conditions(self) -> list[Expression]:
        """All conditions of the page."""
        cases = (*self.rows.values(), *self.columns.values(), *self.events.values())
        return [found for case in cases for found in (case.where, case.about) if found is not None]

    @property
    def watched(self) -> Property:
        """The page as a property of every step whose memory before is known."""
        says = f"In each state, each event leads to what its cell in {self.file.name} says."
        return Property(OUTCOMES, says, self._watch)

    def in_words(self, met: Container[str]) -> list[str]:
        """Return sentences about the cells that were `met`, and those that were not."""
        own = [place for place in self.cells if place[1] not in self.strange]
        left = [place for place in own if ", ".join(place) not in met]
        found = [f"{len(own) - len(left)} of {len(own)} cells of {self.file.name} were met."]
        rows = {row for _, row, _ in left} - {row for _, row, _ in set(own).difference(left)}
        missed = [*sorted(rows), *(", ".join(place) for place in left if place[1] not in rows)]
        if missed:
            found.append(f"Not met: {'; '.join(missed)}.")
        if self.strange:
            found.append(f"Of other missions: {', '.join(sorted(self.strange))}.")
        return found

    # -- one step -----------------------------------------------------------------------------------------

    def _watch(self, state: Remembered, passage: Passage) -> tuple[Remembered, Verdict]:
        event = passage.step.event
        if passage.was is None or not (event.is_request or event.name == "value"):
            return state, NOT_ABOUT
        happened = [name for name, one in self.events.items() if self._is(one, passage)]
        if not happened:
            return state, NOT_ABOUT
        was, now = passage.was(), passage.step.time
        if was.memory.deferred:
            return state, NOT_ABOUT
        held = frozenset(was.memory.held)
        columns = [name for name, one in self.columns.items() if one.held == held and one.is_in(was, now)]
        own = [name for name in self.rows if columns and name not in self.strange]
        rows = [name for name in own if self.rows[name].is_about(was, now)]
        places = [(e, row, column) for e in happened for row in rows for column in columns]
        met = [place for place in places if place in self.cells]
        about = tuple(", ".join(place) for place in met)
        for place in met:
            wrong = "; ".join(self._differences(self.cells[place].text, place[1], passage, was))
            if wrong:
                cell = self.cells[place]
                found = f"{cell.place.shown}: {', '.join(place)}: {cell.text}; but {wrong}"
                return state, Verdict(True, found, about)
        return state, Verdict(bool(met), about=about)

    def _is(self, one: _Case, passage: Passage) -> bool:
        """Return whether a step's event is the given event of the page."""
        event = passage.step.event
        if one.request:
            refusal = passage.step.refusal
            left_out = one.but_for and refusal is not None and refusal.text.endswith(one.but_for)
            return event.name == one.request and not left_out
        if event.name != "value" or one.where is None:
            return False
        names = {name for root, name in _reads(one.where) if root in ("input", "known")}
        values = {self.chart.inputs[name].value for name in names}
        return event.data["name"] in values and one.is_in(passage.scope, passage.step.time)

    def _differences(self, text: str, row: str, passage: Passage, was: EvaluationScope) -> Iterator[str]:
        """Yield the differences between a step and a cell."""
        step, refusal = passage.step, passage.step.refusal
        if text.startswith(_REFUSED) or refusal is not None:
            yield from _refused_otherwise(text, refusal)
            return
        said = self._said(text)
        wanted_row = said.pop("", {row})
        if not any(self.rows[one].is_in(passage.scope, step.time) for one in wanted_row):
            there = [n for n, one in self.rows.items() if one.is_in(passage.scope, step.time)]
            yield f"it is in {' or '.join(there) or passage.after.configuration[-1]}"
        before, after = set(was.memory.held), set(passage.after.held)
        for verb, found in (("engages", after - before), ("releases", before - after)):
            if found != said.get(verb, set()):
                yield f"it {verb} {', '.join(sorted(found)) or 'nothing'}"
        yield from self._of_commands(said, passage, was)
        code = said.get("last_error")
        codes = {one.code for one in step.codes} or {"cleared"}
        if code is not None and not code <= codes:
            yield f"last_error is {', '.join(sorted(codes))}"

    def _of_commands(
        self, said: Mapping[str, set[str]], passage: Passage, was: EvaluationScope
    ) -> Iterator[str]:
        """Yield differences of cancels, starts, outcomes and summary; waiting operations count as started."""
        commands, memory = passage.step.commands, passage.after
        ended = {c.operation for c in commands if isinstance(c, Cancel)}
        begun = {c.operation for c in commands if isinstance(c, Start)}
        begun |= {c.action for c in commands if isinstance(c, Act)}
        waiting = {a.operation for a in memory.attempts.values() if a.phase is Phase.WAITING}
        retries = {owner for _, _, kind, (owner, _) in memory.timers if kind == "retry"}
        waiting |= {
            name for i in memory.invocations.values() if i.id in retries for name in self._of(i.state)
        }
        cancels, starts = self._meant(said.get("cancels", ())), self._meant(said.get("starts", ()))
        sent = (Phase.REQUESTED, Phase.ACCEPTED)
        running = {a.operation for a in was.memory.attempts.values() if a.phase in sent}
        wrong = (ended - set().union(*cancels)) | {o for some in cancels for o in some & running - ended}
        if wrong:
            yield f"it cancels {', '.join(sorted(ended)) or 'nothing'}"
        if begun - set().union(*starts) or any(some.isdisjoint(begun | waiting) for some in starts):
            yield f"it starts {', '.join(sorted(begun)) or 'nothing'}"
        closed = {c.status for c in commands if isinstance(c, Publish)}
        if closed - said.get("closes", set()):
            yield f"it closes a target as {', '.join(sorted(closed))}"
        if any(isinstance(c, Report) for c in commands) != ("summary" in said):
            yield "it tells no summary" if "summary" in said else "it tells a summary"

    def _of(self, state: str) -> Iterator[str]:
        """Yield the operation of a state."""
        invoke = self.chart.states[state].invoke
        if invoke is not None:
            yield invoke.name

    def _meant(self, words: Iterable[str]) -> list[frozenset[str]]:
        return [self.words.get(word, frozenset({word})) for word in words]

    @staticmethod
    def _said(text: str) -> dict[str, set[str]]:
        """Return the parts of a cell: the verb with its names; '' has the state that follows."""
        found: dict[str, set[str]] = {}
        for part in filter(None, map(str.strip, text.split(";"))):
            verb, _, rest = part.partition(" ")
            if part.startswith(_LEADS):
                found[""] = {part.removeprefix(_LEADS)}
            elif verb == "closes":
                found.setdefault(verb, set()).add(rest.rpartition(" ")[2])
            elif verb in _VERBS:
                found[verb] = set(rest.split(", "))
            else:
                found[part] = set()
        return found


def _holds(condition: Expression, scope: EvaluationScope, now: float) -> bool:
    """Return whether a condition is true; one that raises is not."""
    try:
        return bool(condition.evaluate(scope.at("", now)))
    except Exception:
        return False


def _reads(condition: Expression) -> tuple[tuple[str, str], ...]:
    return reads_of(getattr(condition.evaluate, "code", ""))


# -- the page ---------------------------------------------------------------------------------------------


def read_page(file: Path, chart: Chart) -> OutcomePage:
    """Read a page for a chart.

    Raises:
        UsageError: it cannot be read; with all problems and their places.
    """
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as problem:
        raise UsageError(f"{file}: {problem}") from None
    lines, problems = list(lines_of(text, str(file))), Problems(UsageError)
    page = OutcomePage(file, chart)
    reader = _OutcomeReader(page, problems)
    for line in lines:
        reader.define(line)
    for line in lines:
        reader.take(line)
    for place in [place for place in page.cells if page.possible and place[1:] not in page.possible]:
        del page.cells[place]
    if not page.cells and not problems:
        problems.add(f"{file}: no table of outcomes; it has a head '| State | COLUMN | ... |' below an event")
    problems.raise_any()
    return page


def lines_of(text: str, file: str) -> Iterator[_Line]:
    """Yield the rows of all tables, without heads."""
    title, above = "", Place(file, 1, 1)
    head: tuple[str, ...] = ()
    for number, line in enumerate(text.splitlines(), 1):
        if line.startswith("#"):
            title, above = line.lstrip("# ").strip(), Place(file, number, 1)
        if not line.startswith("|"):
            head = ()
            continue
        cells = tuple(cell.strip() for cell in line.strip()[1:].removesuffix("|").split("|"))
        if not head:
            head = cells
        elif len(cells) != len(head):
            raise UsageError(f"{near(file)}:{number}:1: {len(cells)} cells below a head of {len(head)}")
        elif set(cells[0]) != {"-"}:
            yield _Line(Place(file, number, 1), line, above, title, head, cells)


class _OutcomeReader:
    """Reads lines into a page, and collects their problems."""

    def __init__(self, page: OutcomePage, problems: Problems) -> None:
        self._page = page
        self._problems = problems
        self._scope = scope_of(page.chart).with_names({"itinerary": ITINERARY})

    def define(self, line: _Line) -> None:
        """Add a row of the four tables that define names."""
        page, name = self._page, line.cells[0]
        if line.head == _STATES:
            where = self._condition(line, line.cells[1], name)
            is_here = name not in page.strange
            page.rows[name] = _Case(where, self._condition(line, line.cells[2], name), is_here=is_here)
        elif line.head == _COLUMNS:
            held = frozenset(re.findall(r"[a-z_]+", line.cells[1]))
            for hold in sorted(held - all_holds(page.chart).keys()):
                self._wrong(line.place, "hold", hold, all_holds(page.chart))
            page.columns[name] = _Case(self._condition(line, line.cells[2]), held=held)
        elif line.head == _EVENTS:
            what = line.cells[1].strip("`")
            is_request = re.fullmatch(r"(mission|operator|answer)\.\w+", what) is not None
            condition = None if is_request else self._condition(line, line.cells[1])
            request = what if is_request else ""
            page.events[name] = _Case(condition, request=request, but_for=line.cells[2])
        elif line.head == _WORDS:
            page.words[name] = frozenset(re.findall(r"[\w.]+", line.cells[1]))

    def _condition(self, line: _Line, cell: str, row: str = "") -> Expression | None:
        """Read a condition; a row about a state that the chart does not have is of another mission."""
        text, findings = cell.strip("`"), Findings()
        place = line.place._replace(column=line.written.find(text) + 1)
        raw = text_at(text, place) if text and row not in self._page.strange else None
        found = read_guard(raw, line.place, self._scope, findings, line.cells[0])
        for one in findings.errors:
            if row and one.rule == "unknown-state":
                self._page.strange.add(row)
            else:
                self._problems.add(str(one))
        return found

    def take(self, line: _Line) -> None:
        """Add a row of a table of outcomes."""
        page = self._page
        if line.head != ("State", *page.columns) or not page.columns:
            return
        if line.title not in page.events and set(line.cells[1:]) - {"yes", ""}:
            self._wrong(line.above, "event", line.title, page.events)
            return
        for row in self._rows(line):
            last = ""
            for column, cell in zip(page.columns, line.cells[1:], strict=False):
                last = cell if cell not in ("=", "") else last
                if cell == "yes":
                    page.possible.add((row, column))
                elif cell:
                    page.cells[line.title, row, column] = _Cell(last, line.place)
                    self._check(line.place, last)

    def _rows(self, line: _Line) -> Iterator[str]:
        """Yield the rows of a line: a name stands for all rows that begin with it."""
        for name in line.cells[0].split(", "):
            meant = [r for r in self._page.rows if f"{r}{_SEPARATOR}".startswith(f"{name}{_SEPARATOR}")]
            if not meant:
                self._wrong(line.place, "state", name, self._page.rows)
            yield from meant

    def _check(self, place: Place, text: str) -> None:
        """Record the parts of a cell that are not understood."""
        for part in filter(None, map(str.strip, text.split(";"))):
            verb = part.partition(" ")[0]
            if part.startswith(_LEADS):
                if part.removeprefix(_LEADS) not in self._page.rows:
                    self._wrong(place, "state", part.removeprefix(_LEADS), self._page.rows)
            elif not text.startswith(_REFUSED) and verb not in (*_VERBS, "nothing", "next", "summary"):
                self._wrong(place, "outcome", part, (*_VERBS, "nothing", "next target", "summary"))

    def _wrong(self, place: Place, what: str, name: str, allowed: Iterable[str]) -> None:
        self._problems.add(f"{place.shown}: unknown {what} {name!r}; {nearest(name, allowed)}")


def _refused_otherwise(text: str, refusal: Refusal | None) -> Iterator[str]:
    """Yield the difference between a refusal and a cell."""
    answer = "" if refusal is None else refusal.text
    # The rest of the text depends on the loaded missions.
    why, answer = text.removeprefix(_REFUSED).partition("; ")[0], answer.partition("; ")[0]
    wanted = re.escape(why).replace("STATE", "[A-Z_ ]+")
    if refusal is None or not text.startswith(_REFUSED):
        yield f"it is refused: {answer}" if answer else "it is not refused"
    elif not re.search(rf"(^|\s){wanted}$", answer):
        yield f"the answer is {answer}"
