"""Keeps one orchestrator in a namespace of a domain: the later process instance stands down.

A second one would carry out every request too, with the same robot. There are two checks: one before the node
offers anything, and one for two that start in the same second.
"""

from __future__ import annotations

import re
import time
import uuid
from collections.abc import Callable
from typing import Any

from std_msgs.msg import String

from lupin_engine.plugin import Wire, ros_domain
from lupin_ros.adapter.dds.ports import participants
from lupin_ros.adapter.network import NAMELESS, node_name, other_participants
from lupin_ros.adapter.node import Qos, RosNode
from lupin_ros.adapter.peers import service_channels
from lupin_ros.interfaces.definitions import interface_class
from lupin_ros.service import messages
from lupin_ros.service.names import CHART_TOPIC

#: The beginning of a chart's record: the id of the orchestrator's process instance.
_BOOT = re.compile(r'\{"boot": "(\w+)"')

#: How long the search for another one takes, in seconds: one that runs is usually found within 0.3 s. Among
#: several robots that takes longer: so many more where not all participants of this machine are known yet.
LOOK_S, MORE_S = 1.0, 5.0
#: How often a subscription is made again while another publisher's record has not arrived, in seconds.
LISTEN_AGAIN_S = 3.0


def other_orchestrator(ros: RosNode, wire: Wire) -> str:
    """Return the name and lifecycle state of a running orchestrator; '' when none is found in time.

    Must be called before `ros` offers anything. Killed nodes stay in the graph for some seconds, so one
    counts only when its state is received as well.
    """
    heard: list[Any] = []
    topic = ros.topic_name(wire.state.name)
    _, replies = service_channels(ros.service_name(wire.start.name))

    def found() -> set[str]:
        publishing = ros.node.get_publishers_info_by_topic(topic)
        serving = ros.node.get_publishers_info_by_topic(replies, no_mangle=True)
        named = [{node_name(e) for e in ends if e.node_name != NAMELESS} for ends in (publishing, serving)]
        return named[0] & named[1]

    subscription = ros.subscribe(interface_class(wire.state.type), topic, Qos[wire.state.qos], heard.append)

    def is_certain() -> bool:
        return bool(heard and found()) or other_participants(ros.node) >= there - 1

    ros.work_until(lambda: bool(heard and found()), LOOK_S)
    there = participants(ros_domain()) or 0
    ros.work_until(is_certain, MORE_S)
    others = ", ".join(sorted(found())) if heard else ""
    ros.node.destroy_subscription(subscription)
    return f"{others} ({wire.read_state(messages.read(heard[-1])).lifecycle})" if others else ""


def new_boot() -> str:
    """Return a new id of a process instance; ids sort by the wall clock at the start."""
    return f"{time.time_ns():016x}{uuid.uuid4().hex[:16]}"


def watch_for_older_instance(ros: RosNode, boot: str, found: Callable[[str], None]) -> None:
    """Call `found` with the id of an older process instance, whenever one is heard.

    Two that start in the same second do not find each other by `other_orchestrator`. Each publishes its chart
    soon after its start and receives the other's, so the younger one is called. A latched message does not
    always reach a reader that starts together with the writer (Fast DDS, issue 3822): while another writer's
    record has not arrived, the subscription is made again.
    """
    others: set[str] = set()

    def hear(message: String) -> None:
        record = _BOOT.match(message.data)
        if record and record[1] != boot:
            others.add(record[1])
            if record[1] < boot:
                found(record[1])

    def listen() -> Any:
        return ros.subscribe(String, CHART_TOPIC, Qos.LATCHED, hear)

    reader = listen()

    def listen_again() -> None:
        nonlocal reader
        if not others and ros.count_publishers(CHART_TOPIC) > 1:
            ros.node.destroy_subscription(reader)
            reader = listen()

    ros.steady_timer(LISTEN_AGAIN_S, listen_again)
