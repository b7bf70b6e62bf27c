"""Mermaid itself parses and draws every Mermaid text, without a browser.

It is installed once into a cache outside of the repository; the versions are fixed here. Sites stay behind,
so the one before the newest is tried as well, with the charts that are hardest for it.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from lupin_engine.diagram.mermaid import mermaid
from lupin_engine.diagram.outline import outline
from lupin_engine.diagram.picture import Picture
from tests.diagram import pictured

LIMITS: dict[str, dict[str, Any]] = {"focus": {"focus": "SCANNING"}, "depth": {"depth": 1}}
CHARTS = {"12.3.0": (*pictured.NAMES, *LIMITS), "11.17.2": ("inspection", "exploration", "regions")}
CASES = [(version, name) for version, names in CHARTS.items() for name in names]
JSDOM = "24.1.3"
SCRIPT = Path(__file__).with_name("render_mermaid.mjs")

pytestmark = [pytest.mark.node, pytest.mark.timeout(400)]


def installed(version: str) -> Path:
    """The folder with a version of Mermaid, installed when it is not there yet."""
    npm = shutil.which("npm")
    if npm is None or shutil.which("node") is None:
        pytest.skip("Node.js is not installed")
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    folder = cache / "lupin-tests" / f"mermaid-{version}-{JSDOM}"
    done = folder / "installed"
    if not done.is_file():
        folder.mkdir(parents=True, exist_ok=True)
        command = [
            npm,
            "install",
            "--no-audit",
            "--no-fund",
            "--silent",
            "--ignore-scripts",
            "--prefix",
            folder,
        ]
        packages = [f"mermaid@{version}", f"jsdom@{JSDOM}"]
        ran = subprocess.run([*command, *packages], capture_output=True, text=True, timeout=300)
        assert ran.returncode == 0, f"npm cannot install Mermaid: {ran.stderr.strip()[-300:]}"
        done.touch()
    return folder


def picture(name: str) -> Picture:
    """What is drawn under a name."""
    return outline(pictured.chart("inspection" if name in LIMITS else name), **LIMITS.get(name, {}))


@cache
def drawn(version: str) -> Mapping[str, Any]:
    """What a version of Mermaid made of its charts, by their names."""
    folder, node = installed(version), shutil.which("node")
    assert node is not None
    with tempfile.TemporaryDirectory() as texts:
        files = {name: Path(texts) / f"{name}.mmd" for name in CHARTS[version]}
        for name, file in files.items():
            file.write_text(mermaid(picture(name)), encoding="utf-8")
        command = [node, str(SCRIPT), str(folder), *map(str, files.values())]
        ran = subprocess.run(command, capture_output=True, text=True, timeout=200)
        assert ran.returncode == 0, ran.stderr
        found = json.loads(ran.stdout.splitlines()[-1])
    return {name: found[str(file)] for name, file in files.items()}


@pytest.mark.parametrize(("version", "name"), CASES)
def test_mermaid_draws_it(version: str, name: str) -> None:
    """With all arrows, and the names of all states."""
    found = drawn(version)[name]
    assert "problem" not in found, found["problem"]
    assert found["arrows"] >= len(picture(name).arrows)
    assert not [box.title for box in picture(name).every() if box.title not in found["text"]]
