"""Mermaid itself parses and draws every Mermaid text, without a browser.

It is installed once into a cache outside of the repository; the versions are fixed here. Sites stay behind,
so the one before the newest is tried as well, with the charts that are hardest for it.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from lupin_engine.diagram.mermaid import mermaid
from lupin_engine.diagram.outline import outline
from lupin_engine.diagram.picture import Picture
from tests.lupin_engine.diagram import pictured
from tests.npm import installed, run_node

LIMITS: dict[str, dict[str, Any]] = {"focus": {"focus": "SCANNING"}, "depth": {"depth": 1}}
CHARTS = {"12.3.0": (*pictured.NAMES, *LIMITS), "11.17.2": ("inspection", "exploration", "regions")}
CASES = [(version, name) for version, names in CHARTS.items() for name in names]
JSDOM = "24.1.3"
SCRIPT = Path(__file__).with_name("render_mermaid.mjs")

pytestmark = [pytest.mark.node, pytest.mark.timeout(400)]


def picture(name: str) -> Picture:
    """What is drawn under a name."""
    return outline(pictured.chart("inspection" if name in LIMITS else name), **LIMITS.get(name, {}))


@cache
def drawn(version: str) -> Mapping[str, Any]:
    """What a version of Mermaid made of its charts, by their names."""
    folder = installed(f"mermaid@{version}", f"jsdom@{JSDOM}")
    with tempfile.TemporaryDirectory() as texts:
        files = {name: Path(texts) / f"{name}.mmd" for name in CHARTS[version]}
        for name, file in files.items():
            file.write_text(mermaid(picture(name)), encoding="utf-8")
        found = json.loads(run_node(SCRIPT, folder, *files.values()).splitlines()[-1])
    return {name: found[str(file)] for name, file in files.items()}


@pytest.mark.long
@pytest.mark.parametrize(("version", "name"), CASES)
def test_mermaid_draws_it(version: str, name: str) -> None:
    """With all arrows, and the names of all states."""
    found = drawn(version)[name]
    assert "problem" not in found, found["problem"]
    assert found["arrows"] >= len(picture(name).arrows)
    assert not [box.title for box in picture(name).every() if box.title not in found["text"]]
