"""Parses the frames of rosbridge's protocol, version 2, to operations; `BadFrame` where that fails.

Unknown fields are ignored, as in rosbridge: client libraries send more than they need.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, cast

import orjson

from lupin_engine.errors import nearest
from lupin_gateway.encoding import Compression

#: The longest text in a frame, in characters, and the longest name: the middleware adds to it, up to 255.
LONGEST, LONGEST_NAME = 1000, 200
#: How many lists and objects a frame may have: a third of a million empty ones keep all pages waiting.
MOST_LISTS = 10_000


@dataclass(frozen=True)
class BadFrame:
    """A frame that cannot be parsed, or is not offered: why, with id and operation if known."""

    text: str
    id: str | None = None
    operation: str = ""
    #: The service or action that it was about.
    name: str = ""


@dataclass(frozen=True)
class SubscribeTopic:
    """Subscribe to a topic; `throttle` in seconds between two, `queue` as asked (0: the default)."""

    topic: str
    type: str = ""
    id: str | None = None
    compression: Compression = "none"
    throttle: float = 0.0
    queue: int = 0


@dataclass(frozen=True)
class UnsubscribeTopic:
    """Unsubscribe; without an id, from all of this client's subscriptions to the topic."""

    topic: str
    id: str | None = None


@dataclass(frozen=True)
class Advertise:
    """Prepare to publish."""

    topic: str
    type: str
    id: str | None = None
    latch: bool = False


@dataclass(frozen=True)
class Unadvertise:
    """Publish no more."""

    topic: str
    id: str | None = None


@dataclass(frozen=True)
class PublishMessage:
    """Publish a message."""

    topic: str
    message: Any
    id: str | None = None


@dataclass(frozen=True)
class CallService:
    """Call a service; `timeout` is the client's limit in seconds, 0 for the gateway's."""

    service: str
    arguments: Any = field(default_factory=dict)
    type: str = ""
    id: str | None = None
    timeout: float = 0.0


@dataclass(frozen=True)
class SendGoal:
    """Send a goal to an action server, under the id of the frame."""

    action: str
    type: str
    id: str
    arguments: Any = field(default_factory=dict)
    feedback: bool = False


@dataclass(frozen=True)
class CancelGoalById:
    """Cancel the goal that was sent with this id."""

    action: str
    id: str


@dataclass(frozen=True)
class SetLevel:
    """Send only status frames of this level and worse."""

    level: str
    id: str | None = None


Operation = (
    SubscribeTopic
    | UnsubscribeTopic
    | Advertise
    | Unadvertise
    | PublishMessage
    | CallService
    | SendGoal
    | CancelGoalById
    | SetLevel
)

#: Status levels, most severe first.
LEVELS = ("none", "error", "warning", "info")

_NAME = re.compile(r"/?[A-Za-z_]\w*(?:/[A-Za-z_]\w*)*\Z", re.ASCII)
_TYPE = re.compile(r"([A-Za-z]\w*)/(?:(msg|srv|action)/)?([A-Za-z]\w*)\Z", re.ASCII)

#: Operations that are known, and not offered: why, and what to do instead.
_REFUSED = {
    "fragment": "fragments are not offered: send a message in one frame",
    "png": "png is not offered: frames are not compressed as images; use cbor or cbor-raw",
    "auth": "auth is not offered: a page proves who it is when it connects",
    "advertise_service": "pages do not serve services: let a ROS node do it",
    "unadvertise_service": "pages do not serve services: let a ROS node do it",
    "service_response": "pages do not serve services: let a ROS node do it",
    "advertise_action": "pages do not serve actions: let a ROS node do it",
    "unadvertise_action": "pages do not serve actions: let a ROS node do it",
    "action_feedback": "pages do not serve actions: let a ROS node do it",
    "action_result": "pages do not serve actions: let a ROS node do it",
}


class _WrongField(Exception):
    """A field that is not as it must be."""


def parse(frame: str | bytes) -> Operation | BadFrame:
    """Return the operation of a frame, or its error as a `BadFrame`; never raises."""
    if isinstance(frame, bytes):
        return BadFrame("binary frames are not understood: send JSON as text")
    if frame.count("[") + frame.count("{") > MOST_LISTS:
        return BadFrame(f"a frame has at most {MOST_LISTS} lists and objects")
    try:
        data = orjson.loads(frame)
    except (ValueError, RecursionError) as problem:
        return BadFrame(f"this frame is not JSON: {problem}")
    if not isinstance(data, dict):
        return BadFrame(f"a frame is a JSON object with an op, not {_called(data)}")
    operation, about = data.get("op"), data.get("id")
    id_ = about if isinstance(about, str) and len(about) <= LONGEST else None
    if not isinstance(operation, str):
        return BadFrame('a frame needs an "op", a text such as "subscribe"', id_)
    if operation in _REFUSED:
        return BadFrame(_REFUSED[operation], id_, operation)
    if operation not in _READERS:
        known = nearest(operation[:LONGEST_NAME], _READERS)
        return BadFrame(f"unknown operation {operation[:LONGEST_NAME]!r}; {known}", id_)
    try:
        return _READERS[operation](_Fields(data))
    except _WrongField as wrong:
        name = data.get("service") or data.get("action")
        name = name if isinstance(name, str) else ""
        return BadFrame(f"{operation}: {wrong}", id_, operation, name[:LONGEST_NAME])


def full_type(name: str, kind: str) -> str:
    """Return a type with its kind (`msg`, `srv`, `action`), added where it is missing; '' stays.

    Raises:
        ValueError: it is no name of a type.
    """
    if not name:
        return ""
    found = _TYPE.match(name[:LONGEST_NAME])
    if found is None:
        raise ValueError(f"{name[:LONGEST_NAME]!r} is no type such as std_msgs/msg/String")
    return f"{found[1]}/{kind}/{found[3]}"


class _Fields:
    """The fields of a frame, each checked as it is read (else _WrongField); null is the same as absent."""

    def __init__(self, data: Mapping[str, Any]) -> None:
        self._data = data

    def text(self, key: str, default: str | None = None) -> str:
        value = self._data.get(key)
        if value is None and default is not None:
            return default
        if not isinstance(value, str):
            raise _WrongField(f"{key!r} must be a text, not {_called(value)}")
        if len(value) > LONGEST:
            raise _WrongField(f"{key!r} is longer than {LONGEST} characters")
        return value

    def id(self) -> str | None:
        """Return the frame's id; None without one."""
        return self.text("id") if self._data.get("id") is not None else None

    def name(self, key: str) -> str:
        """Return a name of ROS from the root: pages often leave out the first slash. Others: _WrongField."""
        name = self.text(key)
        if len(name) > LONGEST_NAME:
            raise _WrongField(f"{key!r} is longer than {LONGEST_NAME} characters")
        if not _NAME.match(name):
            raise _WrongField(f"{key!r} is {name!r}, which is no name of ROS such as /mission/state")
        return name if name.startswith("/") else f"/{name}"

    def type(self, key: str, kind: str, default: str | None = "") -> str:
        try:
            return full_type(self.text(key, default), kind)
        except ValueError as problem:
            raise _WrongField(f"{key!r}: {problem}") from None

    def number(self, key: str, largest: float) -> float:
        """Return a number from 0 to `largest`, 0 where it is absent; raises _WrongField for anything else."""
        value = self._data.get(key)
        if value is None:
            return 0.0
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 <= value <= largest:
            told = repr(value) if isinstance(value, (int, float)) else _called(value)
            raise _WrongField(f"{key!r} must be a number from 0 to {largest:g}, not {told}")
        return float(value)

    def flag(self, key: str) -> bool:
        value = self._data.get(key)
        if value is not None and not isinstance(value, bool):
            raise _WrongField(f"{key!r} must be true or false, not {_called(value)}")
        return bool(value)

    def any(self, key: str) -> Any:
        value = self._data.get(key)
        return {} if value is None else value

    def compression(self) -> Compression:
        asked = self.text("compression", "none")
        if asked == "png":
            raise _WrongField(_REFUSED["png"])
        if asked not in ("none", "cbor", "cbor-raw"):
            raise _WrongField(f"'compression' is {asked!r}; {nearest(asked, ('none', 'cbor', 'cbor-raw'))}")
        return cast(Compression, asked)


def _called(value: Any) -> str:
    """Return a value's JSON type for a message: the value itself may be long."""
    names = {dict: "an object", list: "a list", str: "a text", bool: "true or false", type(None): "nothing"}
    return names.get(type(value), "a number")


def _subscribe(fields: _Fields) -> SubscribeTopic:
    if fields.number("fragment_size", 1e12):
        raise _WrongField("'fragment_size' is not offered: every message comes in one frame")
    return SubscribeTopic(
        fields.name("topic"),
        fields.type("type", "msg"),
        fields.id(),
        fields.compression(),
        fields.number("throttle_rate", 86_400_000) / 1000.0,
        int(fields.number("queue_length", 10_000)),
    )


def _goal(fields: _Fields) -> SendGoal:
    return SendGoal(
        fields.name("action"),
        fields.type("action_type", "action"),
        fields.text("id"),
        fields.any("args"),
        fields.flag("feedback"),
    )


def _level(fields: _Fields) -> SetLevel:
    level = fields.text("level")
    if level not in LEVELS:
        raise _WrongField(f"'level' is {level!r}; {nearest(level, LEVELS)}")
    return SetLevel(level, fields.id())


def _call(fields: _Fields) -> CallService:
    if fields.number("fragment_size", 1e12):
        raise _WrongField("'fragment_size' is not offered: every answer comes in one frame")
    # A page calls /rosapi with types that no installation has; the call reports one that is no type at all.
    return CallService(
        fields.name("service"),
        fields.any("args"),
        fields.text("type", ""),
        fields.id(),
        _timeout(fields),
    )


def _timeout(fields: _Fields) -> float:
    """Return the client's limit; 0 where it is not positive, which roslib sends for "none"."""
    wanted = fields.any("timeout")
    is_none = isinstance(wanted, (int, float)) and wanted <= 0
    return 0.0 if is_none else fields.number("timeout", 86_400)


_READERS: Mapping[str, Callable[[_Fields], Operation]] = {
    "subscribe": _subscribe,
    "unsubscribe": lambda f: UnsubscribeTopic(f.name("topic"), f.id()),
    "advertise": lambda f: Advertise(f.name("topic"), f.type("type", "msg", None), f.id(), f.flag("latch")),
    "unadvertise": lambda f: Unadvertise(f.name("topic"), f.id()),
    "publish": lambda f: PublishMessage(f.name("topic"), f.any("msg"), f.id()),
    "call_service": _call,
    "send_action_goal": _goal,
    "cancel_action_goal": lambda f: CancelGoalById(f.name("action"), f.text("id")),
    "set_level": _level,
}
