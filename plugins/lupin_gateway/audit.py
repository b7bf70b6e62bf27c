"""The audit log: one JSON line for each command, in a rotating file, written by a thread of its own.

`AuditLog.write` never blocks: lines that do not fit the queue (10,000), or that the disk refuses, are lost.
They are counted, and a line with `"what": "lost"` follows as soon as writing works again.
"""

from __future__ import annotations

import contextlib
import json
import logging
import os
import queue
import sys
import threading
from collections.abc import Callable, Mapping
from datetime import datetime, timezone
from logging.handlers import RotatingFileHandler
from pathlib import Path
from typing import Any

import orjson

#: Size of a file in bytes, and how many older ones are kept.
FILE_BYTES, OLDER_FILES = 10_000_000, 5
#: How many lines may wait for the disk, and how many seconds those that are left have at the end.
WAITING, CLOSE_S = 10_000, 2.0
#: How many letters of arguments and answers a line has at most.
LONGEST = 2_000
#: What stands for what is nested too deep to be written.
TOO_DEEP = "nested too deep to be shown"
#: The same message sooner than this after the last one is that one repeated, in seconds.
STEADY_S = 1.0
#: Topics of which a page's last message is remembered.
MOST_TOPICS = 256


class _PrivateFile(RotatingFileHandler):
    """A rotating file, mode 600. Where it cannot be opened, each line tries again."""

    def __init__(self, file: Path, report: Callable[[str], object]) -> None:
        super().__init__(file, maxBytes=FILE_BYTES, backupCount=OLDER_FILES, encoding="utf-8", delay=True)
        self._report = report
        self._fails = self._is_reported = False
        try:
            self.stream = self._open()
        except OSError:
            self.handleError(logging.makeLogRecord({}))

    def _open(self) -> Any:
        Path(self.baseFilename).parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(self.baseFilename, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
        return os.fdopen(descriptor, self.mode, encoding=self.encoding)

    def take(self, text: str) -> bool:
        """Write a line; return whether that worked. Of failures in a row only the first one is reported."""
        self._fails = False
        self.handle(logging.LogRecord("audit", logging.INFO, "", 0, text, None, None))
        self._is_reported &= self._fails
        return not self._fails

    def abandon(self) -> None:
        """Give up the file without flushing: closing it would wait for a disk that hangs."""
        self.lock = None
        self.flush = self.close = lambda: None  # type: ignore[method-assign]

    def handleError(self, _: logging.LogRecord) -> None:  # noqa: N802
        """Report the first of several failures in a row, and let `take` return False."""
        self._fails = True
        if not self._is_reported:
            self._report(f"{self.baseFilename}: the audit log cannot be written: {sys.exc_info()[1]}")
        self._is_reported = True


class AuditLog:
    """The log in one file; `close` flushes the queue, for at most twice `CLOSE_S`."""

    def __init__(self, file: Path, report: Callable[[str], object] = lambda _: None) -> None:
        """Older files are `FILE.1` and so on; `report` gets why writing fails, on whatever thread."""
        self._lost = 0
        self._waiting: queue.Queue[tuple[str, int] | None] = queue.Queue(WAITING)
        self._handler = _PrivateFile(file, report)
        self._writer = threading.Thread(target=self._write_all, name="audit", daemon=True)
        self._writer.start()

    def _write_all(self) -> None:
        refused = 0
        while (waiting := self._waiting.get()) is not None:
            text, lines = waiting
            if refused and self._handler.take(json.dumps({"what": "lost", "lines": refused})):
                refused = 0
            if not self._handler.take(text):
                refused += lines

    def write(self, line: Mapping[str, Any]) -> None:
        """Queue a line; returns at once."""
        lost = {"wall": line.get("wall", ""), "what": "lost", "lines": self._lost}
        if self._lost and self._put(lost, self._lost):
            self._lost = 0
        if not self._put(line):
            self._lost += 1

    def _put(self, line: Mapping[str, Any], lines: int = 1) -> bool:
        text = json.dumps(line, ensure_ascii=False, default=str)
        try:
            self._waiting.put_nowait((text, lines))
        except queue.Full:
            return False
        return True

    def close(self) -> None:
        """Flush the queue and close the file; a disk that hangs is abandoned after `CLOSE_S`."""
        with contextlib.suppress(queue.Full):
            self._waiting.put(None, timeout=CLOSE_S)
        self._writer.join(CLOSE_S)
        if self._writer.is_alive():
            self._handler.abandon()
            return
        with contextlib.suppress(OSError):  # it has been told
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


def login_line(wall: float, who: str, address: str, accepted: bool, answer: str) -> dict[str, Any]:
    """Return the line of a login, a refused one, or a connection that is ended; it has no `name`."""
    moment = datetime.fromtimestamp(wall, timezone.utc).isoformat(timespec="milliseconds")
    return {
        "wall": moment,
        "who": who,
        "from": address,
        "what": "login",
        "accepted": accepted,
        "answer": answer,
    }


def _bounded(sent: Any) -> Any:
    """Return what was sent, or as much of its text as fits a line."""
    text = _text(sent)
    if text == TOO_DEEP:
        return text
    return sent if len(text) <= LONGEST else f"{text[:LONGEST]}… ({len(text)} letters)"


def _text(sent: Any) -> str:
    try:
        return orjson.dumps(sent).decode()
    except TypeError:  # it reads deeper than it writes
        return TOO_DEEP


def last_lines(file: Path, most: int) -> list[dict[str, Any]]:
    """Return the last commands in a log, of at most `most` lines; none where it cannot be read."""
    try:
        with file.open("rb") as log:
            size = log.seek(0, os.SEEK_END)
            log.seek(max(0, size - most * LONGEST))
            lines = log.read().splitlines()[-most:]
    except OSError:
        return []
    found = []
    for line in lines:
        with contextlib.suppress(ValueError):
            found.append(json.loads(line))
    return [line for line in found if isinstance(line, dict) and "name" in line]


class Repetitions:
    """Deduplicates the publications of a page: the same message again within `STEADY_S` is no new command.

    At `MOST_TOPICS` topics all are forgotten.
    """

    def __init__(self) -> None:
        self._last: dict[str, tuple[float, int]] = {}

    def is_command(self, topic: str, message: Any, now: float) -> bool:
        """Return whether a message differs from the topic's last one, or comes `STEADY_S` after it."""
        mark = hash(_text(message))
        at, before = self._last.get(topic, (-STEADY_S, 0))
        if len(self._last) >= MOST_TOPICS:
            self._last.clear()
        self._last[topic] = (now, mark)
        return mark != before or now - at >= STEADY_S
