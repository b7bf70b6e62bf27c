"""Whatever is in the files, no question becomes a traceback."""

from __future__ import annotations

import contextlib
import random
from pathlib import Path

import pytest

from lupin_engine.plugin.registry import Catalog
from lupin_lsp.completion import complete
from lupin_lsp.folder import Folder
from lupin_lsp.hover import hover
from lupin_lsp.navigation import mention_under, outline, references
from lupin_lsp.places import definition
from lupin_lsp.problems import problem
from lupin_lsp.rename import Refused, rename
from tests.lupin_engine.missions.test_load import damaged

pytestmark = pytest.mark.slow

FILES = ("inspection.yaml", "lifecycle.yaml", "parts/visit_targets.yaml")


@pytest.mark.parametrize("seed", range(9))
def test_answers_in_damaged_files(seed: int, missions: Path, catalog: Catalog) -> None:
    """Every question, at places chosen by chance, with and without a model from before."""
    chance = random.Random(seed)
    folder = Folder(missions, catalog)
    if seed % 3:
        folder.survey()
    path = missions / chance.choice(FILES)
    folder.put(path, damaged(folder.text(path), chance))
    for finding in folder.check(path):
        problem(folder.scan(path), finding)
    folder.refresh()
    outline(folder, path)
    for _ in range(30):
        offset = chance.randrange(len(folder.text(path)) + 1)
        complete(folder, path, offset)
        hover(folder, path, offset)
        mention = mention_under(folder, path, offset)
        if mention is not None:
            definition(folder, path, mention)
            references(folder, path, mention)
    with contextlib.suppress(Refused):
        rename(folder, path, offset, "RENAMED")
