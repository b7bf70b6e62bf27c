"""Writes the file of a recording: MCAP of the profile `ros2`, as rosbag2 writes it."""

from __future__ import annotations

import contextlib
import os
import time
from pathlib import Path
from typing import Any

from mcap.writer import CompressionType, Writer

from lupin_engine import __version__
from lupin_engine.errors import UsageError

#: The type of the files of a journal that a recording brings along.
JOURNAL_TYPE = "application/x-lupin-journal"


class RecordingFile:
    """A new file that stays readable up to the last `flush`, also if the process is killed.

    Raises:
        UsageError: it exists already, or cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.messages = 0
        try:
            self._file = path.open("xb")
        except FileExistsError:
            raise UsageError(f"{str(path)!r} is there already; name another file") from None
        except OSError as problem:
            raise UsageError(f"no recording can be written to {str(path)!r}: {problem.strerror}") from None
        self._schemas: dict[str, int] = {}
        self._whole = self._kept = 0  # bytes and messages up to the last flush
        self._writer: Any = Writer(self._file, compression=CompressionType.ZSTD)
        try:
            self._writer.start(profile="ros2", library=f"lupin {__version__}")
            self.flush()
        except OSError as problem:
            self.cut()
            path.unlink(missing_ok=True)
            raise UsageError(f"no recording can be written to {str(path)!r}: {problem.strerror}") from None

    @property
    def size(self) -> int:
        """The size in bytes at the last flush."""
        return self._whole

    def add_topic(self, topic: str, type_name: str, definition: str, about: dict[str, str]) -> Any:
        """Add a topic with its type and the type's definition; return its channel."""
        if type_name not in self._schemas:
            schema = self._writer.register_schema(type_name, "ros2msg", definition.encode())
            self._schemas[type_name] = schema
        return self._writer.register_channel(topic, "cdr", self._schemas[type_name], about)

    def add(self, channel: Any, data: bytes, published: int, heard: int, sequence: int = 0) -> None:
        """Add a message, as CDR; times are UNIX time in nanoseconds.

        Raises:
            OSError: the disk is full.
        """
        self._writer.add_message(channel, heard, data, published, sequence % 2**32)
        self.messages += 1

    def attach(self, name: str, data: bytes, changed_ns: int, type_name: str) -> None:
        """Attach a whole file that was changed in POSIX time; readers of messages do not see it.

        Raises:
            OSError: the disk is full.
        """
        self._writer.add_attachment(changed_ns, time.time_ns(), name, type_name, data)

    def flush(self) -> None:
        """Write buffered messages to the operating system: they survive this process, not a power cut.

        Raises:
            OSError: the disk is full.
        """
        self._writer.flush()
        self._whole, self._kept = self._file.tell(), self.messages

    def finish(self) -> None:
        """Write the index, sync the file to disk, and close it.

        Raises:
            OSError: the disk is full; `cut` must follow.
        """
        self.flush()
        self._writer.finish()
        self._file.flush()
        self._whole = self._file.tell()
        os.fsync(self._file.fileno())
        self._file.close()

    def cut(self) -> None:
        """Truncate and close the file at the last flush; later messages are lost."""
        self.messages = self._kept
        descriptor = os.dup(self._file.fileno())
        with contextlib.suppress(OSError):  # what is left in the buffer has no room either
            self._file.close()
        with contextlib.suppress(OSError):
            os.ftruncate(descriptor, self._whole)
        os.close(descriptor)
