"""The operator's panel of today, as the robot sees it: what its web page does, through its websocket gateway.

It shares nothing with what it talks to but the message packages: names, types and rules are written here once
more, by hand, as the page has them. The gateway is one ROS node for all pages. It derives the quality of service
of a subscription from the publishers that it knows at that moment, keeps what it publishes for a second,
and hands everything over as JSON, in which a number that is none is null.
"""

from __future__ import annotations

import importlib
import math
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import rclpy
from rclpy.client import Client
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

Json = dict[str, Any]

#: Seconds that anything may take on a busy machine.
PATIENCE = 60.0
#: Seconds between two words about the software stop, and most links between the map and the robot.
STOP_PERIOD_S = 0.5
MOST_LINKS = 32
#: Topics and services with which the page says stop.
STOP_TOPIC = "/lupin/hmi/estop"
CANCEL_DRIVES = "/navigate_to_pose/_action/cancel_goal"

ACTIVE = {"PREPARE", "EXPLORING", "INSPECTING", "MONITORING", "RETURNING"}


class Heard(NamedTuple):
    """A message, and when it came by the clock of this process."""

    at: float
    message: Any


class Panel:
    """A page that was just loaded: its software stop is engaged. Closed with `close`."""

    def __init__(self, domain: int, name: str = "rosbridge_websocket") -> None:
        self._context = Context()
        no_signals = SignalHandlerOptions.NO
        rclpy.init(args=[], context=self._context, domain_id=domain, signal_handler_options=no_signals)
        self.node = Node(name, context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._heard: dict[str, deque[Heard]] = {}
        self._publishers: dict[str, Publisher] = {}
        self._clients: dict[str, Client] = {}
        self.stopped = True
        self.node.create_timer(STOP_PERIOD_S, self._tell_stop)
        self._tell_stop()

    def close(self) -> None:
        """Leave; the stop is engaged when a page is left, but nobody is told any more."""
        self._executor.shutdown()
        self.node.destroy_node()
        self._context.try_shutdown()

    def until(self, condition: Callable[[], Any], what: str, limit: float = PATIENCE) -> None:
        """Work until something holds; fail with `what` after `limit` seconds."""
        end = time.monotonic() + limit
        while not condition():
            assert time.monotonic() < end, f"not within {limit:g} s: {what}"
            self._executor.spin_once(0.05)

    # --- topics -------------------------------------------------------------------------------------------

    def knows(self, topics: Iterable[str]) -> None:
        """Wait until all these topics have a publisher that the gateway knows."""
        self.until(lambda: all(map(self.node.get_publishers_info_by_topic, topics)), f"publishers of {topics}")

    def subscribe(self, topic: str, kind: str, hears_latched: bool = True) -> None:
        """Listen to a topic as the gateway does, or, as if it did not know its publishers yet, never latched."""
        heard = self._heard[topic] = deque(maxlen=5000)
        qos = self._derived(topic) if hears_latched else _gateway_qos()

        def keep(message: Any) -> None:
            heard.append(Heard(time.monotonic(), message))

        self.node.create_subscription(_class(kind, "msg"), topic, keep, qos)

    def _derived(self, topic: str) -> QoSProfile:
        qos = _gateway_qos()
        offered = [info.qos_profile for info in self.node.get_publishers_info_by_topic(topic)]
        if any(profile.durability is DurabilityPolicy.TRANSIENT_LOCAL for profile in offered):
            qos.durability = DurabilityPolicy.TRANSIENT_LOCAL
        if any(profile.reliability is ReliabilityPolicy.BEST_EFFORT for profile in offered):
            qos.reliability = ReliabilityPolicy.BEST_EFFORT
        return qos

    def count(self, topic: str) -> int:
        """Return how many messages have come."""
        return len(self._heard[topic])

    def arrivals(self, topic: str) -> list[float]:
        """Return when messages came."""
        return [heard.at for heard in self._heard[topic]]

    def all(self, topic: str) -> list[Json]:
        """Return what was heard of a topic, oldest first."""
        return [as_json(heard.message) for heard in self._heard[topic]]

    def last(self, topic: str) -> Json:
        """Return what was heard last of a topic; waits for it if there is nothing yet."""
        self.until(lambda: self._heard[topic], f"a message of {topic}")
        found: Json = as_json(self._heard[topic][-1].message)
        return found

    def publish(self, topic: str, kind: str, message: Mapping[str, Any]) -> None:
        """Send a message; for a second it also reaches who comes late."""
        if topic not in self._publishers:
            durability = DurabilityPolicy.TRANSIENT_LOCAL
            qos = QoSProfile(depth=100, durability=durability, lifespan=Duration(seconds=1))
            self._publishers[topic] = self.node.create_publisher(_class(kind, "msg"), topic, qos)
        self._publishers[topic].publish(_filled(_class(kind, "msg")(), message))

    # --- services -----------------------------------------------------------------------------------------

    def call(self, name: str, kind: str, **request: Any) -> Json:
        """Return a service's answer."""
        future = self.call_later(name, kind, **request)
        self.until(future.done, f"an answer of {name}")
        found: Json = as_json(future.result())
        return found

    def call_later(self, name: str, kind: str, **request: Any) -> Future[Any]:
        """Send a request whose answer nobody waits for now."""
        service = _class(kind, "srv")
        if name not in self._clients:
            self._clients[name] = self.node.create_client(service, name)
        client = self._clients[name]
        self.until(client.service_is_ready, f"service {name}")
        return client.call_async(_filled(service.Request(), request))

    # --- the software stop --------------------------------------------------------------------------------

    def stop(self) -> None:
        """Press STOP: everybody is told, and every drive of the navigation is cancelled."""
        self.stopped = True
        self._tell_stop()
        self.call_later(CANCEL_DRIVES, "action_msgs/CancelGoal")  # a goal of zeros means all of them

    def reset(self) -> None:
        """Press Reset, which alone ends the stop."""
        self.stopped = False
        self._tell_stop()

    def _tell_stop(self) -> None:
        self.publish(STOP_TOPIC, "std_msgs/Bool", {"data": self.stopped})

    # --- what the page shows ------------------------------------------------------------------------------

    @property
    def state(self) -> Json:
        """What the mission does."""
        return self.last("/mission/state")

    def buttons(self) -> set[str]:
        """Return the buttons of the mission that are enabled."""
        state = self.state
        lifecycle, paused, stopped = state["lifecycle_state"], state["paused"], state["estop_engaged"]
        active = lifecycle in ACTIVE
        enabled = {
            "start": lifecycle in ("READY", "DONE") and not stopped,
            "pause": active and not paused,
            "resume": active and (paused or stopped),
            "skip_current": lifecycle == "INSPECTING",
            "abort": active,
        }
        return {name for name, on in enabled.items() if on}

    def press(self, button: str) -> Json:
        """Press a button of the mission that is enabled, and return the answer."""
        self.until(lambda: button in self.buttons(), f"button {button}")
        return self.call(f"/mission/{button}", "std_srvs/Trigger")

    def start(self, mission: str, goal: int = 0, tags: Iterable[str] = ()) -> Json:
        """Press the button that starts a mission; the page itself never names tags."""
        self.until(lambda: "start" in self.buttons(), "button start")
        request = {"mission_type": mission, "tag_sequence": list(tags), "discovery_goal": goal}
        return self.call("/mission/start", "lupin_msgs/StartMission", **request)

    def place(self) -> tuple[float, float, float] | None:
        """Return where the robot is on the map (m, m, rad), along the links that transforms make."""
        links: dict[str, tuple[str, Json]] = {}
        for topic in ("/tf_static", "/tf"):
            for message in self.all(topic)[-200:]:
                for link in message["transforms"]:
                    links[link["child_frame_id"]] = link["header"]["frame_id"], link["transform"]
        x = y = yaw = 0.0
        frame = "base_link"
        for _ in range(MOST_LINKS):
            if frame == "map":
                return x, y, math.remainder(yaw, math.tau)
            if frame not in links:
                return None
            frame, link = links[frame]
            there, turn = link["translation"], 2.0 * math.atan2(link["rotation"]["z"], link["rotation"]["w"])
            x, y = (
                there["x"] + x * math.cos(turn) - y * math.sin(turn),
                there["y"] + x * math.sin(turn) + y * math.cos(turn),
            )
            yaw += turn
        return None


def _gateway_qos() -> QoSProfile:
    """Return the gateway's own wish: reliable, nothing latched, ten messages."""
    return QoSProfile(
        depth=10, durability=DurabilityPolicy.VOLATILE, reliability=ReliabilityPolicy.RELIABLE
    )


def _class(kind: str, group: str) -> Any:
    """Return the class of an interface by the name that web pages use: package/Type."""
    package, _, name = kind.partition("/")
    return getattr(importlib.import_module(f"{package}.{group}"), name)


def _filled(message: Any, fields: Mapping[str, Any]) -> Any:
    """Write JSON into a message; what is not said keeps its default, an unknown field is an error."""
    for name, value in fields.items():
        current = getattr(message, name)
        if isinstance(value, Mapping):
            _filled(current, value)
        else:
            setattr(message, name, float(value) if isinstance(current, float) else value)
    return message


def as_json(value: Any) -> Any:
    """Return a message, or part of one, as the page gets it."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: as_json(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, bool | int | str):
        return value
    return [as_json(item) for item in value]
