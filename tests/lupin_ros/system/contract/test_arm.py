"""The plugin `arm` keeps the contract, whoever takes the presets."""

from __future__ import annotations

from typing import Any, ClassVar

import pytest

from lupin_harness.cases import CatalogContract, DriverContract
from lupin_msgs.srv import SetArmPreset
from lupin_ros.adapter.node import RosNode

pytestmark = pytest.mark.timeout(120)


class TestCatalog(CatalogContract):
    """Without ROS."""

    plugin = "arm"


class TestDriver(DriverContract):
    """Over ROS 2, with a stand-in that knows one preset."""

    plugin = "arm"
    arguments: ClassVar = {"preset": {"name": "inspect"}}
    parameters: ClassVar = {"arm_patrol_enabled": True}
    nodes = ()
    waits = False  # no mission waits for the arm

    @staticmethod
    def offer(ros: RosNode) -> None:
        """Take presets."""

        def answer(request: Any, response: Any) -> Any:
            response.success = request.name == "inspect"
            return response

        ros.serve(SetArmPreset, "/lupin/arm/preset", answer)


class TestDriverWithItsOwnNodes(DriverContract):
    """Over ROS 2, with the node that knows the presets, and the simulated arm."""

    plugin = "arm"
    arguments: ClassVar = {"preset": {"name": "home"}}
    parameters: ClassVar = {"arm_patrol_enabled": True}
    waits = False
