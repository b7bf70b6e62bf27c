"""A bridge that misbehaves: slow, too late, twice, about another tag."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from lupin_msgs.srv import GetTagReading
from tests.lupin_ros.system.wire.wire import (
    OK,
    SCAN_FAILED,
    SKIPPED,
    Asked,
    Drive,
    Wire,
    answer_reading,
    leave_open,
    running_node,
)

pytestmark = pytest.mark.timeout(120)

#: Seconds that a reading may take.
LIMIT = 2.0


@pytest.fixture(scope="module")
def running(ros_domain: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Wire]:
    """One node for all tests here: each leaves it with its mission ended."""
    with running_node(tmp_path_factory.mktemp("wire"), scan_timeout_s=LIMIT) as wire:
        yield wire


def calls(wire: Wire, number: int) -> Asked:
    """Wait until the bridge was asked so many times; return the last call."""
    wire.until(lambda: len(wire.bridge.calls) >= number, f"call {number} of the bridge")
    return wire.bridge.calls[number - 1]


def values(wire: Wire, mission: str) -> list[tuple[str, list[float]]]:
    """Return the values that were published for each tag; the bridge gives each its own number."""
    mine = [o for o in wire.operator.observations if o.mission_id == mission]
    return [(o.tag_reading.tag_id, [r.value for r in o.tag_reading.readings]) for o in mine]


def test_an_answer_after_the_deadline_is_not_booked_on_the_next_tag(wire: Wire) -> None:
    """Story A14: it comes while the next tag is asked for, and is about the one before."""
    wire.bridge.plan.extend([leave_open, leave_open])
    mission = wire.start("1", "2")
    late, current = calls(wire, 1), calls(wire, 2)
    answer_reading(late)
    answer_reading(current)
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", SCAN_FAILED), ("2", OK)]
    assert wire.details(mission) == ["scan_timeout", ""]
    assert values(wire, mission) == [("1", []), ("2", [2.0])]


def test_an_answer_after_a_skip_is_not_booked_on_the_next_tag(wire: Wire) -> None:
    """The same when the operator went on, and the answer comes before the next question."""
    wire.bridge.plan.append(leave_open)
    mission = wire.start("1", "2")
    late = calls(wire, 1)
    wire.base.plan.append(Drive.accept)
    assert wire.operator.ask("skip_current").success
    drive = wire.until_driving(2)
    answer_reading(late)
    drive.feed_back(1.0)
    drive.arrive()
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", SKIPPED), ("2", OK)]
    assert values(wire, mission) == [("1", []), ("2", [2.0])]


def test_an_answer_that_comes_twice_counts_once(wire: Wire) -> None:
    """The second one finds nobody who waits, not even when the next tag is being read."""

    def answer_twice(asked: Asked) -> None:
        answer_reading(asked)
        answer_reading(asked)

    wire.bridge.plan.extend([answer_twice, leave_open])
    mission = wire.start("1", "2")
    second = calls(wire, 2)
    answer_reading(wire.bridge.calls[0])
    answer_reading(second)
    wire.until_done(mission)
    assert values(wire, mission) == [("1", [1.0]), ("2", [2.0])]


def test_an_answer_about_another_tag_is_not_taken(wire: Wire) -> None:
    """A bridge that mixes up its answers costs a reading; it does not put it on the wrong plant."""

    def mixed_up(asked: Asked) -> None:
        response = GetTagReading.Response(status=GetTagReading.Response.STATUS_OK)
        response.reading.tag_id = "9"
        asked.answer(response)

    wire.bridge.plan.append(mixed_up)
    mission = wire.start("1", "2")
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", SCAN_FAILED), ("2", OK)]
    assert wire.details(mission)[0] == "the bridge answered with tag '9'"


def test_an_answer_during_a_pause_waits_for_the_resume(wire: Wire) -> None:
    """Story A42: slow, and answered while held. Nothing is published and nobody drives before the resume."""
    wire.bridge.plan.append(leave_open)
    mission = wire.start("1", "2")
    slow = calls(wire, 1)
    assert wire.operator.ask("pause").success
    wire.until_held()
    driven = len(wire.drives)
    answer_reading(slow)
    told = len(wire.operator.states)
    wire.until(lambda: len(wire.operator.states) >= told + 4, "time for the node to make a mistake")
    assert wire.outcomes(mission) == []
    assert len(wire.drives) == driven
    assert wire.operator.ask("resume").success
    wire.until_done(mission)
    assert values(wire, mission) == [("1", [1.0]), ("2", [2.0])]
    assert [asked.request.tag_id for asked in wire.bridge.calls] == ["1", "2"]


def test_a_pause_does_not_use_up_the_deadline_of_a_reading(wire: Wire) -> None:
    """Story A12: held for longer than a reading may take, it is asked for and answered as if nothing was."""
    wire.bridge.plan.append(leave_open)
    mission = wire.start("1")
    slow = calls(wire, 1)
    assert wire.operator.ask("pause").success
    wire.until_held()
    told = len(wire.operator.states)
    wire.until(lambda: len(wire.operator.states) >= told + 5 * (LIMIT + 0.4), "longer than the deadline")
    assert wire.operator.ask("resume").success
    answer_reading(slow)
    wire.until_done(mission)
    assert values(wire, mission) == [("1", [1.0])]


def test_an_answer_after_the_mission_is_nobodys(wire: Wire) -> None:
    """Aborted while it was asked: the tag is closed, and stays as it was closed; so does the next mission."""
    wire.bridge.plan.append(leave_open)
    first = wire.start("1")
    late = calls(wire, 1)
    assert wire.operator.ask("abort").success
    wire.until_done(first)
    wire.bridge.plan.append(leave_open)
    second = wire.start("2")
    current = calls(wire, 2)
    answer_reading(late)
    answer_reading(current)
    wire.until_done(second)
    assert wire.outcomes(first) == [("1", SKIPPED)]
    assert values(wire, second) == [("2", [2.0])]
