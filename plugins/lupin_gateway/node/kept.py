"""Saves state that outlives the gateway as JSON, atomically, on a thread; a slow disk gets the newest only.

Stops and notifications are saved so. A failed write is logged, and not retried before the next change.
"""

from __future__ import annotations

import json
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from lupin_engine.plugin import write_atomically
from lupin_ros.adapter import RosNode


class StateFile:
    """Data of JSON in a file; `what` names it in messages, such as `stops`."""

    def __init__(self, ros: RosNode, file: Path, what: str) -> None:
        self._ros = ros
        self.file = file
        self._what = what
        self._disk = ThreadPoolExecutor(1, what)
        self._lock = threading.Lock()  # held for an assignment, never while writing
        self._newest: Any = None

    def read(self) -> Any:
        """Return the saved data; None where there is no file.

        Raises:
            OSError, ValueError: it cannot be read.
        """
        try:
            return json.loads(self.file.read_text(encoding="utf-8"))
        except FileNotFoundError:
            return None

    def keep(self, data: Any) -> None:
        """Schedule a write; returns at once."""
        with self._lock:
            is_waiting, self._newest = self._newest is not None, data
        if not is_waiting:
            self._disk.submit(self._write)

    def _write(self) -> None:
        with self._lock:
            data, self._newest = self._newest, None
        if data is None:
            return
        try:
            write_atomically(self.file, json.dumps(data).encode())
        except OSError as problem:
            text = f"the {self._what} cannot be kept for a gateway that starts again: {problem}"
            self._ros.log.error(f"{self.file}: {text}")
