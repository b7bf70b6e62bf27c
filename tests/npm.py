"""Packages of Node.js, which others wrote to read what we write, kept in a cache of the user."""

from __future__ import annotations

import os
import shutil
import subprocess
from functools import cache
from hashlib import sha256
from pathlib import Path

import pytest


@cache
def installed(*packages: str) -> Path:
    """Return the folder with these packages, such as `ws@8.18.0`, installed when it is not there yet."""
    npm = shutil.which("npm")
    if npm is None or shutil.which("node") is None:
        pytest.skip("Node.js is not installed")
    kept = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    folder = kept / "lupin-tests" / sha256(" ".join(packages).encode()).hexdigest()[:16]
    done = folder / "installed"
    if not done.is_file():
        folder.mkdir(parents=True, exist_ok=True)
        options = ["--no-audit", "--no-fund", "--silent", "--ignore-scripts", "--prefix", str(folder)]
        command = [npm, "install", *options, *packages]
        ran = subprocess.run(command, capture_output=True, text=True, timeout=300)
        if ran.returncode:
            pytest.skip(f"the npm registry cannot be reached: {ran.stderr.strip()[-200:]}")
        done.touch()
    return folder


def run_node(*arguments: str | Path) -> str:
    """Run a program of Node.js and return what it printed."""
    node = shutil.which("node")
    assert node is not None
    command = [node, *map(str, arguments)]
    ran = subprocess.run(command, capture_output=True, text=True, timeout=200)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    return ran.stdout
