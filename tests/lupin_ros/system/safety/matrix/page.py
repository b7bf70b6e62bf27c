"""A page as its frames: what a browser with roslib sends, and what it is told."""

from __future__ import annotations

import itertools
import json
import threading
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from typing import Any

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

STOP_TOPIC, STOPS_TOPIC = "/lupin/hmi/estop", "/lupin/hmi/stops"


class Page:
    """One connection; a thread keeps what comes."""

    def __init__(self, port: int) -> None:
        self._open = ExitStack()
        link = connect(f"ws://127.0.0.1:{port}/_ros", open_timeout=5.0, close_timeout=1.0)
        self._link = self._open.enter_context(link)
        self._numbers = itertools.count(1)
        #: The last message of each topic, answers by id, and the texts of status frames.
        self.told: dict[str, Any] = {}
        self.answers: dict[str, Mapping[str, Any]] = {}
        self.statuses: list[str] = []
        self.is_closed = False
        threading.Thread(target=self._read, daemon=True).start()
        self.send(op="subscribe", topic=STOPS_TOPIC, type="std_msgs/String")
        self.send(op="subscribe", topic="/mission/state", type="lupin_msgs/MissionState")
        self.send(op="advertise", topic=STOP_TOPIC, type="std_msgs/Bool")
        self.send(op="advertise", topic="/goal_pose", type="geometry_msgs/PoseStamped")
        self.send(op="advertise", topic="/cmd_vel", type="geometry_msgs/Twist")

    def _read(self) -> None:
        with suppress(ConnectionClosed, OSError):
            for frame in self._link:
                told = json.loads(frame)
                if told["op"] == "publish":
                    self.told[told["topic"]] = told["msg"]
                elif told["op"] in ("service_response", "action_result"):
                    self.answers[told["id"]] = told
                elif told["op"] == "status":
                    self.statuses.append(told["msg"])
        self.is_closed = True

    def send(self, **frame: Any) -> None:
        """Send a frame; one to a gateway that is gone is lost."""
        with suppress(ConnectionClosed, OSError):
            self._link.send(json.dumps(frame))

    def publish(self, topic: str, message: Mapping[str, Any]) -> None:
        """Publish."""
        self.send(op="publish", topic=topic, msg=message)

    def stop(self, engaged: bool) -> None:
        """Tell the page's own stop."""
        self.publish(STOP_TOPIC, {"data": engaged})

    def begin(self, op: str, **fields: Any) -> str:
        """Call a service or send a goal; return the id of its answer."""
        number = f"{op}:{next(self._numbers)}"
        self.send(op=op, id=number, **fields)
        return number

    def stops(self) -> Mapping[str, Any]:
        """Return what the page shows of stops."""
        return dict(json.loads(self.told.get(STOPS_TOPIC, {}).get("data", "{}")))

    def close(self) -> None:
        """Leave, as a tab that is closed."""
        self._open.close()
