"""Requests that are refused by what they contain: the sentence, and that nothing has begun."""

from __future__ import annotations

from pathlib import Path

import pytest

from lupin_engine.chart.model import Chart
from lupin_engine.machine.event import Start, accepted, done
from lupin_engine.missions.folders import default_missions_folder
from lupin_engine.missions.load import load_chart
from lupin_engine.runtime.possible import RequestPreview
from lupin_engine.runtime.setup import make_machine, make_world
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
