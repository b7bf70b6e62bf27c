"""`lupin check`: what is wrong, where, and an exit code that scripts can rely on."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from lupin_cli.main import VERBS
from lupin_cli.verbs.check import check, check_paths
from lupin_engine.errors import UsageError
from lupin_engine.missions.folders import default_missions_folder

SHIPPED = default_missions_folder()
LIFECYCLE = """\
lifecycle: L
states:
  A:
    slot: mission
    on_done: A
"""
MISSION = """\
mission: M
states:
  WAITING:
    after: {1: done}
  done: {type: final}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a lifecycle and a mission with one mistake."""
    (tmp_path / "lifecycle.yaml").write_text(LIFECYCLE)
    (tmp_path / "m.yaml").write_text(MISSION)
    return tmp_path


@pytest.mark.parametrize("paths", [[], ["inspection"], [SHIPPED], [SHIPPED / "inspection.yaml", SHIPPED]])
def test_the_shipped_missions_are_right(paths: list[str | Path], capsys: pytest.CaptureFixture[str]) -> None:
    """By every way of naming them."""
    assert check_paths(paths) == 0
    assert capsys.readouterr().out.endswith("no errors, no warnings\n")


@pytest.mark.parametrize("name", ["", "m.yaml", "lifecycle.yaml"])
def test_a_mistake_is_told_whatever_is_named(
    name: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Folder, mission and lifecycle mean the same chart here."""
    assert check_paths([folder / name if name else folder]) == 1
    first, *_, last = capsys.readouterr().out.splitlines()
    problem = "A.M.WAITING.after.0: expected duration (s), got '1'; write '1 s' [no-unit]"
    assert first == f"{folder}/m.yaml:4:13: error: {problem}"
    assert last == "1 mission, 1 error, no warnings"


def test_findings_are_there_for_programs_too(folder: Path) -> None:
    """One object each."""
    result = CliRunner().invoke(check, ["--json", str(folder)], standalone_mode=False)
    (found,) = json.loads(result.output)
    assert result.return_value == 1
    assert (found["line"], found["column"], found["severity"], found["rule"]) == (4, 13, "error", "no-unit")


def test_what_does_not_exist_is_a_wrong_call(folder: Path) -> None:
    """Neither a finding nor a traceback."""
    with pytest.raises(UsageError, match="no mission file"):
        check_paths([folder / "none.yaml"])


def test_the_table_of_verbs_says_the_same() -> None:
    """The short help is written twice, so that `lupin --help` imports nothing."""
    assert check.get_short_help_str(100) == VERBS["check"]
