"""Installs the peers into an environment of their own; what cannot be installed is left out, not fatal."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

HERE = Path(__file__).resolve().parent
REQUIREMENTS = HERE.parent / "requirements.txt"
PACKAGE = HERE / "package.json"

#: Longer than this and a registry is counted as out of reach.
LIMIT_S = 300.0

Say = Callable[[str], None]


def python_of(environment: Path) -> Path:
    """Return the interpreter of the peers that are written in Python."""
    return environment / "bin" / "python"


def node_folder(environment: Path) -> Path:
    """Return where the peers that are written in JavaScript stand."""
    return environment / "node"


def install_python(environment: Path, say: Say) -> None:
    """Make the environment and install each requirement on its own, so that one's failure is only its own."""
    wanted = [line.strip() for line in REQUIREMENTS.read_text(encoding="utf-8").splitlines()]
    wanted = [line for line in wanted if line and not line.startswith("#")]
    stamp = environment / "installed.txt"
    have = stamp.read_text(encoding="utf-8").splitlines() if stamp.is_file() else []
    if not python_of(environment).exists() and not _done(
        [sys.executable, "-m", "venv", str(environment)], say
    ):
        return
    for requirement in wanted:
        if requirement not in have:
            say(f"installing {requirement}")
            if _done([str(python_of(environment)), "-m", "pip", "install", "-q", requirement], say):
                have.append(requirement)
    stamp.write_text("\n".join(have) + "\n", encoding="utf-8")


def install_node(environment: Path, say: Say) -> None:
    """Install the npm packages, where there is Node.js."""
    npm, folder = shutil.which("npm"), node_folder(environment)
    if shutil.which("node") is None or npm is None:
        return
    copy = folder / PACKAGE.name
    same = copy.is_file() and copy.read_bytes() == PACKAGE.read_bytes()
    if same and (folder / "node_modules").is_dir():
        return
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(PACKAGE, copy)
    say("installing the npm packages")
    _done([npm, "install", "--prefix", str(folder), "--no-audit", "--no-fund", "--loglevel=error"], say)


def _done(command: list[str], say: Say) -> bool:
    """Run a command and tell what it says if it fails."""
    try:
        found = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S)
    except (OSError, subprocess.TimeoutExpired) as problem:
        say(f"not installed: {problem}")
        return False
    if found.returncode:
        said = (found.stderr or found.stdout).strip().splitlines()
        say(f"not installed: {said[0] if said else command[0]}")
    return found.returncode == 0
