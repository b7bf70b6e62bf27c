"""The node `lupin_twin`: publishes `/twin/state` at 1 Hz, serves `/twin/get_field`, and stores every record.

A record is written to disk before it counts, so that a published state survives a crash. Where writing fails,
records wait in memory. Unusable messages are dropped and logged, each text at most once in 10 s.
"""

from __future__ import annotations

import array
import math
from collections.abc import Callable, Sequence
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Point32, Polygon, Pose, Quaternion
from nav_msgs.msg import OccupancyGrid
from std_msgs.msg import Header, String

from lupin_engine.plugin import COUNT, NUMBER, ROS_NAME, TEXT, Parameter, filled_in, number_in, time_fields
from lupin_msgs.msg import DiscoveredTags, FlowerPoint, Observation, SensorReading, TwinState, TwinTagState
from lupin_msgs.srv import GetField
from lupin_ros.adapter import Qos, RosNode
from lupin_twin import wire
from lupin_twin.field import DEFAULTS, InterpolationSettings, OccupancyMap
from lupin_twin.heatmap import FieldRequestRefused, Heatmap, Heatmaps, Request
from lupin_twin.place import store_path
from lupin_twin.records import Anomaly, Bloom, Pin, Record
from lupin_twin.state import HISTORY, MAX_SENSORS, MAX_TAGS, Twin, TwinTag
from lupin_twin.store import Store, StoreError

#: Requests older than this, in seconds, get no field: they waited out a broken link, nobody looks at it.
STALE_AFTER_S = 10.0

#: Seconds in which the same complaint is not repeated, and how many different ones are remembered.
COMPLAINT_PERIOD_S = 10.0
MAX_COMPLAINTS = 100

#: Seconds between two maps that are kept.
MAP_PERIOD_S = 30.0

PARAMETERS = {
    "observations_topic": Parameter(ROS_NAME, "/floranova/observations", "Observation: what was observed"),
    "state_topic": Parameter(ROS_NAME, "/twin/state", "TwinState: all that is known, published"),
    "field_service_name": Parameter(ROS_NAME, "/twin/get_field", "GetField: a sensor field over an area"),
    "discovered_tags_topic": Parameter(
        ROS_NAME, "/perception/discovered_tags", "DiscoveredTags: where tags are"
    ),
    "box_geometry_topic": Parameter(ROS_NAME, "/perception/box_geometry_json", "JSON: planter boxes at tags"),
    "map_topic": Parameter(ROS_NAME, "/map", "OccupancyGrid: fields are shown only where it is known"),
    "frame_id": Parameter(TEXT, "map", "frame of all poses; what comes in another one is dropped"),
    "state_publish_rate_hz": Parameter(
        NUMBER, 1.0, "how often the state is published, per second", minimum=0.1, maximum=100.0
    ),
    "buffer_len": Parameter(COUNT, HISTORY, "readings of each tag that are kept in memory", minimum=1),
    "idw_power": Parameter(
        NUMBER, DEFAULTS.power, "exponent p of the weights d^-p", minimum=0.1, maximum=10.0
    ),
    "idw_falloff_radius_m": Parameter(
        number_in("m"), DEFAULTS.falloff, "tags farther from a cell have no weight in it", minimum=0.0
    ),
    "max_distance_to_nearest_tag": Parameter(
        number_in("m"), DEFAULTS.max_distance, "cells farther from every tag have no value", minimum=0.0
    ),
    "store_file": Parameter(
        TEXT, "", "SQLite file of all records; empty: one in the user's state folder; :memory: keeps nothing"
    ),
}


class TwinNode:
    """Subscribes to observations, tags, boxes and the map; stores and folds their records."""

    def __init__(self, ros: RosNode) -> None:
        self._ros = ros
        values = ros.parameters()
        self._frame: str = values["frame_id"]
        self._twin = Twin(values["buffer_len"])
        reach = values["idw_falloff_radius_m"], values["max_distance_to_nearest_tag"]
        self._heatmaps = Heatmaps(self._twin, InterpolationSettings(values["idw_power"], *reach))
        self._message = TwinState(header=Header(frame_id=self._frame))
        self._published_revision = 0
        self._complaints: dict[str, float] = {}
        self._store = Store(store_path(values["store_file"], robot=ros.namespace))
        self._store_fails = False
        self._new_map: OccupancyMap | None = None
        self._map_kept = -math.inf
        self._remember()
        self._connect(values)

    def _remember(self) -> None:
        """Load the records of earlier runs."""
        for record, received in self._store.rows():
            self._twin.advance_time(received)
            self._twin.apply(record, received)
        if not self._ros.node.get_clock().ros_time_is_active:
            # Simulations begin anew; a computer that does not know the time yet will learn it.
            self._twin.forget_time()
        occupancy = self._store.map()
        if occupancy is not None:
            self._heatmaps.explore(occupancy)
        if self._store.put_aside:
            self._ros.log.error(self._store.put_aside)
        for problem in self._store.unreadable:
            self._ros.log.error(problem)
        known, count = len(self._twin.tags), self._twin.observation_count
        self._ros.log.info("twin ready", tags=known, observations=count, store=self._store.path)

    def _connect(self, values: dict[str, Any]) -> None:
        ros = self._ros
        self._states = ros.publisher(TwinState, values["state_topic"], Qos.LATCHED)
        listen = (
            (Observation, "observations_topic", Qos.BACKLOG, self._on_observation),
            (DiscoveredTags, "discovered_tags_topic", Qos.LATCHED, self._on_discovered),
            (String, "box_geometry_topic", Qos.EVENT, self._on_boxes),
            (OccupancyGrid, "map_topic", Qos.LATCHED, self._on_map),
        )
        for kind, topic, qos, callback in listen:
            ros.subscribe(kind, values[topic], qos, self._complaining(callback))
        field = values["field_service_name"]
        ros.serve(GetField, field, self._get_field, stale_after=STALE_AFTER_S, refuse=_refuse)
        # Real time: displays hear of the tags also while simulated time stands still.
        ros.steady_timer(1.0 / values["state_publish_rate_hz"], self._tick)
        ros.on_stop(self.close)
        self._publish()

    # --- messages to the twin -------------------------------------------------------------------------

    def _on_observation(self, message: Observation) -> None:
        record = wire.observed(message, self._frame, self._ros.now())
        if record is not None:
            self._take(record)

    def _on_discovered(self, message: DiscoveredTags) -> None:
        for record in wire.discoveries(message, self._frame):
            self._take(record)

    def _on_boxes(self, message: String) -> None:
        for record in wire.boxes(message.data):
            self._take(record)

    def _on_map(self, message: OccupancyGrid) -> None:
        self._new_map = wire.occupancy(message, self._frame)
        self._heatmaps.explore(self._new_map)

    def _take(self, record: Record) -> None:
        """Store a record, then apply it: a published state is still known after a crash."""
        received = self._ros.now()
        if not self._twin.has_room(record):
            self._complain(f"no room for more than {MAX_TAGS} tags, {MAX_SENSORS} sensors: new ones dropped")
            return
        if not self._twin.is_news(record) or not self._keep(lambda: self._store.add(record, received)):
            return
        self._twin.advance_time(received)
        self._twin.apply(record, received)
        if isinstance(record, Anomaly):
            self._warn_of_anomaly(record)

    def _warn_of_anomaly(self, anomaly: Anomaly) -> None:
        self._ros.log.warning(
            f"anomaly: {anomaly.description}",
            severity=anomaly.severity,
            x=round(anomaly.x, 3),
            y=round(anomaly.y, 3),
            near_tag=self._twin.nearest(anomaly.x, anomaly.y),
            mission=anomaly.mission_id,
        )

    def _keep(self, write: Callable[[], bool]) -> bool:
        """Write to the store; return True also on failure: the record counts in memory."""
        try:
            new = write()
        except StoreError as problem:
            if not self._store_fails:
                self._ros.log.error(f"records cannot be kept: {problem}")
            self._store_fails = True
            return True
        if self._store_fails:
            self._store_fails = False
            self._ros.log.info("records are kept again, those that waited too", store=self._store.path)
        return new

    def _complaining(self, callback: Callable[[Any], None]) -> Callable[[Any], None]:
        """Return `callback` with dropped messages logged, each text at a limited rate."""

        def listen(message: Any) -> None:
            try:
                callback(message)
            except wire.Dropped as dropped:
                self._complain(str(dropped))

        return listen

    def _complain(self, text: str) -> None:
        now = self._ros.elapsed()
        if now - self._complaints.get(text, -math.inf) >= COMPLAINT_PERIOD_S:
            if len(self._complaints) >= MAX_COMPLAINTS:
                self._complaints.clear()
            self._complaints[text] = now
            self._ros.log.warning(text)

    # --- messages of the twin ------------------------------------------------------------------------------

    def _tick(self) -> None:
        if self._store.waiting:
            self._keep(self._store.flush)
        if self._ros.elapsed() - self._map_kept >= MAP_PERIOD_S:
            self._keep_map()
        self._publish()

    def _keep_map(self) -> None:
        """Store the latest map; maps come often and may be large, so at most one in `MAP_PERIOD_S`."""
        occupancy = self._new_map
        if occupancy is None:
            return
        self._map_kept = self._ros.elapsed()
        self._keep(lambda: self._store.keep_map(occupancy))
        if not self._store_fails:
            self._new_map = None

    def _publish(self) -> None:
        now = self._ros.now()
        self._twin.advance_time(now)
        if self._published_revision != self._twin.revision:  # most seconds bring nothing new but age
            self._published_revision = self._twin.revision
            self._message.tags = [_tag_message(tag) for tag in self._twin.tags.values()]
        for tag, message in zip(self._twin.tags.values(), self._message.tags, strict=True):
            message.stale_seconds = tag.stale_seconds(now)
        self._message.header.stamp = self._ros.stamp()
        self._states.publish(self._message)

    def _get_field(self, request: GetField.Request, response: GetField.Response) -> GetField.Response:
        bounds = request.bbox_min_x, request.bbox_min_y, request.bbox_max_x, request.bbox_max_y
        try:
            heatmap = self._heatmaps.answer(Request(request.sensor_type, request.resolution, *bounds))
        except FieldRequestRefused as reason:
            response.error_message = str(reason)
        else:
            fill(response, heatmap)
        return response

    def close(self) -> None:
        """Write waiting records, if possible, and close the store."""
        if self._store.waiting:
            self._keep(self._store.flush)
        self._keep_map()
        self._store.close()


def _refuse(response: GetField.Response, reason: str) -> GetField.Response:
    response.error_message = reason
    return response


def fill(response: GetField.Response, heatmap: Heatmap) -> None:
    """Write a field into the response, with a copy of its values."""
    values = array.array("f")
    values.frombytes(heatmap.values)
    response.ok = True
    response.values = values
    response.width, response.height = heatmap.grid.width, heatmap.grid.height
    response.origin_x, response.origin_y = heatmap.grid.min_x, heatmap.grid.min_y
    response.resolution_used = heatmap.grid.resolution
    response.value_min, response.value_max = heatmap.minimum, heatmap.maximum
    response.sample_count = heatmap.sample_count


def _tag_message(tag: TwinTag) -> TwinTagState:
    """Return a tag's message without its age."""
    return TwinTagState(
        tag_id=tag.tag_id,
        pose=_pose_message(tag.pin),
        readings=[SensorReading(name=name, value=value) for name, value in tag.readings.items()],
        last_observed=Time(**time_fields(tag.last_observed or 0.0)),
        species=tag.species,
        species_confidence=tag.confidence,
        anomaly=tag.anomaly,
        flowers=[_bloom_message(bloom) for bloom in tag.blooms],
        box_footprint=Polygon(points=[Point32(x=x, y=y, z=0.0) for x, y in tag.footprint]),
    )


def _pose_message(pin: Pin | None) -> Pose:
    """Return a pose; without a known one the orientation's w is 0, and only then."""
    if pin is None:
        return Pose(orientation=Quaternion(x=0.0, y=0.0, z=0.0, w=0.0))
    turn = Quaternion(x=0.0, y=0.0, z=pin.z, w=filled_in(pin.w))
    return Pose(position=Point(x=pin.x, y=pin.y, z=0.0), orientation=turn)


def _bloom_message(bloom: Bloom) -> FlowerPoint:
    return FlowerPoint(
        position=Point(x=bloom.x, y=bloom.y, z=bloom.z),
        species=bloom.species,
        confidence=bloom.confidence,
        anomaly=bloom.anomaly,
    )


def main(arguments: Sequence[str]) -> int:
    """Run the node until it is stopped; `arguments` are the ROS arguments."""
    with RosNode("lupin_twin", arguments, PARAMETERS, managed=True) as ros:
        TwinNode(ros)
        ros.spin()
    return 0
