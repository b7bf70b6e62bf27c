"""The node `lupin_gateway`: wires ROS (main thread) to the web server (a thread with an event loop)."""

from __future__ import annotations

import gc
import socket
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from lupin_engine.errors import UsageError
from lupin_engine.plugin import COUNT, DURATION, ROS_NAME, TEXT, Parameter, list_of, load_catalog
from lupin_gateway.history import TopicHistory
from lupin_gateway.history.settings import history_topics
from lupin_gateway.hub import Backlog, Hub
from lupin_gateway.node import rules as rule_parameters
from lupin_gateway.node.listening import listen
from lupin_gateway.node.loop import LoopThread
from lupin_gateway.node.ros import RosAdapter
from lupin_gateway.robots import Robots
from lupin_gateway.server import Address, Gateway, serve
from lupin_gateway.session import Limits
from lupin_greenhouse import StopListener, StopState
from lupin_ros.adapter import Repeater, RosNode
from lupin_ros.service import names

#: The longest that either thread keeps Python's lock while the other one wants it, in seconds.
SWITCH_INTERVAL_S = 0.001

#: Seconds from the start to the first page: a call or message of an earlier one would find nobody there.
DISCOVERY_S = 1.2

PARAMETERS = {
    "host": Parameter(TEXT, "127.0.0.1", "address to listen on; the default lets in this computer only"),
    "port": Parameter(
        COUNT, 8080, "port of pages and protocol (paths / and /_ros)", minimum=1, maximum=65535
    ),
    "rosbridge_port": Parameter(
        COUNT, 0, "second port, with the protocol only, for pages that want 9090; 0: none", maximum=65535
    ),
    "call_timeout": Parameter(
        DURATION, 5.0, "a call that takes longer has failed", minimum=0.1, maximum=600.0
    ),
    "slow_call_timeout": Parameter(
        DURATION, 15.0, "the same for calls of slow services", minimum=0.1, maximum=600.0
    ),
    "slow_services": Parameter(
        list_of(TEXT),
        ["/lupin/arm/", names.DRAW_SERVICE],
        "how the names of slow services begin, such as /lupin/arm/",
    ),
    "events": Parameter(
        list_of(TEXT),
        ["/floranova/observations=50", f"{names.STEPS_TOPIC}=50", "/tf_static=100", "/rosout=100"],
        "topics of which every message counts, each with how many a page gets that comes later",
    ),
    "history": Parameter(
        list_of(TEXT),
        [
            f"{names.STEPS_TOPIC} std_msgs/msg/String 24 MB",
            f"{names.POSSIBLE_TOPIC} std_msgs/msg/String 4 MB",
            f"{names.MISSIONS_TOPIC} std_msgs/msg/String 1 MB",
            f"{names.CHART_TOPIC} std_msgs/msg/String 4 MB",
            "/mission/state lupin_msgs/msg/MissionState 4 MB on change every 2 s",
            "/floranova/observations lupin_msgs/msg/Observation 4 MB",
            "/lupin/hmi/stops std_msgs/msg/String 1 MB",
            "/twin/state lupin_msgs/msg/TwinState 8 MB every 5 s",
            "/tf tf2_msgs/msg/TFMessage 8 MB every 0.5 s",
            "/amcl_pose geometry_msgs/msg/PoseWithCovarianceStamped 2 MB on change",
            "/io/power/power_watcher sensor_msgs/msg/BatteryState 2 MB every 5 s",
        ],
        "topics whose past is kept for pages: TOPIC TYPE NUMBER MB, then `on change`, `every NUMBER s`",
    ),
    "estop_topic": Parameter(ROS_NAME, "/e_stop_state", "topic of the emergency stop, true while engaged"),
    "estop_timeout": Parameter(
        DURATION,
        2.0,
        "an emergency stop that was told steadily and is silent for so long counts as engaged; 0: never",
        maximum=60.0,
    ),
    **rule_parameters.PARAMETERS,
}


def kept_by(values: Mapping[str, Any]) -> Mapping[str, Backlog]:
    """Return the backlog of each topic, from the parameter `events`.

    Raises:
        UsageError: an entry is no `TOPIC=NUMBER`.
    """
    kept = {}
    for entry in values["events"]:
        topic, _, depth = entry.partition("=")
        if not topic.startswith("/") or not depth.isdecimal() or not 0 < int(depth) <= 10_000:
            raise UsageError(f"events: {entry!r} is no TOPIC=NUMBER such as /floranova/observations=50")
        kept[topic] = Backlog(int(depth), events=True)
    return kept


def check(values: Mapping[str, Any]) -> None:
    """Check the parameters together; LupinError where they do not fit. See `lupin_ros.launch.nodes`."""
    kept_by(values)
    history_topics(values["history"])
    rule_parameters.check(values)


def addresses(values: Mapping[str, Any]) -> list[str]:
    """Return where browsers find the pages; see `lupin_ros.launch.nodes`."""
    if not values["open"]:
        return [f"pages at http://{values['host']}:{values['port']}"]
    who = "for who has a token; `lupin invite NAME` prints a link for a phone"
    return [f"pages at https://{socket.gethostname()}:{values['port']}, {who}"]


def _open(waiting: Repeater, loop: LoopThread, serving: Callable[..., Any]) -> None:
    waiting.stop()
    loop.start(serving)


def _gateway(ros: RosNode, values: Mapping[str, Any], loop: LoopThread, base: str = "") -> Gateway:
    """Return the gateway of the robot in the namespace of `ros`; `base` stands before its paths."""
    kept = kept_by(values)
    port = RosAdapter(ros, loop.post)
    limits = Limits(values["call_timeout"], values["slow_call_timeout"], tuple(values["slow_services"]))
    hub = Hub(port.listen, lambda topic: kept.get(topic, Backlog()))
    history = TopicHistory(hub, history_topics(values["history"]), time.time)
    rules = rule_parameters.gateway_rules(ros, port, values, base)
    loop.post(listen, hub, rules, load_catalog().profile)

    def hear_stop(state: StopState) -> None:
        port.hear_stop(state.engaged)
        loop.post(rules.hear_stops, state.sources)

    StopListener(ros, values["estop_topic"], values["estop_timeout"], hear_stop)
    gateway = Gateway(port, hub, limits, rules, rule_parameters.tls(values), history)
    gateway.robot = ros.namespace[1:]
    return gateway


def _robots(ros: RosNode, arguments: Sequence[str], loop: LoopThread) -> Robots:
    """Return the gateways of several robots, each with a node in its namespace, which ends with `ros`."""
    values, found = ros.parameters(), {}
    for robot in values["robots"]:
        inside = ["--ros-args", "-r", f"__ns:={ros.namespace}/{robot}", "--", *arguments]
        node = RosNode(ros.name, inside, PARAMETERS)
        own = rule_parameters.of_robot(values, robot)
        found[robot] = _gateway(node, own, loop, f"/robots/{robot}")
        spinning = threading.Thread(target=_spin, args=(node, ros), name=robot, daemon=True)
        ros.on_stop(partial(_end, node, spinning))
        spinning.start()
    return Robots(found)


def _spin(node: RosNode, ros: RosNode) -> None:
    try:
        node.spin()
    finally:  # one that ended by a defect ends them all, to be started again
        ros.stop()


def _end(node: RosNode, spinning: threading.Thread) -> None:
    node.stop()
    spinning.join()


def main(arguments: Sequence[str]) -> int:
    """Run the node until it is stopped; `arguments` are the ROS arguments."""
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    with RosNode("lupin_gateway", arguments, PARAMETERS, managed=True) as ros:
        values = ros.parameters()
        check(values)
        address = Address(rule_parameters.host(values), values["port"], values["rosbridge_port"])
        sockets = address.sockets()
        loop = LoopThread(ros.stop)
        ros.on_stop(loop.stop)
        for each in sockets:
            ros.on_stop(each.close)
        several = values["robots"]
        gateway = _robots(ros, arguments, loop) if several else _gateway(ros, values, loop)
        opening = Repeater(
            ros.steady_timer, DISCOVERY_S, lambda: _open(opening, loop, partial(serve, gateway, sockets))
        )
        opening.start()
        ros.log.info(
            f"the gateway serves http://{address.host}:{address.port}", rosbridge=address.rosbridge_port
        )
        gc.freeze()  # what is here stays: to look through it for garbage would hold up a stop for long
        try:
            ros.spin()
        finally:  # what nobody came to use is closed as well
            loop.close()
            for opened in sockets:
                opened.close()
    return loop.exit_code
