"""`/lupin/arm/set_torque`: the servos on or off, answered when that is confirmed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from std_srvs.srv import SetBool

from lupin_arm.node.arm import Arm
from lupin_arm.node.refused import Refused
from lupin_arm.node.serving import STALE_AFTER_S, refuse
from lupin_engine.ros.adapter.node import RosNode

#: The name under which operators switch the servos.
OWNER = "operator"

#: Requests that may wait for their answer; each may take seconds, and nobody wants the hundredth any more.
#: Who switches the servos for something of his own has the arm for himself, asks once, and is not counted.
MOST_WAITING = 8


def serve(ros: RosNode, arm: Arm) -> None:
    """Offer the service."""
    waiting = 0

    def switch(request: SetBool.Request, response: Any, answer: Callable[[Any], None]) -> None:
        nonlocal waiting
        on = bool(request.data)

        def tell(problem: str | None) -> None:
            response.success = problem is None
            response.message = problem or f"the servos are {'on' if on else 'off: support the arm'}"
            answer(response)

        def done(problem: str | None) -> None:
            nonlocal waiting
            waiting -= 1
            tell(problem)

        if waiting >= MOST_WAITING:
            tell(f"{waiting} torque requests wait already; try again when they are answered")
            return
        waiting += 1
        try:
            arm.set_torque(on, OWNER, done)
        except Refused as reason:
            done(str(reason))

    ros.serve_later(SetBool, "/lupin/arm/set_torque", switch, stale_after=STALE_AFTER_S, refuse=refuse)
