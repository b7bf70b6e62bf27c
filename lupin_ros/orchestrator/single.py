"""One orchestrator in a domain: a second one would carry out every request too, with the same robot."""

from __future__ import annotations

import re
import time
import uuid
from collections.abc import Callable
from typing import Any

from std_msgs.msg import String

from lupin_engine.plugin import Wire
from lupin_ros.adapter.network import NAMELESS, node_name
from lupin_ros.adapter.node import Qos, RosNode
from lupin_ros.adapter.peers import service_channels
from lupin_ros.interfaces.definitions import interface_class
from lupin_ros.service import messages
from lupin_ros.service.names import CHART_TOPIC

#: What a record of the chart begins with: the name of the start of an orchestrator.
_BOOT = re.compile(r'\{"boot": "(\w+)"')

#: How long another one is looked for, in seconds: one that runs is usually found within 0.3 s.
LOOK_S = 1.0
#: How often it is looked whether another one is there of which nothing was heard, in seconds.
LISTEN_AGAIN_S = 3.0


def other_orchestrator(ros: RosNode, wire: Wire) -> str:
    """Return which node is an orchestrator already, and in what state it is; '' when none is found.

    To be called before `ros` offers anything. Other nodes of this domain stay visible for some seconds after
    they were killed, so one counts only when its state is heard as well: the dead say nothing.
    """
    heard: list[Any] = []
    topic = ros.node.resolve_topic_name(wire.state.name)
    _, replies = service_channels(ros.node.resolve_service_name(wire.start.name))

    def found() -> set[str]:
        publishing = ros.node.get_publishers_info_by_topic(topic)
        serving = ros.node.get_publishers_info_by_topic(replies, no_mangle=True)
        named = [{node_name(e) for e in ends if e.node_name != NAMELESS} for ends in (publishing, serving)]
        return named[0] & named[1]

    subscription = ros.subscribe(interface_class(wire.state.type), topic, Qos[wire.state.qos], heard.append)
    ros.work_until(lambda: bool(heard and found()), LOOK_S)
    others = ", ".join(sorted(found())) if heard else ""
    ros.node.destroy_subscription(subscription)
    return f"{others} ({wire.read_state(messages.read(heard[-1])).lifecycle})" if others else ""


def new_boot() -> str:
    """Return a name for a start of an orchestrator; of two names the smaller one is that of the earlier."""
    return f"{time.time_ns():016x}{uuid.uuid4().hex[:16]}"


def listen_for_an_elder(ros: RosNode, boot: str, found: Callable[[str], None]) -> None:
    """Call `found` with the name of another start that was before `boot`.

    Two that look for each other in the same second find nobody. Each tells its chart a moment after its start
    and hears that of the other, so exactly one of the two is called. What is latched does not always reach a
    reader that starts together with the writer (Fast DDS, issue 3822): while there is another writer of which
    nothing was heard, the reader is made anew.
    """
    others: set[str] = set()

    def hear(message: String) -> None:
        told = _BOOT.match(message.data)
        if told and told[1] != boot:
            others.add(told[1])
            if told[1] < boot:
                found(told[1])

    def listen() -> Any:
        return ros.subscribe(String, CHART_TOPIC, Qos.LATCHED, hear)

    reader = listen()

    def listen_again() -> None:
        nonlocal reader
        if not others and ros.node.count_publishers(CHART_TOPIC) > 1:
            ros.node.destroy_subscription(reader)
            reader = listen()

    ros.steady_timer(LISTEN_AGAIN_S, listen_again)
