"""Rules of the machine that mutation testing found nobody asking about."""

from __future__ import annotations

from typing import Any

import pytest

from lupin_engine.machine.event import Act, Event, accepted, cancelled, done, failed, progress
from lupin_engine.machine.memory import Phase, Traversal, Visit
from lupin_engine.machine.operations import CANCEL_DEADLINE
from lupin_engine.machine.requests import Possibility
from lupin_engine.machine.snapshot import shift
from lupin_engine.machine.step import Considered, Moment, Refusal
from lupin_engine.plugin.profile import Publish
from lupin_engine.plugin.types import NUMBER, TEXT
from tests.lupin_engine.machine.charts import PAUSE, PLACE, Bench, chart, fails, value

# -- events -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "is_request", "is_attempt_event"),
    [
        ("mission.start", True, False),
        ("operator.abort", True, False),
        ("attempt.done", False, True),
        ("value", False, False),
        ("mission.over", False, False),
    ],
)
def test_an_event_is_a_request_of_an_attempt_or_neither(
    name: str, is_request: bool, is_attempt_event: bool
) -> None:
    """Requests are answered; reports are about an attempt."""
    event = Event(name)
    assert (event.is_request, event.is_attempt_event) == (is_request, is_attempt_event)


# -- what expressions see ------------------------------------------------------------------------------------


def test_an_expression_sees_the_itinerary_of_the_state_it_is_written_in() -> None:
    """Two regions walk at the same time; each one's actions name their own target."""
    say = ("say", {"target": lambda env: env["target"], "left": lambda env: env["itinerary"]["remaining"]})
    regions = {
        "L": {"itinerary": ["a", "b"], "states": {"ON": {"on": {"ask": {"do": say}}}}},
        "R": {"itinerary": ["c"], "states": {"ON": {"on": {"ask": {"do": say}}}}},
    }
    step = Bench(chart({"P": {"kind": "parallel", "states": regions}})).send("ask")
    assert step.commands == (Act("say", {"target": "a", "left": 1}), Act("say", {"target": "c", "left": 0}))


def test_in_state_asks_for_any_of_the_states() -> None:
    """One active state is enough; none is not."""
    rules = [
        {"target": "A", "guard": lambda env: env["in_state"](["B", "C"])},
        {"target": "B", "guard": lambda env: env["in_state"](["A", "C"])},
    ]
    bench = Bench(chart({"A": {}, "B": {}, "C": {}}, on={"go": rules}))
    bench.send("go")
    assert bench.leaves == ["B"]
    bench.send("go")
    assert bench.leaves == ["A"]


def test_held_asks_for_one_hold() -> None:
    """A condition may depend on which hold is engaged."""
    rule = {
        "do": ("say", {"held": lambda env: [env["held"]("pause"), env["held"]("estop")]}),
        "during": ("pause",),
    }
    estop = {"engage": "operator.stop", "release": ("operator.go",), "code": "paused"}
    bench = Bench(chart({"A": {"on": {"ask": rule}}}, holds={"pause": PAUSE, "estop": estop}))
    assert bench.send("ask").commands == (Act("say", {"held": [False, False]}),)
    bench.send("operator.pause")
    assert bench.send("ask").commands == (Act("say", {"held": [True, False]}),)


def test_a_guard_that_fails_is_told_with_its_place_and_its_text() -> None:
    """The author reads where, which condition, and what went wrong."""
    bench = Bench(chart({"A": {"on": {"go": {"target": "B", "guard": lambda env: env["absent"]}}}, "B": {}}))
    assert bench.send("go").notes[0] == "test.yaml:1:1: guard: there is no 'absent'"


# -- actions -------------------------------------------------------------------------------------------------


def test_an_action_that_waited_for_a_release_is_carried_out_once() -> None:
    """The second release has nothing left to do."""
    states = {"A": {"on": {"go": {"do": "!arm.preset", "during": ("pause",)}}}}
    bench = Bench(chart(states, holds={"pause": PAUSE}))
    bench.send("operator.pause")
    assert bench.send("go").commands == ()
    assert bench.send("operator.resume").commands == (Act("arm.preset", {}),)
    bench.send("operator.pause")
    assert bench.send("operator.resume").commands == ()


def test_clearing_forgets_the_code_reported_last() -> None:
    """`report.clear` empties code and detail of what is published."""
    failing = {"invoke": "nav.go", "on_error": {"target": "B", "do": ()}}
    given = chart({"A": failing, "B": {"on": {"fine": {"do": "report.clear"}}}}, codes={"blocked": "blocked"})
    bench = Bench(given)
    bench.send(failed(bench.attempt, "blocked", "by a chair"))
    assert (bench.machine.view.code, bench.machine.view.detail) == ("blocked", "by a chair")
    bench.send("fine")
    assert (bench.machine.view.code, bench.machine.view.detail) == ("", "")


def test_an_exit_action_no_longer_sees_the_children() -> None:
    """States are left one by one: who is left later sees who was left before as gone."""
    say = (
        "say",
        {"child": lambda env: env["in_state"](["A.IN"]), "self": lambda env: env["in_state"](["A"])},
    )
    states = {"A": {"states": {"IN": {}}, "exit": [say], "on": {"go": "B"}}, "B": {}}
    step = Bench(chart(states)).send("go")
    assert step.commands == (Act("say", {"child": False, "self": True}),)


def test_an_invariant_may_speak_of_the_itinerary() -> None:
    """It is evaluated outside of every state and sees the walk that the mission entered last."""
    walk = {"itinerary": ["a", "b"], "on": {"ask": {"do": "said"}}}
    bench = Bench(chart({"W": walk}, invariants={"short": lambda env: env["itinerary"]["total"] < 3}))
    assert bench.send("ask").notes == ()


def test_the_guard_of_a_hold_may_speak_of_the_itinerary() -> None:
    """As an invariant does."""
    hold = {**PAUSE, "engage_guard": lambda env: env["itinerary"]["total"] == 2}
    bench = Bench(chart({"W": {"itinerary": ["a", "b"]}}, holds={"pause": hold}))
    assert bench.send("operator.pause").accepted


# -- errors -------------------------------------------------------------------------------------------------


def told(bench: Bench) -> list[Any]:
    """Return the code and the start of the detail that an `error.execution` came with."""
    (said,) = (command for step in bench.steps for command in step.commands if isinstance(command, Act))
    return [said.arguments["code"], said.arguments["detail"][:30]]


SAY_ERROR = {
    "do": ("say", {"code": lambda env: env["error"]["code"], "detail": lambda env: env["error"]["detail"]})
}


def test_a_broken_invariant_is_an_error_with_code_and_detail() -> None:
    """Whoever handles it can tell it from others."""
    bench = Bench(
        chart({"A": {}}, on={"error.execution": SAY_ERROR}, invariants={"never": lambda env: False})
    )
    assert told(bench) == ["invariant_broken", "test.yaml:1:1: invariant never"]


def test_a_chart_that_does_not_come_to_rest_is_an_error_with_code_and_detail() -> None:
    """What handles it is taken, whatever else the chart was about to do."""
    states = {"A": {"on": {"go": "B"}}, "B": {"always": "C"}, "C": {"always": "B"}, "D": {}}
    bench = Bench(chart(states, on={"error.execution": {"target": "D", **SAY_ERROR}}))
    bench.send("go")
    assert bench.leaves == ["D"]
    assert told(bench) == ["execution_error", "the chart does not come to res"]


def test_a_variable_that_cannot_be_computed_is_the_roots_error() -> None:
    """Nobody wrote it in a state."""
    bench = Bench(chart({"A": {}, "B": {}}, on={"error": "B"}, context={"n": fails}))
    assert bench.leaves == ["B"]
    assert bench.steps[0].notes == ("test.yaml:1:1: context n: division by zero",)


def test_a_timer_that_cannot_be_computed_leaves_the_others() -> None:
    """Without a handler the state stays, with the deadlines that are right."""
    bench = Bench(chart({"A": {"after": {fails: "B", 5.0: "C"}}, "B": {}, "C": {}}))
    bench.wait(5.0)
    assert bench.leaves == ["C"]


def test_an_error_that_an_author_raises_has_no_detail() -> None:
    """It is told all the same."""
    bench = Bench(chart({"A": {"on": {"go": {"do": ("raise", {"event": "error.execution"})}}}}))
    assert bench.send("go").notes == ("nobody handles the error ",)


def test_the_end_of_a_state_that_was_left_is_dropped() -> None:
    """What was raised before it led away."""
    inner = {"states": {"end": {"kind": "final"}}, "entry": [("raise", {"event": "go"})], "on": {"go": "B"}}
    bench = Bench(chart({"Z": {"on": {"in": "A"}}, "A": {**inner, "on_done": "C"}, "B": {}, "C": {}}))
    step = bench.send("in")
    assert bench.leaves == ["B"]
    assert step.notes == ("dropped: done of A, which was left",)


@pytest.mark.parametrize(("event", "detail"), [("error", "by a chair"), ("go", "")])
def test_a_transition_may_report_a_code(event: str, detail: str) -> None:
    """With the detail of the error that it answers, without one when there is none."""
    rule = {"target": "B", "code": "given_up"}
    state = {"invoke": "nav.go", "on_error": rule, "on": {"go": rule}}
    bench = Bench(chart({"A": state, "B": {}}, codes={"given_up": "given up", "blocked": "blocked"}))
    bench.send(failed(bench.attempt, "blocked", "by a chair") if event == "error" else Event(event))
    assert (bench.machine.view.code, bench.machine.view.detail) == ("given_up", detail)


# -- holds --------------------------------------------------------------------------------------------------


def test_a_step_says_which_holds_it_engages_and_releases() -> None:
    """The story of a run tells them by name."""
    bench = Bench(chart({"A": {}}, holds={"pause": PAUSE}))
    assert bench.send("operator.pause").notes == ("hold pause engaged",)
    assert bench.send("operator.resume").notes == ("hold pause released",)


def test_a_hold_reports_its_code_without_a_detail() -> None:
    """What was reported before is not its detail."""
    stop = {"engage": "operator.stop", "release": ("operator.go",), "code": "estop"}
    state = {"invoke": "nav.go", "on_error": "B"}
    bench = Bench(chart({"A": state, "B": {}}, holds={"stop": stop}, codes={"estop": "", "blocked": ""}))
    bench.send(failed(bench.attempt, "blocked", "by a chair"))
    bench.send("operator.stop")
    assert (bench.machine.view.code, bench.machine.view.detail) == ("estop", "")


def test_an_old_value_engages_no_hold() -> None:
    """What was true ten seconds ago is unknown now."""
    stop = {"engage": "input.estop", "release": ("operator.go",), "code": "paused"}
    given = chart({"A": {}}, holds={"stop": stop}, inputs={"estop": {"freshness": 2.0}})
    for stamp, held in ((1.0, ()), (9.0, ("stop",))):
        bench = Bench(given)
        bench.wait(10.0)
        bench.observe("estop", True, stamp)
        assert bench.machine.view.held == held


def test_an_event_waits_when_any_of_its_transitions_does() -> None:
    """Which of them is taken may be different after the release."""
    rules = [{"target": "B", "guard": lambda env: False, "during": ("pause",)}, {"target": "C"}]
    bench = Bench(chart({"A": {"on": {"go": rules}}, "B": {}, "C": {}}, holds={"pause": PAUSE}))
    bench.send("operator.pause")
    assert bench.send("go").notes == ("go waits for the release",)
    bench.send("operator.resume")
    assert bench.leaves == ["C"]


def test_what_was_taken_before_waits_while_held_all_the_same() -> None:
    """What was compiled before does not lead past a hold."""
    bench = Bench(chart({"A": {"on": {"go": "B"}}, "B": {"on": {"back": "A"}}}, holds={"pause": PAUSE}))
    for event in ("go", "back", "go", "back", "operator.pause", "go"):
        bench.send(event)
    assert bench.leaves == ["A"]


def test_a_level_moves_one_region_while_another_waits() -> None:
    """Each region has its own."""
    regions = {
        name: {"states": {"OFF": {"on": {f"input.{name}": "ON"}}, "ON": {}}} for name in ("left", "right")
    }
    bench = Bench(chart({"P": {"kind": "parallel", "states": regions}}, inputs={"left": {}, "right": {}}))
    bench.observe("right", False)
    bench.observe("left", True)
    assert bench.leaves == ["P.left.ON", "P.right.OFF"]


def test_what_is_left_of_a_wait_is_left_after_a_hold() -> None:
    """Also when it is less than a second, and nothing when its time had come."""
    for paused_at, left in ((4.5, 0.5), (5.0, 0.0), (6.0, 0.0)):
        bench = Bench(chart({"A": {"after": {5.0: "B"}}, "B": {}}, holds={"pause": PAUSE}))
        bench.now = paused_at
        bench.send("operator.pause")
        bench.wait(20.0)
        bench.send("operator.resume")
        assert bench.wait_for_next() == left
        assert bench.leaves == ["B"]


def test_the_world_goes_on_while_the_chart_is_held() -> None:
    """A value grows old, and a cancel under way is not waited for any longer than without the hold."""
    state = {"invoke": "nav.go", "on": {"go": "B"}}
    bench = Bench(chart({"A": state, "B": {}}, holds={"pause": PAUSE}, inputs={"x": {"freshness": 2.0}}))
    bench.observe("x", 1)
    bench.send("go")
    bench.send("operator.pause")
    notes = [note for step in bench.wait(CANCEL_DEADLINE) for note in step.notes]
    assert notes == [
        "input.x is unknown: last reported 2 s ago",
        f"nav.go did not confirm its cancel in {CANCEL_DEADLINE:g} s",
    ]


# -- requests -----------------------------------------------------------------------------------------------


def test_a_request_may_be_for_any_region() -> None:
    """The first one need not listen to it."""
    regions = {
        "L": {"states": {"ON": {}}},
        "R": {"states": {"ON": {"on": {"operator.dock": "OFF"}}, "OFF": {}}},
    }
    bench = Bench(chart({"P": {"kind": "parallel", "states": regions}}))
    assert bench.send("operator.dock").accepted
    assert bench.leaves == ["P.L.ON", "P.R.OFF"]


def test_a_state_without_a_label_is_called_this_state() -> None:
    """The sentence is one in any case."""
    step = Bench(chart({"A": {"label": ""}})).send("operator.dock")
    assert step.refusal == Refusal("not_possible", "dock is not possible in this state")


def test_a_mission_that_cannot_start_is_not_for_lack_of_a_pause() -> None:
    """Also where a start releases a hold."""
    stop = {"engage": "operator.stop", "release": ("operator.go", "mission.start"), "code": "paused"}
    states = {"A": {"on": {"go": "B"}}, "B": {"on": {"mission.start": "A"}}}
    bench = Bench(chart(states, holds={"stop": stop}))
    start = bench.send("mission.start", mission_type="")
    assert start.refusal == Refusal("not_possible", "start is not possible in A; it is possible in B")


def test_a_new_mission_has_the_request_and_the_name_of_its_own_only() -> None:
    """Nothing of the last mission's request can be read, and no id is no id."""
    slot = {"slot": True, "states": {"M": {"mission": "M"}, "N": {"mission": "N"}}, "on": {"out": "READY"}}
    missions: dict[str, Any] = {
        "M": {"state": "SLOT.M", "request": {"speed": {"type": NUMBER}}},
        "N": {"state": "SLOT.N"},
    }
    bench = Bench(chart({"READY": {"on": {"mission.start": "SLOT"}}, "SLOT": slot}, missions=missions))
    assert bench.send("mission.start", mission_type="M", mission_id="m1", speed=2.0).accepted
    assert (bench.machine.view.mission_id, bench.machine.memory.request) == ("m1", {"speed": 2.0})
    bench.send("out")
    assert bench.send("mission.start", mission_type="N").accepted
    assert (bench.machine.view.mission_id, bench.machine.memory.request) == ("", {})


# -- what is shown ------------------------------------------------------------------------------------------


def test_a_live_value_is_shown_as_long_as_it_is_known() -> None:
    """Asked at a later time, it may have grown old."""
    bench = Bench(chart({"A": {}}, inputs={"pose": {"freshness": 2.0}}))
    bench.observe("pose", 7, 0.0)
    assert bench.machine.input_value("pose", 1.5) == 7
    assert bench.machine.input_value("pose", 2.5) is None


def test_the_first_step_is_called_start() -> None:
    """It is what a journal begins with."""
    assert Bench(chart({"A": {}})).steps[0].event == Event("start")


def possibility(bench: Bench, event: str) -> Possibility:
    """Return what an event could do now."""
    return next(found for found in bench.machine.explain(bench.now) if found.event == event)


def test_an_explanation_names_all_that_is_considered_or_taken() -> None:
    """Reasons stand between semicolons, transitions between commas."""
    regions = {
        name: {
            "on": {
                "go": {"id": name, "guard": lambda env: env["context"]["free"]},
                "step": {"id": f"{name}.step"},
            }
        }
        for name in ("L", "R")
    }
    bench = Bench(chart({"P": {"kind": "parallel", "states": regions}}, context={"free": False}))
    reason = "(test.yaml:1:1): guard is false"
    assert str(possibility(bench, "go")) == f"go: L {reason}; R {reason}"
    assert str(possibility(bench, "step")) == "step: L.step, R.step"
    assert possibility(bench, "step").considered[0] == Considered("L.step", PLACE, "", holds=True)


def test_a_machine_that_did_nothing_has_nothing_to_tell() -> None:
    """No code, no mission, no target."""
    memory = Bench(chart({"A": {}})).machine.memory
    found = (memory.code, memory.detail, memory.mission, memory.mission_id, memory.current_itinerary)
    assert found == ("",) * 5


def test_the_phases_of_an_attempt_have_names() -> None:
    """They stand in what is published and in snapshots, which another version may read."""
    names = ["waiting", "requested", "accepted", "replaced", "cancelling", "lost", "refused"]
    assert [phase.value for phase in Phase] == names
    bench = Bench(chart({"A": {"invoke": "nav.go"}}))
    (attempt,) = bench.machine.view.attempts
    assert (attempt.phase, attempt.detail) == ("requested", "")


def test_a_walk_is_at_its_first_target_in_its_only_sweep() -> None:
    """What nothing else was said of; past its last target it has none."""
    walk = Traversal("W", ["a"], [Visit("a")])
    assert (walk.index, walk.sweep, walk.sweeps, walk.leaves_open, walk.item) == (0, 1, 1, False, "a")
    walk.index = 1
    assert (walk.item, walk.visit, walk.remaining) == (None, None, 0)


# -- operations ---------------------------------------------------------------------------------------------


def deadlines(bench: Bench) -> list[str]:
    """Return the kinds of the deadlines that run or stand still."""
    memory = bench.machine.memory
    return [kind for _, _, kind, _ in (*memory.timers, *memory.frozen)]


def test_an_operation_that_is_cancelled_cannot_time_out() -> None:
    """Only its cancel has a deadline then."""
    bench = Bench(chart({"A": {"invoke": {"do": "nav.go", "timeout": 9.0}, "on": {"go": "B"}}, "B": {}}))
    assert deadlines(bench) == ["timeout"]
    bench.send("go")
    assert deadlines(bench) == ["cancel"]


def test_an_operation_that_has_answered_cannot_time_out() -> None:
    """Also while its answer waits for the release of a hold."""
    state = {"invoke": {"do": "bridge.read", "timeout": 9.0}, "on_done": "B"}
    bench = Bench(chart({"A": state, "B": {}}, holds={"pause": PAUSE}))
    bench.send("operator.pause")
    bench.send(done(bench.attempt, {}))
    assert (bench.leaves, deadlines(bench)) == (["A"], [])


@pytest.mark.parametrize(
    ("how", "code", "detail"),
    [("cancelled", "operation_cancelled", "ended by the server"), ("silent", "timeout", "on its way")],
)
def test_an_end_that_nobody_gave_a_code_has_one(how: str, code: str, detail: str) -> None:
    """A server that gives up by itself, a timeout without a code of its own."""
    bench = Bench(chart({"A": {"invoke": {"do": "nav.go", "timeout": 9.0}, "on_error": "B"}, "B": {}}))
    bench.send(progress(bench.attempt, "on its way"))
    if how == "cancelled":
        bench.send(cancelled(bench.attempt))
    else:
        bench.wait(9.0)
    assert bench.leaves == ["B"]
    assert (bench.machine.view.code, bench.machine.view.detail) == (code, detail)


# -- steps --------------------------------------------------------------------------------------------------


def test_a_step_shows_what_it_passed() -> None:
    """The outermost label and the innermost phase after each microstep, each once; the last one is now."""
    states = {
        "A": {"on": {"go": "B.ONE"}},
        "B": {
            "phase": "outer",
            "states": {"ONE": {"phase": "inner", "always": "TWO"}, "TWO": {"always": "C"}},
        },
        "C": {"label": "", "states": {"IN": {"label": ""}}},
    }
    bench = Bench(chart(states))
    assert bench.steps[0].trail == (Moment("A", "", ""),)
    assert bench.send("go").trail == (Moment("B", "inner", ""), Moment("B", "outer", ""), Moment("", "", ""))


def test_a_helper_that_is_passed_is_not_shown() -> None:
    """States are published in upper case; one in lower case only leads on."""
    states = {
        "A": {"on": {"go": "choose"}},
        "choose": {"always": "B"},
        "B": {"on": {"go": "rest"}},
        "rest": {},
    }
    bench = Bench(chart(states))
    assert bench.send("go").trail == (Moment("B", "", ""),)
    assert (bench.send("go").trail, bench.machine.view.lifecycle) == ((), "rest")


def test_history_is_asked_anew_also_beside_another_transition() -> None:
    """What a history state stands for may have changed since the same transitions were taken."""
    family = {
        "a": {"on": {"flip": "b"}},
        "b": {"on": {"flip": "a"}},
        "PAST": {"kind": "history", "depth": 1},
    }
    left = {"F": {"states": family}, "OUT": {"on": {"back": "F.PAST"}}}
    regions = {
        "L": {"states": left, "on": {"out": "OUT"}},
        "R": {"states": {"r": {"on": {"back": {"do": "said"}}}}},
    }
    bench = Bench(chart({"P": {"kind": "parallel", "states": regions}}))
    for events, expected in ((("out", "back"), "P.L.F.a"), (("flip", "out", "back"), "P.L.F.b")):
        for event in events:
            bench.send(event)
        assert bench.leaves == [expected, "P.R.r"]


@pytest.mark.parametrize(
    ("given", "expected"),
    [({"n": 2, "name": "x"}, {"n": 2, "name": "x"}), ({"name": ""}, {"n": 5, "name": ""})],
)
def test_the_smallest_number_is_allowed_and_so_is_an_empty_text(given: Any, expected: Any) -> None:
    """What is absent has its default; an empty text is one."""
    request = {
        "n": {"type": NUMBER, "default": value(5), "minimum": 2},
        "name": {"type": TEXT, "default": value("all")},
    }
    slot = {"slot": True, "states": {"M": {"mission": "M"}}}
    states = {"READY": {"on": {"mission.start": "SLOT"}}, "SLOT": slot}
    bench = Bench(chart(states, missions={"M": {"state": "SLOT.M", "request": request}}))
    assert bench.send("mission.start", mission_type="M", **given).accepted
    assert bench.machine.memory.request == expected


def test_a_step_of_several_microsteps_tells_all_of_them() -> None:
    """Left, taken and entered in their order, and how often there was a step before."""
    states = {
        "A": {"on": {"go": {"id": "first", "target": "B"}}},
        "B": {"always": {"id": "second", "target": "C"}},
        "C": {},
    }
    bench = Bench(chart(states))
    step = bench.send("go")
    assert (step.exited, step.taken, step.entered) == (("A", "B"), ("first", "second"), ("B", "C"))
    assert repr(step) == "<Step 2 at 0: go: first, second>"
    assert [one.sequence for one in bench.steps] == [1, 2]


def test_a_step_in_which_nothing_happens_has_not_changed_anything() -> None:
    """It shows where the machine is; a transition or a command is a change."""
    states = {"A": {"on": {"go": "B"}}, "B": {"on": {"act": {"do": "!arm.preset", "during": ("pause",)}}}}
    bench = Bench(chart(states, holds={"pause": PAUSE}))
    nothing = bench.send("nonsense")
    assert (nothing.changed, nothing.configuration) == (False, ("", "A"))
    moved = bench.send("go")
    assert (moved.changed, moved.commands, moved.configuration) == (True, (), ("", "B"))
    bench.send("operator.pause")
    bench.send("act")
    released = bench.send("operator.resume")
    assert (released.changed, released.taken, released.commands) == (True, (), (Act("arm.preset", {}),))


def test_a_live_value_is_as_old_on_another_clock() -> None:
    """Its stamp moves with the deadlines."""
    bench = Bench(chart({"A": {}}, inputs={"pose": {"freshness": 8.0}}))
    bench.observe("pose", 1, 0.0)
    shift(bench.machine.memory, 100.0)
    assert bench.machine.input_value("pose", 107.5) == 1
    assert bench.machine.input_value("pose", 108.5) is None


# -- live values, targets, what is published ----------------------------------------------------------------


@pytest.mark.parametrize(("given", "taken"), [(0.0, True), (1.0, True), (-0.1, False), (1.1, False)])
def test_the_ends_of_a_range_are_within_it(given: float, taken: bool) -> None:
    """Beyond them a report is dropped."""
    bench = Bench(chart({"A": {}}, inputs={"charge": {"minimum": 0.0, "maximum": 1.0}}))
    bench.observe("charge", given)
    assert (bench.machine.input_value("charge", 0.0) == given) is taken


def test_a_level_of_the_last_mission_has_no_hysteresis_in_the_next() -> None:
    """What the value was about is over; 0.22 is not low unless it was before."""
    levels = {"low": {"below": 0.2, "hysteresis": 0.05}}
    slot = {"slot": True, "states": {"M": {"mission": "M"}}, "on": {"out": "READY"}}
    bench = Bench(
        chart(
            {"READY": {"on": {"mission.start": "SLOT"}}, "SLOT": slot},
            inputs={"charge": {"levels": levels, "of_mission": True}},
            missions={"M": {"state": "SLOT.M"}},
        )
    )
    found = []
    for event in ("mission.start", "out", "mission.start"):
        bench.send(event, mission_type="M")
        if event == "mission.start":
            for given in (0.22, 0.1, 0.22):
                bench.observe("charge", given)
                found.append(bench.machine.memory.levels["input.charge.low"])
    assert found == [False, True, True] * 2


def test_a_level_that_cannot_be_computed_is_the_roots_error() -> None:
    """It belongs to no state."""
    inputs = {"charge": {"levels": {"low": {"below": fails}}}}
    bench = Bench(chart({"A": {}, "B": {}}, on={"error": "B"}, inputs=inputs))
    assert bench.observe("charge", 0.5).notes == ("test.yaml:1:1: level low: division by zero",)
    assert bench.leaves == ["B"]


def test_without_an_itinerary_there_is_nothing_to_count() -> None:
    """All counters are zero, and nobody waits for the operator."""
    view = Bench(chart({"A": {}})).machine.view
    assert (view.total, set(view.counts.values())) == (0, {0})
    assert not view.paused


def test_the_view_counts_outcomes_and_says_who_waits() -> None:
    """One counter for each outcome; a state may wait for the operator without a hold."""
    ends = ["OK", "UNREACHABLE", "SCAN_FAILED", "SKIPPED", "UNREACHABLE"]
    close = [("itinerary.close", {"status": lambda env: env["event"]["status"]}), "itinerary.advance"]
    states = {
        "W": {"itinerary": list("abcde"), "on": {"end": {"do": close}, "out": "STOP"}},
        "STOP": {"paused": True},
    }
    bench = Bench(chart(states))
    for status in ends:
        bench.send("end", status=status)
    view = bench.machine.view
    assert view.total == 5
    assert view.counts == {"OK": 1, "SCAN_FAILED": 1, "UNREACHABLE": 2, "SKIPPED": 1}
    assert not view.paused
    bench.send("out")
    assert bench.machine.view.paused


def test_an_outcome_is_published_with_its_detail() -> None:
    """Code and detail are for whoever reads what became of a target."""
    outcome = {"status": "SCAN_FAILED", "code": "scan_timeout", "detail": "5 s"}
    walk = {"itinerary": ["a"], "on": {"end": {"do": ("itinerary.close", outcome)}}}
    assert Bench(chart({"W": walk})).send("end").commands == (
        Publish("", "", "a", "SCAN_FAILED", "scan_timeout", "5 s"),
    )


def test_every_sweep_goes_in_the_order_and_its_targets_are_seen_so() -> None:
    """Expressions and what is published agree on the current target; at the end there is none to rank."""
    step = [
        ("itinerary.close", {"status": "OK", "detail": lambda env: env["target"]}),
        "itinerary.advance",
    ]
    walk = {
        "itinerary": {"items": ["3", "1", "2"], "order": lambda env: int(env["target"]), "sweeps": 2},
        "on": {"end": {"do": step}},
    }
    bench = Bench(chart({"W": walk}))
    steps = [bench.send("end") for _ in range(6)]
    told = [command for step in steps for command in step.commands if isinstance(command, Publish)]
    assert [(one.target, one.detail) for one in told] == [(name, name) for name in "123123"]
    assert [step.notes for step in steps] == [()] * 6


def test_sweeps_that_cannot_be_computed_are_one() -> None:
    """The list is walked once; a chart without FAULT stays."""
    bench = Bench(chart({"W": {"itinerary": {"items": ["a"], "sweeps": fails}}}))
    walk = bench.machine.memory.traversal
    assert walk is not None
    assert (walk.sweeps, walk.is_last_sweep) == (1, True)


ENDS = {
    "done": lambda attempt: done(attempt, {}),
    "failed": lambda attempt: failed(attempt, "blocked"),
    "cancelled": cancelled,
}


@pytest.mark.parametrize(("word", "leaf"), [("done", "GOOD"), ("failed", "BAD"), ("cancelled", "BAD")])
def test_an_accepted_operation_ends_with_every_word(word: str, leaf: str) -> None:
    """After that nothing is known of it, and nothing is to be cancelled."""
    state = {"invoke": "nav.go", "on_done": "GOOD", "on_error": "BAD"}
    bench = Bench(chart({"A": state, "GOOD": {}, "BAD": {}}))
    bench.send(accepted(bench.attempt))
    step = bench.send(ENDS[word](bench.attempt))
    assert (bench.leaves, step.commands, bench.machine.memory.attempts) == ([leaf], (), {})


def test_an_accepted_operation_that_nobody_wants_is_cancelled() -> None:
    """Its server works on it."""
    bench = Bench(chart({"A": {"invoke": "nav.go", "on": {"go": "B"}}, "B": {}}))
    bench.send(accepted(bench.attempt))
    bench.send("go")
    assert bench.commands == ["cancel a2"]
    assert bench.machine.view.cancelling == ("nav.go",)


@pytest.mark.parametrize("word", ENDS)
def test_a_lost_operation_that_ends_after_all_is_forgotten(word: str) -> None:
    """Its server is free again."""
    bench = Bench(chart({"A": {"invoke": "nav.go", "on": {"go": "B"}}, "B": {}}))
    attempt = bench.attempt
    bench.send("go")
    bench.wait_for_next()
    assert [one.phase for one in bench.machine.memory.attempts.values()] == [Phase.LOST]
    bench.send(ENDS[word](attempt))
    assert bench.machine.memory.attempts == {}


@pytest.mark.parametrize(("word", "leaf"), [("done", "GOOD"), ("failed", "BAD"), ("cancelled", "BAD")])
def test_an_end_passes_a_hold_where_its_transition_does(word: str, leaf: str) -> None:
    """Success and failure each by their own transitions."""
    for during, expected in ((("pause",), leaf), ((), "A")):
        rules = {name: {"target": name, "during": during} for name in ("GOOD", "BAD")}
        state = {"invoke": "bridge.read", "on_done": rules["GOOD"], "on_error": rules["BAD"]}
        bench = Bench(chart({"A": state, "GOOD": {}, "BAD": {}}, holds={"pause": PAUSE}))
        bench.send("operator.pause")
        bench.send(ENDS[word](bench.attempt))
        assert bench.leaves == [expected]
