"""Publishes diagnostics of a node once a second on /diagnostics of its namespace, by REP 107.

The status of the node, by its full name, has processor time, memory and uptime of the process; the same and
the free disk of the machine; and the publishing rate of each topic. Each trouble has a status of its own,
`NODE: SUBJECT`, with its code, cause and advice; once over, it is reported as OK. So has a shortage of the
machine. The status of the node has the worst level of all, and their texts.
"""

from __future__ import annotations

import os
import shutil
import socket
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node
from rclpy.publisher import Publisher

from lupin_engine.errors import Severity
from lupin_engine.plugin import Code, user_folder
from lupin_ros.adapter.frames import FramePrefix
from lupin_ros.adapter.qos import Qos

#: The standard topic of diagnostics.
DIAGNOSTICS_TOPIC = "/diagnostics"
#: Seconds between two reports.
REPORT_S = 1.0
#: Less than this share of the machine's memory, or less than so many bytes of its disk, is a warning.
LITTLE_MEMORY, LITTLE_DISK = 0.05, 1e9
#: The text of the last report of a node that ends properly, and of a subject without trouble.
ENDED, FINE = "ended", "no trouble"
LEVELS = (DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR)
#: The subject of what the machine lacks, and its code.
MACHINE = "machine"
SHORT = Code(
    "machine_short", "the machine is short of something", advice="Remove old recordings and journals."
)

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


@dataclass(frozen=True)
class Trouble:
    """Something that is wrong, or was: then without a problem. The code has the severity and the advice."""

    problem: str
    code: Code

    @property
    def level(self) -> bytes:
        """Its level of a DiagnosticStatus."""
        is_error = self.code.severity is Severity.ERROR
        return bytes(LEVELS[is_error + 1 if self.problem else 0])

    @property
    def values(self) -> Mapping[str, str]:
        """What a person needs to know about it."""
        found = {"code": self.code.name, "cause": self.problem, "advice": self.code.advice}
        return {key: value for key, value in found.items() if value and self.problem}


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
        #: The troubles that there are or were, by their subject.
        self.troubles = {MACHINE: Trouble("", SHORT)}

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
        self.trouble(MACHINE, "; ".join(shortages(memory, disk.free)), SHORT)
        level = max(each.level for each in self.troubles.values())
        problems = [each.problem for each in self.troubles.values() if each.problem]
        self._publish(level, "; ".join(problems) or "running", values)

    def trouble(self, about: str, problem: str, code: Code) -> None:
        """Report a trouble from now on; '' when it is over."""
        if problem or about in self.troubles:
            self.troubles[about] = Trouble(problem, code)

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
        array.status = [self._status(level, name, message, values)]
        for about, each in self.troubles.items():
            own = level if level == DiagnosticStatus.STALE else each.level
            array.status.append(self._status(own, f"{name}: {about}", each.problem or FINE, each.values))
        self._publisher.publish(array)

    def _status(self, level: bytes, name: str, message: str, values: Mapping[str, str]) -> DiagnosticStatus:
        pairs = [KeyValue(key=key, value=value) for key, value in values.items()]
        return DiagnosticStatus(level=level, name=name, message=message, hardware_id=self._host, values=pairs)


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
