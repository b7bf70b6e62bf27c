"""The plugin `twin` keeps the contract: its own node tells."""

from __future__ import annotations

from typing import ClassVar

import pytest

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
