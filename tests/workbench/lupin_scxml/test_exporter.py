"""SCXML loads in an engine that others wrote, with the same states, and takes the same first steps there."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Iterator
from typing import Any

import pytest
from statemachine.io import load

from lupin_engine.chart.model import Chart
from lupin_engine.diagram.outline import outline
from lupin_scxml.exporter import scxml
from tests.lupin_engine.diagram import pictured

SCXML = "{http://www.w3.org/2005/07/scxml}"
LUPIN = "{urn:lupin-engine:chart}"
KINDS = {
    "atomic": "state",
    "compound": "state",
    "parallel": "parallel",
    "final": "final",
    "history": "history",
}
INSPECTION = "MISSION-InspectionMission"


def ids(names: Iterable[str]) -> set[str]:
    """States, the root aside, as the documents call them."""
    return {name.replace(".", "-") for name in names if name}


def text(name: str) -> str:
    """The document of a chart."""
    return scxml(outline(pictured.chart(name), whole=True))


def tree(name: str) -> ElementTree.Element:
    """The same, read."""
    return ElementTree.fromstring(text(name).encode())


def elements(name: str) -> Iterator[ElementTree.Element]:
    """The states of a document."""
    return (found for found in tree(name).iter() if found.tag.removeprefix(SCXML) in set(KINDS.values()))


def loaded(name: str) -> Any:
    """The chart in the other engine. The guards are Python there too, so it has to trust them.

    It would wait for the deadlines, in real time: they are taken out. And it knows no live values, so guards
    that decide without an event are written in: one that fails is tried again there for ever. Nothing is held
    there, nothing is written, and errors of the data that it lacks do not lead to FAULT.
    """
    without = r"<send [^>]*delay[^>]*/>|<assign [^>]*/>|<transition event=\"error\" target=\"FAULT\"/>"
    timeless = re.sub(without, "", text(name))
    return load(
        re.sub(r'<transition cond="[^"]+"', '<transition cond="False"', _free(timeless)),
        format="scxml",
        trusted=True,
    )


def _free(document: str) -> str:
    return re.sub(r"not held\(\w+\)( and )?", "", document).replace(' cond=""', "")


def names(states: Iterable[Any]) -> Iterator[str]:
    """The names of states of the other engine, and of all within them."""
    for state in states:
        yield state.id
        yield from names(state.states)
        yield from names(getattr(state, "history", ()))


@pytest.mark.parametrize("name", pictured.NAMES)
def test_it_has_every_state_in_its_place_and_of_its_kind(name: str) -> None:
    """And every transition, with its target."""
    given = pictured.chart(name)
    found = {element.attrib["id"]: element for element in elements(name)}
    assert set(found) == ids(given.states)
    for state in given.states.values():
        if not state.name:
            continue
        element = found[state.name.replace(".", "-")]
        assert element.tag == SCXML + KINDS[state.kind.value]
        assert {child.get("id") for child in element} & set(found) == ids(state.children)
        if state.kind.value != "history":
            found_rules = element.findall(f"{SCXML}transition")
            # A history with `resume_at` or of several levels has one more for each way back.
            ways = [rule for rule in found_rules if "left_" not in rule.get("cond", "")]
            outer = given.states[""].transitions if state.parent == "" else ()
            targets = [rule.target for rule in (*state.transitions, *outer)]
            if state.parent == "" and "FAULT" in given.states and state.name != "FAULT":
                targets.append("FAULT")
            assert [rule.get("target") for rule in ways] == [last_target(given, name) for name in targets]


def last_target(given: Chart, name: str | None) -> str | None:
    """A target in the document, of a history of several levels where it begins without a past."""
    state = given.states[name] if name else None
    if state is not None and state.kind.value == "history" and state.depth not in (1, None):
        name = given.states[state.parent or ""].children[0]
    return name and name.replace(".", "-")


@pytest.mark.parametrize("name", pictured.NAMES)
def test_no_two_elements_share_an_id(name: str) -> None:
    """As XML wants it."""
    found = [element.attrib["id"] for element in tree(name).iter() if "id" in element.attrib]
    assert len(found) == len(set(found))


@pytest.mark.parametrize("name", pictured.NAMES)
def test_another_engine_loads_the_same_states(name: str) -> None:
    """And begins where ours does."""
    machine = loaded(name)
    given = pictured.chart(name)
    assert sorted(names(machine.states)) == sorted(ids(given.states))
    assert set(machine().configuration_values) == ids(_first(name))


def _first(name: str) -> set[str]:
    """The states that a chart begins in."""
    given = pictured.chart(name)
    found: set[str] = set()
    waiting = [given.states[""].initial or given.states[""].children[0]]
    while waiting:
        state = given.states[waiting.pop()]
        found.add(state.name)
        if state.kind.value == "parallel":
            waiting += [child for child in state.children if given.states[child].kind.value != "history"]
        elif state.children:
            waiting.append(state.initial or state.children[0])
    return found


def test_another_engine_goes_the_same_ways() -> None:
    """From boot through a mission and home, by the names that SCXML has for the ends of operations.

    There is no itinerary there, so the first target is the last one.
    """
    machine = loaded("inspection")()
    inspecting = f"{INSPECTION}-INSPECTING"
    preparing = {"MISSION", INSPECTION, f"{INSPECTION}-PREPARE", f"{INSPECTION}-PREPARE-LOCALIZING"}
    navigating = f"{inspecting}-NAVIGATING"
    driving = {"MISSION", INSPECTION, inspecting, navigating, f"{navigating}-FOLDING"}
    steps = {
        "done.invoke.BOOT-operation": {"READY"},
        "mission.start": preparing,
        "nothing.of.ours": preparing,
        f"done.invoke.{INSPECTION}-PREPARE-LOCALIZING-operation": driving,
        f"after.0.{navigating}-FOLDING": {*driving - {f"{navigating}-FOLDING"}, f"{navigating}-DRIVING"},
        f"error.invoke.{navigating}-DRIVING-operation": {"RETURNING", "RETURNING-DRIVING_HOME"},
        "operator.abort": {"DONE"},
    }
    for event, wanted in steps.items():
        machine.send(event)
        assert set(machine.configuration_values) == wanted, event


def test_operations_deadlines_actions_and_refusals_have_a_form() -> None:
    """Those that SCXML foresees for what it does not know."""
    found = {element.attrib["id"]: element for element in elements("inspection")}
    reading = found[f"{INSPECTION}-INSPECTING-SCANNING-READING"]
    invoke = reading.find(f"{SCXML}invoke")
    assert invoke is not None
    assert invoke.attrib == {
        "type": "x-lupin",
        "id": f"{reading.attrib['id']}-operation",
        f"{LUPIN}do": "bridge.read_tag",
        f"{LUPIN}timeout": "5s",
        f"{LUPIN}timeout.code": "scan_timeout",
    }
    assert [(p.get("name"), p.get("expr")) for p in invoke] == [("tag_id", "target.id")]
    dwelling = found[f"{INSPECTION}-INSPECTING-SCANNING-DWELLING"]
    event = f"after.0.{dwelling.attrib['id']}"
    assert [send.attrib for send in dwelling.iter(f"{SCXML}send")] == [
        {"event": event, "id": event, "delay": "0s"}
    ]
    assert [cancel.get("sendid") for cancel in dwelling.iter(f"{SCXML}cancel")] == [event]
    waits = [rule.get("event") for rule in dwelling.iter(f"{SCXML}transition")]
    assert waits == ["operator.skip_current", event]
    refused = found["READY"].find(f"{SCXML}transition")
    assert refused is not None
    assert refused.attrib == {
        "event": "mission.start",
        "cond": "len(input.missing) > 0",
        f"{LUPIN}refuse": "dependency_timeout",
    }
    dock = next(
        r for r in found["MISSION"].findall(f"{SCXML}transition") if r.get("event") == "operator.dock"
    )
    assert dock.get("cond") == f"In('{INSPECTION}-PREPARE')"


def test_what_the_machine_adds_is_written_out() -> None:
    """Levels, holds, errors that nobody handles, and the ways back to a mission."""
    found = {element.attrib["id"]: element for element in elements("inspection")}
    low = [
        r.attrib
        for r in found["MISSION"].findall(f"{SCXML}transition")
        if r.get("cond") == "input.battery.low"
    ]
    assert [(rule.get("event"), rule["target"]) for rule in low] == [(None, "RETURNING")]
    (missing,) = (r for r in found["READY"].findall(f"{SCXML}transition") if r.get("event") is None)
    assert missing.get("cond") == "not held(estop) and not held(pause) and len(input.missing) > 0"
    back = [
        (rule.get("cond"), rule.get("target"))
        for rule in found["RETURNING-DOCKED"].findall(f"{SCXML}transition")
        if rule.get("event") == "operator.resume"
    ]
    was = f"left_MISSION == '{INSPECTION}' and left_MISSION_InspectionMission == '{INSPECTION}"
    assert back == [
        ("input.battery.low", None),
        (f"{was}-INSPECTING' and itinerary.open", f"{INSPECTION}-INSPECTING-NAVIGATING"),
        (f"{was}-INSPECTING'", f"{INSPECTION}-INSPECTING-PUBLISHING"),
        (f"{was}-PREPARE'", f"{INSPECTION}-PREPARE"),
        (f"{was}-INSPECTING'", f"{INSPECTION}-INSPECTING"),
        (f"{was}-done'", f"{INSPECTION}-done"),
        (None, INSPECTION),
    ]


def test_a_mission_begins_once() -> None:
    """Its variables and its entry stand where history does not pass by."""
    (begins,) = tree("kinds").iter(f"{SCXML}initial")
    done = [
        (child.tag.removeprefix(SCXML), child.get("location") or child.get("event")) for child in begins[0]
    ]
    assert done == [("assign", "rounds"), ("send", "report.summary")]


def test_what_has_no_form_is_a_comment() -> None:
    """Holds suspend the whole chart; an itinerary walks a list."""
    found = text("inspection")
    assert "<!-- hold pause: from pause until resume -->" in found
    assert "<!-- for each of request.tag_sequence -->" in found
    assert "<!-- resume [itinerary.open] → NAVIGATING -->" in found
    assert "<!-- remembers 2 levels -->" in found


def test_a_comment_cannot_end_itself() -> None:
    """Two hyphens may not stand in one."""
    from lupin_scxml.exporter import _comment

    assert _comment("a -- b --> c") == "a - - b - -&gt; c"


def test_what_is_added_and_removed_is_assigned() -> None:
    """SCXML knows no lists, the expression language of the document does."""
    found = {each.get("location"): each.get("expr") for each in tree("words").iter(f"{SCXML}assign")}
    assert found["done"] == "done if 'T1' in done else done + ['T1']"
    assert found["lately"] == "[each for each in lately if each != 'none']"


def test_an_if_is_that_of_scxml() -> None:
    """With its `else` in the middle, and one inside the other."""
    (outer,) = (found for found in tree("words").iter(f"{SCXML}if") if found.get("cond") == "reason == ''")
    assert [child.tag.removeprefix(SCXML) for child in outer] == ["assign", "else", "if"]
    assert outer[2].get("cond") == "known(input.battery) and input.battery.value < 0.5"


def test_what_events_and_ends_carry_is_in_the_document() -> None:
    """SCXML's `raise` carries nothing, a `send` to the chart itself does; an end has `donedata`."""
    (sent,) = (found for found in tree("words").iter(f"{SCXML}send") if found.get("event") == "read.failed")
    assert sent.get("target") == "#_internal"
    assert [(param.get("name"), param.get("expr")) for param in sent] == [
        ("tag", "reason"),
        ("far", "read > 3"),
    ]
    (given,) = tree("words").iter(f"{SCXML}donedata")
    assert [(param.get("name"), param.get("expr")) for param in given] == [
        ("walked", "param.dwell * itinerary.total")
    ]


def test_a_question_and_its_default_are_in_the_document() -> None:
    """The question by a word of our own, its deadline as the event of the default."""
    document = tree("words")
    lupin = next(found.tag for found in document.iter() if found.tag.endswith("}ask")).removesuffix("ask")
    (asked,) = document.iter(f"{lupin}ask")
    assert (asked.get("question"), asked.get("default")) == (
        "'Again for ${ param.patience } or not?'",
        "enough",
    )
    choices = [(found.get("name"), found.get("label"), found.get("severity")) for found in asked]
    assert choices == [("again", "Once more", "warn"), ("enough", "That will do", "info")]
    (sent,) = (found for found in document.iter(f"{SCXML}send") if "answer.enough" in found.get("event", ""))
    assert sent.get("delay") == "5s"


def test_a_time_of_day_is_sent_by_who_has_a_clock() -> None:
    """SCXML has none: the `send` is of our type, and leaving the state takes it back."""
    name = "at.0.MISSION-Words-STARTING-LOOKING"
    document = tree("words")
    (sent,) = (found for found in document.iter(f"{SCXML}send") if found.get("event") == name)
    assert (sent.get("type"), sent.get(f"{LUPIN}at"), sent.get("delay")) == ("x-lupin", "'06:30'", None)
    assert name in [found.get("sendid") for found in document.iter(f"{SCXML}cancel")]
    assert name in [found.get("event") for found in document.iter(f"{SCXML}transition")]


def test_a_tick_sets_the_next_one() -> None:
    """SCXML has no clock that repeats: what a tick does begins with a `send` of the next."""
    (rule,) = (
        found
        for found in tree("words").iter(f"{SCXML}transition")
        if found.get("event") == "every.0.MISSION-Words-STARTING-LOOKING"
    )
    assert [(child.tag.removeprefix(SCXML), child.get("delay")) for child in rule] == [
        ("send", "0.2s"),
        ("assign", None),
    ]
