"""Missions as a command line names them: found, loaded and checked together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from lupin_engine.errors import Problems, UsageError
from lupin_engine.missions.folders import (
    BUNDLE,
    MISSIONS,
    check_sizes,
    default_missions_folder,
    find_mission,
    is_missions_folder,
    lifecycle_in,
    lifecycle_of,
    mission_files,
)
from lupin_engine.missions.load import LoadedMissions, load_files
from lupin_engine.plugin.registry import Catalog

#: Where missions are looked for before the shipped ones: this folder in the current one, or that one itself.
LOCAL = Path(MISSIONS)


def mission_folders() -> list[Path]:
    """Return the search path of missions, nearest first; UsageError where the shipped ones are missing."""
    found = [LOCAL] if is_missions_folder(LOCAL) else [Path()] if is_missions_folder(Path.cwd()) else []
    shipped = default_missions_folder()
    return found if found and found[0].resolve() == shipped.resolve() else [*found, shipped]


def load_missions(names: Sequence[str], catalog: Catalog, *, reaching: bool = False) -> LoadedMissions:
    """Find, load and check missions; without names all of the nearest folder. `reaching` as in `load_files`.

    Raises:
        UsageError: missions do not exist, or do not share a lifecycle.
        ChartError: with every error of every file.
        LupinError: they are too many, or too large (see `check_sizes`).
    """
    bundles = [name for name in names if Path(name).suffix == BUNDLE]
    if bundles and len(names) > 1:
        raise UsageError(f"{bundles[0]}: a bundle is used alone, without other missions")
    files = _files(names) if names else mission_files(mission_folders()[0])
    lifecycles = {(found := lifecycle_of(file)).resolve(): found for file in files}
    if len(lifecycles) > 1:
        raise UsageError(f"these missions have different lifecycles: {', '.join(map(str, lifecycles))}")
    lifecycle = next(iter(lifecycles.values()), lifecycle_in(mission_folders()[0]))
    if files:
        check_sizes(files[0].parent, files)
    loaded = load_files(lifecycle, files, catalog, reaching=reaching)
    return replace(loaded, bundle=Path(bundles[0])) if bundles else loaded


def _files(names: Sequence[str]) -> list[Path]:
    files: list[Path] = []
    problems = Problems(UsageError)
    for name in names:
        with problems.collecting():
            files.append(find_mission(name, mission_folders()))
    problems.raise_any()
    return files
