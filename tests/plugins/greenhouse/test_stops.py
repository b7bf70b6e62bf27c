"""The fold of all sources of the emergency stop, with times and writers as a test says."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lupin_greenhouse.stops import HMI, LIVING_S, PAGES, QUIET_S, ROBOT, StopFold, StopState, rules

A, B = frozenset("a"), frozenset("b")
BOTH = A | B
SOURCES = (ROBOT, PAGES, HMI)


def fold() -> StopFold:
    return StopFold(rules(2.0))


def test_each_source_is_released_by_its_own_writer_at_once() -> None:
    for source in SOURCES:
        stops = fold()
        stops.heard(source, True, A, 1.0)
        assert stops.state == StopState((source,))
        stops.heard(source, False, A, 1.1)
        assert stops.state == StopState()


messages = st.tuples(
    st.sampled_from(SOURCES), st.booleans(), st.sampled_from((frozenset[str](), A, B, BOTH)), st.floats(0, 30)
)


@given(st.sampled_from(SOURCES), st.lists(messages))
def test_no_message_of_another_source_releases_a_stop(
    held: str, told: list[tuple[str, bool, frozenset[str], float]]
) -> None:
    """Whatever the others say and whenever; the source itself only repeats what it says."""
    stops, now = fold(), 0.0
    for source, engaged, writers, later in told:
        stops.heard(held, True, A, now)
        now += later
        if source != held:
            stops.heard(source, engaged, writers, now)
        assert held in stops.state.sources


@given(st.lists(st.tuples(st.sampled_from((A, B, BOTH, frozenset[str]())), st.floats(0, 100)), min_size=1))
def test_a_false_of_somebody_else_never_releases_the_stop_of_pages(
    told: list[tuple[frozenset[str], float]],
) -> None:
    """Its gateway has died, and another one that knows nothing of the stop says false."""
    stops, now = fold(), 0.0
    stops.heard(PAGES, True, frozenset({"dead"}), now)
    for writers, later in told:
        now += later
        stops.heard(PAGES, False, writers, now)
        stops.look(now)
        assert stops.state.sources == (PAGES,)


def test_the_stop_of_pages_whose_gateway_is_gone_stays() -> None:
    stops = fold()
    stops.heard(PAGES, True, A, 0.0)
    stops.look(1e6)
    assert stops.state == StopState((PAGES,))


def test_after_its_gateway_has_lost_it_a_stop_is_released_by_a_new_true_and_false() -> None:
    stops = fold()
    for engaged, writers in ((True, A), (False, B), (True, B), (False, B)):
        before = stops.state
        stops.heard(PAGES, engaged, writers, 1.0)
    assert (before.engaged, stops.state.engaged) == (True, False)


@pytest.mark.parametrize("source", [ROBOT, HMI])
def test_a_false_of_several_writers_counts_after_a_while_without_a_true(source: str) -> None:
    stops = fold()
    stops.heard(source, True, BOTH, 0.0)
    for now in (0.1, 1.0, QUIET_S - 0.01):
        stops.heard(source, False, BOTH, now)
        stops.look(now)
        assert stops.state.engaged
    stops.heard(source, False, BOTH, QUIET_S)
    assert not stops.state.engaged


def test_who_says_true_and_leaves_is_not_released_by_the_one_who_stays() -> None:
    """The false comes from the only writer that there is now, and the true came from another."""
    stops = fold()
    stops.heard(HMI, True, BOTH, 0.0)
    stops.heard(HMI, False, B, 0.1)
    assert stops.state.engaged


def test_two_gateways_that_live_and_say_false_release_the_stop_late() -> None:
    stops = fold()
    stops.heard(PAGES, True, BOTH, 0.0)
    stops.heard(PAGES, False, BOTH, LIVING_S - 0.01)
    assert stops.state.engaged
    stops.heard(PAGES, False, BOTH, LIVING_S)
    assert not stops.state.engaged


def test_another_hmi_that_says_no_more_that_it_is_stopped_is_not() -> None:
    stops = fold()
    stops.heard(HMI, True, A, 0.0)
    stops.look(QUIET_S - 0.01)
    assert stops.state.engaged
    stops.look(QUIET_S)
    assert not stops.state.engaged


def test_the_robot_is_stopped_as_long_as_one_source_holds_it() -> None:
    stops = fold()
    for source in SOURCES:
        stops.heard(source, True, A, 0.0)
    for source in SOURCES:
        assert stops.state.engaged
        stops.heard(source, False, A, 0.1)
    assert not stops.state.engaged


def test_time_is_looked_at_only_while_it_may_change_something() -> None:
    stops = fold()
    stops.heard(PAGES, False, A, 0.0)
    assert not stops.waits
    stops.heard(ROBOT, False, A, 0.0)
    assert stops.waits
    stops.look(2.0)
    assert not stops.waits


def test_a_gateway_that_was_started_again_releases_its_stop_also_at_once() -> None:
    """Its predecessor is known for 20 s more: who said true cannot be told, so the release counts later."""
    stops = fold()
    stops.heard(PAGES, True, frozenset({"dead"}), 0.0)
    stops.heard(PAGES, True, frozenset({"dead", "new"}), 1.0)
    stops.heard(PAGES, False, frozenset({"dead", "new"}), 2.0)
    stops.heard(PAGES, False, frozenset({"new"}), 1.0 + LIVING_S - 0.1)
    assert stops.state.sources == (PAGES,)
    stops.heard(PAGES, False, frozenset({"new"}), 1.0 + LIVING_S)
    assert not stops.state.engaged
