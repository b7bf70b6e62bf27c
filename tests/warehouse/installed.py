"""The warehouse's package, installed elsewhere: it is found by its entry point as any other is."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
MISSIONS = HERE / "missions"
_SETUP = ("-W", "ignore", "-c", "from setuptools import setup; setup()", "--quiet")


def install(site: Path) -> None:
    """Build the package into a folder, as an installer does; nothing is downloaded."""
    pytest.importorskip("setuptools", reason="the package is built with it")
    subprocess.run(
        [sys.executable, *_SETUP, "egg_info", "--egg-base", str(site), "build_py", "--build-lib", str(site)],
        cwd=HERE / "lupin-warehouse",
        check=True,
        capture_output=True,
    )
