"""Claims ROS domains for tests, each for one process of this machine, by binding a local port."""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import Iterator

#: DDS derives ports from the domain; on Linux they are free for domains up to 101.
FIRST_DOMAIN, DOMAINS = 20, 80
#: A bound port stands for a claimed domain: it is given back when the process ends, however it ends.
FIRST_LOCK_PORT = 47_000


@contextlib.contextmanager
def claimed_domain() -> Iterator[int]:
    """Claim a free ROS domain from 20 to 99 for the block; AssertionError if all are taken."""
    with contextlib.ExitStack() as stack:
        for step in range(DOMAINS):
            domain = FIRST_DOMAIN + (os.getpid() + step) % DOMAINS
            lock = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_STREAM))
            try:
                lock.bind(("127.0.0.1", FIRST_LOCK_PORT + domain))
            except OSError:
                continue
            yield domain
            return
        raise AssertionError("every ROS domain of this machine is taken")
