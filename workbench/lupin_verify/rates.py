"""Reads the file of a campaign: the rates of faults and events; and makes the default rates.

    campaign: a rough week
    limit: 24 h                    # of operation, for each seed
    targets: {between: [1, 29]}    # of those that the mission would visit by itself
    mocks:                         # as in a scenario; chance is drawn for every attempt
      - do: nav.go
        then: {any_of: [{weight: 95 %}, {weight: 4 %, fail: blocked}, {weight: 1 %, never: true}]}
    defaults: false                # else what happens by default happens as well
    chance:                        # what happens every so often, on average
      - every: 3 h
        do: [{value: {stop: true}}, {after: {between: [1 s, 5 min]}, value: {stop: false}}]

Operations without a mock answer as `default_rules` say; a mission that has ended, or waits for a person, gets
the request that goes on (`around_the_clock`). Without `limit` a seed runs for an hour. A file that `learning`
wrote says also what it was learned from (`learned`), and what live values lose (`drain`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from lupin_engine.chart import Chart, Findings, Input, Invoke, Map, Node, State, Written, read, validate
from lupin_engine.errors import ChartError
from lupin_engine.plugin import MISSING, NUMBER, START, Operation
from lupin_engine.runtime import make_world
from lupin_engine.sim import (
    OPERATION,
    AnyOf,
    Ask,
    Between,
    Drain,
    Duration,
    Effect,
    Happen,
    Happening,
    Latency,
    Measured,
    MockOutcome,
    OnCancel,
    Rule,
    ScenarioNames,
    Script,
    ScriptNode,
    ScriptReader,
    SetValue,
    WallTime,
    WhenNode,
    check_names,
)
from lupin_verify.situations.classes import Classes
from lupin_verify.situations.relevance import Relevance

#: The default length of each seed's run, in seconds.
SHIFT = 3600.0
#: The mean time between changes of a live value, in seconds; the most elements of lists.
CHANGES, MOST_ELEMENTS = 300.0, 6
#: The mean time between two events of one kind of a plugin, in seconds.
EVENT_EVERY = 600.0


class ChanceStepNode(WhenNode):
    """One of these effects; `after` counts from the first of them."""

    after: Latency = Field(None, description="duration from the beginning")


class ChanceNode(Node):
    """Effects that come at a mean rate, at random times."""

    every: Duration = Field(description="mean time between two of them")
    do: list[ChanceStepNode] = Field(description="what happens then, in order")


class LearnedNode(Node):
    """What a file was learned from."""

    missions: int = Field(description="how many missions")
    from_: WallTime = Field(alias="from", description="when the first began")
    to: WallTime = Field(description="when the last ended")
    parameters: dict[str, Any] = Field(default_factory=dict, description="settings of the newest mission")
    values: dict[str, Any] = Field(default_factory=dict, description="live values with which missions began")
    seen: Annotated[dict[str, dict[str, int]], OPERATION] = Field(
        default_factory=dict, description="attempts of each operation at each target"
    )


class DrainNode(Node):
    """What a live value loses."""

    value: str = Field(description="live value, as the plugin names it")
    per_metre: Written = Field(0, description="what it loses with each metre that is driven")
    per_minute: Written = Field(0, description="what it loses with each minute")
    metres: float = Field(0, description="how many metres this was learned from")
    minutes: float = Field(0, description="how many minutes this was learned from")


class CampaignNode(ScriptNode):
    """Random worlds: the answers of servers, and events, each at its rate."""

    campaign: str = Field(description="one sentence: what kind of world it is")
    targets: Any = Field(None, description="how many of its targets a mission gets: a number, or `between`")
    chance: list[ChanceNode] = Field(default_factory=list, description="what happens every so often")
    defaults: bool = Field(
        True, description="whether requests, live values and events come at their default rates, too"
    )
    learned: LearnedNode | None = Field(None, description="what the file was learned from")
    drain: list[DrainNode] = Field(default_factory=list, description="what live values lose")


@dataclass(frozen=True)
class Chance:
    """Effects that come every so often; each a time after the first, drawn where it is a `Between`."""

    every: float
    effects: tuple[tuple[float | Between, Effect], ...]


@dataclass(frozen=True)
class Rates:
    """The rates of random worlds. `targets` are the fewest and the most; None: as the request says.

    `own` is what the file says, without defaults; `learned` what it was learned from.
    """

    name: str
    script: Script
    chances: tuple[Chance, ...]
    targets: tuple[int, int] | None = None
    parameters: Mapping[str, Any] = field(default_factory=dict)
    own: Script = field(default_factory=lambda: Script(""))
    learned: LearnedNode | None = None


# -- without a file --------------------------------------------------------------------------------------


def default_rates(chart: Chart) -> Rates:
    """Return the rates without a file: every declared fault happens now and then."""
    mission = next(iter(chart.missions))
    script = Script(mission, {}, default_rules(chart), around_the_clock(chart), SHIFT)
    return Rates("everything goes wrong now and then", script, tuple(default_chances(chart)))


def default_rules(chart: Chart) -> tuple[Rule, ...]:
    """Return a rule for each operation: it mostly succeeds, and now and then ends in every other way."""
    operations = {
        invoke.name: invoke.operation for state in chart.states.values() for invoke in _invokes(state)
    }
    return tuple(Rule(name, (_outcomes(operation),)) for name, operation in sorted(operations.items()))


def _invokes(state: State) -> Iterator[Invoke]:
    if state.invoke is not None:
        yield state.invoke
    if state.for_each is not None:
        yield state.for_each.invoke


def _outcomes(operation: Operation) -> AnyOf:
    takes = Between(0.5, max(1.0, 4.0 * operation.mock.after))
    ends: list[tuple[float, MockOutcome | AnyOf]] = [
        (88.0, MockOutcome(after=takes)),
        (2.0, MockOutcome(never=True)),
        (1.0, MockOutcome(accepted_after=None)),
        (1.0, MockOutcome(after=takes, accepted_after=Between(0.1, 6.0))),
        (1.0, MockOutcome(after=takes, on_cancel=OnCancel.IGNORE)),
        (1.0, MockOutcome(after=takes, on_cancel=OnCancel.SILENT)),
        (1.0, MockOutcome(after=takes, cancel_after=Between(0.0, 6.0))),
    ]
    if operation.codes:
        fails = tuple(MockOutcome(code=code.name, after=takes) for code in operation.codes)
        ends.append((5.0, AnyOf(fails, (1.0,) * len(fails))))
    varied = tuple(MockOutcome(after=takes, result=result) for result in _results(operation))
    if varied:
        ends[0] = (68.0, ends[0][1])
        ends.append((20.0, AnyOf(varied, (1.0,) * len(varied))))
    weights, outcomes = zip(*ends, strict=True)
    return AnyOf(outcomes, weights)


def _results(operation: Operation) -> Iterator[dict[str, Any]]:
    """Yield results with one field other than the mock's: a truth value, a word, an end of a range.

    The classes of the catalog are among them.
    """
    for name, kind in operation.result.items():
        values: tuple[Any, ...] = (False, True) if kind.kind == "bool" else tuple(kind.values or ())
        if kind.kind in ("number", "integer"):
            values = tuple(end for end in (kind.minimum, kind.maximum) if end is not None)
        yield from ({name: value} for value in values)
    yield from map(dict, operation.classes)


def default_chances(chart: Chart) -> Iterator[Chance]:
    """Yield the default rates of requests, changes of live values, and events of plugins that are handled."""
    resume = f"operator.{chart.profile.resume}"
    for event in (*chart.profile.events, *chart.answers):
        every = 1200.0 if event == resume else 3600.0
        yield Chance(every, ((0.0, Ask(event)),))
    some = (Between(1.0, 120.0), SetValue(MISSING, []))
    yield Chance(7200.0, ((0.0, SetValue(MISSING, ["a server that is needed"])), some))
    for found in chart.inputs.values():
        usual, others = _values(found)
        for value in others:
            back = (Between(0.5, 300.0), SetValue(found.value, usual))
            yield Chance(3600.0 * len(others), ((0.0, SetValue(found.value, value)), back))
    classes = Classes(make_world(chart, {}), Relevance(chart), MOST_ELEMENTS)
    yield from _reports_by_class(chart, classes)
    counts = Counter(event.name for event in classes.events)
    for reported in classes.events:
        yield Chance(EVENT_EVERY * counts[reported.name], ((0.0, Happen(reported.name, reported.data)),))


def _reports_by_class(chart: Chart, classes: Classes) -> Iterator[Chance]:
    """Yield reports of a proof's representative values for inputs without a usual one; lists may be longer.

    A value that becomes stale is reported so often that it is fresh most of the time.
    """
    drawn = {found.value: found for found in chart.inputs.values() if not _values(found)[1]}
    reported: dict[str, list[Any]] = {}
    for event in classes.values:
        reported.setdefault(event.data["name"], []).append(event.data["value"])
    for name, found in drawn.items():
        values = reported[name] if name != MISSING else []
        for value in values if len(values) > 1 else ():
            yield Chance((found.freshness or CHANGES) * len(values), ((0.0, SetValue(name, value)),))


def _values(found: Input) -> tuple[Any, tuple[Any, ...]]:
    """Return the usual value of an input, and others; None and none where they do not follow from it."""
    if found.type.kind == "bool":
        return bool(found.initial), (not found.initial,)
    if not found.levels or found.initial is None:
        return None, ()
    low = 0.0 if found.minimum is None else found.minimum
    return found.initial, tuple(low + (found.initial - low) * share for share in (0.05, 0.15, 0.23))


def around_the_clock(chart: Chart) -> tuple[Happening, ...]:
    """Return the requests that end states in which a mission waits for ever, some time after each entry."""
    stages, found = chart.profile.stages, list[Happening]()
    for state in chart.states.values():
        asked = [rule.event for rule in state.transitions if rule.refuse is None]
        if not state.label or (state.parent and chart.states[state.parent].label == state.label):
            continue
        if state.label in (*stages.ended, *stages.ready) and START in asked:
            found.append(Happening(Ask(START), 60.0, state.name, 0))
        elif state.label in stages.faulted:
            outs = [event for event in asked if event.startswith("operator.")]
            found += [Happening(Ask(event), 60.0, state.name, 0) for event in outs[:1]]
    if chart.profile.resume:
        resume = Ask(f"operator.{chart.profile.resume}")
        waits = [state.name for state in chart.states.values() if state.paused]
        found += [Happening(resume, 120.0, name, 0) for name in waits]
    return tuple(found)


# -- from a file -----------------------------------------------------------------------------------------


def read_rates(file: Path, chart: Chart) -> Rates:
    """Read the file of a campaign.

    Raises:
        ChartError: with everything that is wrong with it.
    """
    findings = Findings()
    raw = read(file, findings)
    node = validate(raw, CampaignNode, findings) if isinstance(raw, Map) else None
    if node is None:
        raise ChartError(findings.all)
    words = ScenarioNames(chart, findings)
    check_names(node, words)
    reader = ScriptReader(node, words)
    measured = _measured(node, words)
    began = tuple(Happening(SetValue(name, value)) for name, value in measured.values.items())
    own = reader.script()
    own = replace(own, happenings=(*began, *own.happenings), measured=measured)
    known = node.learned.parameters if node.learned else {}
    parameters = {name: value for name, value in known.items() if name in chart.parameters}
    parameters |= reader.parameters()
    chances = tuple(chance for one in node.chance for chance in _chance(one, reader, words))
    usual = tuple(default_chances(chart)) if node.defaults else ()
    targets = _targets(node, words)
    if findings.errors:
        raise ChartError(findings.errors)
    mocked = {rule.operation for rule in own.rules}
    rules = (*own.rules, *(rule for rule in default_rules(chart) if rule.operation not in mocked))
    happenings = (*own.happenings, *around_the_clock(chart))
    limit = SHIFT if node.limit is None else own.limit
    whole = replace(own, rules=rules, happenings=happenings, limit=limit)
    return Rates(node.campaign, whole, (*usual, *chances), targets, parameters, own, node.learned)


def _measured(node: CampaignNode, words: ScenarioNames) -> Measured:
    """Return what was measured of a robot."""

    def share(holder: Node, key: str) -> float:
        given = words.value(holder.at(key), key, getattr(holder, key), NUMBER)
        if given is not None and given < 0.0:
            words.wrong(holder.at(key), key, f"expected a share from 0 on, got {getattr(holder, key)}")
        return given or 0.0

    drains, values = list[Drain](), dict[str, Any]()
    for drain in node.drain:
        if words.known(drain.at("value"), "value", drain.value, words.catalog.values, "drain"):
            drains.append(Drain(drain.value, share(drain, "per_metre"), share(drain, "per_minute")))
    learned = node.learned
    for name, value in (learned.values if learned else {}).items():
        assert learned is not None, "it has values"
        if words.known(learned.key_at("values", name), "value", name, words.catalog.values, "learned"):
            kind = words.catalog.values[name].type
            values[name] = words.value(
                learned.value_at("values", name), f"learned.values.{name}", value, kind
            )
    return Measured(tuple(drains), values)


def _chance(node: ChanceNode, reader: ScriptReader, words: ScenarioNames) -> Iterator[Chance]:
    check_names(node, words)
    every = words.duration(node.at("every"), "chance.every", node.every)
    if every is not None and every <= 0.0:
        words.wrong(node.at("every"), "chance.every", "the time between two is more than nothing")
    steps: list[tuple[float | Between, Effect]] = []
    for step in node.do:
        if {"at_", "on", "start_of", "nth", "expect"} & step.model_fields_set:
            problem = "what happens by chance has 'after' and nothing else to say when"
            words.wrong(step.place, "chance.do", problem, "write it under 'when', or leave it out")
        wait = words.latency(step.at("after"), "after", step.after) or 0.0
        steps += [(wait, effect) for effect in reader.effects(step)]
    if not any(step.model_fields_set - {"after"} for step in node.do):
        hint = "say request, value, event, restart or server_gone"
        words.wrong(node.place, "chance.do", "nothing happens", hint)
    yield Chance(every or SHIFT, tuple(steps))


def _targets(node: CampaignNode, words: ScenarioNames) -> tuple[int, int] | None:
    given = node.targets
    if given is None:
        return None
    found = given.get("between") if isinstance(given, dict) and set(given) == {"between"} else [given, given]
    bounds = [each for each in found if type(each) is int] if isinstance(found, list) else []
    if len(bounds) == 2 and 0 < bounds[0] <= bounds[1]:
        return bounds[0], bounds[1]
    problem = "expected how many targets, from 1 on"
    words.wrong(node.at("targets"), "targets", problem, "write 'targets: 5' or 'targets: {between: [1, 29]}'")
    return None


__all__ = ["SHIFT", "CampaignNode", "Chance", "Rates", "default_rates", "read_rates"]
