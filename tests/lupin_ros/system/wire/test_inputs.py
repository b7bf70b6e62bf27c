"""Inputs that misbehave: an e-stop that flaps, a battery of any scale, a list of tags from before."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest

from lupin_greenhouse.stops import GAP, ROW
from lupin_msgs.msg import DiscoveredTag, DiscoveredTags
from lupin_msgs.srv import StartMission
from lupin_ros.adapter.node import Qos
from tests.lupin_ros.helpers import to_time
from tests.lupin_ros.system.wire.wire import OK, Drive, Wire, running_node

pytestmark = pytest.mark.timeout(120)

#: Seconds of silence after which an emergency stop that was told steadily counts as engaged.
SILENCE = 4.0


@pytest.fixture(scope="module")
def running(ros_domain: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Wire]:
    """One node for all tests here: each leaves it with its mission ended."""
    given = {"monitoring_sweeps": 1, "estop_timeout_s": SILENCE}
    with running_node(tmp_path_factory.mktemp("wire"), **given) as wire:
        yield wire


# --- the e-stop -------------------------------------------------------------------------------------------


def test_every_engage_cancels_the_goal_and_only_a_resume_sends_the_next(wire: Wire) -> None:
    """Pressed, released, resumed, again and again: as many goals as resumes, each cancelled once."""
    rounds = 5
    wire.base.plan.extend([Drive.accept] * (rounds + 1))
    mission = wire.start("1")
    for number in range(1, rounds + 1):
        wire.until_driving(number)
        wire.estop(True)
        wire.until(lambda: wire.drives[-1].cancels, "the cancel on the wire")
        wire.until_held()
        wire.estop(False)
        wire.until(lambda: not wire.operator.state.estop_engaged, "released")
        assert wire.operator.state.paused
        assert len(wire.drives) == number
        assert wire.operator.ask("resume").success
    wire.until_driving(rounds + 1).arrive()
    wire.until_done(mission)
    assert [len(drive.cancels) for drive in wire.drives] == [1] * rounds + [0, 0]
    assert wire.outcomes(mission) == [("1", OK)]


def test_a_button_that_flaps_stops_once_and_stays_stopped(wire: Wire) -> None:
    """Story A37: many edges at once. Before a resume neither edge changes anything any more."""
    wire.base.plan.append(Drive.accept)
    mission = wire.start("1")
    drive = wire.until_driving()
    for _ in range(20):
        wire.estop(True, False)
        wire.ros.spin_once(0.001)
    wire.until(lambda: drive.ended, "stopped")
    wire.until_quiet()
    assert (wire.operator.state.estop_engaged, wire.operator.state.paused) == (False, True)
    assert (len(drive.cancels), len(wire.drives)) == (1, 1)
    assert wire.operator.ask("resume").success
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", OK)]


def test_a_button_that_is_pressed_again_right_after_the_resume_stops_again(wire: Wire) -> None:
    """The new goal may be anywhere between send and acceptance: it is cancelled all the same."""
    wire.base.plan.extend([Drive.accept, lambda _: wire.estop(True)])
    mission = wire.start("1")
    wire.until_driving()
    assert wire.operator.ask("pause").success
    assert wire.operator.ask("resume").success
    wire.until(lambda: wire.operator.state.estop_engaged, "pressed when the new goal arrived")
    late = wire.drives[1]
    late.accept()
    wire.until(lambda: late.cancels, "the cancel on the wire")
    wire.estop(False)
    wire.until(lambda: not wire.operator.state.estop_engaged, "released")
    assert wire.operator.ask("resume").success
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", OK)]


def test_a_button_that_was_told_steadily_and_falls_silent_stops(wire: Wire) -> None:
    """Its bridge has died, and nobody would hear it pressed. Heard again, it is what it says."""
    wire.base.plan.append(Drive.accept)
    mission = wire.start("1")
    drive = wire.until_driving()
    since = last = wire.ros.elapsed()

    def tell() -> None:
        nonlocal since, last
        now = wire.ros.elapsed()
        if now - last > 0.5 * GAP * SILENCE:  # that was not steady: this process was not let work
            since = now
        last = now
        wire.estop(False)

    steadily = wire.ros.timer(0.1, tell)
    wire.until(lambda: last - since > (ROW + 0.5) * SILENCE, "a while of that")
    assert (drive.cancels, wire.operator.state.estop_engaged) == ([], False)
    steadily.cancel()
    wire.until(lambda: drive.cancels, "the cancel on the wire")
    wire.until(lambda: wire.operator.state.estop_engaged, "the stop is told")
    assert not wire.operator.ask("resume").success
    wire.estop(False)
    wire.until(lambda: not wire.operator.state.estop_engaged, "heard again")
    assert wire.operator.ask("resume").success
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", OK)]


# --- the battery ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("low", [0.1, 10.0], ids=["fraction", "percent"])
def test_a_low_battery_of_either_scale_docks_once(wire: Wire, low: float) -> None:
    """Story 20: 10 is ten per cent, not a thousand."""
    wire.base.plan.append(Drive.accept)
    mission = wire.start("1")
    drive = wire.until_driving()
    wire.battery(low)
    wire.until(lambda: drive.cancels, "the cancel on the wire")
    wire.until_held()
    assert wire.operator.state.lifecycle_state == "RETURNING"
    assert wire.operator.state.battery_percentage == pytest.approx(0.1)
    wire.battery(80.0 if low > 1.0 else 0.8)
    wire.until(lambda: not wire.operator.state.battery_low, "charged")
    assert wire.operator.ask("resume").success
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", OK)]


def test_readings_of_the_battery_that_say_nothing_change_nothing(wire: Wire) -> None:
    """Not a number, infinite, negative: the level before stays, low or not."""
    nonsense = (math.nan, -1.0, -math.inf, math.inf)
    wire.base.plan.append(Drive.accept)
    mission = wire.start("1")
    drive = wire.until_driving()
    wire.battery(*nonsense, 0.55)
    wire.until(lambda: wire.operator.state.battery_percentage == pytest.approx(0.55), "all were heard")
    assert not wire.operator.state.battery_low
    assert drive.cancels == []
    wire.battery(0.1)
    wire.until(lambda: wire.operator.state.battery_low, "low")
    wire.battery(*nonsense, 0.11)
    wire.until(lambda: wire.operator.state.battery_percentage == pytest.approx(0.11), "all were heard")
    assert wire.operator.state.battery_low
    wire.battery(0.9)
    wire.until(lambda: not wire.operator.state.battery_low and wire.operator.state.paused, "docked, charged")
    assert wire.operator.ask("resume").success
    wire.until_done(mission)


def test_a_battery_that_flickers_at_the_threshold_is_one_trip_to_the_dock(wire: Wire) -> None:
    """Story A18: low below 20 %, high again above 25 % only; a resume in between is refused."""
    wire.base.plan.append(Drive.accept)
    mission = wire.start("1", "2")
    wire.until_driving()
    for _ in range(5):
        wire.battery(0.199, 0.201)
    wire.until(lambda: wire.operator.state.lifecycle_state == "RETURNING", "on the way home")
    wire.until_held()
    for _ in range(5):
        wire.battery(0.19, 0.249)
    wire.until(lambda: wire.operator.state.battery_percentage == pytest.approx(0.249), "all were heard")
    assert wire.operator.ask("resume").message == "resume refused: battery low"
    wire.battery(0.26)
    wire.until(lambda: not wire.operator.state.battery_low, "recovered")
    assert wire.operator.ask("resume").success
    wire.until(lambda: wire.outcomes(mission), "the first tag")
    wire.battery(0.21)  # not low again: above the threshold
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", OK), ("2", OK)]
    ways = [state for state in wire.operator.seen() if state.startswith("RETURNING")]
    docked = [s for s in wire.operator.states if s.lifecycle_state == "RETURNING" and s.mission_id == mission]
    assert ways
    assert {s.battery_low for s in docked if s.paused} == {True, False}
    # one goal to the tag, one to the dock, the two tags, and home
    assert len(wire.drives) == 5


def test_a_battery_that_recovers_on_the_way_home_still_docks(wire: Wire) -> None:
    """Story A38: why the robot returns is kept from the moment it turned round."""
    wire.base.plan.extend([Drive.accept, Drive.accept])
    mission = wire.start("1")
    wire.until_driving()
    wire.battery(0.1)
    home = wire.until_driving(2)
    wire.battery(0.9)
    wire.until(lambda: not wire.operator.state.battery_low, "recovered")
    home.arrive()
    wire.until_held()
    assert wire.operator.state.lifecycle_state == "RETURNING"
    assert wire.operator.ask("resume").success
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", OK)]


# --- the tags that were seen ------------------------------------------------------------------------------


def seen_tags(*names: str, stamp: float) -> DiscoveredTags:
    """Return a snapshot of tags."""
    message = DiscoveredTags()
    message.header.stamp = to_time(stamp)
    for name in names:
        tag = DiscoveredTag(tag_id=name, sightings=3)
        tag.pose_in_map.position.x = float(name)
        tag.pose_in_map.orientation.w = 1.0
        message.tags.append(tag)
    return message


def test_a_snapshot_from_before_the_mission_counts_for_nothing_however_often_it_comes(wire: Wire) -> None:
    """Story A41: latched, and repeated by a feed that has seen nothing since. The first new one counts."""
    feed = wire.ros.publisher(DiscoveredTags, "/perception/discovered_tags", Qos.LATCHED)
    wire.until(feed.get_subscription_count, "somebody who listens")
    old = seen_tags("3", "4", stamp=wire.ros.now() - 0.5)
    feed.publish(old)
    request = StartMission.Request(mission_type="ExplorationMission", discovery_goal=2)
    answer = wire.operator.call(StartMission, "/mission/start", request)
    assert answer.accepted, answer.error_message
    wire.operator.in_state("EXPLORING")
    for _ in range(3):
        feed.publish(old)
        wire.until_quiet()
        assert (wire.operator.state.lifecycle_state, wire.operator.state.tags_discovered) == ("EXPLORING", 0)
    feed.publish(seen_tags("5", "6", stamp=wire.ros.now()))
    wire.until_done(answer.mission_id)
    mine = [o for o in wire.operator.observations if o.mission_id == answer.mission_id]
    visited = [o.tag_reading.tag_id for o in mine if o.source == "MonitoringMission"]
    assert sorted(visited) == ["5", "6"]
