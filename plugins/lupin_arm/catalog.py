"""The catalog of the arm: one action for missions, and its nodes. Loads without ROS."""

from __future__ import annotations

from lupin_engine.plugin import BOOL, ROS_NAME, TEXT, Access, Action, Argument, Parameter, Plugin

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
    composable=("lupin_arm", "lupin_arm_sim"),
    serves=("/lupin/arm/preset",),
    publishes=("/lupin/arm/library/state", "/joint_states"),
    access=Access(
        viewer=("/lupin/arm/library/state", "/lupin/arm/library/list", "/joint_states"),
        operator=(
            "/lupin/arm/preset",
            "/lupin/arm/library/goto_pose",
            "/lupin/arm/library/play",
            "/lupin/arm/library/stop",
            "/lupin/arm/shoulder_pan/set_angle_with_speed",
            "/lupin/arm/shoulder_lift/set_angle_with_speed",
            "/lupin/arm/elbow/set_angle_with_speed",
            "/lupin/arm/wrist/set_angle_with_speed",
            "/lupin/gripper/set_angle_with_speed",
        ),
        engineer=(
            "/lupin/arm/calibrate",
            "/lupin/arm/init",
            "/lupin/arm/set_torque",
            "/lupin/arm/library/delete",
            "/lupin/arm/library/record",
            "/lupin/arm/library/save_pose",
        ),
        # Not the calibration and the servos' power: cancelling the one and switching off the other must pass,
        # and the arm itself refuses what would move it.
        motions=(
            "/lupin/arm/preset",
            "/lupin/arm/init",
            "/lupin/arm/library/goto_pose",
            "/lupin/arm/library/play",
            "/lupin/*/set_angle_with_speed",
            "/mirte_master_arm_controller/joint_trajectory",
            "/io/servo/*/set_angle*",
        ),
    ),
    stands_in={"lupin_arm_sim": ("mirte_master_gripper_controller/gripper_cmd",)},
)
