"""Recordings as others read them: the package `mcap`, and Foxglove's reader of ROS 2."""

from __future__ import annotations

import contextlib
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Channel, Message, Schema
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory


@dataclass(frozen=True)
class Recorded:
    """A message of a recording; times are UNIX time in nanoseconds."""

    data: bytes
    published: int
    heard: int
    value: Any


def whole(path: Path) -> dict[str, list[Recorded]]:
    """Return the messages of a recording by topic, all decoded by the definitions in the file."""
    found: dict[str, list[Recorded]] = defaultdict(list)
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        assert reader.get_header().profile == "ros2"
        for _, channel, message, value in reader.iter_decoded_messages():
            found[channel.topic].append(Recorded(message.data, message.publish_time, message.log_time, value))
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == sum(map(len, found.values()))
    return dict(found)


def channels(path: Path) -> dict[str, tuple[Channel, Schema]]:
    """Return the topics of a recording, each with its type."""
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    return {one.topic: (one, summary.schemas[one.schema_id]) for one in summary.channels.values()}


def remains(path: Path) -> list[Message]:
    """Return the messages of a file that was not finished, up to where it breaks off."""
    found: list[Message] = []
    with path.open("rb") as file, contextlib.suppress(McapError):
        records = StreamReader(file, emit_chunks=False).records
        found.extend(record for record in records if isinstance(record, Message))
    return found
