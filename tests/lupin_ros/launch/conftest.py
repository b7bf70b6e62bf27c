"""Runs on a ROS domain that nobody else uses, and none of which survives its test."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from lupin_harness.domains import claimed_domain
from tests.lupin_ros.launch.processes import Lupin


@pytest.fixture
def lupin(tmp_path: Path) -> Iterator[Callable[..., Lupin]]:
    """Start `lupin` commands, all in the same domain of their own."""
    started: list[Lupin] = []
    with claimed_domain() as domain:

        def start(*arguments: str, **named: Any) -> Lupin:
            logs = tmp_path / f"run{len(started)}"
            started.append(Lupin(*arguments, domain=domain, log_dir=logs, **named))
            return started[-1]

        yield start
    left = {pid: line for command in started for pid, line in command.processes().items()}
    for command in started:
        command.kill()
    assert not left, "processes survived the test"
