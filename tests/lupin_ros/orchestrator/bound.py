"""Bindings for tests of their client, made of text as a file is, and a spray cart to talk to."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from nav2_msgs.action import NavigateToPose
from std_msgs.msg import ColorRGBA, Float32
from std_srvs.srv import Trigger

from lupin_engine.bindings.data import Binding
from lupin_engine.bindings.file import BindingNode
from lupin_engine.bindings.reader import check_definition, read_binding
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.source import parse_bytes
from lupin_engine.chart.validation import validate
from lupin_engine.plugin.registry import build_catalog
from lupin_greenhouse.profile import PROFILE
from lupin_ros.adapter.node import Qos, RosNode, ServedGoal
from lupin_ros.interfaces.definitions import interface_types

SPRAYER = Path(__file__).parents[3] / "docs" / "sprayer"


def binding_of(text: str) -> Binding:
    """Return the binding that a text says, which has no mistake and fits what is installed."""
    findings = Findings()
    raw = parse_bytes(text.encode(), "bound.yaml", findings)
    assert raw is not None
    node = validate(raw, BindingNode, findings)
    assert node is not None, findings.all
    binding = read_binding(node, build_catalog([], [PROFILE]), findings)
    check_definition(binding, interface_types, findings)
    assert findings.errors == ()
    return binding


def sprayer() -> Binding:
    """Return the binding of the documentation."""
    return binding_of((SPRAYER / "bindings" / "sprayer.yaml").read_text(encoding="utf-8"))


class Cart:
    """The spray cart: takes orders, and ends them when a test says so, or by `answer`."""

    def __init__(self, ros: RosNode) -> None:
        self.ros = ros
        self.willing = True
        self.goals: list[ServedGoal] = []
        self.cancelled: list[ServedGoal] = []
        self.lamps: list[tuple[float, float]] = []
        self.rinsed = 0
        self.answer: Callable[[ServedGoal], None] = lambda _: None
        ros.serve_action(
            NavigateToPose,
            "/sprayer/spray",
            admit=lambda _: self.willing,
            started=self._begin,
            cancelled=self._cancel,
        )
        ros.serve(Trigger, "/sprayer/rinse", self._rinse)
        self._tank = ros.publisher(Float32, "/sprayer/tank", Qos.SENSOR)
        self._state = ros.publisher(DiagnosticStatus, "/sprayer/state", Qos.EVENT)
        ros.subscribe(ColorRGBA, "/sprayer/lamp", Qos.LATCHED, lambda m: self.lamps.append((m.r, m.g)))

    def _begin(self, served: ServedGoal) -> None:
        self.goals.append(served)
        self.answer(served)

    def _cancel(self, served: ServedGoal) -> None:
        self.cancelled.append(served)
        served.cancel(NavigateToPose.Result(error_msg="half of it"))

    def _rinse(self, _: Any, response: Any) -> Any:
        self.rinsed += 1
        response.success, response.message = True, "clean"
        return response

    def tank(self, percent: float) -> None:
        """Tell how full the tank is."""
        self._tank.publish(Float32(data=percent))

    def state(self, level: bytes, text: str) -> None:
        """Tell how the cart is."""
        self._state.publish(DiagnosticStatus(level=level, message=text))


def succeed(served: ServedGoal) -> None:
    """Spray at once."""
    served.succeed(NavigateToPose.Result())


def abort(number: int, text: str) -> Callable[[ServedGoal], None]:
    """Return what gives up an order."""
    return lambda served: served.abort(NavigateToPose.Result(error_code=number, error_msg=text))


if __name__ == "__main__":
    Cart(RosNode(sys.argv[1])).ros.spin()
