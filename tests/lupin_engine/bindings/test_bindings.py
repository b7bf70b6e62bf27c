"""Bindings: a plugin that is a file, known without ROS, and held against definitions where there are any."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from lupin_engine.bindings import file as binding_file
from lupin_engine.bindings.data import Binding, Outcome
from lupin_engine.bindings.file import BindingNode
from lupin_engine.bindings.meaning import Definition
from lupin_engine.bindings.reader import check_definition
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.nodes import Node
from lupin_engine.chart.source import read
from lupin_engine.chart.validation import validate
from lupin_engine.errors import Severity
from lupin_engine.missions.folders import LIFECYCLE
from lupin_engine.missions.load import check_chart, forget, inspect_chart, load_chart, load_files
from lupin_engine.plugin.contract import OnHold
from lupin_engine.plugin.mocks import MockCases
from lupin_engine.plugin.registry import Catalog
from lupin_engine.plugin.robot import name_of
from lupin_engine.plugin.types import BOOL, COUNT, LENGTH, NUMBER, POSE, TEXT, Type, list_of
from lupin_engine.sim.simulation import Script, simulate
from tests.lupin_engine.chart.test_words import key, keys_said

BOUND = Path(__file__).parents[2] / "charts" / "good" / "bound"
FIELD = "lupin_msgs/srv/GetField"

REQUEST = Type(
    "record",
    f"{FIELD}.Request",
    fields={"sensor_type": TEXT, **dict.fromkeys(("resolution", "bbox_min_x", "bbox_max_x"), NUMBER)},
)
RESPONSE = Type(
    "record",
    f"{FIELD}.Response",
    fields={"ok": BOOL, "error_message": TEXT, "values": list_of(NUMBER), "width": COUNT},
)


#: What expressions see besides arguments and answer.
AROUND: dict[str, Any] = {"param": {}, "constant": {}, "now": 0.0}


def definition(request: Type = REQUEST, response: Type = RESPONSE) -> Definition:
    """What is installed, when anything is."""
    return {"request": request, "response": response, "constant": Type("record", "constant")}


def answer(**fields: Any) -> dict[str, Any]:
    """An answer of the service."""
    return {"response": {"ok": True, "values": [], "width": 0, "error_message": "", **fields}}


def message(name: str, **fields: Type) -> Type:
    """A message that is installed, when anything is."""
    return Type("record", name, fields=fields)


SECONDS = message("builtin_interfaces/msg/Duration", sec=COUNT, nanosec=COUNT)
POSE_MESSAGE = message("geometry_msgs/msg/Pose", position=message("P"), orientation=message("Q"))
HEADER = message(
    "std_msgs/msg/Header", stamp=replace(SECONDS, name="builtin_interfaces/msg/Time"), frame_id=TEXT
)
CODES = message("constant", BLOCKED=COUNT)
DEPTH = message("Depth", stone=BOOL, depths=list_of(message("Reading", value=NUMBER)))
GOAL = {
    "header": HEADER,
    "middle": POSE_MESSAGE,
    "patience": SECONDS,
    "points": list_of(message("Point", x=NUMBER)),
    "mode": COUNT,
    "step": COUNT,
    "stops": list_of(POSE_MESSAGE),
}
SURVEY: dict[str, Definition] = {
    "survey_msgs/action/Walk": {
        "goal": message("Walk.Goal", **GOAL),
        "result": message(
            "Walk.Result", steps=COUNT, end=POSE_MESSAGE, took=SECONDS, error=COUNT, way=NUMBER
        ),
        "feedback": message("Walk.Feedback", steps=COUNT),
        "constant": message("constant", SLOW=COUNT, Error=CODES),
    },
    "survey_msgs/msg/Depth": {"message": DEPTH, "constant": message("constant")},
}
SAYING: Definition = {"message": message("String", data=TEXT), "constant": message("constant")}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the binding that says everything, and a mission that uses it."""
    shutil.copytree(BOUND, tmp_path / "missions")
    return tmp_path / "missions"


@pytest.fixture
def survey(catalog: Catalog) -> Binding:
    """The binding that says everything."""
    loaded = load_files(BOUND / LIFECYCLE, [BOUND / "survey_mission.yaml"], catalog)
    return loaded.bindings["survey"]


def test_a_good_binding_is_without_a_word(catalog: Catalog) -> None:
    """Neither an error nor a warning, for the file and the mission that uses it."""
    chart, found = check_chart(BOUND / LIFECYCLE, [BOUND / "survey_mission.yaml"], catalog)
    assert found == ()
    assert chart is not None
    assert chart.plugins == ("bridge", "survey")  # the lifecycle reads the state of the robot from there
    assert "survey" not in catalog.plugins
    assert chart.catalog.operations["survey.ask"].doc == "Ask for the field around a place."
    assert chart.catalog.operations["survey.walk"].adopts


@pytest.mark.parametrize(
    ("more", "line", "why"),
    [
        ("on_hold: cancel", 57, "a restart is a hold, and on_hold cancels it"),
        ("watch: client", 57, "its server ends it when the client falls silent, which a restart does"),
    ],
)
def test_what_cannot_go_on_after_a_restart(
    more: str, line: int, why: str, folder: Path, catalog: Catalog
) -> None:
    file = folder / "bindings" / "survey.yaml"
    text = file.read_text(encoding="utf-8")
    file.write_text(
        text.replace("    on_restart: finish\n", f"    on_restart: finish\n    {more}\n"), "utf-8"
    )
    _, found = check_chart(folder / LIFECYCLE, [folder / "survey_mission.yaml"], catalog)
    (told,) = found
    assert (told.place.line, told.rule, told.problem, told.hint) == (line, "wrong-shape", why, "leave it out")


def test_a_call_cannot_go_on_after_a_restart(folder: Path, catalog: Catalog) -> None:
    file = folder / "bindings" / "survey.yaml"
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace("    watch: client\n", "    on_restart: finish\n"), "utf-8")
    _, found = check_chart(folder / LIFECYCLE, [folder / "survey_mission.yaml"], catalog)
    why = "only an action goes on: the answer to a call is lost with the process that has called"
    assert [told.problem for told in found] == [why]


def test_every_word_of_a_binding_is_said() -> None:
    """A word that no good binding says is a word that nobody has seen loading."""
    findings = Findings()
    raw = read(BOUND / "bindings" / "survey.yaml", findings)
    assert raw is not None
    said = keys_said(validate(raw, BindingNode, findings))
    models: list[type[Node]] = [getattr(binding_file, n) for n in binding_file.__all__ if n != "KIND"]
    assert {key(model, name) for model in models for name in model.model_fields} - said == set()


def test_missions_see_it_like_any_plugin(survey: Binding) -> None:
    """Arguments with types and defaults, result, code, what it uses, what a hold does, the mock."""
    operation = survey.plugin.operations["ask"]
    assert {name: str(argument.type) for name, argument in operation.arguments.items()} == {
        "sensor": "text",
        "place": "pose",
        "reach": "length",
    }
    assert operation.arguments["reach"].default == 2.0
    assert {name: str(kind) for name, kind in operation.result.items()} == {
        "values": "list of number",
        "first": "number",
        "cells": "count",
    }
    assert [(code.name, code.label, int(code.severity)) for code in operation.codes] == [
        ("no_field", "there is no field", 2)
    ]
    assert (operation.uses, operation.on_hold) == (("base", "arm"), OnHold.CANCEL)
    usual = {"values": [1.5], "first": 1.5, "cells": 1}
    assert isinstance(operation.mock.result, MockCases)
    assert (operation.mock.after, operation.mock.result.usual) == (0.5, usual)
    assert survey.calls["ask"].endpoint.deadline == 120.0


def test_what_is_sent_is_computed_from_the_arguments(survey: Binding) -> None:
    """Units are gone: metres on the wire."""
    place = {"x": 10.0, "y": 0.0, "yaw": 0.0}
    sent = survey.calls["ask"].sending.sent({"sensor": "co2", "place": place, "reach": 2.0}, AROUND)
    assert sent == {"sensor_type": "co2", "resolution": 0.5, "bbox_min_x": 8.0, "bbox_max_x": 12.0}


def test_what_an_answer_means(survey: Binding) -> None:
    """Done with the result, or not with the detail."""
    call = survey.calls["ask"]
    good = call.outcome(answer(ok=True, values=[2.5, 3.0], width=2), AROUND)
    assert good.result == {"values": [2.5, 3.0], "first": 2.5, "cells": 2}
    bad = call.outcome(answer(ok=False, error_message="no such sensor"), AROUND)
    assert bad == Outcome(None, "no_field", "no such sensor")
    with pytest.raises(ValueError, match="expected count of at least 0, got -1"):
        call.outcome(answer(ok=True, values=[1.0], width=-1), AROUND)


def test_it_is_simulated(catalog: Catalog) -> None:
    """By the mock in the file."""
    chart = load_chart(BOUND / LIFECYCLE, [BOUND / "survey_mission.yaml"], catalog)
    run = simulate(chart, Script("Survey", {}))
    ended = [step for step in run.steps if step.event.name == "attempt.done"]
    assert [(step.time, step.event.data["result"]["first"]) for step in ended] == [(0.5, 1.5)]


@pytest.mark.parametrize(("reach", "cells"), [("2 m", 1), ("1 m", 4)])
def test_what_it_is_asked_may_change_the_simulated_answer(
    reach: str, cells: int, folder: Path, catalog: Catalog
) -> None:
    mission = folder / "survey_mission.yaml"
    text = mission.read_text(encoding="utf-8")
    mission.write_text(text.replace("{sensor: co2,", f"{{sensor: co2, reach: {reach},"), encoding="utf-8")
    run = simulate(load_chart(folder / LIFECYCLE, [mission], catalog), Script("Survey", {}))
    ended = [step.event.data["result"] for step in run.steps if step.event.name == "attempt.done"]
    assert [(result["first"], result["cells"]) for result in ended] == [(1.5, cells)]


def test_a_simulated_answer_comes_at_once_when_nothing_is_said(folder: Path, catalog: Catalog) -> None:
    """The result must be written, the time need not."""
    binding = folder / "bindings" / "survey.yaml"
    binding.write_text(binding.read_text(encoding="utf-8").replace("after: 500 ms, ", ""), encoding="utf-8")
    chart = load_chart(folder / LIFECYCLE, [folder / "survey_mission.yaml"], catalog)
    assert chart.catalog.operations["survey.ask"].mock.after == 0.0


def test_the_same_files_are_the_same_chart(folder: Path, catalog: Catalog) -> None:
    """So looking for changes costs next to nothing; a binding that changed makes another one."""
    mission = [folder / "survey_mission.yaml"]
    first = load_files(folder / LIFECYCLE, mission, catalog)
    assert load_chart(folder / LIFECYCLE, mission, catalog) is first.chart
    binding = folder / "bindings" / "survey.yaml"
    binding.write_text(binding.read_text(encoding="utf-8").replace("500 ms", "700 ms"), encoding="utf-8")
    second = load_files(folder / LIFECYCLE, mission, catalog)
    assert second.chart is not first.chart
    assert second.bindings["survey"] is not first.bindings["survey"]
    assert second.chart.catalog.operations["survey.ask"].mock.after == pytest.approx(0.7)


def test_a_text_that_is_edited_is_read_in_place_of_its_file(folder: Path, catalog: Catalog) -> None:
    """An editor asks about what is on the screen, also of a file that was never saved."""
    new = folder / "bindings" / "lamp.yaml"
    text = b"binding: lamp\nsummary: A lamp.\noperations: {}\n"
    mission = [folder / "survey_mission.yaml"]
    inspection = inspect_chart(folder / LIFECYCLE, mission, catalog, {new: text})
    assert inspection.bound is not None
    assert list(inspection.bound.bindings) == ["survey", "lamp"]


# -- actions and topics ------------------------------------------------------------------------------------

PLACE = {"x": 10.0, "y": 0.0, "yaw": 0.0}
ON_THE_WAY: dict[str, Any] = {
    "param": {"survey_frame": "bed", "survey_steps": 2},
    "constant": {"SLOW": 3, "Error": {"BLOCKED": 9}},
    "now": 12.5,
}


def walked(status: str = "succeeded", **fields: Any) -> dict[str, Any]:
    """How a walk ended."""
    end = {"position": {"x": 1.0, "y": 2.0}, "orientation": {"x": 0.0, "y": 0.0, "z": 1.0, "w": 0.0}}
    return {
        "status": status,
        "result": {"steps": 4, "end": end, "took": 2.5, "error": 0, "way": 5.0, **fields},
    }


def test_what_else_missions_see(survey: Binding) -> None:
    """Actions, live values, events, parameters; several codes; a mock that changes a live value."""
    plugin = survey.plugin
    walk = plugin.operations["walk"]
    assert [code.name for code in walk.codes] == ["no_walk", "blocked", "nobody_there", "refused"]
    assert walk.mock.values == {"soil.depth": 0.02}
    assert (plugin.actions["call_out"].moves, list(plugin.actions["call_out"].arguments)) == (True, ["words"])
    depth = plugin.values["soil.depth"]
    assert (depth.type, depth.freshness, depth.initial) == (LENGTH, 3.0, 1.0)
    assert plugin.events["stone"].fields == {"deep": NUMBER, "kind": TEXT}
    steps = plugin.parameters["survey_steps"]
    assert (steps.default, steps.minimum, steps.maximum) == (2, 1.0, 9.0)
    assert survey.sends["call_out"].endpoint.qos == "latched"


def test_a_goal_is_computed(survey: Binding) -> None:
    """From arguments, parameters, constants and the time; lists of messages, too."""
    arguments = {"place": PLACE, "stops": [PLACE], "step": 0.57}
    assert survey.calls["walk"].sending.sent(arguments, ON_THE_WAY) == {
        "header": {"stamp": 12.5, "frame_id": "bed"},
        "middle": PLACE,
        "patience": "5 s",
        "points": [{"x": 1.5}, {"x": 10.0}],
        "mode": 3,
        "step": 57,
        "stops": [PLACE],
    }


def lamp(folder: Path, catalog: Catalog, text: str) -> Binding:
    """A binding that an author has on the screen beside the one that says everything."""
    head = "binding: lamp\nsummary: A lamp.\ncodes: {failed: {label: it failed}}\n"
    texts = {folder / "bindings" / "lamp.yaml": f"{head}{text}".encode()}
    inspection = inspect_chart(folder / LIFECYCLE, [folder / "survey_mission.yaml"], catalog, texts)
    assert [str(one) for one in inspection.found if one.severity is Severity.ERROR] == []
    assert inspection.bound is not None
    return inspection.bound.bindings["lamp"]


LEAST = """\
operations:
  light:
    summary: Light it.
    action: {name: /light, type: lamp_msgs/action/Light}
    done_when: status == 'succeeded'
    code: failed
    progress: ${ feedback.share }
actions:
  blink:
    summary: Blink.
    topic: {name: /blink, type: std_msgs/msg/Empty}
values:
  lamp.share:
    summary: How bright it is.
    type: number
    topic: {name: /share, type: std_msgs/msg/Float32}
    from: ${ message.data }
  lamp.where:
    summary: Where it is.
    type: length
    topic: {name: /where, type: std_msgs/msg/Float32}
    from: 3 m
    unit: cm
"""


def test_what_is_not_written_is_the_harmless(folder: Path, catalog: Catalog) -> None:
    """Nothing moves the robot, one code is for everything, every message counts and is taken as it is."""
    binding = lamp(folder, catalog, LEAST)
    light = binding.calls["light"]
    assert (light.unavailable, light.rejected, light.moves) == ("failed", "failed", False)
    assert binding.plugin.operations["light"].on_hold is OnHold.FINISH
    assert light.sending.sent({}, AROUND) == {}
    assert light.outcome({"status": "succeeded", "result": {}}, AROUND) == ({}, "", "")
    assert light.outcome({"status": "aborted", "result": {}}, AROUND) == (None, "failed", "")
    assert binding.plugin.actions["blink"].moves is False
    assert binding.sends["blink"].endpoint.qos == "reliable"
    share = binding.plugin.values["lamp.share"]
    assert (share.freshness, share.initial) == (None, None)
    assert binding.values["lamp.share"].heard({"data": 0.0}, AROUND) == {"value": 0.0}
    assert binding.values["lamp.share"].heard({"data": 0.25}, AROUND) == {"value": 0.25}


def test_what_is_written_without_an_expression_has_its_own_unit(folder: Path, catalog: Catalog) -> None:
    """The unit beside it is the one of numbers in messages."""
    assert lamp(folder, catalog, LEAST).values["lamp.where"].heard({}, AROUND) == {"value": 3.0}


@pytest.mark.parametrize(
    ("share", "told"), [(0.123456, "0.1235"), (7, "7"), ("half", "half"), (True, "True")]
)
def test_one_value_of_progress_needs_no_name(share: Any, told: str, folder: Path, catalog: Catalog) -> None:
    """People are told it alone, in a few digits."""
    assert lamp(folder, catalog, LEAST).calls["light"].progress({"share": share}, AROUND) == told


def test_what_to_write_stands_apart_from_what_is_wrong(folder: Path, catalog: Catalog) -> None:
    """An editor and `check --format json` show both by themselves."""
    file = folder / "bindings" / "survey.yaml"
    file.write_text(
        file.read_text(encoding="utf-8").replace("{type: pose,", "{type: poze,"), encoding="utf-8"
    )
    found = inspect_chart(folder / LIFECYCLE, [folder / "survey_mission.yaml"], catalog).found
    assert {(one.problem, one.hint) for one in found if one.rule == "unknown-type"} == {
        ("unknown type 'poze'", "did you mean 'pose'?")
    }


def test_what_is_forgotten_is_read_again(folder: Path, catalog: Catalog) -> None:
    """Bindings as well: who measures how long reading takes measures all of it."""
    files = folder / LIFECYCLE, [folder / "survey_mission.yaml"]
    first = load_files(*files, catalog)
    forget()
    assert load_files(*files, catalog).bindings["survey"] is not first.bindings["survey"]


def test_how_an_action_ended(survey: Binding) -> None:
    """By status and result; a pose is read with its yaw."""
    call = survey.calls["walk"]
    end = {"x": 1.0, "y": 2.0, "yaw": pytest.approx(math.pi)}
    good = call.outcome(walked(), ON_THE_WAY)
    assert good.result == {"steps": 5, "end": end, "took": 2.5, "halves": 2, "way": 0.05}
    assert call.outcome(walked("aborted"), ON_THE_WAY) == Outcome(None, "no_walk")
    assert call.outcome(walked("aborted", error=9), ON_THE_WAY) == Outcome(None, "blocked")
    assert call.progress({"steps": 4}, ON_THE_WAY) == "steps -4, still walking"
    assert (call.unavailable, call.rejected, call.moves) == ("nobody_there", "refused", False)
    assert survey.calls["ask"].unavailable == "no_field"


def test_only_numbers_are_calculated_with(survey: Binding) -> None:
    """What an answer really has is seen when it comes."""
    with pytest.raises(TypeError, match="expected a number, got 'four'"):
        survey.calls["walk"].outcome(walked(steps="four"), ON_THE_WAY)
    with pytest.raises(TypeError, match="expected a number, got True"):
        survey.calls["walk"].outcome(walked(steps=True), ON_THE_WAY)


def test_what_a_topic_tells(survey: Binding) -> None:
    """A live value in its base unit, or nothing; an event with its fields."""
    depth, stone = survey.values["soil.depth"], survey.events["stone"]
    names = [name_of("/robot2", each.endpoint.name) for each in (depth, stone)]
    assert names == ["/robot2/survey/depth", "/survey/stone"]  # which is common
    message = {"stone": False, "depths": [{"value": 30.0}]}
    assert depth.heard(message, ON_THE_WAY) == {"value": pytest.approx(0.3)}
    assert depth.heard({"depths": [{"value": 0.0}]}, ON_THE_WAY) is None
    assert stone.heard(message, ON_THE_WAY) is None
    assert stone.heard({**message, "stone": True}, ON_THE_WAY) == {
        "deep": 30.0,
        "kind": "granite",
    }


# -- held against a definition -----------------------------------------------------------------------------


def misfits(binding: Binding, request: Type = REQUEST, response: Type = RESPONSE) -> list[str]:
    """What does not fit a definition, as `place: problem`, without the folder."""
    findings = Findings()
    known = {FIELD: definition(request, response), **SURVEY}
    check_definition(binding, lambda name: known.get(name, SAYING), findings)
    return [str(found).replace(f"{BOUND}/", "") for found in findings.all]


def test_a_binding_that_fits(survey: Binding) -> None:
    """Nothing is said."""
    assert misfits(survey) == []


def test_fields_that_are_not_there(survey: Binding) -> None:
    """Each at its place in the file, with the nearest one."""
    fewer = replace(REQUEST, fields={"sensor": TEXT, "resolution": NUMBER, "min_x": NUMBER, "max_x": NUMBER})
    other = replace(RESPONSE, fields={**RESPONSE.fields, "ok": TEXT, "width": NUMBER})
    assert misfits(survey, fewer, other) == [
        "bindings/survey.yaml:19:7: error: operations.ask.with: lupin_msgs/srv/GetField.Request has no field "
        "'sensor_type'; did you mean 'sensor'? [unknown-argument]",
        "bindings/survey.yaml:21:7: error: operations.ask.with: lupin_msgs/srv/GetField.Request has no field "
        "'bbox_min_x'; did you mean 'min_x'? [unknown-argument]",
        "bindings/survey.yaml:22:7: error: operations.ask.with: lupin_msgs/srv/GetField.Request has no field "
        "'bbox_max_x'; did you mean 'max_x'? [unknown-argument]",
        "bindings/survey.yaml:23:16: error: operations.ask.done_when: expected bool, "
        "but 'response.ok' is text [wrong-type]",
        "bindings/survey.yaml:27:38: error: operations.ask.result.cells: expected a whole number, but "
        "'response.width' is one with digits; write 'type: number' [wrong-type]",
    ]


def test_what_is_no_type_is_not_looked_for(folder: Path, catalog: Catalog) -> None:
    """The file has been told of it; nobody asks a middleware for such a name."""
    file = folder / "bindings" / "survey.yaml"
    file.write_text(file.read_text(encoding="utf-8").replace(FIELD + ",", "GetField,"), encoding="utf-8")
    inspection = inspect_chart(folder / LIFECYCLE, [folder / "survey_mission.yaml"], catalog)
    assert "bad-name" in {one.rule for one in inspection.found}
    assert inspection.bound is not None
    assert misfits(inspection.bound.bindings["survey"]) == []


def test_types_that_do_not_fit(survey: Binding) -> None:
    """A text is no number; units do not count, for the wire has none."""
    narrow = {**REQUEST.fields, "sensor_type": NUMBER, "bbox_min_x": LENGTH, "resolution": TEXT}
    told = misfits(survey, replace(REQUEST, fields=narrow))
    assert told == [
        "bindings/survey.yaml:19:23: error: operations.ask.with.sensor_type: expected a plain number, but "
        "'sensor' is text [wrong-type]",
        "bindings/survey.yaml:20:19: error: operations.ask.with.resolution: expected text, got 0.5; "
        "quote it: '0.5' [wrong-type]",
    ]


def test_messages_in_messages(folder: Path, catalog: Catalog) -> None:
    """A field that is a message itself is a mapping of its fields, as deep as it goes."""
    binding = folder / "bindings" / "survey.yaml"
    text = binding.read_text(encoding="utf-8")
    nested = 'resolution: {middle: {x: "${ place.x }", z: 0.5}}'
    binding.write_text(text.replace("resolution: 0.5", nested), encoding="utf-8")
    loaded = load_files(folder / LIFECYCLE, [folder / "survey_mission.yaml"], catalog)
    place = {"x": 10.0, "y": 0.0, "yaw": 0.0}
    call = loaded.bindings["survey"].calls["ask"]
    sent = call.sending.sent({"sensor": "co2", "place": place, "reach": 2.0}, AROUND)
    assert sent["resolution"] == {"middle": {"x": 10.0, "z": 0.5}}
    area = Type("record", "Area", fields={"middle": POSE})
    told = misfits(loaded.bindings["survey"], replace(REQUEST, fields={**REQUEST.fields, "resolution": area}))
    assert [line.partition("error: ")[2] for line in told] == [
        "operations.ask.with.resolution.middle: pose has no field 'z'; "
        "allowed: 'x', 'y', 'yaw' [unknown-argument]"
    ]


WARD_MESSAGE = {"id": TEXT, "floor": COUNT, "pose": POSE_MESSAGE, "door": NUMBER}
BED_MESSAGE = message("Bed", number=COUNT, free=BOOL)
RIDE: Definition = {
    "request": message(
        "Request",
        floors=list_of(COUNT),
        goal=Type("record", "Goal", fields={"name": TEXT, "place": POSE_MESSAGE, "width": NUMBER}),
        stops=list_of(COUNT),
        whole=message("Ward", **WARD_MESSAGE),
    ),
    "response": message(
        "Response", ok=BOOL, ward=message("Ward", **WARD_MESSAGE, beds=list_of(BED_MESSAGE), more=TEXT)
    ),
    "constant": Type("record", "constant"),
}


def test_a_record_and_the_message_that_it_is_sent_as(catalog: Catalog) -> None:
    """By their fields: a pose in it fills a pose, and what the other has besides is left out."""
    folder = BOUND.parent / "records"
    binding = load_files(folder / LIFECYCLE, [folder / "rounds.yaml"], catalog).bindings["lift"]
    ward = {"id": "lab", "floor": 1, "pose": {"x": 1.0, "y": 2.0, "yaw": 0.0}, "door": 1.2, "beds": []}
    ride = binding.calls["ride"]
    sent = ride.sending.sent({"start": ward, "to": ward, "by": [ward]}, AROUND)
    assert (sent["floors"], sent["goal"]["width"], sent["stops"], sent["whole"]) == ([1, 1], 1.2, [1], ward)
    position, turned = {"x": 1.0, "y": 2.0, "z": 0.0}, {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    place = {"position": position, "orientation": turned}
    heard = {**ward, "pose": place, "beds": [{"number": 1, "free": True}], "more": "unread"}
    given = ride.outcome({"response": {"ok": True, "ward": heard}}, AROUND).result
    assert given == {"at": {**ward, "beds": [{"number": 1, "free": True}]}}

    def told(definition: Definition) -> list[tuple[str, str]]:
        findings = Findings()
        check_definition(binding, lambda name: definition if name.endswith("Ride") else None, findings)
        errors = (found for found in findings.all if found.severity is Severity.ERROR)
        return [(found.problem, found.hint) for found in errors]

    assert told(RIDE) == []
    without = message("Response", ok=BOOL, ward=message("Ward", id=TEXT))
    problem = "expected ward, but 'response.ward' is Ward"
    assert told({**RIDE, "response": without}) == [(problem, "it has no 'floor'")]
    more = message("Request", **{**RIDE["request"].fields, "whole": message("Ward", floor=TEXT)})
    assert told({**RIDE, "request": more}) == [
        ("expected Ward, but 'to' is ward", "its 'floor' is a plain number")
    ]


def test_whole_numbers_of_a_message_may_be_of_any_unit(folder: Path, catalog: Catalog) -> None:
    """What is on the wire has no unit that could be wrong."""
    file = folder / "bindings" / "survey.yaml"
    text = file.read_text(encoding="utf-8").replace("response.ok and", "response.width > param.least and")
    file.write_text(f"{text}\n  least: {{type: length, default: 5 cm}}\n", encoding="utf-8")
    loaded = load_files(folder / LIFECYCLE, [folder / "survey_mission.yaml"], catalog)
    assert misfits(loaded.bindings["survey"]) == []


def refuse(_: str) -> Definition:
    """Know no type."""
    raise LookupError("lupin_msgs has no service 'GetField'; did you mean 'GetFields'?")


@pytest.mark.parametrize(
    ("definitions", "told"),
    [
        (
            refuse,
            "error: operations.ask.service: lupin_msgs has no service 'GetField'; did you mean 'GetFields'? "
            "[unknown-type]",
        ),
        (
            lambda _: None,
            "warning: operations.ask.service: nobody has looked whether this fits lupin_msgs/srv/GetField, "
            "which is not installed here; check it where it is [unknown-type]",
        ),
    ],
)
def test_a_type_that_is_not_there(
    survey: Binding, definitions: Callable[[str], Definition | None], told: str
) -> None:
    """An error where it should be; where nothing of its package is, only a warning."""
    findings = Findings()
    others = {**SURVEY, "std_msgs/msg/String": SAYING}
    check_definition(survey, lambda name: others.get(name) or definitions(name), findings)
    assert [str(found).removeprefix(f"{found.place}: ") for found in findings.all] == [told]


def test_actions_and_topics_that_do_not_fit(survey: Binding) -> None:
    """Their parts are those of the definition: fields, constants, a pose that needs a stamp around it."""
    goal = {**GOAL, "middle": message("PoseStamped", header=HEADER, pose=POSE_MESSAGE), "patience": NUMBER}
    other = {
        "goal": message("Walk.Goal", **{**goal, "points": NUMBER, "mode": TEXT, "stops": list_of(NUMBER)}),
        "result": message("Walk.Result", steps=TEXT, end=TEXT, took=TEXT, error=COUNT, way=NUMBER),
        "feedback": message("Walk.Feedback", stairs=COUNT),
        "constant": message("constant", SLOW=COUNT),
    }
    findings = Findings()
    known = {**SURVEY, "survey_msgs/action/Walk": other, FIELD: definition()}
    check_definition(survey, lambda name: known.get(name, SAYING), findings)
    assert [str(found).partition("error: operations.walk.")[2] for found in findings.all] == [
        "with.middle: expected PoseStamped, but 'place' is pose; "
        "write 'pose: ${ place }' inside of it [wrong-type]",
        "with.patience: expected a plain number, got '5 s'; "
        "write a number without a unit, or in % [wrong-unit]",
        "with.points: expected a plain number, got a list of 2 [wrong-type]",
        "with.mode: expected text, but 'constant.SLOW' is a plain number [wrong-type]",
        "with.stops: expected list of number, but 'stops' is list of pose [wrong-type]",
        "done_when: expected a number, but 'result.steps' is text [wrong-type]",
        "result.steps: expected a number, but 'result.steps' is text [wrong-type]",
        "result.end: expected pose, but 'result.end' is text [wrong-type]",
        "result.took: expected duration (s), but 'result.took' is text [wrong-type]",
        "code_when.blocked: 'constant' has no 'Error'; allowed: 'SLOW' [unknown-name]",
        "progress.steps: 'feedback' has no 'steps'; allowed: 'stairs' [unknown-name]",
    ]
