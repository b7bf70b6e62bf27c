"""The one adapter over rclpy: every node and every plugin client talks to ROS through a `RosNode`.

Each work-around lives in this package, for this reason:

* single-threaded executor: the multi-threaded one drops reliable messages, the events executor deadlocks;
* guarded callbacks (`logs`): an exception in a callback ends the spin, while the services stay advertised;
* depth 1000 on services (`qos`): the default queue of 10 over all clients loses requests silently;
* a deadline on every call (`calls`), then `remove_pending_request`: an answer may never come;
* results asked for again (`actions`): rclpy leaves the future pending when a result was lost in an outage;
* requests refused by the middleware's timestamp (`executor`): those sent in an outage arrive after it;
* a node leaves only when its cancels are answered (`actions`): goals would go on unobserved;
* own signal handlers (`process`): rclpy's shut the context down before the `on_stop` callbacks;
* `ExternalShutdownException` ends a spin quietly: the context may be shut down from elsewhere;
* the end of the spin closes executor, node and context: a leaking server steals the requests of the next;
* a limit on that (`process`): Fast DDS deadlocks in about 1 of 700 ends when several nodes leave at once;
* a profile of our own (`dds`): without it finding a peer takes up to 2.4 s and detecting its death 20 s, and
  every participant on the network is answered;
* no second wake-up after each callback, and a wait set that is kept (`executor`, `wait_set`): rclpy's take
  two thirds of an idle node's processor time;
* dead references are dropped (`executor`): rclpy keeps one for each timer that was ever made;
* results of goals are kept for two minutes (`actions`): rclpy keeps and publishes those of fifteen;
* posting wakes the executor: nothing else makes it look for work of other threads;
* timers run on the monotonic clock (on ROS time with `use_sim_time`): a stepped wall clock moves no deadline;
* declared parameter types, integers accepted for doubles (`parameters`): rclpy refuses `60` for a double;
* type hashes compared with the peers' (`peers`): a mismatch is otherwise silent;
* a node that stood still for longer than others remember it ends itself (`process`): Fast DDS may never
  match the two again;
* bytes counted before a message is read (`qos`): a list of thousands keeps a stop waiting for a second;
* diagnostics of every node (`vitals`): a hanging one stays in the graph;
* servers counted (`peers`): two of one name would both carry out every request;
* transitions judged before rclpy's lifecycle is asked (`lifecycle`): it answers nothing to a wrong one.
"""

from __future__ import annotations

import contextlib
import os
import re
import time
import uuid
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import Any, ClassVar

import rclpy
from builtin_interfaces.msg import Time
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.action import ActionClient, ActionServer
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.exceptions import InvalidHandle, InvalidParameterTypeException, NameValidationException
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription

from lupin_engine.errors import LupinError, Severity, UsageError
from lupin_engine.plugin import MAX_SECONDS, Code, CommonName, name_of, robot_namespace
from lupin_ros.adapter.actions import (
    CANCEL_LIMIT_S,
    ActionCaller,
    ActionHost,
    Goal,
    GoalCallbacks,
    ServedGoal,
)
from lupin_ros.adapter.calls import CallFailure, ServiceCall, ServiceCaller
from lupin_ros.adapter.dds.profile import forgotten_after, is_closed, use_profile
from lupin_ros.adapter.executor import Executor, LivingEntities, Serving, StaleAfter
from lupin_ros.adapter.frames import FRAME_PREFIX, FramePrefix
from lupin_ros.adapter.lifecycle import NOT_ACTIVE, ManagedNode
from lupin_ros.adapter.logs import COUNT_S, NodeLog, guarded
from lupin_ros.adapter.parameters import Declared, DeclaredParameters
from lupin_ros.adapter.peers import (
    action_channels,
    peer_mismatches,
    rival_servers,
    service_channels,
)
from lupin_ros.adapter.process import (
    StoodStill,
    ends_the_process_after,
    signals_call,
    standstill_calls,
)
from lupin_ros.adapter.qos import Qos, most_bytes
from lupin_ros.adapter.vitals import DIAGNOSTICS_TOPIC, REPORT_S, CountedPublisher, Vitals

__all__ = [
    "ActionCaller",
    "ActionHost",
    "CallFailure",
    "Goal",
    "GoalCallbacks",
    "Qos",
    "RosNode",
    "RosTimer",
    "ServedGoal",
    "ServiceCall",
    "ServiceCaller",
    "guarded",
    "peer_mismatches",
]

#: Seconds from the start to the first check of the peers, and between two checks.
FIRST_PEER_CHECK_S = 1.0
PEER_CHECK_PERIOD_S = 5.0

#: This many exceptions outside callbacks within one second are a broken node, not a bad message.
MAX_FAILURES_PER_SECOND = 20

#: Codes of a node's own troubles in its diagnostics; of a trouble without one.
TOO_LARGE = Code("message_too_large", "a message is too large", advice="Send less in one message.")
MISMATCH = Code(
    "other_peers",
    "peers have other types, or serve the same name",
    Severity.ERROR,
    "Use the same interface packages on both sides, and one server for a name.",
)
UNNAMED = Code("", "")

#: Nodes that are named by their process, and the enclave of SROS2 that they run in.
_OF_PEOPLE = re.compile(r"lupin_\w+_\d+")
OPERATOR_ENCLAVE = "/lupin/operator"

#: Seconds that releasing a node at the end of its spin may take before the process is ended by force.
TEARDOWN_LIMIT_S = 3.0
#: How long the end of a process waits for subscribers to acknowledge what was published, in seconds.
DELIVERY_LIMIT_S = 0.5


def enclave_of(node: str) -> str:
    """Return the enclave in which a node runs under SROS2; the verbs of people have one for all."""
    return OPERATOR_ENCLAVE if _OF_PEOPLE.fullmatch(node) else f"/lupin/{node}"


def _enclave_arguments(node: str, given: Sequence[str]) -> list[str]:
    """Return the ROS arguments of that enclave, where SROS2 is on and no other is given."""
    said = {"-e", "--enclave"}.intersection(given) or os.environ.get("ROS_SECURITY_ENCLAVE_OVERRIDE")
    return [] if said or not is_secured() else ["--ros-args", "--enclave", enclave_of(node)]


def is_secured() -> bool:
    """Return whether SROS2 is switched on."""
    return os.environ.get("ROS_SECURITY_ENABLE", "").lower() == "true"


def begin(context: Context, arguments: Sequence[str]) -> None:
    """Begin a context with ROS arguments, without rcl's own log file, which would grow without limit."""
    rclpy.init(
        args=["--ros-args", "--disable-external-lib-logs", "--", *arguments],
        context=context,
        signal_handler_options=SignalHandlerOptions.NO,
    )


@contextlib.contextmanager
def one_context(arguments: Sequence[str]) -> Iterator[None]:
    """Let all nodes that this process makes share a context, and so a participant of DDS.

    Under SROS2 each has its own, for its own permissions.

    Raises:
        UsageError: ROS cannot read the arguments.
    """
    if is_secured():
        yield
        return
    use_profile()
    RosNode._shared = context = Context()
    try:
        begin(context, arguments)
    except (RuntimeError, ValueError) as error:
        raise _bad_arguments(arguments, error) from error
    try:
        yield
    finally:
        with ends_the_process_after(TEARDOWN_LIMIT_S):
            RosNode._shared = None
            context.try_shutdown()


def _bad_arguments(arguments: Sequence[str], error: Exception) -> UsageError:
    reason = str(error).split(", at /")[0]  # the rest is places in rcl's sources
    return UsageError(f"ROS does not start with the arguments {list(arguments)}: {reason}")


class RosTimer:
    """A running timer of the node; ends with `cancel`."""

    def __init__(self, node: Node, period: float, callback: Callable[[], None], clock: Clock) -> None:
        self._node = node
        # ROS counts nanoseconds in 64 bits; a period that is no number is waited for as long as possible.
        self._timer = node.create_timer(min(MAX_SECONDS, period), callback, clock=clock)

    def cancel(self) -> None:
        """End the timer; its callback is not called any more. Cancelling twice does no harm."""
        timer, self._timer = self._timer, None
        if timer is not None:
            self._node.destroy_timer(timer)


class RosNode:
    """A node with its own context and executor, all ROS arguments honoured; a context that closes it.

    Every name follows the node's namespace, with and without a slash at its begin, but `COMMON_NAMES` and
    what is a `CommonName`. The namespace is `__ns` of the ROS arguments, else `LUPIN_ROBOT`.

    Everything is called on the thread that spins, except `post` and `stop`. Parameters are declared with
    type, range and documentation; values given on the command line are checked before anything else.
    `parameters` may be a function of the given values, because a mission has its own. A `managed` node has
    the lifecycle services, and activates itself unless its parameter `autostart_node` is false.

    Raises:
        UsageError: ROS cannot read the arguments.
        LupinError: a parameter has a value that it may not have.
    """

    #: The context of all nodes of this process, where they share one.
    _shared: ClassVar[Context | None] = None
    #: Called instead of every spin, to read the interfaces that a node declares; the node ends then.
    rehearsed: ClassVar[Callable[[RosNode], None] | None] = None

    def __init__(
        self,
        name: str,
        arguments: Sequence[str] = (),
        parameters: Declared | Callable[[Mapping[str, Any]], Declared] = MappingProxyType({}),
        *,
        managed: bool = False,
    ) -> None:
        use_profile()
        self._context = RosNode._shared or Context()
        self.node = self._make_node(name, arguments, ManagedNode if managed else Node)
        self.name: str = self.node.get_name()
        #: '' for the root.
        self.namespace: str = self.node.get_namespace().rstrip("/")
        #: Where `log` goes.
        self.log_book = NodeLog(self.node)
        self.log = self.log_book.log
        #: The prefix of the frames in messages; see `frames`.
        self.frames = FramePrefix("")
        self._executor = Executor(self._context, self.log)
        self._executor.add_node(self.node)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._simulated = 0.0  # simulated time when it was read last; 0 is what ROS says before it knows
        self._behind = 0.0  # what has to be added to it
        self._posted: deque[Callable[[], object]] = deque()
        self._wakeup = self.node.create_guard_condition(self._run_posted)
        self._closed = self._stopping = False
        #: The seed of the ids of goals; a process that resumes another's work has the same.
        self.lineage = uuid.uuid4().hex
        #: The topic by which servers of this node's goals see that it is alive; '' for none.
        self.lifeline = ""
        self._stop_callbacks: list[Callable[[], None]] = []
        self._left_callbacks: list[Callable[[], object]] = []
        self._callers: list[ActionCaller] = []
        self._hosts: list[ActionHost] = []
        self._channels: dict[str, None] = {}
        self._vitals: Vitals | None = None
        self._failures: deque[float] = deque(maxlen=MAX_FAILURES_PER_SECOND)
        self._stood_still: float | None = None
        self._logged_findings: frozenset[str] = frozenset()
        self._seen_rivals: frozenset[str] = frozenset()
        #: Topics whose last message was too large.
        self._refused: set[str] = set()
        try:
            self._declared = DeclaredParameters(self.node, self.log, arguments, parameters)
            self.frames = FramePrefix(self._frame_prefix())
            self._one_shot(FIRST_PEER_CHECK_S, self._check_peers, self._steady)
            self.steady_timer(PEER_CHECK_PERIOD_S, self._check_peers)
            vitals = self._vitals = Vitals(self.node, self.full(DIAGNOSTICS_TOPIC), time.monotonic())
            self.steady_timer(REPORT_S, lambda: vitals.report(time.monotonic()))
            self.steady_timer(COUNT_S, self.log_book.flush)
            if isinstance(self.node, ManagedNode):
                self._manage(self.node)
        except BaseException:
            self.close()
            raise

    def _make_node(self, name: str, arguments: Sequence[str], kind: type[Node]) -> Node:
        namespace = robot_namespace() or None
        try:
            if self._context is not RosNode._shared:
                begin(self._context, [*arguments, *_enclave_arguments(name, arguments)])
            node = kind(name, context=self._context, namespace=namespace)
        except (RuntimeError, ValueError, NameValidationException) as error:
            # rcl has half a dozen exceptions for bad arguments and names, all derived from these.
            self._end_context()
            raise _bad_arguments(arguments, error) from error
        living = LivingEntities()
        for reference in node.default_callback_group.entities:
            living.add(reference)
        node.default_callback_group.entities = living
        return node

    # --- lifecycle --------------------------------------------------------------------------------------

    @property
    def inactive(self) -> str:
        """Why a managed node refuses requests; '' while it is active."""
        return self.node.inactive if isinstance(self.node, ManagedNode) else ""

    def _manage(self, node: ManagedNode) -> None:
        node.autostart()
        node.refused, node.changed = self.log.warning, self._state_changed
        self._executor.inactive = lambda: self.inactive
        self.trouble("lifecycle", self.inactive, NOT_ACTIVE)

    def on_inactive(self, left: Callable[[], object] = str, hindrance: Callable[[], str] = str) -> None:
        """Run `left` when the managed node has left `active`; `hindrance` returns why it may not, else ''."""
        self._left_callbacks.append(left)
        self.node.hindrance = hindrance

    def _state_changed(self, was_active: bool) -> None:
        self.log.info("lifecycle", state=self.inactive or "active")
        self.trouble("lifecycle", self.inactive, NOT_ACTIVE)
        for left in self._left_callbacks if was_active else ():
            self.guarded(left)()

    # --- parameters -------------------------------------------------------------------------------------

    def _frame_prefix(self) -> str:
        """Declare the parameter of every node.

        Raises:
            LupinError: its value is no text.
        """
        about = ParameterDescriptor(
            description="what stands before each frame on the network", read_only=True
        )
        try:
            return str(self.node.declare_parameter(FRAME_PREFIX, "", about).value)
        except InvalidParameterTypeException as problem:
            raise LupinError(f"parameter {FRAME_PREFIX!r}: {problem}") from None

    def parameters(self) -> dict[str, Any]:
        """Return the current values of the declared parameters as plain data in base units."""
        return self._declared.values()

    def on_parameter(
        self,
        callback: Callable[[Mapping[str, Any]], str | None],
        stored: Callable[[Mapping[str, Any]], None] | None = None,
    ) -> None:
        """Allow changes at run time: `callback` gets the new values (checked, base units) by name.

        It returns None to accept them, or why not. Without any callback every change is refused, because a
        value that is only read at the start would seem to have been set. ROS may still refuse accepted
        values: `stored` gets those that ROS has stored.
        """
        self._declared.on_change(callback, stored and self.guarded(stored))

    def set_parameter(self, name: str, value: Any) -> None:
        """Correct a declared parameter from inside the node; the `on_parameter` callbacks get the value.

        Raises:
            LupinError: one of them refuses it, or ROS does; the parameter is as before.
        """
        self._declared.set(name, value)

    def values_with(self, specs: Declared) -> dict[str, Any]:
        """Return the values after a `declare_anew`, without changing anything.

        Raises:
            LupinError: a given value is not allowed, or ROS has no such type.
        """
        return self._declared.values_with(specs)

    def declare_anew(self, specs: Declared) -> None:
        """Have exactly these parameters: new and changed ones as at a start, the others as they are."""
        self._declared.declare_anew(specs)

    # --- time -------------------------------------------------------------------------------------------

    def now(self) -> float:
        """Return the time of the node's clock in seconds (wall clock, or ROS time with `use_sim_time`)."""
        return float(self.node.get_clock().now().nanoseconds) * 1e-9

    def stamp(self) -> Time:
        """Return the time of the node's clock as a message."""
        return self.node.get_clock().now().to_msg()

    def elapsed(self) -> float:
        """Return seconds on the clock of the timers: for durations, not to be shown or sent.

        It never goes back: where simulated time jumps back, or is received for the first time, the clock goes
        on from its last value.
        """
        clock = self._timer_clock()
        if clock is self._steady:
            return float(clock.now().nanoseconds) * 1e-9
        return self._continued(float(clock.now().nanoseconds) * 1e-9)

    def _continued(self, simulated: float) -> float:
        if simulated < self._simulated or not self._simulated:
            self._behind += self._simulated - simulated
        self._simulated = simulated
        return simulated + self._behind

    def timer(self, period: float, callback: Callable[[], None]) -> RosTimer:
        """Call `callback` every `period` seconds (of ROS time with `use_sim_time`, else of real time)."""
        return RosTimer(self.node, period, self.guarded(callback), self._timer_clock())

    def call_later(self, delay: float, callback: Callable[[], None]) -> RosTimer:
        """Call `callback` once after `delay` seconds (of ROS time with `use_sim_time`, else real time)."""
        return self._one_shot(delay, callback, self._timer_clock())

    def steady_timer(self, period: float, callback: Callable[[], None]) -> RosTimer:
        """Call `callback` every `period` seconds of real time, also when simulated time stands still."""
        return RosTimer(self.node, period, self.guarded(callback), self._steady)

    def _one_shot(self, delay: float, callback: Callable[[], None], clock: Clock) -> RosTimer:
        def fire() -> None:
            timer.cancel()
            callback()

        timer = RosTimer(self.node, max(0.0, delay), self.guarded(fire), clock)
        return timer

    def _timer_clock(self) -> Clock:
        # The ROS clock without simulated time is the wall clock, and that one is stepped now and then.
        clock = self.node.get_clock()
        return clock if clock.ros_time_is_active else self._steady

    # --- topics, services, actions ----------------------------------------------------------------------

    def full(self, name: str) -> str:
        """Return a name in the node's namespace, before remapping; private ones (`~/`) as they are."""
        return name_of(self.namespace, name)

    def topic_name(self, name: str) -> str:
        """Return the name of a topic or action on the network: in the namespace, and remapped."""
        return CommonName(self.node.resolve_topic_name(self.full(name)))

    def service_name(self, name: str) -> str:
        """Return the name of a service on the network."""
        return CommonName(self.node.resolve_service_name(self.full(name)))

    def count_publishers(self, topic: str) -> int:
        """Return how many publishers a topic has."""
        return int(self.node.count_publishers(self.full(topic)))

    def publisher(self, kind: Any, topic: str, qos: Qos) -> Publisher:
        """Return an object whose `publish(message)` sends to `topic`."""
        profile = qos.profile()
        publisher = self.node.create_publisher(
            kind, self.full(topic), profile, publisher_class=CountedPublisher
        )
        publisher.frames = self.frames
        self.watch_channels([f"rt{publisher.topic_name}"])
        return publisher

    def subscribe(
        self, kind: Any, topic: str, qos: Qos, callback: Callable[[Any], None], most: int | None = None
    ) -> Subscription:
        """Call `callback` with every message of `topic`, until the node's `destroy_subscription`.

        One of more than `most` bytes, by default `qos.most_bytes`, is refused and reported.
        """
        topic, limit, guard = self.full(topic), most or most_bytes(kind), self.guarded(callback)
        if limit is None:

            def hear(message: Any) -> None:  # rclpy counts the arguments
                guard(self.frames.incoming(message))

            subscription = self.node.create_subscription(kind, topic, hear, qos.profile())
        else:
            read = self.guarded(partial(self._read, kind, topic, limit, callback))

            def take(data: bytes) -> None:  # rclpy counts the arguments
                read(data)

            subscription = self.node.create_subscription(kind, topic, take, qos.profile(), raw=True)
        self.watch_channels([f"rt{subscription.topic_name}"])
        return subscription

    def _read(self, kind: Any, topic: str, limit: int, callback: Callable[[Any], None], data: bytes) -> None:
        """Make a message of its bytes, unless they are too many to be read while a stop waits."""
        if len(data) <= limit:
            if topic in self._refused:
                self._refused.discard(topic)
                self.trouble(topic, "")
            callback(self.frames.incoming(deserialize_message(data, kind)))
            return
        problem = f"{topic}: messages of more than {limit} bytes are refused"
        self._refused.add(topic)
        self.trouble(topic, problem, TOO_LARGE)
        self.log.error(problem)

    def subscribe_raw(
        self, kind: Any, topic: str, profile: QoSProfile, callback: Callable[[bytes, Any], None]
    ) -> Subscription:
        """Call `callback` with the bytes of every message, as CDR, and with the times of its transport.

        These are `source_timestamp` and `received_timestamp`, in nanoseconds of the wall clock.
        `qos.heard_profile` makes a profile that matches the publishers of other nodes.
        """
        guard = self.guarded(callback)

        def take(data: bytes, times: Any) -> None:  # rclpy counts the arguments
            guard(data, times)

        # Without rclpy's own handlers of events, each of which is waited for beside the messages.
        silent = SubscriptionEventCallbacks(use_default_callbacks=False)
        topic = self.full(topic)
        return self.node.create_subscription(kind, topic, take, profile, raw=True, event_callbacks=silent)

    def serve(
        self,
        kind: Any,
        name: str,
        callback: Callable[[Any, Any], Any],
        *,
        stale_after: StaleAfter = None,
        refuse: Callable[[Any, str], Any] | None = None,
        in_every_state: bool = False,
    ) -> None:
        """Answer requests with `callback(request, response)`, which returns the response.

        A request that was sent more than `stale_after` seconds ago is not carried out: its caller has
        given up. Where that depends on the request, `stale_after` is a function (see `StaleAfter`). It is
        answered with `refuse(response, reason)`, in case the caller still waits and only the clocks disagree;
        without `refuse` not at all. While the node is not active it is refused likewise, unless the service
        works `in_every_state`. When the callback raises nothing is answered, because an empty response may
        mean success; the caller's deadline reports it.
        """
        self._serve(kind, name, callback, Serving(stale_after, refuse, in_every_state, later=False))

    def serve_later(
        self,
        kind: Any,
        name: str,
        callback: Callable[[Any, Any, Callable[[Any], None]], None],
        *,
        stale_after: StaleAfter = None,
        refuse: Callable[[Any, str], Any] | None = None,
        in_every_state: bool = False,
    ) -> None:
        """Answer requests asynchronously: `callback(request, response, answer)`, then `answer(response)`.

        `answer` must be called once, now or later; see `serve` for the rest.
        """
        self._serve(kind, name, callback, Serving(stale_after, refuse, in_every_state, later=True))

    def _serve(self, kind: Any, name: str, callback: Callable[..., Any], how: Serving) -> None:
        profile = Qos.SERVICES.profile()
        guard = self.guarded(callback)
        service = self.node.create_service(kind, self.full(name), guard, qos_profile=profile)
        self._executor.serve(service, how)
        self.watch_channels(service_channels(service.service_name))

    def service(self, kind: Any, name: str) -> ServiceCaller:
        """Return a client of the service `name`."""
        self.watch_channels(service_channels(self.service_name(name)))
        return ServiceCaller(self, kind, self.full(name))

    def action(self, kind: Any, name: str) -> ActionCaller:
        """Return a client of the action `name`."""
        self.watch_channels(action_channels(self.topic_name(name)))
        caller = ActionCaller(self, kind, self.full(name))
        # Missions that are loaded anew make new clients: those that are released are not kept.
        self._callers = [*(other for other in self._callers if not other.released), caller]
        return caller

    def serve_action(
        self,
        kind: Any,
        name: str,
        *,
        admit: Callable[[Any], bool],
        started: Callable[[ServedGoal], None],
        cancelled: Callable[[ServedGoal], None],
    ) -> ActionHost:
        """Offer the action `name`; see `ActionHost` for the callbacks."""
        self.watch_channels(action_channels(self.topic_name(name)))
        host = ActionHost(self, kind, self.full(name), admit=admit, started=started, cancelled=cancelled)
        self._hosts = [*(other for other in self._hosts if not other.closed), host]
        return host

    def channels(self) -> list[str]:
        """Return the DDS topics that this node uses (see `peers`)."""
        return list(self._channels)

    def watch_channels(self, channels: Sequence[str]) -> None:
        """Compare the types of these DDS topics with the peers', as for the node's own."""
        self._channels.update(dict.fromkeys(channels))

    def _check_peers(self) -> None:
        self._executor.events_too = True
        rivals = frozenset(rival_servers(self))
        found = frozenset(peer_mismatches(self)) | (rivals & self._seen_rivals)
        for finding in sorted(found - self._logged_findings):
            self.log.error(finding)
        self.trouble("peers", "; ".join(sorted(found)), MISMATCH)
        self._logged_findings, self._seen_rivals = found, rivals

    def trouble(self, about: str, problem: str, code: Code = UNNAMED) -> None:
        """Report a trouble on /diagnostics from now on; '' when it is over.

        `code` has its severity and advice.
        """
        if self._vitals is not None:
            self._vitals.trouble(about, problem, code)

    # --- running ----------------------------------------------------------------------------------------

    def guarded(self, callback: Callable[..., Any]) -> Callable[..., Any]:
        """Return `callback` with its exceptions logged on this node; see `guarded`."""
        return guarded(callback, self.log)

    def post(self, callback: Callable[[], object]) -> None:
        """Run `callback` on the node's thread, in the order of posting; safe from every thread."""
        self._posted.append(callback)
        with contextlib.suppress(InvalidHandle):  # the node has been closed meanwhile: nobody will run it
            self._wakeup.trigger()

    def _run_posted(self) -> None:
        # Only what is there now: a callback that posts again must not keep messages waiting.
        for _ in range(len(self._posted)):
            self.guarded(self._posted.popleft())()

    def spin(self) -> None:
        """Spin until SIGINT, SIGTERM or `stop`, then run the `on_stop` callbacks and close the node.

        Before it closes, goals that its clients sent are cancelled, and the answers waited for, at most
        `CANCEL_LIMIT_S`. Returns cleanly in all these cases.

        Raises:
            StoodStill: the process stood still, others may have forgotten the node; it ended as on `stop`.
            Exception: the node keeps failing outside its callbacks (see MAX_FAILURES_PER_SECOND).
        """
        with signals_call(self.stop), self._watching() as limit, contextlib.ExitStack() as end:
            end.callback(self.leave)
            end.callback(self._shut_down)
            if RosNode.rehearsed is not None:
                RosNode.rehearsed(self)
                return
            while self.spin_once():
                pass
        if self._stood_still is not None:
            raise StoodStill(
                f"{self.name} stood still for {self._stood_still:.1f} s; others may forget a node after "
                f"{limit:g} s, so it ends, to be started again"
            )

    @contextlib.contextmanager
    def _watching(self) -> Iterator[float]:
        """End the spin when the process stood still for more than so many seconds."""

        def end(seconds: float) -> None:
            self._stood_still = seconds
            self.stop()

        # The second one goes on while the computer sleeps. Whoever sleeps with it forgets nobody.
        which = time.CLOCK_MONOTONIC if is_closed() else time.CLOCK_BOOTTIME
        limit = forgotten_after()
        with standstill_calls(end, limit, partial(time.clock_gettime, which)):
            yield limit

    def _shut_down(self) -> None:
        for callback in self._stop_callbacks:
            self.guarded(callback)()
        if self._context.ok():
            if self._vitals is not None:
                self.guarded(self._vitals.end)()
            self.guarded(self._cancel_goals)()
            self.guarded(self._deliver)()

    def _cancel_goals(self) -> None:
        """Cancel the goals of all clients, and wait for the answers; other callbacks are not called."""
        for caller in self._callers:
            caller.close()
        self._executor.answers_only = True
        self.work_until(lambda: all(caller.released for caller in self._callers), CANCEL_LIMIT_S)

    def _deliver(self) -> None:
        """Wait until subscribers have acknowledged the last messages, such as the end of a motion."""
        end = time.monotonic() + DELIVERY_LIMIT_S
        for publisher in self.node.publishers:
            publisher.wait_for_all_acked(Duration(seconds=max(0.0, end - time.monotonic())))

    def spin_once(self, timeout: float | None = None) -> bool:
        """Handle one event, waiting at most `timeout` seconds for it; False when the node is to end."""
        if self._stopping or self._closed:
            return False
        self._work_once(timeout)
        return not self._stopping and bool(self._context.ok())

    def _work_once(self, timeout: float | None) -> None:
        try:
            self._executor.spin_once(timeout)
        except ExternalShutdownException:
            self._stopping = True
        except Exception:
            self.log.exception("rclpy failed outside a callback")
            if self._fails_all_the_time():
                raise

    def _fails_all_the_time(self) -> bool:
        self._failures.append(time.monotonic())
        full = len(self._failures) == MAX_FAILURES_PER_SECOND
        return full and self._failures[-1] - self._failures[0] < 1.0

    def on_stop(self, callback: Callable[[], None]) -> None:
        """Run `callback` when the spin ends, while publishers and services still work."""
        self._stop_callbacks.append(callback)

    def work_until(self, done: Callable[[], bool], seconds: float) -> None:
        """Spin until `done()`, at most for so long: for `on_stop` callbacks that wait for an answer."""
        end = time.monotonic() + seconds
        while not done() and (left := end - time.monotonic()) > 0 and self._context.ok():
            self._work_once(left)

    def stop(self) -> None:
        """End the spin; safe from every thread."""
        self._stopping = True
        self.post(lambda: None)

    def leave(self) -> None:
        """Close, as the last use of ROS in this process: a hanging teardown ends the process."""
        with ends_the_process_after(TEARDOWN_LIMIT_S):
            self.close()

    def __enter__(self) -> RosNode:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release executor, node and context. Closing twice does no harm."""
        if self._closed:
            return
        self._closed = True
        if self._context.ok() and self._vitals is not None:
            self.guarded(self._vitals.end)()
        for host in self._hosts:
            host.close()
        for caller in self._callers:
            caller.release()
        for entity in list(self.node.waitables):
            if isinstance(entity, (ActionServer, ActionClient)):  # rclpy leaves them: a server would serve on
                entity.destroy()
        self.log_book.close()
        self._executor.shutdown()
        self.node.destroy_node()
        self._end_context()

    def _end_context(self) -> None:
        if self._context is not RosNode._shared:
            self._context.try_shutdown()
