"""Loads files to one checked chart, or to all errors in them.

`check_chart` returns errors and warnings, `load_chart` the chart, or raises `ChartError` with all errors.
Files are read every time, but results are cached: an unchanged file is not parsed again, and a chart of
unchanged files is not composed again.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import chain
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from lupin_engine.bindings import catalog as bound_catalogs
from lupin_engine.bindings.catalog import BINDINGS, BoundCatalog, bound_catalog
from lupin_engine.chart.compose.compose import Composed, compose
from lupin_engine.chart.compose.tree import UsedNode
from lupin_engine.chart.documents import FileNode, LifecycleNode, MissionNode, PartNode, StateNode
from lupin_engine.chart.extended import BaseFile, extended, with_override
from lupin_engine.chart.findings import Findings, answered, collected, warning
from lupin_engine.chart.model import Chart
from lupin_engine.chart.rules.checks import check_composed
from lupin_engine.chart.sequences import write_out
from lupin_engine.chart.source import Text, head, parse_bytes, read_bytes
from lupin_engine.chart.strictness import stricter
from lupin_engine.chart.validation import Way, follows, is_kind, read_document
from lupin_engine.errors import MAX_LISTED, ChartError, Diagnostic, Place, Severity, meant
from lupin_engine.missions.folders import (
    EXTENDED,
    PARTS,
    is_mission,
    lifecycle_called,
    mission_files,
    shipped_lifecycles,
)
from lupin_engine.plugin.registry import Catalog

if TYPE_CHECKING:
    # Most missions have no bindings, and nearly all that a check takes are imports.
    from lupin_engine.bindings.data import Binding

#: How much is remembered: every scenario of a folder, or all the missions that a node offers, without reading
#: them twice.
MAX_DOCUMENTS = 512
MAX_CHARTS = 32

_D = TypeVar("_D", bound=FileNode)
_D_co = TypeVar("_D_co", bound=FileNode, covariant=True)


@dataclass(frozen=True, eq=False)
class _Document(Generic[_D_co]):
    """A parsed file: its document, or None, its findings, and the uses in its states.

    The uses are name, place and state; `left_out` are the parts with a wrong shape; `base` is the lifecycle
    that one extends. The same bytes under the same name are the same document.
    """

    node: _D_co | None
    found: tuple[Diagnostic, ...] = ()
    uses: tuple[tuple[str, Place, str], ...] = ()
    raw: bytes = b""
    left_out: tuple[Way, ...] = ()
    base: BaseFile | None = None


@dataclass(frozen=True, eq=False, repr=False)
class LoadedMissions:
    """Checked missions with their lifecycle, and those of their plugins that are made of a file.

    `sources` are the bytes that all of it was made of, by the names of the files as places have them.
    `bundle` is the one file that they came in.
    """

    chart: Chart
    bindings: Mapping[str, Binding]
    files: tuple[Path, ...]
    lifecycle: Path
    sources: Mapping[str, bytes] = field(repr=False)
    bundle: Path | None = None

    def __repr__(self) -> str:
        return f"<LoadedMissions {', '.join(self.names)}>"

    @property
    def names(self) -> tuple[str, ...]:
        """The missions, as requests call them."""
        return tuple(self.chart.missions)

    @property
    def plugins(self) -> tuple[str, ...]:
        """The plugins that the missions use, and those whose nodes serve their bindings."""
        bound = [each for binding in self.bindings.values() for each in binding.calls.values()]
        wanted = {name.strip("/") for name in (*(call.endpoint.name for call in bound), *self.heard)}
        serving = (
            name
            for name, plugin in self.chart.catalog.plugins.items()
            if any(served.strip("/") in wanted for served in plugin.offered)
        )
        return tuple(dict.fromkeys((*self.chart.plugins, *serving)))

    @property
    def heard(self) -> Mapping[str, str]:
        """The topics that bindings read, each with the values and events that come from it."""
        found: dict[str, list[str]] = {}
        for binding in self.bindings.values():
            events = {f"{binding.name}.{name}": event for name, event in binding.events.items()}
            for name, one in {**binding.values, **events}.items():
                found.setdefault(one.endpoint.name, []).append(name)
        return {topic: ", ".join(names) for topic, names in found.items()}

    @cached_property
    def short_names(self) -> Mapping[str, str]:
        """The name of each file in its folder of missions, wherever that is: `parts/visit.yaml`.

        Of two files with one name, from two folders, the second is `name.2.yaml`.
        """
        found: dict[str, str] = {}
        for name in self.sources:
            path = Path(name)
            inside = Path(path.parent.name) if path.parent.name in (PARTS, BINDINGS) else Path()
            short, number = inside / path.name, 2
            if name in self.chart.lifecycle_files[1:]:
                short = Path(EXTENDED, f"{self.chart.extends}.yaml")
            while short.as_posix() in found.values():
                short, number = inside / f"{path.stem}.{number}{path.suffix}", number + 1
            found[name] = short.as_posix()
        return found

    @cached_property
    def hash(self) -> str:
        """A digest of the files' names and bytes, as hex digits; folder and plugins make no difference."""
        files = [(short, self.sources[name].hex()) for name, short in self.short_names.items()]
        return hashlib.sha256(json.dumps(files).encode()).hexdigest()

    def parameters(self) -> dict[str, Any]:
        """Return the orchestrator's parameters to load the same."""
        if self.bundle is not None:
            return {"missions_path": str(self.bundle.resolve())}
        folder = self.lifecycle.resolve().parent
        files = [file.resolve() for file in self.files]
        named = {} if files == mission_files(folder) else {"missions": [str(file) for file in files]}
        return {**named, "missions_path": str(folder)}


@dataclass(frozen=True, eq=False)
class _Made:
    """The result of composing documents with a catalog: a chart, and its findings."""

    composed: Composed | None
    found: tuple[Diagnostic, ...]


@dataclass(frozen=True, eq=False)
class Inspection:
    """All results of reading a chart, also of one with mistakes.

    `documents` are the readable files, `sources` their bytes by name; nothing is composed when one is
    unreadable. `bound` is their catalog: the installed plugins and the bindings beside the missions.
    """

    found: tuple[Diagnostic, ...]
    documents: Mapping[Path, FileNode]
    sources: Mapping[str, bytes]
    composed: Composed | None = None
    bound: BoundCatalog | None = None

    @property
    def chart(self) -> Chart | None:
        """The chart; None when there are errors."""
        wrong = self.composed is None or any(d.severity is Severity.ERROR for d in self.found)
        return None if wrong or self.composed is None else self.composed.chart


#: Nothing that is being edited: every file is as it was saved.
SAVED: Mapping[Path, bytes] = MappingProxyType({})


def forget() -> None:
    """Clear the caches; for measurements."""
    _document.cache_clear()
    _make.cache_clear()
    bound_catalogs.forget()


def load_chart(lifecycle: Path, missions: Sequence[Path], catalog: Catalog) -> Chart:
    """Load a lifecycle with the missions in its slot.

    Raises:
        ChartError: carries every error of every file.
    """
    return load_files(lifecycle, missions, catalog).chart


def load_files(
    lifecycle: Path, missions: Sequence[Path], catalog: Catalog, *, reaching: bool = False
) -> LoadedMissions:
    """Load a lifecycle with missions, and the bindings that they use.

    With `reaching` the names that bindings talk to are checked, and those without permission refused.

    Raises:
        ChartError: carries every error of every file.
    """
    inspection = inspect_chart(lifecycle, missions, catalog, reaching=reaching)
    chart, bound = inspection.chart, inspection.bound
    if chart is None or bound is None:
        raise ChartError(d for d in inspection.found if d.severity is Severity.ERROR)
    bindings = {name: bound.bindings[name] for name in chart.plugins if name in bound.bindings}
    bound_sources = {binding.node.place.file: bound.sources[name] for name, binding in bindings.items()}
    sources = {**inspection.sources, **bound_sources}
    return LoadedMissions(chart, bindings, tuple(missions), lifecycle, sources)


def check_chart(
    lifecycle: Path, missions: Sequence[Path], catalog: Catalog
) -> tuple[Chart | None, tuple[Diagnostic, ...]]:
    """Load a lifecycle with missions; return the chart, None where there are errors, and all findings."""
    inspection = inspect_chart(lifecycle, missions, catalog)
    return inspection.chart, inspection.found


def inspect_chart(
    lifecycle: Path,
    missions: Sequence[Path],
    catalog: Catalog,
    texts: Mapping[Path, bytes] = SAVED,
    *,
    reaching: bool = True,
) -> Inspection:
    """Read a lifecycle with missions, and return all findings and results, also after errors.

    `texts` replace the saved content of their files, for an editor. Unless the missions are `reaching` for
    nothing, forbidden names in their bindings are findings.
    """
    findings = Findings()
    holders = (lifecycle.parent, *(path.parent for path in missions))
    bound = bound_catalog(dict.fromkeys(holders), catalog, texts, findings)
    if bound is not None and bound.bindings and reaching:
        from lupin_engine.bindings.allowed import check_allowed

        check_allowed(bound.bindings.values(), catalog, findings)
    root = _read_lifecycle(lifecycle, findings, texts)
    read_missions = {path: _read(path, MissionNode, findings, texts) for path in missions}
    parts = _read_used((lifecycle, root), read_missions, findings, texts)
    read = (root, *read_missions.values(), *parts.values())
    documents = {Path(d.node.place.file): d.node for d in read if d.node is not None}
    sources: dict[str, bytes] = {}
    for document in read:
        if document.node is not None:
            sources[document.node.place.file] = document.raw
        if document.base is not None:
            sources[document.base.file] = document.base.raw
    found = [*findings.all, *chain.from_iterable(document.found for document in read)]
    unread = any(document.node is None for document in read)
    if bound is None or unread or any(each.rule == "no-file" for each in found):
        return Inspection(answered(_with_overrides(found, root, lifecycle)), documents, sources, bound=bound)
    made = _make(root, tuple(read_missions.values()), tuple(parts.items()), bound)
    found += chain(made.found, _unused(lifecycle, read_missions, parts, texts))
    bound_texts = {binding.node.place.file: bound.sources[name] for name, binding in bound.bindings.items()}
    texts_of = {**sources, **bound_texts}
    lines = {file: raw.decode("utf-8-sig").splitlines() for file, raw in texts_of.items() if b"accept" in raw}
    shared = texts_of.keys() - {str(path) for path in missions}
    found = _with_overrides(found, root, lifecycle)
    return Inspection(answered(found, lines, shared), documents, sources, made.composed, bound)


def _with_overrides(
    found: list[Diagnostic], root: _Document[LifecycleNode], lifecycle: Path
) -> list[Diagnostic]:
    """Return findings, those in the extended lifecycle with the place of what overrides there."""
    base = root.base
    if base is None or all(one.place.file != base.file for one in found):
        return found
    own = parse_bytes(root.raw, str(lifecycle), Findings())
    return [one if own is None else with_override(one, own, base.file) for one in found]


@lru_cache(maxsize=MAX_CHARTS)
def _make(
    lifecycle: _Document[LifecycleNode],
    missions: tuple[_Document[MissionNode], ...],
    parts: tuple[tuple[str, _Document[UsedNode]], ...],
    bound: BoundCatalog,
) -> _Made:
    """Compose and check documents that all could be read."""
    root = lifecycle.node
    assert root is not None
    documents = (lifecycle, *missions, *(used for _, used in parts))
    known = [found for document in documents for found in document.found]
    left_out = [way for document in documents for way in document.left_out]
    whole = [document.node for document in missions if document.node is not None]
    named = {name: document.node for name, document in parts if document.node is not None}
    composed, found = collected(lambda findings: compose(root, whole, named, bound.catalog, findings), known)
    if composed is not None:
        found = (*found, *check_composed(composed, found, whole=not left_out))
    return _Made(composed, tuple(each for each in found if each in known or not follows(each, left_out)))


def _read(path: Path, model: type[_D], findings: Findings, texts: Mapping[Path, bytes]) -> _Document[_D]:
    """Parse a file, with its findings; `findings` get the reason if it cannot be read."""
    raw = texts[path] if path in texts else read_bytes(path, findings)
    return _Document(None) if raw is None else _document(str(path), model, raw)


def _read_lifecycle(path: Path, findings: Findings, texts: Mapping[Path, bytes]) -> _Document[LifecycleNode]:
    """Parse a lifecycle, and the one that it extends; `findings` as for `_read`."""
    raw = texts[path] if path in texts else read_bytes(path, findings)
    named = _extended_by(str(path), raw) if raw is not None else None
    if raw is None or named is None:
        return _Document(None) if raw is None else _document(str(path), LifecycleNode, raw)
    file = lifecycle_called(named, path.parent)
    if file is None:
        known = shipped_lifecycles()
        findings.unknown(named.place, "unknown-lifecycle", "extends", "shipped lifecycle", named, known)
        return _Document(None)
    base = texts[file] if file in texts else read_bytes(file, findings)
    if base is None:
        return _Document(None)
    return _document(str(path), LifecycleNode, raw, BaseFile(str(named), str(file), base))


def expanded(lifecycle: Path) -> dict[str, Any]:
    """Return the content of a lifecycle as one file, with that of the one that it extends.

    Raises:
        ChartError: it cannot be read, or an override is wrong.
    """
    findings = Findings()
    document = _read_lifecycle(lifecycle, findings, SAVED)
    errors = [one for one in (*findings.all, *document.found) if one.severity is Severity.ERROR]
    if document.node is None or errors:
        raise ChartError(errors)
    return {key: value for key, value in document.node.content.items() if key != "extends"}


@lru_cache(maxsize=MAX_CHARTS)
def _extended_by(name: str, raw: bytes) -> Text | None:
    """Return the name of the lifecycle that the bytes of one extend; None without a readable one."""
    parsed = parse_bytes(raw, name, Findings()) if b"extends" in raw else None
    named = parsed.get("extends") if parsed is not None else None
    return named if isinstance(named, Text) else None


@lru_cache(maxsize=MAX_DOCUMENTS)
def _document(name: str, model: type[FileNode], raw: bytes, base: BaseFile | None = None) -> _Document[Any]:
    """Read the bytes of a file as a document; nothing else matters to it, so it can be remembered by them."""
    left_out: list[Way] = []

    def read(findings: Findings) -> FileNode | None:
        parsed = parse_bytes(raw, name, findings)
        if parsed is not None and base is not None and is_kind(parsed, "lifecycle", findings):
            under = parse_bytes(base.raw, base.file, findings)
            for each in (parsed, under):
                if each is not None:
                    write_out(each, findings)
            parsed = None if under is None else extended(parsed, under, findings, left_out)
        return None if parsed is None else read_document(parsed, model, findings, left_out)

    node, found = collected(read)
    uses = () if node is None else tuple(_uses(node.states, node, ""))
    return _Document(node, found, uses, raw, tuple(left_out), base)


def _read_used(
    lifecycle: tuple[Path, _Document[LifecycleNode]],
    missions: Mapping[Path, _Document[MissionNode]],
    findings: Findings,
    texts: Mapping[Path, bytes],
) -> dict[str, _Document[UsedNode]]:
    """Read the parts and missions that the files use, and those that these use."""
    found: dict[str, _Document[UsedNode]] = {}
    offered = {path.resolve(): document for path, document in missions.items()}
    files: list[tuple[Path, _Document[FileNode]]] = [lifecycle, *missions.items()]
    waiting = [(path.parent, document) for path, document in files]
    while waiting:
        folder, document = waiting.pop(0)
        for name, place, state in document.uses:
            if name not in found:
                path = _find_used(folder, name, place, state, findings)
                if path is None:
                    found[name] = _Document(None)
                    continue
                known = offered.get(path.resolve())
                found[name] = used = known or _read_one(path, name, findings, texts)
                waiting.append((folder, used))
    return found


def _find_used(folder: Path, name: str, place: Place, state: str, findings: Findings) -> Path | None:
    """Return the file of a part, or of a mission that is used as one; None after a finding."""
    part, mission = folder / PARTS / f"{name}.yaml", folder / f"{name}.yaml"
    found = [*([part] if part.is_file() else []), *([mission] if is_mission(mission) else [])]
    if len(found) == 1:
        return found[0]
    if found:
        problem = f"{str(name)!r} is both a part and a mission: {part} and {mission}"
        both = stricter("part-and-mission", place, state, problem, "the part counts; rename one of the files")
        findings.extend([both])
        return part if both.severity is Severity.WARN else None
    problem = f"unknown part or mission {str(name)!r}"
    findings.add(place, "unknown-part", state, problem, _instead_of(name, folder))
    return None


def _instead_of(name: str, folder: Path) -> str:
    """Return what can be used in place of a missing name."""
    parts = sorted(file.stem for file in (folder / PARTS).glob("*.yaml"))
    missions = {file.stem: (head(file) or ("", ""))[1] for file in mission_files(folder)}
    stem = next((stem for stem, title in missions.items() if title == name), "")
    if stem:
        return f"a mission is used by the name of its file: write 'use: {stem}'"
    groups = [(what, some) for what, some in (("parts", parts), ("missions", list(missions))) if some]
    lists = [f"the {what} {', '.join(map(repr, some[:MAX_LISTED]))}" for what, some in groups]
    near = meant(name, [*parts, *missions])
    return near or (f"there are {' and '.join(lists)}" if lists else "there are none here")


def _read_one(path: Path, name: str, findings: Findings, texts: Mapping[Path, bytes]) -> _Document[UsedNode]:
    if path.parent.name != PARTS:
        return _read(path, MissionNode, findings, texts)
    part = _read(path, PartNode, findings, texts)
    if part.node is not None and part.node.part != name:
        problem = f"the part calls itself {part.node.part!r}, its file {name!r}"
        findings.add(part.node.at("part"), "bad-name", "part", problem, f"write 'part: {name}'")
        return _Document(None, part.found)
    return part


def _uses(
    states: Mapping[str, StateNode | None], holder: FileNode | StateNode, path: str
) -> Iterator[tuple[str, Place, str]]:
    """Yield every use of a part or mission among states: its name, where it is written, and the state."""
    for name, node in states.items():
        if node is None:
            continue
        full = f"{path}.{name}" if path else name
        if node.use is not None:
            yield node.use, node.at("use"), full
        yield from _uses(node.states, node, full)


def _unused(
    lifecycle: Path,
    missions: Mapping[Path, _Document[MissionNode]],
    used: Mapping[str, _Document[UsedNode]],
    texts: Mapping[Path, bytes],
) -> Iterator[Diagnostic]:
    """Yield unused parts and results, when all the missions that could use them are loaded."""
    folder = lifecycle.parent
    loaded = {path.resolve() for path in missions}
    if not all(path.resolve() in loaded for path in mission_files(folder)):
        return
    for mission in missions.values():
        if mission.node is not None and not any(each.node is mission.node for each in used.values()):
            yield from _unused_results(mission.node)
    for path in sorted((folder / PARTS).glob("*.yaml")):
        if path.stem not in used:
            findings = Findings()
            yield from (*_read(path, PartNode, findings, texts).found, *findings.all)
            problem, hint = f"no mission uses the part {path.stem!r}", "use it, or remove the file"
            yield warning(Place(str(path), 1, 1), "unused-part", "", problem, hint)


def _unused_results(mission: MissionNode) -> Iterator[Diagnostic]:
    """Yield the results of a mission's own end, which only a mission that embeds it could read."""
    for name, state in mission.states.items():
        if state is not None and state.result:
            path, hint = f"states.{name}.result", "remove it, or use the mission as a part"
            problem = "nothing reads this: the end of a mission that is started has no 'on_done'"
            yield warning(state.key_at("result"), "unused-result", path, problem, hint)
