"""An outlet that records a driver's reports, and every violation of the contract."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from lupin_engine.errors import nearest
from lupin_engine.plugin import EventKind, LiveValue, Notation, Operation, Plugin, Type, problems
from lupin_harness.rules import result_problems


class ContractBroken(AssertionError):
    """A driver violates the contract; the text says how."""


class NeedsArguments(ContractBroken):
    """An operation fails, as it may, with arguments that were made up for it: they must be given."""


class Untried(ContractBroken):
    """A rule could not be tested because the driver does not get ready; another rule reports why."""


@dataclass
class RefereedAttempt:
    """The course of an attempt: `reports` are its reports in order, without progress."""

    operation: str
    reports: list[str] = field(default_factory=list)
    cancelled: bool = False
    code: str = ""
    detail: str = ""

    @property
    def ended(self) -> bool:
        """Whether it has ended."""
        return any(word in ("done", "failed", "cancelled") for word in self.reports)

    def __str__(self) -> str:
        why = f" ({self.code}: {self.detail})" if self.code else ""
        return f"{', '.join(self.reports) or 'nothing'}{why}"


class Referee:
    """The engine's side of a driver: see `Outlet` for the calls; `problems` has the violations.

    Like the engine it repeats the cancel of an attempt that is accepted afterwards: `again` is called with
    its name. Attempt names are unique on a node: `numbers` is shared by all its drivers.
    """

    def __init__(
        self,
        plugin: Plugin,
        again: Callable[[str], None] = lambda _: None,
        numbers: Iterator[int] | None = None,
    ) -> None:
        self._plugin = plugin
        self._again = again
        self._numbers = numbers or itertools.count(1)
        self.attempts: dict[str, RefereedAttempt] = {}
        self.values: list[tuple[str, Any]] = []
        self.events: list[tuple[str, Mapping[str, Any]]] = []
        self.problems: list[str] = []
        self.closed = False

    def begin(self, operation: str) -> str:
        """Return the name of a new attempt."""
        name = f"{operation}_{next(self._numbers)}"
        self.attempts[name] = RefereedAttempt(operation)
        return name

    def accepted(self, attempt: str) -> None:
        known = self._hears("accepted", attempt)
        if known is None:
            return
        if "accepted" in known.reports[:-1]:
            self.problems.append(f"{attempt} is accepted twice")
        if known.cancelled:
            self._again(attempt)

    def progress(self, attempt: str, detail: str) -> None:
        known = self._known("progress", attempt)
        if known is not None and known.ended:
            self.problems.append(f"{attempt} reports progress after its end")
        if not isinstance(detail, str) or not detail:
            self.problems.append(f"{attempt} reports progress without a text: {detail!r}")

    def done(self, attempt: str, result: Mapping[str, Any]) -> None:
        known = self._hears("done", attempt)
        if known is not None:
            problems = result_problems(self._operation(known), result)
            self.problems += [f"{attempt} is done, but {problem}" for problem in problems]

    def failed(self, attempt: str, code: str, detail: str = "") -> None:
        known = self._hears("failed", attempt)
        if known is None:
            return
        known.code, known.detail = code, detail
        declared = {declared.name for declared in self._operation(known).codes}
        if code not in declared:
            said = nearest(code, declared)
            self.problems.append(f"{attempt} fails with {code!r}, which is no code of its operation; {said}")

    def cancelled(self, attempt: str, result: Mapping[str, Any] | None = None) -> None:
        known = self._hears("cancelled", attempt)
        if known is not None and not known.cancelled:
            self.problems.append(f"{attempt} reports that it is cancelled, and nobody asked for it")

    def cancel_refused(self, attempt: str, detail: str) -> None:
        known = self._known("cancel_refused", attempt)
        if known is not None and not known.cancelled:
            self.problems.append(f"{attempt} reports that its cancel is refused, and nobody asked for it")

    def value(self, name: str, value: Any, stamp: float) -> None:
        self._open(f"value {name!r}")
        self.values.append((name, value))
        declared: LiveValue | None = self._plugin.values.get(name)
        if declared is None:
            said = nearest(name, self._plugin.values)
            self.problems.append(f"value {name!r} is reported and not declared; {said}")
            return
        if not isinstance(stamp, (int, float)) or not math.isfinite(stamp):
            self.problems.append(f"value {name!r} has the stamp {stamp!r}; it must be seconds")
        self._fits(f"value {name!r}", value, declared.type)

    def event(self, name: str, data: Mapping[str, Any]) -> None:
        self._open(f"event {name!r}")
        self.events.append((name, data))
        known = {f"{self._plugin.name}.{local}": event for local, event in self._plugin.events.items()}
        declared: EventKind | None = known.get(name)
        if declared is None:
            self.problems.append(f"event {name!r} is reported and not declared; {nearest(name, known)}")
            return
        self._fits(f"event {name!r}", data, Type("record", name, fields=declared.fields))

    def _hears(self, word: str, attempt: str) -> RefereedAttempt | None:
        """Record a report about an attempt; return None for an unknown attempt."""
        known = self._known(word, attempt)
        if known is not None:
            if known.ended:
                self.problems.append(f"{attempt} reports {word!r} after its end {known.reports}")
            known.reports.append(word)
        return known

    def _known(self, word: str, attempt: str) -> RefereedAttempt | None:
        self._open(f"{word!r} of {attempt}")
        known = self.attempts.get(attempt)
        if known is None:
            self.problems.append(f"{word!r} is reported of {attempt!r}, an attempt that was never started")
        return known

    def _open(self, what: str) -> None:
        if self.closed:
            self.problems.append(f"{what} is reported after close")

    def _operation(self, attempt: RefereedAttempt) -> Operation:
        return self._plugin.operations[attempt.operation]

    def _fits(self, what: str, value: Any, kind: Type) -> None:
        found = problems(value, kind, Notation.DATA)[:1]
        self.problems.extend(f"{what}: {problem.at()}" for problem in found)
