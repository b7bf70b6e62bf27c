"""The settings of the node `lupin_arm`."""

from __future__ import annotations

from lupin_arm.node.calibration.chart import CHART
from lupin_arm.node.gates import SERVOS
from lupin_engine.plugin import ROS_NAME, TEXT, Parameter, number_in, one_of
from lupin_greenhouse import WATCHDOG_PARAMETERS

PARAMETERS = {
    "joint_states_topic": Parameter(ROS_NAME, "/joint_states", "JointState: where the joints are"),
    "trajectory_topic": Parameter(
        ROS_NAME, "/mirte_master_arm_controller/joint_trajectory", "JointTrajectory: what the arm is to do"
    ),
    "gripper_action": Parameter(
        ROS_NAME, "/mirte_master_gripper_controller/gripper_cmd", "GripperCommand: the jaw's controller"
    ),
    "estop_topic": Parameter(ROS_NAME, "/e_stop_state", "Bool: the emergency stop, true while engaged"),
    "estop_timeout": Parameter(
        number_in("s"),
        2.0,
        "an emergency stop that was told steadily and is silent for so long counts as engaged; 0: never",
        minimum=0.0,
        maximum=60.0,
    ),
    "torque_service": Parameter(
        ROS_NAME, f"{SERVOS}/enable_all_servos", "SetBool: the vendor's switch of the servos' power"
    ),
    "gate_service": Parameter(
        ROS_NAME, "/enable_arm_control", "SetBool: the vendor's gate of commands; a simulation has none"
    ),
    "hardware": Parameter(
        one_of("auto", "real", "simulated"),
        "auto",
        "the servos: real, simulated, or auto (real where their own services are there)",
    ),
    "preset_duration": Parameter(
        number_in("s"), 3.0, "how long a preset takes, more where it is far", minimum=0.5, maximum=60.0
    ),
    "init_duration": Parameter(
        number_in("s"), 5.0, "how long /lupin/arm/init takes to the zero pose", minimum=0.5, maximum=60.0
    ),
    "library_path": Parameter(
        TEXT, "", "JSON file of the operators' poses; empty: lupin/arm_library.json among the user's settings"
    ),
    "mission_state_topic": Parameter(
        ROS_NAME, "/mission/state", "MissionState: while a mission runs the library moves nothing"
    ),
    **WATCHDOG_PARAMETERS,
    **CHART.parameters,
}
