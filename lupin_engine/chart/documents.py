"""The vocabulary of the language: one model for each mapping that a mission file may contain.

There are three kinds of file: a lifecycle, a mission, a part. The models are the single source of keys and of
the meaning of their values (`Meaning`): the editor, its schema and the reference are made from them. Short
forms (a target as text, one action instead of a list) are expanded here, so no later module handles them.
Texts that may be expressions are left unparsed; the shape of names is checked here, `compose` resolves them.
A wrong shape raises pydantic's ValidationError, of which `validation` makes findings.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping
from functools import cache
from types import MappingProxyType
from typing import Annotated, Any, Literal, TypeVar, get_args

from pydantic import (
    BeforeValidator,
    Discriminator,
    Field,
    Tag,
    WithJsonSchema,
)

from lupin_engine.chart.nodes import VERSION_HELP, Keyed, Meaning, Named, Node, Version, show, wrong_shape
from lupin_engine.chart.semantics import MIN_PERIOD
from lupin_engine.chart.source import Map, Merged


def _many(description: str, alias: str | None = None) -> Any:
    """Describe a list that may be left out: then it is a tuple, for a list would be copied, which is slow."""
    return Field((), alias=alias, description=description)


def _by_name(description: str, alias: str | None = None) -> Any:
    """Describe a mapping that may be left out."""
    return Field(default_factory=dict, alias=alias, description=description)


def _to_list(value: Any) -> Any:
    return value if isinstance(value, list) else [value]


#: What may be an expression: text, number, yes or no, list or record; typed where it is used.
Written = Annotated[Any, WithJsonSchema({"type": ["string", "number", "boolean", "array", "object"]})]
#: A condition; always an expression.
Condition = Annotated[Any, WithJsonSchema({"type": ["string", "boolean"]})]
Conditions = Annotated[
    list[Condition], BeforeValidator(_to_list, json_schema_input_type=str | bool | list[str | bool])
]
Names = Annotated[list[str], BeforeValidator(_to_list, json_schema_input_type=str | list[str])]
Bound = Annotated[Any, WithJsonSchema({"type": ["string", "number"]})]


class ActionNode(Node):
    """An action: a name, or a mapping of one name to its arguments, with models for `raise` and `if`."""

    name: Annotated[str, Meaning.ACTION]
    arguments: Any = None
    raise_: RaiseNode | None = Field(None, alias="raise", description="the event of `raise`")
    if_: IfNode | None = Field(None, alias="if", description="what `if` chooses between")

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        if isinstance(data, str):
            return {"name": data}
        if not isinstance(data, Map) or len(data) != 1:
            raise wrong_shape("expected an action: a name, or a mapping of one name to its arguments")
        ((name, arguments),) = data.items()
        data.model = None
        if name in ("if", "raise"):
            return {"name": name, name: arguments}
        if arguments is not None and not isinstance(arguments, Map):
            raise wrong_shape(f"expected the arguments of {name} as a mapping, got {show(arguments)}")
        return {"name": name, "arguments": arguments}


Actions = Annotated[
    list[Annotated[ActionNode, WithJsonSchema({"type": ["string", "object"], "maxProperties": 1})]],
    BeforeValidator(_to_list),
]


class RaiseNode(Node):
    """An internal event; it is handled before the next one from outside."""

    event: Annotated[str, Meaning.EVENT] = Field(description="name of the event: words with dots")
    with_: dict[str, Written] = _by_name("what it carries, read as event.FIELD, by name", alias="with")

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        if not isinstance(data, Map):
            raise wrong_shape(f"expected {{event: NAME}}, got {show(data)}")
        return data


class IfNode(Node):
    """Actions chosen by a condition, which is evaluated when its turn in the list has come."""

    guard: Annotated[Condition, Meaning.CONDITION] = Field(
        description="condition; as everywhere it is false where it reads an unknown value"
    )
    then: Actions = Field(description="actions where it is true, in order")
    else_: Actions = _many("actions where it is false, in order", alias="else")

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        if not isinstance(data, Map):
            raise wrong_shape(f"expected {{guard: CONDITION, then: ACTIONS}}, got {show(data)}")
        return data


class TransitionNode(Node):
    """The effect of an event: go to a target, run actions, or refuse a request with a reason."""

    ELSEWHERE = MappingProxyType(
        {"after": ("a transition has no delay", "go to a state that waits: 'after: {1 s: STATE}'")}
    )

    target: Annotated[str | None, Meaning.STATE] = Field(
        None, description="state to go to, found in the nearest enclosing scope"
    )
    guard: Annotated[Condition, Meaning.CONDITION] = Field(
        None, description="the transition is taken only when it is true"
    )
    do: Actions = _many("actions, in order")
    refuse: Annotated[str | None, Meaning.CODE] = Field(
        None,
        description="code that answers a request which is not allowed here; has no target and no actions",
    )
    value: Annotated[Written, Meaning.VALUE] = Field(
        None, description="of a refusal: the value that it is about, which the answer names"
    )
    during: Annotated[Names, Meaning.HOLD] = _many(
        "holds during which this is taken all the same; they stay engaged"
    )
    releases: Annotated[Names, Meaning.HOLD] = _many("holds that taking this releases")
    code: Annotated[str | None, Meaning.CODE] = Field(
        None, description="code that is reported when this is taken"
    )
    detail: Annotated[Written, Meaning.VALUE] = Field(
        None, description="text beside the code; it sees what the actions have set; else that of the error"
    )
    internal: bool = Field(
        False,
        description="do not leave and re-enter the state that this stands in, whose `entry`, clocks and "
        "itinerary would begin anew",
    )
    use: Annotated[str | None, Meaning.STATE] = Field(
        None, description="answer as this other state does; stands alone"
    )

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        if isinstance(data, str):
            return {"target": data}
        if not isinstance(data, Map):
            wanted = "expected a state to go to, or a mapping such as {target: STATE, do: ACTION}"
            raise wrong_shape(f"{wanted}, got {show(data)}; name the state")
        return data


def _transitions(value: Any) -> Any:
    return value if isinstance(value, list) else [value]


Transitions = Annotated[
    list[TransitionNode],
    BeforeValidator(_transitions, json_schema_input_type=str | TransitionNode | list[str | TransitionNode]),
]


class LimitNode(Node):
    """How long an attempt may take, and the code it ends in then."""

    SHAPE = "{after: DURATION, code: CODE} or never"
    LINE = "timeout: {after: 30 s, code: CODE}"

    after: Annotated[Written, Meaning.VALUE] = Field(description="longest time for one attempt, a duration")
    code: Annotated[str, Meaning.CODE] = Field(
        description="code that an attempt fails with which took longer"
    )


def _timeout_kind(value: Any) -> str:
    return "limit" if isinstance(value, (Map, LimitNode)) or value != "never" else "never"


Timeout = Annotated[
    Annotated[LimitNode, Tag("limit")] | Annotated[Literal["never"], Tag("never")],
    Discriminator(_timeout_kind),
]


class RetryNode(Node):
    """How often and how patiently an operation is tried again."""

    SHAPE = "{attempts: COUNT, backoff: DURATION}"
    LINE = "retry: {attempts: 2}"

    attempts: Annotated[Written, Meaning.VALUE] = Field(description="attempts in all, the first included")
    backoff: Annotated[Written, Meaning.VALUE] = Field(None, description="pause between attempts, a duration")
    unless: Annotated[Names, Meaning.CODE] = _many("codes that are not tried again")
    factor: Annotated[Written, Meaning.VALUE] = Field(
        None, description="how much longer every further pause is, 1 or more"
    )
    jitter: Annotated[Written, Meaning.VALUE] = Field(
        None, description="share of each pause that is left to chance, 0 to 1"
    )


class InvokeNode(Node):
    """An operation of a plugin that lives as long as its state."""

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        if isinstance(data, str):
            raise wrong_shape(f"expected a mapping, got {show(data)}; write {{do: {data}, timeout: ...}}")
        return data

    do: Annotated[str, Meaning.OPERATION] = Field(description="operation, as PLUGIN.OPERATION")
    with_: dict[str, Written] = _by_name("arguments, by name", alias="with")
    timeout: Timeout | None = Field(
        None, description="limit of each attempt; must be written, `never` needs another way out of the state"
    )
    retry: RetryNode | None = Field(None, description="further attempts after an error")
    on_hold: Literal["again", "continue", "fail"] = Field(
        "again",
        description="what the release of a hold does that cancelled it: `again` begins it anew, `continue` "
        "counts it as done with what it gave so far, `fail` ends it with the code operation_cancelled",
    )
    classes: list[Written] = _many(
        "results that `lupin prove` tries as well: of each the fields that differ from the usual ones"
    )
    update: Annotated[Written, Meaning.VALUE] = Field(
        None,
        description=f"a duration, {MIN_PERIOD * 1000:.0f} ms or more: so often its arguments are evaluated "
        "again while it runs, and changed ones go to the server as a new goal in place of the old one",
    )


_ENDS_HERE = "an element's end leads nowhere: the state goes on with the others"


class ElementEndNode(Node):
    """The actions at the end of the operation for one element."""

    ELSEWHERE = MappingProxyType(
        {
            "target": (
                _ENDS_HERE,
                "let the actions set a variable, and leave by 'always' with a guard on it",
            ),
            "guard": (_ENDS_HERE, "let the actions choose: 'if: {guard: CONDITION, then: ACTION}'"),
            "code": (_ENDS_HERE, "hand the code to an action"),
        }
    )

    do: Actions = Field(description="actions, in order")

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        if not isinstance(data, Map):
            raise wrong_shape(f"expected {{do: [ACTION, ...]}}, got {show(data)}; {_ENDS_HERE}")
        return data


class ForEachNode(Node):
    """One operation for every new element of a list, while the state is active."""

    SHAPE = "{item: NAME, in: LIST, key: VALUE, invoke: ...}"

    item: str = Field(description="what the element is called in the expressions below")
    in_: Annotated[Written, Meaning.VALUE] = Field(
        alias="in", description="list of elements, evaluated again after every step"
    )
    key: Annotated[Written, Meaning.VALUE] = Field(
        description="identifies an element; each key is handled once in a mission"
    )
    limit: Annotated[Written, Meaning.VALUE] = Field(
        None, description="largest number of operations at a time; otherwise all at once"
    )
    when: Annotated[Condition, Meaning.CONDITION] = Field(
        None, description="condition on the element; evaluated until it is true"
    )
    invoke: InvokeNode = Field(description="operation that is begun for the element")
    on_done: ElementEndNode | None = Field(
        None, description="what is done when the operation for an element has succeeded"
    )
    on_error: ElementEndNode | None = Field(None, description="what is done when it has failed for good")


class BudgetNode(Node):
    """The time that a state has over all visits in one mission."""

    SHAPE = "{after: DURATION, code: CODE, target: STATE}"
    LINE = "budget: {after: 30 s, code: CODE, target: STATE}"

    after: Annotated[Written, Meaning.VALUE] = Field(description="time that the state has in all, a duration")
    code: Annotated[str, Meaning.CODE] = Field(description="code that is reported when the time is used up")
    detail: Annotated[Written, Meaning.VALUE] = Field(None, description="text beside the code")
    target: Annotated[str, Meaning.STATE] = Field(
        description="state to go to then, found in the nearest enclosing scope"
    )
    during: Literal["divert"] | None = Field(
        None, description="`divert`: the time goes on while the lifecycle has the robot"
    )
    do: Actions = _many("actions, in order")


class BeforeDivertNode(Node):
    """How a state is finished, or left in order, before a divert leaves it."""

    SHAPE = "a duration, or {leave_by: STATE, within: DURATION}"
    LINE = "before_divert: {leave_by: STATE, within: 60 s}"

    within: Annotated[Written, Meaning.VALUE] = Field(
        description="how long a divert waits at most, a duration, from the entry of this state or of that in "
        "`leave_by`"
    )
    leave_by: Annotated[str | None, Meaning.STATE] = Field(
        None, description="child to go to when a divert waits; without it the state is finished"
    )

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        return data if isinstance(data, Map) else {"within": data}


class ChoiceNode(Node):
    """An answer that a person may give."""

    label: str = Field(description="text for people")
    severity: Literal["info", "warn", "error"] = Field("info", description="how grave the answer is")

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        if isinstance(data, str):
            return {"label": data}
        if not isinstance(data, Map):
            raise wrong_shape(
                f"expected a text for people, or {{label: ..., severity: warn}}, got {show(data)}"
            )
        return data


_OR_LABEL = BeforeValidator(lambda data: data, json_schema_input_type=str | ChoiceNode)


class AskNode(Node):
    """A question to the operator, asked while the state is active; each choice is the event answer.CHOICE."""

    question: Annotated[Written, Meaning.VALUE] = Field(description="what is asked, a text")
    choices: dict[str, Annotated[ChoiceNode, _OR_LABEL]] = Field(
        description="what can be answered, by name; an answer counts for every open question with that choice"
    )
    default: str = Field(description="choice that counts when nobody has answered in time")
    after: Annotated[Written, Meaning.VALUE] = Field(
        description="time to answer, a duration; it stands still during a hold"
    )


class ItineraryNode(Node):
    """The list that a state walks."""

    SHAPE = "{items: LIST}"

    items: Annotated[Written, Meaning.VALUE] = Field(
        description="list of targets: texts, whole numbers or records, identified by their `id`"
    )
    order: Annotated[Written, Meaning.VALUE] = Field(
        None, description="number for each `target`; the smallest is next"
    )
    sweeps: Annotated[Written, Meaning.VALUE] = Field(
        None, description="how often the list is walked; 0: until something else ends it"
    )
    again: Names = Field(
        [],
        description="statuses: what ended so in the last sweep is visited once more, after the rest",
    )
    on_abort: Literal["skip", "leave_open"] = Field(
        "skip", description="what itinerary.close_rest does to the targets that are still open"
    )
    source: str = Field("", description="what its observations name as their source; else the mission")


class StateNode(Node):
    """A state: its operation or children while it is active, and its ways out."""

    summary: str = Field("", description="one sentence for people")
    type: Literal["parallel", "final", "history"] | None = Field(
        None,
        description="`parallel`: all children at once; `final`: an end; `history`: the child that was left",
    )
    depth: Literal["shallow", "deep"] | None = Field(
        None,
        description="of a history state: `shallow` is the child that was left, `deep` all inside it too",
    )
    initial: Annotated[str | None, Meaning.CHILD] = Field(
        None, description="child that is entered first; needed where several could be"
    )
    states: Annotated[dict[str, StateNode | None], Named(Meaning.STATE)] = _by_name("children, by name")
    sequence: list[Annotated[dict[str, StateNode | None], Named(Meaning.STATE)]] = _many(
        "children, one after the other: the end of each leads to the next, that of the last ends this state; "
        "`on_error` is that of each step that has none; a wait at the end leads to `over`, with `times` to "
        "`again`"
    )
    times: Written = Field(None, description="how often the sequence is walked, 1 or more")
    entry: Actions = _many("actions on entering")
    exit: Actions = _many("actions on leaving")
    invoke: InvokeNode | None = Field(None, description="operation that lives as long as this state")
    on_done: Transitions = _many("when the operation has succeeded, or a final child is reached")
    on_error: Transitions = _many("when the operation has failed for good")
    on: Annotated[dict[str, Transitions], Keyed(Meaning.EVENT)] = _by_name("by event: what it does")
    always: Transitions = _many("without an event: taken as soon as the guard is true")
    after: Annotated[dict[str, Transitions], Keyed(Meaning.VALUE)] = _by_name(
        "by duration: what happens when the state has been active that long"
    )
    every: Annotated[dict[str, Transitions], Keyed(Meaning.VALUE)] = _by_name(
        f"by duration, {MIN_PERIOD * 1000:.0f} ms or more: what happens at that rate while the state is "
        "active; late ticks do not shift the next ones, missed ones are left out, a hold stops this clock too"
    )
    at_: Annotated[dict[str, Transitions], Keyed(Meaning.VALUE)] = _by_name(
        'by time of day, such as "06:30": what happens each time that the clock comes to it while the state '
        "is active",
        alias="at",
    )
    budget: BudgetNode | None = Field(None, description="time that this state has in one mission")
    before_divert: BeforeDivertNode | None = Field(
        None, description="a divert of the lifecycle waits until this state is left, within a time"
    )
    for_each: ForEachNode | None = Field(None, description="one operation for every element of a list")
    itinerary: ItineraryNode | None = Field(None, description="the list that this state walks")
    ask: AskNode | None = Field(None, description="question to the operator")
    use: Annotated[str | None, Meaning.PART] = Field(
        None, description="part, or mission by the name of its file, whose states stand here"
    )
    with_: dict[str, Written] = _by_name(
        "by parameter of the part, or by field of the mission's request: its value for this use", alias="with"
    )
    out: Annotated[dict[str, Annotated[str, Meaning.VARIABLE]], Keyed(Meaning.BINDING)] = _by_name(
        "by variable that the part reports: the variable here that it is"
    )
    resume_at: Transitions = _many(
        "child to go on with when history (its own, or one around it) brings this back; the first that holds"
    )
    result: dict[str, Written] = _by_name(
        "of a final state: what `on_done` of the state that ends reads as event.FIELD, by name"
    )
    phase: str | None = Field(None, description="what is published as the phase while the state is active")
    paused: bool = Field(False, description="published as paused: waits for the operator")
    slot: Literal["mission"] | None = Field(
        None, description="in the lifecycle: the missions' states stand here"
    )
    history: Literal["shallow", "deep"] | None = Field(
        None, description="adds the child `history`, a target for going back to what was left"
    )


class RecordFieldNode(Node):
    """A field of a record type: a type alone, or with its unit and range."""

    SHAPE = "a type, or a mapping with 'type'"

    type: Annotated[str, Meaning.TYPE] = Field(description="such as text, integer, pose, list of text")
    unit: Annotated[str | None, Meaning.UNIT] = Field(
        None, description="unit of a number; a number in s is a duration"
    )
    min: Bound = Field(None, description="smallest value")
    max: Bound = Field(None, description="largest value; of a list, the most elements")

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        return {"type": data} if isinstance(data, str) else super()._long_form(data)


#: Record types by name, each with its fields.
RecordTypes = dict[
    str,
    dict[
        str,
        Annotated[
            RecordFieldNode,
            BeforeValidator(lambda value: value, json_schema_input_type=str | RecordFieldNode),
        ],
    ],
]


class ParameterNode(Node):
    """A setting: becomes a ROS parameter of the same name."""

    type: Annotated[str, Meaning.TYPE] = Field(description="such as duration, count, text, list of text")
    default: Written = Field(
        None, description="value when nobody sets it; only a part may leave it out: its users give it then"
    )
    unit: Annotated[str | None, Meaning.UNIT] = Field(
        None, description="unit of a number; a number in s is a duration"
    )
    min: Bound = Field(None, description="smallest value; of a list, the fewest elements")
    max: Bound = Field(None, description="largest value; of a list, the most elements")
    summary: str = Field("", description="one sentence for people")


class CodeNode(Node):
    """A reason that can be reported, or that a request is refused with."""

    label: str = Field(description="text for people")
    severity: Literal["info", "warn", "error"] = Field("warn", description="how bad it is")
    advice: str = Field("", description="one sentence for the operator: what to do about it")


class VariableNode(Node):
    """A context variable: written by `set`, `add` and `remove`, kept in the snapshot."""

    type: Annotated[str, Meaning.TYPE] = Field(description="such as text, count, pose")
    unit: Annotated[str | None, Meaning.UNIT] = Field(
        None, description="unit of a number; a number in s is a duration"
    )
    default: Annotated[Written, Meaning.VALUE] = Field(
        description="value when a mission starts; of a variable of the lifecycle, when the chart starts"
    )
    max: Bound = Field(
        None,
        description="most elements of a list or set, needed where actions `add`; largest value of a number",
    )
    summary: str = Field("", description="one sentence for people")


class OutNode(Node):
    """A variable of the state that uses the part: the part reads and writes it by this name."""

    SHAPE = "{type: TYPE}"

    type: Annotated[str, Meaning.TYPE] = Field(description="such as bool, text, pose: that of the variable")
    unit: Annotated[str | None, Meaning.UNIT] = Field(
        None, description="unit of a number; a number in s is a duration"
    )
    summary: str = Field("", description="one sentence for people")


class LevelNode(Node):
    """A yes or no drawn from a number."""

    below: Annotated[Written, Meaning.VALUE] = Field(None, description="true below this value")
    above: Annotated[Written, Meaning.VALUE] = Field(
        None, description="true above this value; either this or `below` is written"
    )
    hysteresis: Annotated[Written, Meaning.VALUE] = Field(
        None, description="how far the value must come back to be false again"
    )


class InputNode(Node):
    """A live value of a plugin under the name that the chart reads it by."""

    value: Annotated[str, Meaning.LIVE_VALUE] = Field(description="live value, as a plugin calls it")
    freshness: Written = Field(
        None, description="how long a report stays known, a duration; otherwise as the plugin says"
    )
    initial: Written = Field(None, description="value before the first report; unknown when not given")
    unit: Annotated[str | None, Meaning.UNIT] = Field(None, description="unit of the value, for the reader")
    min: Bound = Field(None, description="smallest value that is believed")
    max: Bound = Field(None, description="largest value that is believed")
    since: Literal["mission"] | None = Field(
        None,
        description="only what was reported since the mission began counts; "
        "of a list, only elements that were not reported just the same before it",
    )
    levels: Annotated[dict[str, LevelNode], Named(Meaning.LEVEL)] = _by_name(
        "yes or no drawn from the number, by name"
    )
    classes: list[Written] = _many("values that `lupin prove` tries beside those that it finds by itself")
    summary: str = Field("", description="one sentence for people")


class HoldNode(Node):
    """A suspension of the whole chart."""

    engage: Annotated[str, Meaning.ENGAGE] = Field(
        description="request (operator.pause) or level (input.danger) that engages it"
    )
    release: Annotated[Names, Meaning.REQUEST] = Field(description="requests that release it")
    code: Annotated[str, Meaning.CODE] = Field(description="code that engaging reports")
    engage_guard: Annotated[Condition, Meaning.CONDITION] = Field(
        None, description="when the request is allowed; a level engages its hold without"
    )
    engage_code: Annotated[str | None, Meaning.CODE] = Field(
        None, description="code that refuses the request"
    )
    release_guard: Annotated[Condition, Meaning.CONDITION] = Field(
        None, description="when releasing is allowed"
    )
    summary: str = Field("", description="one sentence for people")


class RefusalNode(Node):
    """A value of a request's field with which nothing starts, and the reason."""

    SHAPE = "{guard: CONDITION, code: CODE}"
    LINE = "refuse: {guard: CONDITION, code: CODE}"

    guard: Annotated[Condition, Meaning.CONDITION] = Field(
        description="the request is refused when it is true; it reads all fields of the request"
    )
    code: Annotated[str, Meaning.CODE] = Field(description="code that answers the request")
    value: Annotated[Written, Meaning.VALUE] = Field(
        None, description="value that it is about, which the answer names; without it that of the field"
    )


Refusals = Annotated[
    list[RefusalNode],
    BeforeValidator(_to_list, json_schema_input_type=RefusalNode | list[RefusalNode]),
]


class RequestFieldNode(Node):
    """A field of the request that starts a mission."""

    type: Annotated[str, Meaning.TYPE] = Field(description="such as count, duration, list of text")
    unit: Annotated[str | None, Meaning.UNIT] = Field(
        None, description="unit of a number; a number in s is a duration"
    )
    default: Annotated[Written, Meaning.VALUE] = Field(
        None, description="value when the request does not say"
    )
    not_empty: Annotated[str | None, Meaning.CODE] = Field(
        None, description="code that refuses an empty list"
    )
    refuse: Refusals = _many("values that are refused; the first that holds answers")
    distinct: bool = Field(
        False, description="of a list: what is named twice counts once, which makes it a set"
    )
    min: Bound = Field(None, description="smallest value")
    max: Bound = Field(None, description="largest value; of a list, the most elements")
    summary: str = Field("", description="one sentence for people")


class InvariantNode(Node):
    """A condition that holds at every moment."""

    that: Annotated[Condition, Meaning.CONDITION] = Field(description="what holds")
    summary: str = Field("", description="one sentence for people")

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        if data is None or isinstance(data, list):
            raise wrong_shape(f"expected a condition, got {show(data)}; write 'NAME: CONDITION'")
        return data if isinstance(data, Map) else {"that": data}


class PropertyNode(Node):
    """A condition on every possible run, checked by `lupin test`, `prove` and `campaign`; a robot watches it.

    One that reads the `request` of its mission is about the runs of that mission. So is one that begins with
    each start of it: places to visit, and `until` without `after`. Missions of one lifecycle, which a robot
    loads together, have no two properties of one name. `breach` and `code` decide what a robot does when it
    is broken. A breach is a step of its own, right after the one that broke the property. It is reported once
    until the property holds again.
    """

    SHAPE = "a mapping with one of always, never, eventually, visit_all and visit_in_order, or with built_in"
    ELSEWHERE = MappingProxyType(
        {
            "before": ("'never' and 'until' say what must not come before it", "write 'until: CONDITION'"),
            "between": (
                "'after' and 'until' say between which moments",
                "write 'after: CONDITION, until: CONDITION'",
            ),
            "response": (
                "'eventually' and 'within' say what must follow in time",
                "write 'eventually: CONDITION, within: 10 s'",
            ),
        }
    )

    always: Annotated[Condition, Meaning.CONDITION] = Field(None, description="holds at every moment")
    never: Annotated[Condition, Meaning.CONDITION] = Field(None, description="holds at no moment")
    eventually: Annotated[Condition, Meaning.CONDITION] = Field(None, description="holds at last, in time")
    visit_all: Annotated[Conditions, Meaning.CONDITION] = _many(
        "each has become true when the mission is done, in any order"
    )
    visit_in_order: Annotated[Conditions, Meaning.CONDITION] = _many(
        "each has become true when the mission is done, and none before the one to its left"
    )
    within: Annotated[Written, Meaning.VALUE] = Field(
        None, description="time in which `eventually` comes true; holds do not stop this clock"
    )
    after: Annotated[Condition, Meaning.CONDITION] = Field(
        None,
        description="the watch begins each time that this becomes true; without it at the start, and with "
        "`until` at each start of a mission",
    )
    until: Annotated[Condition, Meaning.CONDITION] = Field(
        None, description="the watch ends when this becomes true, until it begins again"
    )
    built_in: bool = Field(False, description="what the name says, which the engine knows")
    breach: Literal["report", "hold", "fault"] = Field(
        "report",
        description="what the robot does when it is broken: report it, hold until a resume, or go to FAULT",
    )
    code: Annotated[str | None, Meaning.CODE] = Field(
        None, description="code that reports a breach; without it property_broken"
    )
    formerly: str = Field("", description="former name, which `not_meant` may still use")
    summary: str = Field("", description="one sentence for people")


class FileNode(Node):
    """The declarations that every kind of file may have."""

    lupin: Version = Field(None, description=VERSION_HELP)
    summary: str = Field("", description="one sentence for people")
    types: Annotated[RecordTypes, Named(Meaning.TYPE)] = _by_name(
        "record types, by name: each has fields, by name, with their types"
    )
    params: Annotated[dict[str, ParameterNode], Named(Meaning.PARAMETER)] = _by_name("settings, by name")
    inputs: Annotated[dict[str, InputNode], Named(Meaning.INPUT)] = _by_name(
        "live values that are read, by the name that expressions use"
    )
    codes: Annotated[dict[str, CodeNode], Named(Meaning.CODE)] = _by_name(
        "reasons that can be reported, by name"
    )
    context: Annotated[dict[str, VariableNode], Named(Meaning.VARIABLE)] = _by_name("variables, by name")
    invariants: Annotated[
        dict[
            str,
            Annotated[
                InvariantNode,
                BeforeValidator(lambda value: value, json_schema_input_type=str | bool | InvariantNode),
            ],
        ],
        Named(Meaning.INVARIANT),
    ] = _by_name("conditions that hold at every moment; broken, they lead to FAULT, and nothing starts")
    properties: Annotated[dict[str, PropertyNode], Named(Meaning.PROPERTY)] = _by_name(
        "what is true of every run, by name; checked before the robot runs, and watched while it does"
    )
    initial: Annotated[str | None, Meaning.CHILD] = Field(
        None, description="state that is entered first; needed where several could be"
    )
    states: Annotated[dict[str, StateNode | None], Named(Meaning.STATE)] = Field(
        description="states, by name"
    )

    @property
    @abstractmethod
    def name(self) -> str:
        """The name that the file gives itself."""

    @property
    def title(self) -> str:
        """Kind and name, unique over the files of a chart."""
        return f"{type(self).__name__} {self.name}"


class OriginNode(Node):
    """The lifecycle that a copy was made of."""

    SHAPE = "{lifecycle: NAME, version: VERSION, sha256: DIGEST}"

    lifecycle: str = Field(description="name of the shipped lifecycle")
    version: str = Field(description="version of the engine that shipped it")
    sha256: str = Field(description="beginning of the digest of its file")


class LifecycleNode(FileNode):
    """The lifecycle: the states and declarations that all missions share."""

    lifecycle: Annotated[str, Meaning.FILE] = Field(description="name of the lifecycle")
    extends: Annotated[str | None, Meaning.LIFECYCLE] = Field(
        None,
        description="name of a shipped lifecycle, which this one changes: mappings are merged key by key; "
        "transitions, actions, lists and expressions replace; its holds and its answers to a start stay",
    )
    origin: OriginNode | None = Field(
        None,
        description="of a copy: the lifecycle that it was made of; `lupin doctor` reports a change since",
    )
    profile: str | None = Field(None, description="kind of robot; without it the one that is installed")
    holds: Annotated[dict[str, HoldNode], Named(Meaning.HOLD)] = _by_name(
        "suspensions of the whole chart, by name"
    )
    on: Annotated[dict[str, Transitions], Keyed(Meaning.EVENT)] = _by_name(
        "by event: what it does in every state"
    )

    @property
    def name(self) -> str:
        """The name that the file gives itself."""
        return self.lifecycle

    @property
    def files(self) -> tuple[str, ...]:
        """The names of the files that it is written in: its own, and the one that it extends."""
        raw = self._raw
        return (raw.file.name, raw.base.file.name) if isinstance(raw, Merged) else (raw.file.name,)


class MissionNode(FileNode):
    """A mission: stands in the slot of the lifecycle."""

    mission: Annotated[str, Meaning.FILE] = Field(description="name of the mission, as requests call it")
    request: Annotated[dict[str, RequestFieldNode], Named(Meaning.FIELD)] = _by_name(
        "what the request that starts it carries, by name"
    )
    entry: Actions = _many("actions when the mission starts; not when history brings it back")
    exit: Actions = _many("actions whenever the mission is left, also if history brings it back later")
    on: Annotated[dict[str, Transitions], Keyed(Meaning.EVENT)] = _by_name(
        "by event: what it does in every state of the mission"
    )
    not_meant: Annotated[dict[str, str | None], Keyed(Meaning.PROPERTY)] = _by_name(
        "why properties that it inherits are not meant of its runs, by name"
    )

    @property
    def name(self) -> str:
        """The name that the file gives itself."""
        return self.mission


class PartNode(FileNode):
    """States that missions use, with parameters of their own."""

    part: Annotated[str, Meaning.PART] = Field(description="name of the part, also that of its file")
    needs: Literal["itinerary"] | None = Field(None, description="what the state that uses this must have")
    out: Annotated[dict[str, OutNode], Named(Meaning.VARIABLE)] = _by_name(
        "what it reports: variables that each use of it names, by the name that they have here"
    )
    resume_at: Transitions = _many("child to go on with when history brings it back; the first that holds")

    @property
    def name(self) -> str:
        """The name that the file gives itself."""
        return self.part


_N = TypeVar("_N", bound=Node)


def written_in(node: Node, kind: type[_N]) -> Iterator[_N]:
    """Yield the nodes of a kind that a state or a file writes itself, not in the states inside it."""
    for name in _holders(type(node)):
        for found in _each_in(getattr(node, name)):
            if isinstance(found, kind):
                yield found
            if isinstance(found, Node):
                yield from written_in(found, kind)


def _each_in(value: Any) -> Iterator[Any]:
    """Yield the values of a field: itself, or the elements of its list, its mapping or the lists in that."""
    for each in value.values() if isinstance(value, dict) else (value,):
        yield from each if isinstance(each, (list, tuple)) else (each,)


@cache
def _holders(model: type[Node]) -> tuple[str, ...]:
    """Return the fields of a model that hold nodes which are no states."""
    fields = ((name, _nodes_in(field.annotation)) for name, field in model.model_fields.items())
    return tuple(name for name, nodes in fields if nodes - {StateNode})


def _nodes_in(annotation: Any) -> set[type[Node]]:
    if isinstance(annotation, type) and issubclass(annotation, Node):
        return {annotation}
    return set[type[Node]]().union(*map(_nodes_in, get_args(annotation)))


# Not before the models above are made: they would take over its whole validator, and read each action twice.
ActionNode.model_rebuild()

KINDS: Mapping[str, type[FileNode]] = {"lifecycle": LifecycleNode, "mission": MissionNode, "part": PartNode}

__all__ = [
    "KINDS",
    "ActionNode",
    "BudgetNode",
    "CodeNode",
    "ElementEndNode",
    "FileNode",
    "ForEachNode",
    "HoldNode",
    "IfNode",
    "InputNode",
    "InvariantNode",
    "InvokeNode",
    "ItineraryNode",
    "LevelNode",
    "LifecycleNode",
    "LimitNode",
    "MissionNode",
    "OriginNode",
    "OutNode",
    "ParameterNode",
    "PartNode",
    "PropertyNode",
    "RaiseNode",
    "RecordFieldNode",
    "RecordTypes",
    "RefusalNode",
    "RequestFieldNode",
    "RetryNode",
    "StateNode",
    "TransitionNode",
    "VariableNode",
]
