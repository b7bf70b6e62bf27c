"""Frames as a page may send them: bad ones are told and harm nothing; subscriptions do as they are asked."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from typing import Any

import pytest
from rcl_interfaces.msg import ParameterDescriptor
from std_msgs.msg import Int32, String

from lupin_msgs.msg import Observation
from lupin_ros.adapter.node import Qos, RosNode
from tests.lupin_ros.plugins.gateway.page import Page

pytestmark = [pytest.mark.node, pytest.mark.timeout(120)]

VERSIONS = pytest.mark.parametrize("version", ["1", "2"])
OpenPage = Callable[..., Page]

BAD = [
    ("not JSON", "this frame is not JSON: "),
    ([1, 2], "a frame is a JSON object with an op, not a list"),
    ({"op": "subscrib", "topic": "/a"}, "unknown operation 'subscrib'; did you mean 'subscribe'?"),
    ({"op": "fragment", "id": "1", "data": "", "num": 0, "total": 2}, "fragments are not offered: "),
    ({"op": "png", "data": "iVBORw0KGgo="}, "png is not offered: "),
    ({"op": "subscribe", "topic": "/a", "compression": "png"}, "subscribe: png is not offered: "),
    ({"op": "subscribe", "topic": "/a", "fragment_size": 500}, "subscribe: 'fragment_size' is not offered"),
    ({"op": "publish", "topic": "/unknown", "msg": {}}, "/unknown: advertise it before the first message"),
    (
        {"op": "advertise", "topic": "/a", "type": "no_msgs/Type"},
        "/a: type no_msgs/msg/Type is not",
    ),
    ({"op": "publish", "topic": "/a", "msg": 5}, "/a: advertise it before the first message"),
    ({"op": "cancel_action_goal", "action": "/a", "id": "x"}, "/a: no goal with the id 'x' is under way"),
    ({"op": "call_service", "id": "1"}, "call_service: 'service' must be a text, not nothing"),
]


@pytest.mark.core
@VERSIONS
def test_bad_frames_are_told_and_the_connection_stays(
    version: str, gateway: Callable[..., str], page: OpenPage
) -> None:
    """A status for each, and afterwards all works."""
    one = page(gateway(), version=version)
    for frame, text in BAD:
        one.raw(frame if isinstance(frame, str) else json.dumps(frame))
        one.until(lambda t=text: any(each.startswith(t) for each in one.status()), text)
    assert len(one.status()) == len(BAD)
    assert one.call("/rosapi/get_time", "rosapi/GetTime", {})["time"]["sec"] > 1e9
    assert not one.of("close")


def test_a_page_chooses_how_much_it_is_told(gateway: Callable[..., str], page: OpenPage) -> None:
    """With `set_level`."""
    one = page(gateway())
    one.raw({"op": "set_level", "level": "none"})
    one.raw({"op": "unknown"})
    one.raw({"op": "set_level", "level": "error"})
    one.raw("[]")
    one.told("a frame is a JSON object with an op, not a list")
    assert len(one.status()) == 1


@VERSIONS
def test_two_subscriptions_of_a_page_are_one(
    version: str, gateway: Callable[..., str], page: OpenPage, make_node: Callable[..., RosNode]
) -> None:
    """Each message comes once, as long as one of them is left."""
    ros = make_node("robot")
    numbers = ros.publisher(Int32, "/numbers", Qos.LATCHED)
    numbers.publish(Int32(data=1))
    one = page(gateway(), ros, version=version)
    one.subscribe("/numbers", "std_msgs/Int32")
    one.until(lambda: one.messages("/numbers"), "the first one")
    one.raw({"op": "subscribe", "topic": "/numbers", "id": "other", "type": "std_msgs/msg/Int32"})
    one.raw({"op": "subscribe", "topic": "/numbers", "id": "wrong", "type": "std_msgs/msg/String"})
    one.told("/numbers is subscribed to as std_msgs/msg/Int32 already, not as std_msgs/msg/String")
    numbers.publish(Int32(data=2))
    one.until(lambda: len(one.messages("/numbers")) == 2, "the second one")
    one.raw({"op": "unsubscribe", "topic": "/numbers", "id": "other"})
    one.call("/rosapi/get_time", "", {})
    numbers.publish(Int32(data=3))
    one.until(lambda: len(one.messages("/numbers")) == 3, "the third one")
    one.do("unsubscribe", name="/numbers")
    one.call("/rosapi/get_time", "", {})
    numbers.publish(Int32(data=4))
    one.call("/rosapi/get_time", "", {})
    assert [each["data"] for each in one.messages("/numbers")] == [1, 2, 3]


@VERSIONS
def test_throttle_and_queue(
    version: str, gateway: Callable[..., str], page: OpenPage, make_node: Callable[..., RosNode]
) -> None:
    """One at once; then one each interval, the newest of those that came, and all of them from a queue."""
    ros = make_node("robot")
    numbers = ros.publisher(Int32, "/numbers", Qos.EVENT)
    url = gateway()
    newest, queued = page(url, ros, version=version), page(url, ros, version=version)
    newest.subscribe("/numbers", "std_msgs/Int32", throttle_rate=300)
    queued.subscribe("/numbers", "std_msgs/Int32", throttle_rate=50, queue_length=10)
    for each in (newest, queued):  # frames keep their order: after the answer it is subscribed
        each.call("/rosapi/get_time", "", {})
    newest.until(lambda: numbers.get_subscription_count() == 1, "the gateway")
    begin = time.monotonic()
    for number in range(6):
        numbers.publish(Int32(data=number))
    newest.until(lambda: len(newest.messages("/numbers")) == 2, "the first and the newest")
    assert time.monotonic() - begin > 0.25
    queued.until(lambda: len(queued.messages("/numbers")) == 6, "all of them")
    assert [each["data"] for each in newest.messages("/numbers")] == [0, 5]
    assert [each["data"] for each in queued.messages("/numbers")] == list(range(6))


@VERSIONS
def test_types_are_the_network_s(
    version: str, gateway: Callable[..., str], page: OpenPage, make_node: Callable[..., RosNode]
) -> None:
    """A wrong one is told, to subscribers and publishers; a missing one is found; a later node is heard."""
    ros = make_node("robot")
    words = ros.publisher(String, "/words", Qos.LATCHED)
    words.publish(String(data="hello"))
    url = gateway()
    wrong, right = page(url, ros, version=version), page(url, ros, version=version)
    wrong.subscribe("/words", "std_msgs/Int32")
    wrong.told("/words is of type std_msgs/msg/String, not std_msgs/msg/Int32")
    right.raw({"op": "subscribe", "topic": "words"})
    right.subscribe("/later", "std_msgs/Int32")
    right.do("subscribe", name="/words", type="std_msgs/String", options={})
    right.until(lambda: right.messages("/words") == [{"data": "hello"}], "the latched word")
    wrong.publish("/words", "std_msgs/Int32", {"data": 1})
    wrong.told("/words: it is of type std_msgs/msg/String, not std_msgs/msg/Int32")
    later = make_node("later").publisher(Int32, "/later", Qos.LATCHED)
    later.publish(Int32(data=7))
    right.until(lambda: right.messages("/later") == [{"data": 7}], "a node that came later")


@VERSIONS
def test_a_page_s_latched_topic(
    version: str, gateway: Callable[..., str], page: OpenPage, make_node: Callable[..., RosNode]
) -> None:
    """Who subscribes later hears the last message; pages of the same gateway do as well."""
    ros = make_node("robot")
    url = gateway()
    one = page(url, ros, version=version)
    one.publish("/chosen", "std_msgs/String", {"data": "tag 5"}, latch=True)
    one.call("/rosapi/get_time", "", {})
    heard: list[str] = []
    ros.subscribe(String, "/chosen", Qos.LATCHED, lambda message: heard.append(message.data))
    one.until(lambda: heard == ["tag 5"], "the latched message, later")
    other = page(url, ros, version=version)
    other.subscribe("/chosen", "std_msgs/String")
    other.until(lambda: other.messages("/chosen") == [{"data": "tag 5"}], "another page")


def test_a_topic_that_a_page_unadvertises(
    gateway: Callable[..., str], page: OpenPage, make_node: Callable[..., RosNode]
) -> None:
    """Its publisher stays while another page has it, and until what was said last has arrived."""
    ros = make_node("robot")
    heard: list[str] = []
    ros.subscribe(String, "/words", Qos.EVENT, lambda message: heard.append(message.data))
    url = gateway()
    one, other = page(url, ros), page(url, ros)
    for each in (one, other):
        each.publish("/words", "std_msgs/String", {"data": "hello"})
    one.until(lambda: len(heard) == 2, "both")
    one.do("unadvertise", name="/words")
    other.publish("/words", "std_msgs/String", {"data": "last"})
    other.do("unadvertise", name="/words")
    other.until(lambda: heard[-1] == "last", "the last one")
    other.until(lambda: ros.node.count_publishers("/words") == 0, "no publisher any more")


def test_a_publisher_that_is_volatile_after_all(
    gateway: Callable[..., str], page: OpenPage, make_node: Callable[..., RosNode]
) -> None:
    """Who demands the backlog hears nothing of publishers without one: both are heard, nothing twice."""
    ros = make_node("robot")
    first = ros.publisher(Observation, "/floranova/observations", Qos.BACKLOG)
    first.publish(Observation(mission_id="1"))
    url = gateway()
    one = page(url, ros)
    one.subscribe("/floranova/observations", "lupin_msgs/Observation")
    one.until(lambda: one.messages("/floranova/observations"), "the latched one")
    second = make_node("other").publisher(Observation, "/floranova/observations", Qos.EVENT)
    one.until(lambda: second.get_subscription_count(), "the gateway listens to the other one")
    second.publish(Observation(mission_id="2"))
    one.until(lambda: len(one.messages("/floranova/observations")) == 2, "both")
    first.publish(Observation(mission_id="3"))
    one.until(lambda: len(one.messages("/floranova/observations")) == 3, "all")
    assert [each["mission_id"] for each in one.messages("/floranova/observations")] == ["1", "2", "3"]
    late = page(url, ros)
    late.subscribe("/floranova/observations", "lupin_msgs/Observation")
    late.until(lambda: len(late.messages("/floranova/observations")) == 3, "the backlog of both")


STRING = "std_msgs/msg/String"
ASKED: list[tuple[str, dict[str, Any], Callable[[Any], Any], Any]] = [
    (
        "topics",
        {},
        lambda a: dict(zip(a["topics"], a["types"], strict=True))["/words"],
        "std_msgs/msg/String",
    ),
    ("services", {}, lambda a: "/robot/get_parameters" in a["services"], True),
    ("nodes", {}, lambda a: a["nodes"], ["/lupin_gateway", "/robot"]),
    ("topic_type", {"topic": "/words"}, lambda a: a, {"type": "std_msgs/msg/String"}),
    ("topic_type", {"topic": "/nobody"}, lambda a: a, {"type": ""}),
    (
        "service_type",
        {"service": "robot/get_parameters"},
        lambda a: a,
        {"type": "rcl_interfaces/srv/GetParameters"},
    ),
    ("service_type", {"service": "/nobody"}, lambda a: a, {"type": ""}),
    ("action_servers", {}, lambda a: a, {"action_servers": []}),
    ("get_param", {"name": "/robot:speed"}, lambda a: a, {"value": "1.5", "successful": True, "reason": ""}),
    (
        "get_param",
        {"name": "robot:nothing", "default_value": "7"},
        lambda a: a,
        {"value": "7", "successful": False, "reason": "robot has no parameter 'nothing'"},
    ),
    (
        "get_param",
        {"name": "speed"},
        lambda a: a,
        "failed: /rosapi/get_param: 'name' is written NODE:PARAMETER, such as /lupin_twin:frame_id",
    ),
    ("topic_type", {}, lambda a: a, "failed: /rosapi/topic_type: 'topic' must be a text"),
    (
        "message_details",
        {"type": "lupin_msgs/Observation"},
        lambda a: [
            a["typedefs"][0]["fieldnames"][:3],
            a["typedefs"][0]["fieldtypes"][:3],
            a["typedefs"][0]["constnames"][:2],
            sorted(each["type"] for each in a["typedefs"])[:2],
        ],
        [
            ["header", "mission_id", "source"],
            ["std_msgs/Header", "string", "string"],
            ["KIND_TAG_READING", "KIND_FLOWER"],
            ["builtin_interfaces/Time", "geometry_msgs/Point"],
        ],
    ),
    ("has_param", {"name": "/robot:speed"}, lambda a: a, {"exists": True}),
    ("get_param_names", {}, lambda a: "/robot:speed" in a["names"], True),
    ("topics_for_type", {"type": "std_msgs/String"}, lambda a: "/words" in a["topics"], True),
    (
        "services_for_type",
        {"type": "rcl_interfaces/GetParameters"},
        lambda a: "/robot/get_parameters" in a["services"],
        True,
    ),
    ("service_providers", {"service": "/robot/get_parameters"}, lambda a: a, {"providers": ["/robot"]}),
    (
        "delete_param",
        {},
        lambda a: a,
        "failed: /rosapi/delete_param: no client changes parameters; "
        "give them where the node is started: --set NODE.NAME=VALUE",
    ),
]


@VERSIONS
def test_what_pages_ask_about_the_network(
    version: str, gateway: Callable[..., str], page: OpenPage, make_node: Callable[..., RosNode]
) -> None:
    """The services of /rosapi, with and without the first slash, whatever the type."""
    ros = make_node("robot")
    ros.node.declare_parameter("speed", 1.5, ParameterDescriptor())
    ros.publisher(String, "/words", Qos.EVENT)
    one = page(gateway(), ros, version=version)
    one.until(lambda: len(one.call("/rosapi/nodes", "", {})["nodes"]) == 2, "both nodes")
    for question, request, read, expected in ASKED:
        for name in (f"/rosapi/{question}", f"rosapi/{question}"):
            answer = one.call(name, "rosapi_msgs/srv/Wrong", request)
            assert (answer if isinstance(answer, str) else read(answer)) == expected, question
