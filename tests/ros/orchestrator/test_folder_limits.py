"""How much a folder of missions may have: the node's thread understands it while nobody is told the state."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from lupin_engine.errors import LupinError
from lupin_engine.missions.folders import default_missions_folder
from lupin_engine.plugin.registry import load_catalog
from lupin_engine.ros.folder import MAX_BYTES, MAX_FILES, MissionsFolder


@pytest.fixture
def missions(tmp_path: Path) -> Path:
    """A folder with the shipped missions."""
    shutil.copytree(default_missions_folder(), tmp_path / "missions")
    return tmp_path / "missions"


def made(missions: Path) -> MissionsFolder:
    return MissionsFolder({"missions_path": str(missions)}, load_catalog())


def test_too_many_missions_are_refused_before_they_are_read(missions: Path) -> None:
    for number in range(MAX_FILES - 1):
        (missions / f"m{number}.yaml").write_text(f"mission: M{number}\n")
    with pytest.raises(LupinError) as caught:
        made(missions).load()
    assert str(caught.value) == (
        f"{MAX_FILES + 1} missions in {missions}; at most {MAX_FILES} are offered: "
        "name some with -p missions:=[NAME, ...], or move others elsewhere"
    )


def test_too_many_bytes_are_refused_and_a_running_node_goes_on(missions: Path) -> None:
    """Parts count, too; when the file is small again all is as it was."""
    found = made(missions)
    loaded = found.load()
    part = missions / "parts" / "visit_targets.yaml"
    text = part.read_text(encoding="utf-8")
    part.write_text(text + "#" * MAX_BYTES)
    sizes = [file.stat().st_size for file in (*missions.glob("[ei]*.yaml"), *missions.glob("parts/*.yaml"))]
    assert found.changed(loaded) is None
    assert found.problem == (
        f"the missions and parts in {missions} have {sum(sizes)} bytes; at most {MAX_BYTES} are "
        f"read; the largest is visit_targets.yaml with {part.stat().st_size}"
    )
    part.write_text(text)
    assert found.changed(loaded) is None
    assert found.problem == ""
