"""Three robots for longer, two of them flooded; and as many processes as one computer may have."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from contextlib import ExitStack

import pytest

from lupin_harness.domains import claimed_domain
from tests.lupin_ros.system.robots.three import Robot, flood, spin, stopped_in

pytestmark = [pytest.mark.timeout(600), pytest.mark.long]

STOP_S, STOPS = 0.1, 100
#: A participant more than the middleware finds by itself, and a dozen.
MANY = 45
MEET = """
import sys, time
from lupin_ros.adapter.network import other_participants
from lupin_ros.adapter.node import RosNode
nodes = [RosNode(f"n{number}") for number in range(int(sys.argv[1]))]
end = time.monotonic() + 60.0
while other_participants(nodes[-1].node) < len(nodes) - 1 and time.monotonic() < end:
    nodes[-1].spin_once(0.1)
print(other_participants(nodes[-1].node), other_participants(nodes[0].node), flush=True)
import os
os._exit(0)
"""


def test_a_flooded_fleet_stops_in_time(
    robots: list[Robot], record_property: Callable[[str, object], None]
) -> None:
    """The one that is stopped is on a mission, and nobody floods it."""
    *flooded, stopped = robots
    assert stopped.operator.start("29").accepted
    stopped.operator.in_state("INSPECTING", "NAVIGATING")
    with ExitStack() as floods:
        for number in range(len(flooded)):
            floods.enter_context(flood(f"robot{number + 1}"))
        assert spin(robots, lambda: all(len(one.stops) > 1000 for one in flooded), 60.0)
        took = sorted(stopped_in(stopped, robots) for _ in range(STOPS))
    record_property("stops_ms", [round(1000 * seconds) for seconds in (took[STOPS // 2], took[-5], took[-1])])
    assert took[-5] <= STOP_S
    assert stopped.starts() == 1


def test_as_many_processes_find_each_other() -> None:
    """The profile says so: without it 33 are the last."""
    with claimed_domain() as domain:
        said = subprocess.run(
            [sys.executable, "-c", MEET, str(MANY)],
            env={**os.environ, "ROS_DOMAIN_ID": str(domain)},
            capture_output=True,
            text=True,
            timeout=200.0,
            check=False,
        )
    assert said.stdout.split() == [str(MANY - 1)] * 2, said.stderr
