"""How many participants of a ROS domain there are on this machine, told by the ports that they hold.

Discovery gives no sign of being complete: on a busy machine the first nodes appear at once and the last a
second later, and whoever looks too early starts a second robot. The ports of a domain are computed from its
number (DDSI-RTPS 9.6.1.1), so the kernel's table says how many participants are still to be discovered.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

TABLES = (Path("/proc/net/udp"), Path("/proc/net/udp6"))

#: Ports of domain 0 begin here; each domain has as many; participant n listens for others at offset 10 + 2n.
PORT_BASE, PORTS_PER_DOMAIN, FIRST_OFFSET = 7400, 250, 10


def participants(domain: int, tables: Iterable[Path] = TABLES) -> int | None:
    """Return how many participants of `domain` this machine has; None when that cannot be seen."""
    base = PORT_BASE + PORTS_PER_DOMAIN * domain
    offsets = {port - base for table in tables for port in _bound_ports(table)}
    found = sum(1 for o in offsets if FIRST_OFFSET <= o < PORTS_PER_DOMAIN and (o - FIRST_OFFSET) % 2 == 0)
    return found or None


def _bound_ports(table: Path) -> Iterator[int]:
    try:
        lines = table.read_text().splitlines()[1:]
    except OSError:
        return
    for line in lines:
        yield int(line.split()[1].rpartition(":")[2], 16)
