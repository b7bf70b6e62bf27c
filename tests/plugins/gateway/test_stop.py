"""The software stop of many pages: time is an argument, connections are numbers."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lupin_gateway.stop import BACK_WITHIN_S, LINK, LINK_GRACE_S, OnLinkLost, StopArbiter, stop_of

ANNA, BEN, EVE = 1, 2, 3


def two_pages(**settings: object) -> StopArbiter:
    """Two pages of operators, of different browsers."""
    stops = StopArbiter(**settings)  # type: ignore[arg-type]
    stops.joined(ANNA, "anna-1", operator=True, browser="a")
    stops.joined(BEN, "ben-2", operator=True, browser="b")
    return stops


def test_two_pages_one_stopped() -> None:
    """A page that is not stopped tells so again and again, and releases nobody else's stop."""
    stops = two_pages()
    stops.report(ANNA, True, 1.0)
    heard = []
    for half_second in range(20):
        for page, stopped in ((BEN, False), (ANNA, True)):
            assert stops.report(page, stopped, half_second / 2) == ""
            heard.append(stops.stopped)
    assert set(heard) == {True}
    stops.report(ANNA, False, 11.0)
    assert not stops.stopped


def test_a_page_gone_stopped_leaves_its_stop() -> None:
    """The stop stays, by the name of the page, until an operator resets it by that name."""
    stops = two_pages()
    stops.report(ANNA, True, 1.0)
    stops.gone(ANNA, 2.0)
    stops.report(BEN, False, 3.0)
    assert stops.stopped
    assert stops.state(5.0)["stops"] == [{"name": "anna-1", "left": True, "age": 4.0}]
    assert stops.reset("anna") == "no stop is called 'anna'; engaged are: anna-1"
    assert stops.stopped
    assert stops.reset("anna-1") == ""
    assert not stops.stopped
    assert stops.reset("anna-1") == "no stop is called 'anna-1'; none is engaged"


def test_a_page_gone_running_leaves_nothing() -> None:
    """Who has told no stop goes without a trace."""
    stops = two_pages()
    stops.report(ANNA, False, 1.0)
    stops.gone(ANNA, 2.0)
    stops.gone(ANNA, 2.0)
    assert not stops.stopped


def test_a_page_that_is_loaded_anew_takes_its_stop_over() -> None:
    """Pages stop when they are left and when they are loaded: one reset by their button is enough."""
    stops = two_pages()
    stops.report(ANNA, True, 1.0)
    stops.gone(ANNA, 1.1)
    stops.joined(EVE, "anna-3", operator=True, browser="a")
    stops.report(EVE, True, 1.5)
    assert stops.state(2.0)["stops"] == [{"name": "anna-3", "left": False, "age": 1.0}]
    stops.report(EVE, False, 3.0)
    assert not stops.stopped


@pytest.mark.parametrize(("browser", "said"), [("b", [True, False]), ("", [True, False]), ("a", [False])])
def test_others_take_no_stop_over(browser: str, said: list[bool]) -> None:
    """Another browser does not, one that is unknown does not, and one that was never stopped does not."""
    stops = two_pages()
    stops.report(ANNA, True, 1.0)
    stops.gone(ANNA, 1.1)
    stops.joined(EVE, "eve-3", operator=True, browser=browser)
    for stopped in said:
        stops.report(EVE, stopped, 2.0)
    assert stops.stopped


def test_pages_of_unknown_browsers_take_nothing_over() -> None:
    """No cookie is no proof, also where both have none."""
    stops = StopArbiter()
    stops.joined(ANNA, "page-1", operator=True)
    stops.report(ANNA, True, 1.0)
    stops.gone(ANNA, 2.0)
    stops.joined(BEN, "page-2", operator=True)
    stops.report(BEN, True, 3.0)
    stops.report(BEN, False, 4.0)
    assert stops.stopped


def test_a_viewer_stops_and_does_not_release() -> None:
    """Its stop is reset by an operator, by name; what the page then repeats is not a new stop."""
    stops = StopArbiter()
    stops.joined(EVE, "eve-3", operator=False)
    assert stops.report(EVE, True, 1.0) == ""
    refused = stops.report(EVE, False, 2.0)
    assert refused == "only an operator releases a stop: reset the stop 'eve-3'"
    assert stops.stopped
    assert stops.reset("eve-3") == ""
    repeated = stops.report(EVE, True, 3.0)
    assert repeated == "an operator has reset this stop: release it on this page before it stops again"
    assert not stops.stopped
    assert stops.report(EVE, False, 4.0) == ""
    stops.report(EVE, True, 5.0)
    assert stops.stopped


def test_viewers_that_may_not_stop() -> None:
    """A setting leaves the stop to operators; a page that says that it runs is not told so."""
    stops = StopArbiter(viewers_stop=False)
    stops.joined(EVE, "eve-3", operator=False)
    assert stops.report(EVE, True, 1.0) == "the stop is for operators here (viewers_stop is off)"
    assert stops.report(EVE, False, 1.0) == ""
    assert not stops.stopped


def test_nobody_resets_the_stop_of_an_operator_who_is_there() -> None:
    """Who is connected says for himself that the danger is over."""
    stops = two_pages()
    stops.report(ANNA, True, 1.0)
    assert stops.reset("anna-1") == "anna-1 is connected, and releases its stop itself"
    assert stops.stopped


@pytest.mark.parametrize("mode", list(OnLinkLost))
def test_a_link_cut_for_half_a_minute(mode: OnLinkLost) -> None:
    """One decision when the last operator's link is lost, none when it is back, and nothing is released."""
    stops = two_pages(on_link_lost=mode)
    stops.gone(ANNA, 10.0)
    assert stops.link_lost(20.0) is None  # Ben is there
    stops.gone(BEN, 20.0)
    assert stops.state(20.0)["link"] == "none"
    decisions = [stops.link_lost(20.0 + tick / 5) for tick in range(150)]
    assert [one for one in decisions if one] == [mode]
    assert decisions.index(mode) / 5 == LINK_GRACE_S
    assert stops.stopped is (mode is OnLinkLost.STOP)
    assert stops.state(50.0)["link"] == "lost"
    stops.joined(EVE, "ben-3", operator=True, browser="b")
    assert stops.link_lost(51.0) is None
    assert stops.state(51.0) == {
        "stopped": mode is OnLinkLost.STOP,
        "stops": [{"name": LINK, "left": True, "age": 29.0}] if mode is OnLinkLost.STOP else [],
        "operators": 1,
        "link": "up",
        "on_link_lost": mode.value,
    }


def test_a_page_loaded_anew_is_no_lost_link() -> None:
    """Nothing is decided when an operator is back within the grace."""
    stops = StopArbiter(OnLinkLost.STOP)
    stops.joined(ANNA, "anna-1", operator=True)
    stops.gone(ANNA, 1.0)
    assert stops.link_lost(1.0 + LINK_GRACE_S / 2) is None
    stops.joined(BEN, "anna-2", operator=True)
    assert stops.link_lost(60.0) is None


def test_viewers_are_no_link() -> None:
    """A viewer who comes and goes decides nothing, and keeps no link up."""
    stops = StopArbiter(OnLinkLost.STOP)
    stops.joined(EVE, "eve-1", operator=False)
    stops.gone(EVE, 1.0)
    assert stops.link_lost(60.0) is None
    stops.joined(EVE, "eve-2", operator=False)
    stops.joined(ANNA, "anna-3", operator=True)
    stops.gone(ANNA, 100.0)
    assert stops.link_lost(103.0) is OnLinkLost.STOP


def test_a_gateway_that_starts_again_keeps_the_stops() -> None:
    """Its pages are gone with it; two stops of one name are two."""
    before = two_pages()
    before.report(ANNA, True, 1.0)
    after = StopArbiter(OnLinkLost.PAUSE)
    after.restore(before.kept(), 0.0)
    after.joined(ANNA, "anna-1", operator=True)
    after.report(ANNA, True, 1.0)
    after.gone(ANNA, 2.0)
    assert [stop["name"] for stop in after.state(2.0)["stops"]] == ["anna-1", "anna-1'"]
    after.reset("anna-1")
    assert after.stopped


def test_a_gateway_that_starts_again_loses_the_link_unless_somebody_comes_back() -> None:
    """Its operators were connected; where there was none, nothing is lost."""
    before = two_pages()
    for waits, decision in ((False, OnLinkLost.PAUSE), (True, None)):
        after = StopArbiter(OnLinkLost.PAUSE)
        after.restore(before.kept(), 0.0)
        assert after.link_lost(BACK_WITHIN_S - 0.1) is None
        if waits:
            after.joined(ANNA, "anna-1", operator=True)
        assert after.link_lost(BACK_WITHIN_S) is decision
    for page in (ANNA, BEN):
        before.gone(page, 1.0)
    after.restore(before.kept(), 100.0)
    assert after.link_lost(200.0) is None


@pytest.mark.parametrize(
    ("message", "stopped"),
    [
        ({"data": True}, True),
        ({"data": False}, False),
        ({"data": 0}, False),
        ({"data": 1}, True),
        ({}, True),
        ({"data": None}, True),
        ({"data": "false"}, True),
        ({"data": float("nan")}, True),
        (None, True),
    ],
)
def test_what_is_not_clear_is_a_stop(message: object, stopped: bool) -> None:
    """Only a plain false says that a page is not stopped."""
    assert stop_of(message) is stopped


@given(st.lists(st.tuples(st.integers(0, 3), st.sampled_from(["join", "stop", "run", "gone"])), max_size=40))
def test_the_or_of_all_pages(happened: list[tuple[int, str]]) -> None:
    """Whatever operators' pages do: the robot is stopped while one of them is, or left so."""
    stops, pages, left = StopArbiter(), dict[int, bool](), 0
    for now, (page, what) in enumerate(happened):
        if what == "join" and page not in pages:
            stops.joined(page, f"page-{now}", operator=True)
            pages[page] = False
        elif what in ("stop", "run") and page in pages:
            stops.report(page, what == "stop", now)
            pages[page] = what == "stop"
        elif what == "gone":
            stops.gone(page, now)
            left += pages.pop(page, False)
        assert stops.stopped is (left > 0 or any(pages.values()))
        assert len(stops.kept().stops) == left + sum(pages.values())
