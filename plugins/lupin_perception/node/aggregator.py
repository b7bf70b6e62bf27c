"""The aggregator node: takes detectors' frames, publishes tags periodically and findings at once.

No callback blocks. Invalid input is dropped; each kind of fault is logged once.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence

import numpy as np
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from lupin_engine.errors import LupinError
from lupin_greenhouse import Array, is_under_way
from lupin_msgs.msg import DiscoveredTags, MissionState, Observation
from lupin_msgs.srv import ConfirmTag
from lupin_perception.anomalies import AnomalyWatch
from lupin_perception.boxes import PlanterBox, Size, box_from_tag, column_depth, column_fraction
from lupin_perception.detections import Detection, read_flowers, read_tags
from lupin_perception.flowers import ColumnBloom, TagScan, scanned_tag
from lupin_perception.memory import MissionFile, Past, memory_path
from lupin_perception.node import messages
from lupin_perception.node.layout import KnownBoxes
from lupin_perception.node.passive import PassiveObserver
from lupin_perception.node.settings import PARAMETERS, fusion_rules
from lupin_perception.registry import MAX_TAGS, Known, Registry
from lupin_perception.sightings import Sightings
from lupin_ros.adapter import Qos, RosNode, WarnOnce

__all__ = ["NAME", "PARAMETERS", "Aggregator", "main"]

NAME = "perception_aggregator"

#: Requests older than this, in seconds, are not answered: they waited out a broken link, nobody listens.
STALE_AFTER_S = 10.0
#: Seconds for which a node that has begun waits to hear of a mission, and one that remembers a mission of
#: anything at all: on a busy machine a new node is found late.
HEAR_S, RECALL_S = 2.0, 10.0
#: Without a mission the tag that flowers belong to changes when another one is nearer by so much (m): what is
#: measured of two tags at one distance changes from frame to frame.
NEARER_M = 0.1
#: Without a mission a scan has no end: detections older than so many seconds are dropped.
IDLE_MEMORY_S = 30.0
#: A box that has moved (m) or turned (rad) by more is published again with its flowers.
MOVED_M, TURNED = 0.05, 0.1


class Aggregator:
    """Fuses detections into tags on the map, flowers at tags, and pests at no tag."""

    def __init__(self, ros: RosNode) -> None:
        self._ros = ros
        self._values = values = ros.parameters()
        self._size = Size(values["box_width"], values["box_depth"])
        self._tags = Registry(values["min_sightings"], values["max_tag_distance_m"], values["freshness_s"])
        self._sightings = Sightings(
            self._tags, values["tf_frame_prefix"], values["tag_in_sight_s"], self._on_sighting
        )
        self._scan = TagScan(fusion_rules(values))
        #: When another tag was scanned, or none any more; and when the scan was last made to forget.
        self._aimed = self._aged = -math.inf
        #: The tag whose scan an earlier process was killed in.
        self._interrupted = ""
        self._watch = AnomalyWatch(
            values["anomaly_class_name"],
            values["yolo_min_confidence"],
            values["anomaly_frames"],
            values["anomaly_spacing_m"],
        )
        self._mission = MissionState()
        self._mission_heard = -math.inf
        self._memory = MissionFile(memory_path(values["memory_file"], os.environ, ros.namespace))
        self._past = self._recall()
        #: What was last written to the memory: revision of the tags, reports of pests, what is scanned.
        self._kept = 0, 0, ""
        self._begun = ros.elapsed()
        self._pan = 0.0
        self._since = ros.stamp()
        #: The box with which this scan's flowers were published; None before.
        self._published_box: PlanterBox | None = None
        self._has_published = False
        self._warn = WarnOnce(ros.log)
        self._connect()
        self._boxes = KnownBoxes(ros, values, self._tags, self._warn)
        if values["passive_climate"]:
            PassiveObserver(ros, values, self._tags, self._observations, self._is_idle)

    def _connect(self) -> None:
        ros, names = self._ros, self._values
        self._lists = ros.publisher(DiscoveredTags, names["discovered_tags_topic"], Qos.LATCHED)
        self._observations = ros.publisher(Observation, names["observations_topic"], Qos.BACKLOG)
        # Transforms first: those of a frame are then known before what was seen in it.
        ros.subscribe(TFMessage, "/tf_static", Qos.STATIC_TRANSFORMS, self._on_static_transforms)
        ros.subscribe(TFMessage, "/tf", Qos.TRANSFORMS, self._on_transforms)
        ros.subscribe(MissionState, names["mission_state_topic"], Qos.LATCHED, self._on_mission)
        ros.subscribe(JointState, names["joint_states_topic"], Qos.DETECTION, self._on_joints)
        ros.subscribe(String, names["tag_detections_topic"], Qos.DETECTION, self._on_tags)
        ros.subscribe(String, names["yolo_detections_topic"], Qos.DETECTION, self._on_flowers)
        ros.serve(
            ConfirmTag, names["confirm_service"], self._confirm, stale_after=STALE_AFTER_S, refuse=_refuse
        )
        # Real time: displays hear of the tags also while simulated time stands still.
        ros.steady_timer(1.0 / names["publish_rate_hz"], self._tick)

    # --- where things are ---------------------------------------------------------------------------------

    def _on_transforms(self, message: TFMessage) -> None:
        for problem in self._sightings.take(message.transforms, self._ros.elapsed()):
            self._warn(f"/tf: {problem}")

    def _on_static_transforms(self, message: TFMessage) -> None:
        for problem in self._sightings.take(message.transforms, self._ros.elapsed(), static=True):
            self._warn(f"/tf_static: {problem}")

    def _on_joints(self, message: JointState) -> None:
        for name, angle in zip(message.name, message.position, strict=False):
            if name == self._values["pan_joint_name"] and math.isfinite(angle):
                self._pan = float(angle)

    # --- the mission --------------------------------------------------------------------------------------

    def _on_mission(self, message: MissionState) -> None:
        self._mission, self._mission_heard = message, self._ros.elapsed()
        if self._tags.begin(message.mission_id):
            self._begin(message.mission_id)
        self._aim(self._focus())
        self._interrupted = ""  # the mission has gone on to something else

    def _begin(self, mission_id: str) -> None:
        """Forget the last mission, and restore the saved state of this one."""
        past, self._past = self._past, None
        if past is None or past.mission_id != mission_id:
            past = Past(mission_id)
        self._tags.restore(past.tags)
        self._watch.begin(past.reported)
        self._sightings.forget()
        self._interrupted = past.scanned
        self._boxes.refresh()
        self._aim("")
        self._since = self._ros.stamp()
        self._publish_tags()

    def _recall(self) -> Past | None:
        """Return what the memory file has; None where it cannot be read, which is logged."""
        try:
            return self._memory.read()
        except LupinError as error:
            self._ros.log.warning(str(error))
            return None

    def _keep(self) -> None:
        """Save the mission's state where it has changed."""
        scanned = self._scan.tag_id if self._has_published else ""
        state = self._tags.revision, len(self._watch.reported), scanned
        if self._tags.mission_id and state != self._kept:
            self._kept = state
            try:
                tags, reported = self._tags.discovered(), self._watch.reported
                past = Past(self._tags.mission_id, tags, reported, scanned)
                self._memory.write(past)
            except LupinError as error:
                self._warn(str(error))

    def _aim(self, tag_id: str) -> None:
        """Credit flowers to this tag from now on; another tag begins a new scan."""
        box, last = self._boxes.find(tag_id), self._scan.tag_id
        if self._scan.aim(tag_id, None if box is None else box.size.width):
            self._has_published, self._published_box = False, None
            self._aged = self._ros.elapsed()
            self._aimed = self._aimed if tag_id == last else self._aged
            self._resume()

    def _resume(self) -> None:
        """Continue the scan of a killed process: its published result stays valid."""
        known = self._tags.find(self._scan.tag_id)
        if known is not None and known.id == self._interrupted and known.summary is not None:
            self._scan.resume(known.summary)

    def _age(self) -> None:
        """Age an endless scan: false detections would add up over a night."""
        now = self._ros.elapsed()
        if self._is_idle() and now - self._aged >= IDLE_MEMORY_S:
            self._aged = now
            self._scan.age()

    def _is_under_way(self) -> bool:
        """Return whether a mission is active, by the last state if that is fresh."""
        heard = self._ros.elapsed() - self._mission_heard <= self._values["mission_freshness_s"]
        return heard and is_under_way(self._mission.lifecycle_state)

    def _is_idle(self) -> bool:
        """Return whether no mission is active, and one would have been heard of by now."""
        return not self._is_under_way() and not self._may_hear()

    def _may_hear(self) -> bool:
        """Return whether this node has just begun and may hear of a mission in a moment."""
        return math.isinf(self._mission_heard) and self._ros.elapsed() - self._begun <= HEAR_S

    def _mission_id(self) -> str:
        """Return the active mission's id for observations; '' outside of one."""
        return self._tags.mission_id if self._is_under_way() else ""

    def _focus(self) -> str:
        """Return the tag that flowers belong to, '' for none."""
        mission = self._mission
        if self._is_under_way():
            return scanned_tag(mission.lifecycle_state, mission.mission_phase, mission.current_target)
        return self._nearest() if self._values["attribute_when_idle"] and self._is_idle() else ""

    def _nearest(self) -> str:
        """Return the nearest discovered tag in sight, '' for none."""
        in_sight = self._sightings.in_sight(self._ros.elapsed())
        here = {tag: distance for tag, distance in in_sight.items() if self._tags.find(tag)}
        if not here:
            return ""
        nearest, so_far = min(here, key=lambda tag: (here[tag], tag)), self._scan.tag_id
        return so_far if so_far in here and here[so_far] <= here[nearest] + NEARER_M else nearest

    # --- tags ---------------------------------------------------------------------------------------------

    def _on_tags(self, message: String) -> None:
        seen, problems = read_tags(message.data)
        self._log_problems("tag_detections_topic", problems)
        warning = self._sightings.see(seen, self._ros.elapsed())
        if warning:
            self._ros.log.warning(warning)

    def _on_sighting(self, known: Known | None) -> None:
        """Handle a tag that was placed; None: the registry is full."""
        self._since = self._ros.stamp()
        if known is None:
            self._warn(f"more than {MAX_TAGS} tags; further ones left out")
        elif known.sightings == self._values["min_sightings"]:
            x, y = np.round(known.pose.position[:2], 3).tolist()
            self._ros.log.info("tag discovered", tag=known.id, x=x, y=y)
            # At once: a mission that has just come to this tag will say where it is.
            self._tick()
            if known.id == self._scan.tag_id:
                self._publish_flowers()  # seen already, and there may be no further frame

    def _tick(self) -> None:
        # A list without the restored tags would mean to the mission that its finds are gone.
        patience = RECALL_S if math.isinf(self._mission_heard) else HEAR_S
        if self._past is None or self._ros.elapsed() - self._begun > patience:
            self._keep()
            self._publish_tags()

    def _publish_tags(self) -> None:
        self._lists.publish(messages.discovered_tags(self._tags.discovered(), self._since))

    def _confirm(self, request: ConfirmTag.Request, response: ConfirmTag.Response) -> ConfirmTag.Response:
        found = self._tags.confirm(request.expected_tag_id, self._ros.elapsed())
        response.detected, response.detection_confidence = found.detected, found.confidence
        response.error_message = found.error
        response.tag_pose_in_map.orientation.w = 0.0
        if found.pose is not None:
            response.tag_pose_in_map = messages.pose_message(found.pose)
        return response

    # --- flowers and pests --------------------------------------------------------------------------------

    def _on_flowers(self, message: String) -> None:
        names, width = self._values["flower_class_names"], self._values["detection_image_width"]
        detections, problems = read_flowers(message.data, names, width)
        self._log_problems("yolo_detections_topic", problems)
        self._aim(self._focus())
        now = self._ros.elapsed()
        # A late frame was seen from an earlier position: it belongs to no scan and is no find.
        is_late = now - self._aimed < self._values["detection_delay_s"]
        if self._scan.tag_id and not is_late:
            self._age()
            self._scan.add(detections, self._pan)
            self._publish_flowers()
        if self._scan.tag_id or is_late or self._may_hear() or self._sightings.in_sight(now):
            self._watch.interrupt()
        else:
            self._look_for_pests(detections)

    def _publish_flowers(self) -> None:
        """Publish the flowers of the scanned tag, if it is discovered and they are news."""
        known, summary = self._tags.find(self._scan.tag_id), self._scan.summary()
        if known is None or summary is None:
            return
        box = self._boxes.find(known.id)
        if box is None:
            box = box_from_tag(known.pose, self._size, self._values["tag_lateral_offset"])
        published = known.summary if self._has_published else None
        if not summary.adds_to(published) and _is_alike(box, self._published_box):
            return
        self._has_published, self._published_box = True, box
        self._tags.classify(known.id, summary)
        self._since = self._ros.stamp()
        places = np.empty((0, 2)) if box is None else self._places(box, summary.blooms)
        self._observations.publish(
            messages.flower_observation(known, summary, box, places, self._mission_id(), self._since)
        )

    def _places(self, box: PlanterBox, blooms: Sequence[ColumnBloom]) -> Array:
        values, columns = self._values, [bloom.column for bloom in blooms]
        depths = column_depth(columns, values["flower_base_depth_frac"], values["flower_depth_jitter_frac"])
        return box.place(column_fraction(columns, values["lateral_columns"]), depths)

    def _look_for_pests(self, detections: Sequence[Detection]) -> None:
        robot = self._sightings.where(self._values["base_frame"], self._ros.elapsed())
        place = None if robot is None else robot.plane
        pest = self._watch.add(detections, place, self._ros.elapsed())
        if pest is not None and robot is not None:
            stamp = self._ros.stamp()
            self._observations.publish(messages.anomaly_observation(pest, robot, self._mission_id(), stamp))

    # --- what is wrong ------------------------------------------------------------------------------------

    def _log_problems(self, topic: str, problems: Sequence[str]) -> None:
        for problem in problems:
            self._warn(f"{self._values[topic]}: {problem}")


def _refuse(response: ConfirmTag.Response, reason: str) -> ConfirmTag.Response:
    response.error_message = reason
    response.tag_pose_in_map.orientation.w = 0.0
    return response


def _is_alike(box: PlanterBox | None, other: PlanterBox | None) -> bool:
    if box is None or other is None:
        return box is other
    return box.is_like(other, MOVED_M, TURNED)


def main(arguments: Sequence[str]) -> int:
    """Run the node until it is stopped; `arguments` are the ROS arguments."""
    with RosNode(NAME, arguments, PARAMETERS, managed=True) as ros:
        Aggregator(ros)
        ros.spin()
    return 0
