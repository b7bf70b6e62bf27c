"""A bare rclpy node with the endpoints of another: what a node costs that does nothing of its own.

    .venv/bin/python benchmarks/mirror.py /mission_orchestrator [--listen 5]

It looks at the network, listens for some seconds to what the other one publishes, and then has the same
subscriptions (with callbacks that do nothing) and clients, its own copies of the services and actions, and
publishers that send copies of the last message of each topic as often as the other one did. It uses rclpy
as it is, with its own SingleThreadedExecutor; nothing of it is the engine's but the look at the network.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import time
from collections import Counter
from typing import Any

import rclpy
from rclpy.action import ActionClient, ActionServer
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor

from lupin_ros.adapter.network import Interface, interfaces

#: Seconds until everybody has been discovered.
DISCOVERY_S = 3.0
#: Before the names of what the mirror offers itself.
PREFIX = "/bare"


def type_of(interface: Interface) -> Any:
    """Import the message, service or action that an interface uses."""
    package, kind, name = interface.type.split("/")
    return getattr(importlib.import_module(f"{package}.{kind}"), name)


def spin(executor: SingleThreadedExecutor, seconds: float) -> None:
    """Work for so long."""
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0:
        executor.spin_once(timeout_sec=left)


def profile(node: Any, name: str, topic: str, publishes: bool) -> Any:
    """Return the quality of service that the node `name` has for a topic."""
    ask = node.get_publishers_info_by_topic if publishes else node.get_subscriptions_info_by_topic
    found = next(e for e in ask(topic) if f"{e.node_namespace.rstrip('/')}/{e.node_name}" == name).qos_profile
    found.depth = found.depth or 10  # DDS does not announce it
    found.history = type(found.history).KEEP_LAST
    return found


def main() -> None:
    """Be the mirror of a node until interrupted."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("node", help="full name of the node")
    parser.add_argument("--listen", type=float, default=5.0, help="seconds")
    arguments = parser.parse_args()
    rclpy.init()
    node = rclpy.create_node("mirror")
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    spin(executor, DISCOVERY_S)
    seen = [i for i in interfaces(node, without=["/mirror"]) if not i.is_housekeeping]
    offered = [i for i in seen if arguments.node in i.producers]
    used = [i for i in seen if arguments.node in i.consumers]
    if not offered and not used:
        raise SystemExit(f"mirror: no node {arguments.node} on the network")
    said, last = listen(node, executor, arguments.node, offered, arguments.listen)
    for interface in used:
        use(node, arguments.node, interface)
    for interface in offered:
        offer(node, arguments.node, interface, said[interface.name] / arguments.listen, last)
    print("mirrored", flush=True)
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        executor.spin()


def listen(
    node: Any, executor: SingleThreadedExecutor, name: str, offered: list[Interface], seconds: float
) -> tuple[Counter[str], dict[str, Any]]:
    """Return how many messages came of each topic in so many seconds, and the last of each."""
    said: Counter[str] = Counter()
    last: dict[str, Any] = {}

    def keep(topic: str, message: Any) -> None:
        said[topic] += 1
        last[topic] = message

    subscriptions = [
        node.create_subscription(
            type_of(i), i.name, lambda m, topic=i.name: keep(topic, m), profile(node, name, i.name, True)
        )
        for i in offered
        if i.kind == "topic"
    ]
    spin(executor, seconds)
    for subscription in subscriptions:
        node.destroy_subscription(subscription)
    return said, last


def use(node: Any, name: str, interface: Interface) -> None:
    """Subscribe, or make a client."""
    kind = type_of(interface)
    if interface.kind == "topic":
        quality = profile(node, name, interface.name, False)
        node.create_subscription(kind, interface.name, lambda message: None, quality)
    elif interface.kind == "service":
        node.create_client(kind, interface.name)
    else:
        ActionClient(node, kind, interface.name)


def offer(node: Any, name: str, interface: Interface, rate: float, last: dict[str, Any]) -> None:
    """Publish at `rate` per second, or serve, under a name of the mirror's own."""
    kind = type_of(interface)
    own = PREFIX + interface.name
    if interface.kind == "topic":
        publisher = node.create_publisher(kind, own, profile(node, name, interface.name, True))
        if rate:
            node.create_timer(1.0 / rate, lambda: publisher.publish(last[interface.name]))
    elif interface.kind == "service":
        node.create_service(kind, own, lambda request, response: response)
    else:
        ActionServer(node, kind, own, lambda goal: kind.Result())


if __name__ == "__main__":
    main()
