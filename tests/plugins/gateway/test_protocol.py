"""Frames of rosbridge's protocol: each becomes an operation, or a problem in words; nothing raises."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from lupin_gateway.protocol import (
    Advertise,
    BadFrame,
    CallService,
    CancelGoalById,
    PublishMessage,
    SendGoal,
    SetLevel,
    SubscribeTopic,
    Unadvertise,
    UnsubscribeTopic,
    full_type,
    parse,
)

FRAMES = [
    ({"op": "subscribe", "topic": "/a"}, SubscribeTopic("/a")),
    (
        {
            "op": "subscribe", "id": "s", "topic": "a/b", "type": "std_msgs/String",
            "compression": "cbor-raw", "throttle_rate": 200, "queue_length": 5,
        },
        SubscribeTopic("/a/b", "std_msgs/msg/String", "s", "cbor-raw", 0.2, 5),
    ),
    ({"op": "unsubscribe", "topic": "/a", "id": None}, UnsubscribeTopic("/a")),
    (
        {"op": "advertise", "topic": "/a", "type": "std_msgs/msg/Bool", "latch": True, "queue_size": 100},
        Advertise("/a", "std_msgs/msg/Bool", None, latch=True),
    ),
    ({"op": "unadvertise", "topic": "/a", "id": "x"}, Unadvertise("/a", "x")),
    ({"op": "publish", "topic": "/a", "msg": {"data": 1}, "latch": False}, PublishMessage("/a", {"data": 1})),
    ({"op": "publish", "topic": "/a"}, PublishMessage("/a", {})),
    ({"op": "call_service", "service": "rosapi/topics"}, CallService("/rosapi/topics")),
    (
        {"op": "call_service", "service": "/a", "type": "no type", "args": [1], "timeout": 2, "id": "c"},
        CallService("/a", [1], "no type", "c", 2.0),
    ),
    ({"op": "call_service", "service": "/a", "timeout": -1}, CallService("/a")),
    (
        {
            "op": "send_action_goal", "id": "g", "action": "/go", "action_type": "nav2_msgs/NavigateToPose",
            "args": {}, "feedback": True,
        },
        SendGoal("/go", "nav2_msgs/action/NavigateToPose", "g", {}, feedback=True),
    ),
    ({"op": "cancel_action_goal", "id": "g", "action": "/go"}, CancelGoalById("/go", "g")),
    ({"op": "set_level", "level": "error"}, SetLevel("error")),
]  # fmt: skip


@pytest.mark.parametrize(("frame", "operation"), FRAMES)
def test_frames_are_read(frame: dict[str, Any], operation: object) -> None:
    """Fields that an operation does not have are ignored, null is absent, names begin at the root."""
    assert parse(json.dumps(frame)) == operation


BAD = [
    (b"\x00", "binary frames are not understood: send JSON as text"),
    ("[]", "a frame is a JSON object with an op, not a list"),
    ("{}", 'a frame needs an "op", a text such as "subscribe"'),
    ({"op": "subscrib"}, "unknown operation 'subscrib'; did you mean 'subscribe'?"),
    ({"op": "fragment", "data": "x"}, "fragments are not offered: send a message in one frame"),
    (
        {"op": "png", "data": "x"},
        "png is not offered: frames are not compressed as images; use cbor or cbor-raw",
    ),
    ({"op": "advertise_service", "service": "/a"}, "pages do not serve services: let a ROS node do it"),
    ({"op": "subscribe"}, "subscribe: 'topic' must be a text, not nothing"),
    (
        {"op": "subscribe", "topic": "a b"},
        "subscribe: 'topic' is 'a b', which is no name of ROS such as /mission/state",
    ),
    ({"op": "subscribe", "topic": "/" + "a" * 260}, "subscribe: 'topic' is longer than 200 characters"),
    (
        {"op": "subscribe", "topic": "/a", "type": "String"},
        "subscribe: 'type': 'String' is no type such as std_msgs/msg/String",
    ),
    (
        {"op": "subscribe", "topic": "/a", "compression": "png"},
        "subscribe: png is not offered: frames are not compressed as images; use cbor or cbor-raw",
    ),
    (
        {"op": "subscribe", "topic": "/a", "compression": "cbro"},
        "subscribe: 'compression' is 'cbro'; did you mean 'cbor'?",
    ),
    (
        {"op": "subscribe", "topic": "/a", "fragment_size": 1000},
        "subscribe: 'fragment_size' is not offered: every message comes in one frame",
    ),
    (
        {"op": "subscribe", "topic": "/a", "throttle_rate": -1},
        "subscribe: 'throttle_rate' must be a number from 0 to 8.64e+07, not -1",
    ),
    (
        {"op": "subscribe", "topic": "/a", "queue_length": "5"},
        "subscribe: 'queue_length' must be a number from 0 to 10000, not a text",
    ),
    ({"op": "advertise", "topic": "/a"}, "advertise: 'type' must be a text, not nothing"),
    (
        {"op": "advertise", "topic": "/a", "type": "std_msgs/Bool", "latch": 1},
        "advertise: 'latch' must be true or false, not a number",
    ),
    ({"op": "send_action_goal", "action": "/a"}, "send_action_goal: 'id' must be a text, not nothing"),
    ({"op": "set_level", "level": "warn"}, "set_level: 'level' is 'warn'; did you mean 'warning'?"),
]


@pytest.mark.parametrize(("frame", "text"), BAD)
def test_bad_frames_are_told(frame: Any, text: str) -> None:
    """In words, and with what is meant instead."""
    bad = parse(frame if isinstance(frame, (str, bytes)) else json.dumps(frame))
    assert isinstance(bad, BadFrame)
    assert bad.text == text


def test_what_is_no_json_is_told_with_the_place() -> None:
    """The rest of the sentence is the parser's."""
    bad = parse('{"op": NaN}')
    assert isinstance(bad, BadFrame)
    assert bad.text.startswith("this frame is not JSON: ")
    assert "line 1 column 8" in bad.text


def test_a_bad_call_can_be_answered() -> None:
    """A page that waits for the answer of a call gets one."""
    bad = parse('{"op": "call_service", "service": "a b", "id": "7"}')
    assert isinstance(bad, BadFrame)
    assert (bad.id, bad.operation, bad.name) == ("7", "call_service", "a b")


def test_the_id_of_a_long_name_is_kept() -> None:
    """Libraries make ids of names."""
    name = "/" + "a" * 199
    id_ = f"call_service:{name}:{'0' * 36}"
    found = parse(json.dumps({"op": "call_service", "service": name, "id": id_}))
    assert isinstance(found, CallService)


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=8,
)
OPERATIONS = sorted({frame["op"] for frame, _ in FRAMES} | {"fragment", "png", "auth", "action_result"})
KEYS = ["topic", "service", "action", "type", "id", "args", "msg", "compression", "throttle_rate", "timeout"]
KEYS += ["queue_length", "latch", "feedback", "level", "action_type", "fragment_size"]
NAMES = st.sampled_from(["/a", "a/b", "", "/", "//", "~a", "/a b", "std_msgs/String", "cbor", "info"])


@given(st.binary() | st.text())
@example("[" * 100_000)
@example('"\\ud800"')
@example("9" * 5000)
def test_no_bytes_raise(frame: str | bytes) -> None:
    """What is no frame is told to be none."""
    assert isinstance(parse(frame), BadFrame)


@given(
    st.sampled_from(OPERATIONS) | st.text(),
    st.dictionaries(st.sampled_from(KEYS), NAMES | ANYTHING),
)
def test_no_field_raises(operation: str, fields: dict[str, Any]) -> None:
    """Whatever stands in the fields of whatever operation."""
    found = parse(json.dumps({"op": operation, **fields}))
    if isinstance(found, BadFrame):
        assert found.text
        assert len(found.text) < 1000
    else:
        assert operation in OPERATIONS


@given(st.text())
def test_a_type_is_read_or_refused(name: str) -> None:
    """`std_msgs/String` and `std_msgs/msg/String` are one type; nothing but ValueError comes."""
    try:
        found = full_type(name, "msg")
    except ValueError:
        return
    assert found == "" or found.split("/")[1] == "msg"


def test_a_frame_of_nothing_but_lists() -> None:
    """It is not even read; as many numbers are no trouble."""
    assert parse("[" + "[]," * 10_000 + "0]") == BadFrame("a frame has at most 10000 lists and objects")
    numbers = '{"op": "publish", "topic": "/x", "msg": {"data": [' + "1," * 400_000 + "1]}}"
    assert isinstance(parse(numbers), PublishMessage)
