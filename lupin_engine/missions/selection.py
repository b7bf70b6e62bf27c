"""Missions as a command line names them: found, loaded and checked together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lupin_engine.chart.model import Chart
from lupin_engine.errors import Problems, UsageError
from lupin_engine.missions.load import (
    MISSIONS,
    default_missions_folder,
    find_mission,
    is_missions_folder,
    lifecycle_in,
    lifecycle_of,
    load_chart,
    mission_files,
)
from lupin_engine.plugin.registry import Catalog

#: Where missions are looked for before the shipped ones: the folder `missions` of the current folder.
LOCAL = Path(MISSIONS)


@dataclass(frozen=True)
class Loaded:
    """Checked missions of one folder with their lifecycle; `names` are as requests call them."""

    chart: Chart
    files: tuple[Path, ...]
    lifecycle: Path

    @property
    def names(self) -> tuple[str, ...]:
        """The missions, as requests call them."""
        return tuple(self.chart.missions)

    @property
    def plugins(self) -> tuple[str, ...]:
        """The plugins that the missions use, and those whose nodes serve what their bindings call."""
        bound = [each for binding in self.chart.bindings.values() for each in binding.calls.values()]
        called = {call.endpoint.name.strip("/") for call in bound}
        serving = (
            name
            for name, plugin in self.chart.catalog.plugins.items()
            if any(served.strip("/") in called for served in plugin.serves)
        )
        return tuple(dict.fromkeys((*self.chart.plugins, *serving)))

    def parameters(self) -> dict[str, Any]:
        """Return what the orchestrator needs to load the same."""
        return {
            "missions": [str(file.resolve()) for file in self.files],
            "missions_path": str(self.lifecycle.resolve().parent),
        }


def folders() -> list[Path]:
    """Return where missions are looked for, nearest first."""
    found = [LOCAL] if is_missions_folder(LOCAL) else []
    shipped = default_missions_folder()
    return found if found and LOCAL.resolve() == shipped.resolve() else [*found, shipped]


def load_missions(names: Sequence[str], catalog: Catalog) -> Loaded:
    """Find, load and check missions; without names all of the nearest folder.

    Raises:
        UsageError: missions do not exist, or do not share a lifecycle.
        ChartError: with every error of every file.
    """
    files = _files(names) if names else mission_files(folders()[0])
    lifecycles = {lifecycle_of(file).resolve(): None for file in files}
    if len(lifecycles) > 1:
        raise UsageError(f"these missions have different lifecycles: {', '.join(map(str, lifecycles))}")
    lifecycle = next(iter(lifecycles), lifecycle_in(folders()[0]))
    return Loaded(load_chart(lifecycle, files, catalog), tuple(files), lifecycle)


def _files(names: Sequence[str]) -> list[Path]:
    files: list[Path] = []
    problems = Problems(UsageError)
    for name in names:
        with problems.collecting():
            files.append(find_mission(name, folders()))
    problems.tell()
    return files
