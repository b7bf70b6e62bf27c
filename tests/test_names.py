"""One word, one meaning: no class name stands twice in engine and plugins, and no folder is too large."""

from __future__ import annotations

import ast
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).parents[1]
SOURCES = sorted(
    file
    for room in ("lupin_engine", "plugins")
    for file in (ROOT / room).rglob("*.py")
    if "__pycache__" not in file.parts
)
#: The most Python files that one folder holds.
LARGEST_FOLDER = 16


def test_no_class_name_stands_twice() -> None:
    """Neither public nor private ones, nested ones included; `_Attempt` and `Attempt` are one name."""
    places: dict[str, list[str]] = defaultdict(list)
    for file in SOURCES:
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef):
                places[node.name.lstrip("_")].append(f"{file.relative_to(ROOT)}:{node.lineno}")
    assert {name: found for name, found in places.items() if len(found) > 1} == {}


def test_no_folder_is_too_large() -> None:
    """What belongs together is one file, and what does not has a folder of its own."""
    sizes: dict[str, int] = defaultdict(int)
    for file in SOURCES:
        sizes[str(file.parent.relative_to(ROOT))] += 1
    assert {folder: size for folder, size in sizes.items() if size > LARGEST_FOLDER} == {}
