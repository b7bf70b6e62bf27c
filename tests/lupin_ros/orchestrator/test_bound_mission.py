"""A mission with a plugin that is only a file, in the orchestrator: the spray cart of the documentation."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from rcl_interfaces.srv import DescribeParameters
from std_msgs.msg import String

from lupin_engine.missions.folders import default_missions_folder
from lupin_ros.adapter.node import Qos, RosNode
from tests.lupin_ros.orchestrator import bound
from tests.lupin_ros.orchestrator.bound import SPRAYER, Cart, abort, succeed
from tests.lupin_ros.world import PATIENCE, Operator, World

pytestmark = pytest.mark.timeout(180)


ORDER = "sprayer.spray"


class Desk(Operator):
    """An operator who also works the spray cart."""

    def __init__(self, make_node: Callable[..., RosNode]) -> None:
        super().__init__("desk")
        self._steps: list[dict[str, Any]] = []
        steps = "/mission_orchestrator/steps"
        self.ros.subscribe(String, steps, Qos.BACKLOG, lambda m: self._steps.append(json.loads(m.data)))
        self._make = make_node
        self.cart: Cart | None = None
        self.level: float | None = 80.0

    def until(self, condition: Callable[[], Any], what: str, timeout: float = PATIENCE) -> None:
        """Work until `condition` holds; the cart works, and tells its tank all the time."""

        def holds() -> Any:
            if self.cart is not None:
                self.cart.ros.spin_once(0.0)
                if self.level is not None:
                    self.cart.tank(self.level)
            return condition()

        super().until(holds, what, timeout)

    def order_is_taken(self) -> bool:
        """Tell whether the orchestrator has heard that the cart has an order."""
        steps = [record["step"] for record in self._steps]
        orders = {c["attempt"] for s in steps for c in s.get("commands", ()) if c.get("operation") == ORDER}
        return any(s["event"] == "attempt.accepted" and s["data"]["attempt"] in orders for s in steps)

    def switch_on(self) -> Cart:
        """Let the cart appear."""
        self.cart = Cart(self._make("cart"))
        return self.cart

    def begin(self, *tags: str) -> None:
        """Start the mission when the robot is ready."""
        self.in_state("READY")
        answer = self.start(*tags, mission="SprayMission")
        assert answer.accepted, answer.error_message


def put(file: Path, *changes: tuple[str, str]) -> None:
    """Change a file, at once."""
    text = file.read_text(encoding="utf-8")
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    aside = file.with_suffix(".new")
    aside.write_text(text, encoding="utf-8")
    aside.replace(file)


@pytest.fixture
def desk(ros_domain: int, make_node: Callable[..., RosNode]) -> Iterator[Desk]:
    """An operator on the same domain."""
    desk = Desk(make_node)
    yield desk
    desk.ros.close()


@pytest.fixture
def missions(tmp_path: Path) -> Path:
    """A folder with the spray mission alone."""
    folder = tmp_path / "missions"
    shutil.copytree(SPRAYER / "bindings", folder / "bindings")
    shutil.copy(SPRAYER / "spray.yaml", folder)
    shutil.copy(SPRAYER / "lupin.yaml", folder.parent)
    shutil.copy(default_missions_folder() / "lifecycle.yaml", folder)
    return folder


@pytest.fixture
def spraying(world: World, desk: Desk, missions: Path) -> Cart:
    """Everything runs, and the robot is ready."""
    cart = desk.switch_on()
    world.start_all(missions_path=missions, spray_frame="bed_3")
    desk.in_state("READY")
    return cart


def test_a_mission_with_it(world: World, desk: Desk, spraying: Cart) -> None:
    """Done, failed, lamp, rinsing; the parameter given to the node reaches the cart, with its range."""
    answers = [succeed, abort(204, "a box")]
    spraying.answer = lambda served: answers.pop(0)(served)
    desk.begin("1", "5")
    desk.until_done(published=2)
    told = [(o.tag_reading.tag_id, o.status) for o in desk.observations]
    assert told == [("1", 0), ("5", 1)]
    assert desk.observations[1].status_detail == "spray_blocked: a box"
    assert {goal.request.pose.header.frame_id for goal in spraying.goals} == {"bed_3"}
    assert (spraying.lamps, spraying.rinsed) == ([(0.0, 1.0), (1.0, 0.0)], 1)
    described = desk.call(
        DescribeParameters,
        "/mission_orchestrator/describe_parameters",
        DescribeParameters.Request(names=["spray_least"]),
    ).descriptors[0]
    assert described.description == "what the tank never holds less of"
    assert described.floating_point_range[0].to_value == 1.0


def test_leaving_the_state_takes_the_order_back(desk: Desk, spraying: Cart) -> None:
    """By an event of the plugin: it leaks."""
    desk.begin("1")
    desk.until(lambda: spraying.goals, "the order")
    spraying.state(b"\x02", "at the pump")
    desk.in_state("DONE")
    assert spraying.cancelled == spraying.goals
    assert (desk.state.last_error, spraying.rinsed) == ("leaking", 1)


def test_a_level_of_its_value_is_an_event(desk: Desk, spraying: Cart) -> None:
    """The tank runs empty, in the unit of the gauge."""
    desk.begin("1")
    desk.until(lambda: spraying.goals, "the order")
    desk.level = 25.0  # less the 10 % that it always holds: below the reserve of 20 %
    desk.in_state("DONE")
    assert "tank_empty" in {state.last_error for state in desk.states}
    assert spraying.cancelled == spraying.goals


def test_a_value_that_nobody_tells_any_more_is_unknown(world: World, desk: Desk, missions: Path) -> None:
    """After its `freshness`; nothing has to come for that to be noticed."""
    put(missions / "bindings" / "sprayer.yaml", ("freshness: 5 s", "freshness: 3 s"))
    level = "  input.tank.low:\n        target: RINSING\n"
    unknown = "always:\n        target: RINSING\n        guard: not known(input.tank)\n"
    put(missions / "spray.yaml", (level, unknown))
    cart = desk.switch_on()
    world.start_all(missions_path=missions)
    desk.begin("1")
    desk.until(lambda: cart.goals, "the order")
    desk.level = None
    desk.in_state("DONE")
    assert "tank_empty" in {state.last_error for state in desk.states}
    assert cart.cancelled == cart.goals


@pytest.mark.core
def test_a_hold_stops_the_cart_and_gives_the_order_again(desk: Desk, spraying: Cart) -> None:
    """`on_hold: cancel`."""
    desk.begin("1")
    desk.until(lambda: spraying.goals, "the order")
    assert desk.ask("pause").success
    desk.until(lambda: spraying.cancelled == spraying.goals, "the cart has stopped")
    desk.until(lambda: desk.state.paused, "paused")
    spraying.answer = succeed
    assert desk.ask("resume").success
    desk.in_state("DONE")
    assert len(spraying.goals) == 2
    assert spraying.goals[0].request.pose.pose == spraying.goals[1].request.pose.pose


@pytest.mark.core
def test_an_order_goes_on_when_the_orchestrator_is_started_again(
    world: World, desk: Desk, missions: Path
) -> None:
    """`on_restart: finish`: no second one is given, and the result of the first counts."""
    put(missions / "bindings" / "sprayer.yaml", ("    on_hold: cancel", "    on_restart: finish"))
    cart = desk.switch_on()
    world.start_all(missions_path=missions)
    desk.begin("1")
    desk.until(desk.order_is_taken, "the order is taken")
    world.processes["mission_orchestrator"].kill()
    world.processes["mission_orchestrator"].wait(10.0)
    desk.states.clear()
    world.start("mission_orchestrator", missions_path=missions, estop_timeout_s=10.0)
    desk.until(lambda: desk.states and desk.state.paused, "the new one is held")
    succeed(cart.goals[0])
    assert desk.ask("resume").success
    desk.until_done(published=1)
    assert [(o.tag_reading.tag_id, o.status) for o in desk.observations] == [("1", 0)]
    assert (len(cart.goals), cart.cancelled) == (1, [])


def test_a_cart_that_will_not(desk: Desk, spraying: Cart) -> None:
    """The reason stands in what is published of the plant."""
    spraying.willing = False
    desk.begin("1")
    desk.until_done(published=1)
    detail = "spray_refused: action server /sprayer/spray is not willing to take the goal"
    assert [o.status_detail for o in desk.observations] == [detail]


def test_a_cart_that_dies(world: World, desk: Desk, missions: Path) -> None:
    """The order is given up, and what it told is not known any more."""
    world.run("cart", [sys.executable, "-m", bound.__name__, "cart"])
    world.start_all(missions_path=missions)
    desk.begin("1")
    desk.in_state("SPRAYING")
    desk.until(desk.order_is_taken, "the order is taken")
    world.processes["cart"].kill()
    desk.until_done(published=1)
    detail = "sprayer_gone: action server /sprayer/spray is gone"
    assert [o.status_detail for o in desk.observations] == [detail]


def test_the_robot_waits_for_the_cart(world: World, desk: Desk, missions: Path) -> None:
    """It is ready when all servers of its missions are there."""
    world.start_all(missions_path=missions)
    desk.in_state("BOOT")
    refused = desk.start("1", mission="SprayMission")
    assert refused.error_message == "start refused: the robot is still starting up"
    desk.switch_on()
    desk.in_state("READY")


def test_a_binding_that_changes_while_nothing_runs(desk: Desk, spraying: Cart, missions: Path) -> None:
    """The next order goes as the file says now, over a client that was made anew."""
    put(missions / "bindings" / "sprayer.yaml", ("default: mist", "default: fog"), ("1.0}", "0.5}"))
    spraying.answer = succeed
    desk.begin("1")
    desk.until_done(published=1)
    assert [goal.request.behavior_tree for goal in spraying.goals] == ["fog"]
    assert spraying.lamps == [(0.0, 1.0), (1.0, 0.0)]
    assert [o.status for o in desk.observations] == [0]


def test_what_is_not_in_the_definition(world: World, desk: Desk, missions: Path) -> None:
    """A binding that was changed is held against what is installed; all that is wrong is told at once."""
    file = missions / "bindings" / "sprayer.yaml"
    desk.switch_on()
    world.start_all(missions_path=missions)
    desk.in_state("READY")
    put(
        file,
        ("result.error_msg", "result.error_mesg"),
        ("constant.NONE", "constant.NOTHING"),
        ("frame_id:", "frame:"),
        ("message.data >= 0", "message.level >= 0"),
        ('g: "${ green }"', 'green: "${ green }"'),
        ("constant.ERROR", "constant.ERR"),
        ("feedback.distance_remaining", "feedback.distance"),
    )
    refused = desk.start("1", mission="NoSuchMission")
    told = [line.partition(": error: ")[2] for line in refused.error_message.splitlines()]
    assert told == [
        "operations.spray.with.pose.header: std_msgs/msg/Header has no field 'frame'; "
        "did you mean 'frame_id'? [unknown-argument]",
        "operations.spray.done_when: 'constant' has no 'NOTHING'; allowed: 'NONE' [unknown-name]",
        "operations.spray.detail: 'result' has no 'error_mesg'; did you mean 'error_msg'? [unknown-name]",
        "operations.spray.progress.to go: 'feedback' has no 'distance'; "
        "did you mean 'distance_remaining'? [unknown-name]",
        "actions.lamp.with: std_msgs/msg/ColorRGBA has no field 'green'; "
        "allowed: 'a', 'b', 'g', 'r' [unknown-argument]",
        "values.tank.level.when: 'message' has no 'level'; allowed: 'data' [unknown-name]",
        "events.leak.when: 'constant' has no 'ERR'; did you mean 'ERROR'? [unknown-name]",
    ]
