"""The operation `choose_frontier`: waits for a map with a frontier; its progress text is the missing input.

Knows no ROS: the client passes messages in, reports go out through the outlet. It never fails by itself;
the mission's timeout ends it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from lupin_engine.plugin import Outlet
from lupin_greenhouse import Frames, heading
from lupin_nav.frontier import Frontier, OccupancyGrid, Point, Survey, Thresholds, make_grid, survey

#: The position of the robot; None while it is unknown.
Whereabouts = Callable[[], Point | None]

#: Seconds after which the last transforms say nothing any more about where the robot is.
SILENCE_S = 3.0


@dataclass
class _Waiting:
    """One attempt: the places to avoid, and its last progress text."""

    avoid: Sequence[Point]
    reported: str = ""


class Explorer:
    """The waiting attempts, and their inputs: the last map and the transforms."""

    def __init__(
        self,
        outlet: Outlet,
        parameters: Mapping[str, Any],
        localizer: Whereabouts,
        clock: Callable[[], float],
    ) -> None:
        """`localizer` gives the position where no transform leads to the robot; `clock` is in seconds."""
        self._clock = clock
        self._outlet = outlet
        self._parameters = parameters
        self._localizer = localizer
        self._thresholds = thresholds_of(parameters)
        self._frames = Frames()
        self._grid: OccupancyGrid | None = None
        self._map_came = False
        self._waiting: dict[str, _Waiting] = {}

    @property
    def idle(self) -> bool:
        """Whether no attempt waits."""
        return not self._waiting

    def start(self, attempt: str, avoid: Sequence[Point] = ()) -> None:
        """Wait for a frontier that is not near `avoid`; ends at once where there is one."""
        self._waiting[attempt] = _Waiting(avoid)
        self._outlet.accepted(attempt)
        self.look()

    def cancel(self, attempt: str) -> None:
        """Stop waiting; unknown attempts are ignored."""
        if self._waiting.pop(attempt, None) is not None:
            self._outlet.cancelled(attempt)

    def close(self) -> None:
        """Stop waiting; report nothing more."""
        self._waiting.clear()

    def take_transforms(self, message: Any, static: bool = False) -> None:
        """Process a TFMessage; unusable transforms are left out."""
        self._frames.take(message.transforms, static=static, heard=self._clock())

    def take_map(self, message: Any) -> None:
        """Take an OccupancyGrid in frame `map`, and end the attempts that find a frontier."""
        info = message.info
        origin = info.origin.position.x, info.origin.position.y, heading(info.origin.orientation)
        self._grid = make_grid(message.data, info.width, info.height, info.resolution, origin)
        self._map_came = True
        self.look()

    def look(self) -> None:
        """End each attempt that finds a frontier; report when the others' missing input changes."""
        if self.idle:
            return
        since = self._clock() - SILENCE_S
        pose = self._frames.find(self._parameters["frame_id"], self._parameters["base_frame"], since)
        robot = self._localizer() if pose is None else pose.plane
        for attempt, waiting in list(self._waiting.items()):
            missing, found = self._search(robot, waiting.avoid)
            if found is not None and robot is not None:
                del self._waiting[attempt]
                yaw = math.atan2(found.y - robot[1], found.x - robot[0])
                self._outlet.done(attempt, {"pose": {"x": found.x, "y": found.y, "yaw": yaw}})
            elif missing != waiting.reported:
                waiting.reported = missing
                self._outlet.progress(attempt, missing)

    def _search(self, robot: Point | None, avoid: Sequence[Point]) -> tuple[str, Frontier | None]:
        """Return why there is no frontier to drive to, and None; else '' and the frontier."""
        topic = self._parameters["map_topic"]
        if not self._map_came:
            return f"no {topic} received", None
        if robot is None:
            frames = f"{self._parameters['frame_id']} to {self._parameters['base_frame']}"
            return f"no pose: no transform from {frames}, no {self._parameters['amcl_pose_topic']}", None
        if self._grid is None:
            return f"{topic} has no cells", None
        result = survey(self._grid, robot, self._thresholds, avoid)
        return nothing_found(result), result.frontier


def thresholds_of(parameters: Mapping[str, Any]) -> Thresholds:
    """Return the frontier thresholds of the parameters."""
    return Thresholds(
        free=parameters["frontier_free_thresh"],
        occupied=parameters["frontier_occupied_thresh"],
        min_cells=parameters["frontier_min_cluster_cells"],
        clearance=parameters["frontier_robot_clearance_m"],
        radius_cells=parameters["frontier_robot_radius_cells"],
        clearance_occupied=parameters["frontier_clearance_occupied_thresh"],
        avoid_distance=parameters["frontier_avoid_distance_m"],
    )


def nothing_found(result: Survey) -> str:
    """Describe a grid without a frontier, by the counts of its cells."""
    text = f"no frontier in a map of {result.known} known cells"
    text += f" ({result.small} clusters too small, {result.cramped} cells without clearance"
    text += f", {result.avoided} avoided" if result.avoided else ""
    # Neither driven to nor kept from: where the thresholds do not suit the map, it may have no other cells.
    text += f", {result.undecided} neither free nor solid" if result.undecided else ""
    return f"{text})"
