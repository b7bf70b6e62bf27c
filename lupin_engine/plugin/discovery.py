"""Finding installed plugins: the entry points of one group, read from what the installers left on the path.

`importlib.metadata` would read and parse the entry points of every installed package, at every start
(docs/performance.md). Here a file is parsed only when it names the group. The rules are the same: folders are
looked at in the order of `sys.path`, and of packages with one name the first counts.
"""

from __future__ import annotations

import importlib
import os
import re
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

#: Entry points of this group name a `Plugin`.
GROUP = "lupin.plugins"

#: What installers name the folders in which they describe a package: by wheels, and by what came before them.
_DESCRIPTIONS = (".dist-info", ".egg-info")
_SEPARATORS = re.compile(r"[-_.]+")


@dataclass(frozen=True, order=True)
class EntryPoint:
    """An entry point: its name, and what it names as `module:attribute`."""

    name: str
    value: str

    @property
    def module(self) -> str:
        """The module that it names."""
        return self.value.partition(":")[0].strip()

    def load(self) -> Any:
        """Import the module and return what is named in it."""
        found: Any = importlib.import_module(self.module)
        attributes = self.value.partition(":")[2].partition("[")[0].strip()
        for name in filter(None, attributes.split(".")):
            found = getattr(found, name)
        return found


def entry_points(path: Iterable[str] | None = None) -> list[EntryPoint]:
    """Return the entry points of plugins by name; `path` is where to look, by default `sys.path`."""
    seen: set[str] = set()
    found: set[EntryPoint] = set()
    for folder in sys.path if path is None else path:
        for description in _descriptions(folder):
            # The name of a package has no hyphen there; its version follows one.
            package = _SEPARATORS.sub("-", description.name.rpartition(".")[0].partition("-")[0]).lower()
            if package not in seen:
                seen.add(package)
                found.update(_of_group(description / "entry_points.txt"))
    return sorted(found)


def _descriptions(folder: str) -> Iterator[Path]:
    try:
        names = sorted(os.listdir(folder or "."))
    except OSError:
        return  # a zip file, or what is not there
    yield from (Path(folder, name) for name in names if name.endswith(_DESCRIPTIONS))


def _of_group(file: Path) -> Iterator[EntryPoint]:
    """Yield the entry points of the group in a file; most packages have none, many have no file."""
    try:
        text = file.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return
    inside = False
    for line in text.splitlines() if GROUP in text else ():
        line = line.strip()
        if line.startswith("["):
            inside = line == f"[{GROUP}]"
        elif inside and line and not line.startswith(("#", ";")):
            name, _, value = line.partition("=")
            yield EntryPoint(name.strip(), value.strip())
