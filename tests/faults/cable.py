"""A cable between two computers that can be cut, lose packets and delay them.

`cable.py END END` makes two network interfaces and carries frames between them until its input ends. Each
line of its input is JSON: {"loss": SHARE, "delay": SECONDS}; a loss of 1 is a cut. (Not every kernel has
netem, which does the same.)
"""

from __future__ import annotations

import contextlib
import fcntl
import heapq
import json
import os
import random
import select
import struct
import subprocess
import sys
import time

from tests.lupin_ros.computers import Computers, NoComputers

#: From linux/if_tun.h.
_TUNSETIFF, _TAP, _NO_INFO = 0x400454CA, 0x0002, 0x1000
_FRAME = 65_536


class FaultyComputers(Computers):
    """Two computers whose cable can be faulty."""

    def __init__(self) -> None:
        super().__init__()
        self._cable: subprocess.Popen[str] | None = None

    def lay_cable(self) -> None:
        """Start the process that is the cable."""
        line = [sys.executable, "-m", "tests.faults.cable", *self.ends]
        self._cable = subprocess.Popen(line, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert self._cable.stdout is not None
        if self._cable.stdout.readline().strip() != "laid":
            raise NoComputers("no cable between them: /dev/net/tun cannot be used")

    def remove(self) -> None:
        """Take them away."""
        if self._cable is not None:
            self._cable.communicate()
            self._cable = None
        super().remove()

    @property
    def control(self) -> int:
        """The descriptor by which the cable is told how it is."""
        assert self._cable is not None
        assert self._cable.stdin is not None
        return self._cable.stdin.fileno()


def tell(control: int, loss: float = 0.0, delay: float = 0.0) -> None:
    """Say how a cable is from now on."""
    os.write(control, (json.dumps({"loss": loss, "delay": delay}) + "\n").encode())


def _tap(name: str) -> int:
    end = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(end, _TUNSETIFF, struct.pack("16sH", name.encode(), _TAP | _NO_INFO))
    return end


def carry(ends: list[int]) -> None:
    """Carry frames from each end to the other one until the input ends."""
    loss, delay = 0.0, 0.0
    waiting: list[tuple[float, int, int, bytes]] = []
    count = 0
    while True:
        left = max(0.0, waiting[0][0] - time.monotonic()) if waiting else None
        ready, _, _ = select.select([*ends, sys.stdin], [], [], left)
        if sys.stdin in ready:
            line = os.read(sys.stdin.fileno(), 4096).decode().splitlines()
            if not line:
                return
            told = json.loads(line[-1])
            loss, delay = told["loss"], told["delay"]
        for number, end in enumerate(ends):
            if end in ready:
                frame = os.read(end, _FRAME)
                if random.random() >= loss:
                    count += 1
                    heapq.heappush(waiting, (time.monotonic() + delay, count, ends[1 - number], frame))
        while waiting and waiting[0][0] <= time.monotonic():
            _, _, to, frame = heapq.heappop(waiting)
            with contextlib.suppress(OSError):  # the other computer is not up yet, or gone
                os.write(to, frame)


if __name__ == "__main__":
    found = [_tap(name) for name in sys.argv[1:]]
    print("laid", flush=True)
    carry(found)
