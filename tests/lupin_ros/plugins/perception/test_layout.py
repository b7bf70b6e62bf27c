"""The known layout laid over the map by the aggregator; and the twin, which shows what it finds."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from std_msgs.msg import String

from lupin_msgs.msg import Observation, TwinState
from lupin_ros.adapter.node import Qos, RosNode
from lupin_twin.node import PARAMETERS as TWIN_PARAMETERS
from lupin_twin.node import TwinNode
from tests.lupin_ros.helpers import spin_until
from tests.lupin_ros.plugins.perception.test_node import BUG, RED, Log, Scene

MakeNode = Callable[..., RosNode]

#: A table of 1.1 m by 0.25 m; tag 6 hangs at its left, tag 29 on its right, and nothing at the other one.
LAYOUT = {
    "tags": {"6": {"x": 1.5, "y": 7.3}, "29": {"x": 2.4, "y": 7.3}, "1": {"x": 0.0, "y": 0.0}},
    "tables": {
        "Table1": {"x0": 1.5, "x1": 2.6, "y0": 7.3, "y1": 7.55},
        "Table2": {"x0": 1.5, "x1": 2.6, "y0": 6.6, "y1": 6.85},
    },
}
#: The map begins elsewhere than the layout: this is where the layout's origin is on the map, not turned.
SHIFT_X, SHIFT_Y = 0.5, -7.3


def plate_facing(heading: float) -> tuple[float, float, float, float]:
    """A plate whose +Z looks along `heading`."""
    half = math.sqrt(0.5)
    return -half * math.sin(heading), half * math.cos(heading), 0.0, half


@pytest.fixture
def scene(make_node: MakeNode, tmp_path: Path) -> Scene:
    """The aggregator with that layout, in the middle of a mission."""
    file = tmp_path / "layout.json"
    file.write_text(json.dumps(LAYOUT))
    made = Scene(make_node, "-p", f"tag_locations_file:={file}", "-p", "tag_in_sight_s:=0.1")
    made.mission("MONITORING", "SCANNING", "6")
    return made


def find_both(scene: Scene) -> None:
    for tag, x in ((6, 1.5), (29, 2.4)):
        scene.place(tag, x + SHIFT_X, 7.3 + SHIFT_Y, plate_facing(-math.pi / 2))
        scene.see(tag, times=3)


def heard_boxes(scene: Scene) -> list[str]:
    heard: list[str] = []
    scene.world.subscribe(
        String, "/perception/box_geometry_json", Qos.EVENT, lambda message: heard.append(message.data)
    )
    return heard


def test_boxes_are_told_as_soon_as_tags_say_how_the_layout_lies(scene: Scene) -> None:
    """And again and again: who cannot ask for a latched message hears them too."""
    heard = heard_boxes(scene)
    find_both(scene)
    scene.until(lambda: len(heard) >= 2, "the boxes, twice")
    boxes = {entry.pop("id"): entry for entry in json.loads(heard[-1])}
    assert set(boxes) == {"6", "29"}, "the tag that was not found has none"
    table = {"x": 2.05 + SHIFT_X, "y": 7.425 + SHIFT_Y, "yaw": -math.pi / 2}
    for box in boxes.values():
        assert box == pytest.approx({**table, "width": 1.1, "depth": 0.25, "height": 0.3})


def test_blooms_stand_on_the_table_and_the_next_tables_are_left_out(scene: Scene) -> None:
    """War stories 49 and 50."""
    heard = heard_boxes(scene)
    find_both(scene)
    scene.until(lambda: heard, "the boxes")
    scene.flowers(RED)
    told = scene.told(1).flower
    xs, ys = zip(*((corner.x, corner.y) for corner in told.box_footprint.points), strict=True)
    assert (min(xs), max(xs)) == pytest.approx((1.5 + SHIFT_X, 2.6 + SHIFT_X))
    assert (min(ys), max(ys)) == pytest.approx((7.3 + SHIFT_Y, 7.55 + SHIFT_Y))
    assert (told.pose.pose.position.x, told.pose.pose.position.y) == pytest.approx((1.5 + SHIFT_X, 0.0))


def test_without_enough_tags_nothing_is_told_and_the_box_is_the_one_behind_the_tag(scene: Scene) -> None:
    heard = heard_boxes(scene)
    scene.place(6, 1.5 + SHIFT_X, 0.0, plate_facing(-math.pi / 2))
    scene.see(6, times=3)
    scene.flowers(RED)
    xs = [corner.x for corner in scene.told(1).flower.box_footprint.points]
    assert (min(xs), max(xs)) == pytest.approx((1.5 + SHIFT_X - 0.4, 1.5 + SHIFT_X + 0.4))
    assert heard == []


def test_a_layout_that_is_of_another_greenhouse_is_not_used(scene: Scene) -> None:
    """A26: boxes where none are would drop real blooms."""
    heard = heard_boxes(scene)
    for tag, x in ((6, 1.5), (29, 4.0)):
        scene.place(tag, x, 0.0, plate_facing(-math.pi / 2))
        scene.see(tag, times=3)
    scene.until(lambda: scene.log.warnings, "the reason")
    assert scene.log.warnings == [
        "no boxes from the layout: the layout does not fit: tags are more than 0.15 m from where it has them"
    ]
    assert heard == []


class Watched:
    """The aggregator's scene with a twin that listens to it."""

    def __init__(self, scene: Scene, make_node: MakeNode) -> None:
        self.scene = scene
        self.twin = make_node("lupin_twin", ["--ros-args", "-p", "store_file:=':memory:'"], TWIN_PARAMETERS)
        self.log = Log()
        self.twin.log = self.log  # type: ignore[assignment]
        self.node = TwinNode(self.twin)
        self.states: list[Any] = []
        scene.world.subscribe(TwinState, "/twin/state", Qos.LATCHED, self.states.append)
        self.until(lambda: self.states, "the twin")

    def until(self, condition: Callable[[], Any], what: str) -> None:
        spin_until([self.scene.node, self.scene.world, self.twin], condition, what=what)

    def tag(self, tag_id: str) -> Any:
        return next((tag for tag in self.states[-1].tags if tag.tag_id == tag_id), None)


def test_the_twin_shows_what_the_aggregator_tells(scene: Scene, make_node: MakeNode) -> None:
    """Place, species, blooms, pest, and the table's own rectangle, over the wire."""
    watched = Watched(scene, make_node)
    find_both(scene)
    scene.flowers(RED, BUG)
    watched.until(lambda: (tag := watched.tag("6")) and tag.species and tag.box_footprint.points, "tag 6")
    tag = watched.tag("6")
    assert (tag.species, tag.anomaly, len(tag.flowers)) == ("tulip_red", True, 1)
    assert (tag.pose.position.x, tag.pose.position.y) == pytest.approx((1.5 + SHIFT_X, 0.0))

    def width() -> float:
        xs = [corner.x for corner in watched.tag("6").box_footprint.points]
        return max(xs) - min(xs)

    watched.until(lambda: width() == pytest.approx(1.1), "the table's rectangle")
    assert watched.tag("29").species == ""


def test_a_pest_at_no_tag_is_kept_by_the_twin_and_named_with_the_nearest_tag(
    scene: Scene, make_node: MakeNode
) -> None:
    """KIND_ANOMALY from its producer to its consumer."""
    watched = Watched(scene, make_node)
    scene.place(6, 1.5 + SHIFT_X, 0.0, plate_facing(-math.pi / 2))
    scene.see(6, times=3)
    watched.until(lambda: watched.tag("6"), "the tag")
    scene.mission("EXPLORING")
    scene.wait(0.2)  # until the tag is out of sight
    scene.place(7, robot=2.5)
    for _ in range(3):
        scene.flowers(BUG)
    watched.until(lambda: watched.node._twin.reports, "the report")
    (report,) = watched.node._twin.reports
    assert (report.anomaly.description, report.anomaly.severity, report.near) == (
        "bug seen where no tag is in sight (confidence 0.80)",
        1,
        "6",
    )
    assert (report.anomaly.x, report.anomaly.y, report.anomaly.mission_id) == (2.5, 0.0, "m1")
    assert "anomaly: bug seen where no tag is in sight (confidence 0.80)" in watched.log.warnings
    assert scene.told(1).kind == Observation.KIND_ANOMALY
