"""The plugin `bridge` keeps the contract: its own node answers."""

from __future__ import annotations

from typing import ClassVar

import pytest

from lupin_harness.cases import CatalogContract, DriverContract

pytestmark = pytest.mark.timeout(120)


class TestCatalog(CatalogContract):
    """Without ROS."""

    plugin = "bridge"


class TestDriver(DriverContract):
    """Over ROS 2."""

    plugin = "bridge"
    arguments: ClassVar = {"read_tag": {"tag_id": "1"}}
