"""A recording for pages: its messages, its charts redrawn and explained, and no commands."""

from __future__ import annotations

import json
from bisect import bisect_right
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from lupin_engine.errors import LupinError, shortened
from lupin_engine.machine import Machine
from lupin_engine.missions import LoadedMissions, lifecycle_in, load_files, mission_files
from lupin_engine.plugin import Access, Catalog, PageMessage, Profile
from lupin_engine.runtime import JournalMoments, explanation
from lupin_ros.recording.reader import Recording
from lupin_ros.recording.unpacked import unpack_journal, write_files
from lupin_ros.service import names
from lupin_ros.service.drawn import drawn, shown

#: Of a topic of sensors at most one message of a frame is sent to pages in so many nanoseconds.
THINNED_NS = 100_000_000


@dataclass(frozen=True)
class _RecordedStep:
    """When a step was published, in milliseconds since 1970, by which process, and its number."""

    at: float
    boot: str
    sequence: int


class RecordedPages:
    """A recording as a source of pages: its history and charts (`plugin.pages.PageSource`).

    Args:
        recording: the recording.
        profiles: those whose missions may have been recorded.
        catalog: of the installed plugins.
        journal: the folder of a journal, for a recording without its own; need not exist.
    """

    def __init__(
        self, recording: Recording, profiles: Iterable[Profile], catalog: Catalog, journal: Path
    ) -> None:
        self._recording = recording
        self._catalog = catalog
        self._journal = journal
        #: The charts that were drawn anew, by their hashes.
        self._charts: dict[str, LoadedMissions] = {}
        wires = [profile.wire for profile in profiles if profile.wire is not None]
        own = (names.STEPS_TOPIC, names.MISSIONS_TOPIC, names.CHART_TOPIC, names.POSSIBLE_TOPIC)
        self._wanted = (*own, *(wire.state.name for wire in wires))
        #: Of these every message counts.
        self._whole = frozenset((*self._wanted, *(wire.outcomes.name for wire in wires)))

    @property
    def topics(self) -> Mapping[str, str]:
        """The recorded topics that can be read, each with its type."""
        return self._recording.topics

    @property
    def events(self) -> Collection[str]:
        """No topic: a page sees each at a moment, by its last message."""
        return ()

    @property
    def access(self) -> Access:
        """Return the access: viewers may read all topics, and draw and explain charts."""
        services = (*names.ACCESS.viewer, *names.ACCESS.operator)
        return Access(viewer=(*self._recording.topics, *services))

    def about(self) -> Mapping[str, Any]:
        """Return the mode, the file's name, the recorded time in ms since 1970, and problems for people."""
        recording = self._recording
        return {
            "mode": "recording",
            "title": recording.path.name,
            "from": recording.begin / 1e6,
            "to": recording.end / 1e6,
            "problems": list(self.problems()),
        }

    def problems(self) -> Iterator[str]:
        """Yield the gaps of the recording for people: a truncated end, missing and unreadable topics."""
        recording = self._recording
        if recording.is_cut_off:
            yield "the file is cut off: what came after its last message is not known"
        missing = [name for name in self._wanted if name not in recording.topics]
        if missing:
            yield f"nobody told {', '.join(missing)} while it was recorded"
        for topic, why in recording.unreadable.items():
            yield f"{topic} cannot be read: {why}"

    def begin(self, publish: Callable[[PageMessage], None], forget: Callable[[], None]) -> None:
        """Do nothing: a recording publishes nothing by itself, pages ask for its `history`."""

    def work(self, now: float) -> float | None:
        """Return None: there is nothing to do."""
        return None

    def clock(self, now: float) -> float:
        """Return the end of the recording, in milliseconds since 1970."""
        return self._recording.end / 1e6

    def stop(self, stopped: bool) -> None:
        """Do nothing: there is no robot."""

    def call(self, service: str, arguments: Mapping[str, Any], now: float) -> Mapping[str, Any]:
        """See `PageSource`; LupinError for all but drawing and explaining, which a recording can answer."""
        if service not in (names.DRAW_SERVICE, names.EXPLAIN_SERVICE):
            raise LupinError(f"{service}: this is a recording: it cannot be commanded, and nobody answers")
        loaded = self._chart(str(arguments.get("chart", "")))
        return drawn(loaded, arguments) if service == names.DRAW_SERVICE else self._explain(loaded, arguments)

    def _explain(self, loaded: LoadedMissions, arguments: Mapping[str, Any]) -> Mapping[str, Any]:
        """Explain a state or transition at a `moment` in milliseconds since 1970, or at the end.

        Raises:
            LupinError: `moment` is no number. Other problems are in the response's `message`.
        """
        moment = arguments.get("moment", self._recording.end / 1e6)
        if isinstance(moment, bool) or not isinstance(moment, int | float):
            raise LupinError(f"{names.EXPLAIN_SERVICE}: moment must be a number")

        def explained() -> dict[str, str]:
            machine, now = self._machine(loaded, float(moment))
            found = explanation(machine, str(arguments.get("element", "")), now)
            return {"explanation": json.dumps(found, default=str)}

        return shown(loaded, arguments, "explanation", explained)

    def _machine(self, loaded: LoadedMissions, moment: float) -> tuple[Machine, float]:
        """Return the machine, restored from the journal, at a moment in ms since 1970, and its clock.

        Raises:
            LupinError: no step was recorded until then, or the journal cannot be used.
        """
        place = bisect_right(self._steps, moment, key=lambda step: step.at)
        if not place:
            raise LupinError("no step was recorded until this moment")
        step = self._steps[place - 1]
        after = self._steps[place] if place < len(self._steps) else None
        before = after.sequence if after is not None and after.boot == step.boot else None
        return self._moments.at(loaded.chart, loaded.hash, step.boot, moment / 1000.0, before)

    @cached_property
    def _steps(self) -> list[_RecordedStep]:
        """The recorded steps in the order of time; those without a time are left out."""
        texts = (each.fields["data"] for each in self._recording.messages([names.STEPS_TOPIC]))
        records = [
            record for record in map(json.loads, texts) if {"wall_ns", "boot", "step"} <= record.keys()
        ]
        found = [_RecordedStep(one["wall_ns"] / 1e6, one["boot"], one["step"]["sequence"]) for one in records]
        return sorted(found, key=lambda step: step.at)

    @cached_property
    def _moments(self) -> JournalMoments:
        """The attached journal; without one, the given one."""
        self._unpacked = TemporaryDirectory(prefix="lupin-journal-")  # it is there as long as this object
        folder = Path(self._unpacked.name)
        return JournalMoments(folder if unpack_journal(self._recording, folder) else self._journal)

    def _chart(self, asked: str) -> LoadedMissions:
        """Return a chart that ran, by its hash, loaded from its recorded files.

        Raises:
            LupinError: no such chart was recorded, or the installed plugins cannot load it.
        """
        if asked not in self._charts:
            records = (
                json.loads(each.fields["data"]) for each in self._recording.messages([names.CHART_TOPIC])
            )
            record = next((each for each in records if each["hash"] == asked), None)
            if record is None:
                raise LupinError(f"the chart {shortened(asked)!r} was not recorded")
            with TemporaryDirectory() as folder:
                self._charts[asked] = _load(record["files"], Path(folder), self._catalog)
        return self._charts[asked]

    def history(self, since: float, topics: Collection[str]) -> Iterator[PageMessage]:
        """Yield the messages later than `since`, thinned where not every one counts; no topics: of all."""
        last: dict[tuple[str, str], int] = {}
        for message in self._recording.messages(topics, round(since * 1e6)):
            source = message.topic, _frame(message.fields)
            if message.topic not in self._whole and message.heard - last.get(source, 0) < THINNED_NS:
                continue
            last[source] = message.heard
            yield PageMessage(message.topic, message.heard / 1e6, message.fields)


def _load(files: Mapping[str, str], folder: Path, catalog: Catalog) -> LoadedMissions:
    """Load missions from the texts of their files, written into an empty folder.

    Raises:
        LupinError: a name leads out of the folder, or the missions have errors with the plugins here.
    """
    write_files(files, folder)
    try:
        return load_files(lifecycle_in(folder), mission_files(folder), catalog)
    except LupinError as problem:
        text = str(problem).replace(f"{folder}/", "")
        raise LupinError(f"the plugins here do not understand the chart that was recorded: {text}") from None


def _frame(fields: Mapping[str, Any]) -> str:
    """Return the frame of a message: several nodes publish transforms of theirs on one topic."""
    transforms = fields.get("transforms")
    if transforms:
        return str(transforms[0].get("child_frame_id"))
    header = fields.get("header")
    return str(header.get("frame_id")) if isinstance(header, Mapping) else ""
