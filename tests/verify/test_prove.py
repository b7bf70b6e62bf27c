"""`lupin prove`: what it says of a mission that is well, and of wrong usage."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from lupin_engine.cli.main import main
from lupin_engine.missions.folders import lifecycle_of
from lupin_engine.missions.load import load_chart
from lupin_engine.runtime.setup import make_world
from lupin_engine.verify.proof import Proof, ProofVerdict, prove
from lupin_engine.verify.situations.explorer import Bounds
from lupin_engine.verify.situations.found import ExplorationProgress
from tests import shipped

ROOT = Path(__file__).parents[2]


def test_a_budget_that_runs_out_proves_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 3, and how far it came."""
    assert main(["prove", "inspection", "--targets", "0", "--budget", "0 s", "--json"]) == 3
    (found,) = json.loads(capsys.readouterr().out)
    assert found["complete"] is False
    assert found["stopped"] == "the budget of 0 s ran out"
    assert {one["verdict"] for one in found["properties"]} == {"not proven"}


def wrong(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> Any:
    """Return what is said of wrong usage."""
    code = main(["prove", *arguments])
    return code, capsys.readouterr().err


def test_wrong_usage_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    """No such mission, and a budget that is no duration."""
    code, told = wrong(["inspektion"], capsys)
    assert code == 2
    assert "did you mean 'inspection'?" in told
    code, told = wrong(["inspection", "--budget", "60"], capsys)
    assert code == 2
    assert "--budget: expected duration, got '60'" in told


def test_check_proves_within_a_budget(capsys: pytest.CaptureFixture[str]) -> None:
    """What was not proven in time is told, and is no error; a budget that is none is."""
    assert main(["check", "inspection", "--prove", "0 s"]) == 0
    told = capsys.readouterr().out
    assert "InspectionMission: not proven, the budget of 0 s ran out: 1 situations" in told
    assert main(["check", "inspection", "--prove", "soon"]) == 2
    assert "--prove: expected duration, got 'soon'" in capsys.readouterr().err
    assert main(["check", "inspection", "--prove", "1 s", "--watch"]) == 2
    assert "--prove takes its time; leave out --watch" in capsys.readouterr().err


def test_inspection_is_proven() -> None:
    """The shipped mission with one target, in every situation: nothing is broken."""
    proof = prove(make_world(shipped.mission("inspection"), {}), Bounds(targets=1, restarts=False))
    assert proof.complete
    assert proof.broken == []
    assert {one.name for one in proof.properties if one.verdict is not ProofVerdict.HOLDS} == {"invariants"}


#: Mission -> its file, and the parameters that bound it.
MISSIONS: dict[str, tuple[Path, dict[str, Any]]] = {
    "exploration": (ROOT / "missions" / "exploration.yaml", {"monitoring_sweeps": 1}),
    **{
        name: (ROOT / "examples" / name / "missions" / f"{name}.yaml", {})
        for name in ("watering", "photo_round", "night_watch")
    },
}


def proven(name: str, situations: int) -> Proof:
    """Return what comes of a mission with one target and so many situations at most."""
    file, parameters = MISSIONS[name]
    chart = load_chart(lifecycle_of(file), [file], shipped.catalog())

    def far(progress: ExplorationProgress) -> str:
        return "far enough" if progress.situations > situations else ""

    return prove(make_world(chart, parameters), Bounds(targets=1, restarts=False), far)


@pytest.mark.parametrize("name", MISSIONS)
def test_nothing_is_broken_nearby(name: str) -> None:
    """The first situations of each of the others; all of them take a minute."""
    proof = proven(name, 5_000)
    assert proof.stopped == "far enough"
    assert proof.broken == []


@pytest.mark.proof
@pytest.mark.timeout(900)
@pytest.mark.parametrize("name", MISSIONS)
def test_it_is_proven(name: str) -> None:
    """All situations of a mission, or those that there is time for at each run."""
    proof = proven(name, 150_000)
    assert proof.broken == []
    assert proof.complete or name == "night_watch"
