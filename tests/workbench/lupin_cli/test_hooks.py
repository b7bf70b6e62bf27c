"""The hooks for missions in repositories of their own, run by pre-commit itself."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from lupin_engine.missions.folders import LIFECYCLE

pytestmark = pytest.mark.slow

pytest.importorskip("pre_commit", reason="the extra `dev` is not installed")

ROOT = Path(__file__).parents[3]
#: pre-commit would install this repository into an environment of its own; here the one of the tests is used.
CONFIG = """\
repos:
  - repo: {repo}
    rev: {rev}
    hooks:
      - {{id: lupin-check, language: unsupported}}
      - {{id: lupin-prove, language: unsupported}}
"""
#: Whether it does what its author asks for no check knows.
WATCH = """\
mission: Watch
properties:
  looks: {after: in_state('LOOKING'), never: in_state('WAITING'), until: in_state('READY')}
states:
  LOOKING: {after: {2 s: %s}}
  WAITING: {after: {5 s: LOOKING}, on: {operator.skip_current: done}}
  done: {type: final}
initial: WAITING
"""


class Author:
    """Works in a repository with the hooks, and pushes to another one."""

    def __init__(self, folder: Path) -> None:
        """Make both, and a repository that has the hooks."""
        self.folder = folder / "work"
        self._env = {
            **{name: value for name, value in os.environ.items() if not name.startswith("GIT_")},
            "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
            "PRE_COMMIT_HOME": str(folder / "cache"),
            "GIT_CONFIG_GLOBAL": os.devnull,
        }
        hooks = folder / "hooks"
        for made in (hooks, self.folder):
            made.mkdir()
            self.run("git", "init", "--quiet", at=made)
            for name, value in (("user.name", "author"), ("user.email", "author@example.org")):
                self.run("git", "config", name, value, at=made)
        shutil.copy(ROOT / ".pre-commit-hooks.yaml", hooks)
        for words in (("add", "-A"), ("commit", "--quiet", "-m", "hooks")):
            self.run("git", *words, at=hooks)
        rev = self.run("git", "rev-parse", "HEAD", at=hooks)[1].strip()
        self.write(".pre-commit-config.yaml", CONFIG.format(repo=hooks, rev=rev))
        self.run("git", "init", "--quiet", "--bare", str(folder / "origin"))
        self.run("git", "remote", "add", "origin", str(folder / "origin"))
        kinds = ("--hook-type", "pre-commit", "--hook-type", "pre-push")
        assert self.run(sys.executable, "-m", "pre_commit", "install", *kinds)[0] == 0

    def write(self, name: str, text: str) -> None:
        """Write a file."""
        file = self.folder / name
        file.parent.mkdir(exist_ok=True)
        file.write_text(text, encoding="utf-8")

    def run(self, *command: str, at: Path | None = None) -> tuple[int, str]:
        """Run a command, and return its exit code and what it says."""
        done = subprocess.run(
            command,
            cwd=at or self.folder,
            env=self._env,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
        return done.returncode, done.stdout

    def commit(self) -> tuple[int, str]:
        """Commit all."""
        self.run("git", "add", "-A")
        return self.run("git", "commit", "-m", "a change")

    def push(self) -> tuple[int, str]:
        """Push what was committed."""
        return self.run("git", "push", "--quiet", "origin", "HEAD:main")


def test_the_hooks_stop_a_bad_commit_and_a_bad_push(tmp_path: Path) -> None:
    """With the place and what is wrong; a good mission passes both."""
    author = Author(tmp_path)
    mini = ROOT / "tests" / "charts" / "mini" / LIFECYCLE
    author.write(f"missions/{LIFECYCLE}", mini.read_text(encoding="utf-8"))
    author.write("missions/watch.yaml", WATCH % "LOKING")
    code, said = author.commit()
    assert code == 1
    place = "missions/watch.yaml:5:26: error: MISSION.Watch.LOOKING.after.0"
    assert f"\n{place}: no state is called 'LOKING' here; did you mean 'LOOKING'?" in said
    author.write("missions/watch.yaml", WATCH % "done")
    code, said = author.commit()
    assert code == 0, said
    assert "Passed" in said
    code, said = author.push()
    assert code == 0, said
    assert said.count("Passed") == 2
    author.write("missions/watch.yaml", WATCH % "WAITING")
    code, said = author.commit()
    assert code == 0, said
    code, said = author.push()
    assert code == 1
    assert f"\n{place}: property looks (line 3): in_state('WAITING') became true; it must never be; " in said
    assert author.run("git", "log", "--oneline", "origin/main")[1].count("\n") == 1
