"""Records every published topic as bytes, without decoding; hidden ones, as of actions, are left out.

A node with a thread of its own discovers topics and subscribes to them, so that neither the display of a run
nor a slow disk delays the other. A full disk ends the recording; a killed recorder loses up to `FLUSH_S`.
"""

from __future__ import annotations

import contextlib
import os
import re
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from lupin_engine.errors import LupinError, Severity, UsageError
from lupin_engine.plugin import COMMON_NAMES, CommonName, Profile, Wire
from lupin_engine.runtime import journal_files, journal_folder
from lupin_ros.adapter.network import node_name
from lupin_ros.adapter.node import Qos, RosNode
from lupin_ros.adapter.qos import asks_more, heard_profile, offers_text
from lupin_ros.interfaces.definitions import interface_class
from lupin_ros.interfaces.type_hashes import local_hash
from lupin_ros.recording.file import JOURNAL_TYPE, RecordingFile
from lupin_ros.recording.schema import message_text
from lupin_ros.service.messages import read

#: Seconds between two looks for topics.
LOOK_S = 0.25
#: What is lost at most when the recorder is killed, in seconds.
FLUSH_S = 2.0


@dataclass
class _Topic:
    """A recorded topic: its class, its channel in the file, and its subscription."""

    name: str
    kind: Any
    channel: Any
    profile: Any
    subscription: Any = field(default=None)


class TopicRecorder:
    """Records into a new file, within a `with` block; a file without messages is removed at its end.

    Args:
        path: of the file.
        without: topics whose name matches are left out.
        profiles: of the missions whose end sets `mission_is_over`, the monotonic time since which the
            mission is over: None before that, and while the next one runs.

    Raises:
        UsageError: the file exists already, or cannot be written.
    """

    def __init__(
        self, path: Path, without: re.Pattern[str] | None = None, profiles: Iterable[Profile] = ()
    ) -> None:
        self._ros = RosNode(f"lupin_recorder_{os.getpid()}")
        try:
            self._file = RecordingFile(path)
        except UsageError:
            self._ros.close()
            raise
        self._begun = time.time()
        self._me = self._ros.node.get_fully_qualified_name()
        self._without = without
        self._topics: dict[str, _Topic] = {}
        self._left_out: set[str] = set()
        self._news: deque[tuple[str, Severity]] = deque()
        self._runs = False
        #: Since when the mission is over that ran while this recorded, in seconds of the monotonic clock.
        self.mission_is_over: float | None = None
        #: Whether the recording ended by itself: nothing more could be heard, or written.
        self.failed = False
        self._thread = threading.Thread(target=self._work, name="recorder", daemon=True)
        for profile in profiles:
            self._follow(profile)

    @property
    def path(self) -> Path:
        """The file."""
        return self._file.path

    @property
    def messages(self) -> int:
        """How many messages were recorded."""
        return self._file.messages

    @property
    def topics(self) -> int:
        """How many topics are recorded."""
        return len(self._topics)

    @property
    def size(self) -> int:
        """How many bytes the file had at the last flush."""
        return self._file.size

    def news(self) -> list[tuple[str, Severity]]:
        """Return the events since the last call: a topic that cannot be recorded, a full disk."""
        return [self._news.popleft() for _ in range(len(self._news))]

    def __enter__(self) -> TopicRecorder:
        self._ros.steady_timer(LOOK_S, partial(self._safely, self._look))
        self._ros.steady_timer(FLUSH_S, partial(self._safely, self._file.flush))
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ros.stop()
        self._thread.join()
        self._safely(self._attach_journal)
        self._safely(self._file.finish)
        if not self.messages:
            self.path.unlink(missing_ok=True)
        self._ros.leave()

    def _work(self) -> None:
        try:
            while not self.failed and self._ros.spin_once():
                pass
        except Exception as defect:  # nobody waits for this thread: it must not end unheard
            self._fail(f"rclpy fails all the time: {defect!r}")

    def _attach_journal(self) -> None:
        """Attach the files that an orchestrator on this computer has written to its journal meanwhile.

        One that cannot be read, or was deleted to make room, is left out with a warning.
        """
        for file in journal_files(journal_folder()) if self.messages else ():
            try:
                changed = file.stat()
                if changed.st_mtime < self._begun:
                    continue
                data = file.read_bytes()
            except OSError as problem:
                self._news.append((f"{file} is not attached: {problem.strerror}", Severity.WARN))
                continue
            self._file.attach(file.name, data, changed.st_mtime_ns, JOURNAL_TYPE)

    def _safely(self, write: Callable[[], None]) -> None:
        """Write; a failure ends the recording."""
        if self.failed:
            return
        try:
            write()
        except OSError as problem:
            self._fail(f"{str(self.path)!r} cannot be written: {problem.strerror}")

    def _fail(self, reason: str) -> None:
        self.failed = True
        self._file.cut()
        self._news.append((f"the recording ends here, {reason}", Severity.ERROR))

    # -- topics -----------------------------------------------------------------------------------------

    def _leave_out(self, name: str, problem: Exception) -> None:
        reason = str(problem) if isinstance(problem, LupinError) else repr(problem)
        self._left_out.add(name)
        self._news.append((f"{name} is not recorded: {reason}", Severity.WARN))

    def _look(self) -> None:
        """Subscribe to new topics, and again where the best common QoS has changed."""
        node = self._ros.node
        for name, types in node.get_topic_names_and_types():
            if name in self._left_out or self._is_unwanted(name):
                continue
            ends = [end for end in node.get_publishers_info_by_topic(name) if node_name(end) != self._me]
            if not ends:
                continue
            topic = self._topics.get(name)
            wanted = heard_profile([end.qos_profile for end in ends])
            if topic is None:
                try:
                    self._topics[name] = self._begin(name, types, ends, wanted)
                except OSError:
                    raise
                except Exception as problem:  # of packages by others: whatever it is, the rest is recorded
                    self._leave_out(name, problem)
            elif asks_more(topic.profile, wanted):
                topic.profile = wanted
                self._listen(topic)

    def _is_unwanted(self, name: str) -> bool:
        """Return whether a topic is hidden, as those of actions are, of another robot, or excluded."""
        of_ours = name in COMMON_NAMES or name.startswith(f"{self._ros.namespace}/")
        return not of_ours or "/_" in name or (self._without is not None and bool(self._without.search(name)))

    def _begin(self, name: str, types: Sequence[str], ends: Sequence[Any], wanted: Any) -> _Topic:
        if len(types) > 1:
            raise UsageError(f"it is of several types: {', '.join(sorted(types))}")
        (type_name,) = types
        try:
            hash_, kind = local_hash(type_name), interface_class(type_name)
            definition = message_text(type_name)
        except OSError as problem:  # of a package: the recording itself can be written
            raise UsageError(f"{type_name} cannot be read: {problem.strerror}") from problem
        others = [node_name(end) for end in ends if str(end.topic_type_hash) not in (hash_, "INVALID")]
        if others:
            raise UsageError(f"{', '.join(sorted(set(others)))} has another definition of {type_name}")
        about = {"offered_qos_profiles": offers_text(end.qos_profile for end in ends)}
        channel = self._file.add_topic(name, type_name, definition, {**about, "topic_type_hash": hash_})
        topic = _Topic(name, kind, channel, wanted)
        self._listen(topic)
        return topic

    def _listen(self, topic: _Topic) -> None:
        if topic.subscription is not None:
            self._ros.node.destroy_subscription(topic.subscription)
        take = partial(self._take, topic.channel)
        topic.subscription = self._ros.subscribe_raw(topic.kind, CommonName(topic.name), topic.profile, take)

    def _take(self, channel: Any, data: bytes, times: Any) -> None:
        heard = times["received_timestamp"] or time.time_ns()
        published = times["source_timestamp"] or heard
        sequence = times["publication_sequence_number"] or 0
        self._safely(lambda: self._file.add(channel, data, published, heard, sequence))

    # -- the mission ------------------------------------------------------------------------------------

    def _follow(self, profile: Profile) -> None:
        wire = profile.wire
        if wire is None:
            return
        with contextlib.suppress(LupinError):  # its messages are not installed
            kind = interface_class(wire.state.type)
            heard = partial(self._take_state, profile, wire)
            self._ros.subscribe(kind, wire.state.name, Qos[wire.state.qos], heard)

    def _take_state(self, profile: Profile, wire: Wire, message: Any) -> None:
        lifecycle = wire.read_state(read(message)).lifecycle
        runs = lifecycle not in profile.stages.without_mission
        if self._runs and not runs:
            self.mission_is_over = time.monotonic()
        elif runs:
            self.mission_is_over = None
        self._runs = runs
