"""Compiles a scenario file to a script: resolves every name, and reports all mistakes."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache, lru_cache
from types import MappingProxyType
from typing import Any

from lupin_engine.chart.compose.timeless import own_name, read_property, scope_of
from lupin_engine.chart.expressions.values import is_expression, plain, read_constant
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.model import Chart, TemporalProperty
from lupin_engine.chart.nodes import Node, show
from lupin_engine.chart.source import Map, Seq
from lupin_engine.chart.strictness import stricter
from lupin_engine.errors import Place, nearest
from lupin_engine.machine.holds import all_holds
from lupin_engine.plugin.contract import OPERATION_CODES, Operation
from lupin_engine.plugin.parameters import narrowed
from lupin_engine.plugin.profile import START
from lupin_engine.plugin.types import DURATION, NUMBER, Type, convert, converted, innermost, problems
from lupin_engine.properties.authored import properties_of
from lupin_engine.properties.built_in import STANDSTILL
from lupin_engine.runtime.clock import UTC, calendar_of
from lupin_engine.sim.measured import Metres
from lupin_engine.sim.scenario_file import (
    END,
    EVERY,
    OPEN,
    EndNode,
    ExpectNode,
    IsClock,
    IsDuration,
    MockNode,
    MomentNode,
    NameOf,
    OutcomeNode,
    RestartNode,
    ScenarioNode,
    ScriptNode,
    WhenNode,
)
from lupin_engine.sim.scripted import AnyOf, Between, MockOutcome, OnCancel, Rule
from lupin_engine.sim.simulation import (
    LIMIT,
    NEW_YEAR,
    Ask,
    ComeBack,
    Effect,
    End,
    Happen,
    Happening,
    Leave,
    Restart,
    Script,
    SetClock,
    SetValue,
    TakeView,
    is_named,
)

#: The keys of an outcome that say how it ends; one of them at most.
_ENDS = ("done", "fail", "never", "any_of")
#: The keys of a `when` that say what happens then.
_EFFECTS = (
    "request",
    "value",
    "event",
    "fail",
    "finish",
    "server_gone",
    "server_back",
    "clock",
    "restart",
    "expect",
)
#: What is looked up -> the rule that a wrong name breaks, where that is not `unknown-WHAT`.
_RULES: Mapping[str, str] = MappingProxyType(
    {
        "code": "undeclared-code",
        "field": "unknown-argument",
        "invariant": "unknown-name",
        "operation or action": "unknown-operation",
        "phase": "unknown-name",
        "property": "unknown-name",
        "published state": "unknown-state",
        "request": "unknown-event",
        "status": "unknown-name",
        "status of a visit": "unknown-name",
        "variable": "unknown-name",
        "word": "unknown-name",
    }
)


class ScenarioNames:
    """Resolves names and reads values; a mistake becomes a finding, and None."""

    def __init__(self, chart: Chart, findings: Findings) -> None:
        self.chart = chart
        self.catalog = chart.catalog
        self.findings = findings
        operations, actions = self.catalog.operations, self.catalog.actions
        #: Those that a scenario may name: the built-in ones, the mission's and its own.
        self.properties = {STANDSTILL, *(one.name for one in properties_of(chart))}
        #: What is looked up -> what it may be called.
        self._allowed: Mapping[str, Callable[[], Collection[str]]] = {
            "hold": lambda: all_holds(chart),
            "invariant": lambda: chart.invariants,
            "operation": lambda: operations,
            "operation or action": lambda: (*operations, *actions),
            "phase": lambda: self._published("phase"),
            "property": lambda: self.properties,
            "published state": lambda: self._published("label"),
            "status": lambda: chart.profile.statuses,
            "status of a visit": lambda: (*chart.profile.statuses, OPEN),
            "variable": lambda: chart.context,
        }

    def known(self, place: Place, what: str, name: str, allowed: Collection[str], path: str = "") -> bool:
        """Say whether a name is one of those allowed."""
        if name not in allowed:
            rule = _RULES.get(what, f"unknown-{what}")
            self.findings.unknown(place, rule, path, what, name, allowed)
        return name in allowed

    def wrong(self, place: Place, path: str, problem: str, hint: str = "") -> None:
        """Report a wrong shape."""
        self.findings.add(place, "wrong-shape", path, problem, hint)

    def operation(self, place: Place, name: str) -> Operation | None:
        """Return an operation of the catalog; None after a finding with the nearest name."""
        self.known(place, "operation", name, self.catalog.operations)
        return self.catalog.operations.get(name)

    def look_up(self, node: Node, key: str, value: Any, mark: NameOf) -> None:
        """Resolve the names under `key`: a text, which may be empty, a list or the keys of a mapping."""
        for index, name in enumerate([value] if isinstance(value, str) else value or ()):
            place = node.key_at(key, name) if isinstance(value, dict) else node.at(key, index)
            if mark.what == "state":
                self._state(place, name)
            elif name or not isinstance(value, str):
                self.known(place, mark.what, name, self._allowed[mark.what](), mark.path)

    def _published(self, attribute: str) -> set[str]:
        return {getattr(state, attribute) or "" for state in self.chart.states.values()} - {""}

    def _state(self, place: Place, name: str) -> None:
        """Resolve a state by its full name or its last parts."""
        if not _has_state(self.chart, name):
            names = {state.rpartition(".")[2] for state in self.chart.states if state}
            self.known(place, "state", name, names)

    def code(self, place: Place, code: str, name: str, operation: Operation) -> None:
        """Resolve a code of an operation."""
        if code not in OPERATION_CODES:
            self.known(place, "code", code, [known.name for known in operation.codes], name)

    def value(self, place: Place, path: str, value: Any, kind: Type) -> Any:
        """Convert a value."""
        try:
            return convert(value, kind)
        except ValueError as problem:
            self.findings.add(place, "wrong-type", path, str(problem))
            return None

    def fields(
        self, node: Node, key: str, given: Mapping[str, Any], declared: Mapping[str, Type], path: str
    ) -> dict[str, Any]:
        """Convert the fields written under `key`, each to its declared type."""
        found = {}
        for name, value in given.items():
            if self.known(node.key_at(key, name), "field", name, declared, path):
                found[name] = self.value(node.value_at(key, name), f"{path}.{name}", value, declared[name])
        return found

    def variables(self, node: MomentNode) -> None:
        """Read the expected values of variables, whose names are resolved with the others."""
        for name, value in node.variables.items():
            if name in self.chart.context:
                kind, place = self.chart.context[name].type, node.value_at("variables", name)
                self.value(place, f"expect.variables.{name}", value, kind)

    def read_properties(self, node: ScenarioNode) -> dict[str, TemporalProperty]:
        """Read the properties that a scenario adds to its mission's; their names are known from then on."""
        found, scope = {}, scope_of(self.chart) if node.properties else None
        for name, one in node.properties.items():
            place = node.key_at("properties", name)
            own = own_name(name, one, place, self.findings)
            if own is None:
                continue
            if own in self.properties:
                problem = f"there is a property {own!r} already"
                self.findings.add(place, "conflicting-definition", f"properties.{name}", problem, "rename it")
            mission = next(iter(self.chart.missions), "")
            read = read_property(own, one, place, scope, self.findings, mission) if scope else None
            if read is not None:
                found[own] = read
        self.properties |= node.properties.keys() | found.keys()
        return found

    def parts(self, what: str, given: Map, declared: Mapping[str, Type], path: str) -> dict[str, Any]:
        """Read the expected values of declared arguments or fields, in the notation of missions."""
        found = {}
        for name in given:
            if self.known(given.key_place(name), what, name, declared, path):
                place = given.value_place(name)
                found[name] = self._part(given[name], place, declared[name], f"{path}.{name}")
        return found

    def _part(self, raw: Any, place: Place, kind: Type, path: str) -> Any:
        """Read an expected value; of a record, also in a list, some of the fields are enough."""
        if kind.kind == "record" and isinstance(raw, Map):
            return self.parts("field", raw, kind.fields, path)
        if kind.kind == "list" and isinstance(raw, Seq) and kind.item is not None:
            return [self._part(*one, kind.item, path) for one in zip(raw, raw.places, strict=True)]
        if is_expression(raw):
            self.wrong(place, path, f"a scenario computes nothing, got {show(raw)}", "write the value itself")
            return None
        found = Findings()
        read = read_constant(raw, place, kind, found, path)
        if isinstance(raw, (int, float)) and [one.rule for one in found.all] == ["no-unit"]:
            bare = found.all[0]
            found = Findings()
            found.extend([stricter("bare-quantity", place, path, bare.problem, bare.hint)])
            read = read_constant(f"{raw!r} {kind.unit}", place, kind, found, path)
        self.findings.extend(found.all)
        return None if read is None else read.value

    def given(self, raw: Any, place: Place, kind: Type, path: str) -> bool:
        """Say whether a value that is given to the mission is of its type; findings for each wrong part."""
        found = Findings()
        read_constant(raw, place, kind, found, path)
        is_bare = bool(found.all) and not problems(plain(raw), kind)  # older engines took base units
        if is_bare:
            bare = [stricter("bare-setting", d.place, d.path, d.problem, d.hint) for d in found.all]
            found = Findings()
            found.extend(bare)
        self.findings.extend(found.all)
        return is_bare or not found.all

    def duration(self, place: Place, path: str, value: Any) -> float | None:
        """Read a duration; nothing written is None."""
        if value is None:
            return None
        if isinstance(value, (int, float)) and value != 0:
            problem = f"a duration needs a unit, got {show(value)}"
            self.findings.add(place, "no-unit", path, problem, f"write '{value} s'")
            return None
        try:
            return float(convert(value, DURATION))
        except ValueError:
            problem = f"expected a duration, got {show(value)}"
            self.findings.add(place, "wrong-type", path, problem, "write a duration such as '5 s'")
            return None

    def clock(self, place: Place, path: str, value: str | None) -> None:
        """Check a date with a time of day."""
        try:
            calendar_of(UTC).moment(value or NEW_YEAR)
        except ValueError as problem:
            self.findings.add(place, "wrong-type", path, *str(problem).split("; "))

    def latency(self, place: Place, path: str, value: Any) -> float | Between | None:
        """Read a duration in seconds, or the ones that it lies between; None after findings."""
        if not isinstance(value, Mapping):
            return self.duration(place, path, value)
        bounds = value.get("between")
        if set(value) != {"between"} or not isinstance(bounds, list) or len(bounds) < 2:
            self.wrong(place, path, f"expected a duration, got {show(value)}", "write 'between: [1 s, 3 s]'")
            return None
        found = [self.duration(place, path, bound) for bound in bounds]
        seconds = [one for one in found if one is not None]
        if len(seconds) < len(bounds):
            return None
        if seconds != sorted(seconds):
            ordered = ", ".join(str(bound) for _, bound in sorted(zip(seconds, bounds, strict=True)))
            self.wrong(place, path, "the shortest duration comes first", f"write 'between: [{ordered}]'")
        return Between(seconds[0], seconds[-1], tuple(seconds[1:-1]))


class ScriptReader:
    """Compiles the script of a scenario."""

    def __init__(self, node: ScriptNode, words: ScenarioNames) -> None:
        self._node = node
        self._words = words

    def script(self) -> Script:
        """Return the script, as far as it can be understood."""
        node = self._node
        self._check_request()
        return Script(
            mission=next(iter(self._words.chart.missions)),
            request=node.request,
            rules=tuple(rule for mock in node.mocks for rule in self._rules(mock)),
            happenings=tuple(
                happening
                for index, when in enumerate(node.when)
                for happening in self._happenings(index, when)
            ),
            limit=self._limit(),
            starts=node.start == "ready",
            seed=node.seed,
            clock=node.clock or NEW_YEAR,
        )

    def _limit(self) -> float:
        """Return the time limit: the written one, else `LIMIT`, or a later time that the scenario names."""
        node, words = self._node, self._words
        limit = words.duration(node.at("limit"), "limit", node.limit)
        if limit is not None:
            if isinstance(node, ScenarioNode):
                self._warn_of_end(limit, node)
            return limit
        wanted: list[tuple[Node, str, Any]] = [
            (when, "at", when.at_) for when in node.when if when.at_ != END
        ]
        if isinstance(node, ScenarioNode):
            expect = node.expect
            wanted += [(expect, word, getattr(expect, word)) for word in ("within", "at_least")]
            wanted += [(one, word, getattr(one, word)) for one in expect.passes for word in ("within", "by")]
        found = [words.duration(holder.at(word), word, value) for holder, word, value in wanted]
        return max(LIMIT, *(due for due in found if due is not None), 0.0)

    def _warn_of_end(self, limit: float, node: ScenarioNode) -> None:
        """Warn of a longest duration that no run can have, because it is stopped before."""
        expect, words = node.expect, self._words
        longest = words.duration(expect.at("within"), "within", expect.within)
        if longest is not None and limit <= longest:
            problem = f"no run lasts longer than its 'limit' of {node.limit}, so this always holds"
            hint = f"write a 'limit' above {expect.within}, or leave one of them out"
            words.findings.warn(expect.at("within"), "never-applies", "expect.within", problem, hint)

    def parameters(self) -> dict[str, Any]:
        """Return the settings, checked."""
        found = {}
        declared = self._words.chart.parameters
        for name, value in self._node.parameters.items():
            key = self._node.key_at("parameters", name)
            if not self._words.known(key, "parameter", name, declared, "parameters"):
                continue
            place, kind = self._node.value_at("parameters", name), narrowed(declared[name])
            if self._words.given(value, place, kind, f"parameters.{name}"):
                found[name] = converted(plain(value), kind)
        return found

    def _check_request(self) -> None:
        """Report what the mission would refuse in its request, unless the scenario expects a refusal."""
        words, written = self._words, self._node.mapping("request")
        if written is None or (isinstance(self._node, ScenarioNode) and _may_be_refused(self._node.expect)):
            return
        (mission, *_) = words.chart.missions.values()
        for name in written:
            field = mission.request.get(name)
            if field is None and name not in words.chart.profile.request:  # every start has those
                place, hint = written.key_place(name), nearest(name, mission.request)
                problem = f"{mission.name} has no field {name!r}, which is ignored"
                words.findings.extend([stricter("ignored-field", place, "request", problem, hint)])
            if field is None or written[name] is None:
                continue
            if innermost(field.type).name not in words.catalog.readers:
                words.given(written[name], written.value_place(name), field.type, f"request.{name}")

    # -- mocks ------------------------------------------------------------------------------------------

    def _rules(self, mock: MockNode) -> Iterator[Rule]:
        operation = self._words.operation(mock.at("do"), mock.do)
        if operation is None:
            return
        declared = {name: argument.type for name, argument in operation.arguments.items()}
        given = mock.mapping("with")
        arguments = {} if given is None else self._words.parts("argument", given, declared, mock.do)
        outcomes = tuple(self._outcome(outcome, mock.do, operation) for outcome in mock.then)
        metres = None if mock.metres is None else Metres(*mock.metres.between)
        yield Rule(mock.do, outcomes, arguments, mock.target, mock.in_turn, metres, mock.hour)

    def _outcome(self, node: OutcomeNode, name: str, operation: Operation) -> MockOutcome | AnyOf:
        ends = [word for word in _ENDS if getattr(node, word) not in (None, False)]
        if len(ends) > 1:
            self._words.wrong(node.place, name, f"an attempt ends once, not in {' and '.join(ends)}")
        if node.any_of is not None:
            return self._any_of(node, name, operation)
        if node.fail is not None:
            self._words.code(node.at("fail"), node.fail, name, operation)
        on_cancel, cancel_after = self._cancel(node)
        return MockOutcome(
            after=self._latency(node, "after"),
            code=node.fail or "",
            detail=node.detail,
            result=self._words.fields(node, "done", node.done or {}, operation.result, name),
            never=node.never,
            accepted_after=None if node.accepted == "never" else self._latency(node, "accepted") or 0.0,
            on_cancel=on_cancel,
            cancel_after=cancel_after,
            cut_short=self._cut_short(node, name, operation),
            progress=node.progress,
        )

    def _cut_short(self, node: OutcomeNode, name: str, operation: Operation) -> Mapping[str, Any] | None:
        if node.cut_short is None:
            return None
        if not operation.cut_short:
            self._words.wrong(node.key_at("cut_short"), name, "it gives no result when it is cancelled")
            return None
        return self._words.fields(node, "cut_short", node.cut_short, operation.result, name)

    def _any_of(self, node: OutcomeNode, name: str, operation: Operation) -> AnyOf:
        nodes = node.any_of or []
        if not nodes:
            self._words.wrong(node.at("any_of"), name, "there is nothing to choose from")
        outcomes = tuple(self._outcome(one, name, operation) for one in nodes)
        return AnyOf(outcomes, tuple(map(self._weight, nodes)))

    def _weight(self, node: OutcomeNode) -> float:
        weight = self._words.value(node.at("weight"), "weight", node.weight, NUMBER)
        if weight is None or weight > 0.0:
            return float(weight or 1.0)
        problem = f"expected a number above 0, got {show(node.weight)}"
        self._words.findings.add(node.at("weight"), "wrong-type", "weight", problem)
        return 1.0

    def _latency(self, node: OutcomeNode, key: str) -> float | Between | None:
        return self._words.latency(node.at(key), key, getattr(node, key))

    def _cancel(self, node: OutcomeNode) -> tuple[OnCancel, float | Between]:
        """Return the server's reaction to a cancel, and the delay of its confirmation."""
        words = {kind.value: kind for kind in OnCancel}
        if isinstance(node.cancel, str) and node.cancel in words:
            return words[node.cancel], 0.0
        if isinstance(node.cancel, str) and node.cancel.isalpha():
            self._words.known(node.at("cancel"), "word", node.cancel, words, "cancel")
            return OnCancel.END, 0.0
        return OnCancel.END, self._latency(node, "cancel") or 0.0

    # -- happenings -------------------------------------------------------------------------------------

    def _happenings(self, index: int, node: WhenNode) -> Iterator[Happening]:
        """Yield the happenings of a `when`; its number leads back to it."""
        triggers = [word for word in ("at", "on", "start_of") if getattr(node, _attribute(word)) is not None]
        if len(triggers) != 1:
            problem = "say one of 'at' (a duration), 'on' (a state) and 'start_of' (an operation)"
            self._words.wrong(node.place, "when", problem)
            return
        effects: list[Effect] = [*self.effects(node)]
        if node.expect is not None:
            effects.append(TakeView())
            self._words.variables(node.expect)
        if node.at_ == END:
            if [type(effect) for effect in effects] != [TakeView]:
                self._words.wrong(node.place, "when", "at the end nothing can happen", "say 'expect' only")
            return
        if not node.model_fields_set.intersection(_EFFECTS):
            self._words.wrong(node.place, "when", "nothing happens", f"say {' or '.join(_EFFECTS)}")
        key = "after" if node.at_ is None else "at"
        wait = self._words.duration(node.at(key), key, getattr(node, _attribute(key))) or 0.0
        nth = self._nth(node)
        for effect in effects:
            yield Happening(effect, wait, node.on, nth, node.start_of, index)

    def _nth(self, node: WhenNode) -> int:
        """Return which entry or start is meant; 0 is every one."""
        if node.nth == EVERY:
            return 0
        if isinstance(node.nth, int) and not isinstance(node.nth, bool) and node.nth >= 1:
            return node.nth
        problem = f"expected a number from 1 or '{EVERY}', got {show(node.nth)}"
        self._words.wrong(node.at("nth"), "when.nth", problem)
        return 1

    def effects(self, node: WhenNode) -> Iterator[Effect]:
        """Yield the effects of a `when`."""
        words = self._words
        if node.request is not None:
            allowed = (*words.chart.profile.events, *words.chart.answers)
            words.known(node.at("request"), "request", node.request.name, allowed, "when")
            yield Ask(node.request.name, node.request.data)
        for name, value in (node.value or {}).items():
            yield from self._reports(node, name, value)
        if node.event is not None:
            yield from self._event(node)
        if node.fail is not None:
            yield self._end(node.fail, needs_code=True)
        if node.finish is not None:
            yield self._end(node.finish, needs_code=False)
        for key, effect in (("server_gone", Leave), ("server_back", ComeBack)):
            yield from map(effect, getattr(node, key))
        if node.clock is not None:
            yield SetClock(node.clock)
        if node.restart is not None:
            yield self._restart(node, node.restart)

    def _restart(self, node: WhenNode, restart: RestartNode) -> Restart:
        if restart.after is True:
            problem, hint = "expected a duration such as '5 s', got true", "write 'restart: 1 s' and a resume"
            place = node.at("restart")
            self._words.findings.extend([stricter("restart-true", place, "when.restart", problem, hint)])
            return Restart(None)
        return Restart(self._words.duration(restart.at("after"), "restart.after", restart.after) or 0.0)

    def _reports(self, node: WhenNode, name: str, value: Any) -> Iterator[SetValue]:
        """Yield the change of a live value, which may be named as the plugin or as the chart names it."""
        inputs = self._words.chart.inputs.values()
        known = {spec.value: spec.value for spec in inputs} | {spec.name: spec.value for spec in inputs}
        if self._words.known(node.key_at("value", name), "value", name, known, "when.value"):
            # A world that reports nonsense is what some scenarios are about.
            kind = replace(self._words.catalog.values[known[name]].type, minimum=None, maximum=None)
            place = node.value_at("value", name)
            yield SetValue(known[name], self._words.value(place, f"when.value.{name}", value, kind))

    def _event(self, node: WhenNode) -> Iterator[Happen]:
        assert node.event is not None, "there is an event"
        events, name = self._words.catalog.events, node.event.name
        if not self._words.known(node.at("event"), "event", name, events, "when"):
            return
        given, fields = node.event.data, events[name].fields
        key = "data" if node.event.mapping("data") is not None else name
        data = self._words.fields(node.event, key, given, fields, name)
        missing = [field for field in fields if field not in given]
        if missing:
            self._words.wrong(node.at("event"), name, f"the event has no {', '.join(missing)}")
        yield Happen(name, data)

    def _end(self, node: EndNode, needs_code: bool) -> End:
        operation = self._words.operation(node.at("do"), node.do)
        if operation is None:
            return End(node.do)
        if needs_code and not node.code:
            codes = ", ".join(code.name for code in operation.codes)
            self._words.wrong(node.place, "when.fail", f"{node.do} fails in a code", f"say one of {codes}")
        elif node.code:
            self._words.code(node.at("code"), node.code, node.do, operation)
        result = self._words.fields(node, "done", node.done, operation.result, node.do)
        return End(node.do, node.code, node.detail, result)


def _may_be_refused(expect: ExpectNode) -> bool:
    """Say whether a scenario allows that its mission is not started."""
    starts = [one for one in expect.refused if one.request in (None, START)]
    return bool(starts) or expect.only is not None


def _attribute(key: str) -> str:
    return "at_" if key == "at" else key


@lru_cache(1024)
def _has_state(chart: Chart, name: str) -> bool:
    """Say whether a state is called that; the scenarios of a folder name the same ones again and again."""
    return any(is_named(state, name) for state in chart.states if state)


@cache
def _marks(model: type[Node]) -> Mapping[str, tuple[str, Sequence[NameOf | IsDuration | IsClock]]]:
    """Return the key of each field of a model, and how it is marked."""
    return {
        name: (
            field.alias or name,
            [m for m in field.metadata if isinstance(m, (NameOf, IsDuration, IsClock))],
        )
        for name, field in model.model_fields.items()
    }


def _check_marked(
    node: Node, key: str, value: Any, mark: NameOf | IsDuration | IsClock, names: ScenarioNames
) -> None:
    if isinstance(mark, NameOf):
        names.look_up(node, key, value, mark)
    elif isinstance(mark, IsClock):
        names.clock(node.at(key), key, value)
    elif not (isinstance(node, RestartNode) and value is True):  # a row of `chart.strictness`
        names.duration(node.at(key), key, value)


def check_names(node: Node, names: ScenarioNames) -> None:
    """Check the marked names and durations in a node, and in the nodes below it."""
    fields = _marks(type(node))
    for field in node.model_fields_set:
        value, (key, marks) = getattr(node, field), fields[field]
        for mark in marks:
            _check_marked(node, key, value, mark, names)
        for inner in value if isinstance(value, list) else [value]:
            if isinstance(inner, Node):
                check_names(inner, names)
