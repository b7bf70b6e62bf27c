"""The planter boxes: derived from the layout and published once a second, or received from another node.

Never both: a topic has one source.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

from std_msgs.msg import String

from lupin_greenhouse import layout
from lupin_perception.boxes import PlanterBox
from lupin_perception.detections import read_boxes
from lupin_perception.layout import Quality, entries, register
from lupin_perception.registry import Registry
from lupin_ros.adapter import Qos, RosNode

#: Seconds between two messages about the boxes: consumers in browsers need them again and again.
PUBLISH_S = 1.0


class KnownBoxes:
    """The box of each tag that was found where the layout has it."""

    def __init__(
        self, ros: RosNode, values: Mapping[str, Any], tags: Registry, warn: Callable[[str], None]
    ) -> None:
        """`warn` logs a text, each only once.

        Raises:
            LupinError: the layout cannot be used.
        """
        self._tags, self._warn = tags, warn
        self._boxes: Mapping[str, PlanterBox] = {}
        self._topic: str = values["box_geometry_topic"]
        self._layout: layout.Layout | None = None
        if not values["register_layout"]:
            ros.subscribe(String, self._topic, Qos.DETECTION, self._take)
            return
        self._layout = layout.load(values["tag_locations_file"])
        self._quality = Quality(values["layout_max_error_m"], values["layout_min_spread_m"])
        self._height: float = values["box_height"]
        self._registered = tags.revision
        self._text = ""
        self._publisher = ros.publisher(String, self._topic, Qos.LATCHED)
        ros.steady_timer(PUBLISH_S, self._publish)

    def find(self, tag_id: str) -> PlanterBox | None:
        """Return the box at a tag; None when the layout knows none."""
        return self._boxes.get(tag_id)

    def refresh(self) -> None:
        """Register the layout again if tags have changed; does nothing where boxes are received."""
        if self._layout is not None and self._registered != self._tags.revision:
            self._registered = self._tags.revision
            self._register(self._layout)

    def _publish(self) -> None:
        self.refresh()
        if self._text:
            self._publisher.publish(String(data=self._text))

    def _register(self, known_layout: layout.Layout) -> None:
        found = {known.id: known.pose for known in self._tags.discovered()}
        result = register(known_layout, found, self._quality)
        self._boxes = result.boxes
        self._text = json.dumps(entries(result.boxes, self._height)) if result.boxes else ""
        if result.reason and len(found) > 1:  # of a single tag nothing else could be expected
            self._warn(f"no boxes from the layout: {result.reason}")
        for tag_id in result.misplaced:
            self._warn(f"tag {tag_id} is not where the layout has it: it has no box from there")

    def _take(self, message: String) -> None:
        boxes, problems = read_boxes(message.data)
        for problem in problems:
            self._warn(f"{self._topic}: {problem}")
        if boxes or not problems:
            self._boxes = boxes
