"""Requests that are refused by what they contain: the sentence, and that nothing has begun."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from lupin_engine.chart.model import Chart
from lupin_engine.errors import ChartError
from lupin_engine.machine.event import Start, accepted, done
from lupin_engine.missions.folders import default_missions_folder
from lupin_engine.missions.load import load_chart
from lupin_engine.runtime.possible import RequestPreview
from lupin_engine.runtime.setup import make_machine, make_world
from lupin_engine.sim.scenario import Scenario, load_scenario
from lupin_engine.sim.simulation import Script, simulate
from lupin_verify.proof import ProofVerdict, prove
from lupin_verify.situations.explorer import Bounds
from tests import shipped

COOKBOOK = Path(__file__).parents[3] / "docs" / "cookbook"
WARDS = (COOKBOOK / "meals.yaml").read_text(encoding="utf-8")
SERVED_UNKNOWN = """\
properties:
  only_known: {never: in_state('SERVING') and any(w not in param.wards for w in request.tag_sequence)}
"""


def chart(folder: Path, mission: str, name: str = "wards") -> Chart:
    """Return the chart of a mission in the shipped lifecycle."""
    file = folder / f"{name}.yaml"
    file.write_text(mission, encoding="utf-8")
    lifecycle = default_missions_folder() / "lifecycle.yaml"
    return load_chart(lifecycle, [file], shipped.catalog())


REFUSED = [
    (["W9"], "unknown ward: 'W9'"),
    (["W1", "W9", "W10"], "unknown ward: 'W9', 'W10'"),
    (["a", "b", "c", "d", "e", "f", "g"], "unknown ward: 'a', 'b', 'c', 'd', 'e' and 2 more"),
    (["W1", "W2", "W3"], "more wards than the trolley has shelves: 3"),
]


@pytest.mark.parametrize(("wards", "sentence"), REFUSED)
def test_the_value_is_named_and_nothing_begins(tmp_path: Path, wards: list[str], sentence: str) -> None:
    """The label of the code, the value, and the state as it was."""
    run = simulate(chart(tmp_path, WARDS), Script("Meals", {"tag_sequence": wards}))
    (step,) = run.history.refused
    assert step.refusal is not None
    assert (step.refusal.text, step.changed, run.view.lifecycle) == (sentence, False, "READY")


NAMED = [
    ("value: ", "unknown ward: 'W1', 'W9'"),  # that of the field
    ('value: "${ [] }"', "unknown ward"),
    ("value: 3", "unknown ward: 3"),
    ('value: "${ param.dependency_timeout_s }"', "unknown ward: 30 s"),
    ('value: "${ len(request.tag_sequence) > 1 }"', "unknown ward: true"),
]


@pytest.mark.parametrize(("value", "sentence"), NAMED)
def test_a_value_of_any_type_is_named(tmp_path: Path, value: str, sentence: str) -> None:
    """A number in its unit, a truth value, and without a value that of the field."""
    said = 'value: "${ [w for w in request.tag_sequence if w not in param.wards] }"'
    assert WARDS.count(said) == 1
    given = Script("Meals", {"tag_sequence": ["W1", "W9"]})
    (step,) = simulate(chart(tmp_path, WARDS.replace(said, value)), given).history.refused
    assert step.refusal is not None
    assert step.refusal.text == sentence


def test_a_default_that_is_refused_is_known_beforehand(tmp_path: Path) -> None:
    """The list of what is possible says why, and that other fields may be accepted."""
    machine = make_machine(chart(tmp_path, WARDS.replace("default: [W1]", "default: [W7]")), {})
    started = machine.start(0.0)
    (attempt,) = [command.attempt for command in started.commands if isinstance(command, Start)]
    machine.handle(accepted(attempt), 0.0)
    machine.handle(done(attempt, {}), 0.0)
    told = {one["verb"]: one for one in RequestPreview(machine).news(0.0) or ()}["start"]
    assert (told["possible"], told["fields"]) == (False, True)
    assert (told["code"], told["reason"]) == ("unknown_ward", "unknown ward: 'W7'")


def test_a_mission_that_is_used_refuses_what_it_is_given(tmp_path: Path) -> None:
    """That is an error of the mission around it, with the place of the use."""
    (tmp_path / "wards.yaml").write_text(WARDS, encoding="utf-8")
    evening = "mission: Evening\nstates:\n  A: {use: wards, with: {tag_sequence: [W4]}, on_done: done}\n"
    run = simulate(chart(tmp_path, f"{evening}  done: {{type: final}}\n", "evening"), Script("Evening", {}))
    problem = f"{tmp_path}/evening.yaml:3:12: use Meals: unknown ward: 'W4'"
    assert (run.view.lifecycle, run.history.errors) == ("FAULT", [problem])


@pytest.mark.slow
@pytest.mark.parametrize(("guard", "holds"), [("any(", True), ("all(", False), ("any(w == 'W9' and ", False)])
def test_a_proof_tries_both_outcomes(tmp_path: Path, guard: str, holds: bool) -> None:
    """A guard that lets an unknown ward through is found: alone, or beside one that is known."""
    mission = WARDS.replace("guard: any(w not", f"guard: {guard}w not")
    world = make_world(chart(tmp_path, mission + SERVED_UNKNOWN), {})
    proof = prove(world, Bounds(targets=2, restarts=False))
    (found,) = [one for one in proof.properties if one.name == "only_known"]
    assert (found.verdict is ProofVerdict.HOLDS) == holds


SCENARIO = """\
scenario: what is given is checked where it is written
mission: wards
parameters:
  trolley: 1
  wards: {id: lab}
request:
  deliver_to:
    - {id: lab, flor: 1, pose: {x: 1 m, y: 0 kg, yaw: 0 rad}, door: 20 cm}
    - {id: icu, floor: 1, pose: {x: 1 m, y: 0 m, yaw: 0 rad}, door: 1 s}
expect: {final: DONE}
"""
BARE = """\
scenario: older files have numbers without a unit
mission: wards
parameters: {trolley: 0.6}
request: {deliver_to: [{id: lab, floor: 1, pose: {x: 1, y: 0 m, yaw: 0 rad}, door: 1.2}], delivr_to: []}
expect: {published: [lab OK]}
"""
LATER = "(an error in versions from 2027-02-28 on; 'lupin upgrade' mends it) [no-unit]"


def bare(number: str) -> str:
    """Return what is told of a length without its unit."""
    return f"{number} has no unit, but a length needs one; write '{number} m' {LATER}"


def scenario(folder: Path, text: str) -> Scenario:
    """Return a scenario of the wards of the cookbook."""
    shutil.copytree(COOKBOOK / "parts", folder / "parts")
    shutil.copy(COOKBOOK / "wards.yaml", folder)
    shutil.copy(default_missions_folder() / "lifecycle.yaml", folder)
    file = folder / "x.scenario.yaml"
    file.write_text(text, encoding="utf-8")
    return load_scenario(file, shipped.catalog())


def test_what_a_scenario_gives_is_checked_field_by_field(tmp_path: Path) -> None:
    """All at once, each at its place; a scenario that expects a refusal may give what is refused."""
    with pytest.raises(ChartError) as caught:
        scenario(tmp_path / "wrong", SCENARIO)
    assert [str(one).partition("x.scenario.yaml:")[2] for one in caught.value.diagnostics] == [
        "5:10: error: parameters.wards: expected list of ward, got a mapping with 'id'; "
        "a list is wanted: write [ ... ] [wrong-type]",
        "8:7: error: request.deliver_to: this ward has no floor [wrong-type]",
        "8:17: error: request.deliver_to: a ward has no 'flor'; did you mean 'floor'? [wrong-type]",
        "8:44: error: request.deliver_to.pose.y: expected length (m), got '0 kg'; "
        "its units are 'mm', 'cm', 'm', 'km' [wrong-unit]",
        "8:69: error: request.deliver_to.door: expected length between 50 and 300 cm, got '20 cm' "
        "[wrong-type]",
        "9:69: error: request.deliver_to.door: expected length (m), got '1 s'; "
        "its units are 'mm', 'cm', 'm', 'km' [wrong-unit]",
    ]
    refused = SCENARIO.partition("parameters:")[0] + "request:" + SCENARIO.partition("request:")[2]
    found = scenario(tmp_path / "refused", refused.replace("{final: DONE}", "{refused: [bad_request]}"))
    assert not found.failures(found.run())


def test_numbers_without_a_unit_warn_for_some_time(tmp_path: Path) -> None:
    """They are in base units, as over ROS."""
    found = scenario(tmp_path / "bare", BARE)
    assert not found.failures(found.run())
    assert [str(one).partition("x.scenario.yaml:")[2] for one in found.warnings] == [
        f"3:23: warning: parameters.trolley: {bare('0.6')}",
        f"4:54: warning: request.deliver_to.pose.x: {bare('1')}",
        f"4:84: warning: request.deliver_to.door: {bare('1.2')}",
        "4:91: warning: request: Wards has no field 'delivr_to', which is ignored; "
        "did you mean 'deliver_to'? (an error in versions from 2027-02-28 on) [unknown-argument]",
    ]
