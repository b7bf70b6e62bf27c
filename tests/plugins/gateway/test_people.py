"""Who is here, what they pressed, and what they are notified of."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from lupin_gateway.access import IssuedToken, UserRole, Visitor
from lupin_gateway.audit import last_lines
from lupin_gateway.people import NOTIFICATIONS_TOPIC, PEOPLE_TOPIC, People
from lupin_gateway.people.notifications import ERROR, MOST, WARNING, Notifications
from lupin_gateway.people.sources import SILENT_S, NodeNotices, StepNotices, StopNotices
from tests.plugins.gateway.served import OpenPage, ServedGateway

TOKENS = [
    IssuedToken(Visitor("anna", UserRole.OPERATOR), "a" * 64),
    IssuedToken(Visitor("hall", UserRole.VIEWER), "h" * 64),
]


def as_data(notifications: Notifications) -> list[tuple[Any, ...]]:
    """Kind, about, times, over of all."""
    return [(one["kind"], one["about"], one["times"], one["over"]) for one in notifications.as_data()]


def step(sequence: int, *codes: dict[str, Any], boot: str = "b1", asking: Any = ()) -> dict[str, Any]:
    """A record of the topic of steps, taken `sequence` seconds after 1970."""
    return {
        "boot": boot,
        "wall_ns": sequence * 10**9,
        "step": {"sequence": sequence, "codes": codes},
        "view": {"asking": asking},
    }


def code(name: str, severity: int, target: str = "") -> dict[str, Any]:
    """A code that a step tells."""
    return {"code": name, "label": name.upper(), "severity": severity, "detail": "why", "target": target}


def test_the_same_again_is_one_until_it_is_acknowledged() -> None:
    found = Notifications()
    found.add("code", "nav_failed 3", WARNING, "first", 1.0)
    found.add("code", "nav_failed 3", WARNING, "second", 2.0)
    assert as_data(found) == [("code", "nav_failed 3", 2, None)]
    assert found.as_data()[0]["text"] == "second"
    assert found.acknowledge([1], "anna-1", 3.0) == ""
    found.add("code", "nav_failed 3", WARNING, "third", 4.0)
    assert [one["acknowledged"] for one in found.as_data()] == [3.0, None]


def test_what_is_known_already_stays_so_and_what_is_not_there_is_refused() -> None:
    found = Notifications()
    found.add("stop", "page-1", ERROR, "stopped", 1.0)
    assert found.acknowledge([1], "anna-1", 2.0) == ""
    assert found.acknowledge([1], "bert-2", 3.0) == ""
    assert (found.as_data()[0]["by"], found.as_data()[0]["acknowledged"]) == ("anna-1", 2.0)
    assert found.acknowledge([1, 7], "x", 4.0) == "no such notification: 7; nothing was acknowledged"
    assert (
        found.acknowledge([], "x", 4.0) == "no such notification: nothing was named; nothing was acknowledged"
    )


def test_their_number_is_bounded_and_the_acknowledged_go_first() -> None:
    found = Notifications()
    for number in range(MOST):
        found.add("code", str(number), WARNING, "", 0.0)
    found.acknowledge([5], "anna", 1.0)
    found.add("code", "one more", WARNING, "", 2.0)
    assert len(found.as_data()) == MOST
    assert [one["id"] for one in found.as_data()[:6]] == [1, 2, 3, 4, 6, 7]
    found.add("code", "and another", WARNING, "", 3.0)
    assert [one["id"] for one in found.as_data()[:2]] == [2, 3]


def test_steps_notify_of_warnings_and_of_questions_until_they_are_answered() -> None:
    found = Notifications()
    steps = StepNotices(found)
    steps.take(step(1, code("already_paused", 0), code("nav_failed", 1, "3"), code("driver_error", 2)))
    steps.take(step(1, code("nav_failed", 1, "3")))  # the backlog again
    assert as_data(found) == [("code", "nav_failed 3", 1, None), ("code", "driver_error", 1, None)]
    assert found.as_data()[0]["text"] == "NAV_FAILED: why"
    asking = [{"state": "MISSION.ASK", "question": "Go on?"}]
    steps.take(step(2, asking=asking))
    steps.take(step(3, asking=asking))
    steps.take(step(4))
    assert as_data(found)[2:] == [("question", "MISSION.ASK", 1, 4.0)]
    steps.take(step(1, code("nav_failed", 1, "3"), boot="b2"))
    assert as_data(found)[0] == ("code", "nav_failed 3", 2, None)


def status(name: str, level: int = 0, message: str = "running") -> dict[str, Any]:
    """A status as a page would read it."""
    return {"name": name, "level": level, "message": message, "hardware_id": "robot", "values": []}


def test_a_node_that_falls_silent_is_lost_until_it_is_heard_again() -> None:
    found = Notifications()
    nodes = NodeNotices(found)
    nodes.take(status("/lupin_twin"), 100.0, 0.0)
    nodes.take(status("a sensor of somebody"), 100.0, 0.0)
    nodes.look(105.0, SILENT_S)
    assert as_data(found) == []
    nodes.look(106.0, SILENT_S + 1.0)
    nodes.look(107.0, SILENT_S + 2.0)
    assert as_data(found) == [("node", "/lupin_twin", 1, None)]
    assert (found.as_data()[0]["text"], found.as_data()[0]["first"]) == (
        "/lupin_twin is not heard any more",
        100.0,
    )
    nodes.take(status("/lupin_twin"), 110.0, 10.0)
    assert as_data(found) == [("node", "/lupin_twin", 1, 110.0)]


def test_a_node_that_ends_as_it_should_is_not_lost() -> None:
    found = Notifications()
    nodes = NodeNotices(found)
    nodes.take(status("/lupin_twin"), 100.0, 0.0)
    nodes.take(status("/lupin_twin", 3, "ended"), 101.0, 1.0)
    nodes.look(200.0, 100.0)
    assert as_data(found) == []


def test_a_machine_that_runs_out_of_something_is_told_once() -> None:
    found = Notifications()
    nodes = NodeNotices(found)
    nodes.take(status("/one: stop", 1, "the robot is stopped"), 1.0, 1.0)
    for name in ("/one: machine", "/other: machine"):
        nodes.take(status(name, 1, "the disk is nearly full"), 1.0, 1.0)
    assert as_data(found) == [("machine", "robot", 1, None)]
    nodes.take(status("/one: machine", 0, "no trouble"), 2.0, 2.0)
    assert as_data(found) == [("machine", "robot", 1, 2.0)]
    nodes.look(100.0, 100.0)
    assert len(as_data(found)) == 1, "what has trouble is no node that could be silent"


def test_stops_are_told_by_who_engaged_them() -> None:
    found = Notifications()
    stops = StopNotices(found)
    stops.take(["page-1"], 1.0)
    stops.take(["page-1", "link"], 2.0)
    stops.take(["link"], 3.0)
    assert as_data(found) == [("stop", "page-1", 1, 3.0), ("stop", "link", 1, None)]


def test_they_outlive_the_gateway() -> None:
    kept: list[Any] = []
    people = People(keep=kept.append)
    people.steps.take(step(4, code("driver_error", 2)))
    people.notifications.acknowledge([1], "anna-1", 5.0)
    people.publish_changes()
    later = People()
    later.restore(json.loads(json.dumps(kept[-1])))
    later.steps.take(step(4, code("driver_error", 2)))
    assert later.notifications.as_data() == people.notifications.as_data()
    later.steps.take(step(5, code("driver_error", 2)))
    assert [one["id"] for one in later.notifications.as_data()] == [1, 2]


def test_nothing_is_told_twice() -> None:
    found: list[tuple[str, str]] = []
    people = People(lambda topic, text: found.append((topic, text)))
    people.publish_changes()
    people.publish_changes()
    assert [topic for topic, _ in found] == [PEOPLE_TOPIC, NOTIFICATIONS_TOPIC]
    people.notifications.add("stop", "page-1", ERROR, "stopped by page-1", 1.0)
    people.publish_changes()
    assert [topic for topic, _ in found[2:]] == [NOTIFICATIONS_TOPIC]


def test_pages_see_who_is_here_and_operators_what_was_pressed(tmp_path: Path) -> None:
    with ServedGateway(tmp_path, TOKENS) as served:
        anna = OpenPage(served.port, authorization=f"Bearer {'a' * 64}")
        hall = OpenPage(served.port, authorization=f"Bearer {'h' * 64}")
        stop_of_anna = OpenPage(served.port, authorization=f"Bearer {'a' * 64}", cookie="lupin_browser=x")
        anna_again = OpenPage(served.port, authorization=f"Bearer {'a' * 64}", cookie="lupin_browser=x")
        assert anna.call("/lupin/hmi/here", view="chart")["values"] == {"page": "anna-1"}
        anna_again.call("/lupin/hmi/here", view="map")
        here = served.call(served.rules.people.presence.as_data)
        assert [(one["page"], one["role"], one["view"]) for one in here] == [
            ("anna-1", "operator", "chart"),
            ("hall-2", "viewer", ""),
            ("anna-4", "operator", "map"),
        ]
        served.robot.answers["/mission/pause"] = lambda data: {"success": True, "message": "paused"}
        anna.call("/mission/pause")
        pressed = anna.call("/lupin/hmi/commands", since=0)["values"]["commands"]
        assert [(one["page"], one["name"], one["accepted"], one["number"]) for one in pressed] == [
            ("anna-1", "/mission/pause", True, 1)
        ]
        assert anna.call("/lupin/hmi/commands", since=1)["values"]["commands"] == []
        assert anna.call("/lupin/hmi/commands", since="x")["values"]["commands"] == pressed
        refused = hall.call("/lupin/hmi/commands")
        assert refused["values"] == "calling /lupin/hmi/commands needs the role operator; hall is viewer"
        for page in (stop_of_anna, anna_again, hall, anna):
            page.close()


def test_who_acknowledges_is_known_and_written_down(tmp_path: Path) -> None:
    with ServedGateway(tmp_path) as served:
        page = OpenPage(served.port)
        page.stop(True)
        page.work_off()
        wrong = page.call("/lupin/hmi/acknowledge", ids="all")["values"]
        assert wrong == {
            "success": False,
            "message": "'ids' must be a list of numbers of notifications",
        }
        answer = page.call("/lupin/hmi/acknowledge", ids=[1])["values"]
        assert answer == {"success": True, "message": "acknowledged by page-1"}
        [stop] = served.call(served.rules.people.notifications.as_data)
        assert (stop["kind"], stop["about"], stop["by"]) == ("stop", "page-1", "page-1")
        page.close()
    assert [(line["name"], line.get("accepted")) for line in served.lines()][1:] == [
        ("/lupin/hmi/acknowledge", False),
        ("/lupin/hmi/acknowledge", True),
    ]


def test_the_last_commands_are_read_from_the_log(tmp_path: Path) -> None:
    log = tmp_path / "audit.jsonl"
    assert last_lines(log, 5) == []
    lines = [json.dumps({"name": f"/s{number}", "what": "call_service"}) for number in range(9)]
    log.write_text("\n".join([*lines, "broken {", '["no line"]']) + "\n")
    assert [line["name"] for line in last_lines(log, 5)] == ["/s6", "/s7", "/s8"]


def test_a_stop_of_a_page_is_told_once() -> None:
    """Who pressed it; the mission's hold is the same. Of the robot's own button the mission tells."""
    engaged = {"event": "value", "data": {"value": True}, "notes": ["hold estop engaged"]}
    told_by = {1: ["page-1"], 2: []}
    for sequence, names in told_by.items():
        found = Notifications()
        StopNotices(found).take(names, 1.0)
        record = step(sequence, code("estop_engaged", 1))
        record["step"] |= engaged
        StepNotices(found).take(record)
        kinds = [kind for kind, *_ in as_data(found)]
        assert kinds == (["stop"] if names else ["code"])
