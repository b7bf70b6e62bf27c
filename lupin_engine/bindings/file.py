"""The vocabulary of a binding: a plugin in YAML, for services, actions and topics that exist already.

A binding stands in `bindings/` beside the missions and is named like its file. Words that missions have mean
the same here. Name and type over ROS stand under one key (`service`, `action` or `topic`), the fields to send
always under `with`, and the expressions about an answer or a message under keys of their own.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, Field

from lupin_engine.chart.documents import (
    Bound,
    CodeNode,
    Condition,
    Names,
    ParameterNode,
    RecordTypes,
    Written,
)
from lupin_engine.chart.nodes import VERSION_HELP, Meaning, Named, Node, Version, show, wrong_shape


def _to_list(value: Any) -> Any:
    return value if isinstance(value, list) else [value]


#: The key that makes a file a binding.
KIND = "binding"


class ArgumentNode(Node):
    """An argument that missions give to an operation."""

    type: Annotated[str, Meaning.TYPE] = Field(description="such as text, count, pose")
    summary: str = Field(description="one sentence for people: what it is for")
    default: Written = Field(None, description="value when a mission gives none; without it one must")
    unit: Annotated[str | None, Meaning.UNIT] = Field(
        None, description="unit that `with` sees the number in, such as mm or deg; else the one it is kept in"
    )
    min: Bound = Field(None, description="smallest value")
    max: Bound = Field(None, description="largest value")


class EndpointNode(Node):
    """A service, action or topic, by name and type."""

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        if isinstance(data, str):
            instead = f"write {{name: {data}, type: PACKAGE/{cls.KIND}/NAME}}"
            raise wrong_shape(f"expected a mapping, got {show(data)}; {instead}")
        return data

    #: What its types are called in the middle, and itself by people.
    KIND: ClassVar[str]
    CALLED: ClassVar[str]
    #: A type of it, and a name.
    SUCH_AS: ClassVar[tuple[str, str]]

    name: str = Field(description="its name over ROS")
    type: str = Field(description="its type as PACKAGE/KIND/NAME")
    common: bool = Field(
        False, description="`true`: all robots of a ROS domain share it, its name follows no namespace"
    )


class ServiceNode(EndpointNode):
    """The service that an operation calls, once for each attempt."""

    KIND = "srv"
    CALLED = "a service"
    SUCH_AS = ("std_srvs/srv/Trigger", "/camera/take_photo")

    name: str = Field(description="name of the service, such as /camera/take_photo")
    type: str = Field(description="its type as PACKAGE/srv/NAME, such as std_srvs/srv/Trigger")
    deadline: Written = Field(
        None,
        description="longest wait for an answer where the mission sets no shorter one, a duration; else 60 s",
    )


class ActionServerNode(EndpointNode):
    """The action to which an operation sends a goal, one for each attempt."""

    KIND = "action"
    CALLED = "an action"
    SUCH_AS = ("nav2_msgs/action/NavigateToPose", "/sprayer/spray")

    name: str = Field(description="name of the action, such as /sprayer/spray")
    type: str = Field(description="its type as PACKAGE/action/NAME, such as nav2_msgs/action/NavigateToPose")


class TopicNode(EndpointNode):
    """The topic that is listened to, or written to."""

    KIND = "msg"
    CALLED = "a message"
    SUCH_AS = ("std_msgs/msg/Bool", "/sprayer/leak")

    name: str = Field(description="name of the topic, such as /sprayer/leak")
    type: str = Field(description="its type as PACKAGE/msg/NAME, such as std_msgs/msg/Bool")
    qos: Literal["reliable", "latched", "sensor"] = Field(
        "reliable",
        description="`reliable`: every message, 10 are kept; `latched`: the last one also for who comes "
        "later; `sensor`: best effort, what is lost is lost",
    )


class ResultNode(Node):
    """A field of an operation's result, or of an event; missions read it as event.NAME."""

    type: Annotated[str, Meaning.TYPE] = Field(description="such as text, count, duration")
    from_: Written = Field(alias="from", description="value, from `response`, `result` or `message`")
    unit: Annotated[str | None, Meaning.UNIT] = Field(
        None, description="unit of the number that is read, such as mm or deg; else the one it is kept in"
    )


class BoundMockCaseNode(Node):
    """The differences of the mock for certain arguments."""

    with_: dict[str, Written] = Field(alias="with", description="arguments for which this holds, by name")
    result: dict[str, Written] = Field(
        default_factory=dict, description="fields of the result that are different then"
    )
    values: dict[str, Written] = Field(
        default_factory=dict, description="live values of this binding that are different afterwards, by name"
    )


class BoundMockNode(Node):
    """The operation's end in a simulation, where the scenario does not mock it."""

    after: Written = Field(None, description="duration from the call to the answer; otherwise none")
    result: dict[str, Written] = Field(
        default_factory=dict, description="every field of the result, with its value"
    )
    values: dict[str, Written] = Field(
        default_factory=dict, description="live values of this binding that are different afterwards, by name"
    )
    when: Annotated[
        list[BoundMockCaseNode],
        BeforeValidator(_to_list, json_schema_input_type=BoundMockCaseNode | list[BoundMockCaseNode]),
    ] = Field(
        default_factory=list,
        description="what is otherwise for some arguments; the first that holds counts",
    )


class BoundOperationNode(Node):
    """An operation of a binding: its service or action, the request, and the meaning of the answer."""

    ELSEWHERE: ClassVar[Mapping[str, tuple[str, str]]] = MappingProxyType(
        {
            "type": ("the type belongs to the service or action", "write 'service: {name: ..., type: ...}'"),
            "params": (
                "what a mission hands over are arguments, parameters are those of the whole binding",
                "write 'arguments: {NAME: {...}}'",
            ),
            "request": ("values are handed over by 'with'", "write 'with: {FIELD: VALUE}'"),
            "goal": ("values are handed over by 'with'", "write 'with: {FIELD: VALUE}'"),
            "doc": ("a sentence for people is its summary", "write 'summary: ...'"),
            "guard": ("a guard belongs to a transition", "write 'done_when: CONDITION'"),
            "timeout": ("how long to wait is for the mission to say", "write it where the mission invokes"),
            "feedback": ("what is told meanwhile is its progress", "write 'progress: VALUE'"),
            "codes": (
                "codes are declared once for the whole binding",
                "write 'code: NAME', and 'code_when: {NAME: CONDITION}' for others",
            ),
            "topic": (
                "nobody answers on a topic",
                "write an action of the binding: 'actions: {NAME: {topic: ...}}'",
            ),
        }
    )

    summary: str = Field(description="one sentence for people: what it does")
    arguments: dict[str, ArgumentNode] = Field(
        default_factory=dict, description="what missions hand over, by name"
    )
    service: ServiceNode | None = Field(None, description="service that is called; this or `action`")
    action: ActionServerNode | None = Field(None, description="action that gets a goal; this or `service`")
    with_: dict[str, Written] = Field(
        default_factory=dict,
        alias="with",
        description="fields of the request or goal, by name; what is not written stays empty or 0",
    )
    done_when: Condition = Field(
        description="condition on the answer (`response`; of an action `status` and `result`): the operation "
        "succeeded; `true` where every answer means that"
    )
    result: dict[str, ResultNode] = Field(
        default_factory=dict, description="what missions get from the answer, by name"
    )
    code: Annotated[str, Meaning.CODE] = Field(
        description="code that an attempt fails with where nothing below says another"
    )
    code_when: dict[str, Condition] = Field(
        default_factory=dict,
        description="by code: condition on an answer that is no success; the first that is true counts",
    )
    unavailable: Annotated[str | None, Meaning.CODE] = Field(
        None, description="code where the server is not there, or goes while it works"
    )
    rejected: Annotated[str | None, Meaning.CODE] = Field(
        None, description="code where the server of an action does not take the goal"
    )
    detail: Written = Field(None, description="text beside the code, from the answer")
    progress: Written = Field(
        None,
        description="feedback of an action, from `feedback`: a value, or several by their names",
    )
    uses: Names = Field(default_factory=list, description="what it needs for itself, such as base or lift")
    cut_short: bool = Field(
        False,
        description="of an action: `result` is read of a cancelled goal too; missions get it as error.result",
    )
    on_hold: Literal["cancel", "finish"] = Field(
        "finish",
        description="`cancel`: it moves the robot, a hold ends it and calls again on release; "
        "`finish`: its answer waits for the release",
    )
    on_restart: Literal["cancel", "finish"] = Field(
        "cancel",
        description="when another orchestrator goes on: `cancel`: what is under way is ended and begun anew; "
        "`finish`: an action goes on, and its result counts",
    )
    updates: bool = Field(
        False,
        description="of an action: its server takes a new goal in place of the one it works on, so that "
        "missions may write `update`",
    )
    watch: Literal["client"] | None = Field(
        None,
        description="`client`: its server hears whether the orchestrator is there, and ends the order "
        "when it falls silent; to a server that does not listen no order is given",
    )
    mock: BoundMockNode | None = Field(None, description="how it is simulated; needed where it has a result")


_FROM_A_TOPIC = "write 'topic: {name: ..., type: PACKAGE/msg/NAME}'"
_A_FIELD = "write 'fields: {NAME: {type: ..., from: VALUE}}'"


class BoundActionNode(Node):
    """An action of a binding: a message that is published and not waited for."""

    ELSEWHERE: ClassVar[Mapping[str, tuple[str, str]]] = MappingProxyType(
        {
            "service": ("a service answers, so it is an operation", "write it under 'operations'"),
            "action": ("a goal comes to an end, so it is an operation", "write it under 'operations'"),
            "type": ("the type belongs to the topic", _FROM_A_TOPIC),
            "doc": ("a sentence for people is its summary", "write 'summary: ...'"),
        }
    )

    summary: str = Field(description="one sentence for people: what it does")
    arguments: dict[str, ArgumentNode] = Field(
        default_factory=dict, description="what missions hand over, by name"
    )
    topic: TopicNode = Field(description="topic that the message goes to")
    with_: dict[str, Written] = Field(
        default_factory=dict,
        alias="with",
        description="fields of the message, by name; what is not written stays empty or 0",
    )
    moves: bool = Field(False, description="it moves the robot: while held it waits for the release")


class BoundValueNode(Node):
    """A live value of a binding: the latest message of a topic; missions declare an input for it."""

    ELSEWHERE: ClassVar[Mapping[str, tuple[str, str]]] = MappingProxyType(
        {
            "service": ("a live value comes unasked", _FROM_A_TOPIC),
            "value": ("what it is stands under 'from'", "write 'from: VALUE'"),
            "doc": ("a sentence for people is its summary", "write 'summary: ...'"),
        }
    )

    summary: str = Field(description="one sentence for people: what it is")
    type: Annotated[str, Meaning.TYPE] = Field(description="such as bool, number, length, pose")
    topic: TopicNode = Field(description="topic that reports it")
    from_: Written = Field(alias="from", description="value, from `message`")
    when: Condition = Field(None, description="condition on `message`: others are passed over")
    unit: Annotated[str | None, Meaning.UNIT] = Field(
        None, description="unit of the number in the message, such as cm or %; else the one it is kept in"
    )
    freshness: Written = Field(
        None, description="how long a message stays known, a duration; otherwise until the next one"
    )
    initial: Written = Field(None, description="value before the first message; unknown when not given")


class BoundEventNode(Node):
    """An event of a binding: each message of a topic, or those that `when` selects; `on: BINDING.EVENT`."""

    ELSEWHERE: ClassVar[Mapping[str, tuple[str, str]]] = MappingProxyType(
        {
            "service": ("an event comes unasked", _FROM_A_TOPIC),
            "from": ("what comes with an event are its fields", _A_FIELD),
            "value": ("what comes with an event are its fields", _A_FIELD),
            "doc": ("a sentence for people is its summary", "write 'summary: ...'"),
        }
    )

    summary: str = Field(description="one sentence for people: what happened")
    topic: TopicNode = Field(description="topic that reports it")
    when: Condition = Field(None, description="condition on `message`: others are no event")
    fields: dict[str, ResultNode] = Field(default_factory=dict, description="what comes with it, by name")


class BindingNode(Node):
    """A plugin in YAML instead of Python."""

    ELSEWHERE: ClassVar[Mapping[str, tuple[str, str]]] = MappingProxyType(
        {
            "service": ("a service belongs to an operation", "write 'operations: {NAME: {service: ...}}'"),
            "action": (
                "an action of ROS belongs to an operation",
                "write 'operations: {NAME: {action: ...}}'",
            ),
            "topic": (
                "a topic belongs to a value, an event or an action",
                "write 'values: {NAME: {topic: ...}}'",
            ),
            "parameters": ("parameters are its params", "write 'params: {NAME: {...}}'"),
            "doc": ("a sentence for people is its summary", "write 'summary: ...'"),
        }
    )

    lupin: Version = Field(None, description=VERSION_HELP)
    binding: Annotated[str, Meaning.FILE] = Field(
        description="name of the plugin that this makes, also that of its file"
    )
    summary: str = Field(description="one sentence for people: what is connected")
    types: Annotated[RecordTypes, Named(Meaning.TYPE)] = Field(
        default_factory=dict,
        description="record types, by name, for it, and for the missions and bindings beside it",
    )
    params: Annotated[dict[str, ParameterNode], Named(Meaning.PARAMETER)] = Field(
        default_factory=dict, description="settings that its expressions read as param.NAME, by name"
    )
    codes: Annotated[dict[str, CodeNode], Named(Meaning.CODE)] = Field(
        default_factory=dict, description="reasons that its operations fail with, by name"
    )
    operations: dict[str, BoundOperationNode] = Field(
        default_factory=dict, description="what missions can invoke, by name"
    )
    actions: dict[str, BoundActionNode] = Field(
        default_factory=dict, description="messages that missions can send, by name"
    )
    values: dict[str, BoundValueNode] = Field(
        default_factory=dict,
        description="live values, by the whole name that inputs call them, such as tank.level",
    )
    events: dict[str, BoundEventNode] = Field(
        default_factory=dict, description="what missions can react to, by name"
    )


__all__ = [
    "KIND",
    "ActionServerNode",
    "ArgumentNode",
    "BindingNode",
    "BoundActionNode",
    "BoundEventNode",
    "BoundMockCaseNode",
    "BoundMockNode",
    "BoundOperationNode",
    "BoundValueNode",
    "ResultNode",
    "ServiceNode",
    "TopicNode",
]
