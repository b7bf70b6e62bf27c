"""The composed chart: what loading produces and what every other room reads, never the YAML.

A chart is a lifecycle with the missions standing in its slot and all parts expanded. States are named by
their path from the top (`MISSION.InspectionMission.INSPECTING.SCANNING`); the root's name is the empty
text. Everything is frozen, resolved (targets are full names) and checked (expressions are typed); every
piece keeps the `Place` where the author wrote it, in the author's file.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from lupin_engine.chart.expressions.evaluation import Expression, Value
from lupin_engine.chart.records import record
from lupin_engine.errors import Place
from lupin_engine.plugin.contract import Code, Operation, Parameter
from lupin_engine.plugin.profile import Profile
from lupin_engine.plugin.registry import Catalog
from lupin_engine.plugin.types import Type


@record(frozen=True)
class ActionCall:
    """One action with its arguments: built-in (`set`, `raise`, `itinerary.close`, ...) or a plugin's.

    For `set` the arguments are the context variables; for `raise` the single argument `event` is the name.
    """

    name: str
    arguments: Mapping[str, Value]
    place: Place
    moves: bool = False


@record(frozen=True)
class Transition:
    """What an event does in a state.

    `event` is a name (`operator.abort`), a prefix (`nav.*`), any (`*`), or one of the engine's own: ``
    (eventless, written `always`), `done`, `error` (the end of the state's invocation, or for `done` of the
    state), `after.N` (the state's N-th timer), `budget` (the state's time is used up). Event names starting
    `input.` stand for a level: the transition is taken whenever that live value is true. No target and no
    refusal: actions only. A `refuse` transition answers a request with that code and changes nothing.
    """

    id: str
    event: str
    source: str
    place: Place
    target: str | None = None
    guard: Expression | None = None
    actions: tuple[ActionCall, ...] = ()
    refuse: str | None = None
    during: frozenset[str] = frozenset()
    releases: frozenset[str] = frozenset()
    code: str | None = None
    internal: bool = False


@record(frozen=True)
class Timer:
    """An `after` or the `budget` of a state: `event` is what its transitions listen to."""

    event: str
    after: Value
    place: Place


@record(frozen=True)
class Retry:
    """How often and how patiently an operation is tried: `attempts` in all, `backoff` seconds between.

    Every further pause is `factor` times the one before, and then lengthened or shortened by a random share
    of up to `jitter` (0.2 is a fifth) of itself. Codes in `unless` are not tried again.
    """

    attempts: Value
    backoff: Value | None = None
    unless: frozenset[str] = frozenset()
    factor: Value | None = None
    jitter: Value | None = None


@record(frozen=True)
class Invoke:
    """An operation that lives exactly as long as its state. `timeout` is None for `never`."""

    name: str
    operation: Operation
    arguments: Mapping[str, Value]
    place: Place
    timeout: Value | None = None
    timeout_code: str | None = None
    retry: Retry | None = None


@record(frozen=True)
class ForEach:
    """One operation for every new element of a collection, while the state is active.

    `items` is evaluated again after every step; an element is new when no other with its `key` was dealt with
    in this mission, and taken up when `when` holds and fewer than `limit` operations run. Expressions about
    one element see it as `item` of the environment, which the author calls `name`. The actions see `event`
    or `error` like a transition's.
    """

    name: str
    items: Value
    key: Value
    invoke: Invoke
    place: Place
    limit: Value | None = None
    when: Expression | None = None
    on_done: tuple[ActionCall, ...] = ()
    on_error: tuple[ActionCall, ...] = ()


@record(frozen=True)
class Itinerary:
    """The list that a state walks; every item is visited and closed exactly once a sweep.

    `order` is a number for each `target`: the open one with the smallest is next, the first among equals;
    without it the list's order counts. `sweeps` is how often the list is walked, 0 without end; it is made
    anew for every sweep. What `leaves_open` is not closed by `itinerary.close_rest`. `source` is what its
    observations name as their source, '' for the mission's name.
    """

    items: Value
    place: Place
    order: Value | None = None
    sweeps: Value | None = None
    leaves_open: bool = False
    source: str = ""


class Kind(enum.Enum):
    """The kinds of states, as in SCXML."""

    ATOMIC = "atomic"
    COMPOUND = "compound"
    PARALLEL = "parallel"
    FINAL = "final"
    HISTORY = "history"


@record(frozen=True)
class State:
    """One state. `budget` is like a timer, but counts the state's active time over all visits in one mission.

    `label` is the lifecycle state that it is published as ('' for the root and the slot).

    `mission` names the mission whose states these are ('' outside the slot); `slot` marks the state whose
    children are the missions. A history state remembers the active descendants of its parent `depth` levels
    down (1 is shallow; None is deep). `resume_at` chooses the child when this state is entered by history.
    """

    name: str
    kind: Kind
    place: Place
    parent: str | None = None
    children: tuple[str, ...] = ()
    initial: str | None = None
    label: str = ""
    mission: str = ""
    slot: bool = False
    phase: str | None = None
    paused: bool = False
    entry: tuple[ActionCall, ...] = ()
    exit: tuple[ActionCall, ...] = ()
    transitions: tuple[Transition, ...] = ()
    timers: tuple[Timer, ...] = ()
    budget: Timer | None = None
    invoke: Invoke | None = None
    for_each: ForEach | None = None
    itinerary: Itinerary | None = None
    resume_at: tuple[Transition, ...] = ()
    depth: int | None = None
    summary: str = ""

    @property
    def local_name(self) -> str:
        """The last part of the name, as the author wrote it."""
        return self.name.rpartition(".")[2]


@record(frozen=True)
class Hold:
    """A suspension of the whole chart.

    `engage` is a request (`operator.pause`) or a level (`input.estop`); `release` are requests. A guard that
    is false refuses the request with `engage_code` or, for a release, with `code`. `code` is what engaging
    reports.
    """

    name: str
    engage: str
    release: tuple[str, ...]
    code: str
    place: Place
    engage_guard: Expression | None = None
    engage_code: str | None = None
    release_guard: Expression | None = None


@record(frozen=True)
class Field:
    """A field of a mission's request: type, default, and the code that refuses an empty list."""

    name: str
    type: Type
    place: Place
    default: Value | None = None
    not_empty: str | None = None
    minimum: float | None = None


@record(frozen=True)
class Mission:
    """A mission in the slot; `state` is the full name of the state that wraps it."""

    name: str
    state: str
    file: str
    summary: str
    request: Mapping[str, Field]
    place: Place


@record(frozen=True)
class Variable:
    """A context variable: written by `set`, kept in the snapshot."""

    name: str
    type: Type
    default: Value
    place: Place


@record(frozen=True)
class Level:
    """A yes or no drawn from a number, exactly one of `below` and `above`.

    True below `below` until the number has risen to `below + hysteresis`; or above `above` until it has
    fallen to `above - hysteresis`.
    """

    name: str
    hysteresis: Value | None
    place: Place
    below: Value | None = None
    above: Value | None = None


@record(frozen=True)
class Input:
    """A live value of a plugin under the chart's own name for it; unknown when older than freshness.

    A report outside `minimum` to `maximum` is dropped. With `of_mission` only what was reported since the
    mission began counts, of a list only elements that were not the same before; until then it is `initial`.
    """

    name: str
    value: str
    type: Type
    place: Place
    freshness: float | None = None
    initial: Any = None
    levels: tuple[Level, ...] = ()
    minimum: float | None = None
    maximum: float | None = None
    of_mission: bool = False


@record(frozen=True)
class Invariant:
    """A condition that holds whenever the machine is at rest; broken, it is an error that leads to FAULT."""

    name: str
    that: Expression
    place: Place
    summary: str = ""


@dataclass(frozen=True, eq=False)
class Chart:
    """A lifecycle with its missions, checked. `states` are in document order, parents before children.

    `plugins` are those that it uses; `catalog` is what it was checked against: all that the installed plugins
    and the bindings beside the missions offer.

    Two charts are equal only when they are the same one; what is worked out for a chart is kept under it.
    """

    name: str
    files: tuple[str, ...]
    states: Mapping[str, State]
    missions: Mapping[str, Mission]
    holds: Mapping[str, Hold] = field(default_factory=dict)
    context: Mapping[str, Variable] = field(default_factory=dict)
    inputs: Mapping[str, Input] = field(default_factory=dict)
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    codes: Mapping[str, Code] = field(default_factory=dict)
    invariants: Mapping[str, Invariant] = field(default_factory=dict)
    plugins: tuple[str, ...] = ()
    summary: str = ""
    catalog: Catalog = field(default_factory=Catalog)

    @property
    def profile(self) -> Profile:
        """What these missions visit, and how visits can end."""
        return self.catalog.profile

    def ancestors(self, name: str) -> list[str]:
        """Return the proper ancestors of a state, innermost first, the root included."""
        found = []
        parent = self.states[name].parent
        while parent is not None:
            found.append(parent)
            parent = self.states[parent].parent
        return found
