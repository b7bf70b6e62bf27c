"""A base or a bridge as a process of its own, to be killed: `peer.py base|bridge [spare]`.

It tells on /wire/told what it does. Whoever says its name on /wire/hold lets it hold the next request: the
base drives and does not arrive, the bridge does not answer. A spare offers nothing until /wire/hold says
`spare`: it comes up in no time, however busy the machine is.
"""

from __future__ import annotations

import sys
from typing import Any

from nav2_msgs.action import NavigateToPose
from std_msgs.msg import String

from lupin_msgs.srv import GetTagReading
from lupin_ros.adapter.node import Qos, RosNode, ServedGoal

TOLD, HOLD = "/wire/told", "/wire/hold"
SPARE = "spare"


class Peer:
    """One of the two, on a node of its name."""

    def __init__(self, role: str, *, spare: bool) -> None:
        self.ros = RosNode(f"wire_{role}")
        self._role = role
        self._holds = False
        self._waits = spare
        self._told = self.ros.publisher(String, TOLD, Qos.BACKLOG)
        self.ros.subscribe(String, HOLD, Qos.EVENT, self._hear)
        if spare:
            self._tell("waits")
        else:
            self._serve()

    def _serve(self) -> None:
        if self._role == "base":
            self.ros.serve_action(
                NavigateToPose,
                "/navigate_to_pose",
                admit=lambda _: True,
                started=self._drive,
                cancelled=self._stop,
            )
        else:
            self.ros.serve(GetTagReading, "/greenhouse_bridge/get_tag_reading", self._read)
        self._tell("up")

    def _tell(self, what: str) -> None:
        self._told.publish(String(data=f"{self._role} {what}"))

    def _hear(self, word: String) -> None:
        if self._waits and word.data == SPARE:
            self._waits = False
            self._serve()
        elif not self._waits and word.data == self._role:
            self._holds = True
            self._tell("holds")

    def _held(self) -> bool:
        held, self._holds = self._holds, False
        return held

    def _drive(self, served: ServedGoal) -> None:
        self._tell("drives")
        if not self._held():
            served.succeed(NavigateToPose.Result())

    def _stop(self, served: ServedGoal) -> None:
        served.cancel(NavigateToPose.Result())

    def _read(self, request: Any, response: Any) -> Any:
        self._tell(f"reads {request.tag_id}")
        response.reading.tag_id = request.tag_id
        return None if self._held() else response


if __name__ == "__main__":
    Peer(sys.argv[1], spare=SPARE in sys.argv).ros.spin()
