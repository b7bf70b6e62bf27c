"""The words of a scenario file: what is simulated, what happens meanwhile, and what is expected of it.

As in mission files, every mapping remembers where it was read. What names mean is looked up in `scenario`,
against the chart and the catalog.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from lupin_engine.chart.documents import Node, Written


def _to_list(value: Any) -> Any:
    return value if isinstance(value, list) else [value]


class OutcomeNode(Node):
    """How one attempt ends; nothing said: done, as the plugin's mock does it. Short: `done`, `never`."""

    done: dict[str, Any] | None = Field(None, description="fields of the result, over the mock's")
    fail: str | None = Field(None, description="code of the operation")
    detail: str = Field("", description="free text beside the code")
    never: bool = Field(False, description="accepted, and never heard of again")
    after: Written = Field(None, description="duration from acceptance to the end")
    accepted: Written = Field(None, description="duration from the request to its acceptance, or `never`")
    cancel: Literal["ends", "ignored", "unconfirmed"] = Field("ends", description="what a cancel does")
    progress: str = Field("", description="what the server says when it has accepted")

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        if data == "done":
            return {}
        return {"never": True} if data == "never" else data


Outcomes = Annotated[list[OutcomeNode], BeforeValidator(_to_list)]


class MockNode(Node):
    """What attempts of an operation come to: one outcome for all, or a list, one for each in turn."""

    do: str = Field(description="operation, as plugin.name")
    with_: dict[str, Any] = Field({}, alias="with", description="arguments that an attempt must have")
    target: str | None = Field(None, description="the current target that an attempt must be for")
    then: Outcomes = Field(description="what happens")

    @property
    def in_turn(self) -> bool:
        """Whether the outcomes are a list: one for each attempt, and then the plugin's mock again."""
        return isinstance(self._raw["then"], list)


class RequestNode(Node):
    """A request, with what it carries. Short: its name."""

    name: str = Field(description="mission.start or operator.NAME")
    data: dict[str, Any] = Field({}, description="what it carries")

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        if isinstance(data, str):
            return {"name": data}
        if isinstance(data, dict) and len(data) == 1:
            ((name, fields),) = data.items()
            if hasattr(data, "model"):
                data.model = None
            return {"name": name, "data": fields or {}}
        return data


class EndNode(Node):
    """The newest attempt of an operation fails, or ends well."""

    do: str = Field(description="operation, as plugin.name")
    code: str = Field("", description="code of the operation")
    detail: str = Field("", description="free text beside the code")

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        return {"do": data} if isinstance(data, str) else data


class WhenNode(Node):
    """Something that happens: at a time, or when a state is entered."""

    at_: Written = Field(None, alias="at", description="duration from the start")
    on: str | None = Field(None, description="state that is entered")
    nth: int = Field(1, ge=1, description="which of its entries")
    after: Written = Field(None, description="duration from that entry")
    request: RequestNode | None = Field(None, description="an operator's request")
    value: dict[str, Any] | None = Field(None, description="live values and what they become")
    fail: EndNode | None = Field(None, description="an operation under way fails")
    finish: EndNode | None = Field(None, description="an operation under way ends well")


class RefusedNode(Node):
    """A request that is refused. Short: its code."""

    code: str = Field(description="why")
    request: str | None = Field(None, description="which request")
    text: str | None = Field(None, description="a piece of what the operator is told")

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        return {"code": data} if isinstance(data, str) else data


class ExpectNode(Node):
    """What must come of it. What is not named is not looked at, refusals excepted: there must be none."""

    lifecycle: list[str] | None = Field(None, description="published states, all of them, in order")
    passes: list[str] = Field([], description="states entered in this order, others between them")
    never: list[str] = Field([], description="states that are not entered")
    visits: list[str] | None = Field(
        None, description="'TARGET STATUS' or 'TARGET STATUS CODE' of every target"
    )
    published: list[str] | None = Field(None, description="the same, in the order of publication")
    refused: list[RefusedNode] = Field([], description="refused requests, all of them, in order")
    final: str | None = Field(None, description="published state at the end")
    paused: bool | None = Field(None, description="whether it waits for the operator at the end")
    last_error: str | None = Field(None, description="code reported last; empty: none")
    counts: dict[str, int] = Field({}, description="how often an operation was started or an action done")
    dropped: int | None = Field(None, description="results that came when nobody waited for them")
    within: Written = Field(None, description="longest duration")
    at_least: Written = Field(None, description="shortest duration")


class ScenarioNode(Node):
    """A scenario: one mission, a script, and what is expected."""

    scenario: str = Field(description="one sentence: what is promised")
    mission: str = Field(description="mission, by name or file")
    request: dict[str, Any] = Field({}, description="what the request carries")
    parameters: dict[str, Written] = Field({}, description="settings")
    start: Literal["ready", "never"] = Field(
        "ready", description="whether the mission is started when possible"
    )
    limit: Written = Field(None, description="virtual time after which the simulation stops")
    mocks: list[MockNode] = Field([], description="what operations come to")
    when: list[WhenNode] = Field([], description="what happens meanwhile")
    expect: ExpectNode = Field(description="what must come of it")
