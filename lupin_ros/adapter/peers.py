"""Detects incompatible peers and second servers from the DDS endpoints that others announce.

Two processes with different definitions of a message match each other; one direction then delivers nothing,
the other truncated objects, without a warning. Only the announced type hashes show it. Two servers of one
service both carry out every request, and the caller gets one answer; the second publisher of answers shows
it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from lupin_ros.adapter.host import Host
from lupin_ros.adapter.network import NAMELESS, UNKNOWN, node_name, type_name

#: The suffix of an action's status topic.
_STATUS = "/_action/status"


def service_channels(name: str) -> list[str]:
    """Return the DDS topics behind the service with the full name `name`."""
    return [f"rq{name}Request", f"rr{name}Reply"]


def action_channels(name: str) -> list[str]:
    """Return the DDS topics behind the action with the full name `name`."""
    services = ("send_goal", "cancel_goal", "get_result")
    channels = [c for service in services for c in service_channels(f"{name}/_action/{service}")]
    return [*channels, f"rt{name}/_action/feedback", f"rt{name}/_action/status"]


def peer_mismatches(ros: Host) -> list[str]:
    """Compare the type of everything this node publishes, subscribes, serves and calls with its peers'.

    Each finding names topic or service, peer node and both hashes. The local hash is the one this node's
    own endpoint announces, so it is exactly what the peers see.

    Seen: topics, and requests and answers of services and actions, because their DDS topics carry hashes
    too. Not seen: a peer that is not discovered yet, is no ROS node, or announces no hash (older than ROS 2
    Iron); and fields of which only the meaning or the unit has changed.
    """
    me = (ros.node.get_name(), ros.node.get_namespace())
    return [finding for channel in ros.channels() for finding in _channel_findings(ros.node, channel, me)]


def is_listened_to(ros: Host, topic: str, server: str) -> bool:
    """Return whether all servers of a service or action (`NAME/_action/send_goal`) subscribe to a topic.

    Both are full names. A node that is not fully discovered yet does not.
    """
    _, replies = service_channels(server)
    serving = {node_name(e) for e in ros.node.get_publishers_info_by_topic(replies, no_mangle=True)}
    hearing = {node_name(e) for e in ros.node.get_subscriptions_info_by_topic(topic)} - {UNKNOWN}
    return bool(serving) and serving <= hearing


def rival_servers(ros: Host) -> list[str]:
    """Return the services and actions of this node that another node offers as well.

    A node that crashed stays visible for some seconds: rely only on a finding of two checks.
    """
    me = (ros.node.get_name(), ros.node.get_namespace())
    return [finding for channel in ros.channels() for finding in _rivals(ros.node, channel, me)]


def _rivals(node: Any, channel: str, me: tuple[str, str]) -> Iterator[str]:
    name = _served(channel)
    found = node.get_publishers_info_by_topic(channel, no_mangle=True) if name else []
    answering = [endpoint for endpoint in found if endpoint.node_name != NAMELESS]
    strangers = list(_others(answering, me))
    if len(strangers) == len(answering) or len(answering) < 2:
        return
    who = ", ".join(sorted({node_name(peer) for peer in strangers})) or "another node of this name"
    yield f"{name} is also offered by {who}: every request is carried out by both; stop one of them"


def _served(channel: str) -> str:
    """Return the service or action whose servers publish this channel; '' for other channels."""
    kind, name = channel[:2], channel[2:]
    if kind == "rr" and "/_action/" not in name:
        return name.removesuffix("Reply")
    return name.removesuffix(_STATUS) if kind == "rt" and name.endswith(_STATUS) else ""


def _channel_findings(node: Any, channel: str, me: tuple[str, str]) -> Iterator[str]:
    endpoints = [
        *node.get_publishers_info_by_topic(channel, no_mangle=True),
        *node.get_subscriptions_info_by_topic(channel, no_mangle=True),
    ]
    mine = next((e for e in endpoints if (e.node_name, e.node_namespace) == me), None)
    if mine is None:
        return
    seen = set()
    for peer in _others(endpoints, me):
        if _announces(peer) == _announces(mine) or not _is_known(peer):
            continue
        finding = _finding_text(channel, mine, peer)
        if finding not in seen:
            seen.add(finding)
            yield finding


def _others(endpoints: Iterable[Any], me: tuple[str, str]) -> Iterator[Any]:
    return (e for e in endpoints if (e.node_name, e.node_namespace) != me)


def _is_known(peer: Any) -> bool:
    # The endpoint is discovered a moment before the name of its node; the next comparison will have it.
    return str(peer.topic_type_hash) != "INVALID" and peer.node_name != NAMELESS


def _announces(endpoint: Any) -> tuple[str, str]:
    return endpoint.topic_type, str(endpoint.topic_type_hash)


def _finding_text(channel: str, mine: Any, peer: Any) -> str:
    return (
        f"{_ros_name(channel)}: node {node_name(peer)} uses another definition: "
        f"here {type_name(mine)} {mine.topic_type_hash}, there {type_name(peer)} {peer.topic_type_hash}; "
        "build both sides from the same interface packages, and the same distribution of ROS 2"
    )


def _ros_name(channel: str) -> str:
    kind, name = channel[:2], channel[2:]
    if kind == "rq":
        return f"request of {name.removesuffix('Request')}"
    if kind == "rr":
        return f"answer of {name.removesuffix('Reply')}"
    return name
