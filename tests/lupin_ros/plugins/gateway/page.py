"""A page of somebody else: real roslib in Node.js, and what it saw."""

from __future__ import annotations

import itertools
import json
import os
import subprocess
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from lupin_ros.adapter.node import RosNode

PROGRAM = Path(__file__).with_name("page.mjs")
#: Seconds that anything may take on a busy machine.
PATIENCE = 30.0


class Page:
    """Sends what a page sends, and keeps what it gets; to be closed."""

    def __init__(self, folder: Path, version: str, url: str, nodes: Sequence[RosNode] = ()) -> None:
        """`folder` has the packages; `nodes` work while the page is waited for."""
        self.nodes = nodes
        self._numbers = itertools.count(1)
        self.events: list[dict[str, Any]] = []
        self._process = subprocess.Popen(
            ["node", str(folder / PROGRAM.name), version, url],
            cwd=folder,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "NODE_NO_WARNINGS": "1"},
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self.events.append(json.loads(line))

    def close(self) -> None:
        """Let the page go, as when its tab is closed."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.wait(PATIENCE)
        self._reader.join(PATIENCE)
        self._process.stdout.close()

    def until(self, condition: Callable[[], Any], what: str, timeout: float = PATIENCE) -> Any:
        """Wait until `condition` holds, and return what it says."""
        end = time.monotonic() + timeout
        while not (found := condition()):
            assert time.monotonic() < end, f"{what}: not within {timeout:g} s; seen: {self.events[-5:]}"
            for node in self.nodes:
                node.spin_once(0.005)
            if not self.nodes:
                self._reader.join(0.005)
        return found

    def connected(self) -> Page:
        """Wait for the connection."""
        self.until(lambda: self.of("connection"), "connected")
        return self

    def of(self, event: str, **fields: Any) -> list[dict[str, Any]]:
        """Return the events of a kind with such fields."""
        return [
            each
            for each in list(self.events)
            if each["event"] == event and all(each.get(name) == value for name, value in fields.items())
        ]

    def messages(self, topic: str) -> list[Any]:
        """Return what came on a topic."""
        return [each["msg"] for each in self.of("message", topic=topic)]

    def status(self) -> list[str]:
        """Return the texts of all status frames."""
        return [each["msg"] for each in self.of("status")]

    def do(self, what: str, **fields: Any) -> None:
        """Let the page do something."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps({"do": what, **fields}) + "\n")
        self._process.stdin.flush()

    def subscribe(self, topic: str, type_: str, **options: Any) -> None:
        """Subscribe with options of roslib."""
        self.do("subscribe", name=topic, type=type_, options=options)

    def publish(self, topic: str, type_: str, message: Any, **options: Any) -> None:
        """Publish, and advertise before the first time."""
        self.do("publish", name=topic, type=type_, msg=message, options=options)

    def begin(self, what: str, name: str, type_: str | None, arguments: Any, **more: Any) -> int:
        """Begin a `call` or `goal`; return its number."""
        number = next(self._numbers)
        self.do(what, n=number, name=name, type=type_, args=arguments, **more)
        return number

    def answer(self, number: int, timeout: float = PATIENCE) -> dict[str, Any]:
        """Wait for the answer of a call or the result of a goal: `ok`, `value`."""
        found = self.until(lambda: self.of("answer", n=number), f"answer {number}", timeout)
        return dict(found[0])

    def call(self, name: str, type_: str | None, arguments: Any, timeout: float = PATIENCE) -> Any:
        """Call a service; return what it answered, or the text of the failure."""
        answer = self.answer(self.begin("call", name, type_, arguments), timeout)
        return answer["value"] if answer["ok"] else f"failed: {answer['value']}"

    def raw(self, frame: str | dict[str, Any]) -> None:
        """Send a frame as it is."""
        self.do("raw", frame=frame if isinstance(frame, str) else json.dumps(frame))

    def told(self, text: str) -> None:
        """Wait for a status frame with exactly this text."""
        self.until(lambda: text in self.status(), text)
