"""The verbs of an operator, as far as that needs no network: what is shown, and what is sent."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest

from lupin_cli.operator.look import lines, look, to_do
from lupin_cli.operator.start import _asked, _offer
from lupin_cli.verbs.up import served
from lupin_engine.errors import UsageError
from lupin_engine.missions.selection import load_missions
from lupin_engine.runtime.offer import missions_record
from lupin_engine.runtime.possible import RequestPreview
from lupin_engine.runtime.record import step_record, view_record
from lupin_engine.runtime.setup import make_machine
from tests import shipped

VERBS = {"skip_current": "skip"}
MISSIONS = [
    {"mission": "WaterMission", "file": "water", "request": [
        {"name": "plants", "type": "list of tag"},
        {"name": "amount", "type": "number in l"},
        {"name": "rounds", "type": "count"},
        {"name": "dry", "type": "bool"},
        {"name": "to", "type": "pose"},
        {"name": "why", "type": "text"},
    ]},
]  # fmt: skip


@pytest.mark.parametrize("mission", ["WaterMission", "water", "missions/water.yaml"])
def test_a_mission_goes_by_its_name_and_by_its_file(mission: str) -> None:
    """As it does for `lupin run`."""
    assert _offer(mission, MISSIONS) is MISSIONS[0]
    assert _offer("Water", MISSIONS) is None


def test_a_field_is_read_as_its_type() -> None:
    """What does not fit is sent as it is: the orchestrator says what is wrong with it."""
    given = (
        "plants=1, 5",
        "amount=300 ml",
        "rounds=3",
        "dry=yes",
        "to={x: 1 m, y: 2 m, yaw: 0 rad}",
        "why=1,2",
    )
    assert _asked({}, given, MISSIONS[0]["request"]) == {
        "plants": ["1", "5"],
        "amount": "300 ml",
        "rounds": 3,
        "dry": True,
        "to": {"x": "1 m", "y": "2 m", "yaw": "0 rad"},
        "why": "1,2",
    }
    assert _asked({}, ["rounds=many", "palnts=1"], MISSIONS[0]["request"]) == {
        "rounds": "many",
        "palnts": "1",
    }
    with pytest.raises(UsageError, match=r"^'plants' has no '='; write --request NAME=VALUE$"):
        _asked({}, ["plants"], ())


def test_a_field_is_given_with_its_unit() -> None:
    """As in a file: 90 may be meant as minutes. Where several lack it, all are reported."""
    declared = [{"name": "patience", "type": "duration"}, {"name": "pauses", "type": "list of duration"}]
    assert _asked({}, ["patience=90 s", "pauses=1 s,2 s"], declared) == {
        "patience": "90 s",
        "pauses": ["1 s", "2 s"],
    }
    door = {"type": "length", "kind": "number", "unit": "m"}
    fields = {"id": {"type": "text", "kind": "text"}, "door": door}
    declared.append({"name": "wards", "type": "list of ward", "kind": "record", "fields": fields})
    assert _asked({}, ["wards=[{id: icu, door: 1 m}]"], declared) == {"wards": [{"id": "icu", "door": "1 m"}]}
    with pytest.raises(UsageError, match=r"^--request: wards\[0\]\.door: 1 has no unit; write '1 m'$"):
        _asked({}, ["wards=[{id: icu, door: 1}]"], declared)
    with pytest.raises(UsageError, match=r"^--request: wards: unfinished: it ends after '\[\{id: icu'$"):
        _asked({}, ["wards=[{id: icu"], declared)
    with pytest.raises(UsageError) as refused:
        _asked({}, ["patience=90", "pauses=1 s,2", "to"], declared)
    assert str(refused.value).splitlines() == [
        "'to' has no '='; write --request NAME=VALUE",
        "--request: patience: 90 has no unit; write '90 s'",
        "--request: pauses[1]: 2 has no unit; write '2 s'",
    ]


def test_a_field_is_given_once() -> None:
    """By its option or by --request."""
    with pytest.raises(UsageError) as refused:
        _asked({"tags": ["1"]}, ["tags=2", "to"], ())
    assert str(refused.value).splitlines() == [
        "'to' has no '='; write --request NAME=VALUE",
        "tags: given by an option of its own and by --request; leave one out",
    ]


def test_up_tells_the_verbs() -> None:
    """With the domain, where another shell would look in another one."""
    loaded = load_missions(["inspection"], shipped.catalog())
    assert served(loaded, 0) == [
        "ready in ROS domain 0; start a mission from the HMI, or with",
        "  lupin start inspection",
        "and operate it with lupin state, answer, abort, dock, pause, reset, resume, skip",
        "Ctrl-C stops everything",
    ]
    assert served(loaded, 7)[1:3] == [
        "  lupin start inspection --domain 7",
        "and operate it with lupin state, answer, abort, dock, pause, reset, resume, skip; "
        "all of them with --domain 7",
    ]
    assert served(loaded, 7, "/fleet/robot2")[:2] == [
        "ready in ROS domain 7, robot /fleet/robot2; start a mission from the HMI, or with",
        "  lupin start inspection --domain 7 --robot fleet/robot2",
    ]


# -- what is shown ----------------------------------------------------------------------------------------


def told() -> tuple[list[dict[str, Any]], dict[str, Any], dict[str, Any]]:
    """Return what an orchestrator of the inspection tells at its start: steps, what is possible, missions."""
    machine = make_machine(shipped.mission("inspection"), {})
    step = machine.start(0.0)
    steps = [{"step": step_record(step), "view": view_record(machine.view, machine.chart)}]
    return steps, {"requests": RequestPreview(machine).news(11.0)}, missions_record(machine, 11.0, ())


TOLD = told()


def standing() -> dict[str, Any]:
    """Return the look at it, at 11 s."""
    return look(*TOLD, 11.0)


def test_what_is_possible_is_told_as_commands() -> None:
    """And why the rest is not, in the sentences that it would be refused with."""
    assert list(lines(standing(), VERBS)) == [
        "BOOT",
        "  doing      plugins.ready",
        "  to do      Wait until the servers and topics that it waits for are there.",
        "  not now    abort: abort is not possible in BOOT; it is possible in RETURNING or a running mission",
        "             dock: dock is not possible in BOOT; it is possible in a running mission",
        "             pause: pause refused: no mission is running",
        "             reset: reset is not possible in BOOT; it is possible in FAULT",
        "             resume: resume is not possible in BOOT because nothing is paused",
        "             skip: skip_current is not possible in BOOT; it is possible in INSPECTING",
        "             start inspection: start refused: the robot is still starting up",
    ]


BUSY = "start refused: a mission is already running"
VIEW = {
    **standing(),
    "lifecycle": "WATERING",
    "phase": "ASKING",
    "target": "7",
    "mission": "WaterMission",
    "mission_id": "lupin-1",
    "total": 9,
    "seconds": 83.4,
    "counts": {"completed": 4, "failed": 0, "skipped": 1},
    "holds": {"pause": "paused by the operator", "stop": "e-stop engaged"},
    "asking": [
        {
            "question": "Go on?",
            "choices": [{"name": "go_on", "label": "Go on"}, {"name": "stay", "label": "Stay here"}],
            "default": "else stay in 00:09.0",
        }
    ],
    "operations": [],
    "to_do": ["Release the stop, then resume."],
    "codes": [
        {"code": "tap_dry", "label": "no water", "severity": 1, "detail": "tap 3", "target": "6"},
        {"code": "paused", "label": "paused by the operator", "severity": 0, "detail": "", "target": ""},
    ],
    "requests": [
        {"request": "answer.stay", "verb": "answer", "possible": True, "reason": ""},
        {"request": "answer.leave", "verb": "answer", "possible": False, "reason": "not asked"},
        {"request": "operator.skip_current", "verb": "skip_current", "possible": True, "reason": ""},
        {"request": "mission.start", "verb": "start", "start": "water", "possible": False, "reason": BUSY},
        {"request": "mission.start", "verb": "start", "start": "weed", "possible": False, "reason": BUSY},
    ],
}  # fmt: skip


def test_what_holds_a_mission_and_what_it_asks_is_told() -> None:
    """With the reason of each hold, the counters, and the codes that were reported last."""
    assert list(lines(VIEW, VERBS)) == [
        "WATERING ASKING  target 7",
        "  mission    WaterMission lupin-1, for 01:23.4",
        "  done       4 completed, 1 skipped of 9 targets",
        "  paused     paused by the operator",
        "             e-stop engaged",
        "  asks       Go on?",
        "             lupin answer go_on: Go on",
        "             lupin answer stay: Stay here",
        "             else stay in 00:09.0",
        "  last       no water (tap_dry: tap 3), target 6",
        "             paused by the operator (paused)",
        "  to do      Release the stop, then resume.",
        "  possible   answer stay, skip",
        "  not now    start water, start weed: start refused: a mission is already running",
    ]


def test_what_an_orchestrator_does_not_tell_is_not_shown() -> None:
    """One of an older version tells nothing of what is possible."""
    shown = look(TOLD[0], {}, {}, 11.0)
    assert list(lines(shown, VERBS)) == ["BOOT", "  doing      plugins.ready"]


def test_what_happened_to_another_mission_is_not_shown() -> None:
    """Nor what was before a reset: each is of the mission of that time."""
    (step,), possible, offer = TOLD
    aborted = {
        "code": "mission_aborted",
        "label": "mission aborted",
        "severity": 1,
        "detail": "",
        "target": "",
    }

    def at(lifecycle: str, mission_id: str, *codes: Mapping[str, Any]) -> dict[str, Any]:
        view = {**step["view"], "lifecycle": lifecycle, "mission_id": mission_id}
        return {"step": {**step["step"], "codes": list(codes)}, "view": view}

    before = [at("INSPECTING", "one", aborted), at("FAULT", "one", aborted)]
    assert look(before, possible, offer, 11.0)["codes"] == [aborted, aborted]
    assert look([*before, at("READY", "one")], possible, offer, 11.0)["codes"] == []
    assert look([*before, at("PREPARE", "two"), at("DONE", "two")], possible, offer, 11.0)["codes"] == []


def test_a_mission_without_targets_has_none_to_count() -> None:
    """The row of its counters is left out."""
    without = {**VIEW, "total": 0, "counts": dict.fromkeys(VIEW["counts"], 0)}
    assert list(lines(without, VERBS))[1:3] == [
        "  mission    WaterMission lupin-1, for 01:23.4",
        "  paused     paused by the operator",
    ]


def test_what_to_do_is_the_advice_of_the_holds_and_of_what_happened_last() -> None:
    """First that of the holds; then, while no mission is under way, also that of refused starts."""
    refused = [{"verb": "start", "code": "battery_low"}, {"verb": "pause", "code": "not_running"}]
    assert to_do({"held": ["estop", "pause"], "code": "nav_timeout"}, refused, TOLD[2]) == [
        "Release the stop, then resume.",
        "Resume to let the mission go on.",
    ]
    assert to_do({"held": [], "code": "nav_timeout"}, refused, TOLD[2]) == [
        "Look whether the way is free; a longer way needs a larger nav_timeout_s.",
        "Charge the robot, then resume or start.",
    ]
    assert to_do({"held": [], "code": ""}, (), TOLD[2]) == []
