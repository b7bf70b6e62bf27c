"""Loading: from file names to one checked chart, or to everything that is wrong with it.

`lifecycle.yaml` stands beside the missions, else they are in the shipped one; the parts they use stand in
`parts/` beside them. `check_chart` tells errors and warnings, `load_chart` is for those who want to run: the
chart, or `ChartError` with all errors.

Files are looked at every time, but what they say is worked out once: a file that has not changed is not
parsed again, and a chart of which no file has changed is not composed again.
"""

from __future__ import annotations

import contextlib
import gc
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, Generic, TypeVar

import lupin_engine
from lupin_engine.chart import bound_catalog as bound_catalogs
from lupin_engine.chart.bound_catalog import BoundCatalog, bound_catalog
from lupin_engine.chart.compose.compose import Composed, compose
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
from lupin_engine.chart.rules.checks import check_composed
from lupin_engine.chart.source import head, parse_bytes, read_bytes
from lupin_engine.errors import ChartError, Diagnostic, Place, UsageError, meant, nearest
from lupin_engine.plugin.registry import Catalog

#: What the file around the missions of a folder is called.
LIFECYCLE = "lifecycle.yaml"
#: What a folder of missions is called; one with a lifecycle may be called otherwise.
MISSIONS = "missions"
#: The folder of the parts, beside the missions.
PARTS = "parts"

#: How much is remembered: every scenario of a folder, or the missions of a few, without reading them twice.
MAX_DOCUMENTS = 64
MAX_CHARTS = 32

#: After so many new objects, some ten charts of a thousand states, garbage is looked for among them.
MAX_UNSEEN = 1_000_000

#: After so many findings nobody reads on, and each costs time: names are compared with all that are allowed.
MAX_FINDINGS = 1000

_T = TypeVar("_T")
_D = TypeVar("_D", bound=FileNode)
_D_co = TypeVar("_D_co", bound=FileNode, covariant=True)


@dataclass(frozen=True, eq=False)
class _Document(Generic[_D_co]):
    """What one file says: its words, or None, what is wrong with it, and the parts that its states use.

    The uses are name, place and state. The same bytes under the same name are the same document.
    """

    node: _D_co | None
    found: tuple[Diagnostic, ...] = ()
    uses: tuple[tuple[str, Place, str], ...] = ()


@dataclass(frozen=True, eq=False)
class _Made:
    """What was made of documents and a catalog: a chart, and what is to be said of it."""

    composed: Composed | None
    found: tuple[Diagnostic, ...]


@dataclass(frozen=True, eq=False)
class Inspection:
    """All that reading a chart comes to, for those who look at mistaken ones too.

    `documents` are those files that could be read; nothing is composed when one of them could not. `bound` is
    what they can use: the installed plugins and the bindings beside the missions.
    """

    found: tuple[Diagnostic, ...]
    documents: Mapping[Path, FileNode]
    composed: Composed | None = None
    bound: BoundCatalog | None = None


#: Nothing that is being edited: every file is as it was saved.
SAVED: Mapping[Path, bytes] = MappingProxyType({})


class _TooMany(Exception):
    """There are more findings than anybody reads; the last of them says so."""


class _Findings(Findings):
    """Findings, until there are too many."""

    def add(self, place: Place, rule: str, path: str, problem: str, hint: str = "") -> None:
        """Report an error."""
        super().add(place, rule, path, problem, hint)
        if self.count > MAX_FINDINGS:
            problem = f"more than {MAX_FINDINGS} findings, the rest is not told"
            super().add(place, "too-large", "", problem, "mend these first")
            raise _TooMany

    def whole(self, work: Callable[[], _T]) -> _T | None:
        """Do what makes findings; None when there were too many."""
        try:
            return work()
        except _TooMany:
            return None


def forget() -> None:
    """Forget what was read before; for those who measure how long reading takes."""
    _document.cache_clear()
    _make.cache_clear()
    bound_catalogs.forget()


class _Collector:
    """Keeps Python from looking for garbage among what was just loaded: nearly all of it stays.

    For a thousand states its looks would take as long as a third of the loading, most of it soon afterwards.
    """

    def __init__(self) -> None:
        self._unseen = 0

    @contextlib.contextmanager
    def paused(self) -> Iterator[None]:
        """Look for no garbage meanwhile, nor afterwards at all that was made."""
        collects = gc.isenabled()
        gc.disable()
        try:
            yield
        finally:
            if collects:
                self._let_age()
                gc.enable()

    def _let_age(self) -> None:
        """Let everything count as old, which is rarely looked at.

        Python does not count what comes there this way, so now and then all is looked through.
        """
        if gc.get_freeze_count() > 0:
            return  # somebody keeps things frozen, and they would be thawed with ours
        self._unseen += gc.get_count()[0]
        if self._unseen > MAX_UNSEEN:
            self._unseen = 0
            gc.collect()
        else:
            gc.freeze()
            gc.unfreeze()


_collector = _Collector()


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
    inspection = inspect_chart(lifecycle, missions, catalog)
    wrong = any(d.severity >= d.severity.ERROR for d in inspection.found)
    return (None if wrong or inspection.composed is None else inspection.composed.chart), inspection.found


@_collector.paused()
def inspect_chart(
    lifecycle: Path, missions: Sequence[Path], catalog: Catalog, texts: Mapping[Path, bytes] = SAVED
) -> Inspection:
    """Read a lifecycle with missions, and return all that was found and made, however wrong it is.

    `texts` are read in place of what is saved in their files: somebody is editing them.
    """
    findings = Findings()
    holders = (lifecycle.parent, *(path.parent for path in missions))
    bound = bound_catalog(dict.fromkeys(holders), catalog, texts, findings)
    root = _read(lifecycle, LifecycleNode, findings, texts)
    read_missions = {path: _read(path, MissionNode, findings, texts) for path in missions}
    parts = _read_parts([(lifecycle, root), *read_missions.items()], findings, texts)
    read = (root, *read_missions.values(), *parts.values())
    documents = {Path(d.node.place.file): d.node for d in read if d.node is not None}
    unread = any(document.node is None for document in read)
    if bound is None or unread or findings.has("unknown-part", "no-file"):
        return Inspection(findings.all, documents, bound=bound)
    made = _make(root, tuple(read_missions.values()), tuple(parts.values()), bound)
    findings.extend(made.found)
    _warn_of_unused_parts(lifecycle, missions, parts, findings, texts)
    return Inspection(findings.all, documents, made.composed, bound)


@lru_cache(maxsize=MAX_CHARTS)
def _make(
    lifecycle: _Document[LifecycleNode],
    missions: tuple[_Document[MissionNode], ...],
    parts: tuple[_Document[PartNode], ...],
    bound: BoundCatalog,
) -> _Made:
    """Compose and check documents that all could be read."""
    root, findings = lifecycle.node, _Findings()
    assert root is not None
    for document in (lifecycle, *missions, *parts):
        findings.extend(document.found)
    whole = [document.node for document in missions if document.node is not None]
    named = {document.node.part: document.node for document in parts if document.node is not None}
    composed = findings.whole(lambda: compose(root, whole, named, bound, findings))
    if composed is not None:
        check_composed(composed, findings)
    return _Made(composed, findings.all)


def mission_files(folder: Path) -> list[Path]:
    """Return the missions of a folder, sorted by name."""
    found = sorted(
        path for path in folder.glob("*.yaml") if path.name != LIFECYCLE and path.suffixes == [".yaml"]
    )
    return [path for path in found if (head(path) or ("mission", ""))[0] == "mission"]


def is_missions_folder(folder: Path) -> bool:
    """Say whether missions are looked for in a folder: it has a lifecycle, or its name and files say so."""
    return (folder / LIFECYCLE).is_file() or (folder.name == MISSIONS and bool(mission_files(folder)))


def lifecycle_in(folder: Path) -> Path:
    """Return the lifecycle around the missions of a folder: the one that stands there, or the shipped one."""
    own = folder / LIFECYCLE
    return own if own.is_file() else default_missions_folder() / LIFECYCLE


def lifecycle_of(mission: Path) -> Path:
    """Return the lifecycle that a mission file belongs to."""
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


def find_mission(name: str, folders: Iterable[Path]) -> Path:
    """Return the file of a mission, named by path, by file (`inspection`) or by itself (`InspectionMission`).

    Raises:
        UsageError: there is none; the text lists those that there are.
    """
    path = Path(name)
    if path.suffix in (".yaml", ".yml") or len(path.parts) > 1:
        if path.is_file():
            return path
        raise UsageError(_no_file(path))
    searched = list(folders)
    known: dict[str, Path] = {}
    for folder in searched:
        for file in mission_files(folder):
            named = head(file)
            for title in (file.stem, named[1] if named else file.stem):
                known.setdefault(title, file)
    if name in known:
        return known[name]
    if path.is_dir():
        raise UsageError(_no_file(path))
    where = ", ".join(str(folder) for folder in searched) or "no folder"
    raise UsageError(f"no mission {name!r} in {where}; {nearest(name, known)}")


def _no_file(path: Path) -> str:
    """Say why a path is no mission, and which are beside it or in it."""
    if path.is_dir():
        files = [str(file) for file in mission_files(path)]
        return f"{str(path)!r} is a folder; " + (nearest("", files) if files else "it has no missions")
    guess = meant(str(path), map(str, mission_files(path.parent))) if path.parent.is_dir() else ""
    return f"no mission file {str(path)!r}" + (f"; {guess}" if guess else "")


def _read(path: Path, model: type[_D], findings: Findings, texts: Mapping[Path, bytes]) -> _Document[_D]:
    """Read a file as a document; what is wrong with it is told every time."""
    raw = texts[path] if path in texts else read_bytes(path, findings)
    if raw is None:
        return _Document(None)
    name = str(path)
    document: _Document[_D] = _document(name, model, raw)
    findings.extend(document.found)
    return document


@lru_cache(maxsize=MAX_DOCUMENTS)
def _document(name: str, model: type[FileNode], raw: bytes) -> _Document[Any]:
    """Read the bytes of a file as a document; nothing else matters to it, so it can be remembered by them."""
    findings = _Findings()
    parsed = findings.whole(lambda: parse_bytes(raw, name, findings))
    node = None if parsed is None else findings.whole(lambda: read_document(parsed, model, findings))
    uses = () if node is None else tuple(_uses(node.states, node, ""))
    return _Document(node, findings.all, uses)


def _read_parts(
    files: Iterable[tuple[Path, _Document[FileNode]]], findings: Findings, texts: Mapping[Path, bytes]
) -> dict[str, _Document[PartNode]]:
    """Read the parts that the files use, and those that these use."""
    found: dict[str, _Document[PartNode]] = {}
    waiting = [(path.parent / PARTS, document) for path, document in files]
    while waiting:
        folder, document = waiting.pop(0)
        for name, place, state in document.uses:
            if name not in found:
                found[name] = part = _read_part(folder, name, place, state, findings, texts)
                waiting.append((folder, part))
    return found


def _read_part(
    folder: Path, name: str, place: Place, state: str, findings: Findings, texts: Mapping[Path, bytes]
) -> _Document[PartNode]:
    path = folder / f"{name}.yaml"
    known = [file.stem for file in folder.glob("*.yaml")]
    if name not in known:
        findings.unknown(place, "unknown-part", state, "part", name, known)
        return _Document(None)
    part = _read(path, PartNode, findings, texts)
    if part.node is not None and part.node.part != name:
        problem = f"the part calls itself {part.node.part!r}, its file {name!r}"
        findings.add(part.node.at("part"), "bad-name", "part", problem, f"write 'part: {name}'")
        return _Document(None)
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
    lifecycle: Path,
    missions: Sequence[Path],
    parts: Iterable[str],
    findings: Findings,
    texts: Mapping[Path, bytes],
) -> None:
    """Tell which parts nobody uses, when all the missions that could use them are loaded."""
    folder = lifecycle.parent
    loaded = {path.resolve() for path in missions}
    if not all(path.resolve() in loaded for path in mission_files(folder)):
        return
    used = set(parts)
    for path in sorted((folder / PARTS).glob("*.yaml")):
        if path.stem not in used:
            _read(path, PartNode, findings, texts)
            hint = "use it, or remove the file"
            findings.warn(
                Place(str(path), 1, 1), "unused-part", "", f"no mission uses the part {path.stem!r}", hint
            )
