"""One word, one meaning: no class name stands twice on all shelves."""

from __future__ import annotations

import ast
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).parents[1]
SOURCES = sorted(
    file
    for shelf in ("lupin_engine", "lupin_ros", "workbench", "plugins")
    for file in (ROOT / shelf).rglob("*.py")
    if "__pycache__" not in file.parts
)


def test_no_class_name_stands_twice() -> None:
    """Neither public nor private ones, nested ones included; `_Attempt` and `Attempt` are one name."""
    places: dict[str, list[str]] = defaultdict(list)
    for file in SOURCES:
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef):
                places[node.name.lstrip("_")].append(f"{file.relative_to(ROOT)}:{node.lineno}")
    assert {name: found for name, found in places.items() if len(found) > 1} == {}
