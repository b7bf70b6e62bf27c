"""The engine's side of the arm over real DDS."""

from __future__ import annotations

from lupin_arm.catalog import PLUGIN
from lupin_arm.client import ArmClient
from lupin_msgs.srv import SetArmPreset
from tests.lupin_ros.helpers import spin_until
from tests.lupin_ros.plugins.arm.scene import MakeNode
from tests.plugins.fakes import FakeOutlet, defaults


def test_over_the_wire_a_preset_arrives(make_node: MakeNode) -> None:
    names: list[str] = []

    def take(request: SetArmPreset.Request, response: SetArmPreset.Response) -> SetArmPreset.Response:
        names.append(request.name)
        response.success = True
        return response

    server, ours = make_node("arm"), make_node("ours")
    server.serve(SetArmPreset, "/lupin/arm/preset", take)
    client = ArmClient(ours, FakeOutlet(), defaults(PLUGIN, arm_patrol_enabled=True))
    probe = ours.service(SetArmPreset, "/lupin/arm/preset")
    spin_until([server, ours], probe.ready)

    def arrived() -> bool:
        if not names:
            client.act("preset", {"name": "inspect"})
        return bool(names)

    spin_until([server, ours], arrived)
    assert set(names) == {"inspect"}
