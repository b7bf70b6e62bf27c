"""Adds the bindings of a missions' folder to the catalog of installed plugins.

All bindings of a folder count, used or not, like installed plugins. Files are read every time, and parsed
once (cached by content).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from lupin_engine.chart.findings import Findings
from lupin_engine.chart.source import parse_bytes, read_bytes
from lupin_engine.chart.validation import Way, follows, is_kind, validate, want_defaults
from lupin_engine.errors import Diagnostic, PluginError, Severity
from lupin_engine.plugin.registry import Catalog

if TYPE_CHECKING:
    from lupin_engine.bindings.data import Binding

#: The folder of the bindings, beside the missions.
BINDINGS = "bindings"
#: What says what they may reach: in the folder above that of the missions, else in it.
LUPIN_FILE = "lupin.yaml"

#: That a file declares record types.
_TYPES = re.compile(rb"^types:", re.MULTILINE)

MAX_FILES = 64
MAX_CATALOGS = 32


@dataclass(frozen=True, eq=False)
class BoundCatalog:
    """A catalog with bindings. The same files with the same catalog give the same object.

    `sources` are the bytes of each binding's file, as they were read.
    """

    catalog: Catalog
    bindings: Mapping[str, Binding]
    sources: Mapping[str, bytes]
    found: tuple[Diagnostic, ...] = ()


@dataclass(frozen=True, eq=False)
class _BindingFile:
    """The result for one file; without a binding where the file is not even of that form."""

    binding: Binding | None
    found: tuple[Diagnostic, ...]
    raw: bytes = b""


_UNREAD = _BindingFile(None, ())


class _Same:
    """A catalog as a cache key, compared by identity: comparing contents is as slow as loading."""

    def __init__(self, catalog: Catalog) -> None:
        self.catalog = catalog

    def __hash__(self) -> int:
        return id(self.catalog)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and self.catalog is other.catalog


def forget() -> None:
    """Clear the caches."""
    _file.cache_clear()
    _join.cache_clear()


def binding_files(folder: Path) -> list[Path]:
    """Return the bindings of a folder of missions, sorted by name."""
    return sorted((folder / BINDINGS).glob("*.yaml"))


def lupin_file(folder: Path) -> Path:
    """Return the `lupin.yaml` that applies to a folder of missions, or where it should be."""
    above = (folder.parent if folder.name not in ("", "..") else folder / "..") / LUPIN_FILE
    if above.is_symlink():  # of a bundle that was unpacked
        return above.readlink()
    inside = folder / LUPIN_FILE
    return inside if inside.is_file() and not above.is_file() else above


def bound_catalog(
    folders: Iterable[Path], catalog: Catalog, texts: Mapping[Path, bytes], findings: Findings
) -> BoundCatalog | None:
    """Return the catalog for missions of these folders; None when a binding cannot be used at all.

    `texts` replace the content of their files. Bindings in `catalog` itself, from an earlier load, are
    ignored.
    """
    key, found = _Same(catalog.installed), {}
    for path in _paths({folder.resolve(): folder for folder in folders}.values(), texts):
        found[path] = texts[path] if path in texts else read_bytes(path, findings)
    # Those with types come first: they are known to the others, as to the missions.
    first = [path for path, raw in found.items() if raw is not None and _TYPES.search(raw)]
    made = {path: _made(path, found[path], key) for path in first}
    shared = _Same(_join(tuple(file for file in made.values() if file.binding is not None), key).catalog)
    files = [made.get(path) or _made(path, raw, shared) for path, raw in found.items()]
    bound = _join(tuple(file for file in files if file.binding is not None), key)
    findings.extend(chain(*(file.found for file in files), bound.found))
    return bound if len(bound.bindings) == len(files) else None


def _paths(folders: Iterable[Path], texts: Iterable[Path]) -> Iterable[Path]:
    """Return the bindings of some folders, saved or not."""
    inside = list(folders)
    edited = (path for path in texts if path.parent in [folder / BINDINGS for folder in inside])
    return dict.fromkeys([*(path for folder in inside for path in binding_files(folder)), *sorted(edited)])


def _made(path: Path, raw: bytes | None, key: _Same) -> _BindingFile:
    return _UNREAD if raw is None else _file(str(path), path.stem, raw, key)


@lru_cache(maxsize=MAX_FILES)
def _file(name: str, stem: str, raw: bytes, key: _Same) -> _BindingFile:
    # Most folders have no bindings, and nearly all that a check takes are imports.
    from lupin_engine.bindings.file import KIND, BindingNode
    from lupin_engine.bindings.reader import read_binding

    findings, left_out = Findings(), list[Way]()
    parsed = parse_bytes(raw, name, findings)
    node = None
    if parsed is not None and is_kind(parsed, KIND, findings):
        want_defaults(parsed, findings)
        node = validate(parsed, BindingNode, findings, left_out)
    if node is None:
        return _BindingFile(None, findings.all)
    if node.binding != stem:
        problem = f"the binding calls itself {node.binding!r}, its file {stem!r}"
        findings.add(node.at("binding"), "bad-name", "binding", problem, f"write 'binding: {stem}'")
    earlier = findings.all
    binding = read_binding(node, key.catalog, findings)
    found = tuple(each for each in findings.all if each in earlier or not follows(each, left_out))
    return _BindingFile(binding, found, raw)


@lru_cache(maxsize=MAX_CATALOGS)
def _join(files: tuple[_BindingFile, ...], key: _Same) -> BoundCatalog:
    """Add bindings to the catalog; those that contradict it are reported and left out."""
    bindings: dict[str, Binding] = {}
    sources: dict[str, bytes] = {}
    catalog, found = key.catalog, list[Diagnostic]()
    for file in files:
        binding = file.binding
        assert binding is not None
        contradictions = list(_contradictions(binding, catalog))
        if contradictions:
            found += contradictions
            continue
        try:
            catalog = catalog.with_plugin(binding.plugin)
        except PluginError as problem:
            if any(each.severity is Severity.ERROR for each in file.found):
                continue  # what is wrong with it has been told
            reason = str(problem).partition(": ")[2]
            place = binding.node.at("binding")
            hint = "choose another name"
            found.append(Diagnostic(place, "conflicting-definition", "binding", reason, hint))
        else:
            bindings[binding.name], sources[binding.name] = binding, file.raw
    return BoundCatalog(catalog, bindings, sources, tuple(found))


def _contradictions(binding: Binding, catalog: Catalog) -> Iterator[Diagnostic]:
    """Yield codes that a plugin declares differently: there is one `last_error` for all."""
    codes = {code.name: code for operation in binding.plugin.operations.values() for code in operation.codes}
    others = {name for name, code in codes.items() if catalog.codes.get(name, code) != code}
    for name in sorted(others):
        known = catalog.codes[name]
        meant = f"{known.label!r}, severity {known.severity.name.lower()}"
        problem = f"the code {name!r} is declared differently by a plugin: {meant}"
        place = binding.node.key_at("codes", name)
        hint = "make both the same, or rename yours"
        yield Diagnostic(place, "conflicting-definition", f"codes.{name}", problem, hint)
