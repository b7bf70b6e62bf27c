"""The catalog of the mobile base: operations, functions, values, parameters. Needs no ROS, numpy or file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lupin_engine.plugin import (
    ANGLE,
    BOOL,
    COUNT,
    DURATION,
    INTEGER,
    LENGTH,
    NUMBER,
    POSE,
    ROS_NAME,
    TEXT,
    Access,
    Argument,
    Code,
    EventKind,
    Function,
    LiveValue,
    Mock,
    OnHold,
    Operation,
    Parameter,
    Parameters,
    Plugin,
    Reader,
    Type,
    list_of,
)
from lupin_nav.functions import (
    bind_add_place,
    bind_approach,
    bind_approach_discovered,
    bind_distance,
    bind_home_pose,
    bind_named,
    bind_numeric_order,
    bind_tag_reader,
)

#: A tag of the known layout: decimal id, and the position of its plate in metres in frame `map`.
TAG = Type("record", "tag", fields={"id": TEXT, "x": LENGTH, "y": LENGTH})

#: An orientation as in ROS messages; all zeros when nobody knows it.
QUATERNION = Type("record", "quaternion", fields=dict.fromkeys("xyzw", NUMBER))

#: A tag that was seen on the way: where its plate is, and the rotation whose +Z axis is the plate's normal.
SEEN_TAG = Type("record", "seen_tag", fields={"x": LENGTH, "y": LENGTH, "facing": QUATERNION})

#: How full a battery is.
CHARGE = Type("number", "number", minimum=0.0, maximum=1.0)

UNKNOWN_TAG = Code("unknown_tag", "unknown tag", advice="Name a tag that the greenhouse has.")

#: An end without a name in ROS is reported as status 0 (UNKNOWN), so three statuses are all a goal can end in
#: without success: see `goal_status.failure`.
DRIVE_CODES = (
    Code(
        "nav_status_0",
        "navigation retry",
        advice="Wait: the outcome of the drive was lost, and it is tried again.",
    ),
    Code(
        "nav_status_5",
        "navigation retry",
        advice="Wait: somebody else cancelled the drive, and it is tried again.",
    ),
    Code(
        "nav_status_6",
        "navigation retry",
        advice="Wait: navigation gave up, and the drive is tried again.",
    ),
    Code(
        "nav_rejected",
        "navigation goal rejected",
        advice="Look whether the target is on the map and outside of obstacles.",
    ),
    Code(
        "nav_unavailable",
        "navigation server gone",
        advice="Look at the navigation; the drive is tried again.",
    ),
)
DRIFTED = Code(
    "amcl_drift_var",
    "localization drifted",
    advice="Wait for a better pose; if that happens often, look at the map and the laser.",
)

MOCK_LOCALIZE_S = 0.5
MOCK_DRIVE_S = 3.0
MOCK_CHOICE_S = 0.5
#: Where the robot finds itself.
MOCK_START = {"x": 0.5, "y": 0.5, "yaw": 0.0}
#: A place in the middle aisle of the bundled greenhouse.
MOCK_FRONTIER = {"x": 2.0, "y": 4.0, "yaw": 0.0}

_POSE = Argument(POSE, "where to drive, in frame `map`")


def _arrived(arguments: Mapping[str, Any], _: Parameters) -> Mapping[str, Any]:
    """Return the robot's pose after a drive."""
    return {"robot.pose": arguments["pose"]}


OPERATIONS: Mapping[str, Operation] = {
    "localize": Operation(
        doc="Wait until the robot knows where it is: the last localizer pose is live and certain enough.",
        arguments={
            "max_variance": Argument(NUMBER, "largest variance of x, y (m²) and yaw (rad²) that passes"),
        },
        on_hold=OnHold.FINISH,
        mock=Mock(after=MOCK_LOCALIZE_S, values={"robot.pose": MOCK_START}),
    ),
    "go_to": Operation(
        doc="Drive to a pose; refused at once when the robot does not know well enough where it is.",
        arguments={
            "pose": _POSE,
            "max_variance": Argument(
                NUMBER,
                "largest variance of x, y (m²) and yaw (rad²) to set off with; without it any pose will do",
                optional=True,
            ),
        },
        updates=True,  # Nav2 gives up an old goal for a new one
        codes=(*DRIVE_CODES, DRIFTED),
        uses=("base",),
        on_hold=OnHold.CANCEL,
        mock=Mock(after=MOCK_DRIVE_S, values=_arrived),
    ),
    "choose_frontier": Operation(
        doc="Wait until the map has a frontier where the robot fits, and choose the best: large and near.",
        arguments={
            "avoid": Argument(
                list_of(POSE),
                "not these, nor what is nearer to one than frontier_avoid_distance_m",
                optional=True,
            ),
        },
        result={"pose": POSE},
        on_hold=OnHold.FINISH,
        mock=Mock(after=MOCK_CHOICE_S, result={"pose": MOCK_FRONTIER}),
    ),
    "dock": Operation(
        doc="Drive to the dock, however uncertain the pose: staying away from the charger helps nobody.",
        arguments={"pose": _POSE},
        codes=DRIVE_CODES,
        uses=("base",),
        on_hold=OnHold.CANCEL,
        replaces=True,  # Nav2 gives up an old goal for a new one
        mock=Mock(after=MOCK_DRIVE_S, values=_arrived),
    ),
}

FUNCTIONS: Mapping[str, Function] = {
    "approach": Function(
        doc="The pose from which a tag is read: a standoff before its plate, facing the tag.",
        returns=POSE,
        bind=bind_approach,
        arguments={"target": Argument(TAG, "the tag to stand in front of")},
    ),
    "approach_discovered": Function(
        doc="The pose from which a tag is read that was found on the way: a standoff along its normal. Where "
        "a tag of the layout hangs there, it is pulled back until none of the layout's tables covers it.",
        returns=POSE,
        bind=bind_approach_discovered,
        arguments={
            "target": Argument(SEEN_TAG, "the tag to stand in front of"),
            "robot": Argument(POSE, "where the robot is; its side is taken when the tag lies flat"),
        },
    ),
    "distance": Function(
        doc="How far apart two poses are, as the crow flies.",
        returns=LENGTH,
        bind=bind_distance,
        arguments={"a": Argument(POSE, "one pose"), "b": Argument(POSE, "the other one")},
    ),
    "add_place": Function(
        doc="A list of poses and one more at its end; of more than 16 the first is left out.",
        returns=list_of(POSE),
        bind=bind_add_place,
        arguments={
            "places": Argument(list_of(POSE), "the list"),
            "place": Argument(POSE, "what is added"),
        },
    ),
    "tags.numeric_order": Function(
        doc="All tags of the layout, numeric ids first and by number, then the others by name.",
        returns=list_of(TAG),
        bind=bind_numeric_order,
    ),
    "tags.named": Function(
        doc="The tags with these ids, in this order; an unknown id is an error.",
        returns=list_of(TAG),
        bind=bind_named,
        arguments={"names": Argument(list_of(TEXT), "tag ids")},
    ),
    "home_pose": Function(
        doc="Where to return to: the parameter dock_pose, or the start position when that is (0, 0).",
        returns=POSE,
        bind=bind_home_pose,
        arguments={"start": Argument(POSE, "where the mission started, in frame `map`")},
    ),
}

VALUES: Mapping[str, LiveValue] = {
    # No freshness: a localizer publishes only while the robot moves, so an old pose of a robot that stands
    # still is right. Whether its publisher still lives is looked at by localize and go_to instead.
    "robot.pose": LiveValue("where the robot is, in frame `map`; unknown before the first pose", POSE),
    # No freshness: a simulation may have no battery at all, and is full then. A source that falls silent is
    # the client's to notice (`battery_timeout_s`).
    "robot.battery": LiveValue(
        "charge of the battery, of several sources the worst", CHARGE, initial=1.0, classes=(1.0, 0.5, 0.0)
    ),
    "robot.battery_source": LiveValue("topic that tells the worst charge", TEXT, initial=""),
    # No freshness: a machine may have none, or one that speaks only when it is pressed; a silence that is a
    # fault the client reports as engaged (`estop_timeout_s`).
    "robot.estop": LiveValue("whether the emergency stop is engaged", BOOL, initial=False),
}

PARAMETERS: Mapping[str, Parameter] = {
    "nav_action_name": Parameter(ROS_NAME, "navigate_to_pose", "action server that drives (NavigateToPose)"),
    "amcl_pose_topic": Parameter(ROS_NAME, "/amcl_pose", "topic of the localizer's pose with covariance"),
    "amcl_pose_must_live": Parameter(
        BOOL,
        True,
        "whether a pose counts only while its publisher exists; false for a pose that is seeded once (SLAM)",
    ),
    "estop_topic": Parameter(ROS_NAME, "/e_stop_state", "topic of the emergency stop, true while engaged"),
    "estop_timeout_s": Parameter(
        DURATION,
        2.0,
        "an emergency stop that was told steadily and is silent for so long counts as engaged; 0: never",
        maximum=60.0,
    ),
    "battery_topic": Parameter(ROS_NAME, "/io/power/power_watcher", "topic of the battery state"),
    "other_battery_topic": Parameter(ROS_NAME, "/battery", "topic of the battery state on other robots"),
    "battery_timeout_s": Parameter(
        DURATION,
        30.0,
        "a topic of the battery that was heard and is silent for so long tells no charge any more; 0: never",
        maximum=3600.0,
    ),
    "silent_battery_is_empty": Parameter(
        BOOL, False, "whether such a topic tells an empty battery instead, which sends the robot home"
    ),
    "frame_id": Parameter(TEXT, "map", "frame of goals and of the localizer's pose"),
    "tag_locations_file": Parameter(TEXT, "", "layout of the greenhouse, JSON; empty: the bundled one"),
    "tag_sequence": Parameter(list_of(TEXT), [], "tags to visit when a request names none; empty: all"),
    "approach_yaw": Parameter(ANGLE, 0.0, "heading where the geometry gives none"),
    # Without a range: values outside are clamped and not refused, as on the reference robot.
    "approach_standoff_m": Parameter(LENGTH, 0.5, "distance from a tag to read it, kept in 0.2 m ... 1.5 m"),
    "map_yaml_path": Parameter(
        TEXT, "", "a map to load; this build loads none and only warns: Nav2 must have one already"
    ),
    "map_topic": Parameter(ROS_NAME, "/map", "topic of the occupancy grid that is explored"),
    "base_frame": Parameter(TEXT, "base_link", "frame of the robot's body"),
    # Occupancy is 0 (free) to 100 (occupied), -1 is unknown; as nav_msgs/OccupancyGrid has it.
    "frontier_free_thresh": Parameter(COUNT, 20, "occupancy up to which a cell is free", maximum=100),
    "frontier_occupied_thresh": Parameter(
        COUNT,
        65,
        "occupancy from which a cell is solid; a search without result tells how many are in between",
        maximum=100,
    ),
    "frontier_min_cluster_cells": Parameter(COUNT, 6, "frontiers of fewer cells are noise", minimum=1),
    "frontier_robot_clearance_m": Parameter(
        LENGTH, 0.35, "distance from what is solid; at least the planner's inflation radius", minimum=0.0
    ),
    "frontier_robot_radius_cells": Parameter(
        INTEGER, -1, "the same in cells of the map, where 0 or more; -1: by the distance", minimum=-1
    ),
    "frontier_avoid_distance_m": Parameter(
        LENGTH, 0.5, "how near to a place that is avoided a frontier is that place", minimum=0.0
    ),
    "frontier_clearance_occupied_thresh": Parameter(
        COUNT, 65, "occupancy from which a cell is solid to this clearance", maximum=100
    ),
    "approach_overrides_file": Parameter(TEXT, "", "YAML with poses set by hand for tags; empty: none"),
    "dock_pose": Parameter(
        POSE,
        {"x": 0.0, "y": 0.0, "yaw": 0.0},
        "where the dock is; with x and y both 0 the place where the mission started",
    ),
}

PLUGIN = Plugin(
    name="nav",
    doc="The mobile base: navigation, its pose, its battery and its emergency stop.",
    operations=OPERATIONS,
    functions=FUNCTIONS,
    values=VALUES,
    events={
        "battery_silent": EventKind(
            "A source of the battery's charge is silent: that charge is unknown.", {"source": TEXT}
        )
    },
    types={"tag": TAG, "quaternion": QUATERNION, "seen_tag": SEEN_TAG},
    readers={"tag": Reader(UNKNOWN_TAG, bind_tag_reader)},
    parameters=PARAMETERS,
    client="lupin_nav.client:NavClient",
    nodes={"nav_watchdog": "lupin_nav.node:main"},
    guards={"nav_watchdog": ("navigate_to_pose",)},
    access=Access(
        viewer=(
            "/map",
            "/plan",
            "/tf",
            "/tf_static",
            "/amcl_pose",
            "/battery",
            "/io/power/power_watcher",
            "/e_stop_state",
        ),
        operator=(
            "/goal_pose",
            "/navigate_to_pose",
            "/navigate_to_pose/_action/cancel_goal",
            "/navigate_through_poses/_action/cancel_goal",
        ),
        motions=("/goal_pose",),
    ),
)
