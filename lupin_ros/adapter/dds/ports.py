"""Counts the participants of DDS on this machine by their ports.

The ports of a domain are computed from its number (DDSI-RTPS 9.6.1.1), and the kernel has a table of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

TABLES = (Path("/proc/net/udp"), Path("/proc/net/udp6"))

#: Ports of domain 0 begin here; each domain has as many; participant n listens for others at offset 10 + 2n.
PORT_BASE, PORTS_PER_DOMAIN, FIRST_OFFSET = 7400, 250, 10
#: This machine's address for itself, as these tables write it.
LOOPBACK = {"0100007F", "00000000000000000000000001000000"}


def participants(domain: int, tables: Iterable[Path] = TABLES) -> int | None:
    """Return the number of participants of `domain` on this machine; None when that cannot be read."""
    return len(_listening(domain, tables)) or None


def exposed(domain: int, tables: Iterable[Path] = TABLES) -> int:
    """Return the number of participants of `domain` on this machine that also listen to other computers."""
    addresses = _listening(domain, tables).values()
    return sum(1 for bound in addresses if not bound <= LOOPBACK)


def _listening(domain: int, tables: Iterable[Path]) -> dict[int, set[str]]:
    """Return the addresses at which each participant of `domain` is found, as the kernel writes them."""
    first = PORT_BASE + PORTS_PER_DOMAIN * domain + FIRST_OFFSET
    found: dict[int, set[str]] = {}
    for table in tables:
        for address, port in _bound_ports(table):
            number, rest = divmod(port - first, 2)
            if not rest and 0 <= port - first < PORTS_PER_DOMAIN - FIRST_OFFSET:
                found.setdefault(number, set()).add(address)
    return found


def _bound_ports(table: Path) -> Iterator[tuple[str, int]]:
    try:
        lines = table.read_text().splitlines()[1:]
    except OSError:
        return
    for line in lines:
        address, _, port = line.split()[1].rpartition(":")
        yield address, int(port, 16)
