"""The plugin `nav` keeps the contract: the simulated robot drives."""

from __future__ import annotations

from typing import ClassVar

import pytest

from lupin_harness.cases import CatalogContract, DriverContract

pytestmark = pytest.mark.timeout(120)

#: A little way from where the simulated robot begins, and where it begins.
THERE, HERE = {"x": 0.9, "y": 0.5, "yaw": 0.0}, {"x": 0.5, "y": 0.5, "yaw": 0.0}


class TestCatalog(CatalogContract):
    """Without ROS."""

    plugin = "nav"


class TestDriver(DriverContract):
    """Over ROS 2."""

    plugin = "nav"
    nodes = ("lupin_sim",)
    arguments: ClassVar = {
        "go_to": {"pose": THERE},
        "dock": {"pose": HERE},
        "localize": {"max_variance": 1.0},
    }
    first: ClassVar = {"go_to": ("localize",)}
