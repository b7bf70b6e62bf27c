"""Missions that come while the node runs: a file and a binding dropped into the folder are a mission."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed here")

from rcl_interfaces.srv import GetParameters
from std_msgs.msg import Bool, String

from lupin_engine.chart.load import default_missions_folder
from lupin_engine.middleware.node import Qos, RosNode
from lupin_msgs.srv import SetArmPreset
from tests.ros.world import Operator, World

pytestmark = [pytest.mark.ros, pytest.mark.timeout(180)]

TUTORIAL = Path(__file__).parents[2] / "docs" / "tutorial"


class Desk(Operator):
    """An operator who also sees which missions there are."""

    def __init__(self) -> None:
        super().__init__("desk")
        self.offers: list[dict[str, Any]] = []
        self.ros.subscribe(
            String, "/mission_orchestrator/missions", Qos.LATCHED, lambda m: self.offers.append(json.loads(m.data))
        )

    def offered(self, mission: str) -> dict[str, Any]:
        """Wait until a mission is offered, and return how."""
        found: list[dict[str, Any]] = []

        def there() -> bool:
            found[:] = [m for o in self.offers[-1:] for m in o["missions"] if m["mission"] == mission]
            return bool(found)

        self.until(there, f"{mission} is offered")
        return found[0]

    def problem(self) -> str:
        """Wait until something is wrong with the files, and return what."""
        self.until(lambda: self.offers and self.offers[-1]["problems"], "a problem of the files")
        return "\n".join(self.offers[-1]["problems"])


class Arm:
    """The server of the arm's presets."""

    def __init__(self, ros: RosNode) -> None:
        self.asked: list[str] = []
        self.answers = True
        ros.serve(SetArmPreset, "/lupin/arm/preset", self._answer)

    def _answer(self, request: Any, response: Any) -> Any:
        self.asked.append(request.name)
        response.success, response.message = self.answers, "" if self.answers else "no such pose"
        return response


@pytest.fixture
def world(ros_domain: int, tmp_path: Path) -> Iterator[World]:
    """Nodes on a domain of their own; the test fails if one does not end when asked."""
    world = World(tmp_path)
    yield world
    assert world.stop() == []


@pytest.fixture
def desk(ros_domain: int) -> Iterator[Desk]:
    """An operator on the same domain."""
    desk = Desk()
    yield desk
    desk.ros.close()


@pytest.fixture
def missions(tmp_path: Path) -> Path:
    """A folder with the inspection alone."""
    folder, shipped = tmp_path / "missions", default_missions_folder()
    shutil.copytree(shipped / "parts", folder / "parts")
    for name in ("lifecycle.yaml", "inspection.yaml"):
        shutil.copy(shipped / name, folder)
    return folder


def drop_patrol(missions: Path) -> None:
    """Do what the tutorial ends with; the mission comes last, as a careful person would copy."""
    (missions / "bindings").mkdir(exist_ok=True)
    shutil.copy(TUTORIAL / "photo_arm.yaml", missions / "bindings")
    shutil.copy(TUTORIAL / "patrol.yaml", missions)
