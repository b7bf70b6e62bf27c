"""Draws the mission's targets for RViz: a MarkerArray with each target, its stand pose and its name.

Their colour tells the outcome. Every message has all of them, so that a late subscriber needs no other; the
first one of a mission deletes those of the mission before. Drawing waits for its own timer, and for nothing.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from std_msgs.msg import ColorRGBA, Header

from lupin_engine.errors import LupinError
from lupin_engine.plugin import Rating
from lupin_engine.runtime import Clock, TargetPlace, TargetPlaces
from lupin_ros.adapter.node import Qos, RosNode
from lupin_ros.interfaces.definitions import interface_class
from lupin_ros.orchestrator.loop import Loop
from lupin_ros.service.names import MARKERS_TOPIC, MARKERS_TYPE

#: The frame of places.
FRAME = "map"
#: Seconds between two looks at what has changed.
LOOK_S = 0.5
#: Of more targets the first ones are drawn. A stop waits 7 ms for a message with so many, and 30 ms for the
#: first one of a mission; with 29 targets 1 and 4 ms.
MOST_TARGETS = 250
#: Red, green and blue by the outcome of a target; of one without an outcome, and of the current one.
COLOURS = {Rating.GOOD: (0.2, 0.7, 0.3), Rating.BAD: (0.85, 0.2, 0.15), Rating.LEFT_OUT: (0.6, 0.6, 0.6)}
OPEN, CURRENT = (0.25, 0.5, 0.95), (1.0, 0.75, 0.0)
#: x, y, z and heading; and the size.
_At = tuple[float, float, float, float]
_Scale = tuple[float, float, float]
#: Namespaces of the markers; in each the ids are those of the targets.
TARGETS, STANDS, NAMES = "targets", "stands", "names"


class MarkerPublisher:
    """Publishes the markers of what runs in a loop, latched, whenever they change."""

    def __init__(self, ros: RosNode, clock: Clock, loop: Loop) -> None:
        self._clock = clock
        self._loop = loop
        self._places = TargetPlaces()
        #: What was published: of which mission, and the markers of each target.
        self._mission: str | None = None
        self._drawn: dict[TargetPlace, list[Any]] = {}
        self._numbers: dict[str, int] = {}
        try:
            self._array = interface_class(MARKERS_TYPE)
            self._marker = interface_class(MARKERS_TYPE.removesuffix("Array"))
        except LupinError as problem:  # an installation of ROS 2 with a part of the common interfaces
            ros.log.warning("targets are not drawn for RViz", problem=str(problem))
            return
        self._publisher = ros.publisher(self._array, MARKERS_TOPIC, Qos.LATCHED)
        ros.steady_timer(LOOK_S, self._look)

    def _look(self) -> None:
        machine = self._loop.machine
        places = self._places.look(machine, self._clock.now())[:MOST_TARGETS]
        mission, drawn = machine.memory.mission_id, self._drawn
        if mission == self._mission and places == list(drawn):
            return
        markers = [] if mission == self._mission else [self._marker(action=self._marker.DELETEALL)]
        self._mission = mission
        self._drawn = {place: drawn.get(place) or list(self._markers(place)) for place in places}
        markers += [marker for each in self._drawn.values() for marker in each]
        self._publisher.publish(self._array(markers=markers))

    def _markers(self, place: TargetPlace) -> Iterator[Any]:
        kind, x, y = self._marker, place.x, place.y
        yield self._made(place, TARGETS, kind.CYLINDER, (x, y, 0.15, 0.0), (0.2, 0.2, 0.3))
        if place.stand is not None:
            x_stand, y_stand, yaw = place.stand
            yield self._made(place, STANDS, kind.ARROW, (x_stand, y_stand, 0.05, yaw), (0.3, 0.06, 0.06))
        yield self._made(place, NAMES, kind.TEXT_VIEW_FACING, (x, y, 0.5, 0.0), (0.0, 0.0, 0.2))

    def _made(self, place: TargetPlace, ns: str, kind: int, at: _At, scale: _Scale) -> Any:
        (x, y, z, yaw), (red, green, blue) = at, self._colour(place)
        turn = Quaternion(z=math.sin(yaw / 2.0), w=math.cos(yaw / 2.0))
        return self._marker(
            header=Header(frame_id=FRAME),  # without a stamp: by the newest transform
            ns=ns,
            id=self._numbers.setdefault(place.id, len(self._numbers)),
            type=kind,
            pose=Pose(position=Point(x=x, y=y, z=z), orientation=turn),
            scale=Vector3(**dict(zip("xyz", scale, strict=True))),
            color=ColorRGBA(r=red, g=green, b=blue, a=1.0),
            text=place.id,
        )

    def _colour(self, place: TargetPlace) -> tuple[float, float, float]:
        outcome = self._loop.chart.profile.outcome(place.status)
        if place.is_current or outcome is None:
            return CURRENT if place.is_current else OPEN
        return COLOURS[outcome.rating]
