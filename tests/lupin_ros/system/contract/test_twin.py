"""The plugin `twin` keeps the contract: its own node tells."""

from __future__ import annotations

from typing import ClassVar

import pytest

from lupin_cli.main import main
from lupin_harness.cases import CatalogContract, DriverContract

pytestmark = pytest.mark.timeout(120)


class TestCatalog(CatalogContract):
    """Without ROS."""

    plugin = "twin"


class TestDriver(DriverContract):
    """Over ROS 2."""

    plugin = "twin"
    arguments: ClassVar = {}
    waits = False  # no mission waits for the twin


def test_the_command_finds_out_that_the_driver_waits_for_no_server(capfd: pytest.CaptureFixture[str]) -> None:
    """`lupin plugin check --live` has no `waits = False` to read."""
    assert main(["plugin", "check", "twin", "--live"]) == 0
    told = capfd.readouterr()
    assert told.out.splitlines()[-1] == "1 plugin, 15 rules, all kept"
    assert told.err == "note: the driver of 'twin' waits for no server: missing() is empty\n"
