"""What the panel of today uses, row by row, as its web page has it: written by hand, from its description."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from tests.lupin_ros.launch.hmi.panel import CANCEL_DRIVES, STOP_TOPIC

#: Nodes of ours.
ORCHESTRATOR, AGGREGATOR, TWIN, ARM = (
    "mission_orchestrator",
    "perception_aggregator",
    "lupin_twin",
    "lupin_arm",
)
ROBOT, SERVOS = "lupin_sim", "lupin_arm_sim"
WATCHDOG = "nav_watchdog"

# --- what the panel uses ----------------------------------------------------------------------------------

#: Topics that it shows: type, and who of ours publishes them.
SHOWN = {
    "/mission/state": ("lupin_msgs/MissionState", {ORCHESTRATOR}),
    "/floranova/observations": ("lupin_msgs/Observation", {ORCHESTRATOR, AGGREGATOR}),
    "/twin/state": ("lupin_msgs/TwinState", {TWIN}),
    "/camera/tag_detections_json": ("std_msgs/String", {ROBOT}),
    "/map": ("nav_msgs/OccupancyGrid", {ROBOT}),
    "/plan": ("nav_msgs/Path", {ROBOT}),
    "/tf": ("tf2_msgs/TFMessage", {ROBOT}),
    "/lupin/arm/library/state": ("std_msgs/String", {ARM}),
    "/io/power/power_watcher": ("sensor_msgs/BatteryState", {ROBOT}),
    "/joint_states": ("sensor_msgs/JointState", {SERVOS}),
    "/rosout": ("rcl_interfaces/Log", {ORCHESTRATOR, AGGREGATOR, TWIN, ARM, ROBOT, SERVOS}),
}
#: Topics that it does not show, and that others of today read beside it.
READ_BESIDE = {
    "/perception/discovered_tags": ("lupin_msgs/DiscoveredTags", {AGGREGATOR}),
    "/perception/box_geometry_json": ("std_msgs/String", {AGGREGATOR}),
}
#: Topics that it tells: type, and who of ours listens.
TOLD = {
    "/goal_pose": ("geometry_msgs/PoseStamped", {ROBOT}),
    "/cmd_vel": ("geometry_msgs/Twist", {ROBOT}),
    STOP_TOPIC: ("std_msgs/Bool", {ROBOT, ARM, ORCHESTRATOR, WATCHDOG}),
}
#: Services that it calls: type, and who of ours answers.
CALLED = {
    "/mission/start": ("lupin_msgs/StartMission", ORCHESTRATOR),
    "/mission/pause": ("std_srvs/Trigger", ORCHESTRATOR),
    "/mission/resume": ("std_srvs/Trigger", ORCHESTRATOR),
    "/mission/abort": ("std_srvs/Trigger", ORCHESTRATOR),
    "/mission/skip_current": ("std_srvs/Trigger", ORCHESTRATOR),
    # It has no button for these two; consoles do.
    "/mission/dock": ("std_srvs/Trigger", ORCHESTRATOR),
    "/mission/reset": ("std_srvs/Trigger", ORCHESTRATOR),
    "/twin/get_field": ("lupin_msgs/GetField", TWIN),
    "/lupin/arm/preset": ("lupin_msgs/SetArmPreset", ARM),
    "/lupin/arm/library/list": ("lupin_msgs/GetArmLibrary", ARM),
    "/lupin/arm/library/save_pose": ("lupin_msgs/SaveArmPose", ARM),
    "/lupin/arm/library/goto_pose": ("lupin_msgs/SetArmPreset", ARM),
    "/lupin/arm/library/record": ("lupin_msgs/ArmRecord", ARM),
    "/lupin/arm/library/play": ("lupin_msgs/PlayArmSequence", ARM),
    "/lupin/arm/library/stop": ("std_srvs/Trigger", ARM),
    "/lupin/arm/library/delete": ("lupin_msgs/ArmLibraryEdit", ARM),
    "/lupin/arm/calibrate": ("lupin_msgs/CalibrateArm", ARM),
    "/lupin/arm/set_torque": ("std_srvs/SetBool", ARM),
    "/lupin/arm/init": ("std_srvs/Trigger", ARM),
    "/lupin/arm/shoulder_pan/set_angle_with_speed": ("mirte_msgs/SetServoAngleWithSpeed", ARM),
    "/lupin/arm/shoulder_lift/set_angle_with_speed": ("mirte_msgs/SetServoAngleWithSpeed", ARM),
    "/lupin/arm/elbow/set_angle_with_speed": ("mirte_msgs/SetServoAngleWithSpeed", ARM),
    "/lupin/arm/wrist/set_angle_with_speed": ("mirte_msgs/SetServoAngleWithSpeed", ARM),
    "/lupin/gripper/set_angle_with_speed": ("mirte_msgs/SetServoAngleWithSpeed", ARM),
    CANCEL_DRIVES: ("action_msgs/CancelGoal", ROBOT),
}
#: What else it uses, and why nobody of ours has it.
NOT_OURS = {
    "/tf_static": "the robot's description tells it; the chain of places is whole without it",
    "/cmd_vel_manual": "driving by hand goes to the robot's drive mux",
    "/io/imu/movement/data": "a gauge of the robot's own driver; nothing of ours reads it",
    "/scan": "the same, of the laser; the simulated robot tells the map that comes of it",
    "/odom": "the same, of the wheels; where the robot is stands in /tf",
    "/navigate_through_poses/_action/cancel_goal": "no mission of ours drives through several places",
    "/lupin/leds/set": "the LED bridge of the robot",
    "/lupin/leds/auto": "the LED bridge of the robot",
    "/lupin/nav/clear_map": "starts the robot's SLAM anew; a simulated map begins anew with each mission",
    "/rosapi/get_time": "part of the gateway",
}

LATCHED = {
    "/mission/state",
    "/floranova/observations",
    "/twin/state",
    "/map",
    "/plan",
    "/lupin/arm/library/state",
    *READ_BESIDE,
}
#: Seconds between two messages of what is told again and again, because pages may not hear what is latched.
PERIODS = {
    "/mission/state": 0.2,
    "/twin/state": 1.0,
    "/lupin/arm/library/state": 0.2,
    "/perception/discovered_tags": 0.5,
    "/perception/box_geometry_json": 1.0,
}

# --- what it reads: a type, fields, or a list of one of them ----------------------------------------------

STAMP = {"sec": int, "nanosec": int}
POINT = {"x": float, "y": float, "z": float}
POSE = {"position": POINT, "orientation": {**POINT, "w": float}}
SENSOR = {"name": str, "value": float}
TAG_READING = {"tag_id": str, "stamp": STAMP, "readings": [SENSOR]}
BLOOM = {"position": POINT, "species": str, "confidence": float, "anomaly": bool}
READ = {
    "/mission/state": {
        "mission_id": str,
        "mission_type": str,
        "lifecycle_state": str,
        "mission_phase": str,
        "current_target": str,
        "targets_total": int,
        "targets_completed": int,
        "targets_failed": int,
        "targets_unreachable": int,
        "targets_skipped": int,
        "last_error": str,
        "last_event": str,
        "last_event_severity": int,
        "tags_discovered": int,
        "discovery_goal": int,
        "estop_engaged": bool,
        "paused": bool,
        "battery_percentage": float,
        "battery_low": bool,
        "started_at": STAMP,
    },
    "/floranova/observations": {
        "tag_reading": TAG_READING,
        "status": int,
        "status_detail": str,
        "tag_pose_in_map": POSE,
    },
    "/twin/state": {
        "tags": [
            {
                "tag_id": str,
                "pose": POSE,
                "readings": [SENSOR],
                "last_observed": STAMP,
                "stale_seconds": float,
                "species": str,
                "species_confidence": float,
                "anomaly": bool,
                "flowers": [BLOOM],
                "box_footprint": {"points": [POINT]},
            }
        ]
    },
    "/map": {"info": {"resolution": float, "width": int, "height": int, "origin": POSE}, "data": [int]},
    "/tf": {
        "transforms": [
            {
                "header": {"frame_id": str},
                "child_frame_id": str,
                "transform": {"translation": POINT, "rotation": POSE["orientation"]},
            }
        ]
    },
    "/io/power/power_watcher": {"percentage": float},
    "/joint_states": {"name": [str], "position": [float]},
    "/perception/discovered_tags": {"tags": [{"tag_id": str, "pose_in_map": POSE, "sightings": int}]},
}
#: The same for topics that carry JSON themselves.
READ_IN_TEXT = {
    "/camera/tag_detections_json": [{"id": int, "corners": [[float]], "dist": float}],
    "/perception/box_geometry_json": [
        {"id": str, "x": float, "y": float, "yaw": float, "width": float, "depth": float, "height": float}
    ],
    "/lupin/arm/library/state": {
        "recording": bool,
        "playing": bool,
        "name": str,
        "mode": str,
        "progress": float,
        "elapsed_s": float,
        "n_waypoints": int,
        "torque": bool,
    },
}
FIELD = {
    "ok": bool,
    "error_message": str,
    "width": int,
    "height": int,
    "origin_x": float,
    "origin_y": float,
    "resolution_used": float,
    "value_min": float,
    "value_max": float,
    "sample_count": int,
}
#: Least and greatest value of each sensor in the unit that the panel writes beside it; but soil moisture is a
#: share, as the greenhouse's simulator has it, and the panel of today writes % beside that.
UNITS = {
    "temperature": (0.0, 40.0),
    "humidity": (0.0, 100.0),
    "co2": (200.0, 1500.0),
    "light": (0.0, 2000.0),
    "soil_moisture": (0.0, 1.0),
}


def unread(value: Any, wanted: Any, at: str) -> list[str]:
    """Name what the panel would not find, or not as what it expects."""
    if isinstance(wanted, dict):
        missing = [f"{at}.{name}: missing" for name in wanted if name not in value]
        parts = [(value[name], part, f"{at}.{name}") for name, part in wanted.items() if name in value]
        return [*missing, *_unread(parts)]
    if isinstance(wanted, list):
        return _unread([(item, wanted[0], f"{at}[{i}]") for i, item in enumerate(value)])
    kinds = (int, float) if wanted is float else wanted
    if isinstance(value, bool) is (wanted is bool) and isinstance(value, kinds):
        return []
    return [f"{at}: {value!r} is no {wanted.__name__}"]


def _unread(parts: Iterable[tuple[Any, Any, str]]) -> list[str]:
    return [problem for part in parts for problem in unread(*part)]
