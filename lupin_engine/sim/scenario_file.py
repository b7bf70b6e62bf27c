"""The vocabulary of a scenario file: the script of a simulation, and its expected result.

As in mission files, every mapping remembers its place. `scenario_reader` resolves the names, against the
chart and the catalog.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, GetJsonSchemaHandler, WithJsonSchema
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from lupin_engine.chart.documents import PropertyNode, Written
from lupin_engine.chart.nodes import VERSION_HELP, Node, Version, show, wrong_shape

#: The moment at which a simulation is over.
END = "end"
#: Which entry: every one.
EVERY = "every"


def _to_list(value: Any) -> Any:
    return value if isinstance(value, list) else [value]


def _to_questions(value: Any) -> Any:
    return [] if value == "" else value if value is None else _to_list(value)


@dataclass(frozen=True)
class NameOf:
    """Marks a field whose text, elements or keys are names of `what`; errors about them begin with `path`."""

    what: str
    path: str = ""


class IsDuration:
    """Marks a field that is a duration and no more."""


class IsClock:
    """Marks a field that is a date with a time of day."""


STATE = NameOf("state")
OPERATION = NameOf("operation")
_SECONDS = WithJsonSchema({"type": ["string", "integer"], "examples": ["5 s", "2 min"]})
#: `5 s`, or 0.
Duration = Annotated[Any, IsDuration(), _SECONDS]
#: `2026-11-22 22:00`.
WallTime = Annotated[
    str | None, IsClock(), WithJsonSchema({"type": "string", "examples": ["2026-11-22 22:00"]})
]
#: A duration, or `{between: [1 s, 3 s]}`: another one each time. More than two are quantiles.
Latency = Annotated[
    Any,
    WithJsonSchema(
        {
            "anyOf": [
                {"type": ["string", "integer"], "examples": ["5 s"]},
                {
                    "type": "object",
                    "properties": {"between": {"type": "array", "minItems": 2}},
                    "required": ["between"],
                    "additionalProperties": False,
                },
            ]
        }
    ),
]
#: Names, or one of them.
Names = Annotated[list[str], BeforeValidator(_to_list, json_schema_input_type=str | list[str])]


class ShortNode(Node):
    """A mapping for which a text may stand."""

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core_schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Describe both forms."""
        return {"anyOf": [{"type": "string"}, handler(core_schema)]}


def _named(data: Any) -> Any:
    """Read `NAME` and `{NAME: fields}` as a name with its data."""
    if isinstance(data, str):
        return {"name": data}
    if isinstance(data, dict) and len(data) == 1 and "name" not in data:
        ((name, fields),) = data.items()
        if hasattr(data, "model"):
            data.model = None
        return {"name": name, "data": fields or {}}
    return data


# -- mocks ---------------------------------------------------------------------------------------------


class OutcomeNode(ShortNode):
    """How one attempt ends; nothing said: done, as the plugin's mock does it. Short: `done`, `never`."""

    done: dict[str, Any] | None = Field(None, description="fields of the result, over the mock's")
    fail: str | None = Field(None, description="code of the operation")
    detail: str = Field("", description="free text beside the code")
    never: bool = Field(False, description="accepted, and never heard of again")
    after: Latency = Field(None, description="duration from acceptance to the end")
    accepted: Latency = Field(None, description="duration from the request to its acceptance, or `never`")
    cancel: Latency = Field(
        "ends",
        description="what a cancel does: `ends`, `ignored`, `refused`, `unconfirmed`, a duration to the end",
    )
    cut_short: dict[str, Any] | None = Field(
        None, description="fields of the result that a cancel gives, over the mock's; else it gives none"
    )
    progress: str = Field("", description="what the server says when it has accepted")
    any_of: list[OutcomeNode] | None = Field(None, description="one of these, by chance")
    weight: Annotated[Any, WithJsonSchema({"type": ["number", "string"]})] = Field(
        1, description="how likely this is beside the others of `any_of`, such as 3 or 20 %"
    )

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        if data == "done":
            return {}
        return {"never": True} if data == "never" else data


Outcomes = Annotated[list[OutcomeNode], BeforeValidator(_to_list)]


class MetresNode(Node):
    """Distances in metres."""

    between: list[float] = Field(
        description="the shortest, and the first that is too long", min_length=2, max_length=2
    )


class MockNode(Node):
    """The outcomes of an operation's attempts: one for all, or a list, one for each in turn."""

    do: str = Field(description="operation, as plugin.name")
    with_: dict[str, Any] = Field(
        default_factory=dict, alias="with", description="arguments that an attempt must have"
    )
    target: str | None = Field(None, description="the current target that an attempt must be for")
    metres: MetresNode | None = Field(None, description="how far an attempt must drive, as the crow flies")
    hour: int | None = Field(None, description="hour of the day in which an attempt begins", ge=0, le=23)
    then: Outcomes = Field(description="what happens")

    @property
    def in_turn(self) -> bool:
        """Whether the outcomes are a list: one for each attempt, and then the plugin's mock again."""
        return isinstance(self._raw["then"], list)


# -- what happens ----------------------------------------------------------------------------------------


class RequestNode(ShortNode):
    """A request with its fields. Short: its name, or its name with the fields: `{NAME: {...}}`."""

    name: str = Field(description="mission.start, operator.NAME or answer.CHOICE")
    data: dict[str, Any] = Field(default_factory=dict, description="what it carries")

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        return _named(data)


class EventNode(ShortNode):
    """An event of a plugin. Short: its name, or its name with the fields: `{NAME: {...}}`."""

    name: str = Field(description="event, as plugin.name")
    data: dict[str, Any] = Field(default_factory=dict, description="its fields")

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        return _named(data)


class EndNode(ShortNode):
    """The newest attempt of an operation fails, or ends well. Short: the operation."""

    do: str = Field(description="operation, as plugin.name")
    code: str = Field("", description="code of the operation")
    detail: str = Field("", description="free text beside the code")
    done: dict[str, Any] = Field(default_factory=dict, description="fields of the result, over the mock's")

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        return {"do": data} if isinstance(data, str) else data


class MomentNode(Node):
    """Expectations at one moment; only the named ones are checked."""

    state: Annotated[Names, STATE] = Field(default_factory=list, description="states that are active")
    not_state: Annotated[Names, STATE] = Field(default_factory=list, description="states that are not active")
    lifecycle: Annotated[str | None, NameOf("published state", "expect.lifecycle")] = Field(
        None, description="published state"
    )
    phase: Annotated[str | None, NameOf("phase", "expect.phase")] = Field(
        None, description="published phase; empty: none"
    )
    target: str | None = Field(None, description="the itinerary's current target; empty: none")
    paused: bool | None = Field(None, description="whether the mission waits for the operator")
    asked: Annotated[
        list[str] | None, BeforeValidator(_to_questions, json_schema_input_type=str | list[str] | None)
    ] = Field(None, description="questions that are open, all of them, in the order of asking; empty: none")
    held: Annotated[list[str] | None, NameOf("hold", "expect.held")] = Field(
        None, description="holds that are engaged, all of them, in their order"
    )
    last_error: str | None = Field(
        None, description="code reported last, alone or as `code: detail`; empty: none"
    )
    running: Annotated[list[str] | None, OPERATION] = Field(
        None, description="operations under way, all of them"
    )
    variables: Annotated[dict[str, Any], NameOf("variable", "expect.variables")] = Field(
        default_factory=dict, description="variables of the chart and their values"
    )


class RestartNode(ShortNode):
    """A restart of the orchestrator. Short: the duration."""

    after: Duration = Field(..., description="duration until another one is there")

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        if not isinstance(data, (str, dict)) and data is not True:  # a row of `chart.strictness`
            raise wrong_shape(f"expected a duration such as '5 s', got {show(data)}")
        return data if isinstance(data, dict) else {"after": data}


class WhenNode(Node):
    """Something that happens, or is looked at: at a time, on entering a state, when an operation starts."""

    at_: Annotated[Any, _SECONDS] = Field(
        None, alias="at", description="duration from the start; `end` to look at the end"
    )
    on: Annotated[str | None, STATE] = Field(None, description="state that is entered")
    start_of: Annotated[str | None, OPERATION] = Field(None, description="operation that is started")
    nth: Annotated[Any, WithJsonSchema({"type": ["integer", "string"]})] = Field(
        1, description="which of its entries or starts, counted from 1, or `every`"
    )
    after: Duration = Field(None, description="duration from that entry or start")
    request: RequestNode | None = Field(None, description="an operator's request")
    value: dict[str, Any] | None = Field(None, description="live values and what they become")
    event: EventNode | None = Field(None, description="what a plugin tells")
    fail: EndNode | None = Field(None, description="an operation under way fails")
    finish: EndNode | None = Field(None, description="an operation under way ends well")
    server_gone: Annotated[Names, OPERATION] = Field(
        default_factory=list, description="operations whose server is not heard of from now on"
    )
    server_back: Annotated[Names, OPERATION] = Field(
        default_factory=list, description="operations whose server answers again"
    )
    clock: WallTime = Field(None, description="the robot's clock is set, to a date and a time of day")
    restart: RestartNode | None = Field(
        None, description="the orchestrator is gone, and another one goes on from its journal, held"
    )
    expect: MomentNode | None = Field(None, description="what must be so then, after what happens here")


# -- what is expected ------------------------------------------------------------------------------------


class CountNode(Node):
    """An expected count, exact or within bounds. Short: a number."""

    at_least: int = Field(0, description="smallest number")
    at_most: int | None = Field(None, description="largest number")

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        is_number = isinstance(data, int) and not isinstance(data, bool)
        return {"at_least": data, "at_most": data} if is_number else data

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core_schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Describe both forms."""
        return {"anyOf": [{"type": "integer", "minimum": 0}, handler(core_schema)]}

    def __str__(self) -> str:
        if self.at_most is None:
            return f"at least {self.at_least}"
        if self.at_least == self.at_most:
            return str(self.at_least)
        return f"{self.at_least} to {self.at_most}" if self.at_least else f"at most {self.at_most}"


class PassNode(ShortNode):
    """A state that is entered after the one before it in the list. Short: its name."""

    state: Annotated[str, STATE] = Field(description="state")
    within: Duration = Field(None, description="longest duration since the one before, or since the start")
    at_least: Duration = Field(None, description="shortest duration since the one before")
    by: Duration = Field(None, description="latest time from the start")

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        return {"state": data} if isinstance(data, str) else data


class NeverNode(ShortNode):
    """A state that is not entered. Short: its name."""

    state: Annotated[str, STATE] = Field(description="state")
    after: Annotated[str | None, STATE] = Field(None, description="not from the first entry of this state on")

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        return {"state": data} if isinstance(data, str) else data


class LeadsNode(Node):
    """Every entry of one state is followed by one of another."""

    from_: Annotated[str, STATE] = Field(alias="from", description="state")
    to: Annotated[str, STATE] = Field(description="state that follows each time, others between them")
    within: Duration = Field(None, description="longest duration between the two")


#: What a visit is called that has no outcome yet; the outcomes are those of the profile.
OPEN = "open"


class VisitNode(ShortNode):
    """The outcome of a target. Short: `TARGET STATUS` or `TARGET STATUS CODE`."""

    target: str = Field(description="target")
    status: Annotated[str, NameOf("status of a visit", "status")] = Field(description="status")
    code: str | None = Field(None, description="code; empty: none")
    detail: str | None = Field(None, description="a piece of the detail")
    reading: dict[str, Any] | None = Field(None, description="fields that the reading has")

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        if not isinstance(data, str):
            return data
        return dict(zip(("target", "status", "code"), data.split(maxsplit=2), strict=False))

    def __str__(self) -> str:
        parts = [self.target, self.status, self.code or "", repr(self.detail) if self.detail else ""]
        reading = f"with {dict(self.reading)}" if self.reading else ""
        return " ".join(filter(None, (*parts, reading)))


class RefusedNode(ShortNode):
    """A request that is refused. Short: its code."""

    code: str = Field(description="why")
    request: str | None = Field(None, description="which request")
    text: str | None = Field(None, description="a piece of what the operator is told")

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        return {"code": data} if isinstance(data, str) else data


class ExpectNode(Node):
    """The expected result; only the named parts are checked, with three exceptions: no request is refused,
    no invariant broken and no property violated unless it is said. With `only`, of these just its properties
    are checked.
    """

    lifecycle: Annotated[list[str] | None, NameOf("published state", "expect.lifecycle")] = Field(
        None, description="published states, all of them, in order"
    )
    phases: Annotated[list[str], NameOf("phase", "expect.phases")] = Field(
        default_factory=list, description="published phases in this order, others between them"
    )
    passes: list[PassNode] = Field(
        default_factory=list, description="states entered in this order, others between them"
    )
    leads_to: list[LeadsNode] = Field(
        default_factory=list, description="states that follow others every time"
    )
    never: list[NeverNode] = Field(default_factory=list, description="states that are not entered")
    visits: list[VisitNode] | None = Field(None, description="what became of every target of the itineraries")
    published: list[VisitNode] | None = Field(None, description="the same, in the order of publication")
    statuses: Annotated[dict[str, CountNode], NameOf("status", "expect.statuses")] = Field(
        default_factory=dict, description="how often each status was published"
    )
    refused: list[RefusedNode] = Field(
        default_factory=list, description="refused requests, all of them, in order"
    )
    holds: Annotated[list[str] | None, NameOf("hold", "expect.holds")] = Field(
        None, description="holds that were engaged, all of them, in order"
    )
    broken: Annotated[list[str], NameOf("invariant", "expect.broken")] = Field(
        default_factory=list, description="invariants that were broken, all of them, in order"
    )
    violated: Annotated[list[str], NameOf("property", "expect.violated")] = Field(
        default_factory=list, description="properties that were violated, all of them, in order"
    )
    only: Annotated[
        list[str] | None,
        BeforeValidator(_to_questions, json_schema_input_type=str | list[str] | None),
        NameOf("property", "expect.only"),
    ] = Field(
        None,
        description="properties that must hold; others may be violated, and requests refused",
    )
    final: Annotated[str | None, NameOf("published state", "expect.final")] = Field(
        None, description="published state at the end"
    )
    paused: bool | None = Field(None, description="whether it waits for the operator at the end")
    last_error: str | None = Field(
        None, description="code reported last, alone or as `code: detail`; empty: none"
    )
    counts: Annotated[dict[str, CountNode], NameOf("operation or action", "expect.counts")] = Field(
        default_factory=dict, description="how often an operation was started or an action done"
    )
    updates: Annotated[dict[str, CountNode], NameOf("operation", "expect.updates")] = Field(
        default_factory=dict, description="how often an operation was updated while it ran"
    )
    cancels: Annotated[dict[str, CountNode], NameOf("operation", "expect.cancels")] = Field(
        default_factory=dict, description="how often an operation was cancelled"
    )
    dropped: CountNode | None = Field(None, description="results that came when nobody waited for them")
    notes: list[str] = Field(
        default_factory=list, description="pieces of what the machine noted, in any order"
    )
    within: Duration = Field(None, description="longest duration of the whole")
    at_least: Duration = Field(None, description="shortest duration of the whole")


class ScriptNode(Node):
    """A script: the request, the servers' answers, and the events meanwhile."""

    request: dict[str, Any] = Field(default_factory=dict, description="what the request carries")
    parameters: dict[str, Written] = Field(default_factory=dict, description="settings")
    seed: int = Field(0, description="what everything that comes by chance is drawn from")
    clock: WallTime = Field(
        None,
        description="date and time of day of the beginning, in the mission's zone; else 2026-01-01 00:00",
    )
    start: Literal["ready", "never"] = Field(
        "ready", description="whether the mission is started when possible"
    )
    limit: Duration = Field(None, description="virtual time after which the simulation stops")
    mocks: list[MockNode] = Field(default_factory=list, description="what operations come to")
    when: list[WhenNode] = Field(default_factory=list, description="what happens meanwhile")


class ScenarioNode(ScriptNode):
    """A scenario: one mission, a script, and the expected result."""

    ELSEWHERE = MappingProxyType(
        {"timeout": ("a scenario has no timeout", "write 'limit: 10 min', or 'within' under 'expect'")}
    )

    lupin: Version = Field(None, description=VERSION_HELP)
    scenario: str = Field(description="one sentence: what is promised")
    mission: str = Field(description="mission, by name or file")
    properties: dict[str, PropertyNode] = Field(
        default_factory=dict, description="what is true all the time, as missions write it, beside theirs"
    )
    expect: ExpectNode = Field(description="what must come of it")
