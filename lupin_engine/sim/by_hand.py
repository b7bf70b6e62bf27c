"""Parses typed commands into effects on a simulation, against the chart and the catalogs.

An error names the nearest spelling, and nothing happens.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from lupin_engine.chart.model import Field
from lupin_engine.errors import LupinError, nearest
from lupin_engine.machine.scope import World
from lupin_engine.plugin.profile import START
from lupin_engine.plugin.types import ANY, DURATION, Type, convert
from lupin_engine.runtime.clock import UTC, calendar_of
from lupin_engine.sim.simulation import (
    Ask,
    ComeBack,
    Effect,
    End,
    Happen,
    Leave,
    PutOff,
    Script,
    SetClock,
    SetValue,
    Simulation,
)

#: Reads a word as a value of a type; what does not fit is returned as it is.
Read = Callable[[str, Type], Any]


class Wrong(LupinError):
    """A typed command is invalid; the text says why, and which ones are valid."""


class Hand:
    """Parses the commands for one simulation. What is wrong in them is raised as `Wrong`.

    Args:
        script: of the simulation.
        world: of this chart and its parameters.
        read: parses typed values.
        simulation: returns the current simulation.
    """

    def __init__(
        self, script: Script, world: World, read: Read, simulation: Callable[[], Simulation]
    ) -> None:
        self._script = script
        self._world = world
        self._chart = world.chart
        self._catalog = world.chart.catalog
        self._read = read
        self._simulation = simulation

    # -- names --------------------------------------------------------------------------------------------

    @property
    def request(self) -> Mapping[str, Field]:
        """The fields of a start."""
        return self._chart.missions[self._script.mission].request

    def event_names(self) -> list[str]:
        """Return the possible events: requests, also without their first word, and those of plugins."""
        requests = [*self._chart.profile.events, *self._chart.profile.requests, *self._chart.answers]
        return [*requests, *self._catalog.events]

    def value_names(self) -> dict[str, str]:
        """Return the settable live values, by the chart's and the plugins' names, with the plugin's name."""
        specs = self._chart.inputs.values()
        return {spec.value: spec.value for spec in specs} | {spec.name: spec.value for spec in specs}

    def choices(self, name: str) -> tuple[str, ...]:
        """Return the allowed values of a live value, if these are a few words."""
        names = self.value_names()
        if name not in names:
            return ()
        kind = self._catalog.values[names[name]].type
        return ("true", "false") if kind.kind == "bool" else tuple(kind.values)

    def codes(self, operation: str) -> list[str]:
        """Return the codes that an operation can fail with."""
        known = self._catalog.operations.get(operation)
        return [code.name for code in known.codes] if known else []

    def results(self, operation: str) -> Mapping[str, Type]:
        """Return the fields of an operation's result."""
        known = self._catalog.operations.get(operation)
        return known.result if known else {}

    def operations_under_way(self) -> list[str]:
        """Return the operations that could end now."""
        view = self._simulation().machine.view
        return list(dict.fromkeys([*(a.operation for a in view.attempts), *view.cancelling]))

    # -- words into effects -------------------------------------------------------------------------------

    def start(self, words: list[str]) -> Ask:
        """`NAME=VALUE ...`: the mission is started."""
        return Ask(START, self._fields(words, {name: field.type for name, field in self.request.items()}))

    def send(self, words: list[str]) -> Effect:
        """`EVENT NAME=VALUE ...`: send a request, or an event of a plugin."""
        name = first(words, "which event", self.event_names())
        if name == START:
            return self.start(words[1:])
        if name in self._chart.profile.requests:
            name = f"operator.{name}"
        if name in self._chart.profile.events or name in self._chart.answers:
            return Ask(name, self._fields(words[1:], {}))
        if name not in self._catalog.events:
            raise Wrong(f"unknown event {name!r}; {nearest(name, self.event_names())}")
        return Happen(name, self._fields(words[1:], self._catalog.events[name].fields))

    def set(self, words: list[str]) -> SetValue:
        """`VALUE X`: a live value changes."""
        names = self.value_names()
        name = first(words, "which value", names)
        if name not in names:
            raise Wrong(f"unknown value {name!r}; {nearest(name, names)}")
        kind = self._catalog.values[names[name]].type
        if len(words) < 2:
            raise Wrong(f"to what? {name} is a {kind}")
        return SetValue(names[name], self._value(name, " ".join(words[1:]), kind))

    def fail(self, words: list[str]) -> End:
        """`OPERATION CODE TEXT`: an operation under way fails."""
        operation = self._under_way(words)
        codes = self.codes(operation)
        code = first(words[1:], "with which code", codes)
        if code not in codes:
            raise Wrong(f"{operation} has no code {code!r}; {nearest(code, codes)}")
        return End(operation, code, " ".join(words[2:]))

    def done(self, words: list[str]) -> End:
        """`OPERATION NAME=VALUE ...`: an operation under way ends well."""
        operation = self._under_way(words)
        return End(operation, result=self._fields(words[1:], self.results(operation)))

    def silence(self, words: list[str]) -> Leave:
        """`OPERATION`: the server of a running operation stops answering."""
        return Leave(self._under_way(words))

    def answer(self, words: list[str]) -> ComeBack:
        """`OPERATION`: the server of an operation answers again."""
        away = self._simulation().away
        operation = first(words, "which operation", away)
        if operation not in away:
            raise Wrong(
                f"the server of {operation!r} is not silent" + (f"; {', '.join(away)} is" * bool(away))
            )
        return ComeBack(operation)

    def late(self, words: list[str]) -> PutOff:
        """`OPERATION DURATION`: delay the answer of a running operation."""
        return PutOff(self._under_way(words), self.duration(" ".join(words[1:])))

    def clock(self, words: list[str]) -> SetClock:
        """`DATE TIME`: the robot's clock is set."""
        try:
            calendar_of(UTC).moment(" ".join(words))
        except ValueError as problem:
            raise Wrong(str(problem)) from None
        return SetClock(" ".join(words))

    def duration(self, text: str) -> float:
        """Read a duration, in seconds; raises `Wrong` for any other text."""
        try:
            return float(convert(text, DURATION))
        except ValueError:
            raise Wrong(f"{text!r} is no duration; write one such as '90 s' or '20 min'") from None

    def _under_way(self, words: list[str]) -> str:
        running = self.operations_under_way()
        if not running:
            raise Wrong("no operation is under way")
        name = first(words, "which operation", running)
        if name not in running:
            if name in self._catalog.operations:
                raise Wrong(f"{name} is not under way; {', '.join(running)} is")
            raise Wrong(f"unknown operation {name!r}; {nearest(name, running)}")
        return name

    def _fields(self, words: Iterable[str], types: Mapping[str, Type]) -> dict[str, Any]:
        """Read `name=value` words; raises `Wrong`."""
        found = {}
        for word in words:
            name, equals, text = word.partition("=")
            if not equals:
                raise Wrong(f"{word!r} has no '='; write NAME=VALUE")
            if name not in types:
                raise Wrong(f"unknown field {name!r}; {nearest(name, types)}")
            found[name] = self._request_value(name, text, types[name])
        return found

    def _request_value(self, name: str, text: str, kind: Type) -> Any:
        """Read a field; one of a plugin's type is left to the plugin's reader."""
        item = kind.item
        if kind.name in self._world.readers:
            return text
        if item is not None and item.name in self._world.readers:
            return [part for part in text.strip("[]").replace(" ", "").split(",") if part]
        return self._value(name, text, kind)

    def _value(self, name: str, text: str, kind: Type) -> Any:
        if kind is ANY:
            return text
        try:
            return convert(self._read(text, kind), kind)
        except ValueError as problem:
            raise Wrong(f"{name}: {problem}") from None


def first(words: list[str], question: str, allowed: Iterable[str]) -> str:
    """Return the first word; without one raise Wrong, whose text is the question and what is allowed."""
    if not words:
        raise Wrong(f"{question}? {', '.join(sorted(allowed)) or 'there is none'}")
    return words[0]
