"""A gateway as its own process, and pages with both versions of roslib, from npm."""

from __future__ import annotations

import shutil
import socket
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from lupin_ros.adapter.node import RosNode
from tests.lupin_ros.plugins.gateway.page import PROGRAM, Page
from tests.lupin_ros.world import World

PACKAGES = ("roslib@2.1.0", "roslib-1@npm:roslib@1.4.1", "ws@8")


@pytest.fixture(scope="session")
def roslib(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Both versions of roslib in a folder, with the page that uses them."""
    npm = shutil.which("npm")
    if npm is None or shutil.which("node") is None:
        pytest.skip("Node.js is not installed")
    folder = tmp_path_factory.mktemp("roslib")
    command = [
        npm,
        "install",
        "--no-audit",
        "--no-fund",
        "--ignore-scripts",
        "--prefix",
        str(folder),
        *PACKAGES,
    ]
    if subprocess.run(command, capture_output=True, cwd=folder).returncode != 0:
        pytest.skip("roslib cannot be fetched")
    shutil.copy(PROGRAM, folder)
    return folder


def free_port() -> int:
    """Return a port that nobody has now."""
    with socket.create_server(("127.0.0.1", 0)) as found:
        return int(found.getsockname()[1])


@pytest.fixture
def gateway(world: World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., str]:
    """Start a gateway with parameters; return the address of the protocol once it answers.

    Pages may use every name, unless the test says which. No stop of another test's gateway is found.
    """
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))

    def start(**parameters: Any) -> str:
        port = free_port()
        # Pages of these tests use names that no catalog has.
        process = world.start("lupin_gateway", port=port, **{"engineer_names": ["/*"], **parameters})
        while True:
            assert process.poll() is None, world.log("lupin_gateway").read_text()
            try:
                socket.create_connection(("127.0.0.1", port), 1.0).close()
                return f"ws://127.0.0.1:{port}/_ros"
            except OSError:
                with pytest.raises(subprocess.TimeoutExpired):
                    process.wait(0.05)

    return start


@pytest.fixture
def page(roslib: Path) -> Iterator[Callable[..., Page]]:
    """Open pages: `page(url, *nodes, version=...)`; they are closed after the test."""
    pages: list[Page] = []

    def open_one(url: str, *nodes: RosNode, version: str = "2") -> Page:
        pages.append(Page(roslib, version, url, nodes))
        return pages[-1].connected()

    yield open_one
    for each in pages:
        each.close()
