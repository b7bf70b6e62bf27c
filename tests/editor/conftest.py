"""Missions that are edited here only, copied where tests may change them: places depend on them."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from lupin_engine.editor.folder import Folder
from lupin_engine.plugin.registry import Catalog, load_catalog


@pytest.fixture(scope="session")
def catalog() -> Catalog:
    """What the installed plugins offer."""
    return load_catalog()


@pytest.fixture
def missions(tmp_path: Path) -> Path:
    """A folder with the lifecycle, the inspection and its part."""
    return shutil.copytree(Path(__file__).with_name("missions"), tmp_path / "missions")


@pytest.fixture
def folder(missions: Path, catalog: Catalog) -> Folder:
    """That folder, looked at once."""
    found = Folder(missions, catalog)
    assert found.survey() == {}
    return found


@pytest.fixture
def typed(folder: Folder) -> Callable[[str, str, str], tuple[Path, int]]:
    """Replace a piece of a file in the editor by one with a `|`; return the file and where that was."""

    def type_into(name: str, old: str, new: str) -> tuple[Path, int]:
        path = folder.path / name
        text = folder.text(path)
        assert old in text
        folder.put(path, text.replace(old, new.replace("|", "", 1), 1))
        folder.check(path)
        return path, text.index(old) + new.index("|")

    return type_into
