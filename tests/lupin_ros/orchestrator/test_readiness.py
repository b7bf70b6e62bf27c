"""The engine's own plugin: waiting for the others, and telling that one of them has lost something."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, cast

import pytest

from lupin_engine.plugin.builtin import MISSING
from lupin_ros.orchestrator.readiness import POLL_PERIOD_S, POLLS_UNTIL_GONE, Readiness

NAV, BRIDGE = "action server navigate_to_pose", "service /greenhouse_bridge/get_tag_reading"


class Neighbour:
    """A driver that misses what it is told to."""

    def __init__(self) -> None:
        self.misses: list[str] = []

    def missing(self) -> list[str]:
        """What it waits for."""
        return self.misses

    def start(self, attempt: str, operation: str, arguments: Mapping[str, Any]) -> None:
        """Nobody asks for that here."""

    def cancel(self, attempt: str) -> None:
        """Nobody asks for that here."""

    def act(self, action: str, arguments: Mapping[str, Any]) -> None:
        """Nobody asks for that here."""

    def close(self) -> None:
        """Nothing is held."""


class Heard:
    """An outlet that keeps what is told."""

    def __init__(self) -> None:
        self.told: list[tuple[Any, ...]] = []

    def __getattr__(self, word: str) -> Callable[..., None]:
        """Keep whatever is told under its word."""
        return lambda *arguments: self.told.append((word, *arguments))

    def news(self) -> list[tuple[Any, ...]]:
        """Return what was told since the last question."""
        told, self.told = self.told, []
        return told


class Bench:
    """A readiness with two neighbours, whose timer is turned by hand."""

    def __init__(self, is_resumed: bool = False) -> None:
        self.nav, self.bridge, self.heard = Neighbour(), Neighbour(), Heard()
        self.period, self.running, self.time = 0.0, True, 100.0
        self.readiness = Readiness(self, cast(Any, self.heard), self, is_resumed)

    def in_use(self) -> list[Any]:
        """Return the neighbours."""
        return [self.nav, self.bridge]

    def now(self) -> float:
        """Return the time."""
        return self.time

    def steady_timer(self, period: float, callback: Callable[[], None]) -> Bench:
        """Keep the callback."""
        self.period, self._callback = period, callback
        return self

    def cancel(self) -> None:
        """The timer is ended."""
        self.running = False

    def poll(self, times: int = 1) -> list[tuple[Any, ...]]:
        """Let the timer fire; return what was told meanwhile."""
        for _ in range(times):
            self.time += self.period
            self._callback()
        return self.heard.news()


@pytest.fixture
def bench() -> Bench:
    """Nothing is missing, and nobody waits."""
    return Bench()


def test_a_wait_names_what_is_missing_and_ends_when_nothing_is(bench: Bench) -> None:
    """Everything that is missing is one text, told when it changes."""
    bench.nav.misses, bench.bridge.misses = [NAV], [BRIDGE]
    bench.readiness.start("a1", "ready", {})
    assert bench.heard.news() == [("accepted", "a1")]
    assert bench.poll(2) == [("progress", "a1", f"{NAV}, {BRIDGE}")]
    bench.bridge.misses = []
    assert bench.poll(2) == [("progress", "a1", NAV)]
    bench.nav.misses = []
    assert bench.poll(2) == [("done", "a1", {})]


def test_a_server_that_goes_is_told_after_two_seconds(bench: Bench) -> None:
    """And told when it is back, at once; nobody has to wait for that."""
    assert bench.poll() == []
    bench.nav.misses = [NAV]
    assert bench.poll(POLLS_UNTIL_GONE - 1) == []
    assert bench.poll(5) == [("value", MISSING, [NAV], pytest.approx(102.2))]
    bench.nav.misses = []
    assert bench.poll(5) == [("value", MISSING, [], pytest.approx(103.2))]
    assert pytest.approx(2.0) == POLLS_UNTIL_GONE * POLL_PERIOD_S


def test_who_goes_on_with_anothers_memory_is_told_what_is_so() -> None:
    """A server that was missing when the other one died may be back since: told once, then as ever."""
    bench = Bench(is_resumed=True)
    assert bench.poll() == [("value", MISSING, [], pytest.approx(100.2))]
    assert bench.poll(20) == []
    other = Bench(is_resumed=True)
    other.nav.misses = [NAV]
    assert other.poll(POLLS_UNTIL_GONE) == [("value", MISSING, [NAV], pytest.approx(102.0))]


def test_discovery_that_stumbles_is_not_told(bench: Bench) -> None:
    """A server that is out of sight now and then is there."""
    for _ in range(5):
        bench.nav.misses = [NAV]
        assert bench.poll(POLLS_UNTIL_GONE - 1) == []
        bench.nav.misses = []
        assert bench.poll() == []


def test_what_is_missing_is_told_anew_when_it_changes(bench: Bench) -> None:
    """The list is what is missing now."""
    bench.nav.misses = [NAV]
    bench.poll(POLLS_UNTIL_GONE)
    bench.bridge.misses = [BRIDGE]
    assert bench.poll(2) == [("value", MISSING, [NAV, BRIDGE], pytest.approx(102.2))]


def test_that_all_is_there_is_told_before_the_wait_ends(bench: Bench) -> None:
    """A chart that goes on when the wait ends must not see an old list and wait again."""
    bench.nav.misses = [NAV]
    bench.readiness.start("a1", "ready", {})
    bench.poll(POLLS_UNTIL_GONE)
    bench.nav.misses = []
    assert bench.poll() == [("value", MISSING, [], pytest.approx(102.2)), ("done", "a1", {})]


def test_a_cancelled_wait_is_silent(bench: Bench) -> None:
    """Only the wait that is under way can be cancelled."""
    bench.nav.misses = [NAV]
    bench.readiness.start("a1", "ready", {})
    bench.readiness.cancel("a0")
    bench.readiness.cancel("a1")
    assert bench.heard.news() == [("accepted", "a1"), ("cancelled", "a1")]
    bench.nav.misses = []
    assert bench.poll(2) == []


def test_closing_ends_the_timer(bench: Bench) -> None:
    """Nothing is asked after that."""
    bench.readiness.close()
    assert not bench.running
