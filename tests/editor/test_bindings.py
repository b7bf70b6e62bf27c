"""Bindings in an editor: their findings, and what missions see of them while they are written."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from lupin_engine.chart.load import default_missions_folder
from lupin_engine.editor.completion import complete
from lupin_engine.editor.folder import Folder, folder_of
from lupin_engine.editor.hover import hover
from lupin_engine.editor.navigation import definition
from lupin_engine.plugin.registry import load_catalog

TUTORIAL = Path(__file__).parents[2] / "docs" / "tutorial"


@pytest.fixture
def folder(tmp_path: Path) -> Folder:
    """The tutorial's mission with its binding."""
    shutil.copytree(TUTORIAL / "bindings", tmp_path / "bindings")
    shutil.copy(TUTORIAL / "patrol.yaml", tmp_path)
    shutil.copy(default_missions_folder() / "lifecycle.yaml", tmp_path)
    return Folder(tmp_path, load_catalog())
