"""The available requests of a machine: a dry run of each, as plain data for displays and buttons.

The answers are `Machine.dry_run`'s. They are cached until one of their dependencies changes or becomes stale.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import TypedDict

from lupin_engine.chart.expressions.evaluation import Value
from lupin_engine.chart.model import Chart
from lupin_engine.chart.records import DECIDING, own, walk
from lupin_engine.machine.event import Event
from lupin_engine.machine.machine import Machine
from lupin_engine.machine.scope import CONFIGURATION, HELD, Reads, Watch
from lupin_engine.machine.structure import dispatch_table
from lupin_engine.plugin.contract import DIVERT_CODE
from lupin_engine.plugin.profile import ANSWER_VERB, START, START_VERB


@dataclass(frozen=True)
class PossibleRequest:
    """A request that can be made: its verb, its mission for a start, and its event."""

    verb: str
    mission: str
    event: Event


class PossibleRecord(TypedDict):
    """The dry run of one request: the holds that it engages and releases, or why it is refused.

    `code` and `reason` of a possible one say that its effect waits until a state is left.

    `fields`: a start is refused only because of its request's defaults, so other fields may be accepted.
    """

    request: str
    verb: str
    mission: str
    possible: bool
    engages: list[str]
    releases: list[str]
    code: str
    reason: str
    fields: bool


@lru_cache(maxsize=32)
def requests_of(chart: Chart) -> tuple[PossibleRequest, ...]:
    """Return the operator's requests, the start of each mission with its defaults, and the answers."""
    return (
        *(PossibleRequest(verb, "", Event(f"operator.{name}")) for name, verb in chart.profile.verbs.items()),
        *(PossibleRequest(START_VERB, name, Event(START, {"mission_type": name})) for name in chart.missions),
        *(PossibleRequest(ANSWER_VERB, "", Event(name)) for name in chart.answers),
    )


@lru_cache(maxsize=32)
def _reads(chart: Chart) -> Reads:
    """Return the dependencies of a chart's requests, but for those that `RequestPreview` compares itself."""
    reads = Reads(chart, _conditions(chart))
    reads.parts |= CONFIGURATION | HELD
    return reads


def _conditions(chart: Chart) -> Iterator[Value]:
    structure = dispatch_table(chart).structure
    for name in {request.event.name for request in requests_of(chart)}:
        for state in chart.states:
            for rule in structure.rules_of(state, name):
                yield from own(rule, DECIDING)
    for thing in (*chart.holds.values(), *chart.missions.values()):
        yield from (said.value for said in walk(thing, DECIDING))


class RequestPreview:
    """Dry-runs the requests of one machine again when a dependency may have changed."""

    def __init__(self, machine: Machine) -> None:
        self._machine = machine
        self._watch = Watch()
        machine.scope.watches.append(self._watch)
        self._seen: tuple[tuple[str, ...], ...] = ()

    def news(self, now: float) -> list[PossibleRecord] | None:
        """Dry-run each request at time `now`, as JSON data; return None if no answer can have changed."""
        machine = self._machine
        memory, reads = machine.memory, _reads(machine.chart)
        refused = tuple(claim.attempt for claim in memory.claims if claim.refused)
        seen = (tuple(memory.asked), tuple(memory.broken), refused)
        if seen == self._seen and not self._watch.is_due(reads, now):
            return None
        self._seen = seen
        machine.scope.doubtful = False  # what is not known now is looked at when it changes
        self._watch.cache_false(reads, machine.scope, now)
        return [self._record(request, now) for request in requests_of(machine.chart)]

    def _record(self, request: PossibleRequest, now: float) -> PossibleRecord:
        found = self._machine.dry_run(request.event, now)
        is_start = request.verb == START_VERB
        return {
            "request": request.event.name,
            "verb": request.verb,
            "mission": request.mission,
            "possible": found.possible,
            "engages": list(found.engages),
            "releases": list(found.releases),
            "code": found.refusal.code if found.refusal else DIVERT_CODE if found.waits else "",
            "reason": found.refusal.text if found.refusal else found.waits,
            "fields": is_start
            and not found.possible
            and self._machine.dry_run(request.event, now, skip_fields=True).possible,
        }
