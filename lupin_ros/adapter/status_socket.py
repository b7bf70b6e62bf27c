"""Lets programs of this user and machine read what a node publishes, without joining the network.

An abstract Unix socket: it belongs to one network namespace, as DDS does, and is gone with its process, so
that nothing stale can be found. Its name is a hash of the settings that decide which nodes reach each other.
Both sides refuse another user. It only sends: it reads nothing.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import queue
import socket
import struct
import threading
from typing import Any, Protocol

from lupin_engine import __version__
from lupin_engine.plugin import robot_namespace, ros_domain
from lupin_ros.adapter.dds.profile import CLOSED, RANGE, users_profile
from lupin_ros.adapter.host import Host

#: How long each side waits for the other, in seconds.
PATIENCE_S = 1.0
_DECIDING = ("ROS_STATIC_PEERS", "ROS_DISCOVERY_SERVER", "RMW_IMPLEMENTATION", "ROS_SECURITY_ENABLE")


class StatusSource(Protocol):
    """A part of a node that knows what was published last."""

    def status(self) -> str:
        """Return what was published last, as JSON text."""


class StatusSocket:
    """Answers every client with the status of a part of the node, made on the node's thread.

    A node whose thread hangs does not answer. Where a socket cannot be opened, the network has to be asked.
    """

    def __init__(self, host: Host, published: StatusSource, robot: str = "") -> None:
        """`robot` is its namespace."""
        self._host = host
        self._published = published
        self._socket = socket.socket(socket.AF_UNIX)
        try:
            self._socket.bind(_name(robot))
            self._socket.listen()
        except OSError as problem:
            self._socket.close()
            host.log.warning("the state can be asked over ROS only", problem=str(problem))
            return
        threading.Thread(target=self._serve, name="status", daemon=True).start()

    def close(self) -> None:
        """Answer no more."""
        with contextlib.suppress(OSError):  # it is closed already
            self._socket.shutdown(socket.SHUT_RDWR)  # ends the thread, which closes it

    def _serve(self) -> None:
        with self._socket, contextlib.suppress(OSError):
            while True:
                connection, _ = self._socket.accept()
                with connection, contextlib.suppress(OSError, queue.Empty):
                    if _is_ours(connection):
                        connection.settimeout(PATIENCE_S)
                        connection.sendall(self._status().encode())

    def _status(self) -> str:
        """Return the status as of a turn of the node's thread.

        Raises:
            queue.Empty: it has no turn in time.
        """
        turn: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._host.post(lambda: turn.put(self._published.status()))
        return turn.get(timeout=PATIENCE_S)


def read_status() -> Any:
    """Return the status of this robot's node of this user, ROS domain and machine; None where none answers.

    Raises:
        UsageError: the environment names no ROS domain or robot that exists.
    """
    with socket.socket(socket.AF_UNIX) as connection:
        connection.settimeout(PATIENCE_S)
        try:
            connection.connect(_name(robot_namespace()))
            if not _is_ours(connection):
                return None
            return json.loads(b"".join(iter(lambda: connection.recv(65536), b"")))
        except (OSError, ValueError):  # nobody is there, or ends just now
            return None


def _name(robot: str = "") -> bytes:
    """Return the name of the socket for this user, engine, ROS domain, namespace and network."""
    network = [ros_domain(), robot, os.environ.get(RANGE) or CLOSED, users_profile()]
    deciding = [__version__, os.getuid(), *network, *(os.environ.get(name, "") for name in _DECIDING)]
    return b"\0lupin-status-" + hashlib.sha256(json.dumps(deciding).encode()).hexdigest().encode()


def _is_ours(connection: socket.socket) -> bool:
    """Return whether the process at the other end is of this user."""
    form = "3i"  # process, user, group
    about = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, struct.calcsize(form))
    return bool(struct.unpack(form, about)[1] == os.getuid())
