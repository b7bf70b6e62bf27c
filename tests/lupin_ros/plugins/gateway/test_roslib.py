"""Both versions of roslib against a gateway and a real node: topics, services, what is refused."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from geometry_msgs.msg import PoseStamped
from std_msgs.msg import String
from std_srvs.srv import Trigger

from lupin_msgs.msg import Observation
from lupin_msgs.srv import StartMission
from lupin_ros.adapter.node import Qos, RosNode
from tests.lupin_ros.plugins.gateway.page import Page

pytestmark = [pytest.mark.node, pytest.mark.timeout(120)]

VERSIONS = pytest.mark.parametrize("version", ["1", "2"])
OpenPage = Callable[..., Page]


@pytest.mark.core
@VERSIONS
def test_a_page_listens_publishes_and_calls(
    version: str, gateway: Callable[..., str], page: OpenPage, make_node: Callable[..., RosNode]
) -> None:
    """All three against one node; types are written in both ways."""
    ros = make_node("robot")
    heard: list[String] = []
    ros.subscribe(String, "/words", Qos.EVENT, heard.append)
    said = ros.publisher(String, "/said", Qos.LATCHED)
    said.publish(String(data="ready"))

    def start(request: Any, response: Any) -> Any:
        response.accepted = request.mission_type == "InspectionMission"
        response.error_message = f"{list(request.tag_sequence)} {request.discovery_goal}"
        return response

    ros.serve(StartMission, "/mission/start", start)
    one = page(gateway(), ros, version=version)
    one.subscribe("/said", "std_msgs/String")
    one.until(lambda: one.messages("/said") == [{"data": "ready"}], "the latched message")
    one.publish("/words", "std_msgs/msg/String", {"data": "hello"})
    one.until(lambda: [each.data for each in heard] == ["hello"], "the first message that was published")
    asked = {"mission_type": "InspectionMission", "tag_sequence": ["1", "5"]}
    for kind in ("lupin_msgs/StartMission", "lupin_msgs/srv/StartMission", "std_srvs/Trigger", None):
        answer = one.call("/mission/start", kind, asked)
        assert answer == {"accepted": True, "mission_id": "", "error_message": "['1', '5'] 0"}


@VERSIONS
def test_a_request_that_does_not_fit_is_refused_by_name(
    version: str, gateway: Callable[..., str], page: OpenPage, make_node: Callable[..., RosNode]
) -> None:
    """All problems at once, with the field; the server is not asked."""
    ros = make_node("robot")
    ros.serve(StartMission, "/mission/start", lambda request, response: pytest.fail("was called"))
    one = page(gateway(), ros, version=version)
    wrong = {"mission": "x", "tag_sequence": [1], "discovery_goal": 70000}
    assert one.call("/mission/start", "lupin_msgs/StartMission", wrong) == (
        "failed: /mission/start: mission: lupin_msgs/srv/StartMission.Request has no such field; "
        "did you mean 'mission_type'?; tag_sequence[0]: expected a text, got 1; "
        "discovery_goal: 70000 is not from 0 to 65535"
    )
    assert one.call("/nobody", "std_srvs/Trigger", {}) == "failed: /nobody: nobody serves this service now"


@VERSIONS
def test_every_page_gets_the_whole_backlog(
    version: str, gateway: Callable[..., str], page: OpenPage, make_node: Callable[..., RosNode]
) -> None:
    """Fifty observations each, however many pages are open, and once only."""
    ros = make_node("robot")
    observations = ros.publisher(Observation, "/floranova/observations", Qos.BACKLOG)
    for number in range(60):
        observations.publish(Observation(mission_id=str(number)))
    url = gateway()
    expected = [str(number) for number in range(10, 60)]
    pages = [page(url, ros, version=version) for _ in range(3)]
    for one in pages:
        one.subscribe("/floranova/observations", "lupin_msgs/Observation")
        one.until(lambda: len(one.messages("/floranova/observations")) >= 50, "the backlog")  # noqa: B023
    observations.publish(Observation(mission_id="60"))
    for one in pages:
        one.until(lambda: len(one.messages("/floranova/observations")) >= 51, "one more")  # noqa: B023
        seen = [each["mission_id"] for each in one.messages("/floranova/observations")]
        assert seen == [*expected, "60"]


def test_a_hung_service_delays_nothing_and_its_failure_names_it(
    gateway: Callable[..., str], page: OpenPage, make_node: Callable[..., RosNode]
) -> None:
    """A service that never answers: publications and other calls pass it; it ends after its time."""
    ros = make_node("robot")
    heard: list[PoseStamped] = []
    ros.subscribe(PoseStamped, "/goal_pose", Qos.EVENT, heard.append)
    ros.serve_later(Trigger, "/hangs", lambda request, response, answer: None)
    ros.serve(Trigger, "/works", lambda request, response: Trigger.Response(success=True))
    one = page(gateway(call_timeout=3.0), ros)
    hung = [one.begin("call", "/hangs", "std_srvs/Trigger", {}) for _ in range(20)]
    one.publish("/goal_pose", "geometry_msgs/PoseStamped", {"header": {"frame_id": "map"}})
    one.until(lambda: heard, "the publication")
    assert one.call("/works", "std_srvs/Trigger", {}) == {"success": True, "message": ""}
    assert not one.of("answer", n=hung[0])
    for number in hung:
        answer = one.answer(number)
        assert answer["value"] == "/hangs: no answer within 3 s; what was asked for may still happen"
