"""Prints the records that an orchestrator and the gateway publish as JSON, as types for the console.

    .venv/bin/python tools/records.py > console/src/records.ts

An interface has the fields of its dataclass or TypedDict. Where the encoder of a class writes it otherwise,
`WRITTEN` says so; tests/console/test_records.py holds all of it against the records of simulated runs.
"""

from __future__ import annotations

import enum
import inspect
import json
import sys
import types
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints, is_typeddict

from lupin_engine.machine import Refusal, Step, View
from lupin_engine.runtime.explanation import ExplanationRecord
from lupin_engine.runtime.offer import MissionsRecord
from lupin_engine.runtime.possible import PossibleRecord
from lupin_engine.runtime.record import COMMAND_NAMES
from lupin_gateway.guard import RobotRecord
from lupin_gateway.motion import BaseRecord
from lupin_gateway.people import NotificationsRecord, PeopleRecord
from lupin_gateway.stop import StopsRecord
from lupin_ros.service.chart_record import ChartRecord
from lupin_ros.service.reports import PublishedPossible, StepRecord
from lupin_ros.service.simulated import SimulationRecord

HEAD = """\
// Made by tools/records.py from the classes of the engine. Do not edit it: make it anew.
//
// Records as they are published in JSON. A field with `?` may be left out: it is empty then, or the record is
// of an earlier version, because recordings are kept for long."""
#: The records of topics, and of answers to a page.
ROOTS: Sequence[type] = (
    *(StepRecord, PublishedPossible, MissionsRecord, ChartRecord, ExplanationRecord, SimulationRecord),
    *(StopsRecord, BaseRecord, PeopleRecord, NotificationsRecord, RobotRecord),
)


@dataclass(frozen=True)
class Written:
    """How a class is written otherwise than field by field.

    `fields` have another type in a record than in the class, or are there only; None: they are left out.
    `others` says what further fields there are, of any name.
    """

    fields: Mapping[str, Any] = field(default_factory=dict)
    may_be_missing: Sequence[str] = ()
    others: str = ""


WRITTEN: Mapping[type, Written] = {
    Step: Written(
        {
            "event": str,
            "data": Mapping[str, Any],
            "accepted": bool,
            "refusal": Refusal,
            "why": tuple[str, ...],
            "trail": None,
        },
        may_be_missing=("data", *(each.name for each in fields(Step) if each.default is not MISSING)),
    ),
    View: Written(
        {"holds": Mapping[str, str], "counts": None},
        may_be_missing=("countdowns",),
        others="How many visits ended in each outcome, under the names that the profile has.",
    ),
    PossibleRecord: Written(may_be_missing=("fields",)),
    ChartRecord: Written(may_be_missing=("problem",)),
    **{kind: Written({"command": Literal[name]}) for kind, name in COMMAND_NAMES.items()},
}


@dataclass(frozen=True)
class Member:
    """A field of an interface."""

    type: str
    may_be_missing: bool


def interfaces() -> dict[type, dict[str, Member]]:
    """Return the members of every interface, the roots first."""
    found: dict[type, dict[str, Member]] = {}
    waiting = list(ROOTS)
    while waiting:
        kind = waiting.pop(0)
        if kind not in found:
            found[kind] = {}
            for name, (hint, may_be_missing) in _told(kind).items():
                found[kind][name] = Member(in_typescript(hint), may_be_missing)
                waiting += _records_in(hint)
    return found


def _told(kind: type) -> dict[str, tuple[Any, bool]]:
    """Return the type of each field of a record, and whether it may be missing."""
    written = WRITTEN.get(kind, Written())
    hints = {**get_type_hints(kind, include_extras=True), **written.fields}
    missing = {*written.may_be_missing, *getattr(kind, "__optional_keys__", ())}
    return {name: (hint, name in missing) for name, hint in hints.items() if hint is not None}


def _records_in(hint: Any) -> list[type]:
    if is_typeddict(hint) or is_dataclass(hint):
        return [hint]
    inside = hint.__metadata__ if get_origin(hint) is Annotated else get_args(hint)
    return [kind for each in inside for kind in _records_in(each)]


def in_typescript(hint: Any) -> str:
    """Return a type of Python as it is in JSON, in TypeScript; of an annotated one, the annotation.

    Raises:
        TypeError: it has no form here.
    """
    origin, inside = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return in_typescript(hint.__metadata__[0])
    if origin is Literal:
        return " | ".join(map(json.dumps, inside))
    if origin in (Union, types.UnionType):
        return " | ".join(map(in_typescript, inside))
    if origin is list or (origin is tuple and inside[1:] == (...,)):
        return _array(in_typescript(inside[0]))
    if origin in (dict, Mapping) and inside[0] is str:
        return f"Readonly<Record<string, {in_typescript(inside[1])}>>"
    if is_typeddict(hint) or is_dataclass(hint):
        return str(hint.__name__)
    if isinstance(hint, type) and issubclass(hint, enum.Enum) and not issubclass(hint, int):
        return " | ".join(json.dumps(each.value) for each in hint)
    return _scalar(hint)


def _array(inner: str) -> str:
    return f"readonly ({inner})[]" if " | " in inner else f"readonly {inner}[]"


def _scalar(hint: Any) -> str:
    if hint is Any:
        return "unknown"
    if hint is type(None):
        return "null"
    for kind, name in ((bool, "boolean"), (int, "number"), (float, "number"), (str, "string")):
        if isinstance(hint, type) and issubclass(hint, kind):
            return name
    raise TypeError(f"tools/records.py: {hint} has no form in TypeScript; say in WRITTEN how it is written")


def module() -> str:
    """Return the module of TypeScript."""
    parts = [HEAD]
    parts += ["\n".join(_interface(kind, members)) for kind, members in interfaces().items()]
    return "\n\n".join(parts) + "\n"


def _interface(kind: type, members: Mapping[str, Member]) -> Iterator[str]:
    yield from _comment(inspect.getdoc(kind) or "")
    yield f"export interface {kind.__name__} {{"
    for name, member in members.items():
        yield f"  readonly {name}{'?' if member.may_be_missing else ''}: {member.type};"
    if others := WRITTEN.get(kind, Written()).others:
        yield f"  /** {others} */"
        yield "  readonly [other: string]: unknown;"
    yield "}"


def _comment(text: str) -> Iterator[str]:
    """Yield a comment for documentation."""
    lines = text.splitlines()
    if len(lines) == 1:
        yield f"/** {text} */"
        return
    yield "/**"
    yield from (f" * {line}".rstrip() for line in lines)
    yield " */"


if __name__ == "__main__":
    sys.stdout.write(module())
