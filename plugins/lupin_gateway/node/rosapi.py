"""Answers the services of `/rosapi/`: clients' queries about nodes, topics, services, types and parameters.

A client learns of the topics, services and actions that its role may use, by the names of the gateway's
namespace, without it; nodes have their full names. The types of these services are not checked: pages have
called `get_time` with a wrong one for years, so only the name counts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

from rcl_interfaces.msg import ParameterType
from rclpy.node import NodeNameNonExistentError

from lupin_engine.errors import nearest
from lupin_engine.plugin import COMMON_NAMES
from lupin_gateway.access import Use, UseRefusal
from lupin_gateway.encoding import as_json
from lupin_gateway.node import types
from lupin_gateway.node.calls import Services, action_type, service_servers, service_type
from lupin_gateway.node.topics import topic_types
from lupin_gateway.ports import CallFailed
from lupin_gateway.protocol import full_type
from lupin_gateway.shapes import TEXT, Listed, MessageShape, NotCarried
from lupin_ros.adapter import RosNode, distribution

#: Seconds that a node has to answer about a parameter.
PARAMETER_WITHIN_S = 5.0

#: Fields of a ParameterValue by its type.
_VALUES = {
    ParameterType.PARAMETER_BOOL: "bool_value",
    ParameterType.PARAMETER_INTEGER: "integer_value",
    ParameterType.PARAMETER_DOUBLE: "double_value",
    ParameterType.PARAMETER_STRING: "string_value",
    ParameterType.PARAMETER_BYTE_ARRAY: "byte_array_value",
    ParameterType.PARAMETER_BOOL_ARRAY: "bool_array_value",
    ParameterType.PARAMETER_INTEGER_ARRAY: "integer_array_value",
    ParameterType.PARAMETER_DOUBLE_ARRAY: "double_array_value",
    ParameterType.PARAMETER_STRING_ARRAY: "string_array_value",
}

#: Names of scalars as interface files write them; rclpy's classes say `double`.
_WRITTEN = {"double": "float64", "float": "float32", "boolean": "bool", "octet": "byte"}

#: Questions about a type: the kind of interface, and its part.
_DETAILS = {
    "message_details": ("msg", ""),
    "service_request_details": ("srv", "Request"),
    "service_response_details": ("srv", "Response"),
    "action_goal_details": ("action", "Goal"),
    "action_result_details": ("action", "Result"),
    "action_feedback_details": ("action", "Feedback"),
}
#: The end of the name of the service by which an action gets its goals.
_GOALS = "/_action/send_goal"
#: Why parameters are not changed.
_NO_CHANGE = "no client changes parameters; give them where the node is started: --set NODE.NAME=VALUE"

Done = Callable[[Any], None]
Data = Mapping[str, Any]


class Rosapi:
    """Answers queries; for the ROS thread."""

    def __init__(self, ros: RosNode, services: Services) -> None:
        self._ros = ros
        self._services = services
        self._questions: Mapping[str, Callable[[Data, UseRefusal], dict[str, Any]]] = {
            "get_time": self._get_time,
            "get_ros_version": lambda *_: {"version": 2, "distro": distribution()},
            "topics": self._topics,
            "topic_type": partial(self._type, Use.SUBSCRIBE, "topic", _topic_type),
            "topics_for_type": partial(self._for_type, Use.SUBSCRIBE, "topics", "msg"),
            "publishers": partial(self._topic_nodes, "publishers"),
            "subscribers": partial(self._topic_nodes, "subscribers"),
            "services": lambda _, refusal: {"services": list(self._known(Use.CALL, refusal))},
            "service_type": partial(self._type, Use.CALL, "service", service_type),
            "services_for_type": partial(self._for_type, Use.CALL, "services", "srv"),
            "service_node": lambda data, refusal: {"node": next(iter(self._servers(data, refusal)), "")},
            "service_providers": lambda data, refusal: {"providers": self._servers(data, refusal)},
            "action_servers": lambda _, refusal: {"action_servers": list(self._known(Use.ACTION, refusal))},
            "action_type": partial(self._type, Use.ACTION, "action", action_type),
            "nodes": lambda *_: {"nodes": list(self._nodes())},
            "node_details": self._node_details,
            "interfaces": self._interfaces,
            **{name: partial(_details, *what) for name, what in _DETAILS.items()},
        }
        self._later: Mapping[str, Callable[[Data, Done], None]] = {
            "get_param": self._get_param,
            "has_param": self._has_param,
            "get_param_names": self._get_param_names,
            "set_param": _refuse_change,
            "delete_param": _refuse_change,
        }
        #: What can be asked.
        self.questions = frozenset({*self._questions, *self._later})

    def answer(self, question: str, data: Any, refusal: UseRefusal, done: Done) -> None:
        """Answer a query: `done` gets the fields of the response, or `CallFailed`."""
        try:
            if not isinstance(data, Mapping):
                raise ValueError("its request is an object of fields")
            if question in self._later:
                self._later[question](data, done)
            else:
                done(self._questions[question](data, refusal))
        except (ValueError, NotCarried, NodeNameNonExistentError) as problem:
            done(CallFailed(f"/rosapi/{question}: {problem}"))

    def _get_time(self, *_: Any) -> dict[str, Any]:
        stamp = self._ros.stamp()
        return {"time": {"sec": stamp.sec, "nanosec": stamp.nanosec}}

    def _seen(self, found: list[tuple[str, list[str]]]) -> dict[str, str]:
        """Return names with their types, without the hidden ones of actions, as ROS's tools do."""
        return {
            own: kinds[0] for name, kinds in sorted(found) if "/_" not in name and (own := self._own(name))
        }

    def _own(self, name: str) -> str:
        """Return a name as pages write it; '' for one of another namespace."""
        space = self._ros.namespace
        if name in COMMON_NAMES or name.startswith(f"{space}/"):
            return name.removeprefix(space)
        return ""

    # -- topics, services and actions ---------------------------------------------------------------------

    def _known(self, use: Use, refusal: UseRefusal) -> dict[str, str]:
        """Return the topics, services or actions that the client may use so, each with its type."""
        node = self._ros.node
        topics = use is Use.SUBSCRIBE
        found = node.get_topic_names_and_types() if topics else node.get_service_names_and_types()
        if use is Use.ACTION:
            names = (self._own(name) for name, _ in found)
            goals = sorted(name.removesuffix(_GOALS) for name in names if name.endswith(_GOALS))
            kinds = {name: action_type(self._ros, name) for name in goals if not refusal(use, name)}
            return {name: kind for name, kind in kinds.items() if kind}
        return {name: kind for name, kind in self._seen(found).items() if not refusal(use, name)}

    def _topics(self, _: Data, refusal: UseRefusal) -> dict[str, Any]:
        found = self._known(Use.SUBSCRIBE, refusal)
        return {"topics": list(found), "types": list(found.values())}

    def _type(
        self, use: Use, key: str, find: Callable[[RosNode, str], str], data: Data, refusal: UseRefusal
    ) -> dict[str, Any]:
        return {"type": find(self._ros, _name(data, key, use, refusal))}

    def _for_type(self, use: Use, key: str, kind: str, data: Data, refusal: UseRefusal) -> dict[str, Any]:
        wanted = full_type(_text(data, "type"), kind)
        return {key: [name for name, type_ in self._known(use, refusal).items() if type_ == wanted]}

    def _topic_nodes(self, end: str, data: Data, refusal: UseRefusal) -> dict[str, Any]:
        node, topic = self._ros.node, _name(data, "topic", Use.SUBSCRIBE, refusal)
        publishes = end == "publishers"
        ask = node.get_publishers_info_by_topic if publishes else node.get_subscriptions_info_by_topic
        return {end: _nodes_of(ask(self._ros.full(topic)))}

    def _servers(self, data: Data, refusal: UseRefusal) -> list[str]:
        return _nodes_of(service_servers(self._ros, _name(data, "service", Use.CALL, refusal)))

    def _interfaces(self, _: Data, refusal: UseRefusal) -> dict[str, Any]:
        """Return the types in use of what the client may know."""
        uses = (Use.SUBSCRIBE, Use.CALL, Use.ACTION)
        return {"interfaces": sorted({kind for use in uses for kind in self._known(use, refusal).values()})}

    # -- nodes --------------------------------------------------------------------------------------------

    def _nodes(self) -> dict[str, tuple[str, str]]:
        """Return the nodes of the gateway's namespace by their full names, with name and namespace."""
        pairs = sorted(set(self._ros.node.get_node_names_and_namespaces()))
        nodes = {f"{namespace.rstrip('/')}/{name}": (name, namespace) for name, namespace in pairs}
        return {full: each for full, each in nodes.items() if self._own(full)}

    def _node_details(self, data: Data, refusal: UseRefusal) -> dict[str, Any]:
        node, nodes = _absolute(_text(data, "node")), self._nodes()
        if node not in nodes:
            raise ValueError(f"there is no node {node}; {nearest(node, nodes)}")
        of = self._ros.node
        ends = {
            "subscribing": (of.get_subscriber_names_and_types_by_node, Use.SUBSCRIBE),
            "publishing": (of.get_publisher_names_and_types_by_node, Use.SUBSCRIBE),
            "services": (of.get_service_names_and_types_by_node, Use.CALL),
        }
        return {
            end: sorted({self._own(name) for name, _ in ask(*nodes[node])} & self._known(use, refusal).keys())
            for end, (ask, use) in ends.items()
        }

    # -- parameters ---------------------------------------------------------------------------------------

    def _get_param(self, data: Data, done: Done) -> None:
        node, parameter = _parameter(data)

        def done_with(answer: Any) -> None:
            values = [] if isinstance(answer, CallFailed) else answer["values"]
            field = _VALUES.get(values[0]["type"]) if values else None
            if field is not None:
                done({"value": as_json(values[0][field]).decode(), "successful": True, "reason": ""})
                return
            reason = (
                answer.text if isinstance(answer, CallFailed) else f"{node} has no parameter {parameter!r}"
            )
            done({"value": data.get("default_value", ""), "successful": False, "reason": reason})

        self._ask_node(node, "get_parameters", {"names": [parameter]}, done_with)

    def _has_param(self, data: Data, done: Done) -> None:
        self._get_param(data, lambda answer: done({"exists": answer["successful"]}))

    def _get_param_names(self, _: Data, done: Done) -> None:
        """Ask all nodes; those that do not answer have none."""
        found: list[str] = []
        waiting = set(self._nodes())

        def answered(node: str, answer: Any) -> None:
            waiting.discard(node)
            names = [] if isinstance(answer, CallFailed) else answer["result"]["names"]
            found.extend(f"{node}:{name}" for name in names)
            if not waiting:
                done({"names": sorted(found)})

        for node in sorted(waiting):
            self._ask_node(node, "list_parameters", {}, partial(answered, node))

    def _ask_node(self, node: str, service: str, request: Data, done: Done) -> None:
        own = self._own(_absolute(node)) or _absolute(node)
        self._services.call(f"{own}/{service}", request, PARAMETER_WITHIN_S, done)


def _refuse_change(*_: Any) -> None:
    raise ValueError(_NO_CHANGE)


def _nodes_of(ends: Iterable[Any]) -> list[str]:
    """Return the full names of the nodes at the ends of a channel."""
    found = {f"{each.node_namespace.rstrip('/')}/{each.node_name}" for each in ends}
    return sorted(name for name in found if not name.endswith("_NODE_NAME_UNKNOWN_"))


def _topic_type(ros: RosNode, topic: str) -> str:
    return next(iter(topic_types(ros, topic)), "")


def _parameter(data: Data) -> tuple[str, str]:
    node, _, parameter = _text(data, "name").partition(":")
    if not parameter:
        raise ValueError("'name' is written NODE:PARAMETER, such as /lupin_twin:frame_id")
    return node, parameter


def _text(data: Data, key: str) -> str:
    value = data.get(key)
    if not isinstance(value, str) or not value:
        raise ValueError(f"{key!r} must be a text")
    return value


def _name(data: Data, key: str, use: Use, refusal: UseRefusal) -> str:
    """Return an absolute name; ValueError where the client may not know of it."""
    name = _absolute(_text(data, key))
    if refused := refusal(use, name):
        raise ValueError(refused)
    return name


def _absolute(name: str) -> str:
    return name if name.startswith("/") else f"/{name}"


def _details(kind: str, part: str, data: Data, _: UseRefusal) -> dict[str, Any]:
    """Return the definition of a message or a part, and of all types that it contains."""
    definitions: dict[str, dict[str, Any]] = {}
    _describe(types.shape(full_type(_text(data, "type"), kind), part), definitions)
    return {"typedefs": list(definitions.values())}


def _describe(shape: MessageShape, definitions: dict[str, dict[str, Any]]) -> None:
    if shape.name in definitions:
        return
    constants = _constants(shape.make)
    described: dict[str, Any] = {
        "type": _short(shape.name), "fieldnames": [], "fieldtypes": [], "fieldarraylen": [], "examples": [],
        "constnames": list(constants), "constvalues": [str(value) for value in constants.values()],
    }  # fmt: skip
    definitions[shape.name] = described
    for name, kind in shape.fields.items():
        of = kind.of if isinstance(kind, Listed) else kind
        described["fieldnames"].append(name)
        described["fieldtypes"].append(
            _short(of.name) if isinstance(of, MessageShape) else _WRITTEN.get(of, of)
        )
        described["fieldarraylen"].append((kind.length or 0) if isinstance(kind, Listed) else -1)
        described["examples"].append(_example(kind))
        if isinstance(of, MessageShape):
            _describe(of, definitions)


def _short(name: str) -> str:
    package, _, local = name.split("/")
    return f"{package}/{local.replace('.', '_')}"


def _example(kind: str | Listed | MessageShape) -> str:
    if isinstance(kind, Listed):
        return "[]"
    if isinstance(kind, MessageShape):
        return "{}"
    return {TEXT: "", "boolean": "false", "float": "0.0", "double": "0.0"}.get(kind, "0")


def _constants(kind: Any) -> dict[str, Any]:
    """Return the constants of a generated class: its metaclass prepares them, beside the defaults."""
    prepared = type(kind).__prepare__("", ())
    return {name: value for name, value in prepared.items() if not name.endswith("__DEFAULT")}
