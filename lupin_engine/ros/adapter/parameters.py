"""Declared parameters as ROS parameters: type, default, range and documentation in both directions.

ROS knows bool, integer, double, string and flat lists of them. A record of numbers (a pose) travels as the
list of its fields in their order, metres and radians; an empty list stands for a record that is not given.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.parameter import Parameter as RosParameter

from lupin_engine.errors import LupinError, PluginError
from lupin_engine.plugin.contract import Parameter
from lupin_engine.plugin.parameters import named, narrowed, sorted_out
from lupin_engine.plugin.types import Type

_ROS_TYPES = {
    "bool": RosParameter.Type.BOOL,
    "integer": RosParameter.Type.INTEGER,
    "number": RosParameter.Type.DOUBLE,
    "text": RosParameter.Type.STRING,
}
_ROS_LIST_TYPES = {
    "bool": RosParameter.Type.BOOL_ARRAY,
    "integer": RosParameter.Type.INTEGER_ARRAY,
    "number": RosParameter.Type.DOUBLE_ARRAY,
    "text": RosParameter.Type.STRING_ARRAY,
}


def ros_type(name: str, kind: Type) -> RosParameter.Type:
    """Return the ROS type that carries `kind`.

    Raises:
        PluginError: ROS has no parameter type for it.
    """
    if kind.kind == "record" and all(f.kind == "number" for f in kind.fields.values()):
        return RosParameter.Type.DOUBLE_ARRAY
    if kind.kind == "list" and kind.item is not None and kind.item.kind in _ROS_LIST_TYPES:
        return _ROS_LIST_TYPES[kind.item.kind]
    if kind.kind in _ROS_TYPES:
        return _ROS_TYPES[kind.kind]
    raise PluginError(f"parameter {name!r}: type {kind} cannot be a ROS parameter")


def descriptor(spec: Parameter) -> ParameterDescriptor:
    """Return what `ros2 param describe` shows: documentation, unit and range or choice."""
    kind, unit = spec.type, _unit(spec.type)
    described = ParameterDescriptor(description=f"{spec.doc} [{unit}]" if unit else spec.doc)
    if kind.values:
        described.additional_constraints = f"one of {', '.join(kind.values)}"
    low, high = narrowed(spec).minimum, narrowed(spec).maximum
    if low is None and high is None:
        return described
    if kind.kind == "integer":
        # The whole range of int64 stands for "no limit": IntegerRange has no infinity.
        from_value = -(2**63) if low is None else math.ceil(low)
        to_value = 2**63 - 1 if high is None else math.floor(high)
        described.integer_range = [IntegerRange(from_value=from_value, to_value=to_value, step=0)]
    elif kind.kind == "number":
        from_float = -math.inf if low is None else float(low)
        to_float = math.inf if high is None else float(high)
        described.floating_point_range = [
            FloatingPointRange(from_value=from_float, to_value=to_float, step=0.0)
        ]
    return described


def _unit(kind: Type) -> str:
    """Return what the numbers are in; of a record, which travels as a list, field by field."""
    fields = (f"{name} {field.unit}".rstrip() for name, field in kind.fields.items())
    return ", ".join(fields) if kind.kind == "record" else kind.unit


def read(name: str, spec: Parameter, value: Any) -> Any:
    """Return what ROS delivered for `spec` as plain checked data in base units.

    Integers are taken for numbers, `60 s` in text for a number with that unit, a list of three numbers for
    a pose; None or an empty list mean "not given" where the default is None.

    Raises:
        ValueError: wrong type or out of range; the text names parameter, value and what is allowed.
    """
    if spec.default is None and _is_nothing(spec, value):
        return None
    try:
        return named(name, spec, _unpacked(spec.type, value))
    except ValueError as error:
        raise ValueError(f"{error}{_hint(spec.type, value)}") from None


def to_ros(name: str, spec: Parameter, value: Any) -> RosParameter:
    """Return checked data as a ROS parameter.

    The type is always said: rclpy takes an empty list for a byte array.
    """
    kind = ros_type(name, spec.type)
    if isinstance(value, Mapping):
        value = [float(value[field]) for field in spec.type.fields]
    elif value is None and spec.type.kind in ("record", "list"):
        value = []
    if value is None:
        return RosParameter(name, RosParameter.Type.NOT_SET, None)
    return RosParameter(name, kind, value)


def starting_values(specs: Mapping[str, Parameter], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the value of every parameter: the given one where there is one, else the default.

    Raises:
        LupinError: some given values cannot be used; the text lists all of them, one a line.
    """
    wanted = {name: given.get(name, spec.default) for name, spec in specs.items()}
    values, problems = sorted_out(specs, wanted, read)
    if problems:
        raise LupinError("\n".join(problems))
    return values


def _is_nothing(spec: Parameter, value: Any) -> bool:
    # rcl hands over `[]` from the command line as "not set".
    return value is None or (spec.type.kind in ("record", "list") and _plain(value) == [])


def _unpacked(kind: Type, value: Any) -> Any:
    if kind.kind == "list":
        return [] if value is None else _plain(value)
    if kind.kind == "record" and not isinstance(value, Mapping):
        parts = _plain(value)
        if isinstance(parts, list) and len(parts) == len(kind.fields):
            return dict(zip(kind.fields, parts, strict=True))
    return value


def _plain(value: Any) -> Any:
    # rclpy delivers lists as array.array of the C type.
    return value if isinstance(value, str) or not hasattr(value, "__iter__") else list(value)


def _hint(kind: Type, value: Any) -> str:
    if kind.kind == "record":
        return f"; give it as [{', '.join(kind.fields)}]"
    wants_text = kind.kind == "text" or (kind.item is not None and kind.item.kind == "text")
    if wants_text and not isinstance(value, str):
        given = _plain(value)
        if kind.kind == "list":
            given = [str(v) for v in given] if isinstance(given, list) else [str(given)]
        return f"; write {json.dumps(given if kind.kind == 'list' else str(given))}"
    if kind.kind == "list" and isinstance(value, (str, int, float)):
        return f"; write [{value}]"
    return ""
