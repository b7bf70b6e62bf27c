"""What plugins tell against what their catalog declares: the last look before a mission sees it."""

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
    """Return an answer or an event of a plugin as it is; one that breaks its declaration, as what that means.

    A wrong result is a failure of its attempt: nobody would hear of its end otherwise, and a mission that
    works with what is not a number would drive by it. A wrong event is not taken in. Live values are the
    machine's own matter, which knows their ranges.
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


def _misfits(told: Any, declared: Mapping[str, Type]) -> Iterator[str]:
    """Yield what keeps fields from being the declared ones."""
    if not isinstance(told, Mapping):
        yield f"fields are expected, got {type(told).__name__}"
        return
    for name, kind in declared.items():
        if name in told:
            yield from (problem.at(name) for problem in problems(told[name], kind, Notation.DATA))
        else:
            yield f"{name}: left out"
