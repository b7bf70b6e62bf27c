"""Missions of every kind, each in a folder of its own, for verbs to be tried on."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from tests.workbench.lupin_cli.verbs.table import FOLDER, MISSION, OWN_PROFILE, RUN

ROOT = Path(__file__).parents[4]
SHIPPED = ROOT / "missions"
COOKBOOK = ROOT / "docs" / "cookbook"

#: Two regions, of which one drives; what people read is in scripts of their own.
PARALLEL = """\
mission: Both
summary: Fahre, und sieh dabei nach dem Akku. 植物を見る
initial: WORKING
states:
  WORKING:
    type: parallel
    on_done: done
    states:
      DRIVING:
        states:
          GOING:
            invoke:
              do: nav.go_to
              with: {pose: {x: 1 m, y: 1 m, yaw: 0 deg}}
              timeout: {after: 60 s, code: nav_timeout}
            on_done: THERE
            on_error: THERE
          THERE: {type: final}
      WATCHING:
        initial: LOOKING
        states:
          LOOKING: {after: {3 s: SEEN}}
          SEEN: {type: final}
  done: {type: final}
"""
BROKEN = "mission: Broken\nstates:\n  A: {after: {1 s: B}}\n  - no mapping\n"


@dataclass(frozen=True)
class Case:
    """A folder and the mission in it, `wrong` where there is none to work with.

    `run` is what is simulated, where a mission alone is `refused` with that text. `server` is the program
    that serves its bindings.
    """

    folder: Path
    mission: str
    wrong: str = ""
    run: str = ""
    refused: str = ""
    server: Path | None = None

    def words(self, words: Iterable[str]) -> list[str]:
        """Return the words of a call with this mission in them."""
        is_shipped = (SHIPPED / f"{self.mission}.yaml").is_file()
        stands_for = {
            MISSION: self.mission,
            RUN: self.run or self.mission,
            FOLDER: str(SHIPPED if is_shipped else Path(self.mission).parent),
        }
        return [stands_for.get(word, word) for word in words]


def _copied(folder: Path, source: Path, *names: str) -> Path:
    """Copy files and folders beside each other."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        found = source / name
        (shutil.copytree if found.is_dir() else shutil.copy)(found, folder / name)
    return folder


def _shipped(name: str) -> Callable[[Path], Case]:
    return lambda folder: Case(folder, name)


def _example(name: str, server: str) -> Callable[[Path], Case]:
    def make(folder: Path) -> Case:
        _copied(folder, ROOT / "examples" / name, "missions", "lupin.yaml")
        return Case(folder, f"missions/{name}.yaml", server=ROOT / "examples" / name / server)

    return make


def _cookbook(*missions: str) -> Callable[[Path], Case]:
    def make(folder: Path) -> Case:
        files = [f"{name}.yaml" for name in missions]
        _copied(folder / "missions", COOKBOOK, *files, "parts")
        return Case(folder, f"missions/{files[0]}")

    return make


def _text(name: str, text: str, wrong: str = "") -> Callable[[Path], Case]:
    def make(folder: Path) -> Case:
        file = folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
        return Case(folder, name, wrong)

    return make


def _part(folder: Path) -> Case:
    _copied(folder / "missions", SHIPPED, "inspection.yaml", "parts")
    return Case(folder, "missions/inspection.yaml")


def _own_profile(folder: Path) -> Case:
    _copied(folder, ROOT / "tests" / "warehouse", "missions", "scenarios", "lupin.yaml")
    scenario = "scenarios/fetch.scenario.yaml"
    picker = ROOT / "tests" / "lupin_ros" / "system" / "warehouse" / "picker.py"
    refused = "the order names no shelf"
    return Case(folder, "missions/fetch.yaml", run=scenario, refused=refused, server=picker)


def _empty(folder: Path) -> Case:
    (folder / "missions").mkdir()
    return Case(folder, "missions", "empty")


#: By name, what makes a case in a folder.
CASES: dict[str, Callable[[Path], Case]] = {
    "inspection": _shipped("inspection"),
    "exploration": _shipped("exploration"),
    "binding": _example("watering", "valve.py"),
    "question": _example("photo_round", "camera.py"),
    "part": _part,
    "missions in missions": _cookbook("evening", "rows"),
    "parallel": _text("missions/both.yaml", PARALLEL),
    "non-ASCII": _text("Wände/größe é.yaml", PARALLEL),
    "blanks": _text("my missions/round trip.yaml", PARALLEL),
    OWN_PROFILE: _own_profile,
    "empty": _empty,
    "broken": _text("missions/broken.yaml", BROKEN, "broken"),
}
