"""Supervises child processes: starts them in groups of their own, detects deaths, and stops all.

Each child leads a session of its own, so Ctrl-C in the terminal reaches the supervisor only, which then stops
them in order. A child ends with its supervisor however that ends (see `ros.adapter.process`). Nothing here
knows ROS.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from lupin_ros.adapter.process import SUPERVISED
from lupin_ros.launch import shared_memory

#: How large the log of a process becomes before it is begun anew, in bytes; the one before is kept.
LOG_BYTES = 10_000_000
#: Lines of its log that are shown when a process has died.
SHOWN_LINES = 12
#: Period of the check of a stopping process, in seconds.
POLL_S = 0.02


@dataclass(frozen=True)
class Death:
    """A process that ended by itself."""

    name: str
    code: int
    log: Path
    last_lines: tuple[str, ...]

    @property
    def how(self) -> str:
        """How it ended."""
        killed = self.code < 0
        return f"was killed by {_signal_name(-self.code)}" if killed else f"ended with exit code {self.code}"

    def __str__(self) -> str:
        return f"{self.name} {self.how}; its log is {self.log}"

    @property
    def text(self) -> str:
        """A sentence about the death, and the last lines of the log below it."""
        return "\n".join([str(self), *(f"  | {line}" for line in self.last_lines)])


@dataclass(frozen=True)
class Patience:
    """Seconds that a process gets after each signal: SIGINT, SIGTERM, SIGKILL; None: it is not sent."""

    interrupt: float | None = 5.0
    terminate: float | None = 3.0
    kill: float = 3.0


#: The patience after a second Ctrl-C.
IMPATIENT = Patience(interrupt=0.5, terminate=0.5, kill=3.0)


@dataclass
class _Child:
    name: str
    command: Sequence[str]
    process: subprocess.Popen[bytes]
    log: Path
    reported: bool = False
    segments: frozenset[str] = field(default_factory=frozenset)


class Supervisor:
    """Starts, watches and stops processes; one log file each in `folder`."""

    def __init__(self, folder: Path, environment: Mapping[str, str]) -> None:
        """Make a supervisor without processes; all get the variables of `environment`."""
        self.folder = folder
        self._environment = {**environment, SUPERVISED: "1"}
        self._children: list[_Child] = []

    @property
    def names(self) -> list[str]:
        """The processes that are running, in the order of their start."""
        return [child.name for child in self._children if child.process.poll() is None]

    def start(self, name: str, command: Sequence[str]) -> int:
        """Start a process and return its id; its output goes to `NAME.log`."""
        log = self.folder / f"{name}.log"
        with log.open("ab") as output:
            process = subprocess.Popen(
                list(command),
                stdin=subprocess.PIPE,  # the lifeline: never written to
                stdout=output,
                stderr=subprocess.STDOUT,
                env=self._environment,
                start_new_session=True,
            )
        self._children.append(_Child(name, command, process, log))
        return process.pid

    def start_again(self, name: str) -> int:
        """Start an ended process with the same command and place in the order; its log is continued."""
        child = next(c for c in self._children if c.name == name and c.process.poll() is not None)
        place = self._children.index(child)
        _close_lifeline(child)
        pid = self.start(name, child.command)
        self._children[place] = self._children.pop()
        return pid

    def deaths(self) -> list[Death]:
        """Return the processes that have ended by themselves since the last call."""
        found = []
        for child in self._children:
            code = child.process.poll()
            if code is None or child.reported:
                continue
            child.reported = True
            shared_memory.remove(child.segments)
            found.append(Death(child.name, code, child.log, last_lines(child.log)))
        return found

    def cut_logs(self) -> None:
        """Rotate logs that have become too large."""
        for child in self._children:
            cut_log(child.log)

    def note_segments(self) -> None:
        """Record the shared memory that each process uses, to remove it if the process is killed."""
        for child in self._children:
            if child.process.poll() is None:
                child.segments = shared_memory.segments_of(child.process.pid) or child.segments

    def stop(self, patience: Patience | Callable[[], Patience] = Patience()) -> list[str]:
        """Stop all processes, the last one first; return the names of those that had to be killed.

        `patience` may be a function, which is called again while waiting, so that a second Ctrl-C shortens
        it.
        """
        ask = patience if callable(patience) else lambda: patience
        killed = [child.name for child in reversed(self._children) if _stop(child, ask)]
        self._children.clear()
        return killed

    def __enter__(self) -> Supervisor:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop(IMPATIENT)


def _stop(child: _Child, patience: Callable[[], Patience]) -> bool:
    """End a child and its whole group; return whether it took a SIGKILL."""
    child.segments = shared_memory.segments_of(child.process.pid) or child.segments
    killed = False
    steps: tuple[tuple[signal.Signals, Callable[[], float | None]], ...] = (
        (signal.SIGINT, lambda: patience().interrupt),
        (signal.SIGTERM, lambda: patience().terminate),
        (signal.SIGKILL, lambda: patience().kill),
    )
    for number, allowed in steps:
        if _is_over(child):
            break
        if allowed() is None:
            continue
        killed = number is signal.SIGKILL
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(child.process.pid, number)
        _wait(lambda: _is_over(child), allowed)
    _close_lifeline(child)
    if killed:
        shared_memory.remove(child.segments)
    return killed


def _close_lifeline(child: _Child) -> None:
    if child.process.stdin is not None:
        child.process.stdin.close()


def _is_over(child: _Child) -> bool:
    """Return whether the child and its whole group have ended."""
    ended = child.process.poll() is not None
    return ended and not group_lives(child.process.pid)


def group_lives(group: int) -> bool:
    """Return whether a process group still has a process (a zombie of ours does not count)."""
    try:
        os.killpg(group, 0)
    except (ProcessLookupError, PermissionError):
        return False
    return True


def _wait(condition: Callable[[], bool], allowed: Callable[[], float | None]) -> None:
    begin = time.monotonic()
    while not condition() and time.monotonic() - begin < (allowed() or 0.0):
        time.sleep(POLL_S)


def cut_log(log: Path, most: int = LOG_BYTES) -> None:
    """Copy a log of more than `most` bytes to `NAME.1` and truncate it, while its process goes on writing."""
    with contextlib.suppress(OSError):
        if log.stat().st_size <= most:
            return
        with contextlib.suppress(OSError):  # on a full disk room is what counts
            shutil.copyfile(log, log.with_name(f"{log.name}.1"))
        os.truncate(log, 0)


def last_lines(log: Path, count: int = SHOWN_LINES) -> tuple[str, ...]:
    """Return the last non-empty lines of a log."""
    try:
        with log.open("rb") as file:
            file.seek(max(0, file.seek(0, os.SEEK_END) - 16_384))
            text = file.read().decode(errors="replace")
    except OSError:
        return ()
    return tuple([line.rstrip() for line in text.splitlines() if line.strip()][-count:])


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
