"""The missions of one folder while they are edited: unsaved texts, findings, and the last valid model.

`check` runs at each keystroke: the changed file, beside the last valid texts of the others. `survey` checks
the whole folder, and makes the model that completion, hover and the rest use; if a file has errors, without
it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from lupin_engine.bindings import BINDINGS, LUPIN_FILE, BindingNode, binding_files
from lupin_engine.chart import LifecycleNode, MissionNode, Node, PartNode
from lupin_engine.errors import Diagnostic
from lupin_engine.missions import (
    LIFECYCLE,
    PARTS,
    Inspection,
    inspect_chart,
    lifecycle_called,
    mission_files,
)
from lupin_engine.plugin import Catalog
from lupin_engine.sim import SUFFIX
from lupin_lsp.grammar import kind_of
from lupin_lsp.model import Model
from lupin_lsp.scan import Scan, scan

if TYPE_CHECKING:
    from lupin_verify import Counterexamples

Found = tuple[Diagnostic, ...]


class Folder:
    """A folder with a lifecycle, missions, parts in `parts/` and bindings in `bindings/`.

    `catalog` is for its missions, by the last valid bindings.
    """

    def __init__(self, path: Path, catalog: Catalog) -> None:
        self.path = path
        self.catalog = self._installed = catalog
        self.model: Model | None = None
        self._open: dict[Path, str] = {}
        self._readable: dict[Path, bytes] = {}
        self._changed = True
        self._counterexamples: Counterexamples | None = None

    @property
    def lifecycle(self) -> Path:
        """The file around the missions."""
        return self.path / LIFECYCLE

    @property
    def base(self) -> Path | None:
        """The lifecycle that the one around the missions extends; None where it extends none."""
        name = self.scan(self.lifecycle).value("extends")
        return lifecycle_called(name, self.path) if name else None

    # -- texts ---------------------------------------------------------------------------------------------

    def put(self, path: Path, text: str) -> None:
        """Set the text of a file in the editor."""
        self._open[path] = text
        self._changed = True

    def drop(self, path: Path) -> None:
        """Close a file: its saved text applies again."""
        self._open.pop(path, None)
        self._readable.pop(path, None)
        self._changed = True

    def touch(self) -> None:
        """Record that a file was changed outside of the editor."""
        self._changed = True

    def current(self) -> dict[Path, str]:
        """Return the present texts of the open files, valid or not."""
        return dict(self._open)

    @property
    def open(self) -> list[Path]:
        """The files that are open."""
        return list(self._open)

    def text(self, path: Path) -> str:
        """Return the text of a file, in the editor or saved; empty when there is none."""
        if path in self._open:
            return self._open[path]
        try:
            return path.read_text(encoding="utf-8-sig")
        except (OSError, UnicodeDecodeError):
            return ""

    def scan(self, path: Path) -> Scan:
        """Return the tokens of a file."""
        return scan(self.text(path))

    def kind(self, path: Path) -> type[Node] | None:
        """Return the kind of a file, by its content, else by its folder; None when it is none of ours."""
        if path.suffixes != [".yaml"] or path.name == LUPIN_FILE:
            return None
        if self.scan(path).key_token(("scenario",)) is not None:
            return None  # a scenario names its mission, too
        said = kind_of(self.scan(path))
        if said is not None:
            return said
        if path == self.lifecycle:
            return LifecycleNode
        if path.parent == self.path / BINDINGS:
            return BindingNode
        if not self.lifecycle.is_file():
            return None
        return PartNode if path.parent != self.path else MissionNode

    def missions(self) -> list[Path]:
        """Return the files of the missions, saved or not."""
        files = dict.fromkeys([*mission_files(self.path), *self._open])
        ours = (path for path in files if path.parent == self.path and path != self.lifecycle)
        return sorted(path for path in ours if path not in self._open or self.kind(path) is MissionNode)

    def used(self, name: str) -> Path:
        """Return the file of a part, or of a mission that is used as one."""
        part = self.path / PARTS / f"{name}.yaml"
        return part if part in self._open or part.is_file() else self.path / f"{name}.yaml"

    def files(self) -> list[Path]:
        """Return all files: lifecycle and what that extends, missions, parts, bindings."""
        parts = {*(self.path / PARTS).glob("*.yaml"), *(p for p in self._open if p.parent.name == PARTS)}
        bindings = {*binding_files(self.path), *(p for p in self._open if p.parent.name == BINDINGS)}
        base = [] if self.base is None else [self.base]
        return [self.lifecycle, *base, *self.missions(), *sorted(parts), *sorted(bindings)]

    # -- checking ------------------------------------------------------------------------------------------

    def check(self, path: Path) -> Found:
        """Return the findings of one file, and keep its text if it is valid."""
        kind = self.kind(path)
        if kind is None:
            return ()
        current = self.text(path).encode()
        missions = [path] if kind is MissionNode else self.missions()
        inspection = self._inspect(missions, {**self._texts(), path: current})
        if path in inspection.documents or (kind is BindingNode and inspection.bound is not None):
            self._readable[path] = current
        return tuple(d for d in inspection.found if d.place.file == str(path))

    def refresh(self) -> None:
        """Rebuild the model if a text has changed."""
        if self._changed:
            for path in self._open:
                if self._readable.get(path) != self._open[path].encode():
                    self.check(path)
            self.survey()

    def survey(self) -> dict[Path, Found]:
        """Return the findings of all files, and rebuild the model."""
        if not self.lifecycle.is_file() and not any(map(self.kind, self._open)):
            return {}
        missions, texts = self.missions(), self._texts()
        first = self._inspect(missions, texts)
        readable = [path for path in missions if path in first.documents]
        inspection = first if readable == missions else self._inspect(readable, texts)
        if inspection.bound is not None:
            self.catalog = inspection.bound.catalog
        if inspection.composed is not None:
            self.catalog = replace(self.catalog, profile=inspection.composed.chart.profile)
            self.model = Model(inspection, inspection.composed, self.catalog)
        self._changed = False
        found = _by_file([*inspection.found, *(d for d in first.found if d not in inspection.found)])
        for path in self._open:
            if self._readable.get(path) != self._open[path].encode():
                found[path] = self.check(path)
        return found

    def broken(self) -> dict[Path, Found]:
        """Return the breaches in scenarios that `lupin prove` has written, by the file at fault."""
        wanted = [mission for mission in self.missions() if any(self.path.glob(f"{mission.stem}.*{SUFFIX}"))]
        if not wanted:
            return {}
        if self._counterexamples is None:
            # It takes a simulation: who has none to look at should not wait until that is loaded.
            from lupin_verify import Counterexamples

            self._counterexamples = Counterexamples()
        known, texts = self._counterexamples, self._texts()
        return _by_file(
            found
            for mission in wanted
            for found in known.found(mission, lambda one: self._inspect([one], texts).chart, self.catalog)
        )

    def inspect_with(self, texts: Mapping[Path, str]) -> Inspection:
        """Return the inspection of the folder with other texts in some files."""
        return self._inspect(self.missions(), {**self._texts(), **{p: t.encode() for p, t in texts.items()}})

    def _texts(self) -> dict[Path, bytes]:
        """Return the last readable text of each open file."""
        return {path: self._readable.get(path, text.encode()) for path, text in self._open.items()}

    def _inspect(self, missions: Iterable[Path], texts: Mapping[Path, bytes]) -> Inspection:
        return inspect_chart(self.lifecycle, list(missions), self._installed, texts)


def _by_file(found: Iterable[Diagnostic]) -> dict[Path, Found]:
    files: dict[Path, list[Diagnostic]] = {}
    for diagnostic in found:
        files.setdefault(Path(diagnostic.place.file), []).append(diagnostic)
    return {path: tuple(diagnostics) for path, diagnostics in files.items()}


def folder_of(path: Path) -> Path:
    """Return the folder of the missions that a file belongs to."""
    return path.parent.parent if path.parent.name in (PARTS, BINDINGS) else path.parent
