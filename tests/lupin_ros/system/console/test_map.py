"""The map over the simulated greenhouse, and over maps, tags and transforms of the tests' own."""

from __future__ import annotations

import csv
import json
import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("playwright", reason="playwright is not installed here")

from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Point32, Quaternion, TransformStamped
from nav2_msgs.action import NavigateToPose
from nav_msgs.msg import OccupancyGrid
from playwright.sync_api import BrowserContext, Locator, Page, expect
from tf2_msgs.msg import TFMessage
from websockets.sync.client import ClientConnection, connect

from lupin_gateway.people import COMMANDS, PEOPLE_TOPIC
from lupin_greenhouse.readings import SENSOR_UNITS
from lupin_msgs.msg import FlowerPoint, MissionState, Observation, SensorReading, TwinState, TwinTagState
from lupin_ros.adapter.node import Qos, RosNode, ServedGoal
from lupin_ros.service.names import COMMAND_SERVICE
from tests.lupin_ros.plugins.gateway.conftest import gateway
from tests.lupin_ros.system.console.conftest import PATIENCE_MS, Served, stall, telling
from tests.lupin_ros.world import World

pytestmark = pytest.mark.long

__all__ = ["gateway"]

expect.set_options(timeout=PATIENCE_MS)

#: Tags of the simulated greenhouse.
TAGS = 29
#: The colours of a scale, at equal distances, and those of cells in the light theme.
RAMP = ((68, 1, 84), (62, 74, 137), (38, 130, 142), (53, 183, 121), (160, 218, 57), (253, 231, 37))
UNKNOWN, FREE, OCCUPIED, ACCENT = (201, 206, 211), (255, 255, 255), (43, 54, 64), (11, 92, 138)
ROBOT, SILENT = (138, 80, 0), (196, 202, 208)
Rgb = Sequence[float]


class Wire:
    """What the gateway tells and answers, without the page."""

    def __init__(self, socket: ClientConnection) -> None:
        self._socket = socket

    def _until(self, fits: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        while True:
            frame: dict[str, Any] = json.loads(self._socket.recv(timeout=PATIENCE_MS / 1000))
            if fits(frame):
                return frame

    def call(self, service: str, **args: Any) -> dict[str, Any]:
        """Call a service and return its answer."""
        self._socket.send(json.dumps({"op": "call_service", "id": "one", "service": service, "args": args}))
        answer = self._until(lambda frame: frame.get("id") == "one" and frame["op"] == "service_response")
        assert answer["result"], answer
        values: dict[str, Any] = answer["values"]
        return values

    def until(self, topic: str, type_: str, fits: Callable[[Any], bool]) -> Any:
        """Return the next message of a topic that fits."""
        self._socket.send(json.dumps({"op": "subscribe", "id": topic, "topic": topic, "type": type_}))
        found = self._until(lambda frame: frame.get("topic") == topic and fits(frame["msg"]))["msg"]
        self._socket.send(json.dumps({"op": "unsubscribe", "id": topic, "topic": topic}))
        return found

    def field(self, sensor: str) -> dict[str, Any]:
        """Return the field over the whole greenhouse, as fine as the page asks for it."""
        box = {"bbox_min_x": -0.05, "bbox_min_y": -0.05, "bbox_max_x": 4.05, "bbox_max_y": 8.05}
        return self.call("/twin/get_field", sensor_type=sensor, resolution=0.1, **box)


@contextmanager
def wired(served: Served) -> Iterator[Wire]:
    """Connect to a gateway."""
    with connect(served.url.replace("http", "ws") + "_ros", max_size=None) as socket:
        yield Wire(socket)


@dataclass
class MapCanvas:
    """The map of a page; places are metres."""

    page: Page

    @property
    def canvas(self) -> Locator:
        """The element."""
        return self.page.locator("canvas.map-canvas")

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Return where a place is on the canvas, in CSS pixels."""
        seen = self.canvas.evaluate("c => ({...c.dataset, w: c.clientWidth, h: c.clientHeight})")
        middle, scale = (float(seen["x"]), float(seen["y"])), float(seen["scale"])
        return seen["w"] / 2 + (x - middle[0]) * scale, seen["h"] / 2 - (y - middle[1]) * scale

    def press(self, x: float, y: float) -> None:
        """Press and release at a place."""
        left, top = self.at(x, y)
        self.canvas.click(position={"x": left, "y": top})

    def hover(self, x: float, y: float) -> None:
        """Move the pointer to a place."""
        left, top = self.at(x, y)
        self.canvas.hover(position={"x": left, "y": top})

    def colour(self, x: float, y: float) -> Rgb:
        """Return the colour of the pixel at a place."""
        look = "(c, at) => [...c.getContext('2d').getImageData(...at, 1, 1).data].slice(0, 3)"
        found: Rgb = self.canvas.evaluate(look, list(self.at(x, y)))
        return found

    def until_colour(self, x: float, y: float, wanted: Rgb) -> None:
        """Look once a frame until the pixel at a place has a colour."""
        for _ in range(1200):
            if math.dist(self.colour(x, y), wanted) < 8:
                return
            self.page.evaluate("() => new Promise(requestAnimationFrame)")
        assert math.dist(self.colour(x, y), wanted) < 8, (x, y, self.colour(x, y), wanted)

    def hide(self, *layers: str) -> None:
        """Switch layers off."""
        self.page.locator(".map-layers").evaluate("part => (part.open = true)")
        for layer in layers:
            self.page.get_by_label(layer, exact=True).uncheck()


def ramp(value: float, low: float, high: float) -> Rgb:
    """Return the colour of a value on a scale."""
    place = min(1.0, max(0.0, (value - low) / (high - low))) * (len(RAMP) - 1)
    begin = min(int(place), len(RAMP) - 2)
    return [a + (b - a) * (place - begin) for a, b in zip(RAMP[begin], RAMP[begin + 1], strict=True)]


@pytest.fixture(scope="module")
def robot(serve: Callable[..., Served]) -> Served:
    """`lupin up --hmi` with a fast robot."""
    return serve("up", "--speed", "8")


@pytest.fixture
def wire(robot: Served) -> Iterator[Wire]:
    """The gateway of the simulated greenhouse."""
    with wired(robot) as found:
        yield found


@pytest.fixture
def greenhouse(console: Page) -> MapCanvas:
    """The map of the simulated greenhouse, once its floor is there."""
    console.get_by_role("link", name="Map").click()
    found = MapCanvas(console)
    expect(found.canvas).to_have_attribute("aria-label", re.compile(r"^Map of 4\.1 by 8\.1 m"))
    found.until_colour(0.5, -0.025, OCCUPIED)
    return found


def test_a_press_a_drag_and_a_confirmation_drive_the_robot(greenhouse: MapCanvas) -> None:
    page = greenhouse.page
    page.get_by_role("button", name="Drive to a place…").click()
    left, top = greenhouse.at(0.8, 0.6)
    box = greenhouse.canvas.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + left, box["y"] + top)
    page.mouse.down()
    page.mouse.move(box["x"] + left, box["y"] + top - 40, steps=4)
    page.mouse.up()
    asked = page.get_by_text(re.compile(r"^Drive to x .* m, y .* m, heading 90°\?"))
    expect(asked).to_be_visible()
    place = re.search(r"x (\S+) m, y (\S+) m", asked.inner_text())
    assert place is not None
    assert [float(each) for each in place.groups()] == pytest.approx([0.8, 0.6], abs=0.03)
    page.get_by_role("button", name="Drive", exact=True).click()
    expect(page.get_by_text(f"Sent to {place[0]}.")).to_be_visible()
    expect(asked).to_have_count(0)
    greenhouse.until_colour(0.8, 0.6, ROBOT)
    greenhouse.press(0.8, 0.6)
    expect(page.locator(".map-chosen")).to_contain_text(place[0])
    expect(page.locator(".map-chosen")).to_contain_text("heading 90°")


def test_without_a_pointer_a_place_is_chosen_by_keys(greenhouse: MapCanvas) -> None:
    page = greenhouse.page
    page.get_by_role("button", name="Drive to a place…").focus()
    page.keyboard.press("Enter")
    greenhouse.canvas.focus()
    for key in ("Shift+ArrowUp", "ArrowLeft", "[", "["):
        page.keyboard.press(key)
    asked = page.get_by_text(re.compile(r"^Drive to x 0\.7\d m, y 1\.\d\d m, heading 120°\?"))
    expect(asked).to_be_visible()
    page.keyboard.press("Escape")
    expect(asked).to_have_count(0)


def test_tags_are_picked_for_a_field_of_a_form(greenhouse: MapCanvas) -> None:
    page = greenhouse.page
    form = page.get_by_role("form", name="InspectionMission")
    form.get_by_text("Options").click()
    form.get_by_role("button", name="Pick on the map").click()
    entry = page.locator(
        '.map-tags button[data-tag="19"]'
    )  # the one that the robot sees from where it starts
    expect(entry).to_be_visible()
    greenhouse.press(1.5, 0.6)
    expect(page.get_by_text(re.compile("^Pick tags for .* of InspectionMission: 19$"))).to_be_visible()
    expect(form.locator("input").first).to_have_value("19")
    entry.press("Enter")
    expect(form.locator("input").first).to_have_value("")
    page.get_by_role("button", name="Back to the form").click()
    expect(page.locator("main.alone")).to_be_visible()


def test_during_a_mission_nobody_drives_by_the_map(greenhouse: MapCanvas, wire: Wire) -> None:
    page = greenhouse.page
    page.get_by_role("button", name="Drive to a place…").click()
    greenhouse.press(0.8, 0.9)
    expect(page.get_by_role("button", name="Drive", exact=True)).to_be_enabled()
    assert wire.call("/mission/start", mission_type="InspectionMission")["accepted"]
    expect(page.get_by_role("button", name="Drive", exact=True)).to_be_disabled()
    expect(page.locator("#map-drive-why")).to_contain_text("Not during a mission (")
    page.get_by_role("button", name="Cancel").click()
    page.get_by_role("button", name="Drive to a place…").click(force=True)
    expect(page.get_by_text("Press on the map")).to_have_count(0)


def test_an_operator_takes_the_base_of_a_mission_that_is_held(greenhouse: MapCanvas, wire: Wire) -> None:
    page, why = greenhouse.page, greenhouse.page.locator("#map-drive-why")
    take = page.get_by_role("button", name="Take the base")
    expect(take).to_have_count(0)
    assert wire.call(COMMAND_SERVICE, verb="pause")["accepted"]
    expect(why).to_have_text("A mission is held: take the base first. Resume the mission to give it back.")
    take.click()
    page.get_by_role("button", name="Drive to a place…").click()
    greenhouse.press(0.8, 0.9)
    page.get_by_role("button", name="Drive", exact=True).click()
    expect(page.locator(".map-drive [role=status]")).to_contain_text("Sent to x")
    greenhouse.until_colour(0.8, 0.9, ROBOT)
    page.get_by_role("button", name="Give the base back").click()
    expect(why).to_contain_text("take the base first")
    take.click()
    expect(page.get_by_role("button", name="Give the base back")).to_be_visible()
    assert wire.call(COMMAND_SERVICE, verb="resume")["accepted"]
    expect(why).to_contain_text("Not during a mission (")
    expect(page.get_by_role("button", name="Give the base back")).to_have_count(0)


def commanded(line: dict[str, Any]) -> str:
    """Return what a line of the audit log says of a goal, or the name of the service that was called."""
    if line["what"] == "send_action_goal":
        return str(line.get("answer", "sent"))
    return "cancelled" if line["what"] == "cancel_action_goal" else str(line["name"])


def drive_to(greenhouse: MapCanvas, x: float, y: float) -> None:
    """Send the robot to a place by the map."""
    page = greenhouse.page
    page.get_by_role("button", name="Drive to a place…").click()
    greenhouse.press(x, y)
    page.get_by_role("button", name="Drive", exact=True).click()


def test_giving_the_base_back_ends_the_drive_first(greenhouse: MapCanvas, wire: Wire, robot: Served) -> None:
    page, why = greenhouse.page, greenhouse.page.locator("#map-drive-why")
    assert wire.call(COMMAND_SERVICE, verb="pause")["accepted"]
    page.get_by_role("button", name="Take the base").click()
    drive_to(greenhouse, 0.8, 0.9)
    expect(page.locator(".map-drive [role=status]")).to_contain_text("Arrived at x 0.")
    before = wire.call(COMMANDS)["commands"][-1]["number"]
    stall(robot, 2)
    drive_to(greenhouse, 0.8, 7.5)
    expect(page.locator(".map-drive [role=status]")).to_contain_text("Sent to x")
    drive_to(greenhouse, 0.5, 0.5)  # takes the place of the drive before
    ended = before + len(("sent", "sent", "ended"))
    wire.until(PEOPLE_TOPIC, "std_msgs/String", lambda told: json.loads(told["data"])["commands"] == ended)
    expect(page.locator(".map-drive [role=status]")).to_contain_text("Sent to x 0.5")
    page.get_by_role("button", name="Give the base back").click()
    expect(why).to_contain_text("take the base first")
    expect(page.locator(".map-drive [role=status]")).to_have_text("")
    done = [commanded(line) for line in wire.call(COMMANDS, since=before)["commands"]]
    assert done == [
        *("sent", "sent", f"ended with status {GoalStatus.STATUS_ABORTED}", "cancelled"),
        *(f"ended with status {GoalStatus.STATUS_CANCELED}", "/lupin/hmi/take_base"),
    ]
    assert wire.call(COMMAND_SERVICE, verb="resume")["accepted"]


# --- what the simulated greenhouse never does; its mission goes on meanwhile --------------------------------


def grid_of(
    origin: tuple[float, float], occupied: tuple[int, int], yaw: float = 0.0, size: tuple[int, int] = (30, 20)
) -> OccupancyGrid:
    """Return a map of free cells of 0.1 m, one of which (column, row) is occupied."""
    message = OccupancyGrid()
    message.header.frame_id = "map"
    message.info.resolution, (message.info.width, message.info.height) = 0.1, size
    message.info.origin.position.x, message.info.origin.position.y = origin
    message.info.origin.orientation = Quaternion(z=math.sin(yaw / 2), w=math.cos(yaw / 2))
    cells = [0] * (size[0] * size[1])
    cells[occupied[1] * size[0] + occupied[0]] = 100
    message.data = cells
    return message


def transform(parent: str, child: str, x: float, y: float, yaw: float) -> TransformStamped:
    """Return where a frame is in another."""
    found = TransformStamped(child_frame_id=child)
    found.header.frame_id = parent
    found.transform.translation.x, found.transform.translation.y = x, y
    found.transform.rotation = Quaternion(z=math.sin(yaw / 2), w=math.cos(yaw / 2))
    return found


@pytest.fixture
def bare(
    world: World, gateway: Callable[..., str], context: BrowserContext, make_node: Callable[..., RosNode]
) -> Iterator[tuple[MapCanvas, RosNode]]:
    """The map before a gateway alone, and a node that tells what there is."""
    node = make_node("teller")
    page = context.new_page()
    wrong: list[str] = []
    page.on("pageerror", lambda problem: wrong.append(str(problem)))
    page.goto(gateway().replace("ws:", "http:").replace("/_ros", "/#map"))
    page.locator(".bar .pill.good").wait_for()
    yield MapCanvas(page), node
    assert not wrong, "\n".join(wrong)


def test_what_is_missing_is_named_and_what_comes_is_shown(bare: tuple[MapCanvas, RosNode]) -> None:
    seen, node = bare
    notes = seen.page.locator(".map-notes")
    for topic in ("/map", "/tf", "/twin/state"):
        expect(notes).to_contain_text(f"Nothing was heard on {topic}:")
    expect(seen.page.locator("#map-drive-why")).to_have_text("Nobody says where the robot is.")
    node.publisher(OccupancyGrid, "/map", Qos.LATCHED).publish(grid_of((-3.0, 2.0), (4, 3)))
    seen.until_colour(-2.55, 2.35, OCCUPIED)
    expect(notes).not_to_contain_text("/map:")
    expect(notes).to_contain_text("Nothing was heard on /tf:")


def test_a_map_that_changes_is_drawn_anew_where_it_is(bare: tuple[MapCanvas, RosNode]) -> None:
    seen, node = bare
    maps = node.publisher(OccupancyGrid, "/map", Qos.LATCHED)
    maps.publish(grid_of((-3.0, 2.0), (4, 3)))
    seen.until_colour(-2.55, 2.35, OCCUPIED)
    assert seen.colour(-1.45, 3.15) == list(FREE)
    maps.publish(grid_of((-3.0, 2.0), (15, 11)))  # one cell changed
    seen.until_colour(-1.45, 3.15, OCCUPIED)
    assert seen.colour(-2.55, 2.35) == list(FREE)
    maps.publish(grid_of((5.0, -1.0), (15, 11)))  # as large, elsewhere
    seen.until_colour(6.55, 0.15, OCCUPIED)
    assert seen.colour(4.95, 0.15) == list(UNKNOWN)
    maps.publish(grid_of((5.0, -1.0), (15, 11), yaw=math.pi / 2))
    seen.until_colour(5.0 - 1.15, -1.0 + 1.55, OCCUPIED)
    seen.hover(5.0 - 1.15, -1.0 + 1.55)
    expect(seen.page.locator(".map-readout")).to_contain_text("· occupied")
    broken = grid_of((5.0, -1.0), (15, 11))
    broken.data = [0] * 7
    maps.publish(broken)
    expect(seen.page.locator(".map-notes")).to_contain_text("What came on /map is no map: 30")
    seen.until_colour(5.0 - 1.15, -1.0 + 1.55, OCCUPIED)  # the last one that was a map stays


def test_the_robot_is_where_the_chain_of_transforms_leads(bare: tuple[MapCanvas, RosNode]) -> None:
    seen, node = bare
    node.publisher(OccupancyGrid, "/map", Qos.LATCHED).publish(grid_of((0.0, 0.0), (0, 0)))
    still = node.publisher(TFMessage, "/tf_static", Qos.STATIC_TRANSFORMS)
    moving = node.publisher(TFMessage, "/tf", Qos.TRANSFORMS)
    still.publish(TFMessage(transforms=[transform("base_footprint", "base_link", 0.1, 0.0, 0.0)]))
    odometry = TFMessage(transforms=[transform("odom", "base_footprint", 0.5, 0.0, math.pi / 2)])
    notes = seen.page.locator(".map-notes")
    with telling(lambda: moving.publish(odometry)):
        expect(notes).to_contain_text("No transform leads from odom to map: nobody says where the robot is.")
    with telling(lambda: moving.publish(odometry), lambda: moving.publish(_localized())):
        # odom stands at (1, 1), turned by 90°: the robot at (1, 1.5), looks along -x, its middle 0.1 m ahead
        seen.until_colour(0.9, 1.5, ROBOT)
        seen.press(0.9, 1.5)
        expect(seen.page.locator(".map-chosen")).to_contain_text("x 0.90 m, y 1.50 m")
        expect(seen.page.locator(".map-chosen")).to_contain_text("180°")
    expect(notes).to_contain_text("its last place is grey.")


def _localized() -> TFMessage:
    return TFMessage(transforms=[transform("map", "odom", 1.0, 1.0, math.pi / 2)])


def test_flowers_boxes_and_anomalies_tell_what_they_are(bare: tuple[MapCanvas, RosNode]) -> None:
    seen, node = bare
    node.publisher(OccupancyGrid, "/map", Qos.LATCHED).publish(grid_of((0.0, 0.0), (0, 0)))
    tag = TwinTagState(tag_id="7", anomaly=True)
    tag.pose.position.x, tag.pose.position.y, tag.pose.orientation.w = 0.5, 1.0, 1.0
    corners = ((1.0, 0.8), (2.0, 0.8), (2.0, 1.4), (1.0, 1.4))
    tag.box_footprint.points = [Point32(x=x, y=y) for x, y in corners]
    tag.flowers = [
        FlowerPoint(position=Point(x=1.2, y=1.2), species="tulip_red", confidence=0.9, anomaly=True)
    ]
    report = Observation(kind=Observation.KIND_ANOMALY, status=Observation.STATUS_OK)
    report.anomaly.description, report.anomaly.severity = "<img src=x onerror=alert(1)>", 2
    report.anomaly.pose.pose.position.x, report.anomaly.pose.pose.position.y = 2.5, 0.5
    states = node.publisher(TwinState, "/twin/state", Qos.LATCHED)
    node.publisher(Observation, "/floranova/observations", Qos.BACKLOG).publish(report)
    tip = seen.page.locator(".map-tip")
    with telling(lambda: states.publish(TwinState(tags=[tag]))):
        seen.until_colour(0.5, 1.0, ACCENT)
        for x, y, told in (
            (0.5, 1.0, "Tag 7nothing measured yet"),
            (1.2, 1.2, "Bloom at tag 7tulip red (90 %)\N{WARNING SIGN} anomaly"),
            (1.8, 1.0, "Planter box of tag 7"),
            (2.5, 0.5, "\N{WARNING SIGN} anomaly<img src=x onerror=alert(1)>severity 2"),
        ):
            seen.hover(x, y)
            expect(tip).to_contain_text(told)
        seen.until_colour(1.2, 1.2, (193, 18, 31))


def test_a_tag_that_was_never_read_has_no_age(bare: tuple[MapCanvas, RosNode], tmp_path: Path) -> None:
    """On the wire it is as old as the clock of UNIX; here, in the table and in its file it was never read."""
    seen, node = bare
    old = TwinTagState(tag_id="7", stale_seconds=1.8e9)
    read = TwinTagState(tag_id="8", last_observed=Time(sec=1_800_000_000), stale_seconds=5.0)
    states = node.publisher(TwinState, "/twin/state", Qos.LATCHED)
    with telling(lambda: states.publish(TwinState(tags=[old, read]))):
        listed = seen.page.locator(".map-tags")
        expect(listed.locator("[data-tag='7']")).to_have_text("Tag 7 nothing measured yet · never read")
        expect(listed.locator("[data-tag='8']")).not_to_contain_text("never read")
        seen.page.evaluate("location.hash = 'twin'")
        rows = seen.page.locator(".twin tbody tr")
        expect(rows.first).to_contain_text("never read")
        expect(rows.last).to_contain_text("ago")
        with seen.page.expect_download() as saving:
            seen.page.get_by_role("button", name="Export as CSV").click()
    file = tmp_path / "tags.csv"
    saving.value.save_as(file)
    with file.open(encoding="utf-8", newline="") as opened:
        told = [(row["tag"], row["observed"]) for row in csv.DictReader(opened)]
    assert told == [("7", "never read"), ("8", "2027-01-15T08:00:00Z")]


def test_a_twin_that_falls_silent_has_grey_tags(bare: tuple[MapCanvas, RosNode]) -> None:
    seen, node = bare
    node.publisher(OccupancyGrid, "/map", Qos.LATCHED).publish(grid_of((0.0, 0.0), (0, 0)))
    tag = TwinTagState(tag_id="<b>7</b>", readings=[SensorReading(name="<i>pH</i>", value=math.nan)])
    tag.pose.position.x, tag.pose.position.y, tag.pose.orientation.w = 1.0, 1.0, 1.0
    state = TwinState(tags=[tag])
    states = node.publisher(TwinState, "/twin/state", Qos.LATCHED)
    with telling(lambda: states.publish(state)):
        seen.until_colour(1.0, 1.0, ACCENT)
        seen.hover(1.0, 1.0)
        expect(seen.page.locator(".map-tip")).to_contain_text("Tag <b>7</b><i>pH</i>: \N{EN DASH}")
    expect(seen.page.locator(".map-notes")).to_contain_text(re.compile(r"The twin is silent since \d"))
    seen.until_colour(1.0, 1.0, SILENT)
    expect(seen.page.locator(".map-tags")).to_have_class(re.compile("stale"))


def test_a_base_whose_drive_does_not_end_is_not_given_back(bare: tuple[MapCanvas, RosNode]) -> None:
    """Navigation refuses: the page says so after a while, and the base is still its own."""
    seen, node = bare
    page, said = seen.page, seen.page.locator(".map-drive [role=status]")
    goals: list[ServedGoal] = []
    navigation = node.serve_action(
        NavigateToPose, "navigate_to_pose", admit=lambda _: True, started=goals.append, cancelled=end_goal
    )
    navigation.refuses = lambda: True
    node.publisher(OccupancyGrid, "/map", Qos.LATCHED).publish(grid_of((0.0, 0.0), (4, 3)))
    moving = node.publisher(TFMessage, "/tf", Qos.TRANSFORMS)
    states = node.publisher(MissionState, "/mission/state", Qos.LATCHED)
    here = TFMessage(transforms=[transform("map", "base_link", 1.0, 1.0, 0.0)])
    held = MissionState(lifecycle_state="INSPECTING", paused=True)
    with telling(lambda: moving.publish(here), lambda: states.publish(held), lambda: work(node)):
        seen.until_colour(0.45, 0.35, OCCUPIED)
        page.get_by_role("button", name="Take the base").click()
        drive_to(seen, 2.0, 1.0)
        expect(said).to_contain_text("Sent to x ")
        page.get_by_role("button", name="Give the base back").click()
        expect(page.locator("#map-drive-why")).to_contain_text("The drive is being ended")
        expect(said).to_have_text("The drive does not end: the base was not given back.")
        navigation.refuses = lambda: False
        expect(said).to_have_text("The drive was ended before the robot was there.")
        page.get_by_role("button", name="Give the base back").click()
        expect(page.get_by_role("button", name="Take the base")).to_be_visible()
    assert len(goals) == 1


def work(node: RosNode) -> None:
    """Handle what has come for a node."""
    for _ in range(20):
        node.spin_once(0.0)


def end_goal(goal: ServedGoal) -> None:
    """End a goal as its client asks."""
    goal.cancel(NavigateToPose.Result())


# --- after the mission -------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def inspected(robot: Served) -> dict[str, Any]:
    """What the twin tells when the mission of the test before has visited all tags."""
    with wired(robot) as wire:
        wire.until(
            "/mission/state", "lupin_msgs/MissionState", lambda told: told["lifecycle_state"] == "DONE"
        )
        before: list[Any] = []

        def is_settled(told: Any) -> bool:
            """Say whether nothing was read for some seconds: at the end all tags are read once more."""
            before.append([[tag["readings"], tag["last_observed"]] for tag in told["tags"]])
            return len(before) > 4 and before[-5] == before[-1] and len(told["tags"]) == TAGS

        told = wire.until("/twin/state", "lupin_msgs/TwinState", is_settled)
    return {tag["tag_id"]: tag for tag in told["tags"]}


def value_of(tag: dict[str, Any], sensor: str) -> float | None:
    """Return the value of a sensor at a tag."""
    return next((float(one["value"]) for one in tag["readings"] if one["name"] == sensor), None)


def is_alone(tag: dict[str, Any], tags: Iterable[dict[str, Any]]) -> bool:
    """Return whether no sign of another tag covers this one's."""
    places = [(each["pose"]["position"]["x"], each["pose"]["position"]["y"]) for each in tags]
    here = tag["pose"]["position"]["x"], tag["pose"]["position"]["y"]
    return sum(math.dist(here, place) < 0.3 for place in places) == 1


def test_a_tag_tells_what_the_twin_knows(greenhouse: MapCanvas, inspected: dict[str, Any]) -> None:
    tag = inspected["1"]
    place = tag["pose"]["position"]
    told = f"temperature: {value_of(tag, 'temperature'):.1f} °C"
    greenhouse.hover(place["x"], place["y"])
    tip = greenhouse.page.locator(".map-tip")
    expect(tip).to_contain_text(re.compile(f"Tag 1{re.escape(told)}.* ago \\("))
    greenhouse.press(place["x"], place["y"])
    expect(greenhouse.page.locator(".map-chosen")).to_contain_text(told)


def test_the_list_tells_it_too_and_is_gone_through_by_keys(
    greenhouse: MapCanvas, inspected: dict[str, Any]
) -> None:
    page = greenhouse.page
    entries = page.locator(".map-tags button")
    expect(entries).to_have_count(TAGS)
    entries.first.focus()
    page.keyboard.press("ArrowDown")
    page.keyboard.press("ArrowDown")
    second = page.locator(".map-tags button:focus")
    expect(second).to_have_attribute("data-tag", "2")
    expect(second).to_contain_text(f"temperature: {value_of(inspected['2'], 'temperature'):.1f} °C")
    expect(page.locator(".map-chosen")).to_contain_text("Tag 2")
    place = inspected["2"]["pose"]["position"]
    greenhouse.until_colour(place["x"], place["y"], ACCENT)


def test_tags_and_field_have_the_colours_of_the_twins_answer(
    greenhouse: MapCanvas, inspected: dict[str, Any], wire: Wire
) -> None:
    page = greenhouse.page
    way = ("way of the last 2 minutes", "plan and goal")
    greenhouse.hide(*way, "boxes", "blooms", "names of tags", "anomalies")
    page.get_by_label("Field of").select_option("temperature")
    expect(page.locator(".map-legend")).to_contain_text("tags, told at")
    field = wire.field("temperature")
    low, high = field["value_min"], field["value_max"]
    for end in (low, high):
        expect(page.locator(".map-ends")).to_contain_text(f"{end:.1f} °C")
    alone = [tag for tag in inspected.values() if is_alone(tag, inspected.values())]
    assert len(alone) > 15
    for tag in alone:
        value, place = value_of(tag, "temperature"), tag["pose"]["position"]
        wanted = FREE if value is None else ramp(value, low, high)
        greenhouse.until_colour(place["x"], place["y"], wanted)
    for x, y in ((0.3, 2.0), (0.3, 6.0), (3.7, 3.0), (3.7, 5.0), (2.5, 7.7)):
        column, row = (int((at + 0.05) / 0.1) for at in (x, y))
        value = field["values"][row * field["width"] + column]
        assert value is not None
        greenhouse.until_colour(x, y, ramp(value, low, high))
        greenhouse.hover(x, y)
        expect(page.locator(".map-readout")).to_contain_text(f"temperature {value:.1f} °C")
    page.get_by_label("Field of").select_option("soil_moisture")
    soil = wire.field("soil_moisture")
    nothing = next(i for i, value in enumerate(soil["values"]) if value is None and i % soil["width"] > 1)
    x, y = ((nothing % soil["width"]) * 0.1, (nothing // soil["width"]) * 0.1)
    greenhouse.hover(x, y)
    expect(page.locator(".map-readout")).to_have_text(re.compile("soil moisture \N{EN DASH}$"))


def test_every_sensor_of_the_interface_has_its_unit(greenhouse: MapCanvas) -> None:
    offered = greenhouse.page.get_by_label("Field of").locator("option")
    told = {each.get_attribute("value"): each.inner_text() for each in offered.all()}
    units = {name: re.findall(r"\[(.*)\]", told[name]) for name in SENSOR_UNITS}
    assert units == {name: [unit] if unit else [] for name, unit in SENSOR_UNITS.items()}


def test_scrubbing_takes_robot_and_tags_back(
    greenhouse: MapCanvas, inspected: dict[str, Any], wire: Wire
) -> None:
    page = greenhouse.page
    transforms = wire.until("/tf", "tf2_msgs/TFMessage", lambda _: True)["transforms"]
    here = next(each for each in transforms if each["child_frame_id"] == "base_link")["transform"][
        "translation"
    ]
    place = f"x {here['x']:.2f} m, y {here['y']:.2f} m"
    greenhouse.until_colour(here["x"], here["y"], ROBOT)
    greenhouse.press(here["x"], here["y"])
    expect(page.locator(".map-chosen")).to_contain_text(place)
    page.get_by_role("slider", name="The moment that is shown").focus()
    page.keyboard.press("Home")
    expect(page.get_by_role("button", name="Drive to a place…")).to_have_attribute("aria-disabled", "true")
    expect(page.locator("#map-drive-why")).to_contain_text("You look at the past")
    assert len(inspected) == TAGS
    expect(page.locator(".map-tags button")).not_to_have_count(TAGS)
    for _ in range(60):
        page.keyboard.press("ArrowRight")
    expect(page.locator(".map-chosen")).to_contain_text("Robot")
    expect(page.locator(".map-chosen")).not_to_contain_text(place)
    page.keyboard.press("l")
    expect(page.locator(".map-chosen")).to_contain_text(place)
    expect(page.locator(".map-tags button")).to_have_count(TAGS)
