"""The parameters that users know: their names, types and defaults are an interface, like topics are.

The table is that of the interface description. Where the node departs from it, `DEPARTURES` says why.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from rcl_interfaces.msg import ParameterDescriptor, ParameterType
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters
from rclpy.parameter import parameter_value_to_python

from tests.lupin_ros.world import Operator, World

pytestmark = pytest.mark.timeout(120)

#: Name -> default; a text list without a default is `None`.
TABLE: dict[str, Any] = {
    "nav_action_name": "navigate_to_pose",
    "bridge_service_name": "/greenhouse_bridge/get_tag_reading",
    "estop_topic": "/e_stop_state",
    "amcl_pose_topic": "/amcl_pose",
    "dependency_timeout_s": 30.0,
    "map_yaml_path": "",
    "localization_timeout_s": 15.0,
    "localization_covariance_threshold": 0.25,
    "nav_localization_cov_threshold": 0.25,
    "tag_locations_file": "",
    "tag_sequence": None,
    "approach_yaw": 0.0,
    "approach_standoff_m": 0.5,
    "approach_overrides_file": "",
    "nav_timeout_s": 60.0,
    "nav_max_attempts": 2,
    "scan_timeout_s": 5.0,
    "flower_scan_dwell_s": 0.0,
    "require_visual_confirmation": False,
    "visual_confirmation_service": "/perception/confirm_tag",
    "visual_confirmation_timeout_s": 3.0,
    "dock_pose": [0.0, 0.0, 0.0],
    "dock_timeout_s": 60.0,
    "dock_retry_max": 3,
    "battery_topic": "/io/power/power_watcher",
    "battery_low_threshold": 0.20,
    "discovery_goal": 5,
    "discovered_tags_topic": "/perception/discovered_tags",
    "map_topic": "/map",
    "base_frame": "base_link",
    "frame_id": "map",
    "frontier_free_thresh": 20,
    "frontier_occupied_thresh": 65,
    "frontier_min_cluster_cells": 6,
    "frontier_robot_clearance_m": 0.35,
    "frontier_robot_radius_cells": -1,
    "frontier_clearance_occupied_thresh": 65,
    "exploration_timeout_s": 180.0,
    "arm_patrol_enabled": False,
    "arm_preset_service": "/lupin/arm/preset",
    "arm_inspect_preset": "inspect",
    "arm_travel_preset": "home",
    "arm_travel_settle_s": 0.0,
    "monitoring_sweeps": 1,
    "state_publish_rate_hz": 5.0,
    "mission_id_prefix": "lupin",
    "seed_climate_on_discovery": True,
}

#: What is otherwise here, and why.
DEPARTURES: dict[str, Any] = {
    "tag_sequence": [],  # one type, one meaning: an empty list is "none named", as an unset one is there
    "monitoring_sweeps": 0,  # the mission is a loop until somebody ends it; a number ends it
}

#: What the node has beside the table, and what it is for.
MORE = {
    "missions",  # which missions are offered, and where their files are
    "missions_path",
    "amcl_pose_must_live",  # a pose seeded once is one without a publisher
    "journal_path",  # what enters the machine is on disk before it counts
    "journal_required",
    "may_repeat_outcomes",  # what a journal that cannot be written would otherwise forbid
    "journal_missions",
    "journal_days",
    "journal_megabytes",
    "log_path",  # JSON lines that never fill a disk
    "log_bytes",
    "log_files",
    "resume_policy",
    "allow_bundles",  # a signature does not grow old; a version does
    "require_signed",  # only missions that somebody has signed
    "max_targets",  # a request of 65,535 targets held the node up for 43 s
    "estop_timeout_s",  # a stop that was told steadily and falls silent is engaged
    "other_battery_topic",  # robots tell their battery here or there
    "battery_timeout_s",  # a battery that was heard and falls silent is unknown
    "silent_battery_is_empty",  # and may send the robot home
    "battery_hysteresis",  # a battery that flickers at the threshold is one trip to the dock
    "frontier_timeout_s",  # a search ends when nothing is left to explore
    "frontier_avoid_distance_m",  # a frontier to which there was no way is not chosen again
}
OF_ROS = {"autostart_node", "frame_prefix", "start_type_description_service", "use_sim_time"}

#: Lower and upper end of what is allowed; where nothing stands a number is free.
RANGES: dict[str, tuple[float, float]] = {
    "state_publish_rate_hz": (0.1, float("inf")),
    "nav_max_attempts": (1, 2**53 - 1),
    "dock_retry_max": (0, 2**53 - 1),
    "discovery_goal": (1, 2**53 - 1),
    "monitoring_sweeps": (0, 2**53 - 1),
    "battery_low_threshold": (0.0, 1.0),
    "frontier_free_thresh": (0, 100),
    "frontier_occupied_thresh": (0, 100),
    "frontier_clearance_occupied_thresh": (0, 100),
    "frontier_min_cluster_cells": (1, 2**53 - 1),
    "frontier_robot_radius_cells": (-1, 2**53 - 1),
}
#: Any number is a heading, and a standoff out of reach is clamped where it is used.
WITHOUT_RANGE = {"approach_yaw", "approach_standoff_m"}
UNITS = {
    "approach_yaw": "rad",
    "approach_standoff_m": "m",
    "frontier_robot_clearance_m": "m",
    "frontier_avoid_distance_m": "m",
    "dock_pose": "x m, y m, yaw rad",
}
NUMBERS = (ParameterType.PARAMETER_DOUBLE, ParameterType.PARAMETER_INTEGER)


@pytest.fixture(scope="module")
def declared(
    ros_domain: int, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[dict[str, tuple[ParameterDescriptor, Any]]]:
    """What a node says of itself that was started without any parameter."""
    world = World(tmp_path_factory.mktemp("node"))
    operator = Operator("reader")
    node = "/mission_orchestrator"
    try:
        world.start("mission_orchestrator")
        listed = operator.call(ListParameters, f"{node}/list_parameters", ListParameters.Request())
        names = list(listed.result.names)
        asked = DescribeParameters.Request(names=names)
        described = operator.call(DescribeParameters, f"{node}/describe_parameters", asked)
        got = operator.call(GetParameters, f"{node}/get_parameters", GetParameters.Request(names=names))
        values = [parameter_value_to_python(value) for value in got.values]
        yield dict(zip(names, zip(described.descriptors, values, strict=True), strict=True))
    finally:
        operator.ros.close()
        assert world.stop() == []


Declared = dict[str, tuple[ParameterDescriptor, Any]]


def test_every_parameter_of_the_table_is_declared_and_no_other(declared: Declared) -> None:
    """A parameter that nobody knows is a mistake here, or belongs into the table."""
    assert set(declared) == set(TABLE) | MORE | OF_ROS


@pytest.mark.parametrize("name", TABLE)
def test_it_has_the_default_of_the_table(declared: Declared, name: str) -> None:
    """With its type: a whole number is none of a continuous quantity."""
    descriptor, value = declared[name]
    expected = DEPARTURES.get(name, TABLE[name])
    found = list(value) if isinstance(expected, list) else value
    assert (found, type(found)) == (expected, type(expected))
    assert descriptor.name == name


@pytest.mark.parametrize("name", [*TABLE, *sorted(MORE)])
def test_it_is_described_with_unit_and_range(declared: Declared, name: str) -> None:
    """As `ros2 param describe` shows it."""
    descriptor, _ = declared[name]
    unit = UNITS.get(name, "s" if name.endswith("_s") else "")
    text, _, told = descriptor.description.partition(" [")
    assert text
    assert told == (f"{unit}]" if unit else "")
    ranges = [*descriptor.floating_point_range, *descriptor.integer_range]
    assert len(ranges) == (descriptor.type in NUMBERS and name not in WITHOUT_RANGE)
    if name in RANGES:
        assert (ranges[0].from_value, ranges[0].to_value) == RANGES[name]


def test_departures_depart() -> None:
    """What has become as the table says is no departure any more."""
    assert all(TABLE[name] != value for name, value in DEPARTURES.items())
