"""The wire of a module's own running node."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.lupin_ros.system.wire.wire import Wire


@pytest.fixture
def wire(running: Wire) -> Iterator[Wire]:
    """A module's own `running` node: at rest before a test, and held to the rules after it."""
    running.begin()
    yield running
    running.check()
