"""Watches the folder of the missions that the node offers, and reloads it after changes.

Each look compares change times and sizes, which takes a fraction of a millisecond; changed files are loaded
on another thread, which may take seconds. A change with errors is reported once, and the loaded missions
stay.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from lupin_engine.bindings import BINDINGS, check_definition, lupin_file
from lupin_engine.chart import Findings
from lupin_engine.errors import ChartError, LupinError
from lupin_engine.machine import dispatch_table
from lupin_engine.missions import (
    BUNDLE,
    EXTENDED,
    PARTS,
    Bundle,
    LoadedMissions,
    SeenBundles,
    check_signed,
    check_sizes,
    default_missions_folder,
    find_mission,
    lifecycle_in,
    load_files,
    mission_files,
    read_bundle,
    seen_file,
    unpack,
)
from lupin_engine.plugin import Catalog
from lupin_ros.interfaces.definitions import interface_types

#: How often the folder is looked at while no mission runs, in seconds.
LOOK_PERIOD_S = 1.0
#: A file that was changed so lately, in seconds, is read: it may have been changed again within one tick of
#: its file system's clock.
SETTLED_S = 2.0

#: To notice changes: each file's change time in nanoseconds, and its size.
_Marks = Mapping[Path, tuple[int, int]]


class MissionsFolder:
    """The missions of the parameters: some or all of a folder, with those added later; or a bundle."""

    def __init__(self, given: Mapping[str, Any], catalog: Catalog) -> None:
        """`given` are the node's parameters about missions: which, from where, and signed by whom."""
        self._path = Path(given.get("missions_path") or default_missions_folder())
        self._keys = str(given.get("require_signed") or "")
        self._seen = SeenBundles(seen_file(), [str(name) for name in given.get("allow_bundles") or []])
        self._names = list(given.get("missions") or [])
        self._catalog = catalog
        #: What stood beside the named missions from the beginning; None before that was looked at.
        self._others: set[Path] | None = None
        self._refused: LoadedMissions | None = None
        #: What came of the files when they were read last, and by what it is seen that they are the same.
        self._read: LoadedMissions | LupinError | None = None
        self._marks: _Marks = {}
        #: What is wrong with the files as they are now; empty when they can be used.
        self.problem = ""
        #: What there is to say of a bundle that is used.
        self.warning = ""

    def load(self) -> LoadedMissions:
        """Return the present missions; unchanged files give the same object.

        Raises:
            LupinError: there is no mission, one has errors, a binding does not fit an interface, or a bundle
                cannot be used.
        """
        self._marks = self._look_marks()
        try:
            self._read = self._load()
        except LupinError as problem:
            self._read = problem
            raise
        return self._read

    def _load(self) -> LoadedMissions:
        bundle = self._bundle()
        if bundle is not None:
            file = unpack(bundle)
            loaded = self._understood(file.parent, [file])
            if loaded.hash != bundle.hash:
                raise LupinError(f"{bundle.path}: its files are not what it was made of; make it anew")
            if self._keys:
                self._seen.remember(bundle)
            return loaded
        files = self._files()
        if not files:
            where = "say where they are with -p missions_path:=FOLDER"
            raise LupinError(f"no missions in {self._path}; {where}")
        return self._understood(self._path, files)

    def _look_marks(self) -> _Marks:
        """Return change times and sizes of the files; empty for a bundle, which is read every time."""
        if self._keys or self._path.suffix == BUNDLE:
            return {}
        return _marks({self._path, *(Path(name).parent for name in self._names)})

    def _bundle(self) -> Bundle | None:
        """Return the bundle that `missions_path` names, with a valid signature where one is required.

        None where it names no bundle, or missions are named as well.

        Raises:
            LupinError: it cannot be used, or no bundle is named where one is required.
        """
        if self._path.suffix != BUNDLE or self._names:
            if self._keys:
                how = "make one with 'lupin bundle MISSION --sign KEY', and name it as missions_path alone"
                raise LupinError(
                    f"{self._path}: not signed, but require_signed asks for a signed bundle; {how}"
                )
            return None
        bundle = read_bundle(self._path)
        if self._keys:
            check_signed(bundle, Path(self._keys))
            self.warning = self._seen.check(bundle)
        return bundle

    def _understood(self, folder: Path, files: Sequence[Path]) -> LoadedMissions:
        check_sizes(folder, files)
        loaded = load_files(lifecycle_in(folder), files, self._catalog, reaching=True)
        findings = Findings()
        for binding in loaded.bindings.values():
            check_definition(binding, interface_types, findings)
        if findings.errors:
            raise ChartError(findings.errors)
        return loaded

    def _files(self) -> list[Path]:
        """Return the named missions and those that were added since; without names, all."""
        named = [find_mission(name, [self._path]) for name in self._names]
        if not named:
            return mission_files(self._path)
        folders = dict.fromkeys(file.parent for file in named)
        beside = [file for folder in folders for file in mission_files(folder) if file not in named]
        self._others = set(beside) if self._others is None else self._others & set(beside)
        return [*named, *(file for file in beside if file not in self._others)]

    def changed(self, current: LoadedMissions) -> LoadedMissions | None:
        """Return the new missions after a change; None without one, or where they have errors or are refused.

        Errors are in `problem`.
        """
        try:
            loaded = self._load_changed()
        except LupinError as problem:
            self.problem = str(problem)
            return None
        if self._refused is not None and loaded.chart is self._refused.chart:
            return None
        self.problem, self._refused = "", None
        return None if loaded.chart is current.chart else loaded

    def _load_changed(self) -> LoadedMissions:
        """Return or raise the result of `load`, without reading unchanged files."""
        marks = self._look_marks()
        newest = max((changed for changed, _ in marks.values()), default=0)
        is_settled = bool(marks) and abs(time.time_ns() - newest) >= SETTLED_S * 1e9
        if self._read is None or marks != self._marks or not is_settled:
            return self.load()
        if isinstance(self._read, LupinError):
            raise self._read
        return self._read

    def refuse(self, loaded: LoadedMissions, reason: str) -> None:
        """Record that these missions cannot be used here, so that they are not tried again."""
        self._refused, self.problem = loaded, reason


class FolderHost(Protocol):
    """The node that uses the missions."""

    log: Any

    def post(self, callback: Callable[[], object]) -> None:
        """Run `callback` on the node's thread, in order."""


class FolderWatch:
    """Looks at a folder on a thread of its own, one look at a time; the results come on the node's thread."""

    def __init__(self, folder: MissionsFolder, ros: FolderHost) -> None:
        self._folder = folder
        self._ros = ros
        self._pool = ThreadPoolExecutor(1, "missions")

    def look(self, current: LoadedMissions, then: Callable[[LoadedMissions | None], None]) -> None:
        """Look at the files as they are now; `then` gets the result of `MissionsFolder.changed`."""
        self._pool.submit(self._look, current, then)

    def _look(self, current: LoadedMissions, then: Callable[[LoadedMissions | None], None]) -> None:
        loaded: LoadedMissions | None = None
        try:
            loaded = self._folder.changed(current)
            if loaded is not None:
                dispatch_table(loaded.chart)  # kept for its machine: no step may take as long
        except Exception as problem:  # whoever waits must go on
            self._ros.post(partial(self._ros.log.error, "missions", problem=repr(problem)))
        self._ros.post(partial(then, loaded))

    def close(self) -> None:
        """Stop looking."""
        self._pool.shutdown(wait=False, cancel_futures=True)


def _marks(folders: Iterable[Path]) -> _Marks:
    """Return change time and size of every file in folders of missions."""
    found: dict[Path, tuple[int, int]] = {}
    for folder in folders:
        inside = (folder.glob(f"{name}*.yaml") for name in ("", f"{PARTS}/", f"{BINDINGS}/", f"{EXTENDED}/"))
        for file in (*itertools.chain(*inside), lupin_file(folder)):
            try:
                about = file.stat()
            except OSError:
                continue  # it is not there, or was just removed
            found[file] = about.st_ctime_ns, about.st_size
    return found
