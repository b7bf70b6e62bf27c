"""The mission catalogue: missions with the fields of their requests, and codes. Plain data, for displays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import PurePath
from typing import Annotated, Any, Literal, TypedDict, cast

from lupin_engine.chart.expressions.evaluation import Constant
from lupin_engine.chart.model import Field
from lupin_engine.machine.holds import all_holds
from lupin_engine.machine.machine import Machine
from lupin_engine.plugin.contract import ENGINE_CODES
from lupin_engine.plugin.profile import Rating, Stages
from lupin_engine.plugin.types import Type


class _DeclaredType(TypedDict):
    type: str
    kind: Annotated[str, Literal["bool", "integer", "number", "text", "name", "list", "record", "any"]]


class TypeRecord(_DeclaredType, total=False):
    """A type with its base unit.

    `kind` and the fields that follow from it describe the elements of a list: `name` is looked up by a
    plugin, and a record has `fields`. `at_most` limits the number of elements of a list.
    """

    unit: str
    allowed: list[str]
    pattern: str
    example: str
    minimum: float
    maximum: float
    at_most: float
    distinct: bool
    fields: dict[str, TypeRecord]


class _DeclaredField(TypeRecord):
    name: str
    required: bool


class FieldRecord(_DeclaredField, total=False):
    """A field of a request: a computed default is as it would be now, and its expression (`computed`)."""

    summary: str
    default: Any
    computed: str
    may_be_empty: bool


class OfferedMission(TypedDict):
    """A mission that can be started, its file's name, and the fields of its request."""

    mission: str
    file: str
    summary: str
    request: list[FieldRecord]


class CodeRecord(TypedDict):
    """The declaration of a code; severity 0 is information, 1 a warning, 2 an error."""

    label: str
    severity: int
    advice: str


class OutcomeRecord(TypedDict):
    """A way in which a visit can end; views have how many did under the name `counter`."""

    name: str
    counter: str
    word: str
    rating: Annotated[str, Rating]


class MissionsRecord(TypedDict):
    """The mission catalogue.

    `codes` are all, `holds` the code of each hold, also of the engine's own, `outcomes` the ends of a visit,
    `stages` the meaning of published states, `ends` the verb that ends a mission. `problems` are the errors
    in files that were not loaded.
    """

    missions: list[OfferedMission]
    problems: list[str]
    codes: dict[str, CodeRecord]
    holds: dict[str, str]
    outcomes: list[OutcomeRecord]
    stages: Annotated[dict[str, Any], Stages]
    ends: str


def missions_record(machine: Machine, now: float, problems: Sequence[str]) -> MissionsRecord:
    """Return the mission catalogue as JSON data."""
    chart, profile = machine.chart, machine.chart.profile
    return {
        "missions": offered(machine, now),
        "problems": list(problems),
        "codes": {
            name: {"label": code.label, "severity": code.severity, "advice": code.advice}
            for name, code in sorted({**ENGINE_CODES, **chart.codes}.items())
        },
        "holds": {name: hold.code for name, hold in all_holds(chart).items()},
        "outcomes": [
            {"name": one.name, "counter": one.counter, "word": one.word, "rating": one.rating.value}
            for one in profile.outcomes
        ],
        "stages": asdict(profile.stages),
        "ends": profile.verbs.get(profile.abort, ""),
    }


def offered(machine: Machine, now: float) -> list[OfferedMission]:
    """Return every mission with its file's name, its summary and the fields of its request, as JSON data."""
    return [
        {
            "mission": mission.name,
            "file": PurePath(mission.file).stem,
            "summary": mission.summary,
            "request": [_field(field, machine, now) for field in mission.request.values()],
        }
        for mission in machine.chart.missions.values()
    ]


def _field(field: Field, machine: Machine, now: float) -> FieldRecord:
    found: dict[str, Any] = {"name": field.name, **_type(field.type), "required": field.default is None}
    if (field.type.item or field.type).name in machine.scope.world.readers:
        found["kind"] = "name"
        found.pop("fields", None)
    if field.default is not None:
        found["default"] = _default(field, machine, now)
        if not isinstance(field.default, Constant):
            found["computed"] = field.default.source
    more = {
        "summary": field.summary or None,
        "minimum": field.minimum,
        "may_be_empty": None if field.not_empty is None else False,
    }
    found |= {name: value for name, value in more.items() if value is not None}
    return cast(FieldRecord, found)


def _type(kind: Type) -> dict[str, Any]:
    inner = kind.item or kind
    more = {
        "unit": inner.unit or None,
        "allowed": list(inner.values) or None,
        "pattern": inner.pattern or None,
        "example": inner.example if inner.pattern else None,
        "minimum": inner.minimum,
        "maximum": inner.maximum,
        "at_most": kind.maximum if kind.item else None,
        "distinct": kind.distinct or None,
        "fields": {name: _type(each) for name, each in inner.fields.items()} or None,
    }
    found = {"type": kind.name, "kind": inner.kind}
    return found | {name: value for name, value in more.items() if value is not None}


def _default(field: Field, machine: Machine, now: float) -> Any:
    """Return the default of a field now, or None while it cannot be evaluated."""
    assert field.default is not None
    try:
        return field.default.evaluate(machine.scope.at("", now))
    except Exception:  # an input that is not known yet, or whatever a plugin's function raises
        return None
    finally:
        machine.scope.clear_event()
