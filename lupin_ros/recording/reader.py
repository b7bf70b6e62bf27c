"""Reads recordings: MCAP of the profile `ros2`, by the definitions in the file; needs no ROS.

A truncated file, of a killed recorder or a full disk, is read up to its end. Messages that cannot be decoded
are skipped.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mcap.reader import make_reader
from mcap.records import Channel, Footer, Message, Schema
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory

from lupin_engine.errors import UsageError

#: How every MCAP file begins.
MAGIC = b"\x89MCAP0\r\n"
_ROS2, _CDR = "ros2msg", "cdr"


@dataclass(frozen=True)
class RecordedMessage:
    """A message by its fields; `heard` is its time of receipt, in UNIX time in nanoseconds."""

    topic: str
    heard: int
    fields: Mapping[str, Any]


class Recording:
    """A recorded file; names in the namespace `robot` are read without it.

    Raises:
        UsageError: it cannot be read, is no recording, or has no message.
    """

    def __init__(self, path: Path, robot: str = "") -> None:
        self.path = path
        self._space = f"{robot}/"
        #: The topics that can be read, each with its type, and why others cannot be.
        self.topics: dict[str, str] = {}
        self.unreadable: dict[str, str] = {}
        #: Whether the file ends before its end.
        self.is_cut_off = False
        self.begin = self.end = 0
        _check(path)
        self._decoders: dict[str, Callable[[bytes], Any]] = {}
        if not self._summarised():
            self._looked_through()
        if not self.topics and not self.unreadable:
            raise UsageError(f"{str(path)!r} has no message that could be shown")

    def messages(self, topics: Collection[str] = (), since: int = -1) -> Iterator[RecordedMessage]:
        """Yield the messages received after `since`, in the order of the file; without topics, of all."""
        channels: dict[int, str] = {}
        for record in self._records():
            if isinstance(record, Channel):
                topic = self._own(record.topic)
                if topic in self.topics and (not topics or topic in topics):
                    channels[record.id] = topic
            elif isinstance(record, Message) and record.channel_id in channels and record.log_time > since:
                topic = channels[record.channel_id]
                with contextlib.suppress(Exception):  # bytes of another type than the file says
                    fields = plain(self._decoders[topic](record.data))
                    yield RecordedMessage(topic, record.log_time, fields)

    def attached(self, type_name: str) -> Iterator[tuple[str, bytes]]:
        """Yield the attached files of a type; a truncated file has none."""
        if self.is_cut_off:
            return
        with self.path.open("rb") as file:
            for each in make_reader(file).iter_attachments():
                if each.media_type == type_name:
                    yield each.name, each.data

    def _records(self) -> Iterator[Any]:
        """Yield all records, up to the end of a truncated file."""
        with self.path.open("rb") as file:
            records = StreamReader(file, emit_chunks=False).records
            try:
                for record in records:
                    yield record
                    if isinstance(record, Footer):
                        return
            except Exception:  # a broken file makes its readers raise whatever they like
                pass
        self.is_cut_off = True

    def _summarised(self) -> bool:
        """Read the index; return False where there is none."""
        try:
            with self.path.open("rb") as file:
                summary = make_reader(file).get_summary()
        except Exception:  # where a file breaks off, numbers are no numbers
            return False
        if summary is None or summary.statistics is None or not summary.channels:
            return False
        counted = summary.statistics.channel_message_counts
        for channel in summary.channels.values():
            if counted.get(channel.id):
                self._add(channel, summary.schemas.get(channel.schema_id))
        self.begin, self.end = summary.statistics.message_start_time, summary.statistics.message_end_time
        return True

    def _looked_through(self) -> None:
        """Read the whole file, which has no index."""
        schemas: dict[int, Schema] = {}
        channels: dict[int, Channel] = {}
        for record in self._records():
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                channels[record.id] = record
            elif isinstance(record, Message):
                channel = channels.pop(record.channel_id, None)
                if channel is not None:
                    self._add(channel, schemas.get(channel.schema_id))
                self.begin = min(self.begin or record.log_time, record.log_time)
                self.end = max(self.end, record.log_time)

    def _own(self, topic: str) -> str:
        return f"/{topic[len(self._space) :]}" if topic.startswith(self._space) else topic

    def _add(self, channel: Channel, schema: Schema | None) -> None:
        topic = self._own(channel.topic)
        if channel.message_encoding != _CDR or schema is None or schema.encoding != _ROS2:
            encoding = schema.encoding if schema is not None else "no definition"
            self.unreadable[topic] = f"{channel.message_encoding} with {encoding}, not {_CDR} with {_ROS2}"
            return
        try:
            decoder = DecoderFactory().decoder_for(channel.message_encoding, schema)
        except Exception as problem:  # of a parser by others, about a definition by others
            self.unreadable[topic] = f"its definition cannot be read: {problem}"
            return
        if decoder is not None:
            self.topics[topic] = schema.name
            self._decoders[topic] = decoder


def plain(value: Any) -> Any:
    """Return a decoded message as dictionaries, lists, bytes and scalars."""
    names = getattr(value, "__slots__", None)
    if names is not None:
        return {name: plain(getattr(value, name)) for name in names}
    if isinstance(value, (list, tuple)):
        return [plain(each) for each in value] if value and hasattr(value[0], "__slots__") else list(value)
    return value


def _check(path: Path) -> None:
    """Raise UsageError unless a file can be read and begins as MCAP does."""
    if path.is_dir():
        raise UsageError(f"{str(path)!r} is a folder; name the .mcap file in it")
    try:
        with path.open("rb") as file:
            begin = file.read(len(MAGIC))
    except OSError as problem:
        raise UsageError(f"{str(path)!r} cannot be read: {problem.strerror}") from None
    if begin != MAGIC:
        hint = "a recording is an MCAP file, as `lupin record` makes it"
        raise UsageError(f"{str(path)!r} is no recording: {hint}")
