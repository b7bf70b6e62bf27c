"""What is left, done and entered, and in which order: SCXML's answers."""

from __future__ import annotations

from typing import Any

import pytest

from tests.lupin_engine.machine.charts import Bench, chart


def loud(name: str, **described: Any) -> dict[str, Any]:
    """Return a state that says when it is entered and left."""
    return {"entry": f"enter.{name}", "exit": f"exit.{name}", **described}


NESTED = {
    "A": loud(
        "A",
        states={
            "B": loud(
                "B", states={"C": loud("C", on={"go": {"target": "Z", "do": "transition"}}), "D": loud("D")}
            ),
            "E": loud("E"),
        },
        on={"up": "A", "side": "E", "down": "B.D", "inside": {"target": "E", "internal": True}},
    ),
    "Z": loud("Z", states={"Y": loud("Y"), "X": loud("X")}, initial="X"),
}


def done(bench: Bench) -> list[str]:
    """Return the actions that the last step carried out, in order."""
    return [word.removeprefix("act ") for word in bench.commands]


def test_exits_go_outwards_entries_inwards() -> None:
    """Children are left before parents; the transition acts; parents are entered before children."""
    bench = Bench(chart(NESTED))
    assert done(bench) == ["enter.A", "enter.B", "enter.C"]
    step = bench.send("go")
    assert done(bench) == ["exit.C", "exit.B", "exit.A", "transition", "enter.Z", "enter.X"]
    assert step.exited == ("A.B.C", "A.B", "A")
    assert step.entered == ("Z", "Z.X")
    assert bench.leaves == ["Z.X"]


@pytest.mark.parametrize(
    ("event", "expected"),
    [
        ("up", ["exit.C", "exit.B", "exit.A", "enter.A", "enter.B", "enter.C"]),
        ("side", ["exit.C", "exit.B", "exit.A", "enter.A", "enter.E"]),
        ("down", ["exit.C", "exit.B", "exit.A", "enter.A", "enter.B", "enter.D"]),
        ("inside", ["exit.C", "exit.B", "enter.E"]),
    ],
)
def test_an_external_transition_leaves_its_source(event: str, expected: list[str]) -> None:
    """A transition leaves and re-enters its source state unless it says that it is internal."""
    bench = Bench(chart(NESTED))
    bench.send(event)
    assert done(bench) == expected


def test_inner_states_answer_first() -> None:
    """An event is offered to the innermost state, then outwards."""
    bench = Bench(chart({"A": {"states": {"B": {"on": {"go": "C"}}, "C": {}}, "on": {"go": "Z"}}, "Z": {}}))
    bench.send("go")
    assert bench.leaves == ["A.C"]
    bench.send("go")
    assert bench.leaves == ["Z"]


def test_the_first_written_wins() -> None:
    """Of several transitions of a state the first one whose guard holds is taken."""
    rules = [
        {"target": "B", "guard": lambda env: env["event"].get("b")},
        {"target": "C", "guard": lambda env: env["event"].get("c")},
        "D",
    ]
    states = {"A": {"on": {"go": rules}}, "B": {}, "C": {}, "D": {}}
    for data, expected in (({"b": 1, "c": 1}, "B"), ({"c": 1}, "C"), ({}, "D")):
        bench = Bench(chart(states))
        bench.send("go", **data)
        assert bench.leaves == [expected]


def test_a_false_guard_lets_the_parent_answer() -> None:
    """A transition whose guard is false leaves the event to the outer states."""
    inner = {"B": {"on": {"go": {"target": "C", "guard": lambda env: False}}}, "C": {}}
    bench = Bench(chart({"A": {"states": inner, "on": {"go": "Z"}}, "Z": {}}))
    bench.send("go")
    assert bench.leaves == ["Z"]


def test_names_and_wildcards_compete_in_the_order_written() -> None:
    """A wildcard written first is taken before an exact name, whichever another state listens to first."""
    rules = {"nav.*": "B", "nav.gone": "C", "*": "D"}
    bench = Bench(chart({"Z": {"on": {"nav.gone": "A"}}, "A": {"on": rules}, "B": {}, "C": {}, "D": {}}))
    bench.send("nav.gone")
    bench.send("nav.gone")
    assert bench.leaves == ["B"]


def test_a_transition_without_target_acts_and_stays() -> None:
    """Without a target nothing is left or entered."""
    bench = Bench(chart({"A": {"on": {"go": {"do": "wave"}}}}))
    step = bench.send("go")
    assert done(bench) == ["wave"]
    assert (step.exited, step.entered) == ((), ())


def test_the_engine_says_that_nobody_listens() -> None:
    """An event that nothing listens to changes nothing, and the step says why."""
    bench = Bench(chart({"A": {}}))
    step = bench.send("greenhouse.flooded")
    assert not step.changed
    assert step.notes == ("nobody listens to greenhouse.flooded",)


# -- eventless transitions and internal events ------------------------------------------------------------


def test_eventless_transitions_go_before_internal_events() -> None:
    """What needs no event is taken first, then what was raised, then the next event from outside."""
    states = {
        "A": {"on": {"go": {"target": "B", "do": ("raise", {"event": "ping"})}}},
        "B": {"always": "C", "on": {"ping": "WRONG"}},
        "C": {"on": {"ping": "D"}},
        "D": {},
        "WRONG": {},
    }
    bench = Bench(chart(states))
    step = bench.send("go")
    assert bench.leaves == ["D"]
    assert step.entered == ("B", "C", "D")


def test_what_a_step_takes_adds_up() -> None:
    """Also where a transition without a target comes first, which leaves and enters nothing."""
    states = {
        "A": {
            "on": {
                "go": {"id": "first", "do": ("raise", {"event": "ping"})},
                "ping": {"id": "second", "target": "B"},
            }
        },
        "B": {},
    }
    step = Bench(chart(states)).send("go")
    assert (step.taken, step.exited, step.entered) == (("first", "second"), ("A",), ("B",))


def test_internal_events_keep_their_order() -> None:
    """Raised events are processed in the order in which they were raised."""
    raising = [("raise", {"event": "one"}), ("raise", {"event": "two"})]
    states = {"A": {"entry": raising, "on": {"one": {"do": "first"}, "two": {"do": "second"}}}}
    assert done(Bench(chart(states))) == ["first", "second"]


def test_a_cycle_of_eventless_transitions_is_told() -> None:
    """A chart that never comes to rest says which transitions repeat; what it commanded is not lost."""
    states = {
        "A": {"exit": "stop", "on": {"go": "B"}},
        "B": {"always": {"target": "C", "id": "b-to-c"}},
        "C": {"always": {"target": "B", "id": "c-to-b"}},
    }
    bench = Bench(chart(states))
    step = bench.send("go")
    assert step.notes == ("the chart does not come to rest after go: it repeats c-to-b, b-to-c",)
    assert bench.machine.view.detail == step.notes[0]
    assert bench.commands == ["act stop"]
    assert bench.leaves in (["B"], ["C"])


def test_a_cycle_leads_to_fault_where_there_is_one() -> None:
    """The drive that was under way is cancelled, and the fault names the transitions that repeat."""
    states = {
        "A": {"invoke": "nav.go", "on_done": "B", "on_error": "B", "on": {"go": "B"}},
        "B": {"always": {"target": "C", "id": "b-to-c"}},
        "C": {"always": "B"},
        "FAULT": {},
    }
    bench = Bench(chart(states, initial="A"))
    first = bench.attempt
    step = bench.send("go")
    assert bench.leaves == ["FAULT"]
    assert f"cancel {first}" in bench.commands
    assert step.taken[-1] == "engine.fault"
    assert "it repeats" in bench.machine.view.detail
    assert "b-to-c" in bench.machine.view.detail


# -- done -------------------------------------------------------------------------------------------------


def test_a_final_child_ends_its_parent() -> None:
    """Reaching a final state raises `done` for its parent, and only for that."""
    inner = {"B": {"on": {"go": "end"}}, "end": {"kind": "final"}}
    outer = {"M": {"states": inner, "on_done": "N"}, "N": {}}
    bench = Bench(chart({"A": {"states": outer, "on_done": "WRONG"}, "WRONG": {}}))
    bench.send("go")
    assert bench.leaves == ["A.N"]


def test_a_parallel_state_is_done_when_all_regions_are() -> None:
    """`done` of a parallel state comes with the last of its regions, whatever their order."""
    regions = {
        "R": {"states": {"r": {"on": {"r.end": "f"}}, "f": {"kind": "final"}}},
        "S": {"states": {"s": {"on": {"s.end": "f"}}, "f": {"kind": "final"}}},
    }
    for first, second in (("r.end", "s.end"), ("s.end", "r.end")):
        bench = Bench(chart({"P": {"kind": "parallel", "states": regions, "on_done": "Z"}, "Z": {}}))
        bench.send(first)
        assert "P" in bench.machine.memory.configuration
        bench.send(second)
        assert bench.leaves == ["Z"]


def test_a_history_child_does_not_keep_a_parallel_state_from_its_end() -> None:
    """A history state is no region."""
    region = {"states": {"r": {"on": {"end": "f"}}, "f": {"kind": "final"}}}
    states = {"R": region, "H": {"kind": "history", "depth": 1}}
    bench = Bench(chart({"P": {"kind": "parallel", "states": states, "on_done": "Z"}, "Z": {}}))
    bench.send("end")
    assert bench.leaves == ["Z"]


def test_a_parallel_region_ends_when_its_own_regions_do() -> None:
    """A region that is parallel itself has ended when all of its regions have."""
    region = {"states": {"r": {"on": {"end": "f"}}, "f": {"kind": "final"}}}
    inner = {"kind": "parallel", "states": {"I": region, "J": region}}
    bench = Bench(
        chart({"P": {"kind": "parallel", "states": {"Q": inner, "R": region}, "on_done": "Z"}, "Z": {}})
    )
    bench.send("end")
    assert bench.leaves == ["Z"]


# -- parallel ---------------------------------------------------------------------------------------------

PARALLEL = {
    "P": {
        "kind": "parallel",
        "states": {
            "R": loud("R", states={"r1": loud("r1", on={"both": "r2", "mix": "Z"}), "r2": loud("r2")}),
            "S": loud("S", states={"s1": loud("s1", on={"both": "s2", "mix": "s2"}), "s2": loud("s2")}),
        },
        "on": {"out": "Z", "into": "S.s2"},
    },
    "Z": loud("Z"),
}


def test_every_region_answers() -> None:
    """One event moves every region that listens, in document order: all exits, then all entries."""
    bench = Bench(chart(PARALLEL))
    bench.send("both")
    assert bench.leaves == ["P.R.r2", "P.S.s2"]
    assert done(bench) == ["exit.s1", "exit.r1", "enter.r2", "enter.s2"]


def test_leaving_a_parallel_state_leaves_all_regions() -> None:
    """The later region is left first, children before parents."""
    bench = Bench(chart(PARALLEL))
    bench.send("out")
    assert done(bench) == ["exit.s1", "exit.S", "exit.r1", "exit.R", "enter.Z"]


def test_conflicting_transitions_the_first_region_wins() -> None:
    """A region that leaves the parallel state wins over what a later region wants to do in it."""
    bench = Bench(chart(PARALLEL))
    bench.send("mix")
    assert bench.leaves == ["Z"]


def test_an_inner_transition_wins_over_an_outer_one() -> None:
    """A transition of the parallel state gives way to one of a region, although it was found first."""
    regions = {"R": {"states": {"r": {}}}, "S": {"states": {"s1": {"on": {"go": "s2"}}, "s2": {}}}}
    bench = Bench(chart({"P": {"kind": "parallel", "states": regions, "on": {"go": "Z"}}, "Z": {}}))
    bench.send("go")
    assert bench.leaves == ["P.R.r", "P.S.s2"]


def test_a_target_in_one_region_enters_the_others_anew() -> None:
    """Entering a region by name enters its neighbours with their first states."""
    bench = Bench(chart(PARALLEL))
    bench.send("both")
    bench.send("into")
    assert bench.leaves == ["P.R.r1", "P.S.s2"]


def test_guards_see_the_state_before_the_step() -> None:
    """No region's guard sees what another region does in the same step."""
    regions = {
        "R": {"states": {"r1": {"on": {"go": "r2"}}, "r2": {}}},
        "S": {"states": {"s1": {"on": {"go": {"target": "s2", "guard": _in("P.R.r1")}}}, "s2": {}}},
    }
    bench = Bench(chart({"P": {"kind": "parallel", "states": regions}}))
    bench.send("go")
    assert bench.leaves == ["P.R.r2", "P.S.s2"]


def _in(state: str) -> Any:
    return lambda env: env["in_state"]((state,))


# -- history ----------------------------------------------------------------------------------------------


def remembering(depth: int | None) -> dict[str, Any]:
    """Return states with a history in M, `depth` levels deep."""
    inner = {"B": {"states": {"b1": {"on": {"next": "b2"}}, "b2": {}}}, "C": {}}
    return {
        "M": {
            "states": {"A": {"on": {"next": "B"}}, **inner, "H": {"kind": "history", "depth": depth}},
            "on": {"out": "Z"},
        },
        "Z": {"on": {"back": "M.H"}},
    }


@pytest.mark.parametrize(("depth", "expected"), [(1, "M.B.b1"), (2, "M.B.b2"), (None, "M.B.b2")])
def test_history(depth: int | None, expected: str) -> None:
    """Shallow history comes back to the child, deep history to the leaf."""
    bench = Bench(chart(remembering(depth)))
    for event in ("next", "next", "out", "back"):
        bench.send(event)
    assert bench.leaves == [expected]


def test_history_without_a_past_enters_the_parent() -> None:
    """Who comes back to where nobody was begins there."""
    bench = Bench(chart(remembering(1), initial="Z"))
    bench.send("back")
    assert bench.leaves == ["M.A"]


def test_history_without_a_past_enters_what_it_says() -> None:
    """Its own beginning goes before its parent's; with a past, that counts."""
    states = {
        "Z": {"on": {"back": "A.H", "in": "A.D"}},
        "A": {
            "states": {
                "B": {},
                "C": {},
                "D": {},
                "H": {"kind": "history", "depth": 1, "initial": "C"},
            },
            "on": {"out": "Z"},
        },
    }
    bench = Bench(chart(states, initial="Z"))
    bench.send("back")
    assert bench.leaves == ["A.C"]
    for event in ("out", "in", "out", "back"):
        bench.send(event)
    assert bench.leaves == ["A.D"]


def test_deep_history_remembers_every_region() -> None:
    """Deep history of a parallel state restores all of its regions."""
    regions = {
        "R": {"states": {"r1": {"on": {"r": "r2"}}, "r2": {}}},
        "S": {"states": {"s1": {"on": {"s": "s2"}}, "s2": {}}},
        "H": {"kind": "history", "depth": None},
    }
    bench = Bench(
        chart(
            {"P": {"kind": "parallel", "states": regions, "on": {"out": "Z"}}, "Z": {"on": {"back": "P.H"}}}
        )
    )
    for event in ("s", "out", "back"):
        bench.send(event)
    assert bench.leaves == ["P.R.r1", "P.S.s2"]


def test_history_from_within_keeps_the_parent_active() -> None:
    """A transition to the history of a state that is active stays inside it."""
    inner = {"A": {"on": {"again": "M.H"}}, "B": {}, "H": {"kind": "history", "depth": 1}}
    bench = Bench(chart({"M": {"states": inner, "entry": "enter.M"}}))
    step = bench.send("again")
    assert step.exited == ("M.A",)
    assert step.entered == ("M.A",)
    assert bench.machine.memory.configuration == ("", "M", "M.A")


def test_resume_at_chooses_the_child() -> None:
    """A state that comes back by history goes on where `resume_at` says, and begins normally otherwise."""
    walk = {
        "states": {"DRIVE": {"on": {"next": "SCAN"}}, "SCAN": {}, "SHOW": {}},
        "resume_at": [{"target": "SHOW", "guard": lambda env: env["context"]["closed"]}, {"target": "DRIVE"}],
    }
    history = {"kind": "history", "depth": 1}
    states = {
        "M": {"states": {"W": walk, "H": history}, "on": {"out": "Z"}},
        "Z": {"on": {"back": "M.H", "anew": "M"}},
    }
    for closed, expected in ((True, "M.W.SHOW"), (False, "M.W.DRIVE")):
        bench = Bench(chart(states, context={"closed": closed}))
        for event in ("next", "out", "back"):
            bench.send(event)
        assert bench.leaves == [expected]
        bench.send("out")
        bench.send("anew")
        assert bench.leaves == ["M.W.DRIVE"]


@pytest.mark.parametrize("history", ["M.W.OWN", "M.W.ALL", "M.DEEP"])
def test_resume_at_counts_for_every_history_that_brings_its_state_back(history: str) -> None:
    """Its own history, and a deep one around it, lead where `resume_at` says; the itinerary goes on."""
    walk = {
        "states": {
            "DRIVE": {"on": {"next": "SCAN"}},
            "SCAN": {},
            "OWN": {"kind": "history", "depth": 1},
            "ALL": {"kind": "history", "depth": None},
        },
        "itinerary": ["a", "b"],
        "resume_at": [{"target": "DRIVE", "guard": lambda env: env["itinerary"]["open"]}],
    }
    deep = {"kind": "history", "depth": None}
    states = {"M": {"states": {"W": walk, "DEEP": deep}, "on": {"out": "Z"}}, "Z": {"on": {"back": history}}}
    bench = Bench(chart(states))
    first = bench.machine.memory.itineraries["M.W"]
    for event in ("next", "out", "back"):
        bench.send(event)
    assert bench.leaves == ["M.W.DRIVE"]
    assert bench.machine.memory.itineraries["M.W"] is first
    first.visits[0].status = "OK"
    for event in ("next", "out", "back"):
        bench.send(event)
    assert bench.leaves == ["M.W.SCAN"]


# -- timers -----------------------------------------------------------------------------------------------


def test_a_timer_belongs_to_its_state() -> None:
    """`after` counts from the entry and is gone when the state is left."""
    states = {"A": {"after": {5.0: "B"}, "on": {"again": "A", "away": "C"}}, "B": {}, "C": {}}
    bench = Bench(chart(states))
    bench.wait(4.0)
    bench.send("again")
    assert bench.wait(4.9) == []
    assert [step.time for step in bench.wait(1.0)] == [9.0]
    assert bench.leaves == ["B"]
    other = Bench(chart(states))
    other.send("away")
    assert other.machine.next_deadline is None


def test_timers_fire_in_the_order_of_time_then_of_arming() -> None:
    """Of two timers that are due together the one that was armed first fires first."""
    acts = {2.0: {"do": "late"}, 1.0: {"do": "early"}, 1.0 + 1e-12: {"do": "next"}}
    bench = Bench(chart({"A": {"after": acts}}))
    bench.wait(1.0 + 1e-9)
    bench.wait(1.0)
    found = [word for step in bench.steps for command in step.commands for word in [command.action]]
    assert found == ["early", "next", "late"]


def test_a_timer_of_no_time_still_lets_the_step_end() -> None:
    """`after: 0 s` is due at once, in a step of its own."""
    bench = Bench(chart({"A": {"after": {0.0: "B"}}, "B": {}}))
    assert bench.leaves == ["A"]
    bench.wait(0.0)
    assert bench.leaves == ["B"]


# -- patterns ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("pattern", "event", "heard"),
    [
        ("nav.*", "nav.gone", True),
        ("nav.*", "nav.gone.far", True),
        ("nav.*", "nav", False),
        ("nav.*", "navigation.gone", False),
        ("nav", "nav.gone", False),
        ("*", "nav.gone", True),
        ("*", "operator", True),
        ("*", "operator.abort", False),
        ("*", "answer.go_on", False),
    ],
)
def test_prefixes_and_the_wildcard(pattern: str, event: str, heard: bool) -> None:
    """A prefix covers what stands below it, word by word; the wildcard covers all that happens, and nothing
    that a person asks for: an abort would be answered, and nobody aborted."""
    bench = Bench(chart({"A": {"on": {pattern: "B"}}, "B": {}}))
    bench.send(event)
    assert (bench.leaves == ["B"]) == heard


def test_the_wildcard_is_not_about_the_engines_own_events() -> None:
    """The end of an operation, an error and a timer are heard by who asked for them."""
    states: dict[str, Any] = {
        "A": {
            "states": {"x": {"on": {"go": "f"}}, "f": {"kind": "final"}},
            "on": {"*": {"do": "heard"}},
            "entry": ("set", {"n": lambda env: env["absent"]}),
            "after": {1.0: {"do": "timed"}},
        }
    }
    bench = Bench(chart(states, context={"n": 0}))
    assert done(bench) == []
    bench.wait(1.0)
    assert done(bench) == ["timed"]
    bench.send("go")
    assert done(bench) == []
    bench.send("other")
    assert done(bench) == ["heard"]


@pytest.mark.parametrize(
    "name", ["", "done", "error.execution", "error", "after.0", "budget", "input.x", "input"]
)
def test_the_engines_own_events_come_from_nobody_else(name: str) -> None:
    """Dropped, with a note; nothing is taken."""
    rules: dict[str, Any] = {
        "on_done": "B",
        "on_error": "B",
        "always": {"target": "B", "guard": lambda env: False},
    }
    states = {"A": {**rules, "after": {9.0: "B"}, "on": {"input.x": "B"}}, "B": {}, "FAULT": {}}
    bench = Bench(chart(states, inputs={"x": {}}))
    step = bench.send(name)
    assert step.notes == (f"dropped: {name!r} is the engine's own event, and nobody else's",)
    assert (bench.leaves, step.changed) == (["A"], False)


# -- self transitions -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("rule", "expected"),
    [
        ({"do": "act"}, ["act"]),
        ({"target": "M", "do": "act"}, ["exit.x", "exit.M", "act", "enter.M", "enter.x"]),
        ({"target": "M", "do": "act", "internal": True}, ["exit.x", "exit.M", "act", "enter.M", "enter.x"]),
        ({"target": "M.x", "do": "act"}, ["exit.x", "exit.M", "act", "enter.M", "enter.x"]),
        ({"target": "M.x", "do": "act", "internal": True}, ["exit.x", "act", "enter.x"]),
    ],
    ids=["targetless", "external self", "internal self", "external", "internal"],
)
def test_transitions_to_oneself(rule: dict[str, Any], expected: list[str]) -> None:
    """Only an internal transition to a descendant keeps its source; without a target nothing is left."""
    bench = Bench(chart({"M": loud("M", states={"x": loud("x")}, on={"go": rule})}))
    bench.send("go")
    assert done(bench) == expected


def test_an_internal_transition_of_a_parallel_state_is_external() -> None:
    """SCXML: only a compound state can be kept."""
    regions = {"R": loud("R"), "S": loud("S")}
    rule = {"target": "P.S", "internal": True}
    bench = Bench(chart({"P": loud("P", kind="parallel", states=regions, on={"go": rule})}))
    bench.send("go")
    assert done(bench) == ["exit.S", "exit.R", "exit.P", "enter.P", "enter.R", "enter.S"]


# -- raise ------------------------------------------------------------------------------------------------


def test_what_is_raised_comes_in_the_order_of_exits_actions_and_entries() -> None:
    """One queue for all of a step; each event sees where the earlier ones led."""

    def shout(word: str) -> tuple[str, dict[str, str]]:
        return ("raise", {"event": word})

    hear = {word: {"do": f"heard.{word}"} for word in ("left", "acted", "entered", "deeper")}
    states = {
        "A": {"exit": shout("left"), "on": {"go": {"target": "B", "do": shout("acted")}}},
        "B": {"entry": shout("entered"), "states": {"C": {"entry": shout("deeper")}}, "on": hear},
    }
    bench = Bench(chart(states))
    bench.send("go")
    assert done(bench) == ["heard.left", "heard.acted", "heard.entered", "heard.deeper"]


def test_what_is_raised_goes_before_the_next_event_from_outside() -> None:
    """Events of one step are done with before the next one begins."""
    states = {
        "A": {"on": {"go": {"target": "B", "do": ("raise", {"event": "inner"})}}},
        "B": {"on": {"inner": "C", "outer": "WRONG"}},
        "C": {"on": {"outer": "D"}},
        "D": {},
        "WRONG": {},
    }
    bench = Bench(chart(states))
    bench.send("go")
    bench.send("outer")
    assert bench.leaves == ["D"]


def test_what_is_raised_for_nobody_is_told() -> None:
    """As an event from outside would be."""
    bench = Bench(chart({"A": {"entry": ("raise", {"event": "ping"})}}))
    assert bench.steps[0].notes == ("nobody listens to ping",)


def test_an_end_that_comes_too_late_is_dropped() -> None:
    """What was raised before it has led out of the state; nobody there could hear."""
    inner = {"x": {"on": {"end": "f"}}, "f": {"kind": "final", "entry": ("raise", {"event": "leave"})}}
    bench = Bench(
        chart({"M": {"states": inner, "on": {"leave": "Z"}, "on_done": "WRONG"}, "Z": {}, "WRONG": {}})
    )
    step = bench.send("end")
    assert (bench.leaves, step.notes) == (["Z"], ("dropped: done of M, which was left",))


def test_nothing_is_fired_before_its_time() -> None:
    """Nor when nothing is armed."""
    bench = Bench(chart({"A": {"after": {5.0: "B"}}, "B": {}}))
    assert bench.machine.advance(4.9) is None
    assert bench.wait(5.0) != []
    assert (bench.machine.next_deadline, bench.machine.advance(99.0)) == (None, None)


# -- more of parallel states ------------------------------------------------------------------------------


def test_a_transition_from_deeper_wins_over_an_earlier_one() -> None:
    """SCXML's preemption: of two that leave the same, the descendant's goes before its ancestor's."""
    inner = {"s": {"states": {"deep": {"on": {"go": "s2"}}, "s2": {}}, "on": {"go": "Z"}}}
    regions = {"R": {"states": {"r": {}}}, "S": {"states": inner}}
    bench = Bench(chart({"P": {"kind": "parallel", "states": regions, "on": {"go": "Z"}}, "Z": {}}))
    step = bench.send("go")
    assert (bench.leaves, len(step.taken)) == (["P.R.r", "P.S.s.s2"], 1)


def test_three_regions_the_first_that_leaves_wins() -> None:
    """Later ones in conflict are dropped, with their actions; what was chosen before them is dropped too."""
    act = {"target": "x2", "do": "moved"}
    regions = {
        "R": {"states": {"x": {"on": {"go": act}}, "x2": {}}},
        "S": {"states": {"x": {"on": {"go": {"target": "Y", "do": "left"}}}}},
        "T": {"states": {"x": {"on": {"go": {"target": "Z", "do": "late"}}}}},
    }
    bench = Bench(chart({"P": {"kind": "parallel", "states": regions}, "Y": {}, "Z": {}}))
    bench.send("go")
    assert (bench.leaves, done(bench)) == (["P.R.x2", "P.S.x", "P.T.x"], ["moved"])


def test_without_targets_there_is_no_conflict() -> None:
    """What leaves nothing goes beside what leaves everything."""
    regions = {
        "R": {"states": {"x": {"on": {"go": {"do": "noted"}}}}},
        "S": {"states": {"x": {"on": {"go": {"target": "Z", "do": "left"}}}}},
    }
    bench = Bench(chart({"P": {"kind": "parallel", "states": regions}, "Z": {}}))
    bench.send("go")
    assert (bench.leaves, done(bench)) == (["Z"], ["noted", "left"])


def test_a_transition_that_all_regions_share_is_taken_once() -> None:
    """Offered to every leaf, chosen for every leaf, and one transition all the same."""
    regions: dict[str, Any] = {"R": {"states": {"x": {}}}, "S": {"states": {"x": {}}}}
    bench = Bench(chart({"P": {"kind": "parallel", "states": regions, "on": {"go": {"do": "once"}}}}))
    bench.send("go")
    assert done(bench) == ["once"]


def test_a_root_may_be_parallel() -> None:
    """Its regions end the chart together; nobody listens to that end, and nothing happens."""
    region = {"states": {"x": {"on": {"go": "f"}}, "f": {"kind": "final"}}}
    bench = Bench(chart({"R": region, "S": region}, kind="parallel"))
    step = bench.send("go")
    assert (bench.leaves, step.notes, step.trail) == (["R.f", "S.f"], (), ())


ENDING = {"states": {"r": {"on": {"end": "f"}}, "f": {"kind": "final"}}}


@pytest.mark.parametrize("order", [("i", "j", "r"), ("r", "j", "i"), ("i", "r", "j")])
def test_nested_parallel_states_end_with_the_last_of_their_regions(order: tuple[str, ...]) -> None:
    """Whichever is the last: the inner one's end is heard, then the outer one's."""

    def ending(word: str) -> dict[str, Any]:
        return {"states": {"x": {"on": {word: "f"}}, "f": {"kind": "final"}}}

    inner = {
        "kind": "parallel",
        "states": {"I": ending("i"), "J": ending("j")},
        "on_done": {"do": "inner.done"},
    }
    outer = {
        "kind": "parallel",
        "states": {"Q": inner, "R": ending("r")},
        "on_done": {"target": "Z", "do": "outer.done"},
    }
    bench = Bench(chart({"P": outer, "Z": {}}))
    heard = [word for event in order for word in (bench.send(event), done(bench))[1]]
    assert (bench.leaves, heard) == (["Z"], ["inner.done", "outer.done"])


def test_an_inner_parallel_state_that_has_ended_does_not_end_the_outer_one() -> None:
    """Another region still works."""
    inner = {"kind": "parallel", "states": {"I": ENDING, "J": ENDING}}
    regions = {"Q": inner, "R": {"states": {"x": {}}}}
    bench = Bench(chart({"P": {"kind": "parallel", "states": regions, "on_done": "Z"}, "Z": {}}))
    bench.send("end")
    assert bench.leaves == ["P.Q.I.f", "P.Q.J.f", "P.R.x"]


def test_a_final_state_at_the_top_ends_the_chart() -> None:
    """There is nobody above it who could hear."""
    bench = Bench(chart({"A": {"on": {"go": "f"}}, "f": {"kind": "final"}}))
    assert (bench.send("go").notes, bench.leaves) == ((), ["f"])


# -- history in parallel states -----------------------------------------------------------------------------


def two_regions(depth: int | None) -> dict[str, Any]:
    """Return a parallel state whose first region remembers its past, `depth` levels deep."""
    deep = {"states": {"x": {"on": {"next": "y"}}, "y": {}}}
    first = {"states": {"A": {"on": {"next": "B"}}, "B": deep, "H": {"kind": "history", "depth": depth}}}
    second = {"states": {"s": {"on": {"next": "t"}}, "t": {"on": {"again": "P.R.H"}}}}
    parallel = {"kind": "parallel", "states": {"R": first, "S": second}, "on": {"out": "Z"}}
    return {"P": parallel, "Z": {"on": {"back": "P.R.H"}}}


@pytest.mark.parametrize(("depth", "expected"), [(1, "P.R.B.x"), (None, "P.R.B.y")])
def test_the_history_of_one_region_enters_the_others_anew(depth: int | None, expected: str) -> None:
    """Shallow comes back to the child, deep to the leaf; who has no history begins."""
    bench = Bench(chart(two_regions(depth)))
    for event in ("next", "next", "out", "back"):
        bench.send(event)
    assert bench.leaves == [expected, "P.S.s"]


def test_a_region_may_send_another_to_its_past() -> None:
    """The parallel state is left and entered; what the region was at that moment is its past."""
    bench = Bench(chart(two_regions(None)))
    bench.send("next")
    assert bench.leaves == ["P.R.B.x", "P.S.t"]
    step = bench.send("again")
    assert bench.leaves == ["P.R.B.x", "P.S.s"]
    assert set(step.exited) == {"P", "P.R", "P.R.B", "P.R.B.x", "P.S", "P.S.t"}


def test_shallow_history_of_a_parallel_state_enters_its_regions_anew() -> None:
    """One level down are the regions themselves."""
    region = {"states": {"x": {"on": {"next": "y"}}, "y": {}}}
    regions = {"R": region, "S": region, "H": {"kind": "history", "depth": 1}}
    states = {"P": {"kind": "parallel", "states": regions, "on": {"out": "Z"}}, "Z": {"on": {"back": "P.H"}}}
    bench = Bench(chart(states))
    for event in ("next", "out", "back"):
        bench.send(event)
    assert bench.leaves == ["P.R.x", "P.S.x"]


def test_two_histories_of_one_state_remember_differently() -> None:
    """Each what it is asked for."""
    inner = {"B": {"states": {"x": {"on": {"next": "y"}}, "y": {}}}}
    past = {"H": {"kind": "history", "depth": 1}, "D": {"kind": "history", "depth": None}}
    states = {
        "M": {"states": {**inner, **past}, "on": {"out": "Z"}},
        "Z": {"on": {"back": "M.H", "deep": "M.D"}},
    }
    for event, expected in (("back", "M.B.x"), ("deep", "M.B.y")):
        bench = Bench(chart(states))
        for name in ("next", "out", event):
            bench.send(name)
        assert bench.leaves == [expected]


def test_resume_at_may_leave_it_to_the_first_child() -> None:
    """Where none of its guards holds, or none is written, a state begins as always."""
    walk = {
        "states": {"DRIVE": {"on": {"next": "SCAN"}}, "SCAN": {}},
        "resume_at": [{"target": "SCAN", "guard": lambda env: False}],
    }
    states = {
        "M": {"states": {"W": walk, "H": {"kind": "history", "depth": 1}}, "on": {"out": "Z"}},
        "Z": {"on": {"back": "M.H"}},
    }
    bench = Bench(chart(states))
    for event in ("next", "out", "back"):
        bench.send(event)
    assert bench.leaves == ["M.W.DRIVE"]


# -- a chart that never comes to rest -----------------------------------------------------------------------


def test_a_cycle_through_fault_is_left_as_it_is() -> None:
    """FAULT that does not rest either ends the step all the same; what it commanded is not lost."""
    states = {
        "A": {"always": {"target": "B", "id": "a-b"}},
        "B": {"always": {"target": "A", "id": "b-a"}},
        "FAULT": {"always": "A"},
    }
    bench = Bench(chart(states))
    assert bench.steps[0].notes[-1] == "nor does it after the error: it is left as it is"
    assert len(bench.steps[0].taken) > 1000
    assert len(bench.leaves) == 1


def test_a_cycle_of_raised_events_is_one_too() -> None:
    """An event that raises itself is told by the transition that repeats."""
    rule = {"id": "echo", "do": ("raise", {"event": "ping"})}
    bench = Bench(chart({"A": {"on": {"ping": rule}}, "FAULT": {}}))
    step = bench.send("ping")
    assert step.notes == ("the chart does not come to rest after ping: it repeats echo",)
    assert bench.leaves == ["FAULT"]
