"""The digital twin over real DDS: what it is told, what it tells, and what a kill leaves of it."""

from __future__ import annotations

import json
import math
import os
import re
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Point32, Polygon, Pose, PoseStamped, Quaternion
from nav_msgs.msg import OccupancyGrid
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Header, String

from lupin_engine.errors import LupinError
from lupin_engine.plugin.wire import seconds_of
from lupin_msgs.msg import (
    AnomalyReport,
    DiscoveredTag,
    DiscoveredTags,
    FlowerObservation,
    FlowerPoint,
    Observation,
    SensorReading,
    TagReading,
    TwinState,
)
from lupin_msgs.srv import GetField
from lupin_ros.adapter.node import Qos, RosNode
from lupin_twin import node as twin_module
from lupin_twin import state as state_module
from lupin_twin.heatmap import Request
from lupin_twin.node import PARAMETERS, TwinNode
from lupin_twin.records import Discovery, Flowers, Reading
from lupin_twin.store import Store, StoreError, read
from tests.lupin_ros.helpers import PATIENCE, spin_until
from tests.lupin_ros.world import World

MakeNode = Callable[..., RosNode]

NEVER_FILLED_IN = Quaternion(x=0.0, y=0.0, z=0.0, w=0.0)
SQUARE = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]


def pose(x: float = 0.0, y: float = 0.0, q: Quaternion | None = None) -> Pose:
    return Pose(position=Point(x=x, y=y, z=0.7), orientation=q or Quaternion())


def header(sec: int = 100, frame: str = "map") -> Header:
    return Header(stamp=Time(sec=sec, nanosec=250_000_000), frame_id=frame)


def reading(tag: str, values: dict[str, float], at: Pose | None = None, **changed: Any) -> Observation:
    sensors = [SensorReading(name=name, value=value) for name, value in values.items()]
    told = {"header": header(), "mission_id": "m1", "kind": Observation.KIND_TAG_READING} | changed
    return Observation(
        tag_reading=TagReading(tag_id=tag, readings=sensors),
        tag_pose_in_map=at or pose(q=NEVER_FILLED_IN),
        **told,
    )


def flower(tag: str, at: Pose, anomaly: bool = True) -> Observation:
    bloom = FlowerPoint(position=Point(x=1.5, y=2.5), species="tulip_red", confidence=0.5, anomaly=False)
    seen = FlowerObservation(
        tag_id=tag,
        pose=PoseStamped(header=header(), pose=at),
        species="tulip_red",
        confidence=0.75,
        anomaly=anomaly,
        flowers=[bloom],
        box_footprint=Polygon(points=[Point32(x=x, y=y) for x, y in SQUARE]),
    )
    return Observation(header=header(), kind=Observation.KIND_FLOWER, flower=seen)


def discovered(*tags: tuple[str, Pose], frame: str = "map") -> DiscoveredTags:
    entries = [DiscoveredTag(tag_id=tag, pose_in_map=at) for tag, at in tags]
    return DiscoveredTags(header=header(frame=frame), tags=entries)


class Watcher:
    """The other side of the wire: what a robot tells the twin, and what an HMI sees of it."""

    def __init__(self, make_node: MakeNode) -> None:
        self.ros = make_node("watcher")
        self.observations = self.ros.publisher(Observation, "/floranova/observations", Qos.BACKLOG)
        self.discovered = self.ros.publisher(DiscoveredTags, "/perception/discovered_tags", Qos.LATCHED)
        self.boxes = self.ros.publisher(String, "/perception/box_geometry_json", Qos.LATCHED)
        self.maps = self.ros.publisher(OccupancyGrid, "/map", Qos.LATCHED)
        self.fields = self.ros.service(GetField, "/twin/get_field")
        self.states: list[TwinState] = []
        self.ros.subscribe(TwinState, "/twin/state", Qos.LATCHED, self.states.append)

    def tags(self) -> dict[str, Any]:
        """Return the tags of the latest state."""
        return {tag.tag_id: tag for tag in self.states[-1].tags} if self.states else {}

    def states_after(self, moment: float) -> list[TwinState]:
        """Return the states that were told after a moment: none is of a twin that had died by then."""
        return [state for state in self.states if seconds_of(state.header.stamp) > moment]


class Scene(Watcher):
    """A twin in this process that publishes quickly, and the other side."""

    def __init__(self, make_node: MakeNode, store: Path, *arguments: str) -> None:
        super().__init__(make_node)
        given = ["-p", f"store_file:={store}", "-p", "state_publish_rate_hz:=50.0", *arguments]
        self.twin = make_node("lupin_twin", ["--ros-args", *given], PARAMETERS)
        self.node = TwinNode(self.twin)
        self.until(self.fields.ready, "the service is there")
        # What is told to a listener of nothing latched before it is there is lost.
        self.until(lambda: self.boxes.get_subscription_count() == 1, "an ear for boxes")
        self.until(lambda: self.states, "a first state")

    def until(self, condition: Callable[[], Any], what: str = "") -> None:
        spin_until([self.twin, self.ros], condition, what=what)

    def tell(self, *observations: Observation) -> None:
        """Publish, and wait until a reading that comes after them has been taken."""
        for message in observations:
            self.observations.publish(message)
        count = len(self.tags())
        self.observations.publish(reading(f"marker {count}", {}))
        self.until(lambda: f"marker {count}" in self.tags())

    def ask(self, sensor: str = "temperature", resolution: float = 0.5, size: float = 2.0) -> Any:
        request = GetField.Request(
            sensor_type=sensor, resolution=resolution, bbox_max_x=size, bbox_max_y=size
        )
        return self.request(request)

    def request(self, request: GetField.Request) -> Any:
        answers: list[Any] = []
        self.fields.call(request, PATIENCE, answers.append)
        self.until(lambda: answers, "an answer")
        return answers[0]


@pytest.fixture
def scene(make_node: MakeNode, tmp_path: Path) -> Iterator[Scene]:
    scene = Scene(make_node, tmp_path / "twin.sqlite")
    yield scene
    scene.node.close()


@pytest.fixture
def warnings(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What the twin logs as warnings and errors."""
    said: list[str] = []
    for severity in ("warning", "error"):
        monkeypatch.setattr(f"lupin_ros.adapter.logs._RosSink.{severity}", lambda _, line: said.append(line))
    return said


# --- the state ---------------------------------------------------------------------------------------


def test_an_empty_state_is_published(scene: Scene) -> None:
    state = scene.states[0]
    assert list(state.tags) == []
    assert state.header.frame_id == "map"
    assert 0.0 <= scene.twin.now() - state.header.stamp.sec < 60.0


def test_a_reading_shows_in_the_state(scene: Scene) -> None:
    scene.tell(reading("5", {"temperature": 21.5, "co2": 400.0}, pose(1.0, 2.0)))
    tag = scene.tags()["5"]
    assert [(sensor.name, sensor.value) for sensor in tag.readings] == [("temperature", 21.5), ("co2", 400.0)]
    place, q = tag.pose.position, tag.pose.orientation
    assert (place.x, place.y, place.z, q.x, q.y, q.z, q.w) == (1.0, 2.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    assert (tag.last_observed.sec, tag.last_observed.nanosec) == (100, 250_000_000)


def test_a_tag_without_a_place_has_no_rotation_and_the_first_place_stays(scene: Scene) -> None:
    scene.tell(reading("5", {"temperature": 20.0}))
    q = scene.tags()["5"].pose.orientation
    assert (q.x, q.y, q.z, q.w) == (0.0, 0.0, 0.0, 0.0)
    scene.tell(reading("5", {"temperature": 21.0}, pose(1.0, 2.0)))
    scene.tell(reading("5", {"temperature": 22.0}, pose(8.0, 9.0)))
    tag = scene.tags()["5"]
    assert (tag.pose.position.x, tag.pose.orientation.w, tag.readings[0].value) == (1.0, 1.0, 22.0)


def test_flowers_show_in_the_state(scene: Scene) -> None:
    scene.tell(reading("5", {"temperature": 20.0}), flower("5", pose(1.0, 2.0)))
    tag = scene.tags()["5"]
    assert (tag.species, tag.species_confidence, tag.anomaly) == ("tulip_red", 0.75, True)
    assert [(bloom.position.x, bloom.species, bloom.confidence) for bloom in tag.flowers] == [
        (1.5, "tulip_red", 0.5)
    ]
    assert [(corner.x, corner.y) for corner in tag.box_footprint.points] == SQUARE
    assert (tag.pose.position.x, tag.readings[0].value) == (1.0, 20.0)
    scene.tell(flower("5", pose(1.0, 2.0), anomaly=False))
    assert scene.tags()["5"].anomaly is False


def test_a_discovered_tag_is_pinned_at_once_and_a_half_turn_survives(scene: Scene) -> None:
    half_turn = Quaternion(x=0.0, y=0.0, z=1.0, w=0.0)
    scene.discovered.publish(discovered(("3", pose(1.0, 2.0, half_turn)), ("4", pose(5.0, 6.0))))
    scene.until(lambda: len(scene.tags()) == 2)
    q = scene.tags()["3"].pose.orientation
    assert q.w != 0.0
    assert 2.0 * math.atan2(q.z, q.w) == pytest.approx(math.pi)
    tag = scene.tags()["4"]
    assert (tag.last_observed.sec, tag.stale_seconds > 1e8, list(tag.readings)) == (0, True, [])


def test_boxes_come_by_their_channel(scene: Scene) -> None:
    box = {"id": 5, "x": 2.0, "y": 1.0, "yaw": 0.0, "width": 1.0, "depth": 0.5, "height": 0.3}
    scene.boxes.publish(String(data=json.dumps([box])))
    scene.until(lambda: "5" in scene.tags())
    corners = [(corner.x, corner.y) for corner in scene.tags()["5"].box_footprint.points]
    assert corners == [(2.25, 1.5), (2.25, 0.5), (1.75, 0.5), (1.75, 1.5)]


def test_what_cannot_be_used_is_dropped_and_told_once(scene: Scene, warnings: list[str]) -> None:
    unheard = reading("5", {"temperature": 20.0}, kind=9)
    scene.tell(
        unheard,
        unheard,
        reading("", {"temperature": 20.0}),
        reading("5", {"temperature": 20.0}, header=header(frame="odom")),
        reading("5", {}, pose(1.0, 2.0), status=Observation.STATUS_SKIPPED),
        reading("5", {"temperature": 20.0}, pose(1.0, 2.0), status=9),
    )
    scene.discovered.publish(discovered(("5", pose()), frame="odom"))
    scene.boxes.publish(String(data="nonsense"))
    scene.until(lambda: len(warnings) == 6)
    assert "5" not in scene.tags()
    assert sorted(warnings) == [
        "box geometry dropped: JSONDecodeError: Expecting value: line 1 column 1 (char 0)",
        "discovered tags in frame 'odom' dropped, expected 'map'",
        "observation of unknown kind 9 dropped",
        "observation of unknown status 9 dropped",
        "tag reading in frame 'odom' dropped, expected 'map'",
        "tag reading without a tag id dropped",
    ]


def test_tags_without_end_are_told_once(
    scene: Scene, warnings: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(state_module, "MAX_TAGS", 3)
    scene.tell(reading("1", {"temperature": 20.0}))
    for tag in ("2", "3", "4"):
        scene.observations.publish(reading(tag, {"temperature": 20.0}))
    scene.until(lambda: warnings, "a complaint")
    assert warnings == ["no room for more than 10000 tags, 256 sensors: new ones dropped"]
    scene.until(lambda: list(scene.tags()) == ["1", "marker 0", "2"], "the third tag")
    scene.observations.publish(reading("1", {"temperature": 21.0}))
    scene.until(lambda: scene.tags()["1"].readings[0].value == 21.0, "what is known goes on")


def test_a_stale_request_is_answered_with_the_reason(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    """A display whose clock is behind is told so; without an answer its field would stay empty for ever."""
    now = time.time_ns
    monkeypatch.setattr(time, "time_ns", lambda: now() + 60_000_000_000)
    answer = scene.ask()
    assert answer == GetField.Response(error_message=answer.error_message)
    (age,) = re.findall(r"^refused: the request is (\d+\.\d) s old, or the clocks", answer.error_message)
    assert float(age) >= 60.0


def test_complaints_are_bounded(scene: Scene, warnings: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(twin_module, "MAX_COMPLAINTS", 2)
    for frame in ("a", "b", "c"):
        scene.tell(reading("5", {}, header=header(frame=frame)))
    assert len(warnings) == 3
    assert len(scene.node._complaints) <= 2


def test_an_anomaly_is_told_with_the_nearest_tag(scene: Scene, warnings: list[str]) -> None:
    report = AnomalyReport(
        pose=PoseStamped(header=header(), pose=pose(1.5, 2.0)), description="fallen plant", severity=2
    )
    told = Observation(header=header(), kind=Observation.KIND_ANOMALY, mission_id="m1", anomaly=report)
    scene.tell(reading("5", {}, pose(1.0, 2.0)), told)
    assert warnings == ["anomaly: fallen plant (severity=2 x=1.5 y=2.0 near_tag='5' mission='m1')"]
    assert [report.near for report in scene.node._twin.reports] == ["5"]


def test_a_tag_grows_older_while_nothing_is_told(scene: Scene) -> None:
    scene.tell(reading("5", {}))
    before = scene.tags()["5"].stale_seconds
    assert before == pytest.approx(scene.twin.now() - 100.25, rel=1e-6)
    scene.node._message.tags[0].stale_seconds = 0.0
    scene.states.clear()
    scene.until(lambda: scene.states)
    assert scene.tags()["5"].stale_seconds >= before


class Simulated(Scene):
    """A twin in simulated time, which stands still unless a test moves it."""

    def __init__(self, make_node: MakeNode, store: Path) -> None:
        super().__init__(make_node, store, "-p", "use_sim_time:=true")
        self.clock = self.ros.publisher(Clock, "/clock", Qos.EVENT)

    def at(self, seconds: int) -> None:
        """Let it be so late, and wait for a state of then."""

        def told() -> bool:
            # Again and again: of a clock nothing is kept for a node that is not matched yet.
            self.clock.publish(Clock(clock=Time(sec=seconds)))
            return bool(self.states[-1].header.stamp.sec == seconds)

        self.until(told, f"a state of {seconds} s")

    def age(self, tag: str) -> float:
        return float(self.tags()[tag].stale_seconds)


def test_a_simulation_that_begins_anew_leaves_no_tag_fresh_for_ever(
    make_node: MakeNode, tmp_path: Path
) -> None:
    """Before and after a restart of the twin: its store knows when the last simulation ended."""
    scene = Simulated(make_node, tmp_path / "twin.sqlite")
    scene.at(5000)
    scene.tell(reading("5", {"temperature": 20.0}, header=header(4990)))
    assert scene.age("5") == pytest.approx(9.75)
    scene.at(5)
    scene.at(8)
    assert scene.age("5") == pytest.approx(3.0)
    assert scene.tags()["5"].last_observed == Time(sec=5)
    scene.observations.publish(reading("6", {"temperature": 20.0}, header=header(6)))
    scene.until(lambda: "6" in scene.tags(), "a reading of the new simulation")
    assert scene.age("6") == pytest.approx(1.75)
    scene.node.close()
    scene.twin.close()
    again = Simulated(make_node, tmp_path / "twin.sqlite")
    again.at(10)
    assert (again.age("5"), again.age("6")) == (pytest.approx(2.0), pytest.approx(3.75))
    again.at(4)
    again.at(5)
    assert (again.age("5"), again.age("6")) == (pytest.approx(1.0), pytest.approx(1.0))
    again.node.close()


def test_a_computer_that_does_not_know_the_time_yet_forgets_no_age(
    make_node: MakeNode, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """War story 36, from another side: one without a battery-backed clock starts in 1970."""
    store = Store(str(tmp_path / "twin.sqlite"))
    store.add(Reading("5", 1.8e9, "m", "s", ()), 1.8e9)
    store.close()
    now = [5.0]
    monkeypatch.setattr(RosNode, "now", lambda _: now[0])
    scene = Scene(make_node, tmp_path / "twin.sqlite")
    assert scene.tags()["5"].last_observed.sec == 1_800_000_000
    now[0] = 1.8e9 + 60.0
    scene.until(lambda: scene.tags()["5"].stale_seconds == pytest.approx(60.0), "the true age")
    scene.node.close()


def test_the_state_is_told_while_simulated_time_stands_still(make_node: MakeNode, tmp_path: Path) -> None:
    """A panel that hears nothing for 3 s greys everything; a simulation that is paused is no dead twin."""
    scene = Simulated(make_node, tmp_path / "twin.sqlite")
    scene.at(5000)
    count = len(scene.states)
    scene.until(lambda: len(scene.states) >= count + 3, "further states")
    assert scene.states[-1].header.stamp == Time(sec=5000)
    scene.node.close()


# --- the field ---------------------------------------------------------------------------------------


def test_a_field_is_answered(scene: Scene) -> None:
    scene.tell(reading("5", {"temperature": 20.0}, pose(0.25, 0.25)))
    answer = scene.ask()
    assert (answer.ok, answer.error_message) == (True, "")
    assert (answer.width, answer.height, len(answer.values)) == (4, 4, 16)
    assert (answer.origin_x, answer.origin_y, answer.resolution_used) == (0.0, 0.0, 0.5)
    assert (answer.value_min, answer.value_max, answer.sample_count) == (20.0, 20.0, 1)
    assert answer.values[0] == 20.0
    assert math.isnan(answer.values[15])  # 2.1 m away
    again = scene.ask()
    assert list(again.values)[:15] == list(answer.values)[:15]


def test_a_new_reading_changes_the_field(scene: Scene) -> None:
    scene.tell(reading("5", {"temperature": 20.0}, pose(0.25, 0.25)))
    assert scene.ask().value_max == 20.0
    scene.tell(reading("5", {"temperature": 24.0}, header=header(101)))
    assert scene.ask().value_max == 24.0


def test_a_sensor_without_a_number_does_not_poison_the_field(scene: Scene) -> None:
    """War story 56: one such value made the whole field none."""
    scene.tell(
        reading("5", {"temperature": 20.0}, pose(0.25, 0.25)),
        reading("6", {"temperature": math.nan}, pose(0.75, 0.25)),
    )
    answer = scene.ask()
    assert (answer.value_min, answer.value_max, answer.sample_count) == (20.0, 20.0, 1)
    assert list(answer.values)[:4] == [20.0] * 4


def test_without_data_a_field_has_no_values(scene: Scene) -> None:
    answer = scene.ask("co2")
    assert answer.ok
    assert all(map(math.isnan, answer.values))
    assert (answer.value_min, answer.value_max, answer.sample_count) == (0.0, 0.0, 0)


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({"sensor_type": ""}, "the sensor type is empty; allowed: "),
        ({"sensor_type": "../../etc/passwd"}, "unknown sensor type '../../etc/passwd'; "),
        ({"sensor_type": "\N{SNOWMAN}" * 100_000}, "unknown sensor type '"),
        ({"resolution": 0.0}, "the resolution must be above 0 m, got 0"),
        ({"resolution": -1.0}, "the resolution must be above 0 m, got -1"),
        ({"resolution": math.nan}, "the resolution must be above 0 m, got nan"),
        ({"bbox_max_x": -1.0}, "the bounds of x are the wrong way round: 0 to -1"),
        ({"bbox_min_y": math.nan}, "the bounds must be finite, got x 0 to 2, y nan to 2"),
        ({"bbox_max_y": math.inf}, "the bounds must be finite, got x 0 to 2, y 0 to inf"),
        ({"bbox_max_x": 3e38, "resolution": 1e-38}, "3e+38 m x 2 m at 1e-38 m are more than 250000 cells; "),
    ],
)
def test_a_hostile_request_is_refused_and_the_twin_lives_on(
    scene: Scene, changed: dict[str, Any], reason: str
) -> None:
    sound = {"sensor_type": "temperature", "resolution": 0.5, "bbox_max_x": 2.0, "bbox_max_y": 2.0}
    answer = scene.request(GetField.Request(**(sound | changed)))
    assert answer == GetField.Response(error_message=answer.error_message)
    assert answer.error_message.startswith(reason)
    assert len(answer.error_message) < 300
    assert scene.ask().ok


def test_the_map_hides_what_nobody_has_seen(scene: Scene) -> None:
    scene.tell(reading("5", {"temperature": 20.0}, pose(0.25, 0.25)))
    message = OccupancyGrid(header=header(), data=[0, -1])
    message.info.width, message.info.height, message.info.resolution = 2, 1, 1.0
    scene.maps.publish(message)
    scene.until(lambda: sum(map(math.isfinite, scene.ask().values)) == 4)
    assert [index for index, value in enumerate(scene.ask().values) if math.isfinite(value)] == [0, 1, 4, 5]


def test_the_settings_are_parameters(make_node: MakeNode, tmp_path: Path) -> None:
    scene = Scene(make_node, tmp_path / "twin.sqlite", "-p", "max_distance_to_nearest_tag:=0.6")
    scene.tell(reading("5", {"temperature": 20.0}, pose(0.25, 0.25)))
    assert sum(map(math.isfinite, scene.ask().values)) == 3
    scene.node.close()


@pytest.mark.parametrize("given", ["state_publish_rate_hz:=0.01", "buffer_len:=0", "idw_power:=-1.0"])
def test_a_setting_out_of_range_is_refused(make_node: MakeNode, given: str) -> None:
    with pytest.raises(LupinError, match=given.partition(":")[0]):
        make_node("lupin_twin", ["--ros-args", "-p", given], PARAMETERS)


# --- the store ---------------------------------------------------------------------------------------


def test_a_corrupt_store_is_put_aside_and_told(
    make_node: MakeNode, tmp_path: Path, warnings: list[str]
) -> None:
    path = tmp_path / "twin.sqlite"
    path.write_bytes(b"garbage" * 1000)
    scene = Scene(make_node, path)
    reason = "is not a store of the twin (file is not a database)"
    assert warnings == [f"{path} {reason}: kept as {path}.corrupt-1, a new one begun"]
    scene.tell(reading("5", {"temperature": 20.0}))
    scene.node.close()


def test_a_record_is_kept_before_it_is_known(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    known_when_kept: list[bool] = []
    store, add = scene.node._store, scene.node._store.add

    def watched(*arguments: Any) -> bool:
        known_when_kept.append("5" in scene.node._twin.tags)
        return add(*arguments)

    monkeypatch.setattr(store, "add", watched)
    scene.tell(reading("5", {"temperature": 20.0}))
    assert known_when_kept == [False, True]  # the second one is the marker's


def test_an_observation_that_arrives_again_changes_nothing(scene: Scene) -> None:
    first, second = reading("5", {"co2": 400.0}), reading("5", {"co2": 500.0}, header=header(101))
    scene.tell(first, second, first)
    assert scene.tags()["5"].readings[0].value == 500.0
    assert scene.node._twin.observation_count == 3  # two, and the marker


def test_with_a_full_disk_the_twin_goes_on_and_keeps_everything_later(
    scene: Scene, make_node: MakeNode, warnings: list[str]
) -> None:
    database = scene.node._store._db
    database.execute("PRAGMA max_page_count = 4")
    many = [reading(str(n), {f"sensor_{k}": 1.0 for k in range(200)}) for n in range(8)]
    scene.tell(*many)
    assert len(scene.tags()) == 9
    (told,) = warnings
    assert told.startswith(f"records cannot be kept: {scene.node._store.path}: database or disk is full; ")
    database.execute(f"PRAGMA max_page_count = {2**30}")
    scene.until(lambda: scene.node._store.waiting == 0, "written at the next tick")
    rows = database.execute("SELECT count(*) FROM record").fetchone()
    assert rows == (9,)


def test_a_map_is_kept_and_known_after_a_restart(
    make_node: MakeNode, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = Scene(make_node, tmp_path / "twin.sqlite")
    scene.tell(reading("5", {"temperature": 20.0}, pose(0.25, 0.25)))
    message = OccupancyGrid(header=header(), data=[0, -1])
    message.info.width, message.info.height, message.info.resolution = 2, 1, 1.0
    scene.maps.publish(message)
    scene.until(lambda: scene.node._store.map() is not None, "the first map is kept at once")
    monkeypatch.setattr(scene.node, "_map_kept", math.inf)
    message.data = [-1, 0]
    scene.maps.publish(message)
    scene.until(lambda: math.isnan(scene.ask().values[0]), "the second map is used")
    scene.node.close()
    content = read(str(tmp_path / "twin.sqlite"))
    assert content.map is not None
    assert content.map.cells.tolist() == [[-1, 0]]  # kept at the end, before its time
    given = ["--ros-args", "-p", f"store_file:={tmp_path / 'twin.sqlite'}"]
    again = TwinNode(
        make_node("lupin_twin", given, PARAMETERS)
    )  # its node does not work: no map is told to it
    request = Request("temperature", 0.5, 0.0, 0.0, 2.0, 2.0)
    cells = np.frombuffer(again._heatmaps.answer(request).values, dtype=np.float32)
    assert np.flatnonzero(np.isfinite(cells)).tolist() == [2, 3, 6, 7]
    again.close()


def test_two_twins_do_not_share_a_store(make_node: MakeNode, scene: Scene, tmp_path: Path) -> None:
    path = tmp_path / "twin.sqlite"
    second = make_node("second", ["--ros-args", "-p", f"store_file:={path}"], PARAMETERS)
    with pytest.raises(StoreError) as refused:
        TwinNode(second)
    assert str(refused.value) == f"{path} is used by another twin; give this one a store_file of its own"
    scene.tell(reading("5", {"temperature": 20.0}))


def test_a_twin_that_was_killed_has_lost_nothing(make_node: MakeNode, tmp_path: Path) -> None:
    watcher, world = Watcher(make_node), World(tmp_path)
    store = tmp_path / "twin.sqlite"
    spin = [watcher.ros]
    try:
        twin = world.start("lupin_twin", store_file=store, state_publish_rate_hz=20.0)
        for n in range(60):  # more than the backlog of the topic
            watcher.observations.publish(reading(str(n), {"temperature": float(n)}, pose(float(n), 1.0)))
            spin_until(spin, lambda n=n: str(n) in watcher.tags(), what=f"tag {n} is told")
        watcher.observations.publish(flower("7", pose(7.0, 1.0)))
        watcher.discovered.publish(discovered(("seen", pose(3.0, 4.0))))
        spin_until(spin, lambda: "seen" in watcher.tags() and watcher.tags()["7"].species)
        before = watcher.tags()
        os.killpg(twin.pid, signal.SIGKILL)
        twin.wait(10.0)
        for n in range(40):  # the mission goes on without a twin
            watcher.observations.publish(reading(f"later {n}", {"temperature": float(n)}, pose(1.0, 2.0)))
        died = watcher.ros.now()
        world.start("lupin_twin", store_file=store, state_publish_rate_hz=20.0)
        spin_until(spin, lambda: watcher.states_after(died), what="the restarted twin tells its state")
        first, after = watcher.states_after(died)[0], watcher.tags()
        assert [tag.tag_id for tag in first.tags][: len(before)] == list(before)
        assert [comparable(after[name]) for name in before] == [comparable(tag) for tag in before.values()]
        # The backlog of the topic has arrived by now: what was kept already is not kept again.
        watcher.observations.publish(reading("last", {}))
        spin_until(spin, lambda: "last" in watcher.tags())
    finally:
        assert world.stop() == []
    kept = Store(str(store))
    rows = list(kept.rows())
    kept.close()
    assert sum(isinstance(row.record, Discovery) for row in rows) == 1
    assert sum(isinstance(row.record, Reading) for row in rows) == 101
    assert sum(isinstance(row.record, Flowers) for row in rows) == 1
    assert "(tags=61 observations=61 " in world.log("lupin_twin").read_text()


def comparable(tag: Any) -> Any:
    """Return a tag without its age."""
    tag.stale_seconds = 0.0
    return tag
