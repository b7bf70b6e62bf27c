"""An engine's process, as the driver sees it."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from peers.install import node_folder, python_of

HERE = Path(__file__).resolve().parent


class EngineError(Exception):
    """An engine cannot do what was asked; the text goes into its cell of the table."""


@dataclass(frozen=True)
class Engine:
    """A row of the table: the adapter, its mode, and the interpreter that runs it (ours, peers, node)."""

    key: str
    title: str
    adapter: str
    runs_in: str = "peers"
    mode: str = ""

    def command(self, environment: Path) -> list[str]:
        """Return what starts its process.

        Raises:
            EngineError: there is nothing to start it with.
        """
        if self.runs_in == "node":
            node = shutil.which("node")
            if node is None:
                raise EngineError("not installed")
            return [node, "--expose-gc", str(HERE / f"{self.adapter}.mjs"), str(node_folder(environment))]
        python = Path(sys.executable) if self.runs_in == "ours" else python_of(environment)
        if not python.exists():
            raise EngineError("not installed")
        return [str(python), str(HERE / "worker.py"), self.adapter, self.mode]


class EngineProcess:
    """Asks one engine's process, a line of JSON for each question."""

    def __init__(self, engine: Engine, environment: Path, folder: Path) -> None:
        """Start the process.

        Raises:
            EngineError: it is not installed.
        """
        self.engine = engine
        self._process = subprocess.Popen(
            engine.command(environment),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env={**os.environ, "BENCHMARK_FOLDER": str(folder)},
        )
        hello = self._read()
        if "version" not in hello:
            self.close()
            raise EngineError("not installed")
        self.version = str(hello["version"])

    def ask(self, do: str, **arguments: Any) -> dict[str, Any]:
        """Return the answer to a question.

        Raises:
            EngineError: the engine cannot do it, or did it wrong.
        """
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps({"do": do, **arguments}) + "\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            raise EngineError("failed: its process ended") from None
        found = self._read()
        if "unsupported" in found:
            raise EngineError(str(found["unsupported"]))
        if "error" in found:
            raise EngineError(f"failed: {found['error']}")
        return found

    def _read(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            return {"error": "its process ended"}
        found: dict[str, Any] = json.loads(line)
        return found

    def close(self) -> None:
        """End the process: with nothing left to answer it ends by itself."""
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()
        try:
            self._process.wait(5.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
