"""The operation `choose_frontier`: waits for a map with a frontier, and says meanwhile what is missing.

Knows no ROS: messages come in as they are, reports go out through the outlet. The client feeds it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from lupin_engine.plugin.contract import Outlet
from lupin_engine.world.frames import Frames
from lupin_engine.world.poses import heading
from lupin_nav.frontier import Frontier, Grid, Survey, Thresholds, make_grid, survey

#: A place on the floor in metres, frame `map`.
Point = tuple[float, float]
#: Where the robot is, or None while nobody knows.
Whereabouts = Callable[[], Point | None]


class Explorer:
    """The attempts that wait for a frontier, and what they know: the last map and the transforms."""

    def __init__(self, outlet: Outlet, parameters: Mapping[str, Any], localizer: Whereabouts) -> None:
        """`localizer` is asked where no transform leads from the robot to the map."""
        self._outlet = outlet
        self._parameters = parameters
        self._localizer = localizer
        self._thresholds = thresholds_of(parameters)
        self._frames = Frames()
        self._grid: Grid | None = None
        self._map_came = False
        self._told: dict[str, str] = {}

    @property
    def idle(self) -> bool:
        """Whether nobody waits."""
        return not self._told

    def start(self, attempt: str) -> None:
        """Begin to wait; ends at once where the map has a frontier already."""
        self._told[attempt] = ""
        self._outlet.accepted(attempt)
        self.look()

    def cancel(self, attempt: str) -> None:
        """Stop waiting; unknown attempts are ignored."""
        if self._told.pop(attempt, None) is not None:
            self._outlet.cancelled(attempt)

    def close(self) -> None:
        """Stop waiting and report nothing."""
        self._told.clear()

    def take_transforms(self, message: Any, static: bool = False) -> None:
        """Take in a TFMessage; what is none of a place is left out."""
        self._frames.take(message.transforms, static=static)

    def take_map(self, message: Any) -> None:
        """Take in an OccupancyGrid in the frame of the map, and look whether it has what is waited for."""
        info = message.info
        origin = info.origin.position.x, info.origin.position.y, heading(info.origin.orientation)
        self._grid = make_grid(message.data, info.width, info.height, info.resolution, origin)
        self._map_came = True
        self.look()

    def look(self) -> None:
        """End the attempts that wait, or tell them what is missing if that is something new."""
        if self.idle:
            return
        pose = self._frames.find(self._parameters["frame_id"], self._parameters["base_frame"])
        robot = self._localizer() if pose is None else pose.plane
        missing, found = self._search(robot)
        if found is None or robot is None:
            self._tell(missing)
            return
        attempts, self._told = list(self._told), {}
        yaw = math.atan2(found.y - robot[1], found.x - robot[0])
        for attempt in attempts:
            self._outlet.done(attempt, {"pose": {"x": found.x, "y": found.y, "yaw": yaw}})

    def _search(self, robot: Point | None) -> tuple[str, Frontier | None]:
        """Return what is missing, or the frontier to drive to."""
        topic = self._parameters["map_topic"]
        if not self._map_came:
            return f"no {topic} received", None
        if robot is None:
            frames = f"{self._parameters['frame_id']} to {self._parameters['base_frame']}"
            return f"no pose: no transform from {frames}, no {self._parameters['amcl_pose_topic']}", None
        if self._grid is None:
            return f"{topic} has no cells", None
        result = survey(self._grid, robot, self._thresholds)
        return nothing_found(result), result.frontier

    def _tell(self, missing: str) -> None:
        for attempt, told in self._told.items():
            if told != missing:
                self._told[attempt] = missing
                self._outlet.progress(attempt, missing)


def thresholds_of(parameters: Mapping[str, Any]) -> Thresholds:
    """Return what the parameters say about frontiers."""
    return Thresholds(
        free=parameters["frontier_free_thresh"],
        occupied=parameters["frontier_occupied_thresh"],
        min_cells=parameters["frontier_min_cluster_cells"],
        clearance=parameters["frontier_robot_clearance_m"],
        radius_cells=parameters["frontier_robot_radius_cells"],
        clearance_occupied=parameters["frontier_clearance_occupied_thresh"],
    )


def nothing_found(result: Survey) -> str:
    """Say what a grid without a frontier has instead."""
    text = f"no frontier in a map of {result.known} known cells"
    text += f" ({result.small} clusters too small, {result.cramped} cells without clearance"
    # Neither driven to nor avoided: where the thresholds do not suit the map, it may have no other cells.
    text += f", {result.undecided} neither free nor solid)" if result.undecided else ")"
    return text
