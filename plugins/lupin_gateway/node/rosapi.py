"""Answers the services of `/rosapi/`: pages' queries about nodes, topics, services and parameters.

Names are those of the gateway's namespace, without it; nodes have their full names. Only the questions that
pages of this robot use are answered. Their types are not checked: pages have called `get_time` with a wrong
one for years, so only the name counts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from rcl_interfaces.msg import ParameterType

from lupin_engine.plugin import COMMON_NAMES
from lupin_gateway.encoding import as_json
from lupin_gateway.node import types
from lupin_gateway.node.calls import Services, action_type, service_type
from lupin_gateway.node.topics import topic_types
from lupin_gateway.ports import CallFailed
from lupin_gateway.protocol import full_type
from lupin_gateway.shapes import TEXT, Listed, MessageShape, NotCarried
from lupin_ros.adapter import RosNode

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

Done = Callable[[Any], None]


class Rosapi:
    """Answers queries; for the ROS thread."""

    def __init__(self, ros: RosNode, services: Services) -> None:
        self._ros = ros
        self._services = services
        self._questions: Mapping[str, Callable[[Mapping[str, Any]], dict[str, Any]]] = {
            "get_time": self._get_time,
            "topics": self._topics,
            "services": self._list_services,
            "nodes": self._nodes,
            "topic_type": lambda data: {"type": next(iter(topic_types(ros, _name(data, "topic"))), "")},
            "service_type": lambda data: {"type": service_type(ros, _name(data, "service"))},
            "action_servers": self._action_servers,
            "action_type": lambda data: {"type": action_type(ros, _name(data, "action"))},
            "message_details": _message_details,
        }
        #: What can be asked.
        self.questions = frozenset({*self._questions, "get_param"})

    def answer(self, question: str, data: Any, done: Done) -> None:
        """Answer a query: `done` gets the fields of the response, or `CallFailed`."""
        try:
            if not isinstance(data, Mapping):
                raise ValueError("its request is an object of fields")
            if question == "get_param":
                self._get_param(data, done)
            else:
                done(self._questions[question](data))
        except (ValueError, NotCarried) as problem:
            done(CallFailed(f"/rosapi/{question}: {problem}"))

    def _get_time(self, _: Mapping[str, Any]) -> dict[str, Any]:
        stamp = self._ros.stamp()
        return {"time": {"sec": stamp.sec, "nanosec": stamp.nanosec}}

    def _topics(self, _: Mapping[str, Any]) -> dict[str, Any]:
        found = self._seen(self._ros.node.get_topic_names_and_types())
        return {"topics": list(found), "types": list(found.values())}

    def _list_services(self, _: Mapping[str, Any]) -> dict[str, Any]:
        return {"services": list(self._seen(self._ros.node.get_service_names_and_types()))}

    def _nodes(self, _: Mapping[str, Any]) -> dict[str, Any]:
        pairs = self._ros.node.get_node_names_and_namespaces()
        nodes = (f"{namespace.rstrip('/')}/{name}" for name, namespace in pairs)
        return {"nodes": sorted({node for node in nodes if self._own(node)})}

    def _action_servers(self, _: Mapping[str, Any]) -> dict[str, Any]:
        names = (self._own(name) for name, _ in self._ros.node.get_service_names_and_types())
        ending = "/_action/send_goal"
        served = [name.removesuffix(ending) for name in names if name.endswith(ending)]
        return {"action_servers": sorted(name for name in served if action_type(self._ros, name))}

    def _get_param(self, data: Mapping[str, Any], done: Done) -> None:
        node, _, parameter = _text(data, "name").partition(":")
        if not parameter:
            raise ValueError("'name' is written NODE:PARAMETER, such as /lupin_twin:frame_id")

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

        service = f"{self._own(_absolute(node)) or _absolute(node)}/get_parameters"
        self._services.call(service, {"names": [parameter]}, PARAMETER_WITHIN_S, done_with)

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


def _text(data: Mapping[str, Any], key: str) -> str:
    value = data.get(key)
    if not isinstance(value, str) or not value:
        raise ValueError(f"{key!r} must be a text")
    return value


def _name(data: Mapping[str, Any], key: str) -> str:
    return _absolute(_text(data, key))


def _absolute(name: str) -> str:
    return name if name.startswith("/") else f"/{name}"


def _message_details(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return the definition of a message, and of all types that it contains."""
    definitions: dict[str, dict[str, Any]] = {}
    _describe(types.shape(full_type(_text(data, "type"), "msg")), definitions)
    return {"typedefs": list(definitions.values())}


def _describe(shape: MessageShape, definitions: dict[str, dict[str, Any]]) -> None:
    if shape.name in definitions:
        return
    constants = _constants(types.class_of(shape.name))
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
    return name.replace("/msg/", "/")


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
