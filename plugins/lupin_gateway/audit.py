"""The audit log: one JSON line for each command, written by a thread of its own.

Whoever writes a line waits for nothing: lines that the disk does not take in time are counted, and the count
is written as soon as it takes them again.
"""

from __future__ import annotations

import json
import logging
import os
import queue
from collections.abc import Mapping
from datetime import datetime, timezone
from logging.handlers import QueueListener, RotatingFileHandler
from pathlib import Path
from typing import Any

import orjson

#: Size of a file in bytes, and how many older ones are kept.
FILE_BYTES, OLDER_FILES = 10_000_000, 5
#: How many lines may wait for the disk.
WAITING = 10_000
#: How many letters of arguments and answers a line has at most.
LONGEST = 2_000
#: The same message sooner than this after the last one is that one repeated, in seconds.
STEADY_S = 1.0
#: Topics of which a page's last message is remembered.
MOST_TOPICS = 256


class _PrivateFile(RotatingFileHandler):
    """A rotating file that only its owner can read."""

    def _open(self) -> Any:
        descriptor = os.open(self.baseFilename, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
        return os.fdopen(descriptor, self.mode, encoding=self.encoding)


class AuditLog:
    """The log in one file; to be closed, which writes what still waits."""

    def __init__(self, file: Path) -> None:
        """Open the file, of which older ones are `FILE.1` and so on.

        Raises:
            OSError: it cannot be written.
        """
        file.parent.mkdir(parents=True, exist_ok=True)
        self._lost = 0
        self._waiting: queue.Queue[Any] = queue.Queue(WAITING)
        self._handler = _PrivateFile(file, maxBytes=FILE_BYTES, backupCount=OLDER_FILES, encoding="utf-8")
        self._writer = QueueListener(self._waiting, self._handler)
        self._writer.start()

    def write(self, line: Mapping[str, Any]) -> None:
        """Write a line; returns at once."""
        if self._lost and self._put({"wall": line.get("wall", ""), "what": "lost", "lines": self._lost}):
            self._lost = 0
        if not self._put(line):
            self._lost += 1

    def _put(self, line: Mapping[str, Any]) -> bool:
        text = json.dumps(line, ensure_ascii=False, default=str)
        record = logging.LogRecord("audit", logging.INFO, "", 0, text, None, None)
        try:
            self._waiting.put_nowait(record)
        except queue.Full:
            return False
        return True

    def close(self) -> None:
        """Write what waits, and close the file."""
        self._writer.stop()
        self._handler.close()


def command_line(
    wall: float,
    who: Mapping[str, str],
    what: str,
    name: str,
    sent: Any,
    answer: Mapping[str, Any] | str | None,
) -> dict[str, Any]:
    """Return the line of a command.

    Args:
        wall: UNIX time in seconds.
        who: `who`, `role`, `from` and `page` of the connection.
        what: the operation, such as `call_service`.
        name: the service, topic or action.
        sent: the arguments or the message.
        answer: the response's fields; a text: why it was not carried out; None: there is none (published).
    """
    moment = datetime.fromtimestamp(wall, timezone.utc).isoformat(timespec="milliseconds")
    line: dict[str, Any] = {"wall": moment, **who, "what": what, "name": name, "sent": _bounded(sent)}
    if isinstance(answer, str):
        return {**line, "accepted": False, "answer": answer[:LONGEST]}
    if answer is None:
        return line
    accepted = next((answer[key] for key in ("accepted", "success", "ok") if key in answer), None)
    text = next((answer[key] for key in ("message", "reason", "error_message") if answer.get(key)), "")
    line |= {"accepted": accepted, "answer": str(text)[:LONGEST]}
    return {**line, **{key: answer[key] for key in ("code", "mission_id", "step") if answer.get(key)}}


def _bounded(sent: Any) -> Any:
    """Return what was sent, or as much of its text as fits a line."""
    text = orjson.dumps(sent).decode()
    return sent if len(text) <= LONGEST else f"{text[:LONGEST]}… ({len(text)} letters)"


class Repetitions:
    """What one page publishes steadily: the same message again and again is one command."""

    def __init__(self) -> None:
        self._last: dict[str, tuple[float, int]] = {}

    def is_command(self, topic: str, message: Any, now: float) -> bool:
        """Say whether a message is another one than the last, or comes after a pause."""
        mark = hash(orjson.dumps(message))
        at, before = self._last.get(topic, (-STEADY_S, 0))
        if len(self._last) >= MOST_TOPICS:
            self._last.clear()
        self._last[topic] = (now, mark)
        return mark != before or now - at >= STEADY_S
