"""Visual confirmation: what becomes of every answer, and of none."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed here")

from lupin_engine.middleware.node import Failure, RosNode
from lupin_msgs.srv import ConfirmTag
from lupin_perception.catalog import PLUGIN
from lupin_perception.client import PerceptionClient
from tests.plugins.fakes import FakeOutlet, FakeRos, defaults
from tests.ros.helpers import spin_until

SERVICE = "/perception/confirm_tag"


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


def test_no_answer_fails_with_the_reason() -> None:
    ros, outlet, client = bench()
    client.start("a1", "confirm_tag", {"tag_id": "7"})
    ros.remote.calls[0].done(Failure("unavailable", f"{SERVICE}: no server"))
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


@pytest.mark.ros
def test_over_the_wire_a_tag_is_confirmed_or_not(make_node: Callable[..., RosNode]) -> None:
    def answer(request: ConfirmTag.Request, response: ConfirmTag.Response) -> ConfirmTag.Response:
        response.detected = request.expected_tag_id == "7"
        response.detection_confidence = 0.9
        response.error_message = "" if response.detected else "not discovered"
        return response

    server, ours, outlet = make_node("aggregator"), make_node("ours"), FakeOutlet()
    server.serve(ConfirmTag, SERVICE, answer)
    client = PerceptionClient(ours, outlet, defaults(PLUGIN, require_visual_confirmation=True))
    spin_until([server, ours], lambda: not client.missing())
    for attempt, tag_id in (("a1", "7"), ("a2", "8")):
        client.start(attempt, "confirm_tag", {"tag_id": tag_id})
    spin_until([server, ours], lambda: len(outlet.reports) == 4)
    assert ("done", "a1", {"confidence": 0.9}) in outlet.reports
    assert ("failed", "a2", "visual_confirm_missed", "not discovered") in outlet.reports


@pytest.mark.ros
def test_over_the_wire_a_server_that_is_not_there_is_a_failure(make_node: Callable[..., RosNode]) -> None:
    ours, outlet = make_node("ours"), FakeOutlet()
    client = PerceptionClient(ours, outlet, defaults(PLUGIN))
    client.start("a1", "confirm_tag", {"tag_id": "7"})
    spin_until([ours], lambda: len(outlet.reports) == 2)
    assert outlet.reports[-1][:3] == ("failed", "a1", "confirm_failed")
