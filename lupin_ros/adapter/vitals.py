"""Publishes diagnostics of a node once a second on /diagnostics of its namespace, as a DiagnosticArray.

It has processor time, memory and uptime of the process; the same and the free disk of the machine; and the
publishing rate of each topic. It warns when memory or disk runs out, and of the node's own troubles.
"""

from __future__ import annotations

import os
import shutil
import socket
import time
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node
from rclpy.publisher import Publisher

from lupin_engine.plugin import user_folder
from lupin_ros.adapter.frames import FramePrefix
from lupin_ros.adapter.qos import Qos

#: The standard topic of diagnostics.
DIAGNOSTICS_TOPIC = "/diagnostics"
#: Seconds between two reports.
REPORT_S = 1.0
#: Less than this share of the machine's memory, or less than so many bytes of its disk, is a warning.
LITTLE_MEMORY, LITTLE_DISK = 0.05, 1e9
#: The text of the last report of a node that ends properly.
ENDED = "ended"

_PROC = Path("/proc")
_PAGE = os.sysconf("SC_PAGE_SIZE")


class CountedPublisher(Publisher):
    """A publisher that counts its messages, and gives their frames the node's prefix."""

    sent = 0
    frames = FramePrefix("")

    def publish(self, msg: Any) -> None:
        """Publish a message."""
        self.sent += 1
        super().publish(self.frames.outgoing(msg))


class Vitals:
    """The reports of one node; call `report` every `REPORT_S`, and `end` when it ends properly.

    The publisher is made with the first report: shorter programs have none.
    """

    def __init__(self, node: Node, topic: str, started: float) -> None:
        """`started` is when the node was made, of the clock that `report` gets."""
        self._node = node
        self._topic = topic
        self._started = started
        self._publisher: Publisher | None = None
        self._host = socket.gethostname()
        self._disk = nearest_folder(user_folder("XDG_STATE_HOME", ".local/state"))
        self._at, self._used, self._machine = started, time.process_time(), machine_ticks()
        self._sent: dict[str, int] = {}
        self._ended = False
        #: The node's own troubles, by their subject.
        self.troubles: dict[str, str] = {}

    def report(self, now: float) -> None:
        """Publish a report; `now` is of a steady clock, in seconds."""
        memory, disk = _machine_memory(), shutil.disk_usage(self._disk)
        values = {
            "pid": f"{os.getpid()}",
            "up (s)": f"{now - self._started:.0f}",
            **self._shares(now),
            "memory (MB)": f"{_own_memory() / 1e6:.1f}",
            "machine memory free (MB)": f"{memory.get('MemAvailable', 0) / 1e3:.0f}",
            "machine memory (MB)": f"{memory.get('MemTotal', 0) / 1e3:.0f}",
            "disk free (GB)": f"{disk.free / 1e9:.1f}",
            "disk (GB)": f"{disk.total / 1e9:.1f}",
        }
        warnings = [*self.troubles.values(), *shortages(memory, disk.free)]
        level = DiagnosticStatus.WARN if warnings else DiagnosticStatus.OK
        self._publish(level, "; ".join(warnings) or "running", values)

    def end(self) -> None:
        """Publish that the node ends properly, so that it is not missed; twice does no harm."""
        if self._publisher is not None and not self._ended:
            self._ended = True
            self._publish(DiagnosticStatus.STALE, ENDED, {})

    def _shares(self, now: float) -> dict[str, str]:
        """Return the shares of processor time since the last report, and the rates of the topics, in Hz."""
        seconds = max(now - self._at, 1e-3)
        used, machine, sent = time.process_time(), machine_ticks(), sent_by(self._node.publishers)
        busy, ticks = machine[0] - self._machine[0], machine[1] - self._machine[1]
        rates = {topic: (count - self._sent.get(topic, 0)) / seconds for topic, count in sent.items()}
        own = 100.0 * (used - self._used) / seconds
        self._at, self._used, self._machine, self._sent = now, used, machine, sent
        return {
            "processor (%)": f"{own:.1f}",
            "machine processor (%)": f"{100.0 * busy / ticks if ticks else 0.0:.0f}",
            **{f"{topic} (Hz)": f"{rate:.1f}" for topic, rate in sorted(rates.items())},
        }

    def _publish(self, level: bytes, message: str, values: Mapping[str, str]) -> None:
        if self._publisher is None:
            self._publisher = self._node.create_publisher(DiagnosticArray, self._topic, Qos.EVENT.profile())
        array = DiagnosticArray()
        array.header.stamp = self._node.get_clock().now().to_msg()
        name = self._node.get_fully_qualified_name()
        pairs = [KeyValue(key=key, value=value) for key, value in values.items()]
        array.status = [
            DiagnosticStatus(level=level, name=name, message=message, hardware_id=self._host, values=pairs)
        ]
        self._publisher.publish(array)


def sent_by(publishers: Iterable[Any]) -> dict[str, int]:
    """Return the number of messages of each topic, by the publishers that count."""
    found: dict[str, int] = {}
    for each in publishers:
        if isinstance(each, CountedPublisher):
            found[each.topic_name] = found.get(each.topic_name, 0) + each.sent
    return found


def shortages(memory: Mapping[str, int], disk_free: float) -> Iterable[str]:
    """Yield warnings of low memory and disk; memory in kB by the kernel's names, disk in bytes."""
    total, free = memory.get("MemTotal", 0), memory.get("MemAvailable", 0)
    if free < LITTLE_MEMORY * total:
        yield f"the memory of this machine is nearly used up: {free / 1e3:.0f} MB are left"
    if disk_free < LITTLE_DISK:
        yield f"the disk of this machine is nearly full: {disk_free / 1e9:.1f} GB are left"


def nearest_folder(folder: Path) -> Path:
    """Return a folder, or the nearest one above it that there is."""
    return next(each for each in (folder, *folder.parents) if each.is_dir())


def machine_ticks(stat: Path = _PROC / "stat") -> tuple[int, int]:
    """Return the ticks in which the machine was busy, and all of them, since it was switched on."""
    ticks = [int(word) for word in stat.read_text().partition("\n")[0].split()[1:9]]
    return sum(ticks) - ticks[3] - ticks[4], sum(ticks)  # without idle, and waiting for the disk


def _own_memory() -> int:
    return int((_PROC / "self" / "statm").read_text().split()[1]) * _PAGE


def _machine_memory() -> dict[str, int]:
    """Return the first lines of the kernel's table of memory, in kB: MemTotal, MemFree, MemAvailable."""
    with (_PROC / "meminfo").open(encoding="ascii") as lines:
        rows = (next(lines).split() for _ in range(3))
        return {name.rstrip(":"): int(size) for name, size, *_ in rows}
