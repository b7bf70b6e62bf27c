"""Two computers on this machine: network namespaces with a cable between them, each with its shared memory.

They need root. Nothing is left behind, however the process that made them ends: they have no names.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import uuid
from collections.abc import Iterator
from contextlib import contextmanager

#: Addresses of the two.
ADDRESSES = ("10.213.77.1", "10.213.77.2")
#: What keeps a computer there until its input is closed.
_THERE = "mount -t tmpfs tmpfs /dev/shm && ip link set lo up && echo up && exec cat"


class NoComputers(Exception):
    """They cannot be made here; the text says why."""


def ip(*arguments: str) -> None:
    """Run `ip`.

    Raises:
        NoComputers: it is not allowed.
    """
    done = subprocess.run(["ip", *arguments], capture_output=True, text=True)
    if done.returncode:
        raise NoComputers(f"no network namespaces here: ip {' '.join(arguments)}: {done.stderr.strip()}")


class Computers:
    """Two computers with a cable between them."""

    def __init__(self) -> None:
        mark = uuid.uuid4().hex[:6]
        self.ends = tuple(f"lu{mark}{side}" for side in "ab")
        self._anchors: list[subprocess.Popen[str]] = []

    def connect(self) -> None:
        """Make them.

        Raises:
            NoComputers: that is not allowed here.
        """
        if os.geteuid() or not shutil.which("ip") or not shutil.which("unshare"):
            raise NoComputers("no network namespaces here: they need root, ip and unshare")
        for _ in ADDRESSES:
            self._anchors.append(_anchor())
        self.lay_cable()
        for anchor, end, address in zip(self._anchors, self.ends, ADDRESSES, strict=True):
            ip("link", "set", end, "netns", str(anchor.pid))
            there = ["nsenter", "-t", str(anchor.pid), "-n", "ip"]
            for words in (["address", "add", f"{address}/24", "dev", end], ["link", "set", end, "up"]):
                subprocess.run([*there, *words], check=True)

    def lay_cable(self) -> None:
        """Make the two ends of the cable."""
        ip("link", "add", self.ends[0], "type", "veth", "peer", "name", self.ends[1])

    def remove(self) -> None:
        """Take them away, and the cable with them."""
        for anchor in self._anchors:
            anchor.communicate()
        self._anchors.clear()

    def enter(self, number: int) -> None:
        """Have this process, and what it starts, be on one of them; it has no threads yet."""
        here = os.getcwd()
        libc = ctypes.CDLL(None, use_errno=True)
        for kind in ("net", "mnt"):
            with open(f"/proc/{self._anchors[number].pid}/ns/{kind}") as space:
                if libc.setns(space.fileno(), 0):
                    raise NoComputers(f"no network namespaces here: {os.strerror(ctypes.get_errno())}")
        os.chdir(here)

    def on(self, number: int, *command: str) -> list[str]:
        """Return the command line that runs a command on one of them."""
        return [
            "nsenter",
            "-t",
            str(self._anchors[number].pid),
            "-n",
            "-m",
            f"--wd={os.getcwd()}",
            "--",
            *command,
        ]


def _anchor() -> subprocess.Popen[str]:
    line = ["unshare", "-n", "-m", "sh", "-c", _THERE]
    anchor = subprocess.Popen(
        line, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert anchor.stdout is not None
    if anchor.stdout.readline().strip() != "up":
        raise NoComputers(f"no network namespaces here: {anchor.communicate()[1].strip()}")
    return anchor


@contextmanager
def connected(computers: Computers) -> Iterator[Computers]:
    """Two computers, for as long as the context lasts."""
    try:
        computers.connect()
        yield computers
    finally:
        computers.remove()
