"""Equivalence classes of inputs: one representative for all values that a mission cannot distinguish.

They are both truth values, every declared word, numbers below, at and above each bound of a condition, and
the texts that conditions compare with, and another one. A value outside the cone of influence has one class;
lists have up to `targets` elements. A plugin's catalog and the author of a mission may add `classes`. Where a
condition is not understood, the values are samples only, and `left_out` says so.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from datetime import date, time
from typing import Any

from lupin_engine.chart import Chart, Compiled, Expression, Field, Input, Mission, Value
from lupin_engine.errors import shortened
from lupin_engine.machine import CLOCK, EvaluationScope, Event, Memory, World, identity_of
from lupin_engine.machine import event as events
from lupin_engine.plugin import ANY as ANY_TYPE
from lupin_engine.plugin import (
    DATE,
    OPERATION_CODES,
    START,
    TIME_OF_DAY,
    Type,
    number_text,
    value_text,
    within,
)
from lupin_engine.runtime import requests_of
from lupin_verify.situations.compared import (
    ANY,
    Compared,
    Read,
    field_of,
    part,
    part_of_element,
    side,
    types_below,
)
from lupin_verify.situations.relevance import (
    Relevance,
    distinguished_lengths,
    invokes,
    reads,
)

#: The robot's clock at the beginning, in POSIX time: six in the morning of 2026-01-01, UTC.
MORNING = 1767247200.0
#: The mission id in a proof.
MISSION_ID = "proof"
#: The most combinations of fields of one result, event or request that are tried.
MOST_COMBINED = 16
#: The most elements of a default list that conditions tell apart, each of which is tried alone, too.
MOST_APART = 6
#: Numbers that are tried of a value that conditions read in another way than by comparing it with constants.
_SAMPLES = (-1000.0, -1.0, 0.0, 1.0, 1000.0)
#: How many values of one read are listed in words, and the most letters of each.
MOST_LISTED, MOST_LETTERS = 8, 40


class Classes:
    """The representative values of one chart with its parameters."""

    def __init__(self, world: World, relevance: Relevance, targets: int) -> None:
        """Compute the values.

        Args:
            world: the chart with its parameters.
            relevance: the cone of influence.
            targets: the most elements of lists.
        """
        self.world = world
        self.chart: Chart = world.chart
        self.targets = targets
        self._env = EvaluationScope(world, Memory())
        #: The lengths of itineraries and `for_each` whose lists are constant, by state: walked as they are.
        self.fixed = dict(self._fixed_lists())
        #: Whether lists were tried with up to `targets` elements only.
        self.cuts_lists = False
        counted = max((targets, *self.fixed.values()))
        self.compared, self._parameters = Compared(world, relevance, counted), relevance.parameters
        #: Sentences about fields and lists of which fewer values are tried than there may be.
        self._reduced_values: dict[str, None] = {}
        #: The tried values of each deciding read.
        self._tried: dict[Read, dict[str, Any]] = {}
        #: The types of what was tried of elements.
        self._part_kinds: dict[Read, tuple[Type, ...]] = {}
        self._operations = {invoke.name: invoke.operation for _, invoke in invokes(world.chart)}
        #: The results that plugins and authors add, by operation.
        self._more = {name: list(operation.classes) for name, operation in self._operations.items()}
        for _, invoke in invokes(world.chart):
            self._more[invoke.name] += invoke.classes
        self.names: list[str] = []
        relevance.clock_key = self.clock_key
        #: A moment of each class of the robot's clock; empty if no condition reads it.
        self.moments = tuple(self._moments())
        starts = {m.name: self._starts(m) for m in self.chart.missions.values()}
        self.requests = tuple(self._requests(starts))
        self.values = tuple(self._values())
        self.events = tuple(self._events())

    # -- the robot's clock --------------------------------------------------------------------------------

    def _moments(self) -> Iterator[Event]:
        """Yield a moment of each class of dates and times of day; `says` has it in words."""
        calendar = self.world.calendar
        if calendar is None or not self.compared.decides(("clock",)):
            return
        today, now = calendar.shown(MORNING)
        dates = self._variants(("clock", "today"), DATE, today)
        times = self._variants(("clock", "time"), TIME_OF_DAY, now)
        for each in itertools.product(dates, times):
            yield Event(CLOCK, {"ahead": self.moment(*each), "says": " ".join(each)})

    def moment(self, day: str, time: str) -> float:
        """Return the moment at which the robot's clock comes to a time of a day (a date)."""
        calendar = self.world.calendar
        assert calendar is not None, "there is no clock without a calendar"
        days = (
            date.fromisoformat(day).toordinal() - date.fromisoformat(calendar.shown(MORNING)[0]).toordinal()
        )
        found, _ = calendar.next(time, MORNING + 86400.0 * (days - 2), ())
        while calendar.shown(found)[0] < day:
            found, _ = calendar.next(time, found, ())
        return found

    def time_comes(self, time: str, wall: Callable[[], float | None]) -> float:
        """Return the moment at which a wait for a time of day ends, given the clock before.

        Which day that is matters only if a condition reads the date.
        """
        calendar = self.world.calendar
        assert calendar is not None, "there is no clock without a calendar"
        is_read = self.compared.decides(("clock", "today"))
        before = wall() if is_read else None
        return self.moment(calendar.shown(MORNING if before is None else before)[0], time)

    def clock_key(self, moment: float) -> str:
        """Return the class of a moment."""
        assert self.world.calendar is not None, "there is no clock without a calendar"
        today, time = self.world.calendar.shown(moment)
        return repr(self.compared.abstracted(("clock",), {"today": today, "time": time}))

    def _walked(self) -> Iterator[tuple[str, str, Value]]:
        """Yield the lists that states walk: what expressions call an element, the state and the list."""
        for name, state in self.chart.states.items():
            if state.itinerary is not None:
                yield "target", name, state.itinerary.items
            if state.for_each is not None:
                yield "item", name, state.for_each.items

    def _fixed_lists(self) -> Iterator[tuple[str, int]]:
        for _, name, value in self._walked():
            items = self._constant_list(value)
            if items is not None:
                yield name, len(items)

    def _constant_list(self, value: Value) -> Sequence[Any] | None:
        """Return the value of an expression that reads nothing but parameters; None of another one."""
        if isinstance(value, Expression):
            is_known = isinstance(value.evaluate, Compiled)
            if not is_known or any(root != "param" for root, _ in reads(value)):
                return None
        try:
            found = value.evaluate(self._env)
        except Exception:  # a plugin's function raises
            return None
        return found if isinstance(found, list) else None

    def _is_fixed(self, read: Read) -> bool:
        """Return whether a read is of elements of constant lists only."""
        walked = [value for root, _, value in self._walked() if root == read[0]]
        return bool(walked) and all(self._constant_list(value) is not None for value in walked)

    # -- requests -----------------------------------------------------------------------------------------

    def _requests(self, starts: Mapping[str, list[Event]]) -> Iterator[Event]:
        for request in requests_of(self.chart):
            if request.event.name == START:
                yield from starts[request.mission]
            else:
                yield request.event

    def _starts(self, mission: Mission) -> list[Event]:
        """Return the start events of a mission, one for each combination of its request's fields."""
        fields = {name: self._field(field) for name, field in mission.request.items()}
        given = {"mission_type": mission.name, "mission_id": MISSION_ID}
        return [
            Event(START, {**given, **each}) for each in self._combined(f"start of {mission.name}", fields)
        ]

    def _field(self, field: Field) -> list[Any]:
        read, usual = ("request", field.name), self._default(field)
        if field.type.item is not None:
            self.cuts_lists = True
            lists = self._lists(read, field.type.item, usual)
            most, longest = min(self.targets, field.type.maximum or self.targets), max(map(len, lists))
            if longest < most and self.compared.decides(read):
                self._note_reduced(f"request.{field.name}: only lists of 0 to {longest} elements were tried")
            for one in lists:
                self._record(read, one)
                for element in one if self.compared.elements(read, field.type.item) else ():
                    self._tried.setdefault((*read, ANY), {})[repr(element)] = element
            return lists
        kind = within(field.type, field.minimum, None)
        if usual is not None and kind.name in self.world.readers:
            return [identity_of(usual)]
        if kind.kind == "integer":  # it may be a number of elements
            is_open = any(self._constant_list(value) is None for _, _, value in self._walked())
            self.cuts_lists = self.cuts_lists or (is_open and self.compared.decides(read))
            least = int(max(field.minimum or 0, field.type.minimum or 0))
            counts = list(range(least, max(least, self.targets) + 1))
            usual = [] if usual is None else [usual]
            return self._distinguished(read, [*counts, *usual, *self._numbers([read], kind)])
        return self._variants(read, kind, self.sample(kind, 1) if usual is None else usual)

    def _lists(self, read: Read, kind: Type, usual: Any) -> list[Any]:
        """Return lists of every length from 0 on: an empty one may have to be refused.

        A value of each class of those that conditions compare elements with is tried alone, too, and behind
        the first element. So is one of each kind of the `usual` elements, also before the first one.
        """
        given = list(usual) if isinstance(usual, list) else []
        items = given[: self.targets]
        samples = [self.sample(kind, n) for n in range(1, self.targets + 1)]
        apart = _apart(self.compared.elements(read, kind), kind)
        kinds = self._kinds_of(read, given, kind)
        if not items:
            items = apart or samples
        elif kind.name in self.world.readers:
            items, kinds = [identity_of(item) for item in items], [identity_of(item) for item in kinds]
        else:
            items += [*apart, *samples]
        items = [one for at, one in enumerate(items) if one not in items[:at]][: self.targets]
        self.names += [str(item) for item in items if isinstance(item, str)]
        # Targets that no condition tells apart are interchangeable: the first ones stand for all.
        lists = [items[:count] for count in range(len(items) + 1)]
        more = [[*items[:before], one] for one in apart for before in range(min(2, self.targets))]
        for one in kinds[1:]:
            more += [each for each in ([one], [kinds[0], one], [one, kinds[0]]) if len(each) <= self.targets]
        for one in more:
            if one not in lists and one[1:] != one[:1]:
                lists.append(one)
        self._record_parts(kind, [one for each in lists for one in each])
        return lists

    def _kinds_of(self, read: Read, given: Sequence[Any], kind: Type) -> list[Any]:
        """Return the first element of each kind that conditions tell apart; of too many, the first ones."""
        found: dict[str, Any] = {}
        for one in given:
            found.setdefault(self.compared.kind_of_element(self._as_read(one, kind)), one)
        if len(found) > MOST_APART:
            self._note_reduced(
                f"{self._shown(read)}: conditions tell {len(found)} kinds of its elements apart, and"
                f" {MOST_APART} were tried"
            )
        return list(found.values())[:MOST_APART]

    def _as_read(self, element: Any, kind: Type) -> Any:
        """Return an element as conditions see it: a plugin may read it by its name."""
        reader = None if isinstance(element, Mapping) else self.world.readers.get(kind.name)
        try:
            return element if reader is None else reader(element)
        except Exception:  # it is not known now
            return element

    def _record_parts(self, kind: Type, elements: Sequence[Any]) -> None:
        """Record what was tried of elements, under each unclear read of them."""
        for read in self.compared.unclear:
            names = part_of_element(read)
            if names is None:
                continue
            self._part_kinds[read] = (*types_below(kind, names), *self._part_kinds.get(read, ()))
            for element in elements:
                value = field_of(self._as_read(element, kind), names)
                self._tried.setdefault(read, {})[repr(value)] = value

    def _default(self, field: Field) -> Any:
        try:
            return None if field.default is None else field.default.evaluate(self._env)
        except Exception:  # an input is not known, or a plugin's function raises
            return None

    # -- live values and events ---------------------------------------------------------------------------

    def _values(self) -> Iterator[Event]:
        for name in sorted({spec.value for spec in self.chart.inputs.values()}):
            specs = [spec for spec in self.chart.inputs.values() if spec.value == name]
            found: dict[str, Any] = {}
            for value in (value for spec in specs for value in self._of_input(spec, specs)):
                apart = [self.compared.abstracted(("input", spec.name), value) for spec in specs]
                found.setdefault(repr(apart), value)
            for spec, value in itertools.product(specs, found.values()):
                self._record(("input", spec.name), value)
            if not any(self.compared.decides(("input", spec.name)) for spec in specs):
                found = dict(list(found.items())[:1])
            for value in found.values():
                yield events.observed(name, value, 0.0)

    def _of_input(self, spec: Input, specs: Sequence[Input]) -> list[Any]:
        """Return values of an input, by the bounds of all inputs of its live value."""
        declared = self.chart.catalog.values.get(spec.value)
        kind = declared.type if declared is not None else spec.type
        first = () if spec.initial is None else (spec.initial,)
        read, more = ("input", spec.name), (*(declared.classes if declared else ()), *spec.classes, *first)
        if kind.kind == "list" and kind.item is not None:
            found = self._of_list(kind, [])
            most = math.inf if spec.of_mission else distinguished_lengths(self.chart, spec.name)
            self.cuts_lists = self.cuts_lists or most > self.targets
            if not spec.of_mission:  # more are too many alike
                found = [value for value in found if len(value) <= most]
            return [*found, *more]
        kind = within(kind, spec.minimum, spec.maximum)
        usual = self.sample(kind, 1)
        if kind.kind in ("number", "integer"):
            return [*(self._numbers([("input", each.name) for each in specs], kind) or [usual]), *more]
        return [usual, *self._others(read, kind, usual), *more]

    def _events(self) -> Iterator[Event]:
        heard = {rule.event for state in self.chart.states.values() for rule in state.transitions}
        for name, kind in sorted(self.chart.catalog.events.items()):
            if name in heard or any(e.endswith("*") and name.startswith(e[:-1]) for e in heard if e):
                fields = {
                    field: self._variants(("event", field), of, self.sample(of, 1))
                    for field, of in kind.fields.items()
                }
                yield from (Event(name, data) for data in self._combined(name, fields))

    # -- answers of servers -------------------------------------------------------------------------------

    def results(self, operation: str, arguments: Mapping[str, Any]) -> Sequence[Mapping[str, Any]]:
        """Return the results of an operation's success, one of each class."""
        declared = self._operations[operation]
        mocked = declared.mock.result
        known = mocked(arguments, self.world.parameters) if callable(mocked) else mocked
        usual = {name: self.sample(kind, 1) for name, kind in declared.result.items()} | dict(known)
        fields = {
            name: self._variants(("event", name), kind, usual[name]) for name, kind in declared.result.items()
        }
        more = ({**usual, **one} for one in self._more[operation])
        return self._distinguished(("event",), [*self._combined(operation, fields), *more])

    def codes(self, operation: str) -> list[str]:
        """Return an operation's own codes, and the one of a driver that fails."""
        own = [code.name for code in self._operations[operation].codes]
        return [*own, OPERATION_CODES[0]]

    def reported_inputs(self, operation: str, arguments: Mapping[str, Any]) -> tuple[str, ...]:
        """Return the inputs that are known after a success of an operation: it sets their live values."""
        known = self._operations[operation].mock.values
        names = known(arguments, self.world.parameters) if callable(known) else known
        return tuple(spec.name for spec in self.chart.inputs.values() if spec.value in names)

    def reports(self, operation: str, arguments: Mapping[str, Any]) -> list[Event]:
        """Return the possible reports of these live values during an operation."""
        values = {self.chart.inputs[name].value for name in self.reported_inputs(operation, arguments)}
        return [event for event in self.values if event.data["name"] in values]

    def gives_result(self, operation: str) -> bool:
        """Return whether a cancelled operation gives a result."""
        return self._operations[operation].cut_short

    # -- types --------------------------------------------------------------------------------------------

    def _variants(self, read: Read, kind: Type, usual: Any) -> list[Any]:
        """Return a usual value, and others that conditions distinguish from it."""
        if not self.compared.decides(read):
            return [usual]
        return self._distinguished(read, [usual, *self._others(read, kind, usual)])

    def _others(self, read: Read, kind: Type, usual: Any) -> Iterable[Any]:
        if kind.kind == "bool":
            return [False, True]
        if kind.kind in ("number", "integer"):
            return self._numbers([read], kind)
        if kind.kind == "text":
            return kind.values or self._words(read, kind, usual)
        if kind.named:
            return self._of_named(read, kind, usual)
        if kind.kind == "list":
            self.cuts_lists = True
            return self._of_list(kind, usual)
        parts = {name: self._variants((*read, name), of, usual[name]) for name, of in kind.fields.items()}
        return self._combined(self._shown(read), parts)

    def _numbers(self, reads: Sequence[Read], kind: Type) -> list[Any]:
        """Return numbers around the bounds of some reads of one value; samples, too, if one is unclear."""
        around = _around((edge for read in reads for edge in self.compared.edges(read)), kind)
        if self.compared.unclear.keys().isdisjoint(reads):
            return around
        low = -math.inf if kind.minimum is None else kind.minimum
        high = math.inf if kind.maximum is None else kind.maximum
        samples = (one for one in (low, high, *_SAMPLES) if low <= one <= high and math.isfinite(one))
        of_kind = int if kind.kind == "integer" else float
        return list(dict.fromkeys([*around, *map(of_kind, samples)]))

    def _words(self, read: Read, kind: Type, usual: str) -> list[str]:
        """Return the texts that conditions name and another one; note where there is no other one."""
        compared = self.compared.texts(read)
        words = _texts_around([*compared, usual], kind)
        if not set(words) - set(compared):
            self._note_reduced(
                f"{self._shown(read)}: no other text was tried than those that conditions name"
            )
        return words

    def _of_named(self, read: Read, kind: Type, usual: Any) -> Iterator[Any]:
        """Yield lists of records of name and value, with every value that is read, and without it."""
        parts: dict[str, list[Any]] = {}
        for name, of in kind.named.items():
            if self.compared.decides((*read, name)):
                known = part(usual, name)
                value = self.sample(of, 1) if known is None else known
                parts[name] = [*self._variants((*read, name), of, value), None]
        others = [one for one in usual if one["name"] not in parts]
        for found in self._combined(self._shown(read), parts):
            named = [{"name": name, "value": one} for name, one in found.items() if one is not None]
            yield [*others, *named]

    def _of_list(self, kind: Type, usual: Sequence[Any]) -> list[Any]:
        most = int(min(self.targets, kind.maximum if kind.maximum is not None else self.targets))
        assert kind.item is not None
        items = [*usual, *(self.sample(kind.item, n) for n in range(len(usual) + 1, max(1, most) + 1))]
        return [items[:count] for count in range(max(1, most) + 1)]

    def sample(self, kind: Type, number: int) -> Any:
        """Return a sample of a type; other numbers give other samples, where there are others."""
        if kind.kind == "bool":
            return number % 2 == 0
        if kind.kind in ("number", "integer"):
            return _sample_number(kind, number)
        if kind.kind == "record":
            return {name: self.sample(of, number) for name, of in kind.fields.items()}
        if kind.kind == "list":
            return [self.sample(kind.item, number)] if kind.item is not None and not kind.named else []
        if kind.kind != "text":
            return None
        if kind.values:
            return kind.values[0]
        if kind.example:
            return kind.example
        return self.names[number - 1] if number <= len(self.names) else f"x{number}"

    def _combined(self, what: str, fields: Mapping[str, Sequence[Any]]) -> list[dict[str, Any]]:
        """Return records with every combination of the fields' values.

        Of more than `MOST_COMBINED`, each value is in at least one record, and the report says so.
        """
        if math.prod(map(len, fields.values())) <= MOST_COMBINED:
            return [dict(zip(fields, values, strict=True)) for values in itertools.product(*fields.values())]
        self._note_reduced(f"{what}: not every combination of its fields")
        usual = {name: values[0] for name, values in fields.items()}
        return [usual, *({**usual, name: one} for name, values in fields.items() for one in values[1:])]

    def _distinguished(self, read: Read, values: Sequence[Any]) -> list[Any]:
        """Return one value of each class, and record them as tried."""
        found: dict[str, Any] = {}
        for value in values:
            found.setdefault(repr(self.compared.abstracted(read, value)), value)
        for value in found.values():
            self._record(read, value)
        return list(found.values())

    def _record(self, read: Read, value: Any) -> None:
        below = [one for one in self.compared.read or () if one[: len(read)] == read and ANY not in one]
        if any(one == read[: len(one)] for one in self.compared.read or ()):
            below = [read]
        for one in below:
            if read == ("event",) and one[1:2] and one[1] not in value:
                continue  # it is a field of other results
            inner = _part_of(value, one[len(read) :])
            if isinstance(value, list) and not self.compared.edges(one) and one == read:
                inner = len(value)
            self._tried.setdefault(one, {})[repr(inner)] = inner

    def _note_reduced(self, what: str) -> None:
        self._reduced_values[what] = None

    # -- in words -----------------------------------------------------------------------------------------

    @property
    def untried_reads(self) -> list[Read]:
        """The reads of which fewer values are tried than there are classes."""
        return [read for read in sorted(self.compared.unclear) if not self._is_tried(read)]

    def _is_tried(self, read: Read) -> bool:
        values = self._tried.get(read, {}).values()
        is_both = {False, True} == {one for one in values if isinstance(one, bool)}
        return read[0] in ("context", "given") or self._is_fixed(read) or is_both

    @property
    def left_out(self) -> list[str]:
        """Sentences about the reads of which fewer values are tried than there are classes."""
        found = list(self._reduced_values)
        for read in self.untried_reads:
            source = self.compared.unclear[read]
            text = self._values_text(read)
            only = f"only {text} {'was' if len(self._tried.get(read, ())) == 1 else 'were'} tried"
            what = only if text else "no other values were tried"
            found.append(f"{self._shown(read)}: {what}, although `{source}` reads it")
        return found

    def words(self) -> list[str]:
        """Return sentences that list the tried values of deciding reads, and the deciding parameters."""
        found = [
            f"Tried as {self._shown(read)}: {self._values_text(read)}."
            for read in sorted(self._tried)
            if read[0] != "context"
            and read not in self.compared.unclear
            and read in (self.compared.read or ())
        ]
        known = {name: one for name, one in self.chart.parameters.items() if name in self._parameters}
        texts = (
            f"{name} = {_text(self.world.parameters.get(name, one.default), one.type)}"
            for name, one in known.items()
        )
        return [
            *found,
            *([f"Conditions and times read these parameters: {', '.join(texts)}."] if known else []),
        ]

    def _values_text(self, read: Read) -> str:
        kinds = self.compared.kinds(read) or self._part_kinds.get(read, ())
        kind = next(iter(kinds), ANY_TYPE)
        values = list(self._tried.get(read, {}).values())
        numbers = sorted(one for one in values if isinstance(one, (int, float)))
        values = [*numbers, *(one for one in values if not isinstance(one, (int, float)))]
        texts = [_text(one, ANY_TYPE if kind.kind == "list" else kind) for one in values]
        more = len(texts) - MOST_LISTED
        if kind.kind == "list":
            return f"lists of {', '.join(texts[:MOST_LISTED])} elements"
        return ", ".join(texts[:MOST_LISTED]) + (f" and {more} more" if more > 0 else "")

    def _shown(self, read: Read) -> str:
        """Return a read as authors write it."""
        text = ".".join(read[:2])
        for number in range(2, len(read)):
            named = any(kind.named for kind in self.compared.kinds(read[:number]))
            text += f"['{read[number]}']" if named else f".{read[number]}"
        return text


def parameter_classes(world: World) -> Iterator[tuple[str, Any]]:
    """Yield a value of each other class of each parameter in the cone of influence, one parameter at a time.

    Classes are both truth values, every word, and numbers below, at and above each bound of a condition.
    """
    relevance = Relevance(world.chart)
    read, compared = relevance.parameters, Compared(world, relevance, -1)
    for name, parameter in world.chart.parameters.items():
        given, kind = world.parameters.get(name, parameter.default), parameter.type
        if name not in read:
            continue
        if kind.kind == "bool":
            yield name, not given
        elif kind.values:
            yield from ((name, word) for word in kind.values if word != given)
        elif kind.kind == "text":
            words = _texts_around([*compared.texts(("param", name)), given], kind)
            yield from ((name, word) for word in words if word != given)
        elif kind.kind in ("number", "integer"):
            edges = compared.edges(("param", name))
            known = {side(given, edges)}
            for value in _around(edges, within(kind, parameter.minimum, parameter.maximum)):
                if side(value, edges) not in known:
                    known.add(side(value, edges))
                    yield name, value


def _text(value: Any, kind: Type) -> str:
    """Return a value as people read it, shortened."""
    if value is None:
        return "nothing"
    if kind.kind == "number" and isinstance(value, float):
        return " ".join(filter(None, number_text(value, kind.unit)))
    return shortened(value_text(value, kind), MOST_LETTERS)


def _apart(named: Sequence[Any], kind: Type) -> list[Any]:
    """Return a value of each class of elements that conditions compare with the `named` ones."""
    if not named:
        return []
    return _texts_around(named, kind) if kind.kind == "text" else _around(named, kind)


def _texts_around(compared: Iterable[str], kind: Type) -> list[str]:
    """Return the compared texts and others: another word, or a minute or day before and after each."""
    words = list(dict.fromkeys(compared))
    if kind.name == TIME_OF_DAY.name:
        near = [time.fromisoformat(word) for word in words]
        minutes = {60 * one.hour + one.minute + more for one in near for more in (-1, 0, 1)}
        return [f"{one // 60:02}:{one % 60:02}" for one in sorted(minutes) if 0 <= one < 24 * 60]
    if kind.name == DATE.name:
        near_days = {date.fromisoformat(word).toordinal() + more for word in words for more in (-1, 0, 1)}
        days = sorted(one for one in near_days if 1 <= one <= date.max.toordinal())
        return [date.fromordinal(one).isoformat() for one in days]
    if kind.pattern or kind.example:  # other words are not known
        return words
    number = next(n for n in itertools.count(1) if f"x{n}" not in words)
    return [*words, f"x{number}"]


def _around(bounds: Iterable[float], kind: Type) -> list[Any]:
    """Return numbers below, at, between and above some bounds, within the type's range."""
    edges = sorted(set(bounds))
    if not edges:
        return []
    low, high = kind.minimum, kind.maximum
    low = (edges[0] if high is None else min(edges[0], high)) - 2.0 if low is None else low
    high = max(edges[-1], low) + 2.0 if high is None else high
    if kind.kind == "integer":
        near = (whole + more for whole in map(math.floor, edges) for more in (0, -1, 1, 2))
        return [value for value in dict.fromkeys(near) if low <= value <= high]
    inside = [edge for edge in edges if low <= edge <= high]
    between = [(one + other) / 2.0 for one, other in itertools.pairwise([low, *inside, high])]
    return sorted({*inside, *between})


def _sample_number(kind: Type, number: int) -> float:
    low = (kind.minimum if kind.minimum is not None else 0.0) + number - 1
    low = low if kind.maximum is None else min(low, kind.maximum)
    return int(low) if kind.kind == "integer" else float(low)


def _part_of(value: Any, way: Iterable[Any]) -> Any:
    """Return the part of a value at a path; None where there is none."""
    for name in way:
        value = None if value is None else part(value, name)
    return value
