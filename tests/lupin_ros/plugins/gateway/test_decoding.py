"""Serialized messages are read as rclpy reads them, whatever stands in them."""

from __future__ import annotations

import contextlib
import importlib
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.serialization import serialize_message

from lupin_gateway.encoding import as_cbor, as_json
from lupin_gateway.filling import filled
from lupin_gateway.node import types
from lupin_gateway.shapes import BYTES, NUMBERS, TEXT, Listed, MessageShape, NotCarried

#: With nested structures, texts between numbers, lists of all kinds, and arrays of fixed length.
TYPES = [
    *("lupin_msgs/msg/TwinState", "lupin_msgs/msg/Observation", "lupin_msgs/msg/MissionState"),
    *("nav_msgs/msg/OccupancyGrid", "nav_msgs/msg/Path", "nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage"),
    *("sensor_msgs/msg/JointState", "sensor_msgs/msg/BatteryState", "sensor_msgs/msg/CameraInfo"),
    *(
        "sensor_msgs/msg/LaserScan",
        "sensor_msgs/msg/Imu",
        "sensor_msgs/msg/PointCloud2",
        "sensor_msgs/msg/Joy",
    ),
    *("rcl_interfaces/msg/ParameterEvent", "rcl_interfaces/msg/ParameterDescriptor", "std_msgs/msg/Empty"),
    *("action_msgs/msg/GoalStatusArray", "diagnostic_msgs/msg/DiagnosticArray", "std_msgs/msg/Byte"),
    *("std_msgs/msg/Int64MultiArray", "std_msgs/msg/UInt16MultiArray", "std_msgs/msg/ByteMultiArray"),
    *("shape_msgs/msg/SolidPrimitive", "rcl_interfaces/msg/Log", "trajectory_msgs/msg/JointTrajectory"),
]
INSTALLED = [name for name in TYPES if importlib.util.find_spec(name.split("/")[0]) is not None]


def values_of(kind: str | Listed | MessageShape) -> st.SearchStrategy[Any]:
    """Anything that fits a field."""
    if isinstance(kind, MessageShape):
        fields = {name: values_of(field) for name, field in kind.fields.items()}
        return st.fixed_dictionaries({}, optional=fields)
    if isinstance(kind, Listed):
        least, most = (kind.length, kind.length) if kind.length is not None else (0, min(3, kind.most or 3))
        return st.lists(values_of(kind.of), min_size=least, max_size=most)
    if kind == TEXT:
        return st.text(st.characters(blacklist_categories=["Cs"], blacklist_characters="\0"), max_size=5)
    if kind == "boolean":
        return st.booleans()
    if kind in ("float", "double"):
        return st.floats(width=32 if kind == "float" else 64)
    info = np.iinfo(np.dtype(NUMBERS[kind][1]))
    return st.integers(int(info.min), int(info.max))


def expected(kind: str | Listed | MessageShape, value: Any) -> Any:
    """What rclpy's message says, in dictionaries and lists."""
    if isinstance(kind, MessageShape):
        return {name: expected(field, getattr(value, name)) for name, field in kind.fields.items()}
    if isinstance(kind, Listed):
        elements = [expected(kind.of, each) for each in value]
        return bytes(elements) if kind.of in BYTES else elements
    return value[0] if isinstance(value, bytes) else value


def same(one: Any, other: Any) -> bool:
    """Compare, with arrays of numpy and NaN."""
    if isinstance(one, dict):
        return list(one) == list(other) and all(same(one[key], other[key]) for key in one)
    if isinstance(one, (list, np.ndarray)):
        return len(one) == len(other) and all(map(same, one, other))
    is_nan = isinstance(one, (float, np.floating)) and math.isnan(one)
    return bool(one == other) or (is_nan and math.isnan(other))


@pytest.mark.parametrize("name", INSTALLED)
def test_what_is_filled_serialized_and_read_is_the_same(name: str) -> None:
    """From a page to rclpy's message, to bytes, to plain data, to JSON and CBOR."""
    shape = types.shape(name)

    @settings(max_examples=25)
    @given(values_of(shape))
    def check(data: dict[str, Any]) -> None:
        message = filled(shape, data)
        found = types.decode(name)(serialize_message(message))
        assert same(found, expected(shape, message))
        assert as_json(found)
        assert as_cbor(found)

    check()


@pytest.mark.parametrize("name", ["lupin_msgs/msg/Observation", "nav_msgs/msg/Path", "std_msgs/msg/Empty"])
def test_what_is_no_such_message_is_told(name: str) -> None:
    """Bytes that end early or say anything raise nothing else, and take no time."""
    whole = serialize_message(filled(types.shape(name), {}))

    @given(st.integers(0, len(whole)), st.binary(max_size=40))
    def check(cut: int, rest: bytes) -> None:
        read_or_told(types.decode(name), whole[:cut] + rest)

    check()
    read_or_told(types.decode(name), whole[:4] + b"\xff" * 400)


def read_or_told(decode: Callable[[bytes], Any], serialized: bytes) -> None:
    """Read bytes, which may be refused."""
    with contextlib.suppress(NotCarried):
        decode(serialized)


def test_types_that_are_not_there_are_named() -> None:
    """With the name that a page gave."""
    with pytest.raises(NotCarried, match=r"^type nowhere_msgs/msg/Nothing is not installed where the"):
        types.shape("nowhere_msgs/msg/Nothing")
