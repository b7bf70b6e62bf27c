"""Logs structured events to the node's logger and a file, exceptions of callbacks too, and counts repeats.

Equal lines are counted instead of repeated. Lines that have their text in common and differ in details are
counted from the `MOST`-th in `COUNT_S` seconds on.
"""

from __future__ import annotations

import contextlib
import logging
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from logging.handlers import RotatingFileHandler
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rclpy.node import Node

from lupin_engine.errors import shortened


@contextlib.contextmanager
def _hidden(*names: str) -> Iterator[None]:
    """Let imports of these modules fail, unless they are imported already."""
    hidden = [name for name in names if name not in sys.modules]
    sys.modules.update(dict.fromkeys(hidden))  # type: ignore[arg-type]
    try:
        yield
    finally:
        for name in hidden:
            del sys.modules[name]


# structlog imports these for terminals, where they are installed: 0.2 s and 12 MB of a node, which has none.
with _hidden("rich", "colorama", "better_exceptions"):
    import structlog

if TYPE_CHECKING:
    from structlog.typing import EventDict, FilteringBoundLogger

#: The most letters of a line, as some are others' words. A traceback is not cut.
MAX_LINE = 4000
#: Equal lines are counted for so many seconds, in which so many different ones of a text are logged.
COUNT_S, MOST = 10.0, 200
#: Details by which lines do not differ.
_IDS = frozenset({"command_id", "age"})
#: The detail of a line that is not counted.
_UNCOUNTED = "_uncounted"


def guarded(callback: Callable[..., Any], log: FilteringBoundLogger) -> Callable[..., Any]:
    """Return a function that calls `callback`; it logs an exception with its traceback and returns None."""

    def guard(*arguments: Any) -> Any:
        try:
            return callback(*arguments)
        except Exception:
            with contextlib.suppress(Exception):  # nothing comes after this that could tell it
                log.exception("callback failed", callback=getattr(callback, "__qualname__", repr(callback)))
            return None

    return guard


class WarnOnce:
    """Warnings that may come with every message: each is logged once, and those after `most` are dropped."""

    def __init__(self, log: FilteringBoundLogger, most: int = 100) -> None:
        self._log = log
        self._most = most
        self._logged: set[tuple[str, ...]] = set()

    def __call__(self, text: str, **details: str) -> None:
        """Warn, unless that was done before in the same words and with the same details."""
        warning = (text, *details.values())
        if warning not in self._logged and len(self._logged) < self._most:
            self._logged.add(warning)
            self._log.warning(text, **details)


@dataclass
class _Counted:
    """Lines of one text since a time: the hashes of those logged, and how many were only counted."""

    since: float
    logged: set[int] = field(default_factory=set)
    more: int = 0


class _RecordFile(RotatingFileHandler):
    """A file of records; one that cannot be opened or written is ignored: the console has the same lines."""

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802
        """Ignore the failure."""


class NodeLog:
    """The log of a node: `log` writes to its logger (console and /rosout), and as JSON lines to a file.

    Lines that are equal but for the ids of commands are counted for `COUNT_S` seconds, and so are those of
    one text beyond `MOST`: a flood of requests must not become one of lines.
    """

    def __init__(self, node: Node, now: Callable[[], float] = time.monotonic) -> None:
        """`now` is a steady clock, in seconds."""
        self._now = now
        self._counted: dict[tuple[str, str], _Counted] = {}
        self._file: _RecordFile | None = None
        #: Fields of every line of the file, such as the id of the mission.
        self.about: dict[str, Any] = {}
        self.log: FilteringBoundLogger = structlog.wrap_logger(
            _RosSink(node.get_logger()),
            processors=[structlog.processors.format_exc_info, self._count, self._record, _as_line],
            wrapper_class=structlog.make_filtering_bound_logger(0),
        )

    def write_to(self, path: Path, size: int, files: int) -> None:
        """Write records to a file, too: with `size` bytes it becomes `NAME.1`, and so on up to `files`.

        Raises:
            OSError: its folder cannot be made.
        """
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = _RecordFile(path, maxBytes=size, backupCount=files, delay=True, encoding="utf-8")

    def flush(self) -> None:
        """Log the counts of repeated lines; must be called every `COUNT_S` seconds."""
        for key, counted in list(self._counted.items()):
            if self._now() - counted.since >= COUNT_S:
                self._log_repeats(key)

    def close(self) -> None:
        """Log the counts, and close the file."""
        for key in list(self._counted):
            self._log_repeats(key)
        if self._file is not None:
            with contextlib.suppress(OSError):  # what a full disk did not take is lost
                self._file.close()

    def _log_repeats(self, key: tuple[str, str]) -> None:
        counted = self._counted.pop(key)
        if counted.more:
            level, text = key
            seconds = max(1.0, self._now() - counted.since)
            logged = f"{text}: {counted.more} times more in {seconds:.0f} s"
            getattr(self.log, level)(logged, **{_UNCOUNTED: True})

    def _count(self, _: Any, level: str, event: EventDict) -> EventDict:
        if event.pop(_UNCOUNTED, False):
            return event
        key = level, str(event.get("event", ""))
        counted = self._counted.get(key)
        if counted is not None and self._now() - counted.since >= COUNT_S:
            self._log_repeats(key)
            counted = None
        if counted is None:
            if len(self._counted) >= MOST:
                self._log_repeats(next(iter(self._counted)))
            counted = self._counted[key] = _Counted(self._now())
        line = hash(repr([(name, value) for name, value in event.items() if name not in _IDS]))
        if line in counted.logged or len(counted.logged) >= MOST:
            counted.more += 1
            raise structlog.DropEvent
        counted.logged.add(line)
        return event

    def _record(self, _: Any, level: str, event: EventDict) -> EventDict:
        if self._file is not None:
            details = {name: _plain(value) for name, value in event.items()}
            record = _STAMPED(None, level, {**self.about, **details, "level": level})
            line = structlog.processors.JSONRenderer(default=str)(None, level, record)
            self._file.handle(logging.makeLogRecord({"msg": line}))
        return event


_STAMPED = structlog.processors.TimeStamper(fmt="iso", utc=True, key="time")


def _plain(value: Any) -> Any:
    return shortened(value, MAX_LINE) if isinstance(value, str) else value


def _as_line(_: Any, __: str, event: EventDict) -> str:
    text = str(event.pop("event", ""))
    traceback = event.pop("exception", None)
    details = " ".join(f"{key}={value!r}" for key, value in event.items())
    line = shortened(f"{text} ({details})" if details else text, MAX_LINE)
    return f"{line}\n{traceback}" if traceback else line


class _RosSink:
    """The methods that structlog calls.

    Each severity is logged from a line of its own: rclpy refuses another severity at the same place.
    """

    def __init__(self, logger: Any) -> None:
        self._logger = logger

    def debug(self, line: str) -> None:
        self._logger.debug(line)

    def info(self, line: str) -> None:
        self._logger.info(line)

    def warning(self, line: str) -> None:
        self._logger.warning(line)

    def error(self, line: str) -> None:
        self._logger.error(line)

    def critical(self, line: str) -> None:
        self._logger.fatal(line)
