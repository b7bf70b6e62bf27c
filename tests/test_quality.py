"""The linter and the type checker have nothing to say."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.mark.timeout(300)
@pytest.mark.parametrize("tool", [["ruff", "check"], ["mypy"]], ids=["ruff", "mypy"])
def test_is_content(tool: list[str]) -> None:
    pytest.importorskip(tool[0])
    found = subprocess.run(
        [sys.executable, "-m", *tool], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    if found.returncode:
        pytest.fail(f"`{' '.join(tool)}` says:\n{found.stdout}", pytrace=False)
