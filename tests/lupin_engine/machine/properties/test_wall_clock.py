"""Times of day, whatever the clock does: held against minutes that are counted one by one."""

from __future__ import annotations

from datetime import datetime, timezone
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from lupin_engine.runtime.clock import calendar_of
from tests.lupin_engine.machine.charts import PAUSE, Bench, chart

#: Zones of each kind: none, of the north, of the south, with half an hour, with a leap at midnight.
ZONES = ("UTC", "Europe/Amsterdam", "Australia/Lord_Howe", "America/Sao_Paulo", "Asia/Kolkata")
MINUTE, DAY = 60, 86_400
TIMES = st.builds("{:02}:{:02}".format, st.integers(0, 23), st.sampled_from([0, 30]))
MOMENTS = st.one_of(
    st.integers(0, 3_000_000_000 // 1800).map(lambda halves: halves * 1800.0),
    # Around the changes of 2018, the last year in which all of these zones but two had some.
    st.builds(
        lambda month, day, half: datetime(2018, month, day, tzinfo=timezone.utc).timestamp() + half * 1800,
        st.sampled_from([2, 3, 4, 10, 11]),
        st.integers(1, 28),
        st.integers(0, 47),
    ),
)


@given(st.sampled_from(ZONES), TIMES, MOMENTS)
def test_the_next_time_is_the_first_minute_that_shows_it_or_has_passed_it(
    zone: str, time: str, after: float
) -> None:
    """Of each date the first such minute; found by looking at every one of two days."""
    calendar = calendar_of(zone)
    found, date = calendar.next(time, after, ())
    first: dict[str, float] = {}
    for minute in range(int(after) - DAY, int(after) + 2 * DAY, MINUTE):
        today, shown = calendar.shown(minute)
        if shown >= time:
            first.setdefault(today, minute)
    expected = min(moment for moment in first.values() if moment > after)
    assert (found, calendar.shown(found)[0]) == (expected, date)


HAPPENINGS = st.lists(
    st.one_of(
        st.sampled_from([0.25, 1.0, 5.0, 13.0, 30.0]).map(lambda hours: ("wait", hours)),
        st.sampled_from([-50.0, -24.0, -1.0, -0.5, 0.5, 3.0, 24.0, 100.0]).map(lambda hours: ("set", hours)),
        st.sampled_from(["go", "back", "operator.pause", "operator.resume"]).map(lambda name: ("send", name)),
    ),
    max_size=20,
)


def noting(env: Any) -> list[str]:
    """Add the moment to those that were noted."""
    return [*env["context"]["seen"], f"{env['clock']['today']} {env['clock']['time']}"]


def bench(zone: str) -> Bench:
    """A state that notes when it is half past two, and another one."""
    tell = {"do": ("set", {"seen": noting})}
    states = {"A": {"at": {"02:30": tell}, "on": {"go": "B"}}, "B": {"on": {"back": "A"}}}
    given = chart(states, context={"seen": []}, holds={"pause": PAUSE})
    return Bench(given, clock="2018-10-27 12:00", zone=zone)


def drive(one: Bench, happening: tuple[str, Any]) -> None:
    """Let something happen."""
    what, value = happening
    if what == "wait":
        one.wait(value * 3600)
    elif what == "set":
        one.send("clock", ahead=(one.machine.memory.wall or 0.0) + value * 3600)
        one.wait(0.0)
    else:
        one.send(value)


@given(st.sampled_from(ZONES), HAPPENINGS)
def test_whatever_happens_no_date_counts_twice(zone: str, happenings: list[tuple[str, Any]]) -> None:
    """Nothing is dealt with during a hold; a machine made anew after each step does the same."""
    one, other = bench(zone), bench(zone)
    for happening in happenings:
        before, held = list(one.context["seen"]), bool(one.machine.memory.held)
        drive(one, happening)
        drive(other, happening)
        other.restart()
        assert one.context == other.context
        if held and one.machine.memory.held:
            assert one.context["seen"] == before
    assert [step.event for step in one.steps] == [step.event for step in other.steps]
    dates = one.machine.memory.reached.get("A", {}).get("02:30", [])
    assert len(dates) == len(set(dates))
    assert len(one.context["seen"]) <= len(dates)
    if not any(value == "operator.pause" for _, value in happenings):
        assert len(one.context["seen"]) == len(dates)
