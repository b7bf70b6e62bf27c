"""Each README of a package against its source; with `ACCEPT=1` the pictures are drawn anew."""

from __future__ import annotations

import os
import re
from functools import cache

import pytest

from tests.test_import_rule import ROOT, crossings, faces, imports, modules, packages, plugin_modules

PACKAGES = {name: modules()[name].parent for name in sorted(packages())}
PICTURE = re.compile(r"(?<=^```mermaid\n).*?(?=^```$)", re.MULTILINE | re.DOTALL)


@cache
def crossed() -> set[tuple[str, str]]:
    """Return what each package imports of others, by full names."""
    return {(name.partition(".")[0], full) for name in modules() for full, _ in crossings(name)}


def arrows(package: str) -> dict[str, set[str]]:
    """Return what each room or module of a package imports of the others; a folder counts as one."""
    inside = {name: name.split(".")[1] for name in modules() if name.startswith(f"{package}.")}
    found: dict[str, set[str]] = {part: set() for part in inside.values()}
    for name, part in inside.items():
        found[part] |= {inside[other] for other in imports(name) if other in inside} - {part}
    return found


def reached(graph: dict[str, set[str]], start: str) -> set[str]:
    """Return everything that can be reached from a node by at least one arrow."""
    found, waiting = set[str](), [start]
    while waiting:
        waiting += (new := graph[waiting.pop()] - found)
        found |= new
    return found


def picture(graph: dict[str, set[str]]) -> str:
    """Return the transitive reduction as Mermaid; of a circle all arrows are kept."""
    below, drawn, text = {node: reached(graph, node) for node in graph}, set[str](), "graph BT\n"
    for node, used in sorted(graph.items()):
        ways = {way for way in used if node not in below[way]}
        kept = {to for to in used if not any(to in below[way] and way not in below[to] for way in ways)}
        text += f"  {node} --> {' & '.join(sorted(kept))}\n" if kept else ""
        drawn |= kept | {node} if kept else kept
    return text + (f"  {' & '.join(sorted(set(graph) - drawn))}\n" if set(graph) - drawn else "")


def listed(users: set[str], own: str) -> str:
    """Return packages as the READMEs name them: all of them, or all plugins, are not named one by one."""
    plugins = {name.partition(".")[0] for name in plugin_modules()}
    whole = {"every other package": set(PACKAGES), "every plugin": plugins}
    words = [words for words, names in whole.items() if users >= names - {own}][:1]
    rest = users - set().union(*(whole[word] for word in words))
    return ", ".join([*words, *(f"`{name}`" for name in sorted(rest))]) or "no other package"


@pytest.mark.parametrize("package", PACKAGES)
def test_a_readme_says_what_the_source_says(package: str) -> None:
    """The picture, the neighbours, a row for each room or module, what faces export, and paths of tests."""
    page, graph = PACKAGES[package] / "README.md", arrows(package)
    text = page.read_text(encoding="utf-8")
    if os.environ.get("ACCEPT") == "1":
        page.write_text(text := PICTURE.sub(picture(graph), text), encoding="utf-8")
    assert PICTURE.findall(text) == [picture(graph)]
    below = listed({full.partition(".")[0] for user, full in crossed() if user == package}, package)
    assert f"It imports {below}." in text.replace("\n", " ")
    rows = re.findall(r"^\| `(\w+)` \| [^|]+\.(?: \| ([^|]+) \| ([^|]+))? \|$", text, re.MULTILINE)
    assert sorted(name for name, *_ in rows) == sorted(graph)
    faced = [(f"{package}.{room}", names, said) for room, names, said in rows if said]
    faced += [(package, *found) for found in re.findall(r"^Its face exports (.+) to (.+)\.$", text, re.M)]
    for face, names, said in faced:
        exported = {*faces(), *(full for _, full in crossed())}
        assert {f"{face}.{name}" for name in re.findall(r"`(\w+)`", names)} <= exported
        assert said == listed({user for user, full in crossed() if full.startswith(f"{face}.")}, package)
    assert re.search(r"^\.venv/bin/python .*-m pytest .*\btests/", text, re.MULTILINE)
    assert [path for path in re.findall(r"(?<![\w/])tests/[\w/.]+", text) if not (ROOT / path).exists()] == []
