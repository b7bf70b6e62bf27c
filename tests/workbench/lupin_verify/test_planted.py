"""Planted defects: what the explorer says of charts and engines with one mistake each."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from lupin_engine.chart.model import Chart
from lupin_engine.machine import operations
from lupin_engine.machine.entry_exit import EntryExit
from lupin_engine.machine.holds import Holds
from lupin_engine.machine.itineraries import Itineraries
from lupin_engine.machine.machine import Machine
from lupin_engine.machine.memory import Phase
from lupin_engine.machine.operations import Operations
from lupin_engine.machine.requests import Requests
from lupin_engine.machine.step import Refusal
from lupin_engine.machine.timers import Timers
from lupin_engine.missions.load import load_chart
from lupin_engine.plugin.types import NUMBER
from lupin_engine.properties.built_in import BUILT_IN
from lupin_engine.runtime.setup import make_world
from lupin_verify.outcomes import OUTCOMES
from lupin_verify.proof import prove
from lupin_verify.situations.explorer import NO_EXCEPTION, Bounds
from lupin_verify.situations.graph import OF_THE_GRAPH
from lupin_verify.situations.situation import TooMany
from tests import shipped
from tests.lupin_engine.machine.charts import PAUSE, chart, fails
from tests.workbench.lupin_verify.toys import broken

DRIVE = {"do": "nav.go", "timeout": 10.0}
CLOSE = ("itinerary.close", {"status": "OK"})
REST = ("itinerary.close_rest", {"status": "SKIPPED"})


def _more(env: Any) -> bool:
    """Say whether another target follows."""
    return bool(env["itinerary"]["remaining"] > 0)


#: Ends of missions, and where a person must look.
ENDS: dict[str, Any] = {"DONE": {"entry": "report.summary"}, "FAULT": {}}
#: Drives, is paused, tries again, and is aborted.
TRIP: dict[str, Any] = {
    "GO": {
        "invoke": {**DRIVE, "attempts": 2, "backoff": 1.0},
        "on_done": "READ",
        "on_error": "DONE",
        "on": {"operator.abort": {"target": "DONE", "releases": {"pause"}}},
    },
    "READ": {
        "invoke": {"do": "bridge.read", "timeout": 5.0},
        "on_done": "REST",
        "on_error": "REST",
        "on": {"operator.skip_current": {"refuse": "crashed"}},
    },
    "REST": {"after": {2.0: "DONE"}},
    **ENDS,
}
#: Walks two targets.
WALK: dict[str, Any] = {
    "W": {
        "itinerary": {"items": ["1", "2"]},
        "states": {
            "V": {
                "invoke": {"do": "bridge.read", "timeout": 5.0},
                "on_done": {"target": "NEXT", "do": CLOSE},
                "on_error": {"target": "NEXT", "do": CLOSE},
                "on": {"operator.skip_current": {"target": "NEXT", "do": CLOSE}},
            },
            "NEXT": {
                "after": {
                    1.0: [{"target": "V", "guard": _more, "do": "itinerary.advance"}, {"target": "DONE"}]
                },
                "on": {"operator.dock": {"do": CLOSE}},
            },
        },
        "on": {"operator.abort": {"target": "DONE", "do": REST}},
    },
    **ENDS,
}


def trip(**changes: Any) -> Chart:
    """Return the chart of `TRIP`, some of its states changed."""
    states = {name: {**state, **changes.get(name, {})} for name, state in TRIP.items()}
    return chart(states, holds={"pause": PAUSE})


def walk() -> Chart:
    """Return the chart of `WALK`, ended by an abort alone."""
    return chart(WALK)


def test_all_is_well_without_a_defect() -> None:
    """What is planted below stands in charts in which nothing else is wrong."""
    assert broken(trip()) == set()
    assert broken(walk()) == set()
    assert broken(_follow()) == set()


#: What is broken where something goes round for ever.
ENDLESS = ("silence_is_told", "no_livelock")
#: Charts that go round: some for ever, but not without news.
ROUNDS: dict[str, tuple[Callable[[], Chart], set[str]]] = {
    "a deadline that runs on while others go round": (lambda: _outer({60.0: "DONE"}, {1.0: "ONE"}), set()),
    "a budget that is used up round after round": (lambda: _rounds({"budget": {10.0: "DONE"}}), set()),
    "what is told every two seconds": (
        lambda: _rounds({"every": {2.0: {"do": "report.summary"}}}, "dock"),
        {"silence_is_told"},
    ),
}


@pytest.mark.parametrize("name", ROUNDS)
def test_what_goes_round_is_told_only_if_nothing_comes_of_it(name: str) -> None:
    """What certainly ends at last is well, and with news a mission goes on."""
    of, told = ROUNDS[name]
    assert broken(of()) == told


def _outer(outer: dict[float, Any], two: dict[float, Any]) -> Chart:
    """Return a chart with a deadline around two states, of which the second leads on."""
    inside = {"ONE": {"after": {3.0: "TWO"}}, "TWO": {"after": two}}
    return chart({"READY": {"on": {"operator.dock": "X"}}, "X": {"after": outer, "states": inside}, **ENDS})


def _rounds(work: dict[str, Any], leaves: str = "") -> Chart:
    """Return a chart that works and rests in turn, until somebody asks for an end."""
    rest = {"after": {1.0: "WORK"}, "on": {f"operator.{leaves}": "DONE"} if leaves else {}}
    states = {"WORK": {"after": {3.0: "REST"}, **work}, "REST": rest}
    return chart({"READY": {"on": {"operator.dock": "X"}}, "X": {"states": states}, **ENDS})


#: What is planted -> the chart, and a property that must be found broken.
CHARTS: dict[str, tuple[Callable[[], Chart], str]] = {
    "a wait without a deadline": (lambda: trip(READ={"invoke": "bridge.read"}), "silence_is_told"),
    "a drive that nothing stops": (lambda: trip(GO={"invoke": "nav.go", "on": {}}), "abort_stops"),
    "a state without a way out": (lambda: trip(REST={"after": {}}), "no_deaf_wait"),
    "a state that is never left": (lambda: trip(REST={"after": {}}), "home_again"),
    "a circle of time": (lambda: _circle(2.0), "no_livelock"),
    "a circle without time": (lambda: _circle(0.0), "no_zeno"),
    "a state that leads to itself without time": (
        lambda: chart({"X": {"after": {0.0: "X"}}, **ENDS}),
        "no_zeno",
    ),
    "a deadline that each round sets anew": (lambda: _outer({5.0: "DONE"}, {1.0: "X"}), "silence_is_told"),
    "a budget that is at its end at once": (
        lambda: _rounds({"budget": {10.0: "REST"}}),
        "silence_is_told",
    ),
    "a wait for a value that grows old": (lambda: _growing_old(), "silence_is_told"),
    "a circle within a step": (lambda: _circle(None), "no_execution_error"),
    "an end that nobody handles": (lambda: trip(GO={"on_error": []}), "home_again"),
    "an action that fails": (lambda: trip(REST={"entry": [("set", {"x": fails})]}), "no_execution_error"),
    "a guard that fails": (
        lambda: trip(READ={"on_done": {"target": "REST", "guard": fails}}),
        "no_execution_error",
    ),
    "an invariant that is broken": (
        lambda: chart(TRIP, invariants={"never REST": lambda env: not env["in_state"](["REST"])}),
        "invariants",
    ),
    "a mission that ends with open targets": (
        lambda: chart({**WALK, "W": {**WALK["W"], "on": {"operator.abort": "DONE"}}}),
        "all_closed",
    ),
    "a request that leads to nowhere": (lambda: _dead_end(), "no_deaf_wait"),
    "a hold that nobody may release": (
        lambda: chart(TRIP, holds={"pause": {**PAUSE, "release_guard": lambda _: False}}),
        "home_again",
    ),
    "a list that is never at its end": (lambda: _endless_list(), "no_livelock"),
    "a flag that is looked at and never set": (lambda: _side_flag(), "home_again"),
    "two states that send each other back": (lambda: _to_and_fro(), "silence_is_told"),
    "an abort that begins a drive without an end": (lambda: _home_for_ever(), "abort_stops"),
    "an abort that begins one drive after another": (lambda: _home_again_and_again(), "abort_stops"),
    "an abort that begins a drive after each that ends well": (lambda: _homes("HOME"), "abort_stops"),
    "an abort that begins to and fro": (lambda: _homes("CHECK"), "abort_stops"),
    "an action that moves again and again": (
        lambda: trip(REST={"after": {}, "every": {5.0: {"do": ("arm.wave", {})}}}),
        "abort_stops",
    ),
    "a budget that each mission begins anew": (lambda: _waves(), "abort_stops"),
    "a drive that begins by itself after the end": (lambda: trip(DONE={"after": {1.0: "GO"}}), "abort_stops"),
}


#: The missions in `planted/`, each with the properties that are broken in it.
FILES: dict[str, set[str]] = {
    "budget_in_no_time": {"home_again", *ENDLESS},
    "budget_in_one_moment": {"home_again", *ENDLESS},
    "budget_beside_rounds": set(),
    "budget_inside_of_a_part": {*ENDLESS},
    "budget_around_a_part": set(),
    "budgets_of_two_lengths": {"not_late"},
    "timeouts_of_a_wait": {"not_late"},
    "default_that_decides": {"not_strong"},
    "one_after_another": {"too_late"},
    "updated": {"begins_once"},
}


@pytest.mark.parametrize("name", FILES)
def test_what_is_broken_in_missions_is_found(name: str) -> None:
    """And nothing else is."""
    folder = Path(__file__).parent / "planted"
    of = load_chart(folder / "lifecycle.yaml", [folder / f"{name}.yaml"], shipped.catalog())
    proof = prove(make_world(of, {}), Bounds(restarts=False))
    assert proof.complete
    assert {one.name for one in proof.broken} == FILES[name]


def test_which_target_it_is_is_told_as_not_tried() -> None:
    """A condition on one of them may lead anywhere."""
    folder = Path(__file__).parent / "planted"
    of = load_chart(folder / "lifecycle.yaml", [folder / "one_target.yaml"], shipped.catalog())
    proof = prove(make_world(of, {}), Bounds(restarts=False))
    assert proof.untried == ("target: only 1, 2 were tried, although `target == '20'` reads it",)


@pytest.mark.slow
def test_a_restart_counts_for_properties() -> None:
    """What a new process begins anew is another value for a property, and its time goes on meanwhile."""
    folder = Path(__file__).parent / "planted"
    of = load_chart(folder / "counting.yaml", [folder / "one_after_another.yaml"], shipped.catalog())
    proof = prove(make_world(of, {}), Bounds())
    assert {"kept", "stays"} <= {one.name for one in proof.broken}
    found = {one.name: one for one in proof.not_shown}
    assert {"goes_on", "recovers"} <= found.keys()
    assert len(found["goes_on"].moves) == 2  # how long the process was gone nobody knows
    calm = prove(make_world(of, {}), Bounds(restarts=False))
    assert not {"kept", "goes_on", "recovers"} & {one.name for one in (*calm.broken, *calm.not_shown)}


def _follow() -> Chart:
    """Return a trip whose drive is updated."""
    path = {"path": lambda env: env["input"]["path"]}
    drive = {"do": "nav.follow", "with": path, "update": 1.0, "timeout": 30.0, "timeout_code": "late"}
    states = {**TRIP, "GO": {**TRIP["GO"], "invoke": drive}}
    inputs, codes = {"path": {"initial": 1.0, "type": NUMBER}}, {"late": "late"}
    return chart(states, holds={"pause": PAUSE}, inputs=inputs, codes=codes)


def _growing_old() -> Chart:
    """Return a chart that ends when a value is not reported any more."""
    rule = {"target": "DONE", "guard": lambda env: not env["known"]("x")}
    states = {"READY": {"on": {"operator.dock": "X"}}, "X": {"always": rule}, **ENDS}
    return chart(states, inputs={"x": {"initial": 1, "freshness": 5.0}})


def _circle(seconds: float | None) -> Chart:
    def to(target: str) -> dict[str, Any]:
        return {"always": target} if seconds is None else {"after": {seconds: target}}

    return chart({"START": {"on": {"operator.dock": "X"}}, "X": to("Y"), "Y": to("X"), **ENDS})


def _dead_end() -> Chart:
    return chart({**TRIP, "REST": {"after": {2.0: "DONE"}, "on": {"operator.dock": "END"}}, "END": {}})


def _endless_list() -> Chart:
    states = {**WALK["W"]["states"], "NEXT": {"after": {1.0: {"target": "V", "do": "itinerary.advance"}}}}
    return chart({**WALK, "W": {**WALK["W"], "states": states}})


def _side_flag() -> Chart:
    waits = {"always": {"target": "DONE", "guard": lambda env: env["context"]["flag"]}}
    return chart({**TRIP, "REST": waits}, context={"flag": False})


def _to_and_fro() -> Chart:
    away = {"after": {1.0: "BACK"}, "on": {"operator.dock": "READ"}}
    return chart(
        {**TRIP, "READ": {**TRIP["READ"], "on_error": "AWAY"}, "AWAY": away, "BACK": {"after": {1.0: "AWAY"}}}
    )


def _home_for_ever() -> Chart:
    go = {**TRIP["GO"], "on": {"operator.abort": "HOME"}}
    return chart({**TRIP, "GO": go, "HOME": {"invoke": "nav.dock", "on_done": "DONE", "on_error": "DONE"}})


def _home_again_and_again() -> Chart:
    """Return a chart in which an abort begins a drive after the end of each, beside a region with waits."""
    go = {**TRIP["GO"], "on": {"operator.abort": "HOME"}}
    again = {"invoke": {"do": "nav.dock", "timeout": 30.0}, "on_done": "D0", "on_error": "D0"}
    tries = {"T0": {"after": {3.0: "T1"}}, "T1": {"after": {5.0: "T0"}}}
    home = {"kind": "parallel", "states": {"DRIVE": {"states": {"D0": again}}, "TRY": {"states": tries}}}
    return chart({**TRIP, "GO": go, "HOME": home})


def _homes(then: str) -> Chart:
    """Return a chart that drives home once it is aborted, and goes on if that ends well."""
    go = {**TRIP["GO"], "on": {"operator.abort": "HOME"}}
    home = {"invoke": {"do": "nav.dock", "timeout": 30.0}, "on_done": then, "on_error": "DONE"}
    check = {"invoke": {"do": "bridge.read", "timeout": 5.0}, "on_done": "HOME", "on_error": "DONE"}
    return chart({**TRIP, "GO": go, "HOME": home, "CHECK": check})


def _waves() -> Chart:
    """Return a chart that moves in rounds; at their ends there is no mission, so no budget goes on."""
    wave = {"every": {3.0: {"do": ("arm.wave", {})}}, "after": {5.0: "DONE"}, "budget": {60.0: "FAULT"}}
    return chart({"GO": wave, "DONE": {"after": {1.0: "GO"}}, "FAULT": {}})


def _passing() -> Chart:
    """Return the chart of `TRIP` with a state that is left in the step that enters it."""
    passed = {"invoke": DRIVE, "always": "READ", "on_done": "READ", "on_error": "READ"}
    return chart({**TRIP, "GO": {**TRIP["GO"], "on_done": "PASSED"}, "PASSED": passed})


def _once() -> Chart:
    """Return the chart of `TRIP` with one try."""
    return trip(GO={"invoke": DRIVE})


@pytest.mark.slow
@pytest.mark.parametrize("planted", CHARTS)
def test_mistakes_of_charts_are_found(planted: str) -> None:
    """War stories and slips of the pen, put into a chart."""
    of, name = CHARTS[planted]
    assert name in broken(of())


def _end_as_wanted(self: Operations, kind: str, attempt: Any, data: Any, step: Any) -> None:
    """Book what is said of an attempt that nobody waits for."""
    for invocation in self._scope.memory.invocations.values():
        if invocation.name == attempt.invocation and kind == "done":
            self._signal("done", invocation, operations.Trigger(event=data["result"]), step)
    self._move(attempt, kind, step)


def _close_again(self: Itineraries, traversal: Any, outcome: Any, step: Any) -> None:
    """Close a visit, whether it has its outcome or not."""
    if traversal is not None and traversal.visit is not None:
        self._close(traversal, traversal.visit, outcome, step)


def _nothing(*_: Any, **__: Any) -> None:
    """Do nothing."""


def _no(*_: Any, **__: Any) -> bool:
    return False


def _without(kind: str) -> Callable[..., None]:
    """Return what arms all deadlines but those of a kind."""

    def arm(self: Timers, armed: str, owner: str, now: float, delay: float, event: str = "") -> None:
        if armed != kind:
            ARM(self, armed, owner, now, delay, event)

    return arm


def _at_once(self: Timers, kind: str, owner: str, now: float, delay: float, event: str = "") -> None:
    """Arm the clocks of states without their time."""
    ARM(self, kind, owner, now, 0.0 if kind == "after" else delay, event)


def _revive(self: Operations, kind: str, attempt: Any, data: Any, step: Any) -> None:
    """Take it for wanted that a server accepts what was cancelled."""
    if kind == "accepted":
        attempt.phase = Phase.ACCEPTED
    else:
        REPORT_UNWANTED(self, kind, attempt, data, step)


def _cancel_nothing(self: Operations, invocation: Any, step: Any) -> None:
    """Wait no longer for an attempt, and do not tell its server."""
    self._scope.timers.disarm("timeout", invocation.attempt or "")
    invocation.attempt = None


def _stay_begun(self: Operations, invocation: Any, why: str, step: Any) -> None:
    """Cancel for a hold, and forget to begin again."""
    INTERRUPT(self, invocation, why, step)
    invocation.begun = True


def _without_replacing(self: Operations, attempt: Any, word: str, step: Any) -> None:
    """Lead an attempt on, but for one that was updated."""
    if word != "updated":
        MOVE(self, attempt, word, step)


def _skip_one(self: Itineraries, traversal: Any, step: Any) -> None:
    """Go on to the target after the next one."""
    ADVANCE(self, traversal, step)
    traversal.index += 1


def _tell_twice(self: Itineraries, visit: Any, step: Any, source: str = "") -> None:
    """Tell what became of a target, and tell it again."""
    PUBLISH(self, visit, step, source)
    PUBLISH(self, visit, step, source)


def _begin_eagerly(self: EntryExit, state: Any, *how: Any) -> None:
    """Begin an operation when its state is entered, not when the step comes to rest."""
    ENTER(self, state, *how)
    found = self._scope.memory.invocations.get(state.name)
    if found is not None:
        found.begun = True
        self._operations._issue(found, how[-1])


#: What mutants fall back to.
ARM, ENTER, ADVANCE, PUBLISH = Timers.arm, EntryExit.enter, Itineraries.advance, Itineraries.publish
REPORT_UNWANTED, INTERRUPT = Operations._report_unwanted, Operations._interrupt
MOVE = Operations._move

#: What is planted -> where, what stands there instead, the chart, and a property that must be found broken.
ENGINES: dict[str, tuple[Any, str, Any, Callable[[], Chart], str]] = {
    "a hold cancels nothing": (Operations, "suspend", _nothing, trip, "hold_stops_all"),
    "a hold keeps nothing from beginning": (operations, "is_held_back", _no, trip, "hold_starts_nothing"),
    "a hold that is never released": (Holds, "release", _nothing, trip, "home_again"),
    "clocks that do not go on": (Timers, "thaw", _nothing, trip, "no_deaf_wait"),
    "answers that wait for ever": (Machine, "_come_back_to", _nothing, trip, "silence_is_told"),
    "a retry that is forgotten": (Operations, "retry", _nothing, trip, "silence_is_told"),
    "a timeout that nobody hears": (Operations, "timed_out", _nothing, trip, "silence_is_told"),
    "an end that is not told": (Operations, "_signal", _nothing, trip, "ends_are_handled"),
    "nothing is ever begun": (Operations, "begin_missing", _no, trip, "no_livelock"),
    "a resource that nobody waits for": (
        Operations,
        "_before",
        lambda *_: None,
        trip,
        "resources_exclude",
    ),
    "what an update replaced is left behind": (
        Operations,
        "_cancel_replaced",
        _nothing,
        lambda: _follow(),
        "hold_stops_all",
    ),
    "an update beside a goal that goes on": (
        Operations,
        "_move",
        _without_replacing,
        lambda: _follow(),
        "resources_exclude",
    ),
    "a refusal without a reason": (
        Requests,
        "_refusal",
        lambda *_: Refusal("", ""),
        trip,
        "refusals_have_reasons",
    ),
    "a former attempt is booked": (Operations, "_report_unwanted", _end_as_wanted, trip, "former_attempts"),
    "a visit is closed twice": (Itineraries, "close", _close_again, walk, "closed_once"),
    "open visits are forgotten": (Itineraries, "close_rest", _nothing, walk, "all_closed"),
    "a target is skipped": (Itineraries, "advance", _skip_one, walk, "all_closed"),
    "the next target is the same": (Itineraries, "advance", _nothing, walk, "no_livelock"),
    "a result is told twice": (Itineraries, "publish", _tell_twice, walk, "closed_once"),
    "a result is told to nobody": (Itineraries, "publish", _nothing, walk, "closed_once"),
    "a cancel that is not sent": (Operations, "_cancel_current", _cancel_nothing, _once, "abort_stops"),
    "a cancel without a deadline": (Timers, "arm", _without("cancel"), trip, "hold_stops_all"),
    "a cancel that is waited for again": (Operations, "abandon", _nothing, trip, "hold_stops_all"),
    "a late accept is taken for wanted": (Operations, "_report_unwanted", _revive, _once, "hold_stops_all"),
    "an answer under a hold counts as a cancel": (
        Operations,
        "_forget_answer",
        lambda *_: True,
        _once,
        "hold_stops_all",
    ),
    "an operation without its timeout": (Timers, "arm", _without("timeout"), trip, "silence_is_told"),
    "a back-off that never ends": (Timers, "arm", _without("retry"), trip, "no_livelock"),
    "clocks that take no time": (Timers, "arm", _at_once, lambda: _circle(2.0), "no_zeno"),
    "what a hold stopped stays stopped": (Operations, "_interrupt", _stay_begun, trip, "no_livelock"),
    "an operation begins too early": (EntryExit, "enter", _begin_eagerly, _passing, "no_false_start"),
    "a late answer raises": (Operations, "_drop", lambda *_: fails(None), trip, "no_exception"),
    "a request is not answered": (Machine, "_request", _nothing, trip, "refusals_have_reasons"),
}


@pytest.mark.slow
@pytest.mark.parametrize("planted", ENGINES)
def test_mistakes_of_engines_are_found(planted: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Mutants of holds, cancels, timers, requests and itineraries."""
    place, name, instead, of, wanted = ENGINES[planted]
    monkeypatch.setattr(place, name, instead)
    assert wanted in broken(of())


def test_a_new_process_that_begins_at_once_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """Before somebody has said that it may, even what does not move."""
    assert broken(trip(), restarts=True) == set()
    monkeypatch.setattr(operations, "is_held_back", _no)
    assert "hold_starts_nothing" in broken(trip(), restarts=True)


#: What follows from an abort and a skip in `TRIP`.
PAGE = """\
| State | Where | About |
|---|---|---|
| GO | `in_state('GO')` | |
| READ | `in_state('READ')` | |
| DONE | `in_state('DONE')` | |

| Column | Held | Where |
|---|---|---|
| free | | |
| paused | pause | |

| Event | What | But for |
|---|---|---|
| abort | `operator.abort` | |
| skip | `operator.skip_current` | |

# abort

| State | free | paused |
|---|---|---|
| GO | → DONE; cancels nav.go; summary | → DONE; releases pause; summary |

# skip

| State | free | paused |
|---|---|---|
| READ | ✗ crashed | = |
"""
#: What is planted -> the chart, and the cell that must be found broken; '': none.
CELLS: dict[str, tuple[Callable[[], Chart], str]] = {
    "nothing": (trip, ""),
    "an abort that leads elsewhere": (
        lambda: trip(GO={"on": {"operator.abort": {"target": "READ", "releases": {"pause"}}}}),
        "abort, GO, free: → DONE; cancels nav.go; summary; but it is in READ; it starts bridge.read; "
        "it tells no summary",
    ),
    "an abort that keeps the hold": (
        lambda: trip(GO={"on": {"operator.abort": {"target": "DONE", "during": {"pause"}}}}),
        "abort, GO, paused: → DONE; releases pause; summary; but it releases nothing",
    ),
    "a skip that is taken": (
        lambda: trip(READ={"on": {"operator.skip_current": "REST"}}),
        "skip, READ, free: ✗ crashed; but it is not refused",
    ),
}


@pytest.mark.parametrize("planted", CELLS)
def test_cells_that_are_not_kept_are_found(planted: str, tmp_path: Path) -> None:
    """What a page of outcomes says in each of its cells."""
    of, cell = CELLS[planted]
    page = tmp_path / "page.md"
    page.write_text(PAGE, encoding="utf-8")
    proof = prove(make_world(of(), {}), Bounds(restarts=False), outcomes=page)
    told = [one.text.partition(": ")[2] for one in proof.broken if one.name == OUTCOMES]
    assert told == ([cell] if cell else [])
    assert cell or "4 of 4 cells of page.md were met." in proof.bounds


def test_a_situation_that_is_farther_is_told_if_no_run_comes_to_the_nearest() -> None:
    """The second deadline inside is due at 6 s, the one around at 5 s: of them no order is known."""
    home = {"on": {"operator.abort": "DONE"}}
    inside = {"ONE": {"after": {3.0: "TWO"}}, "TWO": {"after": {3.0: "NEAR"}}}
    states = {
        "READY": {"on": {"operator.dock": "X"}},
        "X": {"after": {5.0: "A"}, "states": inside, **home},
        "NEAR": {},
        "A": {"after": {1.0: "B"}, **home},
        "B": {"after": {1.0: "FAR"}, **home},
        "FAR": {},
        **ENDS,
    }
    proof = prove(make_world(chart(states), {}), Bounds(restarts=False))
    (found,) = (one for one in proof.broken if one.name == "home_again")
    assert found.steps is not None
    assert found.configuration == ("", "FAR")


def test_there_are_forty_of_them() -> None:
    """Each with the property that finds it; every property finds one at least."""
    assert len(CHARTS) + len(ENGINES) >= 40
    found = {wanted for _, wanted in CHARTS.values()} | {wanted for *_, wanted in ENGINES.values()}
    every = {one.name for one in (*BUILT_IN, *OF_THE_GRAPH)} | {NO_EXCEPTION}
    assert found == every


def test_what_grows_without_end_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Deadlines that nobody disarms are more and more."""
    monkeypatch.setattr(Timers, "disarm", _nothing)
    with pytest.raises(TooMany, match=r"^timers grows: it has had 31 values, the last one \["):
        broken(trip(), most_values=30)


def test_an_exception_is_a_breach(monkeypatch: pytest.MonkeyPatch) -> None:
    """An engine that raises is told with the way to it, like every other breach."""
    monkeypatch.setattr(Operations, "timed_out", lambda *_: fails(None))
    assert "no_exception" in broken(trip())
