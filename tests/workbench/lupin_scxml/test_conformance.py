"""The page about conformance is what the suite's tests come to now."""

from __future__ import annotations

import shutil
import subprocess
import tarfile
from pathlib import Path

import pytest

from tests.tools import load_tool

PAGE = Path(__file__).parents[3] / "docs" / "conformance.md"
SUITE = "@scion-scxml/test-framework@2.0.16"


@pytest.mark.node
@pytest.mark.timeout(200)
def test_the_page_says_what_the_suite_comes_to(tmp_path: Path) -> None:
    """The package is unpacked, not installed: it is read, and nothing of it runs."""
    npm = shutil.which("npm")
    if npm is None:
        pytest.skip("Node.js is not installed")
    packed = subprocess.run([npm, "pack", SUITE], cwd=tmp_path, capture_output=True, text=True)
    if packed.returncode != 0:
        pytest.skip("the suite cannot be fetched")
    with tarfile.open(next(tmp_path.glob("*.tgz"))) as archive:
        archive.extractall(tmp_path, filter="data")
    lines = list(load_tool("conformance").page(tmp_path / "package" / "test" / "w3c-ecma"))
    assert "\n".join(lines) + "\n" == PAGE.read_text(encoding="utf-8")
