"""The services for displays: drawings with states folded, and why something can happen or not."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import pytest

from lupin_engine_msgs.srv import Draw, Explain
from lupin_ros.service.names import DRAW_SERVICE, EXPLAIN_SERVICE
from tests.lupin_ros.world import Operator, World

pytestmark = pytest.mark.timeout(180)

MISSION = "MISSION.InspectionMission"


class Display(Operator):
    """Somebody who shows the chart."""

    def __init__(self) -> None:
        super().__init__("display")

    def draw(self, *folded: str, chart: str = "") -> Any:
        """Ask for a drawing."""
        return self.call(Draw, DRAW_SERVICE, Draw.Request(chart=chart, folded=folded))

    def explain(self, element: str) -> dict[str, dict[str, Any]]:
        """Return what is told of each transition."""
        answer = self.call(Explain, EXPLAIN_SERVICE, Explain.Request(element=element))
        assert answer.success, answer.message
        return {rule["id"]: rule for rule in json.loads(answer.explanation)["rules"]}


@pytest.fixture
def display(ros_domain: int) -> Iterator[Display]:
    """A display on the same domain."""
    display = Display()
    yield display
    display.ros.close()


def test_a_chart_is_drawn_and_explained_while_a_mission_runs(world: World, display: Display) -> None:
    """A drawing of another chart is refused by its hash; explanations follow what happens."""
    world.start_all()
    display.in_state("READY")
    whole, folded = display.draw(), display.draw(MISSION)
    assert whole.success
    assert folded.success
    assert f'data-state="{MISSION}.' in whole.svg
    assert f'data-state="{MISSION}.' not in folded.svg
    assert display.draw(MISSION, chart=whole.chart).svg == folded.svg
    other = display.draw(chart="0" * 12)
    assert (other.success, other.svg) == (False, "")
    assert other.message == f"another chart runs: {whole.chart}, not '000000000000'; read ~/chart again"
    wrong = display.draw(f"{MISSION}.INSPECTING.NAVIGATIN")
    assert wrong.message.startswith(f"no state '{MISSION}.")
    before = [rule for rule in display.explain("MISSION").values() if rule["event"] == "operator.abort"]
    assert [(rule["possible"], rule["reason"]) for rule in before] == [(False, "MISSION is not active")]
    display.hit(1, "stall")
    assert display.start("1").accepted
    display.in_state("INSPECTING")
    after = [rule for rule in display.explain("MISSION").values() if rule["event"] == "operator.abort"]
    assert [(rule["possible"], rule["reason"]) for rule in after] == [(True, "")]


def test_more_drawings_at_once_than_are_taken_are_refused(world: World, display: Display) -> None:
    """Each is answered, and a request of the mission is answered among them."""
    world.start_all()
    display.in_state("READY")
    states = [rule["state"] for rule in display.explain(f"{MISSION}.INSPECTING.NAVIGATING").values()]
    assert display.draw().success
    draw, answers = display.ros.service(Draw, DRAW_SERVICE), list[Any]()
    display.until(draw.ready, "the service")
    for count in range(30):
        folded = [name for place, name in enumerate(sorted(set(states) - {""})) if count >> place & 1]
        draw.call(Draw.Request(folded=folded), 60.0, answers.append)
    assert display.ask("pause").message == "pause refused: no mission is running"
    display.until(lambda: len(answers) == 30, "all answers")
    told = {answer.message for answer in answers if not answer.success}
    assert told <= {"8 drawings are asked for already; wait for a moment"}
    assert sum(answer.success for answer in answers) >= 8
    assert display.draw(MISSION).success
