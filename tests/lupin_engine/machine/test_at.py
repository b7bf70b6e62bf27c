"""What happens at a time of day: `at`, and the clock that expressions read."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from lupin_engine.machine.event import Event
from lupin_engine.machine.inputs import MOST_DATES
from lupin_engine.machine.reload import successor
from lupin_engine.machine.snapshot import restore, shift
from lupin_engine.runtime.clock import calendar_of
from tests.lupin_engine.machine.charts import PAUSE, Bench, chart

COUNT = {"do": ("set", {"n": lambda env: env["context"]["n"] + 1})}


def waiting(clock: str = "2026-11-22 22:00", zone: str = "UTC", **more: Any) -> Bench:
    """A state that counts how often it has become half past six."""
    states = {
        "A": {"at": {"06:30": COUNT}, "on": {"go": "B"}, **more},
        "B": {"on": {"back": "A"}},
        "FAULT": {},
    }
    given = chart(states, context={"n": 0}, holds={"pause": PAUSE})
    return Bench(given, clock=clock, zone=zone)


def test_it_happens_each_day_while_the_state_is_active() -> None:
    """At the next time first, which may be tomorrow."""
    bench = waiting()
    assert (bench.wait_for_next(), bench.clock) == (8.5 * 3600, "2026-11-23 06:30:00 UTC")
    assert (bench.wait_for_next(), bench.context["n"]) == (24 * 3600, 2)
    assert bench.steps[-1].event == Event("timer.at", {"owner": "A", "time": "06:30"})
    bench.send("go")
    assert bench.machine.next_deadline is None


def test_a_state_that_is_entered_after_the_time_waits_for_tomorrow() -> None:
    """As well as one that is entered at that very moment."""
    for clock in ("2026-11-22 06:30", "2026-11-22 06:31", "2026-11-22 23:59"):
        bench = waiting(clock)
        bench.wait_for_next()
        assert bench.clock == "2026-11-23 06:30:00 UTC"


def test_several_times_and_guards() -> None:
    """Each for itself; the first whose guard holds is taken."""
    late = {"target": "B", "guard": lambda env: env["context"]["n"] > 1}
    bench = waiting(at={"06:30": COUNT, "23:00": [late, COUNT]})
    bench.wait(9 * 3600)
    assert bench.context["n"] == 2
    bench.wait_for_next()
    assert (bench.leaves, bench.clock) == (["B"], "2026-11-23 23:00:00 UTC")


def test_the_clock_goes_on_during_a_hold_and_what_it_came_to_waits() -> None:
    """Once, however often it came to it."""
    bench = waiting()
    bench.send("operator.pause")
    bench.wait(60 * 3600)
    assert bench.context["n"] == 0
    assert [step.notes for step in bench.steps[-3:]] == [("06:30 waits for the release",), (), ()]
    bench.restart()
    bench.send("operator.resume")
    assert bench.context["n"] == 1
    bench.wait_for_next()
    assert (bench.context["n"], bench.clock) == (2, "2026-11-26 06:30:00 UTC")


def test_what_waited_is_dealt_with_before_anything_begins() -> None:
    """Nobody drives for a time that is over: the outer state's own leads on in the same step."""
    inner = {"B": {"at": {"06:00": "C"}}, "C": {"invoke": "nav.go"}}
    states = {"A": {"at": {"06:30": "D"}, "states": inner}, "D": {}}
    bench = Bench(chart(states, holds={"pause": PAUSE}), clock="2026-11-22 22:00")
    bench.send("operator.pause")
    bench.wait(10 * 3600)
    step = bench.send("operator.resume")
    assert (bench.leaves, step.commands) == (["D"], ())


def test_what_waits_for_the_release_is_forgotten_with_its_state() -> None:
    """A transition that passes the hold may have left it."""
    bench = waiting(on={"go": {"target": "B", "during": ["pause"]}})
    bench.send("operator.pause")
    bench.wait(10 * 3600)
    bench.send("go")
    bench.send("operator.resume")
    assert (bench.leaves, bench.machine.next_deadline) == (["B"], None)


def test_what_passes_a_hold_is_taken_at_its_time() -> None:
    """The hold stays."""
    bench = waiting(at={"06:30": {"target": "B", "during": ["pause"]}})
    bench.send("operator.pause")
    bench.wait(10 * 3600)
    assert (bench.leaves, bench.machine.memory.held) == (["B"], ["pause"])


def test_a_clock_that_is_set_forward_over_the_time_comes_to_it_once() -> None:
    """Also over several days; it is told."""
    bench = waiting()
    step = bench.set_clock("2026-11-25 12:00")
    assert step.notes == (
        "the clock was set 2.583 days forward",
        "the clock says 2026-11-25 12:00:00 UTC",
        "it has passed 2026-11-23 06:30",
    )
    bench.wait(0.0)
    assert bench.context["n"] == 1
    bench.wait_for_next()
    assert (bench.context["n"], bench.clock) == (2, "2026-11-26 06:30:00 UTC")


def test_a_clock_that_is_set_back_does_not_come_to_a_date_twice() -> None:
    """Nor where the state was left and entered again."""
    bench = waiting("2026-11-22 06:00")
    bench.wait(3600)
    assert bench.set_clock("2026-11-22 06:00").notes[0] == "the clock was set 1 h back"
    bench.send("go")
    bench.restart()
    bench.send("back")
    bench.wait(3600)
    assert bench.context["n"] == 1
    bench.wait_for_next()
    assert (bench.context["n"], bench.clock) == (2, "2026-11-23 06:30:00 UTC")
    bench.set_clock("2026-11-21 12:00")
    assert (bench.wait_for_next(), bench.context["n"], bench.clock) == (
        (24 * 3 - 5.5) * 3600,
        3,
        "2026-11-24 06:30:00 UTC",
    )


def test_a_clock_that_was_years_ahead_is_set_right() -> None:
    """What would have been come to in years is come to tomorrow."""
    bench = waiting("2030-01-01 00:00")
    bench.wait(7 * 3600)
    bench.set_clock("2026-11-22 22:00")
    bench.wait_for_next()
    assert (bench.context["n"], bench.clock) == (2, "2026-11-23 06:30:00 UTC")


@pytest.mark.parametrize(
    ("clock", "come_to"),
    [
        ("2026-03-28 12:00", ["2026-03-29 03:00:00", "2026-03-30 02:30:00"]),
        ("2026-10-24 12:00", ["2026-10-25 02:30:00", "2026-10-26 02:30:00"]),
    ],
)
def test_daylight_saving_leaves_a_time_out_and_brings_one_twice(clock: str, come_to: list[str]) -> None:
    """What is left out is come to when the clock leaps over it; of two the first counts."""
    bench = waiting(clock, "Europe/Amsterdam", at={"02:30": COUNT})
    found = []
    for _ in come_to:
        bench.wait_for_next()
        found.append(bench.clock)
    assert found == [f"{each} Europe/Amsterdam" for each in come_to]
    assert bench.context["n"] == 2


def test_a_time_may_be_computed() -> None:
    """What is none is an error of the state."""
    bench = waiting(at={lambda env: env["param"]["end"]: COUNT})
    assert bench.leaves == ["FAULT"]
    good = Bench(chart({"A": {"at": {lambda _: "06:00": "B"}}, "B": {}}), clock="2026-11-22 22:00")
    assert (good.wait_for_next(), good.leaves) == (8 * 3600, ["B"])
    states = {"A": {"at": {lambda _: "25:00": "B"}}, "B": {}, "FAULT": {}}
    wrong = Bench(chart(states), clock="2026-11-22 22:00")
    assert wrong.machine.view.detail == "test.yaml:1:1: at: a time_of_day such as 06:30, got '25:00'"


def test_the_clock_can_be_read() -> None:
    """A guard that asks is false while nobody has told the time."""
    look = {"do": ("set", {"n": lambda env: dict(env["clock"])})}
    states = {"A": {"on": {"look": look, "go": {"target": "B", "guard": late}}}, "B": {}}
    bench = Bench(chart(states, context={"n": 0}), clock="2026-12-31 23:59:58", zone="Asia/Tokyo")
    bench.send("look")
    assert bench.context["n"] == {"today": "2026-12-31", "time": "23:59"}
    bench.wait(3.0)
    bench.send("look")
    assert bench.context["n"] == {"today": "2027-01-01", "time": "00:00"}
    unknown = Bench(chart(states, context={"n": 0}))
    assert unknown.send("go").notes == ("test.yaml:1:1: guard: clock is unknown: nobody has told the time",)


def late(env: Any) -> bool:
    """Say whether it is late."""
    return bool(env["clock"]["time"] > "22:00")


def test_a_machine_that_hears_of_the_time_later_waits_from_then_on() -> None:
    """Without a clock nothing is due."""
    bench = waiting("")
    assert bench.machine.next_deadline is None
    assert bench.set_clock("2026-11-22 22:00").notes == ("the clock says 2026-11-22 22:00:00 UTC",)
    assert (bench.wait_for_next(), bench.context["n"]) == (8.5 * 3600, 1)


def test_it_goes_on_from_a_snapshot_also_with_another_clock_of_the_machine() -> None:
    """The robot's clock is the same."""
    bench = waiting()
    bench.wait(3600)
    memory = restore(bench.machine.chart, bench.machine.snapshot())
    shift(memory, 1000.0)
    bench.machine = type(bench.machine)(bench.machine.world, memory)
    bench.now += 1000.0
    assert (bench.wait_for_next(), bench.clock) == (7.5 * 3600, "2026-11-23 06:30:00 UTC")


def test_missions_that_are_loaded_anew_wait_for_the_same_times() -> None:
    """And where the zone was set meanwhile, for those of that."""
    bench = waiting(on={"go": "B", "mission.start": "B"})
    bench.wait(3600)
    bench.machine = successor(bench.machine, bench.machine.world)
    bench.machine.go_on(bench.now)
    assert (bench.wait_for_next(), bench.context["n"]) == (7.5 * 3600, 1)
    assert bench.machine.next_deadline == 32.5 * 3600
    tokyo = replace(bench.machine.world, calendar=calendar_of("Asia/Tokyo"))
    bench.machine = successor(bench.machine, tokyo)
    bench.machine.go_on(bench.now)
    assert bench.machine.next_deadline == 23.5 * 3600


def test_a_time_that_comes_while_missions_are_loaded_is_not_lost() -> None:
    """It was not fired yet when the other machine took over."""
    bench = waiting(on={"mission.start": "B"})
    bench.now += 8.5 * 3600 + 1
    bench.machine = successor(bench.machine, bench.machine.world)
    bench.machine.go_on(bench.now)
    assert (bench.wait_for_next(), bench.context["n"]) == (0, 1)
    assert bench.machine.next_deadline == 32.5 * 3600


def test_a_state_remembers_the_dates_of_a_year() -> None:
    """No more, however long it waits."""
    bench = waiting()
    bench.wait(400 * 24 * 3600)
    assert (bench.context["n"], len(bench.machine.memory.reached["A"]["06:30"])) == (400, MOST_DATES)


def test_each_mission_deals_with_its_times_anew() -> None:
    """One that was started again on the day on which the clock was set back."""
    mission = {"mission": "M", "at": {"06:30": COUNT}, "on": {"over": "READY"}}
    slot = {"slot": True, "states": {"M": mission}}
    states = {"READY": {"on": {"mission.start": "MISSION"}}, "MISSION": slot}
    given = chart(states, initial="READY", missions={"M": {"state": "MISSION.M"}}, context={"n": 0})
    bench = Bench(given, clock="2026-11-22 06:00")
    for _ in range(2):
        bench.send("mission.start", mission_type="M")
        bench.wait(3600)
        bench.send("over")
        bench.set_clock("2026-11-22 06:00")
    assert bench.context["n"] == 2


@pytest.mark.parametrize("ahead", [True, float("nan"), 1e30, "1"])
def test_a_clock_that_is_none_is_dropped(ahead: Any) -> None:
    """With the reason."""
    bench = waiting()
    step = bench.send("clock", ahead=ahead)
    assert step.notes == (f"dropped: clock has a wrong ahead: {ahead!r}",)
    assert bench.clock == "2026-11-22 22:00:00 UTC"


def test_a_clock_that_no_calendar_has_is_dropped() -> None:
    """Before 1970, or after the last year."""
    bench = waiting()
    for ahead in (-10.0, 1e11 * 3):
        step = bench.send("clock", ahead=ahead)
        assert step.notes[0].startswith("dropped: ")
    assert bench.clock == "2026-11-22 22:00:00 UTC"
