"""A run that violates a property as a scenario that does so too, with as little in it as can be.

The run is written as a scenario of what was recorded up to the violation. Then whatever can be left out is
left out, as long as the same property is violated: targets, faults of servers, happenings, settings, digits.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from lupin_engine.errors import LupinError, UsageError
from lupin_engine.machine import Start, Step
from lupin_engine.properties import INVARIANTS, STANDSTILL
from lupin_engine.replay import RunRecord, duration, script_of, yaml_text
from lupin_engine.sim import (
    Ask,
    ComeBack,
    Effect,
    End,
    Happen,
    Leave,
    Missions,
    Restart,
    Run,
    Script,
    SetClock,
    Tell,
    load_scenario_text,
    mission_name,
)

#: To how many digits times are tried, and how many scenarios at most.
_DIGITS, MOST_TRIES = (1, 3, 6, 12), 400
#: The same where each is a run of thousands of steps.
_FEW_TRIES = 40
#: What a simulation has of a mission: the parts of a scenario file.
Parts = Mapping[str, Any]
_SECONDS = re.compile(r"([0-9.]+) s")


class Minimiser:
    """Makes one scenario smaller; `tries` counts the scenarios that were run."""

    def __init__(self, name: str, promise: str, file: Path, mission: Path, missions: Missions) -> None:
        """Make one for a property.

        Args:
            name: the property.
            promise: its sentence.
            file: where the scenario will stand.
            mission: the mission's file.
            missions: has its chart.
        """
        self._name = name
        self._promise = promise
        self._file = file
        self._mission = mission
        self._missions = missions
        #: What the servers of a circle without time say to every attempt.
        self._circle: list[dict[str, Any]] = []
        # A run in which time stands still is a long one.
        self._most = MOST_TRIES if name != STANDSTILL else _FEW_TRIES
        self.tries = 0

    def text(self, recording: RunRecord, script: Script) -> str:
        """Return the text of a scenario that fails by the property, and by nothing else.

        Args:
            recording: the run up to the violation.
            script: what it was a run of.

        Raises:
            UsageError: what was recorded does not violate it when it is run again.
        """
        chart = self._missions.chart(self._mission)
        name = mission_name(self._mission, self._file, self._missions)
        for digits in _DIGITS:
            parts = script_of(recording, name, self._promise, chart, digits)
            when = list(_happened(script, recording.steps[-1].time, digits))
            parts |= {"request": script.request, "when": when}
            parts["limit"] = f"{math.ceil(recording.steps[-1].time) + 1} s"
            parts.pop("start", None)
            if self._name == STANDSTILL:
                parts = self._standing(parts, recording.steps)
            run = self._violating(parts)
            if run is not None and run.unfired:
                never = {one.number for one in run.unfired}
                parts["when"] = [one for number, one in enumerate(when) if number not in never]
                run = self._run(parts)
            if run is not None:
                break
        else:
            raise UsageError(f"no scenario was written: as a scenario the run does not violate {self._name}")
        parts = dict(self._smaller(parts))
        run = self._run(parts)
        assert run is not None, "what was kept violates the property"
        written = {key: said for key, said in parts.items() if said}
        if all(when.get("nth") != "every" for when in parts["when"]):
            written.pop("limit")  # what is not begun again ends by itself
        return self._text(written, _expected(run, self._name))

    def _standing(self, parts: Parts, steps: Sequence[Step]) -> dict[str, Any]:
        """Let the servers of a circle without time go on with what they said last, as long as it lasts."""
        begun = [(step.time, c.operation) for step in steps for c in step.commands if isinstance(c, Start)]
        circle = {operation for time, operation in begun if time == steps[-1].time}
        self._circle, mocks = [], []
        for mock in parts.get("mocks", ()):
            then = mock["then"]
            if mock["do"] in circle:
                before = sum(1 for time, name in begun if name == mock["do"] and time < steps[-1].time)
                usual, _ = Counter(map(repr, then[before:])).most_common(1)[0]
                lasting = next(one for one in then[before:] if repr(one) == usual)
                self._circle.append({"do": mock["do"], "then": lasting})
                then = then[:before]
            mocks += [{**mock, "then": then}] if then else []
        return {**parts, "mocks": mocks}

    def _text(self, parts: Parts, expected: Parts) -> str:
        mocks = [*(mock for mock in parts.get("mocks", ()) if mock["then"]), *self._circle]
        kept = {key: said for key, said in parts.items() if key != "mocks"}
        return yaml_text({**kept, **({"mocks": mocks} if mocks else {}), "expect": expected})

    def _run(self, parts: Parts) -> Run | None:
        """Run a scenario; None when it does not violate the property, or not everything in it happens."""
        run = self._violating(parts)
        return run if run is not None and not run.unfired else None

    def _violating(self, parts: Parts) -> Run | None:
        """Run a scenario; None when it does not violate the property, or cannot be run."""
        self.tries += 1
        with suppress(LupinError):
            run = load_scenario_text(self._text(parts, {}), self._file, self._missions).run()
            if any(name == self._name for _, name, _ in run.violated):
                return run
        return None

    def _smaller(self, parts: Parts) -> Parts:
        before: Parts = {}
        while parts != before and self.tries < self._most:
            before = parts
            parts = self._fewer_pieces(parts)
            for candidates in (_plainer, _earlier):
                parts = self._first(parts, candidates)
        return parts

    def _first(self, parts: Parts, candidates: Callable[[Parts], Iterable[Parts]]) -> Parts:
        """Take every candidate that does, one after the other; each is made of what was kept before."""
        index = 0
        while self.tries < self._most:
            found = next(_after(candidates(parts), index), None)
            if found is None:
                break
            if found != parts and self._run(found) is not None:
                parts = found
            else:
                index += 1
        return parts

    def _fewer_pieces(self, parts: Parts) -> Parts:
        """Leave out targets, faults and happenings, first many at once, then each (delta debugging)."""
        size = max(1, len(_pieces(parts)) // 2)
        while size and self.tries < self._most:
            at = 0
            while at < len(_pieces(parts)) and self.tries < self._most:
                fewer = _without(parts, _pieces(parts)[at : at + size])
                if fewer != parts and self._run(fewer) is not None:
                    parts = fewer
                else:
                    at += size
            size //= 2
        return parts


def _happened(script: Script, until: float, digits: int) -> Iterator[dict[str, Any]]:
    """Yield what a script may let happen until a time (s), as scenarios write it."""
    for one in script.happenings:
        if one.after > until:
            continue
        nth = {"nth": one.nth or "every"} if one.nth != 1 else {}
        start = {"on": one.state} if one.state else {"start_of": one.operation} if one.operation else None
        after = {"after" if start else "at": duration(one.after, digits)}
        yield {**(start or {}), **(nth if start else {}), **after, **_written(one.effect)}


def _written(effect: Effect) -> dict[str, Any]:
    match effect:
        case Ask(event, data) | Happen(event, data):
            word = "request" if isinstance(effect, Ask) else "event"
            return {word: {event: dict(data)} if data else event}
        case Tell(value, is_now):
            return {"value": {value: is_now}}
        case End(operation, code, detail, result):
            told = {"do": operation, "code": code, "detail": detail, "done": dict(result)}
            return {"fail" if code else "finish": {key: found for key, found in told.items() if found}}
        case Leave(operation):
            return {"server_gone": operation}
        case ComeBack(operation):
            return {"server_back": operation}
        case SetClock(to):
            return {"clock": to}
        case Restart(after):
            return {"restart": f"{after:g} s"}
    raise AssertionError(f"no scenario says {effect}")


def _after(candidates: Iterable[Parts], index: int) -> Iterator[Parts]:
    for number, candidate in enumerate(candidates):
        if number >= index:
            yield candidate


#: An element of a list that is asked for, a fault of a mock, or something that happens: which part of a
#: scenario, the name of the field or the number in the part, and the number of the element or outcome.
_Piece = tuple[str, str | int, int]


def _pieces(parts: Parts) -> list[_Piece]:
    lists = {name: given for name, given in parts.get("request", {}).items() if isinstance(given, list)}
    elements = [("request", name, index) for name, given in lists.items() for index in range(len(given))]
    mocks = [
        ("mocks", number, index)
        for number, mock in enumerate(parts.get("mocks", ()))
        for index, outcome in enumerate(mock["then"])
        if outcome != "done"
    ]
    return [*elements, *mocks, *(("when", number, 0) for number in range(len(parts.get("when", ()))))]


def _without(parts: Parts, pieces: Sequence[_Piece]) -> Parts:
    gone = set(pieces)
    request = {
        name: [one for i, one in enumerate(given) if ("request", name, i) not in gone] or given[:1]
        if isinstance(given, list)
        else given
        for name, given in parts.get("request", {}).items()
    }
    mocks = []
    for number, mock in enumerate(parts.get("mocks", ())):
        then = ["done" if ("mocks", number, i) in gone else one for i, one in enumerate(mock["then"])]
        while then and then[-1] == "done":
            then.pop()
        mocks += [{**mock, "then": then}] if then else []
    when = [one for number, one in enumerate(parts.get("when", ())) if ("when", number, 0) not in gone]
    return {**parts, "request": request, "mocks": mocks, "when": when}


def _plainer(parts: Parts) -> Iterator[Parts]:
    """Yield the scenario without a setting, and with one fault or time that says less."""
    if parts.get("seed"):
        yield {**parts, "seed": 0}
    yield {key: said for key, said in parts.items() if key != "clock"}
    for name in parts.get("parameters", {}):
        yield {**parts, "parameters": {key: said for key, said in parts["parameters"].items() if key != name}}
    yield {
        **parts,
        "mocks": [{**mock, "then": list(map(_untimed, mock["then"]))} for mock in parts.get("mocks", ())],
    }
    for number, mock in enumerate(parts.get("mocks", ())):
        for index, outcome in enumerate(mock["then"]):
            for plainer in _said_with_less(outcome) if isinstance(outcome, Mapping) else ():
                then = [*mock["then"][:index], plainer, *mock["then"][index + 1 :]]
                yield _exchanged(parts, "mocks", number, {**mock, "then": then})
    for number, when in enumerate(parts.get("when", ())):
        for plainer in _said_with_less(when, ("after", "nth", "at")):
            yield _exchanged(parts, "when", number, plainer)


def _untimed(outcome: Any) -> Any:
    """Return an outcome that takes as long as its plugin's mock does."""
    kept = {word: said for word, said in outcome.items() if word != "after"} if outcome != "done" else {}
    return kept or "done"


def _said_with_less(thing: Mapping[str, Any], words: Sequence[str] = ()) -> Iterator[Any]:
    """Yield a mapping without one of its words, or with a number rounded."""
    for word, value in thing.items():
        least = len(thing) > 1 and word != "at"
        if least and (not words or word in words):
            yield {key: value for key, value in thing.items() if key != word}
        found = _SECONDS.fullmatch(value) if isinstance(value, str) else None
        for digits in (0, 1):
            rounded = f"{round(float(found[1]), digits):g} s" if found else value
            if rounded != value:
                yield {**thing, word: rounded}


def _earlier(parts: Parts) -> Iterator[Parts]:
    """Yield the scenario with a fault or a happening at one of the first chances that it has."""
    for number, mock in enumerate(parts.get("mocks", ())):
        if mock["then"][:1] == ["done"]:
            yield _exchanged(parts, "mocks", number, {**mock, "then": mock["then"][1:]})
    for number, when in enumerate(parts.get("when", ())):
        if when.get("nth") == "every":
            yield _exchanged(parts, "when", number, {key: said for key, said in when.items() if key != "nth"})
        found = _SECONDS.fullmatch(when.get("at", ""))
        for share in (0.1, 0.25, 0.5, 0.75) if found is not None and float(found[1]) > 1.0 else ():
            sooner = duration(float(found[1]) * share if found else 0.0, 1)
            yield _exchanged(parts, "when", number, {**when, "at": sooner})


def _exchanged(parts: Parts, key: str, number: int, new: Any) -> Parts:
    return {**parts, key: [new if at == number else old for at, old in enumerate(parts[key])]}


def _expected(run: Run, name: str) -> dict[str, Any]:
    """Return what must be said so that nothing but the property `name` fails: refusals, broken invariants."""
    refused = [
        {"request": step.event.name, "code": step.refusal.code}
        for step in run.history.refused
        if step.refusal
    ]
    broken = [] if name == INVARIANTS else [invariant for _, invariant in run.history.broken]
    found = {"refused": refused, "broken": broken}
    return {key: value for key, value in found.items() if value}
