"""The mobile base over ROS: Nav2's action server, the localizer, the battery and the emergency stop.

Every callback runs on the node's one thread, so nothing here is locked.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from action_msgs.srv import CancelGoal
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav2_msgs.action import NavigateToPose
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import BatteryState
from std_msgs.msg import Bool
from tf2_msgs.msg import TFMessage

from lupin_engine.middleware.node import Call, Goal, Qos, RosNode, Timer
from lupin_engine.plugin.contract import Outlet
from lupin_nav import goal_status, localization
from lupin_nav.battery import charge
from lupin_nav.exploration import Explorer
from lupin_nav.transforms import Planar, frame_name

#: How often the localizer and the action server are looked at, in seconds.
WATCH_PERIOD_S = 0.2
#: How often a map is searched again while a frontier is waited for, in seconds; each new map is, too.
SEARCH_PERIOD_S = 1.0
#: How long the answer to a cancel is waited for, in seconds. Nothing depends on it.
CANCEL_DEADLINE_S = 3.0
#: How long an action server may be out of sight before its goals count as lost, in seconds of real time:
#: discovery that stumbles is back sooner, and the clock of a simulation stops when the simulation dies.
SERVER_GRACE_S = 2.0


@dataclass
class _Drive:
    """One attempt at the action server."""

    goal: Goal | None = None
    cancelling: bool = False
    out_of_sight: float = 0.0  # seconds since the server was last seen
    told: str = ""


@dataclass
class _Localizing:
    """One attempt that waits for a pose."""

    limit: float
    told: str = ""


class NavClient:
    """The driver of plugin `nav`: see `Driver` for what every call promises."""

    def __init__(self, ros: RosNode, outlet: Outlet, parameters: Mapping[str, Any]) -> None:
        self._ros = ros
        self._outlet = outlet
        self._parameters = parameters
        self._fix: localization.Fix | None = None
        self._drives: dict[str, _Drive] = {}
        self._localizing: dict[str, _Localizing] = {}
        self._lost: dict[str, _Drive] = {}  # nobody waits for these, and yet a server may still drive them
        self._frames_refused: set[tuple[str, str]] = set()
        self._closed = False
        self._server = ros.action(NavigateToPose, parameters["nav_action_name"])
        self._cancel_all = ros.service(CancelGoal, f"{parameters['nav_action_name']}/_action/cancel_goal")
        self._clearing: Call | None = None
        self._is_cleared = False
        self._pose_topic = ros.node.resolve_topic_name(parameters["amcl_pose_topic"])
        ros.subscribe(PoseWithCovarianceStamped, parameters["amcl_pose_topic"], Qos.LATCHED, self._on_pose)
        ros.subscribe(BatteryState, parameters["battery_topic"], Qos.EVENT, self._on_battery)
        ros.subscribe(Bool, parameters["estop_topic"], Qos.EVENT, self._on_estop)
        self._timer: Timer | None = None
        self._map_topic = ros.node.resolve_topic_name(parameters["map_topic"])
        resolved = {"map_topic": self._map_topic, "amcl_pose_topic": self._pose_topic}
        self._explorer = Explorer(outlet, {**parameters, **resolved}, self._believed_place)
        self._explores = False
        self._searching: Timer | None = None
        if parameters["map_yaml_path"]:
            ros.log.warning(
                "map_yaml_path is ignored: this build loads no maps, Nav2 must have one already",
                map_yaml_path=parameters["map_yaml_path"],
            )

    def missing(self) -> list[str]:
        """Name the action server while it cannot be reached, or its old goals are not yet cancelled.

        A goal of an orchestrator that crashed would otherwise drive on, with nobody who knows of it.
        """
        name = f"action server {self._parameters['nav_action_name']}"
        if not (self._server.ready() and self._cancel_all.ready()):
            return [name]
        if self._is_cleared:
            return []
        if self._clearing is None:
            self._clearing = self._clear(self._cleared)
        return [f"{name} to cancel the goals it had"]

    def _clear(self, done: Callable[[Any], None]) -> Call:
        """Ask the server to cancel every goal: to it, no id and no time mean all."""
        return self._cancel_all.call(CancelGoal.Request(), CANCEL_DEADLINE_S, done)

    def _cleared(self, _: Any) -> None:
        # Also when there was no answer: a server that cannot say so is no reason not to boot.
        self._is_cleared = True

    def start(self, attempt: str, operation: str, arguments: Mapping[str, Any]) -> None:
        """Begin `localize`, `go_to`, `choose_frontier` or `dock`."""
        if operation == "localize":
            self._start_localizing(attempt, arguments["max_variance"])
        elif operation == "go_to":
            self._go_to(attempt, arguments["pose"], arguments.get("max_variance"))
        elif operation == "choose_frontier":
            self._choose_frontier(attempt)
        elif operation == "dock":
            self._drive(attempt, arguments["pose"])
        else:
            raise ValueError(f"nav has no operation {operation!r}")

    def cancel(self, attempt: str) -> None:
        """Ask that an attempt ends; a goal not yet accepted is left to be cancelled when it is."""
        if self._localizing.pop(attempt, None) is not None:
            self._outlet.cancelled(attempt)
        self._explorer.cancel(attempt)
        drive = self._drives.get(attempt)
        if drive is not None and drive.goal is not None:
            drive.cancelling = True
            drive.goal.cancel()

    def act(self, action: str, arguments: Mapping[str, Any]) -> None:
        """Nothing: this plugin has no actions."""
        raise ValueError(f"nav has no action {action!r}")

    def close(self) -> None:
        """Stop the robot as far as it can still be told, and report no more."""
        self._closed = True
        self._localizing.clear()
        self._explorer.close()
        self._stop_searching()
        self._stop_watching()
        for attempt in list(self._drives):
            self._abandon(attempt)
        if self._lost:
            self._clear(self._cleared)  # also what the server has taken and not yet said so

    # --- localization

    def _start_localizing(self, attempt: str, limit: float) -> None:
        self._localizing[attempt] = _Localizing(limit)
        self._start_watching()
        self._outlet.accepted(attempt)
        self._look_at_localization()

    def _look_at_localization(self) -> None:
        for attempt, waiting in list(self._localizing.items()):
            reason = localization.waits_for(self._fix, self._pose_is_live(), waiting.limit, self._pose_topic)
            if not reason:
                del self._localizing[attempt]
                self._outlet.done(attempt, {})
            elif reason != waiting.told:
                waiting.told = reason
                self._outlet.progress(attempt, reason)

    def _pose_is_live(self) -> bool:
        """Say whether the last pose can be relied on.

        Age cannot tell: a localizer is silent while the robot stands. One that died can be told by its
        publisher, which no longer exists.
        """
        must_live = self._parameters["amcl_pose_must_live"]
        return not must_live or self._ros.node.count_publishers(self._pose_topic) > 0

    def _on_pose(self, message: PoseWithCovarianceStamped) -> None:
        if not self._is_in_map(message.header.frame_id, self._pose_topic):
            return
        self._fix = localization.fix(message)
        if self._fix is not None:
            # The time of receipt, not of the header: the pose holds until the next one, however old it is,
            # and simulations mix clocks.
            self._report("robot.pose", self._fix.pose)
        self._look_at_localization()

    def _is_in_map(self, frame: str, topic: str) -> bool:
        """Say whether a message is in our frame; the others are ignored, with one warning."""
        frame, expected = frame_name(frame), self._parameters["frame_id"]
        if frame in ("", expected):
            return True
        if (topic, frame) not in self._frames_refused:
            self._frames_refused.add((topic, frame))
            self._ros.log.warning(
                "message in another frame ignored", topic=topic, frame=frame, expected=expected
            )
        return False

    # --- exploring

    def _choose_frontier(self, attempt: str) -> None:
        self._start_exploring()
        if self._searching is None:
            self._searching = self._ros.steady_timer(SEARCH_PERIOD_S, self._search)
        self._explorer.start(attempt)

    def _start_exploring(self) -> None:
        """Listen to map and transforms from the first search on: who never searches pays nothing."""
        if self._explores:
            return
        self._explores = True
        ros = self._ros
        ros.subscribe(OccupancyGrid, self._map_topic, Qos.LATCHED, self._on_map)
        ros.subscribe(TFMessage, "/tf", Qos.TRANSFORMS, self._explorer.take_transforms)
        ros.subscribe(TFMessage, "/tf_static", Qos.STATIC_TRANSFORMS, self._explorer.take_transforms)

    def _on_map(self, message: OccupancyGrid) -> None:
        if self._is_in_map(message.header.frame_id, self._map_topic):
            self._explorer.take_map(message)

    def _believed_place(self) -> Planar | None:
        return None if self._fix is None else Planar(self._fix.x, self._fix.y, self._fix.yaw)

    def _search(self) -> None:
        self._explorer.look()
        if self._explorer.idle:
            self._stop_searching()

    def _stop_searching(self) -> None:
        if self._searching is not None:
            self._searching.cancel()
            self._searching = None

    # --- driving

    def _go_to(self, attempt: str, pose: Mapping[str, float], limit: float | None) -> None:
        drift = localization.drift(self._fix, self._pose_is_live(), limit)
        if drift:
            self._outlet.failed(attempt, "amcl_drift_var", drift)
        else:
            self._drive(attempt, pose)

    def _drive(self, attempt: str, pose: Mapping[str, float]) -> None:
        if not self._server.ready():
            # A goal sent to nobody is lost without a word.
            self._outlet.failed(attempt, "nav_unavailable", self._server_is("not there"))
            return
        drive = self._drives[attempt] = _Drive()
        self._start_watching()
        drive.goal = self._server.send(
            self._goal(pose),
            accepted=partial(self._on_accepted, attempt),
            feedback=partial(self._on_feedback, attempt),
            ended=partial(self._on_ended, attempt),
            rejected=partial(self._on_rejected, attempt),
        )

    def _goal(self, pose: Mapping[str, float]) -> NavigateToPose.Goal:
        goal = NavigateToPose.Goal()
        goal.pose.header.frame_id = self._parameters["frame_id"]
        goal.pose.header.stamp = self._ros.stamp()
        goal.pose.pose.position.x = float(pose["x"])
        goal.pose.pose.position.y = float(pose["y"])
        goal.pose.pose.orientation.z = math.sin(pose["yaw"] / 2.0)
        goal.pose.pose.orientation.w = math.cos(pose["yaw"] / 2.0)
        return goal

    def _on_accepted(self, attempt: str) -> None:
        lost = self._lost.get(attempt)
        if lost is not None and lost.goal is not None:
            lost.goal.cancel()
        elif attempt in self._drives:
            self._outlet.accepted(attempt)

    def _on_rejected(self, attempt: str) -> None:
        self._lost.pop(attempt, None)
        if self._drives.pop(attempt, None) is not None:
            self._outlet.failed(attempt, "nav_rejected", self._server_is("not willing to take the goal"))

    def _on_feedback(self, attempt: str, feedback: NavigateToPose.Feedback) -> None:
        drive = self._drives.get(attempt)
        told = f"{feedback.distance_remaining:.1f} m to go, {feedback.number_of_recoveries} recoveries"
        if drive is not None and told != drive.told:
            drive.told = told
            self._outlet.progress(attempt, told)

    def _on_ended(self, attempt: str, status: int, result: Any) -> None:
        self._lost.pop(attempt, None)
        drive = self._drives.pop(attempt, None)
        if drive is None:
            return
        if status == goal_status.SUCCEEDED:
            self._outlet.done(attempt, {})
        elif status == goal_status.CANCELED and drive.cancelling:
            self._outlet.cancelled(attempt)
        else:
            self._outlet.failed(attempt, *goal_status.failure(status, result))

    # --- the server's life

    def _start_watching(self) -> None:
        """Look at pose and server from time to time; only while an attempt runs, for the sake of idling."""
        if self._timer is None:
            self._timer = self._ros.steady_timer(WATCH_PERIOD_S, self._watch)

    def _stop_watching(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _watch(self) -> None:
        if not self._drives and not self._localizing:
            self._stop_watching()
            return
        self._look_at_localization()
        in_sight = self._server.ready()
        for attempt, drive in list(self._drives.items()):
            drive.out_of_sight = 0.0 if in_sight else drive.out_of_sight + WATCH_PERIOD_S
            if drive.out_of_sight >= SERVER_GRACE_S:
                self._abandon(attempt)
                self._outlet.failed(attempt, "nav_unavailable", self._server_is("gone"))

    def _abandon(self, attempt: str) -> None:
        """Wait for an attempt no more, but have its goal cancelled.

        The server may only be out of reach and still driving: the middleware repeats the request until it is
        answered. A goal whose acceptance never came is cancelled when it comes.
        """
        drive = self._lost[attempt] = self._drives.pop(attempt)
        if drive.goal is not None:
            drive.goal.cancel()

    def _server_is(self, state: str) -> str:
        return f"action server {self._parameters['nav_action_name']} is {state}"

    # --- live values

    def _on_battery(self, message: BatteryState) -> None:
        fraction = charge(message.percentage)
        if fraction is not None:
            self._report("robot.battery", fraction)

    def _on_estop(self, message: Bool) -> None:
        self._report("robot.estop", bool(message.data))

    def _report(self, name: str, value: Any) -> None:
        if not self._closed:
            self._outlet.value(name, value, self._ros.now())
