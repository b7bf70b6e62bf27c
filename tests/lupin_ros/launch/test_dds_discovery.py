"""When everybody has been seen: time alone does not tell, nor does the first look after a standstill."""

from __future__ import annotations

from pathlib import Path

import pytest

from lupin_ros.adapter.dds.ports import exposed, participants
from lupin_ros.launch import dds_discovery
from lupin_ros.launch.dds_discovery import LIMIT_S, QUIET_S, settled

TICK_S = 0.05


class Network:
    """Nodes that appear at their times; `stands` is when who looks is not let work, and for how long."""

    def __init__(self, appear: dict[str, float], stands: tuple[float, float] = (-1.0, 0.0)) -> None:
        self.now = 0.0
        self._appear = appear
        self._stands, self._seconds = stands

    def monotonic(self) -> float:
        """Return the time."""
        return self.now

    def spin(self) -> None:
        """Let time go by."""
        before = self.now
        self.now += TICK_S
        if before <= self._stands < self.now:
            self.now += self._seconds
            # What came meanwhile is still to be worked off.
            late = {node: max(at, self.now + TICK_S) for node, at in self._appear.items() if at > before}
            self._appear |= late

    def strangers(self) -> int:
        """Return how many have appeared."""
        return len(self.look())

    def look(self) -> frozenset[str]:
        """Return the nodes that have appeared."""
        return frozenset(node for node, at in self._appear.items() if at <= self.now)


def seen(network: Network, monkeypatch: pytest.MonkeyPatch, there: int) -> frozenset[str]:
    """Return who is seen where the machine has so many participants, the one who looks among them."""
    monkeypatch.setattr(dds_discovery, "time", network)
    monkeypatch.setattr(dds_discovery, "participants", lambda domain: there)
    monkeypatch.setattr(dds_discovery, "is_local_only", lambda: True)
    return settled(network)


def test_nothing_new_for_a_moment_is_everybody(monkeypatch: pytest.MonkeyPatch) -> None:
    """Later ones are not waited for."""
    network = Network({"a": 0.1, "b": 0.3, "late": 5.0})
    assert seen(network, monkeypatch, there=3) == {"a", "b"}
    assert network.now == pytest.approx(0.3 + QUIET_S, abs=2 * TICK_S)


def test_who_holds_a_port_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """However long nothing is new, up to the limit."""
    assert seen(Network({"a": 0.1, "b": 3.0}), monkeypatch, there=3) == {"a", "b"}
    network = Network({"a": 0.1})
    assert seen(network, monkeypatch, there=3) == {"a"}
    assert network.now == pytest.approx(LIMIT_S, abs=2 * TICK_S)


def test_the_first_look_after_a_standstill_is_not_trusted(monkeypatch: pytest.MonkeyPatch) -> None:
    """The process was not let work, nor were its threads that hear of others: nothing new says nothing."""
    network = Network({"a": 0.0, "a again": 0.2}, stands=(0.1, 1.0))
    assert seen(network, monkeypatch, there=2) == {"a", "a again"}


def test_a_participant_that_listens_to_others_is_told_from_one_that_does_not(tmp_path: Path) -> None:
    """By the kernel's table: domain 1 has its first participant at port 7660, the next at 7662."""
    table = tmp_path / "udp"
    rows = [
        "0100007F:1DEC",
        "00000000:1DEE",
        "0100007F:1DF0",
        "0501A8C0:1DF0",
        "00000000:1DED",
        "00000000:0035",
    ]
    table.write_text("head\n" + "".join(f"  {n}: {row} 00000000:0000\n" for n, row in enumerate(rows)))
    assert (participants(1, [table]), exposed(1, [table])) == (3, 2)
    assert (participants(2, [table]), exposed(2, [table])) == (None, 0)
