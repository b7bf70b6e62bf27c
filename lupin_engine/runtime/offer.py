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


class _DeclaredField(TypedDict):
    name: str
    type: str
    kind: Annotated[str, Literal["bool", "integer", "number", "text", "name", "list", "record", "any"]]
    required: bool


class FieldRecord(_DeclaredField, total=False):
    """A field of a request, with a type and its base unit.

    `kind` and the fields that follow from it describe the elements of a list: `name` is looked up by a
    plugin. A computed default is given as it would be now, and as its expression (`computed`). `at_most`
    limits the number of elements of a list.
    """

    summary: str
    unit: str
    allowed: list[str]
    pattern: str
    example: str
    default: Any
    computed: str
    minimum: float
    maximum: float
    at_most: float
    distinct: bool
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
    if field.default is not None:
        found["default"] = _default(field, machine, now)
        if not isinstance(field.default, Constant):
            found["computed"] = field.default.source
    single = field.type.item or field.type
    low = single.minimum if field.minimum is None else field.minimum
    most = field.type.maximum if field.type.item else None
    more = {
        "summary": field.summary or None,
        "minimum": low,
        "maximum": single.maximum,
        "at_most": most,
        "distinct": field.type.distinct or None,
        "may_be_empty": None if field.not_empty is None else False,
    }
    found |= {name: value for name, value in more.items() if value is not None}
    return cast(FieldRecord, found)


def _type(kind: Type) -> dict[str, Any]:
    inner = kind.item or kind
    found: dict[str, Any] = {"type": kind.name, "kind": inner.kind}
    if inner.unit:
        found["unit"] = inner.unit
    if inner.values:
        found["allowed"] = list(inner.values)
    if inner.pattern:
        found |= {"pattern": inner.pattern, "example": inner.example}
    return found


def _default(field: Field, machine: Machine, now: float) -> Any:
    """Return the default of a field now, or None while it cannot be evaluated."""
    assert field.default is not None
    try:
        return field.default.evaluate(machine.scope.at("", now))
    except Exception:  # an input that is not known yet, or whatever a plugin's function raises
        return None
    finally:
        machine.scope.clear_event()
