"""Finds mission files: the missions of a folder, and the lifecycle that belongs to them.

`lifecycle.yaml` stands beside the missions, else the shipped one counts; their parts stand in `parts/` beside
them.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

import lupin_engine
from lupin_engine.bindings.catalog import LUPIN_FILE
from lupin_engine.chart.source import head
from lupin_engine.errors import LupinError, UsageError, meant, nearest

#: What the file around the missions of a folder is called.
LIFECYCLE = "lifecycle.yaml"
#: What a folder of missions is called; one with a lifecycle may be called otherwise.
MISSIONS = "missions"
#: The folder of the parts, beside the missions.
PARTS = "parts"
#: The folder of a lifecycle that is extended, beside the one that extends it. It counts before the shipped
#: one: a bundle, a journal and a task of a campaign carry theirs.
EXTENDED = "extends"
#: How the name of a bundle ends: a mission with all that it is made of, in one file.
BUNDLE = ".lupin"
#: How many missions a folder may have, and how many bytes they and their parts: to understand more takes
#: many seconds, in which no mission can be started.
MAX_FILES, MAX_BYTES = 200, 1_000_000
#: The line of a copy that says what it was made of.
_ORIGIN = re.compile(rb"^origin: .*\n", re.MULTILINE)
#: What a lifecycle is called that can stand in a folder.
_PLAIN = re.compile(r"\w[\w-]*")


def mission_files(folder: Path) -> list[Path]:
    """Return the missions of a folder, sorted by name."""
    return sorted(filter(is_mission, folder.glob("*.yaml")))


def check_sizes(folder: Path, files: Sequence[Path]) -> None:
    """Refuse missions of a folder that are too much to be read together, before they are.

    Raises:
        LupinError: there are too many missions, or too many bytes.
    """
    if len(files) > MAX_FILES:
        raise LupinError(
            f"{len(files)} missions in {folder}; at most {MAX_FILES} are offered: "
            "name some with -p missions:=[NAME, ...], or move others elsewhere"
        )
    sizes = {
        file: file.stat().st_size for file in (*files, *folder.glob(f"{PARTS}/*.yaml")) if file.is_file()
    }
    if sum(sizes.values()) > MAX_BYTES:
        largest = max(sizes, key=lambda file: sizes[file])
        raise LupinError(
            f"the missions and parts in {folder} have {sum(sizes.values())} bytes; at most {MAX_BYTES} are "
            f"read; the largest is {largest.name} with {sizes[largest]}"
        )


def is_mission(path: Path) -> bool:
    """Say whether a file is a mission, by its name and its beginning."""
    if path.name in (LIFECYCLE, LUPIN_FILE) or path.suffixes != [".yaml"] or not path.is_file():
        return False
    return (head(path) or ("mission", ""))[0] == "mission"


def is_missions_folder(folder: Path) -> bool:
    """Say whether a folder is one of missions: it has a lifecycle, or its name and files say so."""
    return (folder / LIFECYCLE).is_file() or (folder.name == MISSIONS and bool(mission_files(folder)))


def lifecycle_in(folder: Path) -> Path:
    """Return the lifecycle around the missions of a folder: the one that is there, else the shipped one.

    Raises:
        UsageError: neither is there.
    """
    own = folder / LIFECYCLE
    return own if own.is_file() else default_missions_folder() / LIFECYCLE


def lifecycle_of(mission: Path) -> Path:
    """Return the lifecycle that a mission file belongs to; errors as for `lifecycle_in`."""
    return lifecycle_in(mission.parent)


def default_missions_folder() -> Path:
    """Return the folder of the shipped missions: in the checkout, or inside the installed package.

    Raises:
        UsageError: this installation has neither.
    """
    package = Path(lupin_engine.__file__).resolve().parent
    for folder in (package.parent / MISSIONS, package / MISSIONS / "shipped"):
        if (folder / LIFECYCLE).is_file():
            return folder
    raise UsageError("this installation ships no missions; name a mission file")


def shipped_lifecycles() -> dict[str, Path]:
    """Return the lifecycles that this installation ships, by their names."""
    try:
        files = sorted(default_missions_folder().glob("*.yaml"))
    except UsageError:
        return {}
    found = ((head(file), file) for file in files)
    return {known[1]: file for known, file in found if known is not None and known[0] == "lifecycle"}


def lifecycle_called(name: str, folder: Path) -> Path | None:
    """Return the lifecycle that one in `folder` extends by its name: carried there, or shipped; else None."""
    carried = folder / EXTENDED / f"{name}.yaml"
    if _PLAIN.fullmatch(name) and carried.is_file():
        return carried
    return shipped_lifecycles().get(name)


def origin_of(lifecycle: Path) -> dict[str, str]:
    """Return what a copy of a shipped lifecycle says it was made of, as the key `origin` has it."""
    named, raw = head(lifecycle), lifecycle.read_bytes()
    digest = hashlib.sha256(raw).hexdigest()[:16]
    return {"lifecycle": named[1] if named else "", "version": lupin_engine.__version__, "sha256": digest}


def is_shipped(file: Path) -> bool:
    """Say whether a mission or lifecycle is a shipped one, or an unchanged copy of it."""
    try:
        shipped = (default_missions_folder() / file.name).read_bytes()
        return _ORIGIN.sub(b"", file.read_bytes(), count=1) == shipped
    except (OSError, UsageError):
        return False


def find_mission(name: str, folders: Iterable[Path]) -> Path:
    """Return the file of a mission, named by path, by file (`inspection`) or by itself (`InspectionMission`).

    One that is named by its bundle is unpacked.

    Raises:
        UsageError: there is none; the text lists those that there are.
    """
    path = Path(name)
    if path.suffix == BUNDLE and path.is_file():
        from lupin_engine.missions.bundle import read_bundle, unpack  # most runs need no archives

        return unpack(read_bundle(path))
    if path.suffix in (".yaml", ".yml", BUNDLE) or len(path.parts) > 1:
        if path.is_file():
            return path
        raise UsageError(_no_file(path))
    searched = list(folders)
    known = _known_in(searched)
    if name in known:
        return known[name]
    if path.is_dir():
        raise UsageError(_no_file(path))
    where = ", ".join(str(folder) for folder in searched) or "no folder"
    raise UsageError(f"no mission {name!r} in {where}; {nearest(name, known)}")


def _known_in(folders: Iterable[Path]) -> dict[str, Path]:
    """Return the missions of some folders by their possible names; the first of a name counts."""
    known: dict[str, Path] = {}
    for file in (each for folder in folders for each in mission_files(folder)):
        named = head(file)
        known.setdefault(file.stem, file)
        known.setdefault(named[1] if named else file.stem, file)
    return known


def _no_file(path: Path) -> str:
    """Say why a path is no mission, and which are beside it or in it."""
    if path.is_dir():
        files = [str(file) for file in mission_files(path)]
        return f"{str(path)!r} is a folder; " + (nearest("", files) if files else "it has no missions")
    guess = meant(str(path), map(str, mission_files(path.parent))) if path.parent.is_dir() else ""
    return f"no mission file {str(path)!r}" + (f"; {guess}" if guess else "")
