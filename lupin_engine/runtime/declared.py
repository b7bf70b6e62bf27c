"""Checks results and events of plugins against their catalog before a mission sees them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from lupin_engine.machine import event as events
from lupin_engine.machine.event import Event
from lupin_engine.machine.memory import Attempt
from lupin_engine.plugin.registry import Catalog
from lupin_engine.plugin.types import Notation, Type, problems

#: A driver raised or broke its declaration, or the mission names a plugin that has no driver here.
DRIVER_CODE = "driver_error"
#: The event of a driver that failed in what nobody waits for; it is there to be found in the record.
DRIVER_FAILED = "driver.failed"


def as_declared(event: Event, catalog: Catalog, attempts: Mapping[str, Attempt]) -> Event:
    """Return a plugin's event unchanged, or the failure that stands for one that breaks its declaration.

    A wrong result becomes a failure of its attempt, so that the attempt ends and no motion follows from a
    value that is no number. A wrong event is replaced by `driver.failed`. Live values pass: the machine
    checks them against their ranges.
    """
    ends = event.name in ("attempt.done", "attempt.cancelled") and isinstance(event.data, Mapping)
    if ends and (event.name == "attempt.done" or "result" in event.data):
        return _answer(event, catalog, attempts)
    happening = catalog.events.get(event.name)
    wrong = next(_misfits(event.data, happening.fields), "") if happening is not None else ""
    return Event(DRIVER_FAILED, {"command": event.name, "detail": wrong}) if wrong else event


def _answer(event: Event, catalog: Catalog, attempts: Mapping[str, Attempt]) -> Event:
    attempt = attempts.get(str(event.data.get("attempt")))
    operation = catalog.operations.get(attempt.operation) if attempt is not None else None
    if attempt is None or operation is None:
        return event
    wrong = next(_misfits(event.data.get("result"), operation.result), "")
    if not wrong:
        return event
    detail = f"{attempt.operation} answered what it does not declare: {wrong}"
    return events.failed(attempt.id, DRIVER_CODE, detail)


def _misfits(data: Any, declared: Mapping[str, Type]) -> Iterator[str]:
    """Yield the differences between fields and their declaration."""
    if not isinstance(data, Mapping):
        yield f"fields are expected, got {type(data).__name__}"
        return
    for name, kind in declared.items():
        if name in data:
            yield from (problem.at(name) for problem in problems(data[name], kind, Notation.DATA))
        else:
            yield f"{name}: left out"
