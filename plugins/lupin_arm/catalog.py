"""What the arm offers a mission, as data: loads without ROS."""

from __future__ import annotations

from lupin_engine.plugin.contract import Action, Argument, Parameter, Plugin
from lupin_engine.plugin.types import BOOL, ROS_NAME, TEXT

PLUGIN = Plugin(
    name="arm",
    doc="The arm while on patrol.",
    actions={
        "preset": Action(
            doc="Send the arm to a named preset; a mission never waits for the arm, nor fails because of it.",
            arguments={"name": Argument(TEXT, "name of the preset, such as `travel`, `inspect` or `home`")},
            moves=True,
        ),
    },
    parameters={
        "arm_patrol_enabled": Parameter(BOOL, False, "whether missions move the arm at all"),
        "arm_preset_service": Parameter(
            ROS_NAME, "/lupin/arm/preset", "service that takes preset names (SetArmPreset)"
        ),
    },
    client="lupin_arm.client:ArmClient",
    nodes={"lupin_arm": "lupin_arm.node:main", "lupin_arm_sim": "lupin_arm.node.sim:main"},
    serves=("/lupin/arm/preset", "/lupin/arm/library/state", "/joint_states"),
    stands_in={"lupin_arm_sim": ("mirte_master_gripper_controller/gripper_cmd",)},
)
