"""The words of a binding: a plugin without Python, for services that somebody offers over ROS already.

A binding stands in `bindings/` beside the missions and is named like its file. Words that missions have mean
the same here. What an operation talks to stands under one key (`service`) as name and type, so that actions
and topics can stand beside it.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, ClassVar, Literal

from pydantic import Field

from lupin_engine.chart.documents import CodeNode, Condition, Names, Node, Written, show, wrong_shape

#: The key that makes a file a binding.
KIND = "binding"

_LATER = "a binding cannot do this yet"


class ArgumentNode(Node):
    """What a mission hands to an operation."""

    type: str = Field(description="such as text, count, pose")
    summary: str = Field(description="one sentence for people: what it is for")
    default: Written = Field(None, description="value when a mission gives none; without it one must")


class ServiceNode(Node):
    """The service that an operation calls, once for each attempt."""

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        if isinstance(data, str):
            text = f"expected a mapping, got {show(data)}; write {{name: {data}, type: PACKAGE/srv/NAME}}"
            raise wrong_shape(text)
        return data

    name: str = Field(description="name of the service, such as /camera/take_photo")
    type: str = Field(description="its type as PACKAGE/srv/NAME, such as std_srvs/srv/Trigger")
    deadline: Written = Field(
        None,
        description="longest wait for an answer where the mission sets no shorter one, a duration; else 60 s",
    )


class ResultNode(Node):
    """A field of what an operation comes to; missions read it as event.NAME."""

    type: str = Field(description="such as text, count, duration")
    from_: Written = Field(alias="from", description="value, from `response`")


class BoundMockNode(Node):
    """What the operation does in a simulation when the scenario does not say."""

    after: Written = Field(None, description="duration from the call to the answer; otherwise none")
    result: dict[str, Written] = Field(
        default_factory=dict, description="every field of the result, with its value"
    )


class BoundOperationNode(Node):
    """An operation of a binding: which service it calls, with what, and what the answer means."""

    ELSEWHERE: ClassVar[Mapping[str, tuple[str, str]]] = MappingProxyType(
        {
            "type": ("the type belongs to the service", "write 'service: {name: ..., type: ...}'"),
            "params": ("what a mission hands over are arguments", "write 'arguments: {NAME: {...}}'"),
            "request": ("values are handed over by 'with'", "write 'with: {FIELD: VALUE}'"),
            "doc": ("a sentence for people is its summary", "write 'summary: ...'"),
            "guard": ("a guard belongs to a transition", "write 'done_when: CONDITION'"),
            "timeout": ("how long to wait is for the mission to say", "write it where the mission invokes"),
            "action": (f"{_LATER}: only services are bound", "write 'service: ...'"),
            "topic": (f"{_LATER}: only services are bound", "write 'service: ...'"),
        }
    )

    summary: str = Field(description="one sentence for people: what it does")
    arguments: dict[str, ArgumentNode] = Field(
        default_factory=dict, description="what missions hand over, by name"
    )
    service: ServiceNode = Field(description="service that is called")
    with_: dict[str, Written] = Field(
        default_factory=dict,
        alias="with",
        description="fields of the service's request, by name; what is not written stays empty or 0",
    )
    done_when: Condition = Field(
        description="condition on `response`: the operation succeeded; `true` where every answer means that"
    )
    result: dict[str, ResultNode] = Field(
        default_factory=dict, description="what missions get from the answer, by name"
    )
    code: str = Field(description="code that an attempt fails with: not done, no answer, or nobody there")
    detail: Written = Field(None, description="text beside the code, from `response`")
    uses: Names = Field(default_factory=list, description="what it needs for itself, such as base or arm")
    on_hold: Literal["cancel", "finish"] = Field(
        "finish",
        description="`cancel`: it moves the robot, a hold ends it and calls again on release; "
        "`finish`: its answer waits for the release",
    )
    mock: BoundMockNode | None = Field(None, description="how it is simulated; needed where it has a result")


class BindingNode(Node):
    """A plugin that is written down instead of programmed."""

    ELSEWHERE: ClassVar[Mapping[str, tuple[str, str]]] = MappingProxyType(
        {
            "service": ("a service belongs to an operation", "write 'operations: {NAME: {service: ...}}'"),
            "doc": ("a sentence for people is its summary", "write 'summary: ...'"),
            "actions": (f"{_LATER}", "write an operation"),
            "values": (f"{_LATER}: only services are bound", "write a plugin in Python"),
            "events": (f"{_LATER}: only services are bound", "write a plugin in Python"),
        }
    )

    binding: str = Field(description="name of the plugin that this makes, also that of its file")
    summary: str = Field(description="one sentence for people: what is connected")
    codes: dict[str, CodeNode] = Field(
        default_factory=dict, description="reasons that its operations fail with, by name"
    )
    operations: dict[str, BoundOperationNode] = Field(description="what missions can invoke, by name")


__all__ = [
    "KIND",
    "ArgumentNode",
    "BindingNode",
    "BoundMockNode",
    "BoundOperationNode",
    "ResultNode",
    "ServiceNode",
]
