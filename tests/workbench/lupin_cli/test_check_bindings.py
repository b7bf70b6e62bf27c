"""`lupin check` and bindings: a file by itself, with its missions, and held against what is installed."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from lupin_cli.verbs.check import check_paths
from lupin_engine.errors import UsageError
from lupin_ros.interfaces.definitions import knows_interfaces

TUTORIAL = Path(__file__).parents[3] / "docs" / "tutorial"


@pytest.fixture
def binding(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The tutorial's binding in a folder of missions that has none yet."""
    shutil.copytree(TUTORIAL / "bindings", tmp_path / "missions" / "bindings")
    monkeypatch.chdir(tmp_path)
    return Path("missions") / "bindings" / "photo_arm.yaml"


def said(path: Path, capsys: pytest.CaptureFixture[str]) -> list[str]:
    """Check a path; return the lines that are told."""
    check_paths([path])
    return [line for line in capsys.readouterr().out.splitlines() if not line.startswith("   ")]


def test_a_binding_by_itself(binding: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Before there is any mission."""
    assert said(binding, capsys) == ["no missions, no errors, no warnings"]
    binding.write_text(binding.read_text().replace("uses: arm ", "use: arm  "))
    assert said(binding, capsys) == [
        "missions/bindings/photo_arm.yaml:17:5: error: operations.move: unknown key 'use'; "
        "did you mean 'uses'? [unknown-key]",
        "no missions, 1 error, no warnings",
    ]


def test_a_binding_with_its_missions(binding: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The missions of its folder are checked as well; what changes in it may break them."""
    shutil.copy(TUTORIAL / "patrol.yaml", "missions")
    assert said(binding, capsys) == ["1 mission, no errors, no warnings"]
    binding.write_text(binding.read_text().replace("      pose: {type", "      place: {type"))
    told = said(binding, capsys)
    assert told[0].startswith("missions/bindings/photo_arm.yaml:13:22: error: ")
    needs = [line for line in told if "photo_arm.move needs the argument 'place': name of the pose" in line]
    assert [line.partition(":")[0] for line in needs] == ["missions/patrol.yaml"] * 2


def test_a_binding_in_the_wrong_place(binding: Path) -> None:
    """It would belong to no missions."""
    astray = Path(shutil.copy(binding, "."))
    with pytest.raises(UsageError, match="does not stand in a folder 'bindings'"):
        check_paths([astray])


@pytest.mark.skipif(not knows_interfaces(), reason="no interface packages are installed here")
def test_the_service_is_looked_up(binding: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Without importing ROS: what its package installed says what it takes."""
    binding.write_text(binding.read_text().replace("response.message", "response.messages"))
    assert said(binding, capsys) == [
        "missions/bindings/photo_arm.yaml:15:25: error: operations.move.detail: 'response' has no 'messages'"
        "; did you mean 'message'? [unknown-name]",
        "no missions, 1 error, no warnings",
    ]
    binding.write_text(binding.read_text().replace("lupin_msgs/srv", "qwxz_msgs/srv"))
    assert said(binding, capsys) == [
        "missions/bindings/photo_arm.yaml:12:46: warning: operations.move.service: nobody has looked whether "
        "this fits qwxz_msgs/srv/SetArmPreset, which is not installed here; check it where it is "
        "[unknown-type]",
        "no missions, no errors, 1 warning",
    ]
