"""Discovers installed plugins and their verbs by entry point."""

from __future__ import annotations

import importlib
import os
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any, TypeVar

from lupin_engine.errors import PluginError, UsageError, nearest

_T = TypeVar("_T")

#: Entry points of this group name a `Plugin`.
GROUP = "lupin.plugins"
#: Entry points of this group name a `Profile`.
PROFILES = "lupin.profiles"
#: Entry points of this group name a click command, which becomes a verb of `lupin` by the entry point's name.
VERBS = "lupin.verbs"

#: What Python says of a name that a module does not have.
_NO_NAME = re.compile(r"cannot import name '(\w+)' from '([\w.]+)'")
#: A value in a pyproject.toml, in quotes of either kind; a remark may follow.
_QUOTED = re.compile(r"""(["'])(.*?)\1""")


@dataclass(frozen=True)
class Distribution:
    """An installed distribution."""

    name: str
    version: str

    def __str__(self) -> str:
        return f"{self.name} {self.version}".rstrip()


@dataclass(frozen=True, order=True)
class EntryPoint:
    """An entry point: its name, its `module:attribute`, and its distribution."""

    name: str
    value: str
    brought_by: metadata.Distribution | Distribution | None = field(default=None, compare=False, repr=False)

    def __str__(self) -> str:
        return f"{self.value} of {self.distribution}" if self.distribution else self.value

    @property
    def distribution(self) -> Distribution | None:
        """The package that brought it; None where it is unknown.

        Reading its name takes longer than finding all entry points.
        """
        found = self.brought_by  # of a class of their own, where `importlib_metadata` has been imported
        return None if found is None else Distribution(found.name, found.version)

    @property
    def module(self) -> str:
        """The module that it names."""
        return self.value.partition(":")[0].strip()

    @property
    def attribute(self) -> str:
        """The attribute in the module, with dots; '' for the module itself."""
        return self.value.partition(":")[2].partition("[")[0].strip()

    def load(self) -> Any:
        """Import the module and return the attribute."""
        found: Any = importlib.import_module(self.module)
        for name in filter(None, self.attribute.split(".")):
            found = getattr(found, name)
        return found

    def load_as(self, kind: type[_T], what: str, called: str) -> _T:
        """Load an object of one kind; `what` and `called` are the words for it and its kind in errors.

        Raises:
            PluginError: it cannot be imported, or is something else.
        """
        try:
            found = self.load()
        except (Exception, SystemExit) as error:  # foreign code: whatever its import does is told in one line
            reason = told(error, self.module)
            raise PluginError(f"{what} {self.name!r} ({self}) cannot be imported: {reason}") from error
        if not isinstance(found, kind):
            other = type(found).__name__
            raise PluginError(
                f"{what} {self.name!r} ({self}) names something of type {other}; it must name {called}"
            )
        return found


def entry_points(group: str = GROUP) -> list[EntryPoint]:
    """Return the entry points of a group by name."""
    return entry_points_by_group(group)[group]


def entry_points_by_group(*groups: str) -> dict[str, list[EntryPoint]]:
    """Return the entry points of each group by name; the installed packages are read once."""
    every = metadata.entry_points()
    found = {group: every.select(group=group) for group in groups}
    return {
        group: sorted({EntryPoint(point.name, point.value, point.dist) for point in points})
        for group, points in found.items()
    }


def find_entry_point(name: str) -> EntryPoint:
    """Return the entry point of a plugin that is installed.

    Raises:
        UsageError: there is none; the text has the nearest name.
    """
    points = entry_points()
    for point in points:
        if point.name == name:
            return point
    raise UsageError(f"no plugin is called {name!r}; {nearest(name, (point.name for point in points))}")


def told(error: BaseException, module: str) -> str:
    """Return an exception of foreign code in one line, with its place in the package of `module`."""
    place = _place_in(error, module)
    return _reason(error) + (f"; at {place}" if place else "")


def _reason(error: BaseException) -> str:
    """Return kind and text of an error; a name that a module does not have with the nearest that it has."""
    missing = _NO_NAME.match(str(error)) if isinstance(error, ImportError) else None
    if missing is None or missing[2] not in sys.modules:
        return f"{type(error).__name__}: {error}".rstrip(": ")
    offered = [name for name in dir(sys.modules[missing[2]]) if not name.startswith("_")]
    return f"there is no {missing[1]!r} in {missing[2]}; {nearest(missing[1], offered)}"


def _place_in(error: BaseException, module: str) -> str:
    """Return file and line of the innermost step within the package of `module`; '' where there is none."""
    top = sys.modules.get(module.partition(".")[0])
    file = getattr(top, "__file__", None) or source_file(module) or ""
    folder = os.path.dirname(file) if file.endswith("__init__.py") else file
    step, place = error.__traceback__, ""
    while step is not None and folder:
        passed = step.tb_frame.f_code.co_filename
        if passed == folder or passed.startswith(folder + os.sep):
            place = f"{passed.removeprefix(os.getcwd() + os.sep)}:{step.tb_lineno}"
        step = step.tb_next
    return place


def source_file(module: str) -> str | None:
    """Return the file of a module without importing the packages that it is in; None where there is none."""
    top, *below = module.split(".")
    spec = next(filter(None, (finder.find_spec(top, None) for finder in sys.meta_path)), None)
    if spec is None or not below:
        return spec.origin if spec is not None else None
    # Finders would want what is above to be imported, where a folder has no __init__.py.
    for folder in spec.submodule_search_locations or ():
        inside = Path(folder, *below)
        for file in (inside.with_name(f"{below[-1]}.py"), inside / "__init__.py"):
            if file.is_file():
                return str(file)
    return None


def declared_in(project: Path) -> list[tuple[str, str]]:
    """Return name and value of the plugins that a pyproject.toml declares, installed or not."""
    headers = [f"[project.entry-points.{quote}{GROUP}{quote}]" for quote in "\"'"]
    return [
        (name.strip("\"'"), quoted[2] if (quoted := _QUOTED.match(value)) else value)
        for header in headers
        for name, value in _in_section(project, header)
    ]


def _in_section(file: Path, header: str) -> Iterator[tuple[str, str]]:
    """Yield the names and values below a header of a pyproject.toml."""
    try:
        text = file.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return
    inside = False
    for line in text.splitlines() if header.strip("[]") in text else ():
        line = line.strip()
        if line.startswith("["):
            inside = line == header
        elif inside and line and not line.startswith(("#", ";")):
            name, _, value = line.partition("=")
            yield name.strip(), value.strip()
