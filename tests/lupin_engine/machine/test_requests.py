"""Requests: answered by the step that they cause; refused means that nothing changed."""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import Any

import pytest

from lupin_engine.machine.requests import _together
from lupin_engine.machine.step import Refusal, Step
from lupin_engine.plugin.contract import Code
from lupin_engine.plugin.profile import given_fields
from lupin_engine.plugin.types import BOOL, COUNT, TEXT, Type, list_of, set_of, within
from tests.lupin_engine.machine.charts import Bench, chart, value

TAG = Type("record", "tag", fields={"id": TEXT})
KNOWN = ("1", "2", "7")
#: What refusing must not touch; the number of steps is counted all the same.
CODES = {"no_tags": "no tags to visit", "unknown_tag": "unknown tag", "busy": "a mission is already running"}

INNER = {
    "Inspection": {
        "mission": "Inspection",
        "itinerary": lambda env: env["request"]["tags"],
        "states": {"DRIVE": {}, "end": {"kind": "final"}},
        "on": {"finish": "end"},
    },
    "Exploration": {"mission": "Exploration", "states": {"LOOK": {}}},
}
STATES = {
    "READY": {"on": {"mission.start": "MISSION"}},
    "MISSION": {
        "slot": True,
        "states": INNER,
        "on_done": "READY",
        "on": {"mission.start": {"refuse": "busy"}, "operator.abort": "READY"},
    },
}
MISSIONS = {
    "Inspection": {
        "state": "MISSION.Inspection",
        "request": {
            "tags": {"type": list_of(TAG), "default": value([{"id": "7"}]), "not_empty": "no_tags"},
            "goal": {"type": COUNT, "default": value(3), "minimum": 2},
        },
    },
    "Exploration": {"state": "MISSION.Exploration", "file": "missions/find_plants.yaml", "request": {}},
}


def read_tag(given: Any) -> dict[str, str]:
    """Read a tag as the navigation plugin does."""
    if given not in KNOWN:
        raise ValueError(f"unknown tag {given!r}")
    return {"id": given}


def ready() -> Bench:
    """Return a bench that waits for a mission."""
    bench = Bench(chart(STATES, missions=MISSIONS, codes=CODES))
    bench.machine.world.readers["tag"] = read_tag  # type: ignore[index]
    return bench


def start(bench: Bench, **data: Any) -> Step:
    """Ask for an inspection."""
    return bench.send("mission.start", **{"mission_type": "Inspection", "mission_id": "m1", **data})


def test_a_mission_is_read_before_it_starts() -> None:
    """What the request carries is converted, and stands in `request`."""
    bench = ready()
    assert start(bench, tags=["2", "1"], goal=5).accepted
    memory = bench.machine.memory
    assert memory.request == {"tags": [{"id": "2"}, {"id": "1"}], "goal": 5}
    assert (memory.mission, memory.mission_id, bench.leaves) == (
        "Inspection",
        "m1",
        ["MISSION.Inspection.DRIVE"],
    )
    assert [visit.target for visit in memory.traversal.visits] == ["2", "1"] if memory.traversal else False


@pytest.mark.parametrize("data", [{}, {"tags": None}, given_fields({"tags": [], "goal": 0})])
def test_what_is_not_given_has_its_default(data: dict[str, Any]) -> None:
    """In a message nothing is optional: empty and zero mean that nothing was given."""
    bench = ready()
    start(bench, **data)
    assert bench.machine.memory.request == {"tags": [{"id": "7"}], "goal": 3}


def test_what_is_given_counts_where_it_is_empty_or_zero() -> None:
    """Who can leave a field out means what is there."""
    bench = ready()
    assert start(bench, tags=[]).refusal == Refusal("no_tags", "no tags to visit")
    assert start(bench, goal=0).refusal == Refusal("bad_request", "goal must be at least 2, got 0")
    flag = {"flag": {"type": BOOL, "default": value(True)}}
    chosen = {"Inspection": {"state": "MISSION.Inspection", "request": flag}}
    bench = Bench(chart(STATES, missions=chosen, codes=CODES))
    start(bench, flag=False)
    assert bench.machine.memory.request == {"flag": False}


def test_a_request_without_a_mission_begins_none() -> None:
    """What leads to the slot, and is no start, is refused; the checker warns of it."""
    refused = ready().send("mission.start").refusal
    assert refused == Refusal("unknown_mission", "it names no mission to begin")


def test_the_mission_of_the_request_is_entered() -> None:
    """The slot's child is the mission that was asked for."""
    bench = ready()
    start(bench, mission_type="Exploration")
    assert bench.leaves == ["MISSION.Exploration.LOOK"]


REFUSED = [
    (
        {"mission_type": "Inspektion"},
        "unknown_mission",
        "unknown mission 'Inspektion'; did you mean 'Inspection'?",
    ),
    (
        {"mission_type": "find_plant"},
        "unknown_mission",
        "unknown mission 'find_plant'; did you mean 'Exploration'?",
    ),
    (
        {"mission_type": ""},
        "unknown_mission",
        "unknown mission ''; allowed: 'Exploration', 'Inspection'",
    ),
    ({"tags": ["1", "8", "9"]}, "unknown_tag", "unknown tag '8', unknown tag '9'"),
    ({"goal": 1}, "bad_request", "goal must be at least 2, got 1"),
    ({"goal": "many"}, "bad_request", "expected count, got 'many'"),
    ({"tags": "1"}, "bad_request", None),
]


@pytest.mark.parametrize(("data", "code", "text"), REFUSED)
def test_a_bad_request_is_refused_and_nothing_changes(
    data: dict[str, Any], code: str, text: str | None
) -> None:
    """Memory is the same before and after, apart from the number of the step."""
    bench = ready()
    before = copy.deepcopy(bench.machine.memory)
    step = start(bench, **data)
    assert step.accepted is False
    assert step.refusal is not None
    assert text is None or step.refusal == Refusal(code, text)
    before.sequence += 1
    assert bench.machine.memory == before
    assert not step.changed


def test_an_empty_list_is_refused_where_it_may_not_be() -> None:
    """`not_empty` names the code."""
    field = {"type": list_of(TAG), "default": value([]), "not_empty": "no_tags"}
    missions = {"Inspection": {"state": "MISSION.Inspection", "request": {"tags": field}}}
    bench = Bench(chart(STATES, missions=missions, codes=CODES))
    assert start(bench).refusal == Refusal("no_tags", "no tags to visit")


def test_what_a_request_names_twice_counts_once_where_it_must_be_distinct() -> None:
    """In the order in which it came; the most that a list may have counts after that."""
    field = {"type": within(set_of(TEXT), None, 2), "default": value(["7", "7"])}
    missions = {"Inspection": {"state": "MISSION.Inspection", "request": {"tags": field}}}
    for given, kept in ((["2", "1", "2"], ["2", "1"]), (None, ["7"])):
        bench = Bench(chart(STATES, missions=missions, codes=CODES))
        assert start(bench, tags=given).accepted
        assert bench.machine.memory.request == {"tags": kept}
    bench = Bench(chart(STATES, missions=missions, codes=CODES))
    told = "tags is a set of text of at most 2 elements, got 3"
    assert start(bench, tags=["1", "2", "1", "3"]).refusal == Refusal("bad_request", told)


def test_a_default_that_cannot_be_computed_refuses() -> None:
    """A defect in a mission's default is told to who asked, with its place."""
    field = {"type": list_of(TAG), "default": value(lambda env: env["param"]["absent"])}
    missions = {"Inspection": {"state": "MISSION.Inspection", "request": {"tags": field}}}
    bench = Bench(chart(STATES, missions=missions, codes=CODES))
    assert start(bench).refusal == Refusal("bad_request", "test.yaml:1:1: tags: there is no 'absent'")


def test_a_refusal_of_the_chart_goes_before_the_request() -> None:
    """A mission that runs refuses the next one, however wrong that is."""
    bench = ready()
    start(bench)
    step = start(bench, mission_type="nonsense")
    assert step.refusal == Refusal("busy", "start refused: a mission is already running")


def test_a_request_that_nothing_listens_to_says_where_it_would_be_possible() -> None:
    """The text comes from the chart."""
    step = ready().send("operator.abort")
    assert step.refusal == Refusal(
        "not_possible", "abort is not possible in READY; it is possible in a running mission"
    )


def test_a_refusal_may_have_a_guard() -> None:
    """The first transition whose guard holds decides, refusal or not."""
    rules = [{"refuse": "low", "guard": lambda env: env["input"]["battery"]["low"]}, "GONE"]
    inputs = {"battery": {"initial": 1.0, "levels": {"low": (0.2, 0.05)}}}
    given = chart(
        {"READY": {"on": {"operator.dock": rules}}, "GONE": {}}, inputs=inputs, codes={"low": "battery low"}
    )
    bench = Bench(given)
    bench.send("value", name="battery", value=0.1, stamp=0.0)
    assert bench.send("operator.dock").refusal == Refusal("low", "dock refused: battery low")
    bench.send("value", name="battery", value=0.3, stamp=1.0)
    assert bench.send("operator.dock").accepted


def test_a_new_mission_begins_with_nothing_of_the_last() -> None:
    """Itinerary, history and last error are the new mission's own."""
    bench = ready()
    start(bench)
    bench.machine.memory.code = "nav_timeout"
    bench.send("finish")
    assert bench.leaves == ["READY"]
    start(bench, tags=["1"])
    walk = bench.machine.memory.traversal
    assert walk is not None
    assert [visit.target for visit in walk.visits] == ["1"]
    assert bench.machine.view.code == ""


def test_a_mission_begins_once_with_variables_of_its_own() -> None:
    """Its context begins with each start, its entry runs then; history brings it back as it was."""
    count = ("set", {"n": lambda env: env["context"]["n"] + 1, "all": lambda env: env["context"]["all"] + 1})
    inner = {
        "Patrol": {
            "mission": "Patrol",
            "entry": count,
            "states": {"WALK": {"on": {"finish": "end"}}, "end": {"kind": "final"}},
        }
    }
    mission = {
        **STATES["MISSION"],
        "states": {**inner, "past": {"kind": "history", "depth": 2}},
        "on": {"operator.dock": "DOCKED"},
    }
    states = {
        "READY": STATES["READY"],
        "MISSION": mission,
        "DOCKED": {"on": {"operator.resume": "MISSION.past"}},
    }
    given = chart(
        states, missions={"Patrol": {"state": "MISSION.Patrol", "request": {}}}, context={"n": 0, "all": 0}
    )
    context = {**given.context, "n": replace(given.context["n"], of_mission=True)}
    bench = Bench(replace(given, context=context))
    for starts in (1, 2):
        assert bench.send("mission.start", mission_type="Patrol").accepted
        bench.send("operator.dock")
        assert bench.send("operator.resume").entered == ("MISSION", "MISSION.Patrol", "MISSION.Patrol.WALK")
        assert bench.context == {"n": 1, "all": starts}
        bench.send("finish")


def test_a_code_keeps_its_label() -> None:
    """Refusals speak in the words that the chart declares."""
    assert Bench(chart(STATES, missions=MISSIONS, codes=CODES)).machine.chart.codes["busy"] == Code(
        "busy", "a mission is already running"
    )


def test_what_is_allowed_is_said_once_for_all_wrong_elements() -> None:
    """Two unknown tags do not print the list of all tags twice."""
    told = ["unknown tag '8'; the layout has 1, 2", "unknown tag 'x'; the layout has 1, 2"]
    assert _together(told) == "unknown tag '8', unknown tag 'x'; the layout has 1, 2"
    assert _together([told[0], "unknown tag ''; give an id"]) == f"{told[0]}; unknown tag ''; give an id"


def test_a_list_that_is_too_long_is_refused_before_it_is_read() -> None:
    """By the parameter, else by the default; one that is not given may be too long as well."""
    bench = ready()
    told = "tags has 1001 elements; at most 1000 are taken (parameter max_targets)"
    assert start(bench, tags=["9"] * 1001).refusal == Refusal("bad_request", told)
    assert start(bench, tags=["7"] * 1000).accepted
    bench = ready()
    bench.machine.world.parameters["max_targets"] = 2  # type: ignore[index]
    told = "tags has 3 elements; at most 2 are taken (parameter max_targets)"
    assert start(bench, tags=["1", "2", "7"]).refusal == Refusal("bad_request", told)
    many = {"type": list_of(TAG), "default": value([{"id": "7"}] * 1001)}
    missions = {"Inspection": {"state": "MISSION.Inspection", "request": {"tags": many}}}
    bench = Bench(chart(STATES, missions=missions, codes=CODES))
    told = "tags has 1001 elements; at most 1000 are taken (parameter max_targets)"
    assert start(bench).refusal == Refusal("bad_request", told)


def test_of_very_many_wrong_elements_the_first_are_told() -> None:
    """The answer goes over the wire and onto a screen."""
    told = [f"unknown tag '{number}'; the layout has 1" for number in range(1000)]
    heads = ", ".join(f"unknown tag '{number}'" for number in range(5))
    assert _together(told) == f"{heads} and 995 more; the layout has 1"
