"""The engine's side of the cameras over real DDS."""

from __future__ import annotations

from collections.abc import Callable

from lupin_msgs.srv import ConfirmTag
from lupin_perception.catalog import PLUGIN
from lupin_perception.client import PerceptionClient
from lupin_ros.adapter.node import RosNode
from tests.lupin_ros.helpers import spin_until
from tests.plugins.fakes import FakeOutlet, defaults

SERVICE = "/perception/confirm_tag"


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


def test_over_the_wire_a_server_that_is_not_there_is_a_failure(make_node: Callable[..., RosNode]) -> None:
    ours, outlet = make_node("ours"), FakeOutlet()
    client = PerceptionClient(ours, outlet, defaults(PLUGIN))
    client.start("a1", "confirm_tag", {"tag_id": "7"})
    spin_until([ours], lambda: len(outlet.reports) == 2)
    assert outlet.reports[-1][:3] == ("failed", "a1", "confirm_failed")


def test_over_the_wire_the_reason_of_an_answer_is_kept_while_it_is_asked_again(
    make_node: Callable[..., RosNode],
) -> None:
    """A mission's timeout comes while the next answer takes its time: it has the last progress."""

    def answer(_: ConfirmTag.Request, response: ConfirmTag.Response) -> ConfirmTag.Response:
        response.error_message = "tag 8 is behind a leaf"
        return response

    server, ours, outlet = make_node("aggregator"), make_node("ours"), FakeOutlet()
    server.serve(ConfirmTag, SERVICE, answer)
    client = PerceptionClient(ours, outlet, defaults(PLUGIN, require_visual_confirmation=True))
    spin_until([server, ours], lambda: not client.missing())
    client.start("a1", "confirm_tag", {"tag_id": "8", "within": 3.0})
    spin_until([server, ours], lambda: len(outlet.reports) >= 2)
    assert outlet.reports[1] == ("progress", "a1", "tag 8 is behind a leaf")
