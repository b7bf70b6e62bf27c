"""The driver of the mobile base over ROS: Nav2's action server, localizer, battery and emergency stop.

A robot that still moves after a cancel is reported (`cancel_refused`), as is a battery source that falls
silent. Poses in another frame than the map are ignored. All callbacks run on the node's one thread.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from geometry_msgs.msg import Point as Position
from geometry_msgs.msg import PoseWithCovarianceStamped, Quaternion
from nav2_msgs.action import NavigateToPose
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import BatteryState
from tf2_msgs.msg import TFMessage

from lupin_engine.plugin import Code, Outlet, pose_fields
from lupin_greenhouse import StopListener, StopState, frame_name
from lupin_nav import goal_status, localization
from lupin_nav.battery import Charges, charge
from lupin_nav.exploration import Explorer
from lupin_nav.frontier import Point
from lupin_nav.standstill import MovementWatch
from lupin_ros.adapter import (
    WATCH_PERIOD_S,
    ActionAttempts,
    ActionOperation,
    ActionServer,
    Done,
    Failed,
    Qos,
    Repeater,
    RosNode,
    WarnOnce,
)

#: The text for people when the robot does not stop.
REFUSES = "the robot may be moving: navigation refuses to stop"
#: What the diagnostics warn of.
_UNKNOWN = Code(
    "battery_silent",
    "the charge of the battery is unknown",
    advice="Look whether the node that publishes the topic runs.",
)
_STOPPED = Code("stopped", "the robot is stopped", advice="Look why, release the stop, then resume.")
#: How often a map is searched again while a frontier is waited for, in seconds; each new map is, too.
SEARCH_PERIOD_S = 1.0
#: Looks at the battery within the time after which a silent source is unknown.
BATTERY_LOOKS = 12


@dataclass
class _Localizing:
    """An attempt that waits for a pose."""

    limit: float
    reported: str = ""


class NavClient:
    """The driver of plugin `nav`; see `Driver` for the contract of each call."""

    def __init__(self, ros: RosNode, outlet: Outlet, parameters: Mapping[str, Any]) -> None:
        self._ros = ros
        self._outlet = outlet
        self._parameters = parameters
        self._fix: localization.Fix | None = None
        self._drives = ActionAttempts(ros, outlet)
        self._localizing: dict[str, _Localizing] = {}
        self._warn = WarnOnce(ros.log)
        self._closed = False
        self._server = ActionServer(ros, NavigateToPose, parameters["nav_action_name"], ours=True)
        self._driving = ActionOperation(
            self._server, _outcome, _feedback_text, "nav_rejected", "nav_unavailable", refused=REFUSES
        )
        self._standstill = MovementWatch()
        self._pose_topic = ros.topic_name(parameters["amcl_pose_topic"])
        ros.subscribe(PoseWithCovarianceStamped, parameters["amcl_pose_topic"], Qos.LATCHED, self._on_pose)
        self._charges = Charges(
            BATTERY_LOOKS if parameters["battery_timeout_s"] else 0, parameters["silent_battery_is_empty"]
        )
        self._battery_looks = 0
        self._battery_source = ""
        period = parameters["battery_timeout_s"] / BATTERY_LOOKS
        self._watching_battery = Repeater(ros.timer, period, self._look_at_battery)
        for topic in dict.fromkeys((parameters["battery_topic"], parameters["other_battery_topic"])):
            ros.subscribe(BatteryState, topic, Qos.EVENT, partial(self._on_battery, topic))
        self._estop = StopListener(
            ros, parameters["estop_topic"], parameters["estop_timeout_s"], self._on_estop
        )
        self._watching = Repeater(ros.steady_timer, WATCH_PERIOD_S, self._watch)
        self._map_topic = ros.topic_name(parameters["map_topic"])
        resolved = {"map_topic": self._map_topic, "amcl_pose_topic": self._pose_topic}
        self._explorer = Explorer(outlet, {**parameters, **resolved}, self._believed_place, ros.elapsed)
        self._explores = False
        self._searching = Repeater(ros.steady_timer, SEARCH_PERIOD_S, self._search)
        if RosNode.rehearsed is not None:
            self._start_exploring()
        if parameters["map_yaml_path"]:
            ros.log.warning(
                "map_yaml_path is ignored: this build loads no maps, Nav2 must have one already",
                map_yaml_path=parameters["map_yaml_path"],
            )

    def missing(self) -> list[str]:
        """Return the action server while it cannot be reached, or its old goals are not cancelled yet."""
        return self._server.missing()

    def start(self, attempt: str, operation: str, arguments: Mapping[str, Any]) -> None:
        """Begin `localize`, `go_to`, `choose_frontier` or `dock`; ValueError for any other operation."""
        if operation == "localize":
            self._start_localizing(attempt, arguments["max_variance"])
        elif operation == "go_to":
            self._go_to(attempt, arguments["pose"], arguments.get("max_variance"))
        elif operation == "choose_frontier":
            self._choose_frontier(attempt, arguments.get("avoid") or ())
        elif operation == "dock":
            self._drive(attempt, arguments["pose"])
        else:
            raise ValueError(f"nav has no operation {operation!r}")

    def cancel(self, attempt: str) -> None:
        """Cancel an attempt; a goal that is not accepted yet is cancelled once it is."""
        drives = self._drives.runs(attempt)
        self._drives.cancel(attempt)
        if drives:
            self._standstill.cancelled(attempt, self._ros.elapsed())
        if self._localizing.pop(attempt, None) is not None:
            self._outlet.cancelled(attempt)
        self._explorer.cancel(attempt)

    def recover(self, attempt: str, operation: str, *, adopt: bool) -> None:
        """Adopt or cancel a drive of an earlier process; its other attempts ended with that process."""
        if operation in ("go_to", "dock"):
            if not adopt:
                self._standstill.cancelled(attempt, self._ros.elapsed())
            self._drives.recover(attempt, self._driving, adopt=adopt)
        else:
            self._outlet.cancelled(attempt)

    def act(self, action: str, arguments: Mapping[str, Any]) -> None:
        """Raise ValueError: this plugin has no actions."""
        raise ValueError(f"nav has no action {action!r}")

    def close(self) -> None:
        """Cancel all goals as far as the server can be reached; report nothing more."""
        self._closed = True
        self._localizing.clear()
        self._explorer.close()
        self._searching.stop()
        self._watching.stop()
        self._drives.close()
        self._watching_battery.stop()
        self._estop.close()

    # --- localization

    def _start_localizing(self, attempt: str, limit: float) -> None:
        self._localizing[attempt] = _Localizing(limit)
        self._watching.start()
        self._outlet.accepted(attempt)
        self._look_at_localization()

    def _watch(self) -> None:
        """Check the pose while an attempt waits for it."""
        if self._localizing:
            self._look_at_localization()
        else:
            self._watching.stop()

    def _look_at_localization(self) -> None:
        for attempt, waiting in list(self._localizing.items()):
            reason = localization.waits_for(self._fix, self._pose_is_live(), waiting.limit, self._pose_topic)
            if not reason:
                del self._localizing[attempt]
                self._outlet.done(attempt, {})
            elif reason != waiting.reported:
                waiting.reported = reason
                self._outlet.progress(attempt, reason)

    def _pose_is_live(self) -> bool:
        """Return whether the last pose is reliable: its publisher still exists, where that is required.

        Age does not show it: a localizer is silent while the robot stands.
        """
        must_live = self._parameters["amcl_pose_must_live"]
        return not must_live or self._ros.count_publishers(self._pose_topic) > 0

    def _on_pose(self, message: PoseWithCovarianceStamped) -> None:
        if not self._is_in_map(message.header.frame_id, self._pose_topic):
            return
        self._fix = localization.fix(message)
        if self._fix is not None:
            # The time of receipt, not of the header: the pose holds until the next one, however old it is,
            # and simulations mix clocks.
            self._report("robot.pose", self._fix.pose)
            self._watch_standstill((self._fix.x, self._fix.y))
        self._look_at_localization()

    def _watch_standstill(self, place: Point) -> None:
        attempt = self._standstill.attempt
        if (
            self._standstill.moves(place, self._ros.elapsed(), self._drives.runs(attempt))
            and not self._closed
        ):
            self._outlet.cancel_refused(attempt, REFUSES)

    def _is_in_map(self, frame: str, topic: str) -> bool:
        """Return whether a message is in frame `map`; others are ignored, with one warning."""
        frame, expected = frame_name(frame), self._parameters["frame_id"]
        if frame in ("", expected):
            return True
        self._warn("message in another frame ignored", topic=topic, frame=frame, expected=expected)
        return False

    # --- exploring

    def _choose_frontier(self, attempt: str, avoid: Sequence[Mapping[str, float]]) -> None:
        self._start_exploring()
        self._searching.start()
        self._explorer.start(attempt, [(pose["x"], pose["y"]) for pose in avoid])

    def _start_exploring(self) -> None:
        """Subscribe to map and transforms at the first search: without exploration they cost nothing."""
        if self._explores:
            return
        self._explores = True
        ros = self._ros
        ros.subscribe(OccupancyGrid, self._map_topic, Qos.LATCHED, self._on_map)
        ros.subscribe(TFMessage, "/tf", Qos.TRANSFORMS, self._explorer.take_transforms)
        ros.subscribe(TFMessage, "/tf_static", Qos.STATIC_TRANSFORMS, self._take_static)

    def _on_map(self, message: OccupancyGrid) -> None:
        if self._is_in_map(message.header.frame_id, self._map_topic):
            self._explorer.take_map(message)

    def _take_static(self, message: TFMessage) -> None:
        self._explorer.take_transforms(message, static=True)

    def _believed_place(self) -> Point | None:
        return None if self._fix is None else (self._fix.x, self._fix.y)

    def _search(self) -> None:
        self._explorer.look()
        if self._explorer.idle:
            self._searching.stop()

    # --- driving

    def _go_to(self, attempt: str, pose: Mapping[str, float], limit: float | None) -> None:
        drift = localization.drift(self._fix, self._pose_is_live(), limit)
        if drift:
            self._outlet.failed(attempt, "amcl_drift_var", drift)
        else:
            self._drive(attempt, pose)

    def _drive(self, attempt: str, pose: Mapping[str, float]) -> None:
        self._standstill.forget()
        self._drives.start(attempt, self._driving, self._goal(pose))

    def _goal(self, pose: Mapping[str, float]) -> NavigateToPose.Goal:
        goal = NavigateToPose.Goal()
        goal.pose.header.frame_id = self._parameters["frame_id"]
        goal.pose.header.stamp = self._ros.stamp()
        fields = pose_fields(pose)
        goal.pose.pose.position = Position(**fields["position"])
        goal.pose.pose.orientation = Quaternion(**fields["orientation"])
        return goal

    # --- live values

    def _on_battery(self, topic: str, message: BatteryState) -> None:
        fraction = charge(message.percentage)
        if fraction is None or self._closed:
            return
        # What is heard counts from the next look on.
        self._charges.heard(topic, fraction, self._battery_looks + 1)
        if self._parameters["battery_timeout_s"]:
            self._watching_battery.start()
        self._report_battery()

    def _look_at_battery(self) -> None:
        """Count ticks instead of seconds: after a block of its own the node reads waiting messages first."""
        self._battery_looks += 1
        for topic in self._charges.due(self._battery_looks):
            self._ros.log.warning("the battery is not heard any more: its charge is unknown", topic=topic)
            self._report_battery()
            self._outlet.event("nav.battery_silent", {"source": topic})

    def _report_battery(self) -> None:
        worst, silent = self._charges.worst(self._battery_looks), self._charges.silent(self._battery_looks)
        topics = ", ".join(silent)
        self._ros.trouble("battery", topics and f"{_UNKNOWN.label}: {topics} is silent", _UNKNOWN)
        if worst is not None:
            source, fraction = worst
            if source != self._battery_source:
                self._battery_source = source
                self._report("robot.battery_source", source)
            self._report("robot.battery", fraction)

    def _on_estop(self, state: StopState) -> None:
        # The stop leaves first, whatever the rest does.
        self._report("robot.estop", state.engaged)
        if state.engaged:
            self._ros.log.warning(self._estop.reason)
        self._ros.trouble("stop", self._estop.reason, _STOPPED)

    def _report(self, name: str, value: Any) -> None:
        if not self._closed:
            self._outlet.value(name, value, self._ros.now())


def _outcome(status: int, result: Any) -> Done | Failed:
    return Done() if status == goal_status.SUCCEEDED else Failed(*goal_status.failure(status, result))


def _feedback_text(feedback: NavigateToPose.Feedback) -> str:
    return f"{feedback.distance_remaining:.1f} m to go, {feedback.number_of_recoveries} recoveries"
