"""Several robots behind one server: each has its own stop, people, access and log."""

from __future__ import annotations

import json
import urllib.error
import urllib.request
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from lupin_engine.errors import UsageError
from lupin_engine.plugin import Progress
from lupin_gateway.access import IssuedToken, UserRole, Visitor
from lupin_gateway.motion import MissionLevel
from tests.plugins.gateway.served import OpenPage, ServedGateway, until

FOREVER = 4_102_444_800.0
RESET = "/lupin/hmi/reset_stop"


def token(name: str, role: UserRole) -> IssuedToken:
    return IssuedToken(Visitor(name, role, FOREVER), name * 20)


@pytest.fixture
def two(tmp_path: Path) -> Iterator[tuple[ServedGateway, ServedGateway]]:
    """Anna operates the first robot, and looks at the second; Ben is known to the second only."""
    first = ServedGateway(tmp_path / "1", tokens=[token("anna", UserRole.OPERATOR)])
    known: Sequence[IssuedToken] = [token("anna", UserRole.VIEWER), token("ben", UserRole.OPERATOR)]
    second = ServedGateway(tmp_path / "2", tokens=known)
    first.gateway.robot, second.gateway.robot = "robot1", "robot2"
    first.together(robot2=second)
    with first:
        yield first, second


def page_of(name: str, gateway: ServedGateway, base: str) -> OpenPage:
    return OpenPage(gateway.port, base=base, authorization=f"Bearer {name * 20}")


def answer(gateway: ServedGateway, path: str, name: str = "", **headers: str) -> Any:
    """Return what is served at a path, and where."""
    if name:
        headers["authorization"] = f"Bearer {name * 20}"
    asked = urllib.request.Request(f"http://localhost:{gateway.port}{path}", headers=headers)
    with urllib.request.urlopen(asked, timeout=30) as found:
        return found.read().decode(), found.url.partition(str(gateway.port))[2]


def refused(gateway: ServedGateway, path: str, name: str) -> int:
    """Return the status of a refusal."""
    with pytest.raises(urllib.error.HTTPError) as out:
        answer(gateway, path, name)
    out.value.close()
    return out.value.code


def test_a_stop_is_of_one_robot(two: tuple[ServedGateway, ServedGateway]) -> None:
    """And outlives its page, as with one robot; the other one's log knows nothing of it."""
    first, second = two
    page = page_of("ben", first, "/robots/robot2")
    page.stop(True)
    until(lambda: second.stop_told[-1:] == [True], "the stop is told")
    page.close()
    until(lambda: [stop["left"] for stop in second.states[-1]["stops"]] == [True], "its page is gone")
    assert first.stop_told
    assert not any(first.stop_told)
    assert [line["name"] for line in second.lines()] == ["/lupin/hmi/estop"]
    assert first.log.read_text() == ""


def test_each_has_its_own_roles(two: tuple[ServedGateway, ServedGateway]) -> None:
    first, _ = two
    may = page_of("anna", first, "/robots/robot1").call(RESET, name="x")
    assert may["values"] == {"success": False, "message": "no stop is called 'x'; none is engaged"}
    may_not = page_of("anna", first, "/robots/robot2").call(RESET, name="x")
    assert may_not["values"] == f"calling {RESET} needs the role operator; anna is viewer"
    assert refused(first, "/robots/robot1/status", "ben") == 401


def test_the_list_has_those_that_the_visitor_is_let_in_to(two: tuple[ServedGateway, ServedGateway]) -> None:
    """With what each does, what stops it, and its question."""
    first, second = two

    def told() -> None:
        now = second.rules.clocks.steady()
        second.rules.progress = Progress(
            mission="inspection", lifecycle="INSPECTING", target="12", paused=True
        )
        second.rules.motion.hear_mission(MissionLevel("INSPECTING", under_way=True), now)
        second.rules.motion.hear_stops(["robot"])
        second.rules.people.steps.asked = {"ASKING": "Go on?"}

    first.call(told)
    does = {"heard": True, "lifecycle": "INSPECTING", "mission": "inspection", "target": "12", "paused": True}
    robot2 = {"robot": "robot2", **does, "stops": ["robot"], "questions": ["Go on?"]}
    silent = {"heard": False, "lifecycle": "", "mission": "", "target": "", "paused": False}
    robot1 = {"robot": "robot1", **silent, "stops": [], "questions": []}
    assert json.loads(answer(first, "/robots/robot1/robots", "anna")[0]) == [robot1, robot2]
    assert json.loads(answer(first, "/robots/robot2/robots", "ben")[0]) == [robot2]


def test_where_its_pages_are(two: tuple[ServedGateway, ServedGateway]) -> None:
    """The address alone leads to the first one, as do programs that know of no other."""
    first, _ = two
    assert answer(first, "/", "anna")[1] == "/robots/robot1/"
    page, where = answer(first, "/robots/robot2", "anna")
    assert (where, "stop.js" in page) == ("/robots/robot2/", True)
    assert answer(first, "/robots/robot2/", accept="text/html")[1] == "/robots/robot2/login"
    assert json.loads(answer(first, "/status", "anna")[0])["robots"] == ["robot1", "robot2"]
    assert refused(first, "/robots/robot3/", "anna") == 404


@pytest.mark.parametrize(
    ("given", "why"),
    [
        (
            {"robots": ["robot-2"]},
            "robots: 'robot-2' is no ROS namespace: use words of ASCII letters, digits and _ that begin with "
            "no digit, joined by /, such as robot2",
        ),
        (
            {"robots": ["fleet/robot2"]},
            "robots: 'fleet/robot2' is below another one: a gateway in that namespace serves it",
        ),
        (
            {"robots": ["robot2"], "audit_file": "a.jsonl"},
            "audit_file: each of several robots has a file of its own: leave it out",
        ),
        (
            {"robots": ["robot2"], "open": True, "tokens": "/nowhere/{robot}.tokens"},
            "an open gateway needs tls_certificate: the certificate of this machine (PEM)\n"
            "an open gateway needs tls_key: its key (PEM)\n"
            "tokens: there is no file /nowhere/robot2.tokens; it is who may come in: lines of NAME ROLE "
            "EXPIRES TOKEN, mode 600",
        ),
    ],
)
def test_what_cannot_be_served_is_told_at_the_start(given: dict[str, Any], why: str) -> None:
    pytest.importorskip("rclpy", reason="ROS 2 is not installed here")
    from lupin_gateway.node import PARAMETERS, check

    with pytest.raises(UsageError) as told:
        check({**{name: spec.default for name, spec in PARAMETERS.items()}, **given})
    assert str(told.value) == why
