"""Detects the end of DDS discovery: every participant that holds a port of the domain has been seen.

Discovery gives no sign of being complete: on a busy machine the first nodes appear at once and the last a
second later, and a launcher that looks too early starts a second robot. The ports of a domain are computed
from its number (DDSI-RTPS 9.6.1.1), so the kernel's table gives the number of participants on this machine.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Protocol, TypeVar

from lupin_ros.launch.environment import current_domain, is_local_only

_T = TypeVar("_T", covariant=True)

TABLES = (Path("/proc/net/udp"), Path("/proc/net/udp6"))

#: Ports of domain 0 begin here; each domain has as many; participant n listens for others at offset 10 + 2n.
PORT_BASE, PORTS_PER_DOMAIN, FIRST_OFFSET = 7400, 250, 10
#: This machine's address for itself, as these tables write it.
LOOPBACK = {"0100007F", "00000000000000000000000001000000"}

#: The network is looked at until nothing new has appeared for this long; other machines get this long to
#: appear; and no look takes longer than this. In seconds.
QUIET_S, LOOK_S, LIMIT_S = 0.3, 2.0, 6.0
#: So many looks in a row without anything new are quiet as well: a process that was not let work for a while
#: sees at its first look what it saw before, however long that was.
QUIET_LOOKS = 6


class NetworkView(Protocol[_T]):
    """A node that observes the graph."""

    def spin(self) -> None:
        """Spin it for a moment."""

    def look(self) -> _T:
        """Return a snapshot of the graph."""

    def strangers(self) -> int:
        """Return the number of participants besides its own."""


def settled(onlooker: NetworkView[_T]) -> _T:
    """Spin until all participants of this machine are known and nothing new appears, at most `LIMIT_S`.

    Return the last snapshot.
    """
    begin = changed = time.monotonic()
    seen, looks = onlooker.look(), 0
    while (now := time.monotonic()) - begin < LIMIT_S:
        quiet = now - changed >= QUIET_S and looks >= QUIET_LOOKS
        if quiet and _all_known(onlooker.strangers(), now - begin):
            break
        onlooker.spin()
        found, looks = onlooker.look(), looks + 1
        if found != seen:
            seen, changed, looks = found, now, 0
    return seen


def _all_known(strangers: int, looked: float) -> bool:
    """Whether discovery has had enough time and found as many participants as this machine has."""
    there = participants(current_domain())
    if there is None:
        return looked >= LOOK_S
    # Our own participant is among them.
    return strangers >= there - 1 and (is_local_only() or looked >= LOOK_S)


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
