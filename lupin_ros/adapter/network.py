"""Reads the graph of a ROS domain: who publishes, subscribes, serves and calls which name, as plain data.

Read off the DDS topics that every endpoint announces. A service is a pair of them (`rq…Request`, `rr…Reply`,
in the names that rmw gives them), an action three services and two topics; who sends requests is its client.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any, Literal

from rclpy.qos import QoSCompatibility, qos_check_compatible

from lupin_ros.adapter.vitals import DIAGNOSTICS_TOPIC

Kind = Literal["topic", "service", "action"]

#: What rmw says for the node of an endpoint whose own node has not been discovered.
NAMELESS = "_NODE_NAME_UNKNOWN_"
#: Placeholder for such a node: a program that is no ROS node, or one that is starting or ending.
UNKNOWN = "?"

#: What stands between the name of an action and those of its parts.
ACTION = "/_action/"
_SEND_GOAL = f"{ACTION}send_goal"
#: What every node has beside its own: parameters, log, diagnostics, type descriptions, life cycle.
_HOUSEKEEPING_TOPICS = ("/rosout", "/parameter_events")
_HOUSEKEEPING_SERVICES = (
    *("get_type_description", "get_parameter_types", "describe_parameters", "get_parameters"),
    *("list_parameters", "set_parameters", "set_parameters_atomically"),
    *("change_state", "get_state", "get_available_states"),
    *("get_available_transitions", "get_transition_graph"),
)


#: So many bytes of an endpoint's id are its participant's.
_PREFIX = 12


@dataclass(frozen=True)
class Interface:
    """A topic, service or action, and who is at its ends, as full node names in alphabetical order.

    `producers` publish the topic or serve the requests; `consumers` subscribe or call. `problems` says why
    something that is sent does not arrive, or arrives twice.
    """

    kind: Kind
    name: str
    type: str
    producers: tuple[str, ...]
    consumers: tuple[str, ...]
    problems: tuple[str, ...] = ()

    @property
    def is_housekeeping(self) -> bool:
        """Whether every node has this interface, whatever its purpose."""
        last = self.name.rpartition("/")[2]
        every = (
            _HOUSEKEEPING_SERVICES if self.kind == "service" else (DIAGNOSTICS_TOPIC[1:], "transition_event")
        )
        return self.name in _HOUSEKEEPING_TOPICS or last in every


@dataclass(frozen=True)
class _DdsTopic:
    """A DDS topic as endpoint descriptions of rclpy."""

    writers: tuple[Any, ...]
    readers: tuple[Any, ...]


def other_participants(node: Any) -> int:
    """Return how many participants of DDS are known beside that of `node` (of rclpy).

    Each may have many nodes, whose publishers of log and parameters have ids that begin with its own.
    """
    known = (e for topic in _HOUSEKEEPING_TOPICS for e in node.get_publishers_info_by_topic(topic))
    return len({bytes(endpoint.endpoint_gid[:_PREFIX]) for endpoint in known}) - 1


def interfaces(node: Any, without: Iterable[str] = (), *, parts: bool = False) -> list[Interface]:
    """Return the interfaces that `node` (of rclpy) has discovered so far, by kind and name.

    Args:
        node: any node; discovery must have had its time.
        without: full names of nodes to leave out, such as the one that looks.
        parts: also return the services and topics of actions: some clients only cancel.
    """
    hidden = frozenset(without)
    channels = {
        name: channel
        for name, _ in node.get_topic_names_and_types(no_demangle=True)
        if (channel := _channel(node, name, hidden)) is not None
    }
    whole = channels if parts else {name: each for name, each in channels.items() if ACTION not in name}
    found = [*_topics(whole), *_services(whole), *_actions(channels)]
    return sorted(found, key=lambda i: (("topic", "service", "action").index(i.kind), i.name))


def node_name(endpoint: Any) -> str:
    """Return the full name of an endpoint's node."""
    if endpoint.node_name == NAMELESS:
        return UNKNOWN
    return f"{endpoint.node_namespace.rstrip('/')}/{endpoint.node_name}"


def type_name(endpoint: Any) -> str:
    """Return the type as ROS writes it: DDS spells std_msgs/msg/String std_msgs::msg::dds_::String_."""
    return str(endpoint.topic_type).replace("::dds_::", "::").replace("::", "/").removesuffix("_")


def _channel(node: Any, name: str, hidden: frozenset[str]) -> _DdsTopic | None:
    if name[:3] not in ("rt/", "rq/", "rr/"):
        return None  # of the middleware itself, or of a program that does not speak ROS
    writers = node.get_publishers_info_by_topic(name, no_mangle=True)
    readers = node.get_subscriptions_info_by_topic(name, no_mangle=True)
    return _DdsTopic(
        tuple(e for e in writers if node_name(e) not in hidden),
        tuple(e for e in readers if node_name(e) not in hidden),
    )


def _topics(channels: Mapping[str, _DdsTopic]) -> Iterator[Interface]:
    for name, channel in channels.items():
        ends = [*channel.writers, *channel.readers]
        if name.startswith("rt/") and ends:
            problems = (*_definitions(ends), *_unmatched(channel))
            yield _interface(
                "topic", name[2:], type_name(ends[0]), channel.writers, channel.readers, problems
            )


def _services(channels: Mapping[str, _DdsTopic]) -> Iterator[Interface]:
    for name, requests in _requests(channels):
        yield from _asked("service", name, requests, "_Request")


def _actions(channels: Mapping[str, _DdsTopic]) -> Iterator[Interface]:
    for name, requests in _requests(channels):
        if name.endswith(_SEND_GOAL):
            yield from _asked("action", name.removesuffix(_SEND_GOAL), requests, "_SendGoal_Request")


def _requests(channels: Mapping[str, _DdsTopic]) -> Iterator[tuple[str, _DdsTopic]]:
    for name, channel in channels.items():
        if name.startswith("rq/"):
            yield name[2:].removesuffix("Request"), channel


def _asked(kind: Kind, name: str, requests: _DdsTopic, ending: str) -> Iterator[Interface]:
    """Yield the interface of a topic of requests: servers read it, clients write it."""
    ends = [*requests.readers, *requests.writers]
    if not ends:
        return
    problems = list(_definitions(ends))
    if len(requests.readers) > 1:
        servers = ", ".join(_names(requests.readers))
        problems.append(f"{len(requests.readers)} servers ({servers}): every request is carried out by each")
    kind_of = type_name(ends[0]).removesuffix(ending)
    yield _interface(kind, name, kind_of, requests.readers, requests.writers, problems)


def _interface(
    kind: Kind,
    name: str,
    type_: str,
    producers: Iterable[Any],
    consumers: Iterable[Any],
    problems: Iterable[str],
) -> Interface:
    return Interface(kind, name, type_, _names(producers), _names(consumers), tuple(problems))


def _names(endpoints: Iterable[Any]) -> tuple[str, ...]:
    return tuple(sorted({node_name(endpoint) for endpoint in endpoints}))


def _definitions(ends: Iterable[Any]) -> Iterator[str]:
    """Return problems of ends with different definitions of the type."""
    users: dict[tuple[str, str], set[str]] = {}
    for end in ends:
        if str(end.topic_type_hash) != "INVALID":  # an older ROS 2, which announces none
            users.setdefault((type_name(end), str(end.topic_type_hash)), set()).add(node_name(end))
    if len(users) > 1:
        found = "; ".join(
            f"{', '.join(sorted(nodes))}: {type_} {hash_}" for (type_, hash_), nodes in users.items()
        )
        yield f"different definitions ({found}): build both sides from the same interface packages"


def _unmatched(channel: _DdsTopic) -> Iterator[str]:
    """Return pairs with incompatible QoS: a reader that requires more than the writer offers gets nothing."""
    found = set()
    for writer, reader in product(channel.writers, channel.readers):
        fit, reason = qos_check_compatible(writer.qos_profile, reader.qos_profile)
        why = reason.replace("ERROR: ", "").strip(";").replace(";", ", ").lower()
        text = f"{node_name(reader)} hears nothing of {node_name(writer)}: {why}"
        if fit == QoSCompatibility.ERROR and text not in found:
            found.add(text)
            yield text
