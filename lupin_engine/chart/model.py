"""The composed chart: the result of loading, which all other rooms read in place of the YAML.

A chart is a lifecycle with the missions standing in its slot and all parts expanded. States are named by
their path from the top (`MISSION.Patrol.ROUND.DRIVING`); the root's name is the empty text. Everything is
frozen, resolved (targets are full names) and checked (expressions are typed); every piece has its `Place` in
the author's file.
"""

from __future__ import annotations

import enum
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Literal

from lupin_engine.chart.expressions.condition import FREE, Condition
from lupin_engine.chart.expressions.evaluation import Expression, Value
from lupin_engine.chart.records import Role, record, said
from lupin_engine.errors import Place
from lupin_engine.plugin.contract import Code, Operation, Parameter
from lupin_engine.plugin.profile import ANSWER, Profile
from lupin_engine.plugin.registry import Catalog
from lupin_engine.plugin.types import Type

#: The actions that write variables.
WRITING = ("set", "add", "remove")


@record(frozen=True)
class ActionCall:
    """One action with its arguments: built-in (`set`, `raise`, `itinerary.close`, ...) or a plugin's.

    For those in `WRITING` the arguments are the context variables; for `raise` the single argument `event` is
    the name, and `data` the payload. An `if` has no arguments, but a `guard` that chooses between the actions
    `then` and `otherwise`.
    """

    KEY: ClassVar[str] = "name"

    name: str
    arguments: Mapping[str, Value] = field(metadata=said(Role.CARRIED))
    place: Place
    moves: bool = False
    data: Mapping[str, Value] = field(default_factory=dict, metadata=said(Role.CARRIED, "with"))
    guard: Condition = field(default=FREE, metadata=said(Role.CONDITION, "guard"))
    then: tuple[ActionCall, ...] = field(default=(), metadata=said(Role.ACTIONS, "then"))
    otherwise: tuple[ActionCall, ...] = field(default=(), metadata=said(Role.ACTIONS, "else"))


def every_call(actions: Iterable[ActionCall]) -> Iterator[ActionCall]:
    """Yield the actions of a list and those that an `if` among them may carry out."""
    for call in actions:
        yield call
        yield from every_call((*call.then, *call.otherwise))


@record(frozen=True)
class Transition:
    """A transition of a state, on an event or without one.

    `event` is a name (`operator.abort`), a prefix (`nav.*`), `*` (any event of a plugin or raised by the
    chart, see `semantics.matches`), or one of the engine's own: `` (eventless, written `always`), `done`,
    `error` (the end of the state's invocation, or for `done` of the state), `after.N`, `every.N`, `at.N` (the
    N-th of the state's timers of that word, from 0), `budget` (its time is used up). Event names starting
    `input.` stand for a level: the transition is taken whenever that live value is true. No target and no
    refusal: actions only. A `refuse` transition answers a request with that code, and the `value` that it is
    about, and changes nothing.

    `derived` ones are not written: they come from a `before_divert`. `written` is the guard of the file where
    that adds to it.
    """

    KEY: ClassVar[str] = "id"

    id: str
    event: str = field(metadata=said(Role.EVENT))
    source: str
    place: Place
    target: str | None = field(default=None, metadata=said(Role.STATE, "target"))
    guard: Condition = field(default=FREE, metadata=said(Role.CONDITION, "guard"))
    actions: tuple[ActionCall, ...] = field(default=(), metadata=said(Role.ACTIONS, "do"))
    refuse: str | None = field(default=None, metadata=said(Role.CODE, "refuse"))
    during: frozenset[str] = field(default=frozenset(), metadata=said(Role.HOLDS, "during"))
    releases: frozenset[str] = field(default=frozenset(), metadata=said(Role.HOLDS, "releases"))
    code: str | None = field(default=None, metadata=said(Role.CODE, "code"))
    internal: bool = field(default=False, metadata=said(Role.PLAIN, "internal"))
    detail: Value | None = field(default=None, metadata=said(Role.CARRIED, "detail"))
    value: Value | None = field(default=None, metadata=said(Role.CARRIED, "value"))
    derived: bool = False
    written: Condition | None = None


@record(frozen=True)
class Timer:
    """A clock of a state: `after`, `every`, `at` or `budget`. Its transitions listen to `event`.

    `due` is a duration, of `at` a time of day. A budget that `goes_on` counts the time of a divert as well.
    """

    KEY: ClassVar[str] = "event"

    event: str
    due: Value = field(metadata=said(Role.VALUE))
    place: Place
    goes_on: bool = False

    @property
    def word(self) -> str:
        """Its key in missions."""
        return self.event.partition(".")[0]


@record(frozen=True)
class Retry:
    """How often and how patiently an operation is tried: `attempts` in all, `backoff` seconds between.

    The n-th pause is `backoff * factor ** (n - 1)`, lengthened or shortened by a share of up to `jitter` (0.2
    is a fifth), which follows from seed, mission and attempt. Codes in `unless` are not tried again.
    """

    attempts: Value = field(metadata=said(Role.VALUE, "attempts"))
    backoff: Value | None = field(default=None, metadata=said(Role.VALUE, "backoff"))
    unless: frozenset[str] = field(default=frozenset(), metadata=said(Role.CODE, "unless"))
    factor: Value | None = field(default=None, metadata=said(Role.VALUE, "factor"))
    jitter: Value | None = field(default=None, metadata=said(Role.VALUE, "jitter"))


@record(frozen=True)
class Invoke:
    """An operation that ends with its state at the latest. `timeout` is None for `never`.

    `on_hold` is the reaction at the release of a hold that cancelled it: `continue`, `fail`, or empty for
    `again`. With `update` its arguments are evaluated again so often, and changed ones are a new goal.
    """

    name: str = field(metadata=said(Role.PLAIN, "do"))
    operation: Operation
    arguments: Mapping[str, Value] = field(metadata=said(Role.CARRIED, "with"))
    place: Place
    timeout: Value | None = field(default=None, metadata=said(Role.VALUE, "timeout.after"))
    timeout_code: str | None = field(default=None, metadata=said(Role.CODE, "timeout.code"))
    retry: Retry | None = field(default=None, metadata=said(Role.INSIDE, "retry"))
    on_hold: str = field(default="", metadata=said(Role.PLAIN, "on_hold"))
    classes: tuple[Mapping[str, Any], ...] = field(default=(), metadata=said(Role.PLAIN, "classes"))
    update: Value | None = field(default=None, metadata=said(Role.VALUE, "update"))


@record(frozen=True)
class ForEach:
    """One operation for every new element of a collection, while the state is active.

    `items` is evaluated again after every step; an element is new when no other with its `key` was dealt with
    in this mission, and taken up when `when` holds and fewer than `limit` operations run. Expressions about
    one element see it as `item` of the environment, which the author calls `name`. The actions see `event`
    or `error` like a transition's.
    """

    name: str = field(metadata=said(Role.PLAIN, "item"))
    items: Value = field(metadata=said(Role.VALUE, "in"))
    key: Value = field(metadata=said(Role.VALUE, "key"))
    invoke: Invoke = field(metadata=said(Role.INSIDE, "invoke"))
    place: Place
    limit: Value | None = field(default=None, metadata=said(Role.VALUE, "limit"))
    when: Condition = field(default=FREE, metadata=said(Role.CONDITION, "when"))
    on_done: tuple[ActionCall, ...] = field(default=(), metadata=said(Role.ACTIONS, "on_done.do"))
    on_error: tuple[ActionCall, ...] = field(default=(), metadata=said(Role.ACTIONS, "on_error.do"))


@record(frozen=True)
class Itinerary:
    """The list of targets that a state iterates over; every item is visited and closed exactly once a sweep.

    `order` is a number for each `target`: the open one with the smallest is next, the first among equals;
    without it the list's order counts. `sweeps` is the number of passes, 0 without end; the list is evaluated
    again for each. After the last, the targets whose visit ended with a status of `again` have one more. With
    `leaves_open`, `itinerary.close_rest` closes none of its visits. `source` is named as the source of its
    observations, '' for the mission's name.
    """

    items: Value = field(metadata=said(Role.VALUE, "items"))
    place: Place
    order: Value | None = field(default=None, metadata=said(Role.VALUE, "order"))
    sweeps: Value | None = field(default=None, metadata=said(Role.VALUE, "sweeps"))
    again: tuple[str, ...] = field(default=(), metadata=said(Role.PLAIN, "again"))
    leaves_open: bool = field(default=False, metadata=said(Role.PLAIN, "on_abort"))
    source: str = field(default="", metadata=said(Role.PLAIN, "source"))


@record(frozen=True)
class Prompt:
    """A question to the operator; without an answer for `after` seconds, `default` counts.

    An answer is the event `answer.CHOICE`, for the states around as well.
    """

    question: Value = field(metadata=said(Role.CARRIED, "question"))
    choices: Mapping[str, Code] = field(metadata=said(Role.PLAIN, "choices"))
    default: str = field(metadata=said(Role.PLAIN, "default"))
    after: Value = field(metadata=said(Role.VALUE, "after"))
    place: Place

    @property
    def timer(self) -> Timer:
        """The deadline: it makes the event of the default."""
        return Timer(f"{ANSWER}{self.default}", self.after, self.place)


@record(frozen=True)
class FieldRefusal:
    """A reason to refuse a request: `guard` is true of its fields.

    The answer names the `code` and the `value`, without one that of the field.
    """

    KEY: ClassVar[str] = "code"

    guard: Condition = field(metadata=said(Role.CONDITION, "guard"))
    code: str = field(metadata=said(Role.CODE, "code"))
    place: Place
    value: Value | None = field(default=None, metadata=said(Role.CARRIED, "value"))


@record(frozen=True)
class Field:
    """A field of a mission's request.

    One without a `default` must be given. `not_empty` is the code that refuses an empty value; None allows
    it. A number below `minimum` is refused; `refusals` are about all fields, read after the last of them. In
    an embedded mission the default is the argument of its use, if there is one.
    """

    name: str
    type: Type = field(metadata=said(Role.PLAIN, "type"))
    place: Place
    default: Value | None = field(default=None, metadata=said(Role.VALUE, "default"))
    not_empty: str | None = field(default=None, metadata=said(Role.CODE, "not_empty"))
    minimum: float | None = field(default=None, metadata=said(Role.PLAIN, "min"))
    summary: str = field(default="", metadata=said(Role.PLAIN, "summary"))
    refusals: tuple[FieldRefusal, ...] = field(default=(), metadata=said(Role.INSIDE, "refuse"))


@record(frozen=True)
class UsedMission:
    """An embedded mission: its request, and the variables that restart whenever its state is entered.

    `variables` are those of the mission and of missions embedded in it. `entry` and `exit` are the mission's
    own.
    """

    mission: str = field(metadata=said(Role.PLAIN, "use"))
    request: Mapping[str, Field] = field(metadata=said(Role.INSIDE, "with"))
    place: Place
    variables: tuple[str, ...] = ()
    entry: tuple[ActionCall, ...] = field(default=(), metadata=said(Role.ACTIONS, "entry"))
    exit: tuple[ActionCall, ...] = field(default=(), metadata=said(Role.ACTIONS, "exit"))


@record(frozen=True)
class BeforeDivert:
    """How a state is left in order: a divert waits up to `within` seconds, and the chart goes to `leave_by`.

    It becomes transitions, see `compose.diverts`; this is for displays.
    """

    within: Value
    leave_by: str | None


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
    kind: Kind = field(metadata=said(Role.PLAIN, "type"))
    place: Place
    parent: str | None = None
    children: tuple[str, ...] = ()
    initial: str | None = field(default=None, metadata=said(Role.STATE, "initial"))
    label: str = ""
    mission: str = ""
    slot: bool = field(default=False, metadata=said(Role.PLAIN, "slot"))
    phase: str | None = field(default=None, metadata=said(Role.PLAIN, "phase"))
    paused: bool = field(default=False, metadata=said(Role.PLAIN, "paused"))
    entry: tuple[ActionCall, ...] = field(default=(), metadata=said(Role.ACTIONS, "entry"))
    exit: tuple[ActionCall, ...] = field(default=(), metadata=said(Role.ACTIONS, "exit"))
    transitions: tuple[Transition, ...] = field(default=(), metadata=said(Role.INSIDE))
    timers: tuple[Timer, ...] = field(default=(), metadata=said(Role.INSIDE))
    budget: Timer | None = field(default=None, metadata=said(Role.INSIDE, "budget.after"))
    before_divert: BeforeDivert | None = None
    invoke: Invoke | None = field(default=None, metadata=said(Role.INSIDE, "invoke"))
    for_each: ForEach | None = field(default=None, metadata=said(Role.INSIDE, "for_each"))
    itinerary: Itinerary | None = field(default=None, metadata=said(Role.INSIDE, "itinerary"))
    ask: Prompt | None = field(default=None, metadata=said(Role.INSIDE, "ask"))
    use: UsedMission | None = field(default=None, metadata=said(Role.INSIDE, "use"))
    resume_at: tuple[Transition, ...] = field(default=(), metadata=said(Role.INSIDE, "resume_at"))
    depth: int | None = field(default=None, metadata=said(Role.PLAIN, "depth"))
    result: Mapping[str, Value] = field(default_factory=dict, metadata=said(Role.VALUE, "result"))
    summary: str = field(default="", metadata=said(Role.PLAIN, "summary"))

    @property
    def local_name(self) -> str:
        """The last part of the name, as the author wrote it."""
        return self.name.rpartition(".")[2]

    @property
    def on_entry(self) -> tuple[ActionCall, ...]:
        """The actions of entering, with those of a mission that begins then."""
        return self.entry if self.use is None else (*self.entry, *self.use.entry)

    @property
    def on_exit(self) -> tuple[ActionCall, ...]:
        """The actions of leaving, with those of a mission that is left then."""
        return self.exit if self.use is None else (*self.use.exit, *self.exit)


@record(frozen=True)
class Hold:
    """A suspension of the whole chart.

    `engage` is a request (`operator.pause`) or a level (`input.danger`); `release` are requests. A guard that
    is false refuses the request: to engage with `engage_code` (None: with `code`), to release with `code`.
    Engaging reports `code`.
    """

    name: str
    engage: str = field(metadata=said(Role.EVENT, "engage"))
    release: tuple[str, ...] = field(metadata=said(Role.EVENT, "release"))
    code: str = field(metadata=said(Role.CODE, "code"))
    place: Place
    engage_guard: Condition = field(default=FREE, metadata=said(Role.CONDITION, "engage_guard"))
    engage_code: str | None = field(default=None, metadata=said(Role.CODE, "engage_code"))
    release_guard: Condition = field(default=FREE, metadata=said(Role.CONDITION, "release_guard"))


@record(frozen=True)
class Mission:
    """A mission in the slot; `state` is the full name of the state that wraps it."""

    name: str
    state: str
    file: str
    summary: str = field(metadata=said(Role.PLAIN, "summary"))
    request: Mapping[str, Field] = field(metadata=said(Role.INSIDE, "request"))
    place: Place


@record(frozen=True)
class Variable:
    """A context variable: the actions in `WRITING` change it, and snapshots keep it.

    One `of_mission` is declared by a mission or a part, and begins anew with every mission.
    """

    name: str
    type: Type = field(metadata=said(Role.PLAIN, "type"))
    default: Value = field(metadata=said(Role.CARRIED, "default"))
    place: Place
    of_mission: bool = False


@record(frozen=True)
class Level:
    """A yes or no drawn from a number, exactly one of `below` and `above`.

    True below `below` until the number has risen to `below + hysteresis`; or above `above` until it has
    fallen to `above - hysteresis`.
    """

    KEY: ClassVar[str] = "name"

    name: str
    hysteresis: Value | None = field(metadata=said(Role.VALUE, "hysteresis"))
    place: Place
    below: Value | None = field(default=None, metadata=said(Role.VALUE, "below"))
    above: Value | None = field(default=None, metadata=said(Role.VALUE, "above"))


@record(frozen=True)
class Input:
    """A live value of a plugin under the chart's own name for it; unknown when older than its freshness.

    A report outside `minimum` to `maximum` is dropped. With `of_mission` only reports since the mission began
    count, of a list only new or changed elements. Before the first report that counts it has the value
    `initial`; without one (None) it is unknown. One without a `freshness` (None) never grows old.
    """

    name: str
    value: str = field(metadata=said(Role.PLAIN, "value"))
    type: Type
    place: Place
    freshness: float | None = field(default=None, metadata=said(Role.PLAIN, "freshness"))
    initial: Any = field(default=None, metadata=said(Role.PLAIN, "initial"))
    levels: tuple[Level, ...] = field(default=(), metadata=said(Role.INSIDE, "levels"))
    minimum: float | None = field(default=None, metadata=said(Role.PLAIN, "min"))
    maximum: float | None = field(default=None, metadata=said(Role.PLAIN, "max"))
    of_mission: bool = field(default=False, metadata=said(Role.PLAIN, "since"))
    classes: tuple[Any, ...] = field(default=(), metadata=said(Role.PLAIN, "classes"))


@record(frozen=True)
class Invariant:
    """A condition that holds whenever the machine is at rest; broken, it is an error that leads to FAULT."""

    name: str
    that: Expression = field(metadata=said(Role.CONDITION))
    place: Place
    summary: str = field(default="", metadata=said(Role.PLAIN, "summary"))


@record(frozen=True)
class TemporalProperty:
    """A property of every run: `always`, `never`, `eventually` (which has a `within`), or places to visit.

    With `after` it is checked from each moment on at which that holds, with `until` up to the next such
    moment; with `until` alone, and with places, from each start of a mission on. Places are conditions, by
    their text. One that reads the request of a `mission`, or that begins with each start of one, is about the
    runs of that mission; '' is about every moment.
    One that is `built_in` is known by its name. `not_meant` are the missions of which it is not meant, with
    the reason. `breach` is what a robot does that breaks it; it reports `code`, or else the engine's.
    """

    name: str
    place: Place
    always: Expression | None = field(default=None, metadata=said(Role.CONDITION, "always"))
    never: Expression | None = field(default=None, metadata=said(Role.CONDITION, "never"))
    eventually: Expression | None = field(default=None, metadata=said(Role.CONDITION, "eventually"))
    visit_all: Mapping[str, Expression] = field(
        default_factory=dict, metadata=said(Role.CONDITION, "visit_all")
    )
    visit_in_order: Mapping[str, Expression] = field(
        default_factory=dict, metadata=said(Role.CONDITION, "visit_in_order")
    )
    within: Value | None = field(default=None, metadata=said(Role.VALUE, "within"))
    after: Expression | None = field(default=None, metadata=said(Role.CONDITION, "after"))
    until: Expression | None = field(default=None, metadata=said(Role.CONDITION, "until"))
    summary: str = field(default="", metadata=said(Role.PLAIN, "summary"))
    mission: str = ""
    built_in: bool = field(default=False, metadata=said(Role.PLAIN, "built_in"))
    not_meant: Mapping[str, str] = field(default_factory=dict)
    breach: Literal["report", "hold", "fault"] = field(default="report", metadata=said(Role.PLAIN, "breach"))
    code: str | None = field(default=None, metadata=said(Role.CODE, "code"))

    def is_meant(self, mission: str) -> bool:
        """Return whether it is about the runs of a mission ('': when none has begun)."""
        return self.mission in ("", mission) and mission not in self.not_meant


@dataclass(frozen=True, eq=False)
class Chart:
    """A lifecycle with its missions, checked. `states` are in document order, parents before children.

    `plugins` are those that the missions use; `catalog` is the one that it was checked against: all
    declarations of the installed plugins and of the bindings beside the missions.

    `lifecycle_files` are the lifecycle's own file and the one that it extends, which is called `extends`.

    Charts are compared by identity, because results are cached by chart.
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
    properties: Mapping[str, TemporalProperty] = field(default_factory=dict)
    plugins: tuple[str, ...] = ()
    summary: str = ""
    catalog: Catalog = field(default_factory=Catalog)
    lifecycle_files: tuple[str, ...] = ()
    extends: str = ""

    @property
    def profile(self) -> Profile:
        """The profile: kinds of targets, and outcomes of visits."""
        return self.catalog.profile

    @cached_property
    def clients(self) -> tuple[str, ...]:
        """The plugins whose clients run: those that the missions use, and those that the profile reads."""
        owners = self.catalog.owners
        read = [("value", name) for each in self.profile.projections.values() for name in each.values]
        return tuple(sorted({*self.plugins, *(owners[one] for one in read if one in owners)}))

    def file_of(self, place: Place) -> str:
        """Return how the file of a place is called in a line: a lifecycle that is extended by its name."""
        return self.extends if place.file in self.lifecycle_files[1:] else place.file.rpartition("/")[2]

    @cached_property
    def answers(self) -> Mapping[str, Code]:
        """The events that answer a question, each with its choice."""
        asks = (state.ask for state in self.states.values() if state.ask is not None)
        return {f"{ANSWER}{name}": choice for ask in asks for name, choice in ask.choices.items()}

    @cached_property
    def lineage(self) -> Mapping[str, tuple[str, ...]]:
        """Every state's own name and its ancestors', innermost first, the root included."""
        found: dict[str, tuple[str, ...]] = {}
        for name, state in self.states.items():
            above = () if state.parent is None else found[state.parent]
            found[name] = (name, *above)
        return found
