"""The operator's panel of today, as the robot sees it: its web page, and the gateway that speaks ROS for it.

It shares nothing with what it talks to but the message packages: names, types and rules are written here once
more, by hand, as the page has them. The gateway is an ordinary ROS node. It derives the quality of service of
a subscription from the publishers that it knows at that moment, keeps what it publishes for a second, and
hands everything over as JSON, in which a number that is none is null.
"""

from __future__ import annotations

import importlib
import math
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from functools import cached_property
from typing import Any

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
PATIENCE = 120.0
#: Seconds between two words about the software stop, and most links between the map and the robot.
STOP_PERIOD_S = 0.5
MOST_LINKS = 32
#: Topics and services with which the page says stop.
STOP_TOPIC = "/lupin/hmi/estop"
CANCEL_DRIVES = "/navigate_to_pose/_action/cancel_goal"

ACTIVE = {"PREPARE", "EXPLORING", "INSPECTING", "MONITORING", "RETURNING"}


class Heard:
    """A message, and when it came by the clock of this process."""

    def __init__(self, message: Any) -> None:
        self.at = time.monotonic()
        self.message = message

    @cached_property
    def json(self) -> Json:
        """The message as the page gets it."""
        found: Json = as_json(self.message)
        return found


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
        self._links: dict[str, Json] = {}
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
            self.work(0.05)

    def work(self, seconds: float = 0.0) -> None:
        """Do one piece of work, if there is any within so many seconds."""
        self._executor.spin_once(seconds)

    # --- topics -------------------------------------------------------------------------------------------

    def knows(self, topics: Iterable[str]) -> None:
        """Wait until all these topics have a publisher that the gateway knows."""
        self.until(
            lambda: all(map(self.node.get_publishers_info_by_topic, topics)), f"publishers of {topics}"
        )

    def subscribe(self, topic: str, kind: str, hears_latched: bool = True, depth: int = 10) -> None:
        """Listen to a topic as the gateway does, or as it does before it knows the publishers.

        Of more than `depth` messages at once it keeps the last ones.
        """
        heard = self._heard[topic] = deque(maxlen=5000)
        qos = self._derived(topic) if hears_latched else _gateway_qos()
        qos.depth = depth

        def keep(message: Any) -> None:
            heard.append(Heard(message))
            for link in heard[-1].json["transforms"] if kind == "tf2_msgs/TFMessage" else ():
                self._links[link["child_frame_id"]] = link

        self.node.create_subscription(_class(kind, "msg"), topic, keep, qos)

    def _derived(self, topic: str) -> QoSProfile:
        qos = _gateway_qos()
        offered = [info.qos_profile for info in self.node.get_publishers_info_by_topic(topic)]
        if any(profile.durability is DurabilityPolicy.TRANSIENT_LOCAL for profile in offered):
            qos.durability, qos.reliability = DurabilityPolicy.TRANSIENT_LOCAL, ReliabilityPolicy.RELIABLE
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
        return [heard.json for heard in self._heard[topic]]

    def last(self, topic: str) -> Json:
        """Return what was heard last of a topic; waits for it if there is nothing yet."""
        self.until(lambda: self._heard[topic], f"a message of {topic}")
        return self._heard[topic][-1].json

    def fresh(self, topic: str) -> Json:
        """Return what is told of a topic from now on: what was not listened to for a while waits in line."""
        asked = time.time()
        self.until(lambda: _stamp(self.last(topic)) > asked, f"news of {topic}")
        return self.last(topic)

    def publish(self, topic: str, kind: str, message: Mapping[str, Any]) -> None:
        """Send a message; for a second it also reaches who comes late."""
        if topic not in self._publishers:
            durability = DurabilityPolicy.TRANSIENT_LOCAL
            qos = QoSProfile(depth=100, durability=durability, lifespan=Duration(seconds=1))
            self._publishers[topic] = self.node.create_publisher(_class(kind, "msg"), topic, qos)
        self._publishers[topic].publish(_filled(_class(kind, "msg")(), message))

    # --- services -----------------------------------------------------------------------------------------

    def call(self, service: str, kind: str, /, **request: Any) -> Json:
        """Return a service's answer."""
        future = self.call_later(service, kind, **request)
        self.until(future.done, f"an answer of {service}")
        found: Json = as_json(future.result())
        return found

    def call_later(self, service: str, kind: str, /, **request: Any) -> Future[Any]:
        """Send a request whose answer nobody waits for now."""
        interface = _class(kind, "srv")
        if service not in self._clients:
            self._clients[service] = self.node.create_client(interface, service)
        client = self._clients[service]
        self.until(client.service_is_ready, f"service {service}")
        return client.call_async(_filled(interface.Request(), request))

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
        x = y = yaw = 0.0
        frame = "base_link"
        for _ in range(MOST_LINKS):
            if frame == "map":
                return x, y, math.remainder(yaw, math.tau)
            if frame not in self._links:
                return None
            link = self._links[frame]
            frame, there = link["header"]["frame_id"], link["transform"]["translation"]
            rotation = link["transform"]["rotation"]
            turn = 2.0 * math.atan2(rotation["z"], rotation["w"])
            x, y = (
                there["x"] + x * math.cos(turn) - y * math.sin(turn),
                there["y"] + x * math.sin(turn) + y * math.cos(turn),
            )
            yaw += turn
        return None


def _stamp(message: Json) -> float:
    """Return when a message was sent, by its header or that of its first transform."""
    header = message["header"] if "header" in message else message["transforms"][0]["header"]
    return float(header["stamp"]["sec"]) + float(header["stamp"]["nanosec"]) * 1e-9


def _gateway_qos() -> QoSProfile:
    """Return what fits every publisher: best effort, nothing latched; and ten messages."""
    return QoSProfile(
        depth=10, durability=DurabilityPolicy.VOLATILE, reliability=ReliabilityPolicy.BEST_EFFORT
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
