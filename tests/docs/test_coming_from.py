"""The page for those who know another system: its missions are right, and its scenarios hold."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from lupin_cli.main import main
from lupin_engine.missions.folders import LIFECYCLE, default_missions_folder

DOCS = Path(__file__).parents[2] / "docs"
MISSIONS = sorted(file.stem for file in (DOCS / "coming").glob("*.yaml") if file.suffixes == [".yaml"])
MISSIONS.remove("lupin")


@pytest.fixture
def reader(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder as the reader has it at the end of the page."""
    missions = tmp_path / "missions"
    shutil.copytree(DOCS / "coming" / "bindings", missions / "bindings")
    shutil.copytree(DOCS / "coming", tmp_path / "scenarios", ignore=lambda _, names: _others(names))
    for name in MISSIONS:
        shutil.copy(DOCS / "coming" / f"{name}.yaml", missions)
    shutil.copy(default_missions_folder() / LIFECYCLE, missions)
    shutil.copy(DOCS / "coming" / "lupin.yaml", tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def _others(names: list[str]) -> list[str]:
    return [name for name in names if not name.endswith(".scenario.yaml")]


def test_the_missions_are_right(reader: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Only that a type of others is not installed here is noted."""
    assert main(["check", "missions"]) == 0
    found = re.findall(r"\[([\w-]+)\]$", capsys.readouterr().out, re.MULTILINE)
    assert set(found) <= {"unknown-type"}


def test_each_has_a_scenario_that_holds(reader: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One for each of the systems on the page."""
    assert main(["test"]) == 0
    assert capsys.readouterr().out.endswith(f"{len(MISSIONS)} scenarios: all hold\n")
    assert len(MISSIONS) == 5
