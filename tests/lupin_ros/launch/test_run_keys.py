"""`lupin run` on a terminal: keys command the mission, and what was answered is shown."""

from __future__ import annotations

import fcntl
import os
import pty
import re
import struct
import subprocess
import sys
import termios
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from lupin_harness.domains import claimed_domain
from tests.lupin_ros.launch.processes import PATIENCE, until

pytest.importorskip("greenhouse_sim", reason="mdp-greenhouse is not installed here")
pytestmark = pytest.mark.timeout(240)

#: Tags at the other end of the greenhouse: on the way there is time to press keys.
FAR = "21,22"
_CODES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


class Terminal:
    """A command on a terminal of 120 by 40 cells, whose keys are pressed and whose screen is read."""

    def __init__(self, *command: str) -> None:
        self._master, slave = pty.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 40, 120, 0, 0))
        self.process = subprocess.Popen(
            [sys.executable, "-m", "lupin_cli.main", *command],
            stdin=slave,
            stdout=slave,
            stderr=slave,
            env={**os.environ, "TERM": "xterm-256color"},
            start_new_session=True,
        )
        os.close(slave)
        self._shown = ""
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        while True:
            try:
                read = os.read(self._master, 65536)
            except OSError:  # the command has ended
                return
            self._shown += read.decode("utf-8", "replace")

    @property
    def text(self) -> str:
        """All that was shown so far, without colours."""
        return _CODES.sub("", self._shown)

    def until(self, part: str) -> None:
        """Wait until something has been shown."""
        until(lambda: part in self.text or self.process.poll() is not None, f"{part!r} is shown")
        assert part in self.text, self.text[-4000:]

    def press(self, keys: str, answer: str) -> None:
        """Press keys at once, and wait for what is shown of them."""
        os.write(self._master, keys.encode())
        self.until(answer)

    def end(self) -> int:
        """Wait for the end and return the exit code."""
        code = self.process.wait(PATIENCE)
        self._reader.join(PATIENCE)
        return code

    def close(self) -> None:
        """End the command, however it stands."""
        if self.process.poll() is None:
            self.process.terminate()
            self.process.wait(PATIENCE)
        self._reader.join(PATIENCE)
        os.close(self._master)


@pytest.fixture
def terminal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Terminal]:
    """A run to far tags."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    with claimed_domain() as domain:
        given = ("--tags", FAR, "--domain", str(domain), "--log-dir", str(tmp_path / "logs"))
        terminal = Terminal("run", "inspection", *given)
        yield terminal
        terminal.close()


@pytest.mark.long
def test_a_mission_by_its_keys(terminal: Terminal) -> None:
    """Paused, resumed, refused with the reason, skipped, and ended by two presses; the robot comes home."""
    terminal.until("keys: a abort (twice), d dock, p pause, r resume, s skip, 1-9 answer, ? this line")
    terminal.until("NAVIGATING")
    terminal.press("r", "r: resume is not possible in INSPECTING NAVIGATING because nothing is")
    terminal.press("p", "p: pause accepted")
    terminal.until("for r or lupin resume, or Ctrl-C")
    terminal.press("r", "r: resume accepted")
    terminal.press("s", "s: skip_current accepted")
    terminal.until("tag 22")
    terminal.press("a", "a once more within 3 s: abort")
    terminal.press("aa", "a: abort accepted")
    assert terminal.end() == 1, terminal.text
    assert "DONE: 2 skipped of 2 targets" in terminal.text
