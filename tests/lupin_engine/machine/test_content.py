"""Actions, inputs, itineraries, and what becomes of an error in them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from lupin_engine.chart.model import Variable
from lupin_engine.machine.event import Act, Report
from lupin_engine.plugin.profile import Publish
from lupin_engine.plugin.types import ANY, COUNT, TEXT, Type, list_of, set_of, within
from tests.lupin_engine.machine.charts import PAUSE, PLACE, Bench, chart, fails, said, value

BROKEN = ("arm.preset", {"name": lambda env: env["absent"]})


# -- errors -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("where", ["entry", "exit", "action", "guard"])
def test_an_error_leads_to_fault_with_its_place(where: str) -> None:
    """An exception in an action or a guard is the chart's FAULT, never a traceback."""
    first: dict[str, Any] = {"on": {"go": {"target": "B"}}}
    second: dict[str, Any] = {}
    if where == "entry":
        second["entry"] = [BROKEN, "never.done"]
    elif where == "exit":
        first["exit"] = BROKEN
    elif where == "action":
        first["on"]["go"]["do"] = BROKEN
    else:
        first["on"]["go"]["guard"] = lambda env: env["absent"]
    bench = Bench(chart({"A": first, "B": second, "FAULT": {}}))
    step = bench.send("go")
    assert bench.leaves == ["FAULT"]
    assert bench.machine.view.code == "execution_error"
    assert bench.machine.view.detail.startswith("test.yaml:1:1: ")
    assert "never.done" not in str(step.commands)


@pytest.mark.parametrize("by", [-0.5, 2.0])
def test_an_action_with_a_computed_argument_outside_its_range_is_not_sent(by: float) -> None:
    """What the catalog rules out reaches no plugin."""
    bench = Bench(chart({"A": {"entry": ("arm.nod", {"by": lambda env: by})}, "FAULT": {}}))
    if by < 0.0:
        detail = "test.yaml:1:1: arm.nod: by: expected number between 0 and 2, got -0.5"
        assert (bench.leaves, bench.machine.view.detail, bench.commands) == (["FAULT"], detail, [])
    else:
        assert (bench.leaves, bench.steps[0].commands[0]) == (["A"], Act("arm.nod", {"by": 2.0}))


def test_the_states_own_error_handler_goes_first() -> None:
    """A state that handles errors hears of its own."""
    state = {
        "entry": BROKEN,
        "on_error": {"target": "C", "do": ("set", {"seen": lambda env: env["error"]["code"]})},
    }
    bench = Bench(chart({"A": state, "C": {}, "FAULT": {}}, context={"seen": ""}))
    assert bench.leaves == ["C"]
    assert bench.context["seen"] == "execution_error"


def test_an_error_in_the_error_handler_leads_to_fault() -> None:
    """A guard that fails in `on_error` does not send the engine round in circles."""
    handler = {"target": "C", "guard": lambda env: env["absent"]}
    bench = Bench(chart({"A": {"entry": BROKEN, "on_error": handler}, "C": {}, "FAULT": {}}))
    assert bench.leaves == ["FAULT"]


def test_a_note_is_said_in_the_step() -> None:
    """With what its expressions are then."""
    note = ("report.note", {"text": lambda env: f"seen: {env['context']['seen']}"})
    step = Bench(chart({"A": {"on": {"go": {"do": [note]}}}}, context={"seen": "tulip"})).send("go")
    assert step.notes == ("seen: tulip",)


def test_an_error_without_fault_is_told() -> None:
    """A chart without FAULT stays where it is; the step says what nobody handled."""
    bench = Bench(chart({"A": {"on": {"go": {"do": BROKEN}}}}))
    step = bench.send("go")
    assert step.notes == (
        "test.yaml:1:1: arm.preset: there is no 'absent'",
        "nobody handles the error test.yaml:1:1: arm.preset: there is no 'absent'",
    )


def test_an_error_in_fault_does_not_repeat() -> None:
    """An entry action of FAULT that fails leads nowhere."""
    bench = Bench(chart({"A": {"on": {"go": "FAULT"}}, "FAULT": {"entry": BROKEN}}))
    bench.send("go")
    assert bench.leaves == ["FAULT"]


def test_a_failing_guard_of_an_eventless_transition_is_one_error() -> None:
    """It is asked again in every microstep and reported once."""
    state = {
        "always": {"target": "B", "guard": lambda env: env["absent"]},
        "on": {"error.execution": {"do": "told"}},
    }
    bench = Bench(chart({"A": state, "B": {}}))
    assert bench.commands == ["act told"]


def test_a_timer_that_cannot_be_computed_is_an_error() -> None:
    """No state waits for a time that nobody knows."""
    bench = Bench(chart({"A": {"after": {(lambda env: 1 / 0): "B"}}, "B": {}, "FAULT": {}}))
    assert bench.leaves == ["FAULT"]


def test_an_itinerary_that_cannot_be_computed_is_an_error() -> None:
    """A mission without a list of targets is over before it begins."""
    bench = Bench(chart({"A": {"itinerary": lambda env: env["absent"]}, "FAULT": {}}))
    assert bench.leaves == ["FAULT"]


# -- inputs -----------------------------------------------------------------------------------------------

BATTERY = {"battery": {"value": "robot.battery", "levels": {"low": (0.2, 0.05)}}}


def charge(bench: Bench, value: float) -> None:
    """Let the battery have a charge."""
    bench.send("value", name="robot.battery", value=value, stamp=bench.now)


def test_a_guard_on_an_unknown_input_is_false_and_says_so() -> None:
    """Nothing is assumed of a value that was never reported."""
    rule = {"target": "B", "guard": lambda env: env["input"]["battery"]["low"]}
    bench = Bench(chart({"A": {"on": {"go": rule}}, "B": {}}, inputs=BATTERY))
    step = bench.send("go")
    assert bench.leaves == ["A"]
    assert step.notes[0] == "test.yaml:1:1: guard: input.battery is unknown"


def test_a_value_older_than_its_freshness_is_unknown() -> None:
    """What was true once need not be true now."""
    inputs = {"pose": {"freshness": 2.0}}
    rule = {"target": "B", "guard": lambda env: env["known"]("pose")}
    for waited, expected in ((1.9, "B"), (2.0, "A")):
        bench = Bench(chart({"A": {"on": {"go": rule}}, "B": {}}, inputs=inputs))
        bench.send("value", name="pose", value=1, stamp=0.0)
        bench.wait(waited)
        bench.send("go")
        assert bench.leaves == [expected]


def test_a_level_is_a_state_of_the_world_not_an_edge() -> None:
    """A transition on a level is taken whenever the level is true, also when it rose before."""
    states = {"A": {"on": {"go": "B"}}, "B": {"on": {"input.battery.low": "C"}}, "C": {}}
    bench = Bench(chart(states, inputs=BATTERY))
    charge(bench, 0.1)
    assert bench.leaves == ["A"]
    bench.send("go")
    assert bench.leaves == ["C"]


def test_a_level_has_hysteresis() -> None:
    """A low battery is low until it is clearly charged."""
    bench = Bench(chart({"A": {}}, inputs=BATTERY))
    found = []
    for charged in (0.5, 0.19, 0.2, 0.24, 0.25, 0.21):
        charge(bench, charged)
        found.append(bench.machine.memory.levels["input.battery.low"])
    assert found == [False, True, True, True, False, False]


def test_levels_wait_while_held() -> None:
    """A level does not move a held chart, unless its transition says so."""
    for during, expected in (((), "A"), (("pause",), "B")):
        states = {"A": {"on": {"input.battery.low": {"target": "B", "during": during}}}, "B": {}}
        bench = Bench(chart(states, inputs=BATTERY, holds={"pause": PAUSE}))
        bench.send("operator.pause")
        charge(bench, 0.1)
        assert bench.leaves == [expected]
        bench.send("operator.resume")
        assert bench.leaves == ["B"]


# -- itineraries ------------------------------------------------------------------------------------------


def walking(**on: Any) -> Bench:
    """Return a bench that walks the targets 1, 2 and 3."""
    items = [{"id": name} for name in ("1", "2", "3")]
    walk = {"itinerary": items, "states": {"VISIT": {"on": {name: {"do": do} for name, do in on.items()}}}}
    walk["on"] = {"out": "Z"}
    family = {"states": {"W": walk, "PAST": {"kind": "history", "depth": 1}}}
    out = {"F": family, "Z": {"on": {"back": "F.PAST", "again": "F"}}}
    return Bench(chart(out))


CLOSE = ("itinerary.close", {"status": "OK", "reading": {"t": 21}})
FAIL = ("itinerary.close", {"status": "SCAN_FAILED", "code": "scan_timeout", "detail": "5 s"})
REST = ("itinerary.close_rest", {"status": "SKIPPED", "code": "mission_aborted"})


def test_closing_publishes_once() -> None:
    """A visit is closed exactly once; the second time changes nothing and says so."""
    bench = walking(close=CLOSE, fail=FAIL)
    step = bench.send("close")
    assert step.commands == (Publish("", "", "1", "OK", "", "", {"t": 21}),)
    again = bench.send("fail")
    assert again.commands == ()
    assert again.notes == ("itinerary.close refused: the current visit is closed already",)


def test_an_open_visit_cannot_be_left_behind() -> None:
    """`advance` is an error while the current visit has no outcome, or the robot would never get on."""
    bench = walking(next="itinerary.advance", close=CLOSE)
    step = bench.send("next")
    told = "test.yaml:1:1: itinerary.advance: the current visit is open: close it before going on"
    assert step.notes == (told, f"nobody handles the error {told}")
    assert bench.machine.view.target == "1"
    bench.send("close")
    bench.send("next")
    assert bench.machine.view.target == "2"


def test_close_rest_closes_what_is_open() -> None:
    """Every open visit gets its outcome, in order, and only those."""
    bench = walking(close=CLOSE, rest=REST)
    bench.send("close")
    step = bench.send("rest")
    assert said(step) == ["publish 2 SKIPPED", "publish 3 SKIPPED"]
    assert bench.send("rest").commands == ()
    view = bench.machine.view
    assert (view.total, view.counts["OK"], view.counts["SKIPPED"]) == (3, 1, 2)


def test_an_itinerary_survives_its_state() -> None:
    """Who comes back by history goes on with the same list at the same place; who enters anew begins it."""
    bench = walking(close=CLOSE, next="itinerary.advance")
    for event in ("close", "next", "out"):
        bench.send(event)
    assert bench.machine.view.target == ""
    bench.send("back")
    assert bench.machine.view.target == "2"
    bench.send("out")
    bench.send("again")
    assert bench.machine.view.target == "1"
    assert (bench.machine.view.counts["OK"], bench.machine.view.total) == (1, 6)  # of both walks


def test_a_summary_tells_every_visit() -> None:
    """The last word holds closed and open visits."""
    bench = walking(fail=FAIL, sum="report.summary")
    bench.send("fail")
    (report,) = bench.send("sum").commands
    assert isinstance(report, Report)
    assert [(visit["target"], visit["status"], visit["code"]) for visit in report.visits] == [
        ("1", "SCAN_FAILED", "scan_timeout"),
        ("2", "", ""),
        ("3", "", ""),
    ]


def test_context_is_written_by_set() -> None:
    """`set` evaluates against what was before it."""
    rule = {"do": ("set", {"n": lambda env: env["context"]["n"] + 1})}
    bench = Bench(chart({"A": {"on": {"go": rule}}}, context={"n": 1}))
    bench.send("go")
    bench.send("go")
    assert bench.context["n"] == 3


def test_a_variable_keeps_within_its_type() -> None:
    """A count below zero is an error with its place, whichever way the event goes, and nothing is written."""
    less = ("set", {"n": lambda env: env["context"]["n"] - 1})
    states = {
        "A": {"on": {"less": {"target": "B", "do": less}}},
        "B": {"on": {"less": {"target": "A", "do": less}}},
    }
    given = chart(states, context={"n": 3})
    bench = Bench(replace(given, context={"n": Variable("n", COUNT, value(3), PLACE)}))
    steps = [bench.send("less") for _ in range(5)]
    assert bench.context == {"n": 0}
    told = "test.yaml:1:1: set: n is a count of at least 0, got -1"
    assert [step.notes for step in steps[2:]] == [(), *[(told, f"nobody handles the error {told}")] * 2]


def collecting(kind: Type, *before: Any) -> Bench:
    """Return a bench that puts what comes into a variable, and takes it out again."""
    came = {"seen": lambda env: env["event"]["id"]}
    state = {"on": {"came": {"do": ("add", came)}, "went": {"do": ("remove", came)}}}
    given = chart({"A": state, "FAULT": {}})
    return Bench(replace(given, context={"seen": Variable("seen", kind, value(list(before)), PLACE)}))


@pytest.mark.parametrize(
    ("kind", "kept"), [(list_of(TEXT), ["a", "b", "a"]), (set_of(TEXT), ["a", "b"])], ids=str
)
def test_what_is_added_is_kept_in_the_order_in_which_it_came(kind: Type, kept: list[str]) -> None:
    """A set has each once; what is removed is removed everywhere, and what is not there may be removed."""
    bench = collecting(within(kind, None, 3))
    for name in ("a", "b", "a"):
        before = bench.context["seen"]
        bench.send("came", id=name)
        assert bench.context["seen"] is not before, "earlier steps keep what they saw"
    assert bench.context["seen"] == kept
    bench.restart()
    bench.send("went", id="a")
    bench.send("went", id="z")
    assert (bench.context["seen"], bench.leaves) == (["b"], ["A"])


@pytest.mark.parametrize("kind", [list_of(TEXT), set_of(TEXT)], ids=str)
def test_a_list_that_is_full_takes_nothing_more(kind: Type) -> None:
    """It is an error, for what is forgotten without a word is done twice; a set may be told what it has."""
    bench = collecting(within(kind, None, 2), "a", "b")
    if kind.distinct:
        assert bench.send("came", id="a").notes == ()
    bench.send("came", id="c")
    detail = f"test.yaml:1:1: add: seen is a {kind} of at most 2 elements, got 3"
    assert (bench.leaves, bench.machine.view.detail) == (["FAULT"], detail)
    assert bench.context["seen"] == ["a", "b"]


def test_a_number_stays_at_or_below_its_maximum() -> None:
    """As it stays above its minimum."""
    more = ("set", {"n": lambda env: env["context"]["n"] + 1})
    given = chart({"A": {"on": {"more": {"do": more}}}, "FAULT": {}})
    bench = Bench(replace(given, context={"n": Variable("n", within(COUNT, None, 2), value(1), PLACE)}))
    bench.send("more")
    assert (bench.context, bench.leaves) == ({"n": 2}, ["A"])
    bench.send("more")
    detail = "test.yaml:1:1: set: n is a count of at most 2, got 3"
    assert (bench.context, bench.leaves, bench.machine.view.detail) == ({"n": 2}, ["FAULT"], detail)


def test_records_are_told_apart_by_all_that_they_say() -> None:
    """In a set as elsewhere, two that are equal are one."""
    bench = collecting(within(set_of(ANY), None, 2), {"id": "a"}, {"id": "a"})
    assert bench.context["seen"] == [{"id": "a"}]
    bench.send("came", id={"id": "a"})
    bench.send("came", id={"id": "a", "x": 1.0})
    assert bench.context["seen"] == [{"id": "a"}, {"id": "a", "x": 1.0}]


def test_a_variable_keeps_no_text_of_any_length() -> None:
    """What grows at every event would fill the memory."""
    bench = collecting(within(list_of(TEXT), None, 2))
    bench.send("came", id="x" * 10_001)
    told = "test.yaml:1:1: add: seen is a text of 10001 characters; at most 10000 are kept"
    assert (bench.leaves, bench.machine.view.detail, bench.context) == (["FAULT"], told, {"seen": []})


def test_a_choice_that_fails_is_told_and_writes_nothing() -> None:
    """Two variables of one `set` are written together or not at all, by the second way as by the first."""
    both = ("set", {"n": lambda env: env["context"]["n"] - 1, "m": lambda env: env["context"]["m"] + 1})
    choice = [
        {"target": "B", "guard": lambda env: env["event"]["odd"], "do": both},
        {"target": "C", "do": both},
    ]
    back = {"on": {"back": "A"}}
    given = chart({"A": {"on": {"go": choice}}, "B": back, "C": back}, context={"n": 2, "m": 0})
    bench = Bench(replace(given, context={**given.context, "n": Variable("n", COUNT, value(2), PLACE)}))
    seen = []
    for odd in (True, False, True):
        bench.send("go", odd=odd)
        seen.append((bench.leaves[0], dict(bench.context)))
        bench.send("back")
    assert seen == [("B", {"n": 1, "m": 1}), ("C", {"n": 0, "m": 2}), ("B", {"n": 0, "m": 2})]
    step = bench.send("go")
    assert bench.leaves == ["C"], "a guard that cannot be evaluated is false, and an error"
    assert step.notes[0].startswith("test.yaml:1:1: guard: there is no 'odd'")


def test_a_choice_may_choose_nothing() -> None:
    """When no guard of a choice that was met before holds, nothing happens, and the step says why."""
    choice = [{"target": name, "guard": lambda env, n=name: env["event"]["to"] == n} for name in ("B", "C")]
    bench = Bench(chart({"A": {"on": {"go": choice}}, "B": {"on": {"back": "A"}}, "C": {}}))
    for to in ("B", "nowhere"):
        step = bench.send("go", to=to)
        bench.send("back")
    assert bench.leaves == ["A"]
    assert (step.taken, len(step.why)) == ((), 2)


# -- if ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("laps", "done"), [(0, ["few", "after"]), (3, ["many", "after"])])
def test_an_if_chooses_between_actions(laps: int, done: list[str]) -> None:
    """Its guard is looked at when its turn comes, so it sees what the list has set before."""
    choice = ("if", {"guard": lambda env: env["context"]["laps"] > 3, "then": "many", "else": "few"})
    count = ("set", {"laps": lambda env: env["context"]["laps"] + 1})
    bench = Bench(chart({"A": {"on": {"go": {"do": [count, choice, "after"]}}}}, context={"laps": laps}))
    step = bench.send("go")
    assert [command.action for command in step.commands if isinstance(command, Act)] == done


def test_an_if_without_else_may_do_nothing() -> None:
    """And one in another asks only where that has chosen it."""
    asked: list[str] = []
    inner = ("if", {"guard": lambda env: asked.append("inner") or True, "then": "never.done"})
    choice = ("if", {"guard": lambda env: asked.append("outer") or False, "then": [inner]})
    bench = Bench(chart({"A": {"on": {"go": {"do": [choice]}}}}))
    assert (bench.send("go").commands, asked) == ((), ["outer"])


def test_an_unknown_value_makes_the_guard_of_an_if_false() -> None:
    """As it does for a transition, and the step says so."""
    choice = ("if", {"guard": lambda env: env["input"]["place"] > 1, "then": "far", "else": "near"})
    bench = Bench(chart({"A": {"on": {"go": {"do": [choice]}}}}, inputs={"place": {}}))
    step = bench.send("go")
    assert step.commands == (Act("near", {}),)
    assert step.notes == ("test.yaml:1:1: guard: input.place is unknown",)


def test_an_error_in_an_if_ends_the_whole_list() -> None:
    """What stands behind relied on it."""
    choice = ("if", {"guard": lambda env: True, "then": [BROKEN]})
    bench = Bench(chart({"A": {"on": {"go": {"do": [choice, "never.done"]}}}, "FAULT": {}}))
    step = bench.send("go")
    assert (bench.leaves, step.commands) == (["FAULT"], ())
    assert bench.machine.view.detail == "test.yaml:1:1: arm.preset: there is no 'absent'"


# -- what events and results carry ------------------------------------------------------------------------


def test_a_raised_event_carries_fields() -> None:
    """They are worked out where it is raised; guard and actions of who hears it see them."""
    here = ("raise", {"event": "tag.seen", "with": {"tag": lambda env: env["context"]["next"]}})
    heard = {
        "target": "C",
        "guard": lambda env: env["event"]["tag"] == "7",
        "do": ("set", {"next": lambda env: env["event"]["tag"] + "!"}),
    }
    bench = Bench(
        chart(
            {"A": {"on": {"go": {"target": "B", "do": [here]}}}, "B": {"on": {"tag.seen": heard}}, "C": {}},
            context={"next": "7"},
        )
    )
    step = bench.send("go")
    assert (bench.leaves, bench.context["next"]) == (["C"], "7!")
    assert step.notes == ("tag.seen carries tag 7",)


def test_the_end_of_a_state_gives_the_result_of_its_final_state() -> None:
    """It is computed after the entry actions of that, and read as the event of `done`."""
    final = {
        "kind": "final",
        "entry": ("set", {"n": 3}),
        "result": {"n": value(lambda env: env["context"]["n"] + env["event"]["more"])},
    }
    outer = {"states": {"B": {"on": {"go": "end"}}, "end": final}, "initial": "B"}
    ended = {"target": "C", "do": ("set", {"n": lambda env: env["event"]["n"]})}
    bench = Bench(chart({"A": {**outer, "on_done": ended}, "C": {}}, context={"n": 0}))
    step = bench.send("go", more=1)
    assert (bench.leaves, bench.context["n"], step.notes) == (["C"], 4, ("end gives n 4",))


def test_a_result_that_cannot_be_computed_leads_to_fault() -> None:
    """And not to where the end would have led."""
    final = {"kind": "final", "result": {"n": value(fails)}}
    tree = {"A": {"states": {"B": {"on": {"go": "end"}}, "end": final}, "initial": "B", "on_done": "C"}}
    bench = Bench(chart({**tree, "C": {}, "FAULT": {}}))
    bench.send("go")
    assert bench.leaves == ["FAULT"]
    assert bench.machine.view.detail == "test.yaml:1:1: result: division by zero"


def test_the_event_is_seen_through_eventless_transitions_of_its_step() -> None:
    """As SCXML's `_event`: in guards, actions and what is entered, until the next event is dealt with."""
    seen = ("set", {"seen": lambda env: env["event"]["where"]})
    states = {
        "A": {"on": {"blocked": "HOP"}, "on_done": "A"},
        "HOP": {"always": [{"target": "B", "guard": lambda env: env["event"]["where"] > 3}, {"target": "A"}]},
        "B": {"entry": seen, "always": {"target": "C", "do": ("raise", {"event": "next"})}},
        "C": {
            "invoke": {"do": "nav.go", "with": {"to": lambda env: env["event"]["where"]}},
            "on": {"next": "D"},
        },
        "D": {"entry": seen},
        "FAULT": {},
    }
    bench = Bench(chart(states, context={"seen": 0}))
    bench.send("blocked", where=7)
    assert bench.context["seen"] == 7
    assert bench.leaves == ["FAULT"]  # what was raised is the event now, and has no such field
    other = Bench(chart({**states, "C": {**states["C"], "on": {}}}, context={"seen": 0}))
    other.send("blocked", where=7)
    assert other.started[0].arguments == {"to": 7}
    assert other.leaves == ["C"]
