"""Logging: structured events as lines of the node's logger, callbacks whose exceptions end up there, and
warnings that are not repeated.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import structlog
from rclpy.node import Node
from structlog.typing import EventDict, FilteringBoundLogger

from lupin_engine.errors import shortened

#: How many letters a line may have: some of them are others' words. A traceback is not cut.
MAX_LINE = 4000


def guarded(callback: Callable[..., Any], log: FilteringBoundLogger) -> Callable[..., Any]:
    """Return `callback` with its exceptions logged with a traceback instead of raised into the spin."""

    def guard(*arguments: Any) -> Any:
        try:
            return callback(*arguments)
        except Exception:
            log.exception("callback failed", callback=getattr(callback, "__qualname__", repr(callback)))
            return None

    return guard


class WarnOnce:
    """Warnings that may come with every message: each is told once, and not more than `most` of them."""

    def __init__(self, log: FilteringBoundLogger, most: int = 100) -> None:
        self._log = log
        self._most = most
        self._told: set[tuple[str, ...]] = set()

    def __call__(self, text: str, **details: str) -> None:
        """Warn, unless that was done before in the same words and with the same details."""
        warning = (text, *details.values())
        if warning not in self._told and len(self._told) < self._most:
            self._told.add(warning)
            self._log.warning(text, **details)


def ros_log(node: Node) -> FilteringBoundLogger:
    """Return a structlog logger that writes to the node's logger: console, log file and /rosout."""
    logger: FilteringBoundLogger = structlog.wrap_logger(
        _RosSink(node.get_logger()),
        processors=[structlog.processors.format_exc_info, _as_line],
        wrapper_class=structlog.make_filtering_bound_logger(0),
    )
    return logger


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
