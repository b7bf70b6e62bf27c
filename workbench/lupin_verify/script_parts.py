"""Writes a script as the parts of a scenario's file: the inverse of reading one."""

from __future__ import annotations

from typing import Any

from lupin_engine.replay import duration
from lupin_engine.sim import (
    AnyOf,
    Ask,
    Between,
    ComeBack,
    Effect,
    End,
    Happen,
    Happening,
    Leave,
    MockOutcome,
    OnCancel,
    Restart,
    Rule,
    Scenario,
    Script,
    SetClock,
    SetValue,
)

#: The digits of times: the fewest that are exact.
DIGITS = (1, 3, 6, 12)
#: The default outcome of a server, and the default clock.
USUAL, NO_CLOCK = MockOutcome(), Script("").clock


def parts_of(scenario: Scenario) -> dict[str, Any]:
    """Return the parts of a scenario's file, without defaults."""
    script = scenario.script
    # A scenario without events that repeat ends by itself.
    limit = _seconds(script.limit) if any(one.nth == 0 for one in script.happenings) else ""
    parts = {
        "scenario": scenario.promise,
        "mission": scenario.node.mission,
        "request": script.request,
        "parameters": {name: scenario.node.parameters[name] for name in scenario.parameters},
        "seed": script.seed,
        "clock": script.clock if script.clock != NO_CLOCK else "",
        "limit": limit,
        "when": list(map(when_of, script.happenings)),
        "mocks": list(map(_mock, script.rules)),
    }
    return {key: said for key, said in parts.items() if said}


def when_of(one: Happening) -> dict[str, Any]:
    """Return an event and its time, as scenarios write it."""
    if not one.waits:
        return {"at": _seconds(one.after), **_effect(one.effect)}
    start = {"on": one.state} if one.state else {"start_of": one.operation}
    nth = {"nth": one.nth or "every"} if one.nth != 1 else {}
    return {**start, **nth, **({"after": _seconds(one.after)} if one.after else {}), **_effect(one.effect)}


def _effect(effect: Effect) -> dict[str, Any]:
    """Return an event, as scenarios write it."""
    match effect:
        case Ask(event, data) | Happen(event, data):
            word = "request" if isinstance(effect, Ask) else "event"
            return {word: {event: dict(data)} if data else event}
        case SetValue(value, is_now):
            return {"value": {value: is_now}}
        case End(operation, code, detail, result):
            fields = {"do": operation, "code": code, "detail": detail, "done": dict(result)}
            return {"fail" if code else "finish": {key: found for key, found in fields.items() if found}}
        case Leave(operation):
            return {"server_gone": operation}
        case ComeBack(operation):
            return {"server_back": operation}
        case SetClock(to):
            return {"clock": to}
        case Restart(after):
            return {"restart": True if after is None else f"{after:g} s"}
    raise AssertionError(f"no scenario says {effect}")


def _mock(rule: Rule) -> dict[str, Any]:
    """Return a server's outcomes, as scenarios write them."""
    usual, said = _words(USUAL), []
    for outcome in rule.outcomes:
        words = _words(outcome).items()
        said.append({word: value for word, value in words if value != usual[word]} or "done")
    return {"do": rule.operation, "then": said if rule.once else said[0]}


def _words(outcome: MockOutcome | AnyOf) -> dict[str, Any]:
    """Return the fields of an outcome, by the words of scenarios."""
    assert isinstance(outcome, MockOutcome), "what was recorded is not left to chance"
    ended = outcome.on_cancel is OnCancel.END
    return {
        "accepted": _seconds(outcome.accepted_after) or "never",
        "fail": outcome.code,
        "detail": outcome.detail,
        "done": dict(outcome.result),
        "never": outcome.never,
        "cut_short": outcome.cut_short,
        "after": _seconds(outcome.after),
        "cancel": _seconds(outcome.cancel_after) if ended else outcome.on_cancel.value,
        "progress": outcome.progress,
    }


def _seconds(time: float | Between | None) -> str | None:
    """Return a time as scenarios write it, with as many digits as it has."""
    assert not isinstance(time, Between), "what was recorded is not left to chance"
    if time is None:
        return None
    return duration(time, next((d for d in DIGITS if round(time, d) == time), DIGITS[-1]))
