"""Finds the interfaces that a run uses, by their names in the sources of orchestrator, plugins and profiles.

Sources are parsed, not imported, so this needs no ROS: `from std_msgs.msg import String`, and texts such as
"lupin_engine_msgs/srv/Command".
"""

from __future__ import annotations

import ast
import importlib.util
import re
from collections.abc import Iterator
from pathlib import Path

from lupin_engine.plugin import GROUP, PROFILES, entry_points_by_group

_SHELF = Path(__file__).parents[1]
#: A module of interfaces.
_MODULE = re.compile(r"(\w+)\.(msg|srv|action)")
#: The full name of an interface.
NAME = re.compile(r"[a-z]\w*/(msg|srv|action)/[A-Z]\w*")


def used_interfaces() -> set[str]:
    """Return the names of the interfaces that the orchestrator and the installed plugins and profiles use."""
    rooms = (_SHELF / room for room in ("orchestrator", "service", "launch"))
    files = [*(file for room in rooms for file in room.glob("*.py")), *_sources_of_plugins()]
    return {name for file in files for name in _named(file)}


def _sources_of_plugins() -> Iterator[Path]:
    points = [point for group in entry_points_by_group(GROUP, PROFILES).values() for point in group]
    for package in sorted({point.module.partition(".")[0] for point in points}):
        spec = importlib.util.find_spec(package)
        for folder in (spec.submodule_search_locations if spec else None) or ():
            yield from sorted(Path(folder).rglob("*.py"))


def _named(file: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (module := _MODULE.fullmatch(node.module or "")):
            yield from (f"{module[1]}/{module[2]}/{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and NAME.fullmatch(node.value):
            yield node.value
