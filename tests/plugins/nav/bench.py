"""The base's driver between a fake world and a fake engine; needs the messages of ROS 2."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from lupin_nav.catalog import PLUGIN
from lupin_nav.client import NavClient
from tests.plugins.fakes import FakeOutlet, FakeRos, defaults


@dataclass
class NavBench:
    """The driver, with parameters that differ from their defaults in `changed`."""

    ros: FakeRos = field(default_factory=FakeRos)
    outlet: FakeOutlet = field(default_factory=FakeOutlet)
    changed: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        parameters = defaults(PLUGIN, **self.changed)
        self.client = NavClient(self.ros, self.outlet, parameters)  # type: ignore[arg-type]
