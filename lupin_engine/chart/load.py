"""Loading: from file names to one checked chart, or to everything that is wrong with it.

`lifecycle.yaml` stands beside the missions, the parts they use in `parts/` beside them. `check_chart` tells
errors and warnings, `load_chart` is for those who want to run: the chart, or `ChartError` with all errors.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TypeVar

import lupin_engine
from lupin_engine.chart.checks import check_composed
from lupin_engine.chart.compose import compose
from lupin_engine.chart.documents import (
    FileNode,
    LifecycleNode,
    MissionNode,
    PartNode,
    StateNode,
    read_document,
)
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.model import Chart
from lupin_engine.chart.source import head, read
from lupin_engine.errors import ChartError, Diagnostic, Place, UsageError, nearest
from lupin_engine.plugin.registry import Catalog

#: What the file around the missions of a folder is called.
LIFECYCLE = "lifecycle.yaml"
#: The folder of the parts, beside the missions.
PARTS = "parts"

_D = TypeVar("_D", bound=FileNode)


def load_chart(lifecycle: Path, missions: Sequence[Path], catalog: Catalog) -> Chart:
    """Load a lifecycle with the missions in its slot.

    Raises:
        ChartError: carries every error of every file.
    """
    chart, found = check_chart(lifecycle, missions, catalog)
    if chart is None:
        raise ChartError(d for d in found if d.severity >= d.severity.ERROR)
    return chart


def check_chart(
    lifecycle: Path, missions: Sequence[Path], catalog: Catalog
) -> tuple[Chart | None, tuple[Diagnostic, ...]]:
    """Load a lifecycle with missions and tell everything about them; no chart when there are errors."""
    findings = Findings()
    root = _document(lifecycle, LifecycleNode, findings)
    read_missions = {path: _document(path, MissionNode, findings) for path in missions}
    parts = _read_parts([(lifecycle, root), *read_missions.items()], findings)
    whole = [node for node in read_missions.values() if node is not None]
    if root is None or len(whole) < len(read_missions) or findings.has("unknown-part", "no-file"):
        return None, findings.all
    if any(node is None for node in parts.values()):
        return None, findings.all
    composed = compose(root, whole, {name: part for name, part in parts.items() if part}, catalog, findings)
    check_composed(composed, findings)
    _warn_of_unused_parts(lifecycle, missions, parts, findings)
    return (None if findings.errors else composed.chart), findings.all


def mission_files(folder: Path) -> list[Path]:
    """Return the missions of a folder, sorted by name."""
    found = sorted(
        path for path in folder.glob("*.yaml") if path.name != LIFECYCLE and path.suffixes == [".yaml"]
    )
    return [path for path in found if (head(path) or ("mission", ""))[0] == "mission"]


def lifecycle_of(mission: Path) -> Path:
    """Return the lifecycle that a mission file belongs to."""
    return mission.parent / LIFECYCLE


def default_missions_folder() -> Path:
    """Return the folder of the shipped missions: in the checkout, or inside the installed package.

    Raises:
        UsageError: this installation has neither.
    """
    package = Path(lupin_engine.__file__).resolve().parent
    for folder in (package.parent / "missions", package / "missions"):
        if (folder / LIFECYCLE).is_file():
            return folder
    raise UsageError("this installation ships no missions; name a mission file")


def find_mission(name: str, folders: Iterable[Path]) -> Path:
    """Return the file of a mission, named by path, by file (`inspection`) or by itself (`InspectionMission`).

    Raises:
        UsageError: there is none; the text lists those that there are.
    """
    path = Path(name)
    if path.suffix in (".yaml", ".yml") or len(path.parts) > 1:
        if path.is_file():
            return path
        raise UsageError(f"no mission file {name!r}")
    searched = list(folders)
    known: dict[str, Path] = {}
    for folder in searched:
        for file in mission_files(folder):
            named = head(file)
            for title in (file.stem, named[1] if named else file.stem):
                known.setdefault(title, file)
    if name in known:
        return known[name]
    where = ", ".join(str(folder) for folder in searched) or "no folder"
    raise UsageError(f"no mission {name!r} in {where}; {nearest(name, known)}")


def _document(path: Path, model: type[_D], findings: Findings) -> _D | None:
    raw = read(path, findings)
    return None if raw is None else read_document(raw, model, findings)


def _read_parts(
    files: Iterable[tuple[Path, FileNode | None]], findings: Findings
) -> dict[str, PartNode | None]:
    """Read the parts that the files use, and those that these use; None for one that cannot be read."""
    found: dict[str, PartNode | None] = {}
    waiting = [(path.parent / PARTS, file) for path, file in files if file is not None]
    while waiting:
        folder, file = waiting.pop(0)
        for name, place, state in _uses(file.states, file, ""):
            if name in found:
                continue
            found[name] = part = _read_part(folder, name, place, state, findings)
            if part is not None:
                waiting.append((folder, part))
    return found


def _read_part(folder: Path, name: str, place: Place, state: str, findings: Findings) -> PartNode | None:
    path = folder / f"{name}.yaml"
    known = [file.stem for file in folder.glob("*.yaml")]
    if name not in known:
        findings.unknown(place, "unknown-part", state, "part", name, known)
        return None
    part = _document(path, PartNode, findings)
    if part is not None and part.part != name:
        problem = f"the part calls itself {part.part!r}, its file {name!r}"
        findings.add(part.at("part"), "bad-name", "part", problem, f"write 'part: {name}'")
        return None
    return part


def _uses(
    states: Mapping[str, StateNode | None], holder: FileNode | StateNode, path: str
) -> Iterator[tuple[str, Place, str]]:
    """Yield every use of a part among states: its name, where it is written, and the state."""
    for name, node in states.items():
        if node is None:
            continue
        full = f"{path}.{name}" if path else name
        if node.use is not None:
            yield node.use, node.at("use"), full
        yield from _uses(node.states, node, full)


def _warn_of_unused_parts(
    lifecycle: Path, missions: Sequence[Path], parts: Iterable[str], findings: Findings
) -> None:
    """Tell which parts nobody uses, when all the missions that could use them are loaded."""
    folder = lifecycle.parent
    loaded = {path.resolve() for path in missions}
    if not all(path.resolve() in loaded for path in mission_files(folder)):
        return
    used = set(parts)
    for path in sorted((folder / PARTS).glob("*.yaml")):
        if path.stem not in used:
            _document(path, PartNode, findings)
            hint = "use it, or remove the file"
            findings.warn(
                Place(str(path), 1, 1), "unused-part", "", f"no mission uses the part {path.stem!r}", hint
            )
