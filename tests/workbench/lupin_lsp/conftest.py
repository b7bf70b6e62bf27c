"""Missions that are edited here only, copied where tests may change them: places depend on them."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from lupin_engine.plugin.registry import Catalog, load_catalog
from lupin_lsp.folder import Folder


@pytest.fixture(scope="session")
def catalog() -> Catalog:
    """What the installed plugins offer."""
    return load_catalog()


@pytest.fixture
def missions(tmp_path: Path) -> Path:
    """A folder with the lifecycle, the inspection and its part."""
    return shutil.copytree(Path(__file__).with_name("missions"), tmp_path / "missions")


def surveyed(missions: Path, catalog: Catalog) -> Folder:
    """Return a folder without problems, looked at once."""
    found = Folder(missions, catalog)
    assert found.survey() == {}
    return found


@pytest.fixture
def own_folder(missions: Path, catalog: Catalog) -> Folder:
    """That folder, for a test that changes files on the disk."""
    return surveyed(missions, catalog)


@pytest.fixture(scope="session")
def shared_folder(tmp_path_factory: pytest.TempPathFactory, catalog: Catalog) -> Folder:
    """A copy for all tests that change texts in the editor only; nobody types into it."""
    missions = tmp_path_factory.mktemp("editor") / "missions"
    return surveyed(shutil.copytree(Path(__file__).with_name("missions"), missions), catalog)


@pytest.fixture
def folder(shared_folder: Folder) -> Folder:
    """The shared copy, looked at already; nothing is open in it yet."""
    found = Folder(shared_folder.path, shared_folder.catalog)
    found.model, found._changed = shared_folder.model, False
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
