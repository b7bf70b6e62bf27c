"""A whole plugin without Python, over real ROS 2: an action, a service, topics both ways, and a parameter."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from typing import Any

import pytest
from builtin_interfaces.msg import Duration
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseArray, PoseStamped
from nav2_msgs.action import NavigateToPose
from std_msgs.msg import Byte, ColorRGBA, Float32, String

from lupin_engine.errors import LupinError
from lupin_ros.adapter.node import Qos, RosNode
from lupin_ros.interfaces import definitions
from lupin_ros.interfaces.definitions import (
    fill,
    interface_class,
    interface_constants,
    interface_types,
    plain,
)
from lupin_ros.orchestrator.binding_client import BoundClient
from tests.lupin_ros.helpers import spin_for, spin_until
from tests.lupin_ros.orchestrator import bound
from tests.lupin_ros.orchestrator.bound import SPRAYER, Cart, abort, binding_of, sprayer, succeed
from tests.lupin_ros.world import World
from tests.plugins.fakes import FakeOutlet

MakeNode = Callable[..., RosNode]

PLACE = {"x": 2.0, "y": -1.0, "yaw": math.pi / 2}
SETTINGS = {"spray_frame": "bed_3", "spray_least": 0.1, "somebody_elses": 1}
ORDER = {"place": PLACE, "program": "jet"}


class Bench:
    """The client of the spray cart, and the cart."""

    def __init__(self, make_node: MakeNode) -> None:
        self.engine = make_node("engine")
        self.outlet = FakeOutlet()
        self.client = BoundClient(self.engine, sprayer(), self.outlet, SETTINGS)
        self.cart = Cart(make_node("cart"))
        self.nodes = [self.engine, self.cart.ros]

    def until(self, condition: Callable[[], Any], what: str = "") -> None:
        """Work until something holds."""
        spin_until(self.nodes, condition, what=what)

    def ready(self) -> Bench:
        """Wait until the servers are there, and the topics heard: of a gauge nothing is sent again."""
        self.until(lambda: not self.client.missing(), "the servers")
        self.until(
            lambda: all(one._subscription.get_publisher_count() == 1 for one in self.client._listeners),
            "the topics",
        )
        return self

    def spray(self, attempt: str = "a1") -> None:
        """Give an order."""
        self.client.start(attempt, "spray", ORDER)

    def reported(self, *kinds: str, attempt: str = "a1") -> tuple[Any, ...]:
        """Wait until these are the reports of an attempt, and return the last."""
        self.until(lambda: self.outlet.kinds(attempt) == list(kinds), str(kinds))
        return self.outlet.reports[-1]


@pytest.fixture
def bench(make_node: MakeNode) -> Bench:
    """The client with its cart, when they have found each other."""
    return Bench(make_node).ready()


# -- an action ---------------------------------------------------------------------------------------------


def test_an_order_is_a_goal_and_its_end_a_result(bench: Bench) -> None:
    """A pose is a pose with a quaternion, the stamp is now, the frame is a parameter."""
    bench.cart.answer = succeed
    bench.spray()
    assert bench.reported("accepted", "done") == ("done", "a1", {})
    goal = bench.cart.goals[0].request
    assert (goal.pose.header.frame_id, goal.behavior_tree) == ("bed_3", "jet")
    stamp = goal.pose.header.stamp
    assert 0 <= bench.engine.now() - (stamp.sec + stamp.nanosec * 1e-9) < 10
    pose = goal.pose.pose
    assert (pose.position.x, pose.position.y) == (2.0, -1.0)
    assert (pose.orientation.z, pose.orientation.w) == pytest.approx((math.sqrt(0.5), math.sqrt(0.5)))


@pytest.mark.parametrize(
    ("answer", "code", "detail"),
    [
        (abort(100, "nozzle"), "spray_failed", "nozzle"),
        (abort(204, "a box"), "spray_blocked", "a box"),
        (lambda s: s.succeed(NavigateToPose.Result(error_code=7, error_msg="dry")), "spray_failed", "dry"),
    ],
)
def test_an_order_that_fails(bench: Bench, answer: Callable[[Any], None], code: str, detail: str) -> None:
    """The code is chosen by the answer; a success with an error in it is none."""
    bench.cart.answer = answer
    bench.spray()
    assert bench.reported("accepted", "failed") == ("failed", "a1", code, detail)


def test_an_order_that_is_not_taken(bench: Bench) -> None:
    """It has a code of its own."""
    bench.cart.willing = False
    bench.spray()
    detail = "action server /sprayer/spray is not willing to take the goal"
    assert bench.reported("failed") == ("failed", "a1", "spray_refused", detail)


def test_what_is_told_meanwhile(bench: Bench) -> None:
    """Each thing by its name, seconds as seconds, and only what is new."""
    bench.spray()
    bench.reported("accepted")
    feedback = NavigateToPose.Feedback(
        distance_remaining=1.25, estimated_time_remaining=Duration(sec=3, nanosec=500_000_000)
    )
    bench.until(lambda: bench.cart.goals)
    for distance in (1.25, 1.25, 0.5):
        feedback.distance_remaining = distance
        bench.cart.goals[0].feedback(feedback)
    told = [
        ("progress", "a1", "to go 1.25, seconds left 3.5"),
        ("progress", "a1", "to go 0.5, seconds left 3.5"),
    ]
    bench.until(lambda: bench.outlet.reports[1:] == told)


def test_an_order_that_is_taken_back(bench: Bench) -> None:
    """The cart is told, and the attempt ends when it has stopped."""
    bench.spray()
    bench.reported("accepted")
    bench.client.cancel("a1")
    bench.reported("accepted", "cancelled")
    assert bench.cart.cancelled == bench.cart.goals


def test_an_order_that_the_cart_takes_back_itself(bench: Bench) -> None:
    """Nobody asked it to: that is a failure."""
    bench.spray()
    bench.reported("accepted")
    bench.client._attempts._running["a1"].goal.cancel()  # somebody else's request
    assert bench.reported("accepted", "failed") == ("failed", "a1", "spray_failed", "half of it")


def test_a_cancelled_goal_tells_how_far_it_came(make_node: MakeNode) -> None:
    """Where its file says that it does; else nothing is given."""
    text = (SPRAYER / "bindings" / "sprayer.yaml").read_text(encoding="utf-8")
    gives = 'result: {told: {type: text, from: "${ result.error_msg }"}}'
    bench = Bench(make_node)
    for attempt, binding in (
        ("a1", text),
        (
            "a2",
            text.replace(
                "    uses: cart\n", f"    uses: cart\n    {gives}\n    cut_short: true\n", 1
            ).replace("{after: 20 s,", "{after: 20 s, result: {told: x},"),
        ),
    ):
        bench.client = BoundClient(bench.engine, binding_of(binding), bench.outlet, SETTINGS)
        bench.ready()
        bench.spray(attempt)
        bench.reported("accepted", attempt=attempt)
        bench.client.cancel(attempt)
        told = bench.reported("accepted", "cancelled", attempt=attempt)
        assert told[2:] == ((), ({"told": "half of it"},))[attempt == "a2"]
        bench.client.close()


def test_goals_of_a_client_before_are_cancelled(bench: Bench, make_node: MakeNode) -> None:
    """What moves would go on after a crash, and nobody would know of it."""
    bench.spray("of the old one")
    bench.reported("accepted", attempt="of the old one")
    new = BoundClient(bench.engine, sprayer(), FakeOutlet(), SETTINGS)
    seen: list[str] = []
    bench.until(lambda: not new.missing() or seen.extend(new.missing()), "the new one is ready")
    assert "action server /sprayer/spray to cancel the goals it had" in seen
    bench.until(lambda: bench.cart.cancelled == bench.cart.goals, "the old goal ends")


def test_a_closed_client_has_its_goals_cancelled(bench: Bench) -> None:
    """And tells nothing more, not even of topics."""
    bench.spray()
    bench.reported("accepted")
    bench.client.close()
    bench.until(lambda: bench.cart.cancelled, "the goal is cancelled")
    bench.cart.tank(50.0)
    spin_for(bench.nodes, 0.3)
    assert (bench.outlet.kinds("a1"), bench.outlet.values) == (["accepted"], [])


def test_a_cart_that_is_killed(world: World, make_node: MakeNode) -> None:
    """Its order fails with the code for that, and the client waits for it to come back."""
    engine, outlet = make_node("engine"), FakeOutlet()
    client = BoundClient(engine, sprayer(), outlet, SETTINGS)
    cart = world.run("cart", [sys.executable, "-m", bound.__name__, "cart"])
    spin_until([engine], lambda: not client.missing(), what="the cart is there")
    client.start("a1", "spray", ORDER)
    spin_until([engine], lambda: outlet.kinds("a1") == ["accepted"], what="the order is taken")
    cart.kill()
    spin_until([engine], lambda: outlet.kinds("a1") == ["accepted", "failed"], what="it is missed")
    assert outlet.reports[-1] == ("failed", "a1", "sprayer_gone", "action server /sprayer/spray is gone")
    missing = ["service /sprayer/rinse", "action server /sprayer/spray"]
    spin_until([engine], lambda: client.missing() == missing, what="both are missed")
    client.start("a2", "spray", ORDER)
    detail = "action server /sprayer/spray is not there"
    assert outlet.reports[-1] == ("failed", "a2", "sprayer_gone", detail)


def test_a_cart_that_was_started_anew(bench: Bench, make_node: MakeNode) -> None:
    """It knows nothing of the order, and says so."""
    bench.spray()
    bench.reported("accepted")
    old = bench.nodes.pop()
    again = Cart(make_node("cart_again"))
    bench.nodes.append(again.ros)
    bench.until(lambda: sees(bench.engine, "/sprayer/rinse", servers=2), "both carts")
    old.close()
    code, detail = bench.reported("accepted", "failed")[2:]
    assert (code, detail) == ("sprayer_gone", "action server /sprayer/spray no longer knows the goal")


def sees(ros: RosNode, service: str, servers: int) -> bool:
    """Say whether so many offer a service, and all of it: what takes requests is found apart from answers."""
    taking = ros.node.get_subscriptions_info_by_topic(f"rq{service}Request", no_mangle=True)
    answering = ros.node.get_publishers_info_by_topic(f"rr{service}Reply", no_mangle=True)
    return len(taking) == len(answering) == servers


# -- topics ------------------------------------------------------------------------------------------------


def test_a_live_value(bench: Bench) -> None:
    """In its base unit, less what a parameter says; what is no reading is passed over."""
    bench.until(lambda: bench.cart._tank.get_subscription_count())
    for percent in (-1.0, 60.0):
        bench.cart.tank(percent)
    bench.until(lambda: bench.outlet.values)
    ((name, value, stamp),) = bench.outlet.values
    assert (name, value) == ("tank.level", pytest.approx(0.5))
    assert 0 <= bench.engine.now() - stamp < 10


def test_a_reading_that_is_no_number(bench: Bench, capfd: pytest.CaptureFixture[str]) -> None:
    """It is said once with its place; what was known stays known until it is too old."""
    bench.until(lambda: bench.cart._tank.get_subscription_count())
    for percent in (math.inf, math.inf, 60.0):
        bench.cart.tank(percent)
    bench.until(lambda: bench.outlet.values)
    assert len(bench.outlet.values) == 1
    assert capfd.readouterr().err.count("expected number in %, got inf") == 1


def test_an_event(bench: Bench) -> None:
    """Only messages that are one, with what comes with it; the level is compared by its name."""
    bench.until(lambda: bench.cart._state.get_subscription_count())
    bench.cart.state(DiagnosticStatus.WARN, "low pressure")
    bench.cart.state(DiagnosticStatus.ERROR, "at the pump")
    bench.until(lambda: bench.outlet.events)
    assert bench.outlet.events == [("sprayer.leak", {"where": "at the pump"})]


def test_a_message_is_sent(bench: Bench, make_node: MakeNode) -> None:
    """Who comes later gets the last one, because it is latched."""
    bench.until(lambda: bench.engine.node.count_subscribers("/sprayer/lamp"))
    bench.client.act("lamp", {"red": 0.0, "green": 1.0})
    bench.until(lambda: bench.cart.lamps == [(0.0, 1.0)])
    bench.client.act("lamp", {"red": 1.0, "green": 0.25})
    bench.until(lambda: bench.cart.lamps == [(0.0, 1.0), (1.0, 0.25)])
    late: list[ColorRGBA] = []
    make = make_node("late")
    make.subscribe(ColorRGBA, "/sprayer/lamp", Qos.LATCHED, late.append)
    bench.nodes.append(make)
    bench.until(lambda: late)
    assert (late[0].r, late[0].a) == (1.0, 1.0)


def test_a_message_that_cannot_be_sent(bench: Bench, capfd: pytest.CaptureFixture[str]) -> None:
    """Nothing goes out, and the log says why and where it is written."""
    bench.client.act("lamp", {"red": math.nan, "green": 0.0})
    assert "bound.yaml:50:3: std_msgs/msg/ColorRGBA.r: expected number, got nan" in capfd.readouterr().err
    assert bench.cart.lamps == []


def test_a_topic_of_another_type_is_told(make_node: MakeNode, capfd: pytest.CaptureFixture[str]) -> None:
    """DDS itself would be silent about it."""
    engine, other = make_node("engine"), make_node("other")
    client = BoundClient(engine, sprayer(), FakeOutlet(), SETTINGS)
    other.publisher(String, "/sprayer/tank", Qos.SENSOR)
    told = "/sprayer/tank: node /other uses another definition: here std_msgs/msg/Float32 RIHS01_"
    said: list[str] = []
    spin_until([engine, other], lambda: said.append(capfd.readouterr().err) or told in "".join(said))
    client.close()
    assert "there std_msgs/msg/String RIHS01_" in "".join(said)


POSES = """
binding: eyes
summary: What a camera sees.
values:
  robot.where: {summary: w, type: pose, topic: {name: /where, type: geometry_msgs/msg/PoseStamped},
    from: "${ message.pose }"}
  robot.gap: {summary: g, type: duration, topic: {name: /gap, type: std_msgs/msg/Float32},
    from: "${ message.data }", unit: ms}
"""


def test_poses_and_units_of_messages(make_node: MakeNode) -> None:
    """A pose is read with its yaw, milliseconds as seconds."""
    engine, other, outlet = make_node("engine"), make_node("other"), FakeOutlet()
    BoundClient(engine, binding_of(POSES), outlet, {})
    where = other.publisher(PoseStamped, "/where", Qos.EVENT)
    gap = other.publisher(Float32, "/gap", Qos.EVENT)
    nodes = [engine, other]
    spin_until(nodes, lambda: where.get_subscription_count() and gap.get_subscription_count())
    message = PoseStamped()
    message.pose.position.x = 3.0
    message.pose.orientation.z, message.pose.orientation.w = math.sin(0.4), math.cos(0.4)
    where.publish(message)
    gap.publish(Float32(data=250.0))
    spin_until(nodes, lambda: len(outlet.values) == 2)
    assert outlet.of("robot.where") == [{"x": 3.0, "y": 0.0, "yaw": pytest.approx(0.8)}]
    assert outlet.of("robot.gap") == [0.25]


# -- definitions -------------------------------------------------------------------------------------------


def test_an_action_and_a_message_are_read_without_importing_them() -> None:
    """Parts, fields and constants, those of messages inside them too."""
    action = interface_types("nav2_msgs/action/NavigateToPose")
    assert list(action) == ["goal", "result", "feedback", "constant"]
    assert list(action["result"].fields) == ["error_code", "error_msg"]
    assert str(action["result"]) == "nav2_msgs/action/NavigateToPose.Result"
    assert str(action["goal"].fields["pose"].fields["pose"]) == "geometry_msgs/msg/Pose"
    assert interface_constants("nav2_msgs/action/NavigateToPose") == {"NONE": 0}
    array = interface_constants("diagnostic_msgs/msg/DiagnosticArray")
    assert array == {"DiagnosticStatus": {"OK": 0, "WARN": 1, "ERROR": 2, "STALE": 3}}
    kinds = interface_types("diagnostic_msgs/msg/DiagnosticArray")["constant"].fields
    assert kinds["DiagnosticStatus"].fields["OK"].kind == "integer"


def test_constants_are_what_the_code_has() -> None:
    """Every one of a message with many."""
    kind = interface_class("sensor_msgs/msg/BatteryState")
    constants = interface_constants("sensor_msgs/msg/BatteryState")
    assert len(constants) == 23
    assert {name: getattr(kind, name) for name in constants} == constants


CONSTANTS = """
# int8 OLD=1
string EMPTY=
string QUOTED = "x"      # a remark
string<=9 BARE=plain text # a remark
string ODD='"'
bool YES=True # a remark
int8 LOW=-0x10
float64 SMALL = 1e-3
int8 no_constant 5
"""


def test_constants_are_read_as_their_compiler_reads_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """A remark ends them, quotes go in pairs, and an empty one does not take the next line."""
    monkeypatch.setattr(definitions, "local_source", lambda _: CONSTANTS)
    assert definitions.interface_constants.__wrapped__("std_msgs/msg/Bool") == {
        "EMPTY": "",
        "QUOTED": "x",
        "BARE": "plain text",
        "ODD": '"',
        "YES": True,
        "LOW": -16,
        "SMALL": 0.001,
    }


def test_what_is_no_action_and_no_message() -> None:
    """With the nearest one."""
    with pytest.raises(LookupError, match="nav2_msgs has no action 'NavigatToPose'; did you mean"):
        interface_types("nav2_msgs/action/NavigatToPose")
    with pytest.raises(LookupError, match="no package 'sensr_msgs' with messages is installed here; did you"):
        interface_types("sensr_msgs/msg/Temperature")
    with pytest.raises(LupinError, match="std_msgs/msg/Nothing is installed, but cannot be used from Python"):
        interface_class("std_msgs/msg/Nothing")


def test_messages_are_filled_with_times_poses_and_bytes() -> None:
    """Seconds, also written with their unit; places on the floor, also in lists."""
    goal = interface_types("geometry_msgs/msg/PoseArray")["message"]
    array = fill(PoseArray(), {"header": {"stamp": 1.5}, "poses": [PLACE, PLACE]}, goal)
    assert (array.header.stamp.sec, array.header.stamp.nanosec) == (1, 500_000_000)
    assert plain(array)["header"]["stamp"] == 1.5
    assert [pose.position.y for pose in array.poses] == [-1.0, -1.0]
    status = interface_types("diagnostic_msgs/msg/DiagnosticArray")["message"]
    message = fill(DiagnosticArray(), {"status": [{"level": 2}], "header": {"stamp": "2 s"}}, status)
    assert (message.status[0].level, message.header.stamp.sec) == (b"\x02", 2)
    assert plain(message)["status"][0]["level"] == 2
    assert plain(Byte(data=b"\x07")) == {"data": 7}


@pytest.mark.parametrize(
    ("given", "problem"),
    [
        ({"stamp": "soon"}, "Header.stamp: expected seconds, got 'soon'"),
        ({"stamp": "2 m"}, "Header.stamp: expected seconds, got '2 m'"),
        ({"stamp": math.nan}, "Header.stamp: expected seconds, got nan"),
        (
            {"stamp": 1e300},
            "builtin_interfaces/msg/Time.sec: expected int32 between -2.14748e.09 and 2.14748e.09, got 1000",
        ),
        (3, "expected std_msgs/msg/Header, got 3"),
    ],
)
def test_what_does_not_fit_a_message(given: Any, problem: str) -> None:
    """The field, what it takes, what came."""
    kind = interface_types("geometry_msgs/msg/PoseArray")["message"]
    with pytest.raises(ValueError, match=problem.replace("(", r"\(")):
        fill(PoseArray(), {"header": given}, kind)
