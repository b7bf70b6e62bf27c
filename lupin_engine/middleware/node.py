"""The one adapter over rclpy: every node and every plugin client talks to ROS through a `RosNode`.

Each work-around lives here, in `actions`, in `parameters` or in `peers`, for this reason:

* single-threaded executor: the multi-threaded one drops reliable messages, the events executor deadlocks;
* guarded callbacks: an exception in a callback ends the spin, while the services stay advertised;
* depth 1000 on services: the default queue of 10 over all clients loses requests silently;
* a deadline on every call, then `remove_pending_request`: an answer may never come, the future stays;
* results asked for again (`actions`): rclpy leaves the future pending when a result was lost in an outage;
* requests refused by the middleware's timestamp: those sent during an outage arrive when the link returns;
* own signal handlers: rclpy's shut the context down before anybody can say good-bye;
* `ExternalShutdownException` ends a spin quietly: the context may be shut down from elsewhere;
* the end of the spin closes executor, node and context: a leaking server steals the requests of the next;
* a limit on that: Fast DDS deadlocks in about 1 of 700 ends when several nodes leave at the same moment;
* discovery profile: finding a peer takes up to 2.4 s and noticing its death 20 s with the defaults;
* no second wake-up after each callback: rclpy's costs a third of the processor time of an idle node;
* posting wakes the executor: nothing else makes it look for work of other threads;
* timers run on the monotonic clock (on ROS time with `use_sim_time`): a stepped wall clock moves no deadline;
* types of parameters said, integers taken for doubles (`parameters`): rclpy refuses `60` for a double;
* type hashes compared with the peers' (`peers`): a mismatch is otherwise silent;
* servers counted (`peers`): two of one name are otherwise both obeyed.
"""

from __future__ import annotations

import contextlib
import faulthandler
import os
import signal
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from typing import Any

import rclpy
import structlog
from builtin_interfaces.msg import Time
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.context import Context
from rclpy.exceptions import InvalidHandle, NameValidationException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter
from rclpy.publisher import Publisher
from rclpy.service import Service
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription
from rclpy.task import Future, Task
from structlog.typing import EventDict, FilteringBoundLogger

from lupin_engine.errors import LupinError, UsageError, nearest
from lupin_engine.middleware import parameters as ros_parameters
from lupin_engine.middleware.actions import ActionCaller, ActionHost, Goal, ServedGoal
from lupin_engine.middleware.peers import (
    action_channels,
    peer_mismatches,
    rival_servers,
    service_channels,
)
from lupin_engine.middleware.qos import Qos
from lupin_engine.plugin.contract import Parameter

__all__ = [
    "ActionCaller",
    "ActionHost",
    "Call",
    "Failure",
    "Goal",
    "Qos",
    "RosNode",
    "ServedGoal",
    "ServiceCaller",
    "Timer",
    "guarded",
    "peer_mismatches",
]

#: Seconds after the start, and between, two looks at the peers.
FIRST_PEER_CHECK = 1.0
PEER_CHECK_PERIOD = 5.0

#: Parameters by name.
Declared = Mapping[str, Parameter]

#: This many exceptions outside callbacks within one second are a broken node, not a bad message.
MAX_FAILURES_PER_SECOND = 20

#: Seconds that releasing a node at the end of its spin may take before the process is ended by force.
TEARDOWN_LIMIT = 3.0

#: The file descriptor, because `sys.stderr` may be anything by then.
_STDERR = 2

#: Parameters that ROS itself reads from the command line.
_ROS_OWN_PARAMETERS = ("use_sim_time", "start_type_description_service")


@dataclass(frozen=True)
class Failure:
    """Why a call gave no answer: code `timeout`, `unavailable` or `exception`, and a text."""

    code: str
    detail: str


class Timer:
    """A running timer of the node; ends with `cancel`."""

    def __init__(self, node: Node, period: float, callback: Callable[[], None], clock: Clock) -> None:
        self._node = node
        self._timer = node.create_timer(period, callback, clock=clock)

    def cancel(self) -> None:
        """End the timer; its callback is not called any more. Cancelling twice does no harm."""
        timer, self._timer = self._timer, None
        if timer is not None:
            self._node.destroy_timer(timer)


class Call:
    """A service call under way."""

    def __init__(self, caller: ServiceCaller, done: Callable[[Any], None]) -> None:
        self._caller = caller
        self._done = done
        self._over = False
        self._future: Future | None = None
        self._deadline: Timer | None = None

    def cancel(self) -> None:
        """Lose interest: `done` is not called any more. The server is not told, services cannot be."""
        self._over = True
        if self._deadline is not None:
            self._deadline.cancel()
        if self._future is not None:
            self._caller.client.remove_pending_request(self._future)

    def start(self, request: Any, timeout: float) -> None:
        """Send the request and set the deadline (called once, by the caller object)."""
        ros = self._caller.ros
        self._future = self._caller.client.call_async(request)
        self._future.add_done_callback(ros.guarded(lambda future: self.finish(future.result())))
        late = Failure("timeout", f"{self._caller.name}: no answer within {timeout:g} s")
        self._deadline = ros.steady_timer(timeout, lambda: self.finish(late))

    def finish(self, outcome: Any) -> None:
        """Hand over the answer or the failure, once."""
        if self._over:
            return
        self.cancel()
        self._done(outcome)


class ServiceCaller:
    """The client of one service."""

    def __init__(self, ros: RosNode, kind: Any, name: str) -> None:
        self.ros = ros
        self.name = name
        self.client = ros.node.create_client(kind, name, qos_profile=Qos.SERVICES.profile())

    def ready(self) -> bool:
        """Say whether a server is matched; a dead one counts for up to 3 s (the discovery lease)."""
        return bool(self.client.service_is_ready())

    def close(self) -> None:
        """Let go of the service; no answer follows."""
        self.ros.node.destroy_client(self.client)

    def call(self, request: Any, timeout: float, done: Callable[[Any], None]) -> Call:
        """Send `request`; `done` gets the response, or a `Failure` after `timeout` seconds of real time.

        `done` comes exactly once, on the node's thread and after this method has returned, unless the
        call is cancelled. Without a matched server the call fails at once with `unavailable`.
        """
        call = Call(self, done)
        failure = None
        try:
            if self.ready():
                call.start(request, timeout)
            else:
                failure = Failure("unavailable", f"{self.name}: no server")
        except Exception as error:
            self.ros.log.exception("call failed", service=self.name)
            failure = Failure("exception", f"{self.name}: {error}")
        if failure is not None:
            self.ros.post(lambda: call.finish(failure))
        return call


class RosNode:
    """A node with its own context and executor, all ROS arguments honoured.

    Everything is called on the thread that spins, except `post` and `stop`. Parameters are declared with
    type, range and documentation; values given on the command line are checked before anything else.
    Where they depend on what is given (a mission brings its own), `parameters` is a function of that.

    Raises:
        UsageError: ROS cannot read the arguments.
        LupinError: a parameter has a value that it may not have.
    """

    def __init__(
        self,
        name: str,
        arguments: Sequence[str] = (),
        parameters: Declared | Callable[[Mapping[str, Any]], Declared] = MappingProxyType({}),
    ) -> None:
        _use_discovery_profile()
        self._context = Context()
        self._closed = False
        self._stopping = False
        self._said = _parameters_said(arguments)
        self.node = self._make_node(name, arguments)
        try:
            self._start(parameters)
        except BaseException:
            self.close()
            raise

    def _make_node(self, name: str, arguments: Sequence[str]) -> Node:
        try:
            rclpy.init(
                args=list(arguments),
                context=self._context,
                signal_handler_options=SignalHandlerOptions.NO,
            )
            return Node(name, context=self._context)
        except (RuntimeError, ValueError, NameValidationException) as error:
            # rcl has half a dozen exceptions for bad arguments and names, all derived from these.
            self._context.try_shutdown()
            reason = str(error).split(", at /")[0]  # the rest is places in rcl's sources
            raise UsageError(f"ROS does not start with the arguments {list(arguments)}: {reason}") from error

    def _start(self, parameters: Declared | Callable[[Mapping[str, Any]], Declared]) -> None:
        self.name: str = self.node.get_name()
        self.log = _ros_log(self.node)
        self._executor = _Executor(self._context, self.log)
        self._executor.add_node(self.node)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._posted: deque[Callable[[], object]] = deque()
        self._wakeup = self.node.create_guard_condition(self._run_posted)
        self._stop_callbacks: list[Callable[[], None]] = []
        self._closables: list[ActionCaller | ActionHost] = []
        self._channels: dict[str, None] = {}
        self._failures: deque[float] = deque(maxlen=MAX_FAILURES_PER_SECOND)
        self._told_findings: frozenset[str] = frozenset()
        self._seen_rivals: frozenset[str] = frozenset()
        self._specs = dict(parameters(self._given()) if callable(parameters) else parameters)
        self._parameter_callbacks: list[Callable[[Mapping[str, Any]], str | None]] = []
        self._declare_parameters()
        self._one_shot(FIRST_PEER_CHECK, self._check_peers, self._steady)
        self.steady_timer(PEER_CHECK_PERIOD, self._check_peers)

    # --- parameters -------------------------------------------------------------------------------------

    def parameters(self) -> dict[str, Any]:
        """Return the current values of the declared parameters as plain data in base units."""
        return {
            name: ros_parameters.read(name, spec, self.node.get_parameter_or(name).value)
            for name, spec in self._specs.items()
        }

    def on_parameter(self, callback: Callable[[Mapping[str, Any]], str | None]) -> None:
        """Allow changes at run time: `callback` gets the new values (checked, base units) by name.

        It returns None to take them or a text that says why not. Without any callback every change is
        refused, because a value that is only read at the start would seem to have been set.
        """
        self._parameter_callbacks.append(callback)

    def set_parameter(self, name: str, value: Any) -> None:
        """Correct a declared parameter from inside the node; the `on_parameter` callbacks hear of it."""
        self.node.set_parameters([ros_parameters.to_ros(name, self._specs[name], value)])

    def starting_values(self, specs: Declared) -> dict[str, Any]:
        """Return what parameters would be if the node was started with them; nothing changes.

        Raises:
            LupinError: a value was given that one of them may not have, or ROS has no such type.
        """
        for name, spec in specs.items():
            ros_parameters.ros_type(name, spec.type)
        return ros_parameters.starting_values(specs, self._given())

    def declare_anew(self, specs: Declared) -> None:
        """Have exactly these parameters: new and changed ones as at a start, the others as they are."""
        values = self.starting_values(specs)
        kept = {name for name, spec in self._specs.items() if specs.get(name) == spec}
        for name in set(self._specs) - kept:
            self.node.undeclare_parameter(name)
        # What is set here was checked just now, and is no change of what somebody reads.
        self.node.remove_on_set_parameters_callback(self._on_set)
        self._specs = dict(specs)
        for name in specs:
            if name not in kept:
                self._declare_parameter(name, specs[name], values[name])
        self.node.add_on_set_parameters_callback(self._on_set)

    def _declare_parameters(self) -> None:
        given = self._given()
        self._tell_unknown(name for name in given if name not in self._specs and not self._is_ros_own(name))
        values = self.starting_values(self._specs)
        for name, spec in self._specs.items():
            self._declare_parameter(name, spec, values[name])
        self.node.add_pre_set_parameters_callback(self._before_set)
        self.node.add_on_set_parameters_callback(self._on_set)

    def _declare_parameter(self, name: str, spec: Parameter, value: Any) -> None:
        kind = ros_parameters.ros_type(name, spec.type)
        # Declared without the override, which may be an integer for a double, and then set.
        self.node.declare_parameter(name, kind, ros_parameters.descriptor(spec), ignore_override=True)
        given = ros_parameters.to_ros(name, spec, value)
        if given.type_ != RosParameter.Type.NOT_SET:
            self.node.set_parameters([given])

    def _tell_unknown(self, names: Iterable[str]) -> None:
        """Refuse unknown names of `-p`; one that a parameter file has may be meant for other nodes."""
        problems = []
        for name in names:
            problem = f"parameter {name!r} is not known to this node; {nearest(name, self._specs)}"
            if name in self._said:
                problems.append(problem)
            else:
                self.log.warning(problem)
        if problems:
            raise LupinError("\n".join(problems))

    def _given(self) -> dict[str, Any]:
        return {name: override.value for name, override in self.node._parameter_overrides.items()}

    def _is_ros_own(self, name: str) -> bool:
        own = name in _ROS_OWN_PARAMETERS or name.startswith("qos_overrides.")
        return own or bool(self.node.has_parameter(name))

    def _before_set(self, changes: list[RosParameter]) -> list[RosParameter]:
        return [self._retyped(change) for change in changes]

    def _retyped(self, change: RosParameter) -> RosParameter:
        """Return an integer given for a double as a double; what cannot be read stays as it is."""
        spec = self._specs.get(change.name)
        if spec is None:
            return change
        try:
            value = ros_parameters.read(change.name, spec, change.value)
        except (ValueError, TypeError):
            return change  # refused later, with the reason
        return ros_parameters.to_ros(change.name, spec, value)

    def _on_set(self, changes: list[RosParameter]) -> SetParametersResult:
        mine = [change for change in changes if change.name in self._specs]
        reason = self._refusal(mine) if mine else None
        return SetParametersResult(successful=reason is None, reason=reason or "")

    def _refusal(self, changes: list[RosParameter]) -> str | None:
        names = ", ".join(change.name for change in changes)
        if not self._parameter_callbacks:
            return f"{names}: read at the start of the node only; restart it with -p"
        try:
            values = {c.name: ros_parameters.read(c.name, self._specs[c.name], c.value) for c in changes}
            for callback in self._parameter_callbacks:
                reason = callback(values)
                if reason is not None:
                    return reason
        except ValueError as error:
            return str(error)
        except Exception as error:
            self.log.exception("setting parameters failed", names=names)
            return f"{names}: {error}"
        return None

    # --- time -------------------------------------------------------------------------------------------

    def now(self) -> float:
        """Return the time of the node's clock in seconds (wall clock, or ROS time with `use_sim_time`)."""
        return float(self.node.get_clock().now().nanoseconds) * 1e-9

    def stamp(self) -> Time:
        """Return the time of the node's clock as a message."""
        return self.node.get_clock().now().to_msg()

    def elapsed(self) -> float:
        """Return seconds on the clock of the timers: for durations, not to be shown or sent."""
        return float(self._timer_clock().now().nanoseconds) * 1e-9

    def timer(self, period: float, callback: Callable[[], None]) -> Timer:
        """Call `callback` every `period` seconds (of ROS time with `use_sim_time`, else of real time)."""
        return Timer(self.node, period, self.guarded(callback), self._timer_clock())

    def call_later(self, delay: float, callback: Callable[[], None]) -> Timer:
        """Call `callback` once after `delay` seconds (of ROS time with `use_sim_time`, else real time)."""
        return self._one_shot(delay, callback, self._timer_clock())

    def steady_timer(self, period: float, callback: Callable[[], None]) -> Timer:
        """Call `callback` every `period` seconds of real time, also when simulated time stands still."""
        return Timer(self.node, period, self.guarded(callback), self._steady)

    def _one_shot(self, delay: float, callback: Callable[[], None], clock: Clock) -> Timer:
        def fire() -> None:
            timer.cancel()
            callback()

        timer = Timer(self.node, max(0.0, delay), self.guarded(fire), clock)
        return timer

    def _timer_clock(self) -> Clock:
        # The ROS clock without simulated time is the wall clock, and that one is stepped now and then.
        clock = self.node.get_clock()
        return clock if clock.ros_time_is_active else self._steady

    # --- topics, services, actions ----------------------------------------------------------------------

    def publisher(self, kind: Any, topic: str, qos: Qos) -> Publisher:
        """Return an object whose `publish(message)` sends to `topic`."""
        publisher = self.node.create_publisher(kind, topic, qos.profile())
        self._watch_channels([f"rt{publisher.topic_name}"])
        return publisher

    def subscribe(self, kind: Any, topic: str, qos: Qos, callback: Callable[[Any], None]) -> Subscription:
        """Call `callback` with every message of `topic`, until the node's `destroy_subscription`."""
        subscription = self.node.create_subscription(kind, topic, self.guarded(callback), qos.profile())
        self._watch_channels([f"rt{subscription.topic_name}"])
        return subscription

    def serve(
        self,
        kind: Any,
        name: str,
        callback: Callable[[Any, Any], Any],
        *,
        stale_after: float | None = None,
        refuse: Callable[[Any, str], Any] | None = None,
    ) -> None:
        """Answer requests with `callback(request, response)`, which returns the response.

        A request that was sent more than `stale_after` seconds ago is not carried out: its caller has
        given up. It is answered with `refuse(response, reason)`, in case the caller waits all the same and
        only the hosts' wall clocks disagree; without `refuse` not at all. When the callback fails nothing
        is answered, because an empty response may mean success; the caller's deadline tells it.
        """
        service = self.node.create_service(
            kind, name, self.guarded(callback), qos_profile=Qos.SERVICES.profile()
        )
        self._executor.serve(service, stale_after, refuse)
        self._watch_channels(service_channels(service.service_name))

    def serve_later(
        self,
        kind: Any,
        name: str,
        callback: Callable[[Any, Any, Callable[[Any], None]], None],
        *,
        stale_after: float | None = None,
        refuse: Callable[[Any, str], Any] | None = None,
    ) -> None:
        """Answer requests whenever it suits: `callback(request, response, answer)`, then `answer(response)`.

        For answers that depend on others. `answer` is called once, now or later; see `serve` for the rest.
        """
        service = self.node.create_service(
            kind, name, self.guarded(callback), qos_profile=Qos.SERVICES.profile()
        )
        self._executor.serve(service, stale_after, refuse, later=True)
        self._watch_channels(service_channels(service.service_name))

    def service(self, kind: Any, name: str) -> ServiceCaller:
        """Return a client of the service `name`."""
        self._watch_channels(service_channels(self.node.resolve_service_name(name)))
        return ServiceCaller(self, kind, name)

    def action(self, kind: Any, name: str) -> ActionCaller:
        """Return a client of the action `name`."""
        self._watch_channels(action_channels(self.node.resolve_topic_name(name)))
        caller = ActionCaller(self, kind, name)
        self._closables.append(caller)
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
        self._watch_channels(action_channels(self.node.resolve_topic_name(name)))
        host = ActionHost(self, kind, name, admit=admit, started=started, cancelled=cancelled)
        self._closables.append(host)
        return host

    def channels(self) -> list[str]:
        """Return the DDS topics that this node uses (see `peers`)."""
        return list(self._channels)

    def _watch_channels(self, channels: Sequence[str]) -> None:
        self._channels.update(dict.fromkeys(channels))

    def _check_peers(self) -> None:
        rivals = frozenset(rival_servers(self))
        found = frozenset(peer_mismatches(self)) | (rivals & self._seen_rivals)
        for finding in sorted(found - self._told_findings):
            self.log.error(finding)
        self._told_findings, self._seen_rivals = found, rivals

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
        """Work until SIGINT, SIGTERM or `stop`, then run the `on_stop` callbacks and close the node.

        Returns cleanly in all these cases.

        Raises:
            Exception: the node keeps failing outside its callbacks (see MAX_FAILURES_PER_SECOND).
        """
        with _signals_call(self.stop):
            try:
                while self.spin_once():
                    pass
                for callback in self._stop_callbacks:
                    self.guarded(callback)()
            finally:
                self.leave()

    def spin_once(self, timeout: float | None = None) -> bool:
        """Do one piece of work, waiting at most `timeout` seconds for it; False when it is time to end."""
        if self._stopping or self._closed:
            return False
        try:
            self._executor.spin_once(timeout)
        except ExternalShutdownException:
            self._stopping = True
        except Exception:
            self.log.exception("rclpy failed outside a callback")
            if self._fails_all_the_time():
                raise
        return not self._stopping and bool(self._context.ok())

    def _fails_all_the_time(self) -> bool:
        self._failures.append(time.monotonic())
        full = len(self._failures) == MAX_FAILURES_PER_SECOND
        return full and self._failures[-1] - self._failures[0] < 1.0

    def on_stop(self, callback: Callable[[], None]) -> None:
        """Run `callback` when the spin ends, while publishers and services still work."""
        self._stop_callbacks.append(callback)

    def work_until(self, done: Callable[[], bool], seconds: float) -> None:
        """Work on until `done()`, at most for so long: for `on_stop` callbacks that wait for an answer."""
        end = time.monotonic() + seconds
        while not done() and time.monotonic() < end and self._context.ok():
            self._executor.spin_once(end - time.monotonic())

    def stop(self) -> None:
        """End the spin; safe from every thread."""
        self._stopping = True
        self.post(lambda: None)

    def leave(self) -> None:
        """Close, as the last thing that this process does with ROS: a hanging teardown ends the process."""
        with _ends_the_process_after(TEARDOWN_LIMIT):
            self.close()

    def close(self) -> None:
        """Release executor, node and context. Closing twice does no harm."""
        if self._closed:
            return
        self._closed = True
        for closable in getattr(self, "_closables", ()):
            closable.close()
        if hasattr(self, "_executor"):
            self._executor.shutdown()
        self.node.destroy_node()
        self._context.try_shutdown()


@dataclass(frozen=True)
class _Serving:
    """How a service's requests are taken: see `RosNode.serve` and `RosNode.serve_later`."""

    stale_after: float | None
    refuse: Callable[[Any, str], Any] | None
    later: bool


def _send_response(service: Service, header: Any, response: Any) -> None:
    """Send an answer, unless the node has been closed since it was asked."""
    with contextlib.suppress(InvalidHandle):
        service.send_response(response, header)


class _Executor(SingleThreadedExecutor):
    """rclpy's executor, with a look at a request's age before it is carried out, and cheaper.

    The callback of a service does not get the header that holds the timestamp, so the taking of the
    request is the one place to look.
    """

    def __init__(self, context: Context, log: FilteringBoundLogger) -> None:
        super().__init__(context=context)
        self._log = log
        self._served: dict[Service, _Serving] = {}

    def serve(
        self,
        service: Service,
        stale_after: float | None,
        refuse: Callable[[Any, str], Any] | None = None,
        later: bool = False,
    ) -> None:
        """Take the requests of `service` here, refusing those older than `stale_after` seconds."""
        self._served[service] = _Serving(stale_after, refuse, later)

    def _make_handler(self, entity: Any, node: Node, take_from_wait_list: Callable[[Any], Any]) -> Task:
        """Do what rclpy does for one ready entity, but do not wake this thread afterwards.

        rclpy triggers its guard condition for the sake of other threads, of which there are none here; each
        piece of work then costs a second round through the wait set, 30 % of all processor time. Callbacks
        must be plain functions: nothing would take up a suspended one that has ended.
        """
        entity._executor_event = True

        async def handler() -> None:
            if self._is_shutdown or not entity.callback_group.beginning_execution(entity):
                entity._executor_event = False
                return
            with self._work_tracker:
                callback = take_from_wait_list(entity)
                entity._executor_event = False
                try:
                    if callback is not None:
                        await callback()
                finally:
                    entity.callback_group.ending_execution(entity)

        task = Task(handler, (), executor=self)
        with self._tasks_lock:
            self._tasks.append((task, entity, node))
        return task

    def _take_service(self, srv: Service) -> Any:
        if srv not in self._served:  # rclpy's own parameter services
            return super()._take_service(srv)
        try:
            with srv.handle:
                request, header = srv.handle.service_take_request(srv.srv_type.Request)
        except InvalidHandle:
            return None
        if header is None:
            return None
        reason = self._staleness(srv, header)

        async def answer() -> None:
            response = srv.srv_type.Response()
            if reason is not None:
                response = self._refused(srv, reason)
            elif self._served[srv].later:
                srv.callback(request, response, partial(_send_response, srv, header))
                return
            else:
                response = srv.callback(request, response)
            if response is not None:
                srv.send_response(response, header)

        return answer

    def _staleness(self, srv: Service, header: Any) -> str | None:
        """Say why a request is too old to be carried out; None when it is not."""
        stale_after = self._served[srv].stale_after
        if stale_after is None or header.source_timestamp <= 0:
            return None
        age = (time.time_ns() - header.source_timestamp) * 1e-9
        if age <= stale_after:
            return None
        self._log.warning(
            "request refused: it is stale", service=srv.srv_name, age=round(age, 3), allowed=stale_after
        )
        return f"refused: the request is {age:.1f} s old, or the clocks of the two computers disagree"

    def _refused(self, srv: Service, reason: str) -> Any:
        refuse = self._served[srv].refuse
        return None if refuse is None else refuse(srv.srv_type.Response(), reason)


def guarded(callback: Callable[..., Any], log: FilteringBoundLogger) -> Callable[..., Any]:
    """Return `callback` with its exceptions logged with a traceback; they never leave the spin."""

    def guard(*arguments: Any) -> Any:
        try:
            return callback(*arguments)
        except Exception:
            log.exception("callback failed", callback=getattr(callback, "__qualname__", repr(callback)))
            return None

    return guard


def _parameters_said(arguments: Sequence[str]) -> frozenset[str]:
    """Return the names of the parameters given by `-p [NODE:]NAME:=VALUE`."""
    rules = [rule for flag, rule in pairwise(arguments) if flag in ("-p", "--param")]
    return frozenset(rule.partition(":=")[0].rpartition(":")[2] for rule in rules)


def _use_discovery_profile() -> None:
    """Name our discovery profile to the middleware, unless the user has named one."""
    if not any(os.environ.get(f"{prefix}_DEFAULT_PROFILES_FILE") for prefix in ("FASTRTPS", "FASTDDS")):
        profile = Path(__file__).with_name("discovery.xml")
        os.environ["FASTRTPS_DEFAULT_PROFILES_FILE"] = str(profile)


@contextlib.contextmanager
def _signals_call(stop: Callable[[], None]) -> Iterator[None]:
    """Let SIGINT and SIGTERM call `stop`, at once and on another thread.

    A Python signal handler runs only when the main thread executes Python, and that thread waits inside
    the middleware. So the bytes that Python writes for each signal are read by a small thread. Outside the
    main thread signals are somebody else's.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    reader, writer = socket.socketpair()
    writer.setblocking(False)
    handled = (signal.SIGINT, signal.SIGTERM)

    def watch() -> None:
        while received := reader.recv(64):
            if any(number in handled for number in received):
                stop()

    watcher = threading.Thread(target=watch, name="signals", daemon=True)
    before = {number: signal.signal(number, lambda *_: None) for number in handled}
    old_descriptor = signal.set_wakeup_fd(writer.fileno(), warn_on_full_buffer=False)
    watcher.start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(old_descriptor)
        for number, handler in before.items():
            signal.signal(number, handler)
        writer.close()
        watcher.join()
        reader.close()


@contextlib.contextmanager
def _ends_the_process_after(seconds: float) -> Iterator[None]:
    """End the process with code 1 and a traceback when the body hangs for so long.

    The deadlock in Fast DDS holds Python's lock, so no Python code could do it: not a thread, not a signal
    handler. `faulthandler` watches from a thread of its own that needs no Python.
    """
    faulthandler.dump_traceback_later(seconds, exit=True, file=_STDERR)
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()


def _ros_log(node: Node) -> FilteringBoundLogger:
    """Return a structlog logger that writes to the node's logger: console, log file and /rosout."""
    logger: FilteringBoundLogger = structlog.wrap_logger(
        _RosSink(node.get_logger()),
        processors=[structlog.processors.format_exc_info, _as_line],
        wrapper_class=structlog.make_filtering_bound_logger(0),
    )
    return logger


def _as_line(_: Any, __: str, event: EventDict) -> str:
    text = str(event.pop("event", ""))
    traceback = event.pop("exception", None)
    details = " ".join(f"{key}={value!r}" for key, value in event.items())
    line = f"{text} ({details})" if details else text
    return f"{line}\n{traceback}" if traceback else line


class _RosSink:
    """The methods that structlog calls.

    Each severity is logged from a line of its own: rclpy refuses another severity at the same place.
    """

    def __init__(self, logger: Any) -> None:
        self._logger = logger

    def debug(self, line: str) -> None:
        self._logger.debug(line)

    def info(self, line: str) -> None:
        self._logger.info(line)

    def warning(self, line: str) -> None:
        self._logger.warning(line)

    def error(self, line: str) -> None:
        self._logger.error(line)

    def critical(self, line: str) -> None:
        self._logger.fatal(line)
