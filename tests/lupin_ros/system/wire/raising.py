"""The orchestrator as a process in which one callback raises for as long as a file names it.

What can raise is found by introspection: every method of what the orchestrator's modules hold. The names
are written beside the file, one a line.
"""

from __future__ import annotations

import functools
import inspect
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FunctionType
from typing import Any

from lupin_nav.client import NavClient
from lupin_ros.adapter.node import RosNode
from lupin_ros.adapter.vitals import CountedPublisher
from lupin_ros.orchestrator import journal_gate, missions, records, requests, step_publisher
from lupin_ros.orchestrator import node as orchestrator
from lupin_ros.orchestrator.loop import Loop

#: Where the rest of it comes from: what is built of other people's modules is left out.
OURS = ("lupin_ros.", "lupin_engine.runtime.journal.", "lupin_engine.runtime.client_clocks")
#: Not called by a step but what a step is taken by: without a clock or a thread of the node there is none.
NO_CALLBACKS = {
    "ClientClocks", "PluginClients", "Executor", "Loop", "MissionSwitch", "NodeClock", "NodeLog",
    "Orchestrator", "RequestServer", "RosNode", "RosOutlet", "RosTimer",
}  # fmt: skip
#: Runs on the thread of the disk: no step calls it.
OF_THE_DISK = ("JournalGate.post", "JournalGate.disk_changed", "Journal.post")
#: What of those is a callback all the same.
BESIDES = (
    (Loop, ("_sleep_until",)),
    (missions.MissionSwitch, ("why_unknown",)),
    (RosNode, ("call_later", "trouble")),
    (CountedPublisher, ("publish",)),
    (NavClient, ("_go_to",)),
)


def callbacks() -> Iterator[tuple[type, str]]:
    """Yield the class and the name of every method that may raise."""
    modules = (orchestrator, journal_gate, records, step_publisher, missions, requests)
    found = [value for module in modules for value in vars(module).values()]
    for each in dict.fromkeys(filter(inspect.isclass, found)):
        if each.__module__.startswith(OURS) and each.__name__ not in NO_CALLBACKS:
            names = [name for name, made in vars(each).items() if isinstance(made, FunctionType)]
            wanted = [name for name in names if f"{each.__name__}.{name}" not in OF_THE_DISK]
            yield from ((each, name) for name in wanted if not name.startswith("__"))
    for owner, wanted in BESIDES:
        yield from ((owner, name) for name in wanted)


def raising(name: str, method: Callable[..., Any], switch: Path) -> Callable[..., Any]:
    """Return a method that raises while the file says so."""

    @functools.wraps(method)
    def call(*arguments: Any, **named: Any) -> Any:
        if switch.read_text() == name:
            raise RuntimeError(f"{name} raises")
        return method(*arguments, **named)

    return call


def main() -> int:
    """Run the node; the environment names the file."""
    switch = Path(os.environ["RAISES"])
    names = []
    for owner, method in callbacks():
        names.append(f"{owner.__name__}.{method}")
        setattr(owner, method, raising(names[-1], getattr(owner, method), switch))
    switch.write_text("")
    switch.with_suffix(".names").write_text("\n".join(names))
    return orchestrator.main(sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())
