"""How old a request is: differences of clocks, at moments that the test says."""

from __future__ import annotations

import pytest

from lupin_engine.runtime.client_clocks import (
    APART_S,
    MAX_CLIENTS,
    MAX_DIFFERENCES,
    REMEMBERED_S,
    STALE_AFTER_S,
    ClientClocks,
)

WALL = 1.8e9
HOUR = 3600.0


class Desk:
    """Requests of clients whose clocks are behind, or ahead, by so much."""

    def __init__(self) -> None:
        self.clocks = ClientClocks()

    def age(self, now: float, behind: float = 0.0, late: float = 0.0, client: str = "ann") -> float:
        """Return the age of a request that comes at `now` and was under way for `late` seconds."""
        return self.clocks.age(client, WALL + now - late - behind, WALL + now, now)

    def taken(self, now: float, behind: float = 0.0, late: float = 0.0, client: str = "ann") -> bool:
        return self.age(now, behind, late, client) <= STALE_AFTER_S


@pytest.mark.parametrize("behind", [0.0, HOUR, -HOUR])
@pytest.mark.parametrize("client", ["ann", ""])
def test_a_late_request_of_a_known_client_is_old_whatever_its_clock_says(behind: float, client: str) -> None:
    desk = Desk()
    desk.taken(0.0, behind, client=client)
    assert desk.taken(APART_S, behind, client=client)
    assert desk.age(100.0, behind, late=30.0, client=client) == pytest.approx(30.0, abs=1e-3)
    assert desk.taken(101.0, behind, client=client)
    assert desk.taken(150.0, behind, late=4.9, client=client)
    assert not desk.taken(151.0, behind, late=9.0, client=client), "a late one moves nothing"


def test_a_clock_that_is_behind_is_believed_the_second_time() -> None:
    """Old by the clocks on the wall, until another request shows the same."""
    desk = Desk()
    assert desk.age(0.0, HOUR) == pytest.approx(HOUR)
    assert not desk.taken(APART_S - 0.1, HOUR)
    assert desk.taken(APART_S, HOUR)
    assert desk.taken(APART_S + 1.0, HOUR)


def test_what_waited_for_a_broken_link_is_not_believed() -> None:
    """All that was sent meanwhile comes together, or each with another delay."""
    desk = Desk()
    assert not desk.taken(40.0, late=30.0)
    assert not desk.taken(40.1, late=28.0)
    assert not desk.taken(40.2, late=10.0)
    assert not desk.taken(43.0, late=31.0)
    assert desk.taken(44.0)
    assert not desk.taken(60.0, late=10.0)


def test_those_without_a_name_do_not_speak_for_each_other() -> None:
    """One whose clock is an hour behind lets no late request of another one in."""
    desk = Desk()
    assert desk.taken(0.0, client="")
    desk.taken(1.0, HOUR, client="")
    assert desk.taken(1.0 + APART_S, HOUR, client="")
    assert not desk.taken(10.0, late=30.0, client="")
    assert not desk.taken(10.0, HOUR, late=30.0, client="")
    assert desk.taken(11.0, HOUR, client="")
    assert desk.taken(11.0, client="")


def test_a_clock_that_is_set_is_another_one() -> None:
    desk = Desk()
    assert desk.taken(0.0)
    assert desk.taken(1.0, -HOUR), "ahead: nothing says that it is old"
    assert not desk.taken(2.0, HOUR)
    assert desk.taken(2.0 + APART_S, HOUR)


def test_our_own_clock_may_be_set() -> None:
    """A client that was heard is known by the steady clock; the one on the wall is not asked any more."""
    clocks = ClientClocks()
    assert clocks.age("ann", WALL, WALL, 0.0) == 0.0
    assert clocks.age("ann", WALL + 10.0, WALL + HOUR, 10.0) == pytest.approx(0.0)
    assert clocks.age("bob", WALL + 10.0, WALL + HOUR, 10.0) == pytest.approx(HOUR, abs=11.0)


def test_what_is_remembered_is_bounded() -> None:
    """In time, in clients, and in what is known of one."""
    desk = Desk()
    desk.taken(0.0, HOUR)
    assert desk.taken(APART_S, HOUR)
    assert not desk.taken(APART_S + REMEMBERED_S + 0.1, HOUR), "nothing is known any more"
    for number in range(MAX_CLIENTS):
        desk.taken(400.0, client=f"client {number}")
    assert len(desk.clocks._clients) == MAX_CLIENTS
    for number in range(2 * MAX_DIFFERENCES):
        desk.taken(400.0, behind=-10.0 * number)
    assert len(desk.clocks._clients["ann"].believed) == MAX_DIFFERENCES
