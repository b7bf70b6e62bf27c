"""`lupin run` as a separate process, watched from outside; every wait has a deadline."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import Any

#: Seconds that anything may take on a busy machine.
PATIENCE = 120.0


def until(condition: Callable[[], Any], what: str, limit: float = PATIENCE) -> None:
    """Wait for a condition of the outside world; fail with `what` after `limit` seconds."""
    end = time.monotonic() + limit
    pause = threading.Event()
    while not condition():
        assert time.monotonic() < end, f"not within {limit:g} s: {what}"
        pause.wait(0.02)


class Lupin:
    """A `lupin` command under way. All it starts carries a mark in its environment, so nothing can hide."""

    def __init__(self, *arguments: str, domain: int, log_dir: Path, read_until: str = "") -> None:
        """`read_until` is in the last line of its output that is read: then the pipe is closed."""
        self.domain = domain
        self.log_dir = log_dir
        self._read_until = read_until
        self.state = log_dir.parent / "state"
        self.mark = f"LUPIN_TEST={uuid.uuid4()}"
        name, _, value = self.mark.partition("=")
        options = ["--domain", str(domain)]
        if arguments[0] in ("run", "up"):
            options += ["--log-dir", str(log_dir)]
        self.process = subprocess.Popen(
            [sys.executable, "-m", "lupin_cli.main", *arguments, *options],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={
                **os.environ,
                "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
                "XDG_STATE_HOME": str(self.state),
                name: value,
            },
            start_new_session=True,
        )
        self.lines: list[str] = []
        self.errors: list[str] = []
        self._readers = [
            threading.Thread(target=self._read, args=(self.process.stdout, self.lines), daemon=True),
            threading.Thread(target=self._read, args=(self.process.stderr, self.errors), daemon=True),
        ]
        for reader in self._readers:
            reader.start()

    def _read(self, stream: Any, into: list[str]) -> None:
        with stream:
            for line in stream:
                into.append(line.rstrip("\n"))
                if self._read_until and self._read_until in line:
                    break

    @property
    def output(self) -> str:
        """All that was printed."""
        return "\n".join([*self.lines, "-- stderr --", *self.errors])

    def until_line(self, part: str, limit: float = PATIENCE) -> None:
        """Wait until a line has `part`; fail with the whole output when the process ends without."""

        def found() -> bool:
            ended = self.process.poll() is not None
            if any(part in line for line in [*self.lines, *self.errors]):
                return True
            assert not ended, f"ended without {part!r}:\n{self.output}"
            return False

        until(found, f"a line with {part!r}; so far:\n{self.output}", limit)

    def end(self, limit: float = PATIENCE) -> int:
        """Wait for the end and return the exit code."""
        try:
            code = self.process.wait(limit)
        except subprocess.TimeoutExpired:
            self.kill()
            raise AssertionError(f"still running after {limit:g} s:\n{self.output}") from None
        for reader in self._readers:
            reader.join(limit)
        return code

    def records(self, kind: str) -> list[dict[str, Any]]:
        """Return the JSON lines of one type."""
        try:
            found = [json.loads(line) for line in self.lines]
        except ValueError:
            raise AssertionError(f"there is a line that is no JSON:\n{self.output}") from None
        return [record for record in found if record["type"] == kind]

    def processes(self) -> dict[int, str]:
        """Return the living processes that carry our mark: id and command."""
        found = {}
        for entry in Path("/proc").glob("[0-9]*"):
            try:
                if self.mark.encode() in (entry / "environ").read_bytes().split(b"\0"):
                    found[int(entry.name)] = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode()
            except OSError:
                continue
        return found

    def pid_of(self, node: str) -> int:
        """Return the process id of a node that was started."""
        return next(pid for pid, line in self.processes().items() if f" node {node} " in line)

    def kill(self) -> None:
        """End everything that carries our mark."""
        for pid in self.processes():
            try:
                os.kill(pid, 9)
            except ProcessLookupError:
                continue
        self.process.wait(PATIENCE)
        for reader in self._readers:
            reader.join(PATIENCE)
