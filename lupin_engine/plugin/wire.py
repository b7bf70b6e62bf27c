"""Maps messages of ROS to the language: times are seconds, a pose has a yaw, in radians.

Everything else on the wire is unchanged: numbers, texts, lists and messages inside of messages.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from lupin_engine.plugin.types import POSE, Type, parse_quantity

#: Messages that are a number of seconds to an expression.
TIMES = frozenset({"builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration"})
#: The message that is filled from a `pose`, and read as one.
POSE_MESSAGE = "geometry_msgs/msg/Pose"

#: A half turn has w = 0, which on the wire means that nobody has filled the orientation in; this is close
#: enough to it.
SMALLEST_W = 1e-9

_NANOSECONDS = 1_000_000_000


def time_fields(seconds: Any) -> dict[str, int]:
    """Return the fields of a time or duration; a text is a quantity such as '5 s'.

    Raises:
        ValueError: it is no number of seconds.
    """
    quantity = parse_quantity(seconds) if isinstance(seconds, str) else (seconds, "s")
    number = quantity[0] if quantity is not None and quantity[1] == "s" else None
    if isinstance(number, bool) or not isinstance(number, (int, float)) or not math.isfinite(number):
        raise ValueError(f"expected seconds, got {seconds!r}")
    whole = math.floor(number)
    carried, nanoseconds = divmod(round((number - whole) * _NANOSECONDS), _NANOSECONDS)
    return {"sec": whole + carried, "nanosec": nanoseconds}


def seconds_of(message: Any) -> float:
    """Return a Time or Duration as seconds."""
    return float(message.sec) + float(message.nanosec) / _NANOSECONDS


def pose_fields(pose: Mapping[str, float]) -> dict[str, dict[str, float]]:
    """Return the fields of the message for a place on the floor."""
    position = {"x": float(pose["x"]), "y": float(pose["y"])}
    return {"position": position, "orientation": turn_fields(pose["yaw"])}


def turn_fields(yaw: float) -> dict[str, float]:
    """Return the fields, other than 0, of the quaternion of a turn by `yaw` radians about the vertical."""
    return {"z": math.sin(yaw / 2.0), "w": math.cos(yaw / 2.0)}


def filled_in(w: float) -> float:
    """Return the w of an orientation that was filled in: never 0."""
    return w if abs(w) >= SMALLEST_W else math.copysign(SMALLEST_W, w)


def pose_from(value: Any, kind: Type) -> Any:
    """Return a message with a `pose` where one is wanted, and the fields of a record; else as it is."""
    if kind.item is not None and isinstance(value, list):
        return [pose_from(each, kind.item) for each in value]
    if not kind.fields or not isinstance(value, Mapping):
        return value
    if kind.name != POSE.name or "orientation" not in value:
        return {name: pose_from(value[name], of) for name, of in kind.fields.items() if name in value}
    position, turned = value["position"], value["orientation"]
    x, y, z, w = (turned[name] for name in "xyzw")
    # For a quaternion of any length, as `world.poses.heading` has it; neither room may know the other.
    yaw = math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)
    return {"x": position["x"], "y": position["y"], "yaw": yaw}


__all__ = [
    "POSE_MESSAGE",
    "SMALLEST_W",
    "TIMES",
    "filled_in",
    "pose_fields",
    "pose_from",
    "seconds_of",
    "time_fields",
    "turn_fields",
]
