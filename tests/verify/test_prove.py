"""`lupin prove`: what it says of a mission that is well, and of wrong usage."""

from __future__ import annotations

import json
from typing import Any

import pytest

from lupin_engine.cli.main import main
from lupin_engine.runtime.setup import make_world
from lupin_engine.verify.proof import ProofVerdict, prove
from lupin_engine.verify.situations.explorer import Bounds
from lupin_engine.verify.situations.found import ExplorationProgress
from tests import shipped


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


def test_exploration_breaks_nothing_nearby() -> None:
    """The first 15,000 situations of the other one; all of them take a minute."""

    def far(progress: ExplorationProgress) -> str:
        return "far enough" if progress.situations > 15_000 else ""

    world = make_world(shipped.mission("exploration"), {"monitoring_sweeps": 1})
    proof = prove(world, Bounds(targets=1), far)
    assert proof.stopped == "far enough"
    assert proof.broken == []
