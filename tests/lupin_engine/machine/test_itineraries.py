"""Itineraries: which target is next, sweep after sweep, and what is counted."""

from __future__ import annotations

from typing import Any

import pytest

from lupin_engine.chart.expressions.evaluation import Compiled, Expression
from lupin_engine.chart.model import Chart
from lupin_engine.machine import event as events
from lupin_engine.machine.itineraries import Itineraries, identity_of
from lupin_engine.machine.memory import Traversal, Visit
from lupin_engine.plugin.profile import Publish
from lupin_engine.plugin.types import ANY, list_of
from tests.lupin_engine.machine.charts import PAUSE, PLACE, Bench, chart, expression, fails, said

CLOSE = ("itinerary.close", {"status": "OK"})
FAIL = ("itinerary.close", {"status": "SCAN_FAILED"})
REST = ("itinerary.close_rest", {"status": "SKIPPED"})
SEEN = ("set", {"seen": lambda env: dict(env["itinerary"])})
ACTIONS = {
    "close": CLOSE,
    "fail": FAIL,
    "next": "itinerary.advance",
    "rest": REST,
    "see": SEEN,
    "sum": "report.summary",
}


def targets(*names: str) -> list[dict[str, Any]]:
    """Return targets that are called so, at the place that their name says when it is a number."""
    return [{"id": name, "x": float(name)} for name in names]


def walk_chart(**rule: Any) -> Chart:
    """Return a chart that walks the targets 1, 2 and 3, as `rule` says."""
    on = {name: {"do": do} for name, do in ACTIONS.items()}
    walk = {
        "itinerary": {"items": targets("1", "2", "3"), **rule},
        "states": {"VISIT": {"on": on}},
        "on": {"out": "Z", "skip": {"target": "Z", "do": REST}},
    }
    family = {"states": {"W": walk, "PAST": {"kind": "history", "depth": 1}}}
    rest = {"on": {"back": "F.PAST", "again": "F"}}
    context = {"seen": None, "list": targets("1", "2", "3")}
    writes = {"write": {"do": ("set", {"list": lambda env: env["event"]["list"]})}}
    return chart({"F": family, "Z": rest, "FAULT": {}}, inputs={"pose": {}}, context=context, on=writes)


def walking(**rule: Any) -> Bench:
    """Return a bench with that chart."""
    return Bench(walk_chart(**rule))


def walk(bench: Bench, *events: str) -> list[str]:
    """Send events and return the current target after each."""
    found = []
    for event in events:
        bench.send(event)
        found.append(bench.machine.view.target)
    return found


def visit(bench: Bench, number: int) -> list[str]:
    """Close that many targets one after the other; return them."""
    found = []
    for _ in range(number):
        found.append(bench.machine.view.target)
        walk(bench, "close", "next")
    return found


def seen(bench: Bench) -> dict[str, Any]:
    """Return what expressions see of the itinerary."""
    bench.send("see")
    return dict(bench.context["seen"])


# -- order ------------------------------------------------------------------------------------------------

NEAREST = expression(lambda env: abs(env["target"]["x"] - env["input"]["pose"]), "distance")


def nearest(*names: str, at: float | None = None, **rule: Any) -> Bench:
    """Return a bench that walks to the nearest of some targets, beginning at `at`."""
    given = walk_chart(items=targets(*names), order=NEAREST, **rule)
    bench = Bench(given)
    if at is not None:
        bench.observe("pose", at)
        walk(bench, "out", "again")
    return bench


def test_the_open_target_with_the_smallest_number_is_next() -> None:
    """Asked again before every target, with where the robot is then."""
    bench = nearest("1", "4", "6", "9", at=5.2)
    assert bench.machine.view.target == "6"
    bench.observe("pose", 8.0)
    assert walk(bench, "close", "next") == ["6", "9"]
    bench.observe("pose", 0.0)
    assert visit(bench, 3) == ["9", "1", "4"]


def test_of_equals_the_first_in_the_list_is_next() -> None:
    """So that the same inputs give the same walk."""
    assert visit(nearest("4", "6", "4", "6", at=5.0), 4) == ["4", "6", "4", "6"]


def test_what_is_not_known_leaves_the_lists_order() -> None:
    """Nobody knows where the robot is: the walk begins all the same, and says why it goes as written."""
    bench = nearest("6", "4")
    note = "test.yaml:1:1: order: input.pose is unknown; the list's own order counts"
    assert bench.steps[0].notes == (note,)
    assert visit(bench, 2) == ["6", "4"]


def test_closed_targets_are_not_asked_about() -> None:
    """Visits keep their outcomes when the rest of the list is put in order."""
    bench = nearest("1", "4", "6", at=5.8)
    walk(bench, "fail", "next")
    bench.observe("pose", 0.0)
    walk(bench, "close", "next")
    (report,) = bench.send("sum").commands
    told = [(one["target"], one["status"]) for one in report.visits]  # type: ignore[union-attr]
    assert told == [("6", "SCAN_FAILED"), ("4", "OK"), ("1", "")]


def test_an_order_that_cannot_be_computed_is_an_error() -> None:
    """With its place; the list's order counts meanwhile."""
    bench = walking(order=fails)
    assert bench.leaves == ["FAULT"]
    assert bench.machine.view.detail == "test.yaml:1:1: order: division by zero"


# -- sweeps -----------------------------------------------------------------------------------------------


def test_one_sweep_is_the_rule() -> None:
    """After the last target there is none, and nothing to go on from."""
    bench = walking()
    assert visit(bench, 3) == ["1", "2", "3"]
    assert bench.machine.view.target == ""
    step = bench.send("next")
    assert step.notes == ("itinerary.advance refused: there is no target to go on from",)
    assert bench.send("close").notes == ("itinerary.close refused: the current visit is closed already",)


def test_two_sweeps_walk_the_list_twice() -> None:
    """What remains counts to the end of the sweep, and at its end the next one."""
    bench = walking(sweeps=2)
    remaining = []
    for _ in range(6):
        remaining.append((seen(bench)["sweep"], seen(bench)["remaining"]))
        visit(bench, 1)
    assert remaining == [(1, 2), (1, 1), (1, 3), (2, 2), (2, 1), (2, 0)]
    assert bench.machine.view.target == ""


def test_no_sweeps_means_without_end() -> None:
    """Zero: there is always another one."""
    bench = walking(sweeps=0)
    assert visit(bench, 10) == ["1", "2", "3"] * 3 + ["1"]
    assert seen(bench)["sweep"] == 4


def test_the_list_is_made_anew_for_every_sweep() -> None:
    """What it has become counts from the next sweep on, not before."""
    bench = walking(items=lambda env: env["context"]["list"], sweeps=3)
    bench.send("write", list=targets("8", "9"))
    assert visit(bench, 5) == ["1", "2", "3", "8", "9"]
    bench.send("write", list=[])
    assert visit(bench, 2) == ["8", "9"]
    assert bench.machine.view.target == ""


def test_a_list_that_became_empty_stays_as_it_was() -> None:
    """The next sweep goes where the last one went; a walk does not end because a list is read too early."""
    bench = walking(items=lambda env: env["context"]["list"], sweeps=0)
    bench.send("write", list=[])
    assert visit(bench, 5) == ["1", "2", "3", "1", "2"]


def test_a_list_that_fails_stays_as_it_was() -> None:
    """The error is told; without anybody who handles it the walk goes on."""
    items = expression(
        lambda env: env["context"]["list"]["none"] if env["itinerary"]["closed"] else targets("1")
    )
    on = {"close": {"do": CLOSE}, "next": {"do": "itinerary.advance"}}
    bench = Bench(chart({"W": {"itinerary": {"items": items, "sweeps": 0}, "on": on}}, context={"list": {}}))
    assert walk(bench, "close", "next") == ["1", "1"]
    assert bench.steps[-1].notes[0] == "test.yaml:1:1: itinerary: there is no 'none'"


def test_counters_go_over_all_sweeps() -> None:
    """MissionState counts what was done, however often the list was walked."""
    bench = walking(sweeps=2)
    walk(bench, "fail", "next")
    visit(bench, 3)
    view = bench.machine.view
    assert (view.total, view.counts["OK"], view.counts["SCAN_FAILED"]) == (3, 3, 1)
    assert seen(bench) == {"open": True, "remaining": 1, "total": 3, "closed": 1, "sweep": 2}


def test_what_failed_is_visited_once_more_after_the_rest() -> None:
    """The second sweep is over the failed targets alone, and is the last one."""
    bench = walking(again=("SCAN_FAILED",))
    assert walk(bench, "fail", "next", "close", "next", "fail") == ["1", "2", "2", "3", "3"]
    assert seen(bench) == {"open": False, "remaining": 2, "total": 3, "closed": 3, "sweep": 1}
    assert walk(bench, "next", "close", "next", "fail", "next") == ["1", "1", "3", "3", ""]
    view = bench.machine.view
    assert (view.total, view.counts["OK"], view.counts["SCAN_FAILED"]) == (3, 2, 3)
    traversal = bench.machine.memory.traversal
    assert traversal is not None
    assert [(v.target, v.status) for v in traversal.outcomes] == [
        ("2", "OK"),
        ("1", "OK"),
        ("3", "SCAN_FAILED"),
    ]
    assert bench.send("next").notes == ("itinerary.advance refused: there is no target to go on from",)


def test_nothing_is_visited_again_where_nothing_failed() -> None:
    """Another status than the named ones is no failure."""
    bench = walking(again=("UNREACHABLE",))
    assert walk(bench, "fail", "next", "close", "next", "close") == ["1", "2", "2", "3", "3"]
    assert seen(bench)["remaining"] == 0
    assert walk(bench, "next") == [""]


def test_what_failed_in_the_last_of_several_sweeps_is_visited_again() -> None:
    """The sweeps before it are over the whole list."""
    bench = walking(sweeps=2, again=("SCAN_FAILED",))
    walk(bench, "fail", "next")
    visit(bench, 2)
    assert seen(bench) == {"open": True, "remaining": 2, "total": 3, "closed": 0, "sweep": 2}
    visit(bench, 2)
    assert walk(bench, "fail", "next", "close", "next") == ["3", "3", "3", ""]


def test_an_end_in_the_second_visits_leaves_the_first_results() -> None:
    """Targets that wait for their second visit have a result already; closing the rest gives the newest."""
    bench = walking(again=("SCAN_FAILED",))
    walk(bench, "fail", "next", "fail", "next", "close", "next", "close")
    told = [each for each in bench.send("rest").commands if isinstance(each, Publish)]
    assert [(each.target, each.status) for each in told] == [("2", "SKIPPED")]


def test_a_sweep_that_is_cut_short_does_not_hide_the_ones_before() -> None:
    """What became of a target is its newest visit that was closed."""
    bench = walking(sweeps=0)
    walk(bench, "fail", "next")
    visit(bench, 2)
    visit(bench, 1)
    traversal = bench.machine.memory.traversal
    assert traversal is not None
    assert [(v.target, v.status) for v in traversal.visits] == [("1", "OK"), ("2", ""), ("3", "")]
    told = [(v.target, v.status) for v in traversal.outcomes]
    assert told == [("1", "OK"), ("2", "OK"), ("3", "OK")]
    walk(bench, "fail")
    assert [visit.status for visit in traversal.outcomes] == ["OK", "SCAN_FAILED", "OK"]
    bench.restart()
    again = bench.machine.memory.traversal
    assert again is not None
    assert again.outcomes == traversal.outcomes


def test_an_empty_list_is_walked_at_once() -> None:
    """There is no target, and nothing remains, with or without end."""
    for sweeps in (1, 0):
        bench = walking(items=[], sweeps=sweeps)
        assert seen(bench) == {"open": False, "remaining": 0, "total": 0, "closed": 0, "sweep": 1}
        assert bench.send("next").notes == ("itinerary.advance refused: there is no target to go on from",)


def test_sweeps_that_cannot_be_computed_are_an_error() -> None:
    """With its place."""
    bench = walking(sweeps=fails)
    assert bench.machine.view.detail == "test.yaml:1:1: sweeps: division by zero"


def test_a_walk_knows_its_last_sweep() -> None:
    """Asked of the walk itself: zero sweeps never have a last one."""
    sweeps = [
        Traversal("W", [], [], sweep=sweep, sweeps=sweeps).is_last_sweep
        for sweep, sweeps in ((1, 1), (1, 2), (9, 0))
    ]
    assert sweeps == [True, False, False]


# -- closing ----------------------------------------------------------------------------------------------


def test_what_leaves_open_is_not_closed_by_close_rest() -> None:
    """A patrol that is broken off has no targets that were skipped."""
    bench = walking(leaves_open=True)
    bench.send("close")
    step = bench.send("skip")
    assert (said(step), bench.machine.view.counts["SKIPPED"]) == ([], 0)


@pytest.mark.parametrize(("rule", "source"), [({"source": "Rounds"}, "Rounds"), ({}, "")])
def test_an_itinerary_may_name_the_source_of_its_observations(rule: dict[str, str], source: str) -> None:
    """Of those that are closed one by one and of the rest; else it is the mission, which is none here."""
    bench = walking(**rule)
    published = [bench.send("close").commands[0], *bench.send("skip").commands]
    assert [command.source for command in published if isinstance(command, Publish)] == [source] * 3


def test_close_rest_without_an_itinerary_closes_nothing() -> None:
    """An abort before the list was laid out publishes nothing."""
    bench = Bench(
        chart({"A": {"on": {"rest": {"do": REST}, "sum": {"do": "report.summary"}, "see": {"do": SEEN}}}})
    )
    assert bench.send("rest").commands == ()
    assert bench.send("sum").commands[0].visits == ()  # type: ignore[union-attr]
    assert seen(bench) == {"open": False, "remaining": 0, "total": 0, "closed": 0, "sweep": 0}


def test_outside_its_state_the_last_walk_counts() -> None:
    """Who aborts on the way home closes what the mission left open."""
    states = {"W": {"itinerary": targets("1", "2"), "on": {"out": "Z"}}, "Z": {"on": {"rest": {"do": REST}}}}
    bench = Bench(chart(states))
    bench.send("out")
    assert said(bench.send("rest")) == ["publish 1 SKIPPED", "publish 2 SKIPPED"]


def test_targets_of_a_request_are_known_before_they_are_walked() -> None:
    """However early a mission ends, close_rest tells what became of them; entering the walk begins it."""
    asked = Expression("request.tags", PLACE, ANY, Compiled("env['request']['tags']"))
    mission = {
        "mission": "M",
        "states": {
            "LOOK": {"on": {"seen": "WALK"}},
            "WALK": {"mission": "M", "itinerary": asked, "on": {"close": {"do": CLOSE}}},
        },
    }
    slot = {"slot": True, "states": {"M": mission}, "on": {"operator.abort": {"target": "READY", "do": REST}}}
    given = chart(
        {"READY": {"on": {"mission.start": "MISSION"}}, "MISSION": slot},
        missions={"M": {"state": "MISSION.M", "request": {"tags": {"type": list_of(ANY)}}}},
    )
    bench = Bench(given)
    bench.send("mission.start", mission_type="M", tags=targets("1", "2"))
    assert (bench.machine.view.total, bench.machine.view.target) == (2, "")
    assert said(bench.send("operator.abort")) == ["publish 1 SKIPPED", "publish 2 SKIPPED"]
    bench.send("mission.start", mission_type="M", tags=targets("1", "2"))
    bench.send("seen")
    assert said(bench.send("close")) == ["publish 1 OK"]
    assert said(bench.send("operator.abort")) == ["publish 2 SKIPPED"]


def test_every_state_works_on_its_own_itinerary() -> None:
    """An inner list is walked inside an outer one; each `close` means the nearest."""
    inner = {"itinerary": targets("7"), "on": {"close": {"do": CLOSE}}}
    outer = {"itinerary": targets("1"), "states": {"IN": inner}, "on": {"fail": {"do": FAIL}}}
    bench = Bench(chart({"OUT": outer}))
    assert said(bench.send("close")) == ["publish 7 OK"]
    assert said(bench.send("fail")) == ["publish 1 SCAN_FAILED"]


def test_a_reading_of_no_visit_is_published() -> None:
    """What is read in passing has a target and no outcome of its own."""
    act = ("publish.reading", {"tag": "5", "reading": {"t": 20}})
    bench = Bench(chart({"A": {"on": {"go": {"do": act}}}}))
    assert bench.send("go").commands == (Publish("", "", "5", "OK", reading={"t": 20}),)


# -- coming back ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("event", "expected"), [("back", "2"), ("again", "1")])
def test_who_comes_back_by_history_goes_on(event: str, expected: str) -> None:
    """Entered anew, the list begins anew; brought back, it goes on in the same sweep."""
    bench = walking(sweeps=2)
    visit(bench, 4)
    assert walk(bench, "out", event) == ["", expected]
    assert seen(bench)["sweep"] == (2 if event == "back" else 1)


def test_what_is_current_is_the_target_only_where_it_is_walked() -> None:
    """The target of an expression is that of its own state."""
    guard = expression(lambda env: env["target"]["id"] == "1")
    states = {"W": {"itinerary": targets("1"), "on": {"go": {"target": "Z", "guard": guard}}}, "Z": {}}
    bench = Bench(chart(states))
    bench.send("go")
    assert (bench.leaves, bench.machine.view.target) == (["Z"], "")


def test_targets_are_called_by_their_id_or_as_they_are() -> None:
    """What is published needs a name."""
    assert [identity_of(item) for item in ({"id": 7}, 3, "a")] == ["7", "3", "a"]
    assert Visit("7").closed is False


@pytest.mark.parametrize("item", [{"x": 1.0}, {"id": None}, 1.5, True, [1]])
def test_a_target_without_a_name_is_an_error_and_not_walked(item: Any) -> None:
    """Only where its type is not known before does one get as far as here; nothing is published of it."""
    on = {"close": {"do": CLOSE}}
    bench = Bench(chart({"W": {"itinerary": {"items": lambda _: [item]}, "on": on}, "FAULT": {}}))
    bench.send("close")
    problem = f"the target {item!r} has no 'id' to tell it by"
    assert bench.steps[0].notes[0] == f"test.yaml:1:1: itinerary: {problem}"
    assert not [c for step in bench.steps for c in step.commands if isinstance(c, Publish)]


def test_a_mission_begins_though_its_first_target_has_no_name() -> None:
    """The error is that of the state that walks; what is known before it is nothing."""
    bench = Bench(chart({"A": {}, "W": {"itinerary": {"items": lambda _: [1.5]}}}))
    Itineraries(bench.machine.scope).register(bench.machine.chart.states["W"])
    assert bench.machine.memory.itineraries == {}


def driving() -> Bench:
    """Return a bench that drives to the targets 1 and 2, three tries each; home is a drive as well."""
    drive = {
        "invoke": {"do": "nav.go", "attempts": 3},
        "on_done": {"target": "HERE", "do": CLOSE},
        "on_error": {"target": "HERE", "do": FAIL},
    }
    walk = {
        "itinerary": {"items": targets("1", "2")},
        "states": {"DRIVE": drive, "HERE": {"on": {"next": {"target": "DRIVE", "do": "itinerary.advance"}}}},
        "on": {"out": "HOME"},
    }
    family = {"states": {"W": walk, "PAST": {"kind": "history", "depth": None}}}
    home = {"invoke": {"do": "nav.go"}, "on": {"back": "F.PAST"}}
    return Bench(chart({"F": family, "HOME": home, "FAULT": {}}, holds={"pause": PAUSE}))


def tries(bench: Bench) -> list[dict[str, int]]:
    """Return how often each operation was tried for each target."""
    walked = bench.machine.memory.traversal
    assert walked is not None
    return [dict(found.tries) for found in walked.visits]


def test_the_tries_of_a_visit_are_counted() -> None:
    """Those of its own, by operation, whatever they came to."""
    bench = driving()
    assert tries(bench) == [{"nav.go": 1}, {}]
    bench.send(events.failed(bench.attempt, "blocked"))
    bench.wait_for_next()
    bench.send(events.done(bench.attempt, {}))
    bench.send("next")
    assert tries(bench) == [{"nav.go": 2}, {"nav.go": 1}]
    bench.send(events.done(bench.attempt, {}))
    bench.send("out")
    assert tries(bench) == [{"nav.go": 2}, {"nav.go": 1}]


def test_a_try_that_a_hold_or_a_divert_ended_does_not_count() -> None:
    """What comes instead counts; the drive home is nobody's visit."""
    bench = driving()
    bench.send("operator.pause")
    assert tries(bench) == [{"nav.go": 0}, {}]
    bench.send(events.cancelled(bench.started[-1].attempt))
    bench.send("operator.resume")
    assert tries(bench) == [{"nav.go": 1}, {}]
    bench.send("out")
    assert tries(bench) == [{"nav.go": 0}, {}]
    bench.send("back")
    assert tries(bench) == [{"nav.go": 1}, {}]


def test_the_report_tells_the_tries() -> None:
    """Of every target, also of one that was not tried."""
    bench = Bench(walk_chart())
    walk(bench, "close")
    (report,) = bench.send("sum").commands
    assert [one["tries"] for one in report.visits] == [{}, {}, {}]  # type: ignore[union-attr]


def test_a_target_that_is_not_there_is_told_as_that() -> None:
    """And not as what a function of a plugin does with nothing."""
    read = ("set", {"seen": lambda env: env["target"]["id"]})
    bench = Bench(
        chart({"W": {"itinerary": {"items": []}, "entry": [read]}, "FAULT": {}}, context={"seen": 0})
    )
    assert bench.leaves == ["FAULT"]
    assert bench.machine.view.detail.endswith(
        "there is no target here: the itinerary is empty, or at its end"
    )
