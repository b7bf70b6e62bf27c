"""The contract of a plugin: operations, actions, functions, events, values, types, parameters, as data.

A plugin is one `Plugin` object in its `catalog.py`, found by entry point (group `lupin.plugins`). Loading it
needs no ROS, no file and no network, so a laptop can check, draw and simulate every mission. Its driver is
named by text (`client="lupin_nav.client:NavClient"`) and imported only by the node that runs it; it
implements `Driver` and reports through an `Outlet`.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

from lupin_engine.errors import Severity
from lupin_engine.plugin.types import Type

#: Parameter values by name, in base units, after checking.
Parameters = Mapping[str, Any]


class OnHold(enum.Enum):
    """The effect of a hold on a running attempt of an operation."""

    CANCEL = "cancel"  #: it moves the robot: cancelled, and issued again when the hold is released
    FINISH = "finish"  #: a one-shot call: it may finish, its answer waits for the release


@dataclass(frozen=True)
class Code:
    """A reason that can reach the published state: raw name, label for people, severity.

    `advice` is one sentence for the operator of the robot. A second declaration of the code need not repeat
    it.
    """

    name: str
    label: str
    severity: Severity = Severity.WARN
    advice: str = field(default="", compare=False)


#: The code of an expression or an action that failed, of an invariant that does not hold, and of a property
#: that a run breaks.
EXECUTION_CODE, INVARIANT_CODE, PROPERTY_CODE = "execution_error", "invariant_broken", "property_broken"
#: Codes of the orchestrator itself: it was started again in the midst of a mission, it closed one that it
#: could not go on with, its journal cannot be written, or can again.
RESTARTED_CODE, CLOSED_CODE = "restarted", "mission_closed"
UNRECORDED_CODE, RECORDED_CODE = "journal_failed", "journal_works"
#: The code of a server that refuses to end what it does.
REFUSED_CODE = "cancel_refused"
#: The code of a divert that waits until the state is finished, or left in order.
DIVERT_CODE = "divert_waits"
#: The engine's own holds, each with its code: they are in every chart.
RESTARTED, UNRECORDED, BREACHED = "restarted", "unrecorded", "breached"
OWN_HOLDS: Mapping[str, str] = {
    RESTARTED: RESTARTED_CODE,
    UNRECORDED: UNRECORDED_CODE,
    BREACHED: PROPERTY_CODE,
}
#: Codes that any operation may end in: they are the engine's, whatever the operation declares.
OPERATION_CODES = ("driver_error", EXECUTION_CODE, "operation_cancelled")
#: The codes that are in every chart.
ENGINE_CODES: Mapping[str, Code] = {
    code.name: code
    for code in (
        Code("driver_error", "a plugin failed", advice="Tell whoever wrote the plugin what the detail says."),
        Code(
            "operation_cancelled",
            "cancelled by the server",
            advice="Look for who else commands this server; the mission goes on as it says.",
        ),
        Code(
            EXECUTION_CODE,
            "an expression or an action failed",
            Severity.ERROR,
            "Tell whoever wrote the mission: the detail has the file and the line.",
        ),
        Code(
            INVARIANT_CODE,
            "an invariant does not hold",
            Severity.ERROR,
            "Tell whoever wrote the mission what you saw: something that must always hold does not.",
        ),
        Code(
            PROPERTY_CODE,
            "a property is broken",
            Severity.ERROR,
            "Look whether the robot is safe; then tell whoever wrote the mission what the detail says.",
        ),
        Code(
            RESTARTED_CODE,
            "the orchestrator was started again; look, then resume",
            advice="Look where the robot is and that its way is free, then resume, or abort.",
        ),
        Code(
            CLOSED_CODE,
            "the mission was closed: it could not go on after a restart",
            advice="Look where the robot is, then start the mission anew.",
        ),
        Code(
            UNRECORDED_CODE,
            "the journal cannot be written",
            advice="Make room on its disk, or make its folder writable, then resume; it can be ended now.",
        ),
        Code(DIVERT_CODE, "what has begun is finished first", Severity.INFO, "Wait until it is finished."),
        Code(RECORDED_CODE, "the journal is written again", Severity.INFO, "Nothing to do."),
        Code(
            REFUSED_CODE,
            "a server refuses to stop",
            Severity.ERROR,
            "Stop what moves by its own emergency stop, then look at the server that the detail names.",
        ),
    )
}


def classify(code: str, declared: Mapping[str, Code]) -> Code:
    """Return a code with its label and severity; an undeclared one is its own label, a warning."""
    if not code:
        return Code("", "", Severity.INFO)
    return declared.get(code) or ENGINE_CODES.get(code) or Code(code, code)


@dataclass(frozen=True)
class Argument:
    """An argument of an operation, action or function.

    Without `default` it must be given, unless it is `optional`: then it may be left out, and is not among the
    arguments that the driver or function gets.
    """

    type: Type
    doc: str
    default: Any = None
    optional: bool = False


@dataclass(frozen=True)
class Mock:
    """The default end of an operation in a simulation: `result` after `after` seconds.

    `result` maps each result field to a value, or is a function of the arguments and the parameters; `values`
    likewise gives the live values that change with success.
    """

    after: float = 0.0
    result: Mapping[str, Any] | Callable[[Mapping[str, Any], Parameters], Mapping[str, Any]] = field(
        default_factory=dict
    )
    values: Mapping[str, Any] | Callable[[Mapping[str, Any], Parameters], Mapping[str, Any]] = field(
        default_factory=dict
    )


@dataclass(frozen=True)
class Operation:
    """An operation takes time and ends: done with `result`, or in an error with one of `codes`.

    `uses` names resources (`base`, `lift`): an attempt waits until the previous attempt that uses one of them
    has ended. `on_hold` is the effect of a hold on it. With `cut_short` the driver gives the partial result
    of an attempt that was cancelled; after a timeout the mission waits for that. An operation that `adopts`
    continues after a restart of the orchestrator, unless a hold would end it. One that `replaces` begins
    although the server refuses to end an earlier attempt with the same resource: its server replaces the old
    order by the new one. It is for ways home. The server of one that `updates` takes a new order of the same
    operation in place of the one it works on, whose end the driver reports as any other: an `invoke` may have
    `update`. `classes` are results that missions should be proven with, good ones and bad ones; each has the
    fields in which it differs from the mock's.
    """

    doc: str
    arguments: Mapping[str, Argument] = field(default_factory=dict)
    result: Mapping[str, Type] = field(default_factory=dict)
    codes: tuple[Code, ...] = ()
    uses: tuple[str, ...] = ()
    on_hold: OnHold = OnHold.FINISH
    cut_short: bool = False
    mock: Mock = field(default_factory=Mock)
    adopts: bool = False
    replaces: bool = False
    updates: bool = False
    classes: tuple[Mapping[str, Any], ...] = ()


@dataclass(frozen=True)
class Action:
    """Something that is sent and not waited for. `moves`: while held it waits for the release."""

    doc: str
    arguments: Mapping[str, Argument] = field(default_factory=dict)
    moves: bool = False


@dataclass(frozen=True)
class Function:
    """A pure function that expressions may call; `bind` gives it the parameters once, at start.

    Arguments are passed by position, in the order of `arguments`.
    """

    doc: str
    returns: Type
    bind: Callable[[Parameters], Callable[..., Any]]
    arguments: Mapping[str, Argument] = field(default_factory=dict)


@dataclass(frozen=True)
class LiveValue:
    """A value from the world that changes by itself; `freshness` is how long it stays known, in seconds.

    `initial` is the value before the first report; None means unknown. `classes` are values that missions
    should be proven with.
    """

    doc: str
    type: Type
    freshness: float | None = None
    initial: Any = None
    classes: tuple[Any, ...] = ()


@dataclass(frozen=True)
class EventKind:
    """An event in the world, reported once and unasked; `fields` come with it."""

    doc: str
    fields: Mapping[str, Type] = field(default_factory=dict)


@dataclass(frozen=True)
class Parameter:
    """A setting with type, default and range; becomes a ROS parameter of the same name."""

    type: Type
    default: Any
    doc: str
    minimum: float | None = None
    maximum: float | None = None


@dataclass(frozen=True)
class Reader:
    """The parser of a type in requests: `bind(parameters)` gives the reading function.

    The reading function returns the value, or raises ValueError with a text for the operator.
    """

    code: Code
    bind: Callable[[Parameters], Callable[[Any], Any]]


@dataclass(frozen=True)
class Access:
    """The names of the network that browser clients may use, by the least role that may.

    A viewer reads: topics are subscribed to, and services called that change nothing. Names that an operator
    commands and an engineer sets up are published on, called, or sent as an action. Names are absolute; `*`
    in one stands for any letters.

    `motions` are topics and services that move the robot, and `velocities` topics of which a message of zeros
    stops it, for every role: nothing on them passes while the robot is stopped. Every action moves it.
    """

    viewer: tuple[str, ...] = ()
    operator: tuple[str, ...] = ()
    engineer: tuple[str, ...] = ()
    motions: tuple[str, ...] = ()
    velocities: tuple[str, ...] = ()


@dataclass(frozen=True)
class Plugin:
    """All that a plugin offers. Operations, actions and events have local names: `nav.go_to` is `go_to` here.

    Functions, live values, types and parameters carry their full name, which must be unique over all
    plugins. `client` is `module:Class` of the `Driver`; `nodes` maps a node's name to `module:function`,
    called with the command line's ROS arguments and returning an exit code. `stands_in` maps a node that
    simulates something to the actions and services of the real thing: it is not started where those are.
    `guards` maps a node that supervises a device, real or simulated, to its actions and services.
    `companions` names nodes that only listen, and run beside every mission, whether it uses the plugin or
    not. `composable` names nodes that may share a process: each is a `RosNode`, and none keeps the robot
    safe. `simulated_defaults` are values, in base units, that parameters of missions take by default where
    the plugin's simulations are started. The names of its nodes that others may use, such as bindings, are
    separate rights: `serves` are services and actions that may be called, `publishes` topics that may be
    subscribed to and that no other node may publish, `accepts` topics that may be published. `access` are the
    names of its nodes and drivers that people's pages may use. `readers` are by the name of the type that
    they read. An `internal` plugin is for a chart of its own and is not offered to authors of missions.
    The nodes of one that is `hmi` serve people's pages, and are started where `--hmi` asks for them; `pages`
    is the `module:function` that serves the same pages on a simulation or a recording, a
    `plugin.pages.ServePages`. Companions and simulations run beside missions of `profile` only; without one,
    beside all.
    """

    name: str
    doc: str
    operations: Mapping[str, Operation] = field(default_factory=dict)
    actions: Mapping[str, Action] = field(default_factory=dict)
    functions: Mapping[str, Function] = field(default_factory=dict)
    values: Mapping[str, LiveValue] = field(default_factory=dict)
    events: Mapping[str, EventKind] = field(default_factory=dict)
    types: Mapping[str, Type] = field(default_factory=dict)
    readers: Mapping[str, Reader] = field(default_factory=dict)
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    client: str = ""
    nodes: Mapping[str, str] = field(default_factory=dict)
    stands_in: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    guards: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    companions: tuple[str, ...] = ()
    composable: tuple[str, ...] = ()
    simulated_defaults: Mapping[str, Any] = field(default_factory=dict)
    internal: bool = False
    hmi: bool = False
    pages: str = ""
    serves: tuple[str, ...] = ()
    publishes: tuple[str, ...] = ()
    accepts: tuple[str, ...] = ()
    access: Access = field(default_factory=Access)
    profile: str = ""

    @property
    def offered(self) -> tuple[str, ...]:
        """All names that its nodes have for others."""
        return (*self.serves, *self.publishes, *self.accepts)

    @property
    def serving(self) -> dict[str, str]:
        """The nodes that its driver may talk to: all but those in `guards`."""
        return {name: entry for name, entry in self.nodes.items() if name not in self.guards}


class Outlet(Protocol):
    """The interface for a driver's reports. Every call is quick and may come from the node's thread."""

    def accepted(self, attempt: str) -> None:
        """The server took the request."""

    def progress(self, attempt: str, detail: str) -> None:
        """The attempt's progress, or the reason for its wait; becomes the detail of a timeout."""

    def done(self, attempt: str, result: Mapping[str, Any]) -> None:
        """The attempt succeeded."""

    def failed(self, attempt: str, code: str, detail: str = "") -> None:
        """The attempt ended in one of its operation's codes."""

    def cancelled(self, attempt: str, result: Mapping[str, Any] | None = None) -> None:
        """The attempt ended because it was asked to, with its result so far where it is `cut_short`."""

    def cancel_refused(self, attempt: str, detail: str) -> None:
        """The server refuses to end the attempt, or does not end it; `detail` is the consequence for people.

        The driver repeats the cancel until the attempt has ended.
        """

    def value(self, name: str, value: Any, stamp: float) -> None:
        """A live value changed; `stamp` is when it was true, in seconds of the node's clock."""

    def event(self, name: str, data: Mapping[str, Any]) -> None:
        """One of the plugin's events happened (full name); `data` has its fields."""


class Driver(Protocol):
    """The side of a plugin that talks to the world: starts and cancels attempts, carries out actions.

    No call blocks. After `cancel` exactly one of done, failed, cancelled still follows for an attempt that
    the server has accepted; where the server refuses, `cancel_refused` comes first. An attempt cancelled
    before it was accepted reports `accepted` when the server takes it after all, and is then cancelled again
    by the engine.
    """

    def missing(self) -> list[str]:
        """Return the servers and topics that this plugin still waits for; empty when it is ready."""

    def start(self, attempt: str, operation: str, arguments: Mapping[str, Any]) -> None:
        """Begin an attempt of one of the plugin's operations (local name); its name never comes twice."""

    def cancel(self, attempt: str) -> None:
        """Ask that an attempt ends; unknown attempts are ignored."""

    def act(self, action: str, arguments: Mapping[str, Any]) -> None:
        """Carry out an action (local name) without waiting for it."""

    def close(self) -> None:
        """Release everything; no report follows."""


@runtime_checkable
class RecoveringDriver(Driver, Protocol):
    """A driver whose attempts may live on in their servers after the process has ended.

    Attempts of other drivers count as ended with their process.
    """

    def recover(self, attempt: str, operation: str, *, adopt: bool) -> None:
        """Take over an attempt of another process: cancel it, or follow it with `adopt`.

        Reports follow as for one that was accepted.
        """
