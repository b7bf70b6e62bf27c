"""A recording for pages: everything that was heard, and nothing that can be commanded."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from typing import Any

from lupin_engine.errors import LupinError
from lupin_engine.plugin.contract import Access
from lupin_engine.plugin.pages import PageMessage
from lupin_engine.plugin.profile import Profile
from lupin_engine.ros import names
from lupin_engine.ros.recording.reader import Recording

#: Of a topic of sensors at most one message of a frame is told in so many nanoseconds.
THINNED_NS = 100_000_000


class RecordedPages:
    """See `plugin.pages.PageSource`; `profiles` are those whose missions may have been recorded."""

    def __init__(self, recording: Recording, profiles: Iterable[Profile]) -> None:
        self._recording = recording
        wires = [profile.wire for profile in profiles if profile.wire is not None]
        own = (names.STEPS_TOPIC, names.MISSIONS_TOPIC, names.CHART_TOPIC, names.POSSIBLE_TOPIC)
        self._wanted = (*own, *(wire.state.name for wire in wires))
        #: Of these every message counts.
        self._whole = frozenset((*self._wanted, *(wire.outcomes.name for wire in wires)))

    @property
    def topics(self) -> Mapping[str, str]:
        """See `PageSource`."""
        return self._recording.topics

    @property
    def events(self) -> Collection[str]:
        """See `PageSource`."""
        return ()

    @property
    def access(self) -> Access:
        """See `PageSource`."""
        services = (*names.ACCESS.viewer, *names.ACCESS.operator)
        return Access(viewer=(*self._recording.topics, *services))

    def about(self) -> Mapping[str, Any]:
        """See `PageSource`."""
        recording = self._recording
        return {
            "mode": "recording",
            "title": recording.path.name,
            "from": recording.begin / 1e6,
            "to": recording.end / 1e6,
            "problems": list(self.problems()),
        }

    def problems(self) -> Iterator[str]:
        """Tell what a page would look for in vain."""
        recording = self._recording
        if recording.is_cut_off:
            yield "the file is cut off: what came after its last message is not known"
        missing = [name for name in self._wanted if name not in recording.topics]
        if missing:
            yield f"nobody told {', '.join(missing)} while it was recorded"
        for topic, why in recording.unreadable.items():
            yield f"{topic} cannot be read: {why}"

    def begin(self, tell: Callable[[PageMessage], None], forget: Callable[[], None]) -> None:
        """See `PageSource`."""

    def work(self, now: float) -> float | None:
        """See `PageSource`."""
        return None

    def clock(self, now: float) -> float:
        """See `PageSource`."""
        return self._recording.end / 1e6

    def stop(self, stopped: bool) -> None:
        """See `PageSource`."""

    def call(self, service: str, arguments: Mapping[str, Any], now: float) -> Mapping[str, Any]:
        """See `PageSource`."""
        raise LupinError(f"{service}: this is a recording: it cannot be commanded, and answers nothing")

    def history(self, since: float, topics: Collection[str]) -> Iterator[PageMessage]:
        """See `PageSource`."""
        last: dict[tuple[str, str], int] = {}
        for message in self._recording.messages(topics, round(since * 1e6)):
            source = message.topic, _frame(message.fields)
            if message.topic not in self._whole and message.heard - last.get(source, 0) < THINNED_NS:
                continue
            last[source] = message.heard
            yield PageMessage(message.topic, message.heard / 1e6, message.fields)


def _frame(fields: Mapping[str, Any]) -> str:
    """Return which frame a message is about: several nodes tell those of theirs on one topic."""
    transforms = fields.get("transforms")
    if transforms:
        return str(transforms[0].get("child_frame_id"))
    header = fields.get("header")
    return str(header.get("frame_id")) if isinstance(header, Mapping) else ""
