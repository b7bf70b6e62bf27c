"""Plugins whose servers are data: for this operation and these arguments, after so long, this outcome.

What nobody scripts ends as the plugin's own mock says. Times count from the acceptance of an attempt, which
comes at once unless the script says otherwise.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from lupin_engine.plugin.contract import Operation, Outlet
from lupin_engine.plugin.registry import Catalog
from lupin_engine.sim.agenda import Agenda


class OnCancel(enum.Enum):
    """What a scripted server does when an accepted attempt is cancelled."""

    END = "ends"  #: confirms at once
    IGNORE = "ignored"  #: goes on, and ends as if nothing had been said
    SILENT = "unconfirmed"  #: stops, and never says so


@dataclass(frozen=True)
class Outcome:
    """How one attempt ends: done with `result` over the mock's, failed with `code`, or never.

    Args:
        after: seconds from acceptance to the end; None: as long as the plugin's mock takes.
        accepted_after: seconds from the request to its acceptance; None: it is never accepted.
        progress: what the server says after it has accepted.
    """

    after: float | None = None
    code: str = ""
    detail: str = ""
    result: Mapping[str, Any] = field(default_factory=dict)
    never: bool = False
    accepted_after: float | None = 0.0
    on_cancel: OnCancel = OnCancel.END
    progress: str = ""


@dataclass(frozen=True)
class Rule:
    """What attempts of one operation come to.

    An attempt falls under the rule when it has all of `arguments` (records need only contain what is given)
    and, with `target`, when that is the itinerary's current target. With `once` the outcomes are used one
    after the other, one attempt each, and the rule is spent after the last; else the first holds always.
    """

    operation: str
    outcomes: tuple[Outcome, ...]
    arguments: Mapping[str, Any] = field(default_factory=dict)
    target: str | None = None
    once: bool = False

    def covers(self, operation: str, arguments: Mapping[str, Any], target: str) -> bool:
        """Say whether an attempt falls under this rule."""
        if operation != self.operation or (self.target is not None and self.target != target):
            return False
        return contains(arguments, self.arguments)


def contains(whole: Any, part: Any) -> bool:
    """Say whether `whole` has everything that `part` names."""
    if isinstance(part, Mapping) and isinstance(whole, Mapping):
        return all(name in whole and contains(whole[name], value) for name, value in part.items())
    return bool(whole == part)


@dataclass
class _Running:
    """An attempt that a scripted server has heard of."""

    operation: str
    arguments: Mapping[str, Any]
    outcome: Outcome
    accepted: bool = False


class Stage:
    """All servers of one simulation.

    Args:
        target: tells the itinerary's current target, for rules that name one.
        now: tells the time.
    """

    def __init__(
        self,
        catalog: Catalog,
        parameters: Mapping[str, Any],
        rules: Iterable[Rule],
        agenda: Agenda,
        now: Callable[[], float],
        target: Callable[[], str],
    ) -> None:
        self._catalog = catalog
        self._parameters = parameters
        self._rules = [(rule, list(rule.outcomes)) for rule in rules]
        self._agenda = agenda
        self._now = now
        self._target = target
        self._running: dict[str, _Running] = {}
        self._outlet: Outlet | None = None

    def drivers(self, outlet: Outlet) -> dict[str, ScriptedDriver]:
        """Return a driver for every plugin of the catalog, all reporting to `outlet`."""
        self._outlet = outlet
        return {name: ScriptedDriver(self, name) for name in self._catalog.plugins}

    @property
    def outlet(self) -> Outlet:
        """Where the servers report."""
        assert self._outlet is not None, "the stage has no drivers yet"
        return self._outlet

    def start(self, attempt: str, operation: str, arguments: Mapping[str, Any]) -> None:
        """Hear of a request; accept it when its outcome says so."""
        running = _Running(operation, arguments, self._choose(operation, arguments))
        self._running[attempt] = running
        wait = running.outcome.accepted_after
        if wait == 0.0:
            self._accept(attempt)
        elif wait is not None:
            self._agenda.note(self._now() + wait, lambda: self._accept(attempt))

    def cancel(self, attempt: str) -> None:
        """Hear that nobody wants an attempt any more."""
        running = self._running.get(attempt)
        if running is None or not running.accepted or running.outcome.on_cancel is OnCancel.IGNORE:
            return
        del self._running[attempt]
        if running.outcome.on_cancel is OnCancel.END:
            self.outlet.cancelled(attempt)

    def end_current(self, operation: str, code: str, detail: str) -> bool:
        """End the newest attempt of an operation now: done without a code, else failed; False without one."""
        for attempt, running in reversed(list(self._running.items())):
            if running.operation == operation:
                self._end(attempt, Outcome(code=code, detail=detail))
                return True
        return False

    def _choose(self, operation: str, arguments: Mapping[str, Any]) -> Outcome:
        target = self._target()
        for rule, left in self._rules:
            if left and rule.covers(operation, arguments, target):
                return left.pop(0) if rule.once else left[0]
        return Outcome()

    def _accept(self, attempt: str) -> None:
        running = self._running[attempt]
        running.accepted = True
        outcome = running.outcome
        self.outlet.accepted(attempt)
        if outcome.progress:
            self.outlet.progress(attempt, outcome.progress)
        if not outcome.never:
            after = self._operation(running).mock.after if outcome.after is None else outcome.after
            self._agenda.note(self._now() + after, lambda: self._end(attempt, outcome))

    def _end(self, attempt: str, outcome: Outcome) -> None:
        running = self._running.pop(attempt, None)
        if running is None:
            return
        if outcome.code:
            self.outlet.failed(attempt, outcome.code, outcome.detail)
        else:
            self.outlet.done(attempt, {**self._mocked(running), **outcome.result})

    def _mocked(self, running: _Running) -> Mapping[str, Any]:
        result = self._operation(running).mock.result
        return result(running.arguments, self._parameters) if callable(result) else result

    def _operation(self, running: _Running) -> Operation:
        return self._catalog.operations[running.operation]


class ScriptedDriver:
    """A plugin's side of a stage; see `plugin.contract.Driver`."""

    def __init__(self, stage: Stage, plugin: str) -> None:
        self._stage = stage
        self._plugin = plugin

    def missing(self) -> list[str]:
        """Nothing: a scripted server is always there."""
        return []

    def start(self, attempt: str, operation: str, arguments: Mapping[str, Any]) -> None:
        """Begin an attempt."""
        self._stage.start(attempt, f"{self._plugin}.{operation}", arguments)

    def cancel(self, attempt: str) -> None:
        """Ask that an attempt ends."""
        self._stage.cancel(attempt)

    def act(self, action: str, arguments: Mapping[str, Any]) -> None:
        """Carry out an action: the record of the step is all that comes of it."""

    def close(self) -> None:
        """Nothing is held."""
