"""What ends something leaves first, whatever else a step wants, and whatever raises beside it."""

from __future__ import annotations

import itertools
import typing
from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

import pytest

from lupin_engine.machine import event as events
from lupin_engine.machine.event import Act, Cancel, Event, Publish, Report, Start
from lupin_engine.machine.step import Step
from lupin_engine.plugin.contract import Driver
from lupin_engine.runtime.clock import VirtualClock
from lupin_engine.runtime.engine import Engine, InputLog

#: One of each kind of command that a step can have.
COMMANDS: Mapping[type, Any] = {
    Start: Start("a2", "nav.go", {}),
    Cancel: Cancel("a1", "nav.go"),
    Act: Act("nav.ring", {}),
    Publish: Publish("M", "m", "7", "OK"),
    Report: Report("M", "m", ()),
}
LOG = [name for name in vars(InputLog) if not name.startswith("_")]
DRIVER = [name for name in vars(Driver) if not name.startswith("_")]


class Telling:
    """A driver, a log and a listener in one: it notes what it is called, and one of the calls raises."""

    def __init__(self, raises: str) -> None:
        self.called: list[str] = []
        self._raises = raises

    def __getattr__(self, name: str) -> Callable[..., Any]:
        if name not in (*LOG, *DRIVER, "listener", "wall"):
            raise AttributeError(name)

        def call(*given: Any) -> Any:
            self.called.append(name)
            if name == self._raises:
                raise RuntimeError(f"{name} raises")
            if name == "when_flushed":
                given[0]()

        return call


def machine(commands: tuple[Any, ...]) -> Any:
    """Return what the loop uses of a machine, which wants these commands of every request."""
    chart = SimpleNamespace(catalog=SimpleNamespace(events={}, operations={}))
    found = SimpleNamespace(memory=SimpleNamespace(wall=None, attempts={}), chart=chart, next_deadline=None)

    def handle(event: Event, now: float) -> Step:
        is_asked = event.name == "operator.pause"
        return Step(1, now, event, (), commands=commands if is_asked else (), accepted=is_asked or None)

    found.handle = handle
    return found


def test_there_is_one_of_each_kind() -> None:
    assert set(COMMANDS) == set(typing.get_args(events.Command))


@pytest.mark.parametrize("raises", ["", "listener", "wall", *LOG, *(n for n in DRIVER if n != "cancel")])
def test_what_ends_leaves_first(raises: str) -> None:
    """In any order of the commands; the request gets its answer, and the next one as well."""
    for commands in itertools.permutations(COMMANDS.values()):
        told, failed = Telling(raises), []
        engine = Engine(machine(commands), VirtualClock(), {"nav": told}, told.listener, told.wall, told)
        engine.on_failure(failed.append)
        for _ in range(2):
            step = engine.request(Event("operator.pause"))
            assert step.accepted
        counted = ("start", "cancel", "act", "listener", "when_flushed")
        does = [name for name in told.called if name in counted]
        assert does[0] == "cancel", (commands, does)
        assert does.count("cancel") == 2
        assert bool(failed) == (raises in ("listener", "wall", "handled", "when_flushed"))


@pytest.mark.parametrize("raises", ["listener", "when_flushed"])
def test_without_somebody_to_tell_it_is_raised_after_that(raises: str) -> None:
    """As in simulations, where it is a defect to be seen."""
    told = Telling(raises)
    engine = Engine(machine(tuple(COMMANDS.values())), VirtualClock(), {"nav": told}, told.listener, log=told)
    with pytest.raises(RuntimeError, match=f"{raises} raises"):
        engine.request(Event("operator.pause"))
    assert "cancel" in told.called
