"""Steps and views as plain JSON data, for the log, the journal and topics beside the contract; and back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, fields, is_dataclass
from types import MappingProxyType
from typing import Annotated, Any, get_type_hints

from pydantic import (
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    ValidationError,
    create_model,
    field_validator,
)
from pydantic_core.core_schema import ValidationInfo

from lupin_engine.chart.model import Chart
from lupin_engine.machine.event import CLOCK, Act, Cancel, Command, Event, Report, Start
from lupin_engine.machine.holds import all_holds
from lupin_engine.machine.step import Considered, Step, View
from lupin_engine.plugin.contract import classify
from lupin_engine.plugin.profile import START, Publish

#: What a command is called in a record.
COMMAND_NAMES: Mapping[type, str] = MappingProxyType(
    {Start: "start", Cancel: "cancel", Act: "act", Publish: "publish", Report: "report"}
)
#: The parts of a step that are recorded as they are; the trail is made again from the rest.
_WRITTEN = tuple(field.name for field in fields(Step) if field.name not in ("event", "trail"))


def step_record(step: Step) -> dict[str, Any]:
    """Return a step as JSON data; empty parts are left out."""
    record = {"event": step.event.name, "data": dict(step.event.data)}
    record |= {part: _plain(getattr(step, part)) for part in _WRITTEN}
    return {name: value for name, value in record.items() if value not in ([], {}, None)}


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_plain(each) for each in value]
    if type(value) in COMMAND_NAMES:
        return command_record(value)
    if isinstance(value, Considered):
        return str(value)
    return asdict(value) if is_dataclass(value) and not isinstance(value, type) else value


def command_record(command: Command) -> dict[str, Any]:
    """Return a command as JSON data, named by its kind."""
    # A mission that is ended may tell of thousands of targets: these are plain already, and not copied.
    if isinstance(command, Publish | Report):
        data = {each.name: getattr(command, each.name) for each in fields(command)}
    else:
        data = asdict(command)
    return {"command": COMMAND_NAMES[type(command)], **data}


def view_record(view: View, chart: Chart) -> dict[str, Any]:
    """Return a view as JSON data; its counts stand under the names that the profile has for them.

    `holds` are the held ones, each with the label of its code.
    """
    counts = {outcome.counter: view.counts.get(outcome.name, 0) for outcome in chart.profile.outcomes}
    record: dict[str, Any] = {}
    for name, value in asdict(view).items():
        record.update(counts if name == "counts" else {name: value})
    holds = all_holds(chart)
    codes = {name: holds[name].code for name in view.held}
    return {**record, "holds": {name: classify(code, chart.codes).label for name, code in codes.items()}}


# -- and back ---------------------------------------------------------------------------------------------


class _Data(BaseModel):
    """The required data of an event; more fields are allowed."""

    model_config = ConfigDict(strict=True)


class _AttemptData(_Data):
    attempt: str
    result: dict[str, Any] = {}


class _ProgressData(_AttemptData):
    detail: str


class _FailedData(_AttemptData):
    code: str


class _TimerData(_Data):
    owner: str


class _ValueData(_Data):
    name: str
    value: Any


class _ClockData(_Data):
    ahead: float


class _StartData(_Data):
    mission_type: str


#: Events whose data has a form.
_DATA: Mapping[str, type[_Data]] = MappingProxyType(
    {
        "value": _ValueData,
        CLOCK: _ClockData,
        START: _StartData,
        "attempt.progress": _ProgressData,
        "attempt.failed": _FailedData,
    }
)
#: The same for all other events of a family.
_FAMILIES: Mapping[str, type[_Data]] = MappingProxyType({"attempt": _AttemptData, "timer": _TimerData})
#: More seconds than any run has; beyond it, and where a number is none, times cannot be counted with.
_LATEST = 1e12


def _kind(command: Any) -> str | None:
    kind = command.get("command") if isinstance(command, Mapping) else None
    return kind if isinstance(kind, str) else None


class _StepBase(BaseModel):
    """The fields of a step's record that differ from the step's, or are optional in it."""

    event: str
    time: Annotated[float, Field(strict=True, gt=-_LATEST, lt=_LATEST)]
    sequence: int = 0
    data: dict[str, Any] = {}
    configuration: tuple[str, ...] = ()
    commands: tuple[
        Annotated[
            Annotated[Start, Tag("start")]
            | Annotated[Cancel, Tag("cancel")]
            | Annotated[Act, Tag("act")]
            | Annotated[Publish, Tag("publish")]
            | Annotated[Report, Tag("report")],
            Discriminator(_kind),
        ],
        ...,
    ] = ()

    @field_validator("data")
    @classmethod
    def _has_its_form(cls, data: dict[str, Any], info: ValidationInfo) -> dict[str, Any]:
        event = str(info.data.get("event"))
        form = _DATA.get(event) or _FAMILIES.get(event.partition(".")[0])
        if form is not None:
            form.model_validate(data)
        return data


_HINTS = get_type_hints(Step)
_OTHERS: dict[str, Any] = {
    field.name: (_HINTS[field.name], field.default)
    for field in fields(Step)
    if field.name not in (*_StepBase.model_fields, "trail", "why")
}
#: A step as `step_record` writes it; what was considered is for people only.
_StepRecord = create_model("_StepRecord", __base__=_StepBase, **_OTHERS)


def read_step(record: Any) -> Step:
    """Return a recorded step, without its trail and the candidates that were not taken.

    Raises:
        ValueError: a part of it has another shape than a record's; the text is the name of that part.
    """
    try:
        found = dict(_StepRecord.model_validate(record))
    except ValidationError as problem:
        raise ValueError(problem.errors()[0]["loc"][0]) from None
    return Step(event=Event(found.pop("event"), found.pop("data")), **found)
