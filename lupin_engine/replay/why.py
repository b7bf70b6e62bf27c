"""Explains a run: why a target ended so, why a state was entered, why the robot was there at a moment.

An answer is a sentence with steps. For a state or a moment these are a causal chain, newest first: the end
of an operation leads back to its start, a deadline to its arming; a request or a live value has no cause.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from lupin_engine.chart.expressions.condition import Condition
from lupin_engine.chart.expressions.evaluation import Compiled, Environment
from lupin_engine.chart.model import Chart
from lupin_engine.errors import LupinError, Place, guessed, nearest
from lupin_engine.machine.event import PROPERTY_BROKEN, Start
from lupin_engine.machine.scope import reads_of
from lupin_engine.machine.step import Step
from lupin_engine.plugin.profile import Publish
from lupin_engine.replay.observed import observed
from lupin_engine.runtime.history import History
from lupin_engine.sim.narration import StepLine, narrate, short_name, shorten

#: The default length of a causal chain.
USUAL_DEPTH = 5


class NothingKnown(LupinError):
    """The run does not have the answer; the text says what is known."""


@dataclass(frozen=True)
class LivedStep:
    """A step of a run, with the wall clock (POSIX; None: unknown) and who requested it.

    `held` are the holds after it.
    `guards` are, for each taken transition, the values that its guard read.
    """

    step: Step
    wall: float | None = None
    by: str = ""
    held: tuple[str, ...] = ()
    guards: Mapping[str, tuple[tuple[str, Any], ...]] | None = None


@dataclass(frozen=True)
class Reason:
    """A taken transition: its file and place, its guard ('': none) and the values that it read."""

    transition: str
    file: str
    place: Place
    guard: str = ""
    read: tuple[tuple[str, Any], ...] = ()

    def __str__(self) -> str:
        values = ", ".join(f"{name} was {shorten(value)}" for name, value in self.read)
        condition = f": {self.guard}" + (f" ({values})" if values else "") if self.guard else ""
        return f"{self.file}:{self.place.line}{condition}"


@dataclass(frozen=True)
class Cause:
    """One step of an answer as a line: time, requester, event and reasons."""

    line: StepLine
    wall: float | None
    by: str
    reasons: tuple[Reason, ...]


@dataclass(frozen=True)
class Explanation:
    """The answer: a sentence, and the steps that explain it."""

    text: str
    causes: tuple[Cause, ...]


class GuardWitness:
    """Records the values that a chart's guards read when they were true."""

    def __init__(self) -> None:
        self._seen: dict[str, tuple[tuple[str, Any], ...]] = {}

    def prepare(self, chart: Chart) -> Chart:
        """Return a copy of a chart with instrumented guards."""
        return observed(chart, self._watched)

    def of(self, step: Step) -> Mapping[str, tuple[tuple[str, Any], ...]]:
        """Return the values read by the guards of a step's transitions; clears the record."""
        found = {name: self._seen[name] for name in step.taken if name in self._seen}
        self._seen.clear()
        return found

    def _watched(self, name: str, guard: Condition) -> Callable[[Environment], Any]:
        evaluate = guard.evaluate
        if not isinstance(evaluate, Compiled):
            return evaluate
        reads = [(root, below) for root, below in reads_of(evaluate.code) if below]

        def watching(env: Environment) -> Any:
            value = evaluate(env)
            if value:
                self._seen[name] = tuple(_read(env, reads))
            return value

        return watching


def _read(env: Environment, reads: Iterable[tuple[str, str]]) -> Iterator[tuple[str, Any]]:
    for root, below in dict.fromkeys(reads):
        try:
            yield f"{root}.{below}", env[root][below]
        except Exception:  # a function, or what is not known: the condition holds without it
            continue


class Inquiry:
    """Answers questions about one run."""

    def __init__(self, chart: Chart, lived: Sequence[LivedStep], depth: int = USUAL_DEPTH) -> None:
        """Index a run.

        Args:
            chart: its chart.
            lived: its steps, in order.
            depth: the greatest length of a causal chain.
        """
        self._chart = chart
        self._lived = lived
        self._depth = depth
        self._history = History()
        for each in lived:
            self._history.take(each.step, each.held)
        self._targets = list(self._current_targets())
        self._rules = {rule.id: rule for state in chart.states.values() for rule in state.transitions}

    # -- the questions ----------------------------------------------------------------------------------

    def target(self, name: str) -> Explanation:
        """Return the outcome of a target, with the notable steps while it was the current one.

        Raises:
            NothingKnown: the run has no such target.
        """
        word = self._chart.profile.terminal.target
        published = [command for _, command in self._history.published if command.target == name]
        own = [i for i, targets in enumerate(self._targets) if name in targets]
        own += [i for i, one in enumerate(self._lived) if _publishes(one.step, name) and i not in own]
        if not own:
            known = {target for targets in self._targets for target in targets}
            known |= {command.target for _, command in self._history.published}
            hint = nearest(name, known) if known else f"no {word} was visited in this run"
            raise NothingKnown(f"this run knows of no {word} {name!r}; {hint}")
        text = (
            f"{word} {name} was not closed"
            if not published
            else f"{word} {name} is {_outcome(published[-1])}"
        )
        return Explanation(text, self._causes(i for i in sorted(own) if self._is_news(i)))

    def state(self, name: str) -> Explanation:
        """Explain the last entry of a state: a published one, or one of the chart by the end of its name.

        Raises:
            NothingKnown: there is no such state, or it was not entered.
        """
        found = self._last_entry(name)
        if found is None:
            known = self._names()
            if name in known:
                raise NothingKnown(f"this run did not come to {name}")
            raise NothingKnown(f"no state is called {name!r}; {nearest(name, known)}")
        text = f"{name} was come to at {self._lived[found].step.time:.1f} s"
        return Explanation(text, self._causes(self._chain(found)))

    def breach(self, name: str) -> Explanation:
        """Explain the last breach of a property.

        Raises:
            NothingKnown: there is no such property, or this run did not break it.
        """
        broken = (i for i, one in enumerate(self._lived) if broken_property(one.step) == name)
        found = max(broken, default=None)
        if found is not None:
            step = self._lived[found].step
            text = f"broken at {step.time:.1f} s: {step.event.data['detail']}"
            return Explanation(text, self._causes(self._chain(found)))
        if name in self._chart.properties:
            raise NothingKnown(f"this run did not break {name}")
        known = sorted(self._chart.properties)
        raise NothingKnown(
            f"no property is called {name!r}; {nearest(name, known)}\nproperties: {', '.join(known)}"
        )

    def is_property(self, name: str, misspelt: bool = False) -> bool:
        """Return whether a property of the missions has this name, or a `misspelt` one is like it."""
        known = self._chart.properties
        return bool(guessed(name, known)) if misspelt else name in known

    def moment(self, wall: float) -> Explanation:
        """Return where the run was at a time of the wall clock, and the cause of that.

        Raises:
            NothingKnown: the run had not begun then, or had no such clock.
        """
        before = [i for i, one in enumerate(self._lived) if one.wall is not None and one.wall <= wall]
        if not before:
            raise NothingKnown("this run had not begun then")
        last = before[-1]
        moved = next((i for i in reversed(before) if self._lived[i].step.entered), last)
        time = self._lived[last].step.time + wall - (self._lived[last].wall or wall)
        return Explanation(self._where(last, moved, time), self._causes(self._chain(moved)))

    def _where(self, last: int, moved: int, time: float) -> str:
        """Describe the state of a run after a step, with its active operations and holds."""
        states = self._chart.states
        inner = [n for n in self._lived[last].step.configuration if n and not states[n].children]
        since = time - self._lived[moved].step.time
        under_way = [
            f"{one.operation} for {time - one.started:.1f} s"
            + (f" (try {one.tries})" if one.tries > 1 else "")
            + _updated(sum(at <= time for at in one.updated))
            + (f": {one.progress}" if one.progress else "")
            for one in self._history.attempts.values()
            if one.started <= time and (one.over is None or one.over > time)
        ]
        held = [names for at, names in self._history.held if at <= time]
        parts = [
            f"in {', '.join(short_name(self._chart, name) for name in inner)} for {since:.1f} s",
            f"under way: {', '.join(under_way)}" if under_way else "",
            f"held by {', '.join(held[-1])}" if held and held[-1] else "",
        ]
        return "; ".join(filter(None, parts))

    def is_state(self, name: str) -> bool:
        """Return whether a state has this name."""
        return name in self._names()

    # -- how steps hang together ----------------------------------------------------------------------

    def _chain(self, index: int) -> list[int]:
        """Return a step and its causes, the newest first."""
        found, at = [index], self._cause(index)
        while at is not None and len(found) < self._depth:
            found.append(at)
            at = self._cause(at)
        return found

    def _cause(self, index: int) -> int | None:
        """Return the step that caused this one; None where the event is external, or it is unknown."""
        event = self._lived[index].step.event
        if event.name == PROPERTY_BROKEN:
            return index - 1 if index else None
        kind, _, word = event.name.partition(".")
        if kind == "attempt":
            return self._before(index, lambda step: _starts(step, event.data["attempt"]))
        if kind != "timer":
            return None
        owner = str(event.data["owner"])
        if word in ("timeout", "cancel"):
            return self._before(index, lambda step: _starts(step, owner))
        if word == "retry":
            state = owner.partition("[")[0]
            return self._before(index, lambda step: self._fails(step, state))
        if word == "fresh":
            inputs = self._chart.inputs.get(owner)
            return self._before(index, lambda step: _reports(step, inputs.value if inputs else owner))
        return self._before(index, lambda step: owner in step.entered)

    def _before(self, index: int, fits: Callable[[Step], bool]) -> int | None:
        """Return the last step before this one that fits; None without one."""
        return next((i for i in range(index - 1, -1, -1) if fits(self._lived[i].step)), None)

    def _fails(self, step: Step, state: str) -> bool:
        if step.event.name == "attempt.failed":
            attempt = self._history.attempts.get(step.event.data["attempt"])
        elif step.event.name == "timer.timeout":
            attempt = self._history.attempts.get(str(step.event.data["owner"]))
        else:
            return False
        return attempt is not None and attempt.state == state

    def _last_entry(self, name: str) -> int | None:
        """Return the last step that entered a state; None where none did."""
        for index in range(len(self._lived) - 1, -1, -1):
            step = self._lived[index].step
            if name in {word for moment in step.trail for word in _words(moment)}:
                before = self._before(index, lambda step: bool(step.trail))
                if before is None or name not in _words(self._lived[before].step.trail[-1]):
                    return index
            short = (short_name(self._chart, entered) for entered in step.entered if entered)
            if any(one == name or one.endswith(f".{name}") for one in short):
                return index
        return None

    def _names(self) -> set[str]:
        """Return all names of states: published ones and their own."""
        states = self._chart.states.values()
        return {word for state in states for word in (state.label, state.phase, state.local_name) if word}

    def _current_targets(self) -> Iterator[set[str]]:
        """Yield for each step the targets that were current in it: before, within, after."""
        now = ""
        for one in self._lived:
            within = {now, *(moment.target for moment in one.step.trail)}
            now = one.step.trail[-1].target if one.step.trail else now
            yield within - {""}

    # -- formatting ----------------------------------------------------------------------------------

    def _is_news(self, index: int) -> bool:
        step = self._lived[index].step
        return bool(step.changed or step.notes or step.codes or step.why or step.accepted is not None)

    def _causes(self, indices: Iterable[int]) -> tuple[Cause, ...]:
        return tuple(cause for index in indices if (cause := self._cause_of(index)) is not None)

    def _cause_of(self, index: int) -> Cause | None:
        """Return a step as a line; None where it has no line in the story."""
        one = self._lived[index]
        lines = narrate(self._chart, self._history, index, index + 1)
        if not lines:
            return None
        return Cause(lines[0], one.wall, one.by, tuple(self._reasons(one)))

    def _reasons(self, one: LivedStep) -> Iterator[Reason]:
        for name in one.step.taken:
            rule = self._rules.get(name)
            if rule is None:
                continue  # the chart's own answer to an error
            file, read = self._chart.file_of(rule.place), (one.guards or {}).get(name, ())
            yield Reason(name, file, rule.place, rule.guard.source, read)


def broken_property(step: Step) -> str:
    """Return the property whose breach a step reports; '' for none."""
    return str(step.event.data["property"]) if step.event.name == PROPERTY_BROKEN else ""


def _outcome(published: Publish) -> str:
    why = ": ".join(filter(None, (published.code, published.detail)))
    return f"{published.status} ({why})" if why else published.status


def _words(moment: Any) -> tuple[str, str]:
    return moment.lifecycle, moment.phase


def _publishes(step: Step, target: str) -> bool:
    return any(isinstance(command, Publish) and command.target == target for command in step.commands)


def _starts(step: Step, attempt: str) -> bool:
    return any(isinstance(command, Start) and command.attempt == attempt for command in step.commands)


def _reports(step: Step, value: str) -> bool:
    return step.event.name == "value" and step.event.data["name"] == value


def _updated(count: int) -> str:
    return f" (updated {count} time{'s' if count > 1 else ''})" if count else ""
