"""Missions with one defect each, against which `lupin check` and `lupin prove` are measured.

for name, folder in plant("first", tmp_path): ...      # lupin prove FOLDER/*.yaml
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import yaml

from lupin_engine.bindings.catalog import LUPIN_FILE
from lupin_engine.missions.folders import MISSIONS, mission_files

HERE = Path(__file__).parent
ROOT = HERE.parents[3]
#: Which files the defects stand in, two halves of a hundred first. The properties were written for the first
#: one, then for the second one as well; the third one says how general they are. The fourth one has ways to
#: drive unlocalized that take more than one step.
SETS = ("first", "second", "third", "fourth")


@dataclass(frozen=True)
class Defect:
    """A defect: what is changed in a file, and what the robot does wrong then.

    `mission` is the one in which that shows, and `refused` says that `lupin check` has an error for it.
    """

    id: str
    file: Path
    mission: str
    kind: str
    wrong: str
    edits: tuple[tuple[str, str], ...]
    refused: bool = False

    def text(self) -> str:
        """Return the file with the defect.

        Raises:
            ValueError: what is to be replaced does not stand there exactly once.
        """
        text = (ROOT / self.file).read_text(encoding="utf-8")
        for old, new in self.edits:
            if text.count(old) != 1:
                raise ValueError(f"{self.id}: stands {text.count(old)} times in {self.file}: {old!r}")
            text = text.replace(old, new)
        return text


def defects(planted: str) -> list[Defect]:
    """Return the defects of one of the files."""
    written = yaml.safe_load((HERE / f"{planted}.yaml").read_text(encoding="utf-8"))
    return [
        Defect(
            **{**one, "file": Path(one["file"]), "edits": tuple((e["old"], e["new"]) for e in one["edits"])}
        )
        for one in written
    ]


def plant(planted: str, into: Path) -> Iterator[tuple[str, Path]]:
    """Yield each defect's id, and a folder with its mission and all that belongs to that."""
    for defect in defects(planted):
        of = next(folder for folder in defect.file.parents if folder.name == MISSIONS)
        folder = into / defect.id / MISSIONS
        shutil.copytree(ROOT / of, folder)
        if (ROOT / of.parent / LUPIN_FILE).is_file():
            shutil.copy(ROOT / of.parent / LUPIN_FILE, folder.parent)
        for file in mission_files(folder):
            if file.stem != defect.mission:
                file.unlink()
        (folder / defect.file.relative_to(of)).write_text(defect.text(), encoding="utf-8")
        yield defect.id, folder
