"""A managed node (ROS 2 lifecycle) over `rclpy.lifecycle`, which works in every state and serves in `active`.

Publications, subscriptions, stops and watchdogs go on in every state; outside `active` requests are refused
(see `RosNode.serve`). rclpy answers nothing to a transition that the state does not have, and its `shutdown`
cannot be refused: both are decided before rclpy is asked.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from lifecycle_msgs.msg import Transition
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.context import Context
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn

from lupin_engine.errors import shortened
from lupin_engine.plugin import Code

#: The parameter by which a node is left to a lifecycle manager; nodes of Nav2 have it as well.
AUTOSTART = "autostart_node"
#: What is reported of a node that is not active.
NOT_ACTIVE = Code(
    "inactive", "not active", advice="Configure and activate the node by its lifecycle services."
)
_AUTOSTART_DOC = "whether the node configures and activates itself; false: a lifecycle manager does"
#: The transitions that leave `active`, by number and by name.
_LEAVING = (Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_ACTIVE_SHUTDOWN, "deactivate", "shutdown")


class ManagedNode(LifecycleNode):
    """A node with the lifecycle services; it is unconfigured until `autostart` or a manager changes that."""

    def __init__(self, name: str, context: Context, namespace: str | None = None) -> None:
        self._label = "unconfigured"
        #: Returns why the node may not leave `active` now; '' where it may.
        self.hindrance: Callable[[], str] = str
        #: Called after each change of the state, with whether it was `active`; and with why one was refused.
        self.changed: Callable[[bool], object] = bool
        self.refused: Callable[[str], object] = str
        super().__init__(name, context=context, namespace=namespace)
        described = ParameterDescriptor(description=_AUTOSTART_DOC, read_only=True)
        self._is_autostarted = bool(self.declare_parameter(AUTOSTART, True, described).value)
        for service in self.services:
            if service.srv_name.endswith("/change_state"):
                service.callback = partial(self._change, service.callback)

    @property
    def inactive(self) -> str:
        """Why requests are refused; '' while the node is active."""
        return "" if self._label == "active" else f"{self.get_name()} is {self._label}: activate it first"

    def autostart(self) -> None:
        """Configure and activate the node, unless its parameter leaves that to a lifecycle manager."""
        if self._is_autostarted:
            self.trigger_configure()
            self.trigger_activate()

    def _change(self, change: Callable[[Any, Any], Any], request: Any, response: Any) -> Any:
        """Carry out a transition, or say why not: the response has no text."""
        asked = request.transition.label or request.transition.id
        why = self.hindrance() if asked in _LEAVING and not self.inactive else ""
        if not why:
            why = f"{self._label} has no such transition"
            try:
                change(request, response)
            except RuntimeError:  # RCLError; nothing has changed
                response.success = False
        if not response.success:
            self.refused(f"lifecycle: transition {shortened(str(asked))} refused: {why}")
        return response

    def _reached(self, label: str) -> TransitionCallbackReturn:
        was_active, self._label = self._label == "active", label
        self.changed(was_active)
        return TransitionCallbackReturn.SUCCESS

    def on_configure(self, state: Any) -> TransitionCallbackReturn:
        """Reach `inactive`."""
        return self._reached("inactive")

    def on_activate(self, state: Any) -> TransitionCallbackReturn:
        """Reach `active`."""
        return self._reached("active")

    def on_deactivate(self, state: Any) -> TransitionCallbackReturn:
        """Reach `inactive`."""
        return self._reached("inactive")

    def on_cleanup(self, state: Any) -> TransitionCallbackReturn:
        """Reach `unconfigured`."""
        return self._reached("unconfigured")

    def on_shutdown(self, state: Any) -> TransitionCallbackReturn:
        """Reach `finalized`."""
        return self._reached("finalized")

    def destroy_node(self) -> None:
        """Release the node and its state machine, whose services would stay until it is collected."""
        super().destroy_node()
        self._state_machine.destroy_when_not_in_use()
