"""The profile: the vocabulary and interface of one kind of robot, declared as data.

The engine knows requests, operations, holds, inputs and itineraries. Kinds of targets, outcomes of visits,
messages and the terminal's words are one `Profile` object, found by entry point (group `lupin.profiles`).
Loading it needs no ROS: messages are named by their types, and the functions of `Wire` convert plain data to
the fields of a message and back.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from lupin_engine.errors import Severity
from lupin_engine.plugin.contract import Access, Argument
from lupin_engine.plugin.types import Type

#: The fields of a message, service request or response, by name.
Fields = Mapping[str, Any]


# -- the words of missions ------------------------------------------------------------------------------


class Rating(enum.Enum):
    """The meaning of an outcome in displays."""

    GOOD = "good"  #: the visit did what it was for
    BAD = "bad"  #: it did not
    LEFT_OUT = "left out"  #: it was not tried


@dataclass(frozen=True)
class TargetOutcome:
    """How a visit to a target can end: `name` in missions, `counter` in views and records, `word` in text."""

    name: str
    counter: str
    word: str
    rating: Rating = Rating.BAD

    @property
    def is_good(self) -> bool:
        """Whether the visit reached its purpose."""
        return self.rating is Rating.GOOD


@dataclass(frozen=True)
class RequestField:
    """A field that a start can carry: missions declare it under `request` with a type of the same kind.

    `option` is the option of `lupin run` and `lupin simulate` that fills it; a list is written with commas.
    """

    type: Type
    option: str = ""
    metavar: str = ""
    doc: str = ""


@dataclass(frozen=True)
class OperatorRequest:
    """A request that an operator may make at any time.

    `however_late`: it is carried out even when it seems old. How old a request is can often only be judged by
    two wall clocks, the caller's and ours, and these may disagree. So every request that stops the robot,
    ends its mission or sends it home has this: stopping late is better than not at all. A request to resume
    has it not. A request that would end a hold is refused all the same when it is old: the robot stands, and
    would drive. The command line's verb is `verb`, where that is not its name; `key` is its letter in `lupin
    run`.
    """

    doc: str
    however_late: bool = False
    verb: str = ""
    key: str = ""


@dataclass(frozen=True)
class Publication:
    """An action that publishes `outcome` for a target outside of a visit.

    `target` and `reading` name its arguments for the target and its reading.
    """

    doc: str
    outcome: str
    target: tuple[str, Argument]
    reading: tuple[str, Argument]

    @property
    def arguments(self) -> Mapping[str, Argument]:
        """The arguments by name."""
        return dict((self.target, self.reading))


@dataclass(frozen=True)
class Stages:
    """The meaning of published lifecycle states: the labels of the lifecycles of this profile."""

    starting: tuple[str, ...] = ()
    ready: tuple[str, ...] = ()
    returning: tuple[str, ...] = ()
    ended: tuple[str, ...] = ()
    faulted: tuple[str, ...] = ()

    @property
    def without_mission(self) -> frozenset[str]:
        """The states in which no mission is under way."""
        return frozenset((*self.starting, *self.ready, *self.over))

    @property
    def begins_anew(self) -> frozenset[str]:
        """The states in which a new process starts from the beginning, without recovery.

        A fault is recovered, so that it stays visible.
        """
        return frozenset((*self.starting, *self.ready, *self.ended))

    @property
    def over(self) -> frozenset[str]:
        """The states in which a mission is over, well or not."""
        return frozenset((*self.ended, *self.faulted))

    @property
    def anchors(self) -> frozenset[str]:
        """The states in which a run begins and ends; they are found by name, so they keep it."""
        return self.over.union(self.starting)


@dataclass(frozen=True)
class Projection:
    """A fold of live values for the profile's messages, independent of the missions' declarations.

    `values` are live values of plugins. `fold(before, name, value)` returns the new result after a report of
    one of them; `before` is None until the first. It is pure, and its result is plain data.
    """

    values: tuple[str, ...]
    fold: Callable[[Any, str, Any], Any]


def last(value: str) -> Projection:
    """Return the projection that is the last report of one live value."""
    return Projection((value,), lambda _before, _name, reported: reported)


# -- the wire -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Channel:
    """A topic of the orchestrator; `qos` is a name of `ros.adapter.qos.Qos`, such as `LATCHED`."""

    name: str
    type: str
    qos: str


@dataclass(frozen=True)
class StartRequest:
    """The request to start: a mission by name, and fields of `Profile.request`."""

    mission: str
    request: Fields


def given_fields(fields: Fields) -> dict[str, Any]:
    """Return the fields of a message that were given: it has no optional ones, so empty and zero are not."""
    return {name: value for name, value in fields.items() if value not in ("", 0, None) and value != []}


@dataclass(frozen=True)
class StartAnswer:
    """The answer: the id of the mission that has begun, or the reason why none has."""

    accepted: bool
    mission_id: str = ""
    reason: str = ""


@dataclass(frozen=True)
class StartService:
    """The service that starts a mission, and the functions that make and read its request and its response.

    A field that is missing in the argument of `request_fields`, or empty in the result of `read_request`, is
    left to the mission.
    """

    name: str
    type: str
    request_fields: Callable[[StartRequest], Fields]
    read_request: Callable[[Fields], StartRequest]
    answer_fields: Callable[[StartAnswer], Fields]
    read_answer: Callable[[Fields], StartAnswer]


@dataclass(frozen=True)
class Publish:
    """The outcome of a target, to be published. `status` is the name of an outcome."""

    source: str
    mission_id: str
    target: str
    status: str
    code: str = ""
    detail: str = ""
    reading: Mapping[str, Any] | None = None


@dataclass(frozen=True)
class Situation:
    """The state of a mission, for its state message.

    `counts` is by outcome, `value(name)` a projection of the profile, else an input or a variable, None while
    it is unknown, `request` that of the mission's start. `label` and `severity` belong to `code`; `started`
    and `stamp` are the fields of a Time.
    """

    mission: str
    mission_id: str
    lifecycle: str
    phase: str
    target: str
    total: int
    counts: Mapping[str, int]
    code: str
    detail: str
    label: str
    severity: Severity
    paused: bool
    request: Mapping[str, Any]
    value: Callable[[str], Any]
    started: Fields | None
    stamp: Fields


@dataclass(frozen=True)
class Progress:
    """The state of a mission, read from its state message, for displays.

    `goal` and `found` are of a mission that searches for its targets. `error` is the code and detail reported
    last, `event` its label. `flags` and `gauges` (0 to 1) are by the names that `Terminal` has for them.
    """

    mission: str = ""
    mission_id: str = ""
    lifecycle: str = ""
    phase: str = ""
    target: str = ""
    total: int = 0
    counts: Mapping[str, int] = field(default_factory=dict)
    goal: int = 0
    found: int = 0
    error: str = ""
    event: str = ""
    severity: Severity = Severity.INFO
    paused: bool = False
    flags: Mapping[str, bool] = field(default_factory=dict)
    gauges: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class TargetResult:
    """A published outcome: the target, the reason, and the columns that were read there."""

    target: str
    status: str
    reason: str
    values: Mapping[str, float]
    mission_id: str = ""


@dataclass(frozen=True)
class Remark:
    """Another message for people that was published during a mission."""

    severity: Severity
    text: str
    mission_id: str = ""


@dataclass(frozen=True)
class Wire:
    """The orchestrator's interface on the network.

    `requests` is the name of an operator's service (std_srvs/srv/Trigger), with `{}` for the request.
    `state_fields` and `outcome_fields` make messages, `read_state` and `read_outcome` read them; the latter
    returns None for a message that is not meant for people. The state is published at once when a field in
    `urgent` changes, besides the published labels, the target, the code and the pause. `hashes` are the types
    that every run uses, each with the hash that the other end of the wire has.
    """

    state: Channel
    outcomes: Channel
    start: StartService
    requests: str
    state_fields: Callable[[Situation], Fields]
    outcome_fields: Callable[[Publish, Callable[[str], Any], Fields], Fields]
    read_state: Callable[[Fields], Progress]
    read_outcome: Callable[[Fields], TargetResult | Remark | None]
    urgent: tuple[str, ...] = ()
    hashes: Mapping[str, str] = field(default_factory=dict)


# -- the terminal ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Flag:
    """A condition as the terminal shows it: `pill` in the title, `on` and `off` as lines when it changes."""

    pill: str
    on: str
    off: str
    alarm: bool = False


@dataclass(frozen=True)
class Terminal:
    """The terminal's words.

    `columns` are the readings of a target, in order, each with its unit; `read` is the word for all of them.
    `gauges` maps a gauge to the flag that turns it red.
    """

    target: str = "target"
    targets: str = "targets"
    read: str = "values"
    columns: Mapping[str, str] = field(default_factory=dict)
    flags: Mapping[str, Flag] = field(default_factory=dict)
    gauges: Mapping[str, str] = field(default_factory=dict)


# -- all of it ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Profile:
    """The declaration of one kind of robot and its missions.

    `resume` and `abort` are those of `requests` that resume a held mission and that end a mission: the
    terminal names the one, Ctrl-C sends the other. `values_of` returns the terminal's columns of a reading.
    `stop` is the input that is true while the robot is stopped by hand: so a simulation gets the stop of a
    page. `projections` are folds of live values, by names of their own. `access` are names of the robot
    itself that browser clients may use. Without `wire` missions can be checked, drawn and simulated, but not
    run.
    """

    name: str
    doc: str
    outcomes: tuple[TargetOutcome, ...] = ()
    request: Mapping[str, RequestField] = field(default_factory=dict)
    requests: Mapping[str, OperatorRequest] = field(default_factory=dict)
    resume: str = ""
    abort: str = ""
    publications: Mapping[str, Publication] = field(default_factory=dict)
    stages: Stages = field(default_factory=Stages)
    terminal: Terminal = field(default_factory=Terminal)
    values_of: Callable[[Mapping[str, Any]], Mapping[str, float]] = lambda _: {}
    stop: str = ""
    projections: Mapping[str, Projection] = field(default_factory=dict)
    wire: Wire | None = None
    access: Access = field(default_factory=Access)

    @property
    def statuses(self) -> tuple[str, ...]:
        """The names of the outcomes."""
        return tuple(outcome.name for outcome in self.outcomes)

    def outcome(self, name: str) -> TargetOutcome | None:
        """Return the outcome of that name; None where the profile has none."""
        return next((outcome for outcome in self.outcomes if outcome.name == name), None)

    def is_good(self, status: str) -> bool:
        """Say whether a visit with this outcome reached its purpose."""
        outcome = self.outcome(status)
        return outcome is not None and outcome.is_good

    @property
    def verbs(self) -> Mapping[str, str]:
        """The verbs of the command line by the request that each is for."""
        return {name: request.verb or name for name, request in self.requests.items()}

    @property
    def events(self) -> Mapping[str, str]:
        """The requests as events, each with its summary: the start, then the operator's."""
        asked = {f"operator.{name}": request.doc for name, request in self.requests.items()}
        return {START: "Somebody asks to start a mission.", **asked}


#: The request that starts a mission, and what those begin with that answer a question.
START = "mission.start"
ANSWER = "answer."
#: What an operator commands beside the requests of a profile: a start, and an answer to a question.
START_VERB, ANSWER_VERB = OWN_VERBS = "start", "answer"
#: Where no profile is installed: missions have states and operations, but nothing to visit.
NO_PROFILE = Profile("", "No profile.")
