"""Service calls: each has a deadline, and ends exactly once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rclpy.task import Future

from lupin_ros.adapter.host import Host, TimerHandle
from lupin_ros.adapter.qos import Qos


@dataclass(frozen=True)
class CallFailure:
    """Why a call gave no answer: code `timeout`, `unavailable` or `exception`, and a text."""

    code: str
    detail: str


class ServiceCaller:
    """The client of one service."""

    def __init__(self, ros: Host, kind: Any, name: str) -> None:
        self.ros = ros
        self.name = name
        self.client = ros.node.create_client(kind, name, qos_profile=Qos.SERVICES.profile())
        self._under_way: set[ServiceCall] = set()

    def ready(self) -> bool:
        """Return whether a server is matched; a dead one counts for up to 3 s (the discovery lease)."""
        return bool(self.client.service_is_ready())

    def close(self) -> None:
        """Release the client; no answer follows."""
        for call in list(self._under_way):
            call.cancel()
        self.ros.node.destroy_client(self.client)

    def call(self, request: Any, timeout: float, done: Callable[[Any], None]) -> ServiceCall:
        """Send `request`; `done` gets the response, or a `CallFailure` after `timeout` seconds of real time.

        `done` comes exactly once, on the node's thread and after this method has returned, unless the
        call is cancelled. Without a matched server the call fails at once with `unavailable`.
        """
        call = ServiceCall(self, done)
        self._under_way.add(call)
        failure = None
        try:
            if self.ready():
                call.start(request, timeout)
            else:
                failure = CallFailure("unavailable", f"{self.name}: no server")
        except Exception as error:
            self.ros.log.exception("call failed", service=self.name)
            failure = CallFailure("exception", f"{self.name}: {error}")
        if failure is not None:
            self.ros.post(lambda: call.finish(failure))
        return call

    def forget(self, call: ServiceCall) -> None:
        """Remove a call that is over."""
        self._under_way.discard(call)


class ServiceCall:
    """A pending service call."""

    def __init__(self, caller: ServiceCaller, done: Callable[[Any], None]) -> None:
        self._caller = caller
        self._done = done
        self._over = False
        self._future: Future | None = None
        self._deadline: TimerHandle | None = None

    def cancel(self) -> None:
        """Drop the call: `done` is not called any more. Services have no cancellation: the server goes on."""
        self._over = True
        self._caller.forget(self)
        if self._deadline is not None:
            self._deadline.cancel()
        if self._future is not None:
            self._caller.client.remove_pending_request(self._future)

    def start(self, request: Any, timeout: float) -> None:
        """Send the request and set the deadline (called once, by the caller object)."""
        ros = self._caller.ros
        self._future = self._caller.client.call_async(ros.frames.outgoing(request))
        answered = ros.guarded(lambda future: self.finish(ros.frames.incoming(future.result())))
        self._future.add_done_callback(answered)
        late = CallFailure("timeout", f"{self._caller.name}: no answer within {timeout:g} s")
        self._deadline = ros.steady_timer(timeout, lambda: self.finish(late))

    def finish(self, outcome: Any) -> None:
        """Hand over the answer or the failure, once."""
        if self._over:
            return
        self.cancel()
        self._done(outcome)
