"""What the parts of the adapter need of the node that they belong to."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol


class Timer(Protocol):
    """A running timer."""

    def cancel(self) -> None:
        """End it; cancelling twice does no harm."""


class Host(Protocol):
    """The node's side of an action or of a comparison with peers; see `ros.adapter.RosNode`."""

    node: Any
    log: Any

    def guarded(self, callback: Callable[..., Any]) -> Callable[..., Any]:
        """Return `callback` with its exceptions logged."""

    def post(self, callback: Callable[[], object]) -> None:
        """Run `callback` on the node's thread."""

    def steady_timer(self, period: float, callback: Callable[[], None]) -> Timer:
        """Call `callback` every `period` seconds of real time."""

    def channels(self) -> list[str]:
        """Return the DDS topics that the node uses."""
