"""The robot of the warehouse, as a program that knows nothing of the engine's missions."""

from __future__ import annotations

import sys
from collections.abc import Iterable

from control_msgs.action import GripperCommand
from nav2_msgs.action import NavigateToPose

from lupin_ros.adapter.node import RosNode, ServedGoal

#: The first drive to this shelf takes until somebody stops it.
FAR = "Z9"
STEP_S = 0.05


class Picker:
    """Drives to any frame, and grips what lies there: a parcel, but on the shelves that are `empty`."""

    def __init__(self, ros: RosNode, empty: Iterable[str]) -> None:
        self._ros = ros
        self._empty = frozenset(empty)
        self._at = ""
        self._stopped = 0
        for kind, name, work in (
            (NavigateToPose, "/picker/drive", self._drive),
            (GripperCommand, "/picker/grip", self._grip),
        ):
            ros.serve_action(kind, name, admit=lambda _: True, started=work, cancelled=self._stop)

    def _drive(self, served: ServedGoal) -> None:
        place = served.request.pose.header.frame_id
        if place == FAR and not self._stopped:
            return

        def arrive() -> None:
            self._at = place
            served.succeed(NavigateToPose.Result())

        self._ros.call_later(STEP_S, arrive)

    def _grip(self, served: ServedGoal) -> None:
        held = self._at not in self._empty
        result = GripperCommand.Result(
            position=0.12 if held else 0.0, effort=8.0, stalled=held, reached_goal=not held
        )
        self._ros.call_later(STEP_S, lambda: served.succeed(result))

    def _stop(self, served: ServedGoal) -> None:
        self._stopped += 1
        served.cancel(NavigateToPose.Result())


if __name__ == "__main__":
    ros = RosNode("picker")
    Picker(ros, sys.argv[1:])
    ros.spin()
