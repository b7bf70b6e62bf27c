"""Topic history: records messages of some topics in compressed blocks, for pages that are opened later.

Each topic has a limit of bytes; the oldest block goes first. Messages are decoded only when a page asks. All
of it runs on the event loop; nothing survives a restart of the gateway.
"""

from __future__ import annotations

import heapq
import struct
import zlib
from collections import deque
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from operator import itemgetter
from typing import Any

from lupin_gateway.encoding import Sample, as_json
from lupin_gateway.history.settings import HistoryTopic
from lupin_gateway.hub import Hub, Outbox, Subscriber
from lupin_gateway.shapes import NotCarried

#: Bytes of messages that are packed together: it takes less than a millisecond, and steps become a tenth.
BLOCK_BYTES = 64_000
#: Before a message in a block: when it arrived, in ms since 1970, and its length.
_ENTRY = struct.Struct("<QI")
#: Bytes of a message before what may be news: representation, options, and the stamp of its header.
_STAMPED = 12


@dataclass(frozen=True)
class _PackedBlock:
    """A block of compressed messages; `last` is the latest of their times."""

    last: int
    data: bytes


class _HistoryRecorder(Subscriber):
    """A subscriber that records a topic."""

    def __init__(self, wanted: HistoryTopic, wall: Callable[[], float]) -> None:
        super().__init__(wanted.name, Outbox(lambda: None))
        self._wanted = wanted
        self._wall = wall
        self._blocks: deque[_PackedBlock] = deque()
        self._packed = 0
        self._open: list[tuple[int, bytes]] = []
        self._opened = 0
        self._decode: Callable[[bytes], Any] = bytes
        self._kept_at: dict[str, int] = {}
        self._news = b""

    def offer(self, sample: Sample) -> None:
        """Record a message, unless the topic's settings (`every`, `on_change`) filter it out."""
        at = round(self._wall() * 1000)
        self._decode = sample.decode
        if self._is_wanted(sample, at):
            self._open.append((at, sample.serialized))
            self._opened += _ENTRY.size + len(sample.serialized)
            if self._opened >= BLOCK_BYTES:
                self._pack()

    def complain(self, problem: str) -> None:
        """Ignore the problem: there is no page to report it to."""

    def _is_wanted(self, sample: Sample, at: int) -> bool:
        wanted = self._wanted
        if wanted.on_change:
            news = sample.serialized[_STAMPED:]
            changed, self._news = news != self._news, news
        else:
            changed = not wanted.every
        source = _source(sample) if wanted.every else ""
        passed = at - self._kept_at.get(source, -1 << 60)
        if not changed and (not wanted.every or 0 <= passed < wanted.every * 1000):
            return False
        self._kept_at[source] = at
        return True

    def _pack(self) -> None:
        rows = (_ENTRY.pack(at, len(message)) + message for at, message in self._open)
        block = _PackedBlock(max(at for at, _ in self._open), zlib.compress(b"".join(rows), 1))
        self._blocks.append(block)
        self._packed += len(block.data)
        self._open, self._opened = [], 0
        while self._packed > self._wanted.limit:
            self._packed -= len(self._blocks.popleft().data)

    def since(self, begin: float) -> Iterator[tuple[int, bytes]]:
        """Return a snapshot of the recorded messages from a time on, as times and lines of JSON."""
        blocks = [block for block in self._blocks if block.last >= begin]
        return self._lines(blocks, self._open.copy(), begin)

    def _lines(
        self, blocks: Sequence[_PackedBlock], rest: Sequence[tuple[int, bytes]], begin: float
    ) -> Iterator[tuple[int, bytes]]:
        topic = as_json(self.topic)
        for at, message in _unpacked(blocks, rest):
            if at >= begin:
                try:
                    encoded = as_json(self._decode(message))
                except NotCarried:
                    continue
                yield at, b'{"topic":%b,"at":%d,"msg":%b}\n' % (topic, at, encoded)


def _unpacked(
    blocks: Sequence[_PackedBlock], rest: Sequence[tuple[int, bytes]]
) -> Iterator[tuple[int, bytes]]:
    for block in blocks:
        data, place = zlib.decompress(block.data), 0
        while place < len(data):
            at, length = _ENTRY.unpack_from(data, place)
            place += _ENTRY.size + length
            yield at, data[place - length : place]
    yield from rest


def _source(sample: Sample) -> str:
    """Return the key that `every` applies to: on /tf the child frame of the first transform, else ''."""
    if sample.topic != "/tf":
        return ""
    try:
        transforms = sample.decode(sample.serialized)["transforms"]
    except NotCarried:
        return ""
    return str(transforms[0]["child_frame_id"]) if transforms else ""


class TopicHistory:
    """The recorders of all topics with a history."""

    def __init__(self, hub: Hub, wanted: Sequence[HistoryTopic], wall: Callable[[], float]) -> None:
        """`wall` is the clock by which messages arrive, in seconds since 1970."""
        self._hub = hub
        self._wanted = wanted
        self._recorders = {each.name: _HistoryRecorder(each, wall) for each in wanted}

    @property
    def topics(self) -> Collection[str]:
        """The names of the topics."""
        return self._recorders.keys()

    def start(self) -> None:
        """Begin to record; on the event loop."""
        for each in self._wanted:
            self._hub.subscribe(self._recorders[each.name], each.type)

    def lines(self, begin: float, topics: Collection[str]) -> Iterator[bytes]:
        """Return the recorded messages from a time on (ms since 1970), a line of JSON each, the oldest first.

        Messages that arrive while they are read are not included; those that cannot be decoded are left out.
        """
        recorded = [self._recorders[name].since(begin) for name in topics]
        return map(itemgetter(1), heapq.merge(*recorded, key=itemgetter(0)))
