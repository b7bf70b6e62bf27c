"""The cameras: what becomes of every answer to a confirmation, and of every list of discovered tags."""

from __future__ import annotations

import math
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed here")

from geometry_msgs.msg import Pose

from lupin_msgs.msg import DiscoveredTag, DiscoveredTags
from lupin_msgs.srv import ConfirmTag
from lupin_perception.catalog import DISCOVERED_TAG, PLUGIN
from lupin_perception.client import PerceptionClient
from lupin_ros.adapter.node import CallFailure, Qos
from tests.plugins.fakes import FakeOutlet, FakeRos, defaults

SERVICE = "/perception/confirm_tag"
TOPIC = "/perception/discovered_tags"


def bench(**changed: Any) -> tuple[FakeRos, FakeOutlet, PerceptionClient]:
    ros, outlet = FakeRos(), FakeOutlet()
    client = PerceptionClient(ros, outlet, defaults(PLUGIN, **changed))  # type: ignore[arg-type]
    return ros, outlet, client


def test_a_seen_tag_is_done_with_its_confidence() -> None:
    ros, outlet, client = bench()
    client.start("a1", "confirm_tag", {"tag_id": "7"})
    assert ros.remote.calls[0].request.expected_tag_id == "7"
    ros.remote.calls[0].done(ConfirmTag.Response(detected=True, detection_confidence=0.5))
    assert outlet.reports == [("accepted", "a1"), ("done", "a1", {"confidence": 0.5})]


@pytest.mark.parametrize(("said", "detail"), [("stale: 7", "stale: 7"), ("", "visual_confirm_missed")])
def test_an_unseen_tag_fails_with_the_servers_words(said: str, detail: str) -> None:
    ros, outlet, client = bench()
    client.start("a1", "confirm_tag", {"tag_id": "7"})
    # Only `detected` decides, whatever the confidence.
    ros.remote.calls[0].done(ConfirmTag.Response(detection_confidence=1.0, error_message=said))
    assert outlet.reports[-1] == ("failed", "a1", "visual_confirm_missed", detail)


def test_within_its_time_a_tag_is_asked_for_until_it_is_seen() -> None:
    ros, outlet, client = bench()
    client.start("a1", "confirm_tag", {"tag_id": "7", "within": 3.0})
    for look in range(5):
        ros.remote.calls[look].done(ConfirmTag.Response(error_message="tag '7' not discovered"))
        assert outlet.kinds("a1") == ["accepted"]
        ros.pass_time(0.25)
    ros.remote.calls[5].done(ConfirmTag.Response(detected=True, detection_confidence=1.0))
    ros.pass_time(5.0)
    reason = ("progress", "a1", "tag '7' not discovered")
    assert outlet.reports == [("accepted", "a1"), reason, ("done", "a1", {"confidence": 1.0})]
    assert len(ros.remote.calls) == 6


def test_a_tag_that_stays_unseen_fails_just_before_its_time_is_over() -> None:
    """The mission's timeout is the same time: who is not seen and who never answers are told apart."""
    ros, outlet, client = bench()
    client.start("a1", "confirm_tag", {"tag_id": "7", "within": 3.0})
    while outlet.kinds("a1") == ["accepted"]:
        ros.remote.calls[-1].done(ConfirmTag.Response(error_message="tag '7' stale"))
        ros.pass_time(0.25)
    assert outlet.reports[-1] == ("failed", "a1", "visual_confirm_missed", "tag '7' stale")
    assert len(ros.remote.calls) == 12


def test_between_two_looks_an_attempt_can_be_cancelled() -> None:
    ros, outlet, client = bench()
    client.start("a1", "confirm_tag", {"tag_id": "7", "within": 3.0})
    ros.remote.calls[0].done(ConfirmTag.Response())
    client.cancel("a1")
    ros.pass_time(3.0)
    assert len(ros.remote.calls) == 1
    assert outlet.kinds("a1") == ["accepted", "cancelled"]


def test_a_camera_that_is_gone_is_not_asked_again() -> None:
    ros, outlet, client = bench()
    client.start("a1", "confirm_tag", {"tag_id": "7", "within": 3.0})
    ros.remote.calls[0].done(CallFailure("unavailable", f"{SERVICE}: no server"))
    assert outlet.kinds("a1") == ["accepted", "failed"]


def test_no_answer_fails_with_the_reason() -> None:
    ros, outlet, client = bench()
    client.start("a1", "confirm_tag", {"tag_id": "7"})
    ros.remote.calls[0].done(CallFailure("unavailable", f"{SERVICE}: no server"))
    assert outlet.reports[-1] == ("failed", "a1", "confirm_failed", f"unavailable: {SERVICE}: no server")


def test_a_cancelled_attempt_drops_its_answer() -> None:
    ros, outlet, client = bench()
    client.start("a1", "confirm_tag", {"tag_id": "7"})
    client.cancel("a1")
    client.cancel("a1")
    assert ros.remote.calls[0].cancelled
    assert outlet.kinds("a1") == ["accepted", "cancelled"]


def test_closing_drops_every_answer_and_reports_nothing() -> None:
    ros, outlet, client = bench()
    client.start("a1", "confirm_tag", {"tag_id": "7"})
    client.close()
    client.cancel("a1")
    assert ros.remote.calls[0].cancelled
    assert outlet.kinds("a1") == ["accepted"]


@pytest.mark.parametrize(
    ("changed", "missing"),
    [
        ({}, []),
        ({"require_visual_confirmation": False}, []),
        ({"require_visual_confirmation": True}, [f"service {SERVICE}"]),
    ],
)
def test_the_service_is_missing_only_where_a_mission_insists_on_it(
    changed: dict[str, Any], missing: list[str]
) -> None:
    ros, _, client = bench(**changed)
    ros.remote.up = False
    assert client.missing() == missing
    ros.remote.up = True
    assert client.missing() == []


def test_other_words_are_refused() -> None:
    _, _, client = bench()
    with pytest.raises(ValueError, match="no operation 'look'"):
        client.start("a1", "look", {})
    with pytest.raises(ValueError, match="no action 'look'"):
        client.act("look", {})


# --- discovered tags


def tag(name: str, x: float = 1.0, w: float = 1.0, **more: Any) -> DiscoveredTag:
    pose = Pose()
    pose.position.x, pose.position.y, pose.orientation.w = x, 2.0, w
    return DiscoveredTag(tag_id=name, pose_in_map=pose, sightings=3, **more)


def told(*tags: DiscoveredTag, frame: str = "map", stamp: int = 50) -> DiscoveredTags:
    message = DiscoveredTags(tags=list(tags))
    message.header.frame_id = frame
    message.header.stamp.sec = stamp
    return message


def hear(*messages: DiscoveredTags) -> tuple[FakeRos, FakeOutlet]:
    ros, outlet, _ = bench()
    for message in messages:
        ros.subscriptions[TOPIC](message)
    return ros, outlet


def test_discovered_tags_are_told_as_of_their_stamp() -> None:
    """War stories A17 and A41: the list is latched, and may be older than the mission."""
    found = tag("7", species="tulip_red", species_confidence=0.5, anomaly=True)
    ros, outlet = hear(told(found))
    assert ros.profiles[TOPIC] is Qos.LATCHED
    record = {
        "id": "7",
        "x": 1.0,
        "y": 2.0,
        "facing": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
        "species": "tulip_red",
        "species_confidence": 0.5,
        "anomaly": True,
        "sightings": 3,
    }
    assert outlet.values == [("tags.discovered", [record], 50.0)]


def test_what_nobody_stamped_counts_from_its_receipt() -> None:
    ros, outlet = hear(told(stamp=0))
    assert outlet.values == [("tags.discovered", [], ros.time)]


def test_a_half_turn_and_an_orientation_that_nobody_filled_in_are_places() -> None:
    turned = tag("6", w=0.0)
    turned.pose_in_map.orientation.z = 2.0
    _, outlet = hear(told(turned, tag("7", w=0.0)))
    ((half, unfilled),) = outlet.of("tags.discovered")
    assert half["facing"] == {"x": 0.0, "y": 0.0, "z": 1.0, "w": 0.0}
    assert unfilled["facing"] == {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}


@pytest.mark.parametrize("wrong", [{"x": math.nan}, {"x": math.inf}, {"w": math.nan}])
def test_a_tag_without_a_pose_waits_until_it_has_one_and_is_warned_about_once(wrong: dict[str, Any]) -> None:
    ros, outlet = hear(told(tag("7", **wrong), tag("8")), told(tag("7", **wrong)), told(tag("7")))
    assert [[known["id"] for known in seen] for seen in outlet.of("tags.discovered")] == [["8"], [], ["7"]]
    assert ros.log.warnings == [("tag '7' left out: it has no pose yet", {})]


def test_an_orientation_is_told_as_a_unit_quaternion_and_a_strange_confidence_as_none() -> None:
    crooked = tag("7", w=2.0, species_confidence=math.nan)
    crooked.pose_in_map.orientation.y = 2.0
    _, outlet = hear(told(crooked))
    ((seen,),) = outlet.of("tags.discovered")
    assert seen["facing"] == pytest.approx({"x": 0.0, "y": math.sqrt(0.5), "z": 0.0, "w": math.sqrt(0.5)})
    assert seen["species_confidence"] == 0.0


def test_of_one_id_told_twice_the_last_counts() -> None:
    _, outlet = hear(told(tag("7", x=1.0), tag("8"), tag("7", x=3.0)))
    (seen,) = outlet.of("tags.discovered")
    assert [(known["id"], known["x"]) for known in seen] == [("7", 3.0), ("8", 1.0)]


def test_numbers_come_in_their_order_and_names_after_them() -> None:
    _, outlet = hear(told(*map(tag, ("15", "b", "3", "18", "a", "2"))))
    (seen,) = outlet.of("tags.discovered")
    assert [known["id"] for known in seen] == ["2", "3", "15", "18", "a", "b"]


def test_tags_in_another_frame_are_ignored_and_warned_about_once() -> None:
    ros, outlet = hear(told(tag("7"), frame="odom"), told(tag("7"), frame="odom"))
    assert outlet.values == []
    assert ros.log.warnings == [("tags in frame 'odom' ignored, expected 'map'", {})]


def test_the_record_is_what_the_catalog_declares() -> None:
    _, outlet = hear(told(tag("7")))
    ((seen,),) = outlet.of("tags.discovered")
    assert set(seen) == set(DISCOVERED_TAG.fields)


def test_a_closed_driver_tells_of_no_tags() -> None:
    ros, outlet, client = bench()
    client.close()
    ros.subscriptions[TOPIC](told(tag("7")))
    assert outlet.values == []
