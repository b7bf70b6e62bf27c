"""The words of the language: one model for each mapping that a mission file may contain.

There are three kinds of file: a lifecycle, a mission, a part. The models are the single source of what keys
exist; the editor's schema is generated from them. Short forms (a target as text, one action instead of a
list) are brought to the long form here, so nothing after this module knows that they exist. Texts that may
be expressions stay as they were read; names are checked for shape only, what they mean is `compose`'s work.

Every model keeps the mapping it was read from, and can say where each of its keys and values stands.
"""

from __future__ import annotations

import re
from abc import abstractmethod
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, TypeVar

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    ModelWrapValidatorHandler,
    Tag,
    ValidationError,
    WithJsonSchema,
    model_validator,
)
from pydantic_core import ErrorDetails, PydanticCustomError

from lupin_engine.chart.findings import Findings
from lupin_engine.chart.source import Map, Seq, Text
from lupin_engine.errors import Place, meant

_M = TypeVar("_M", bound="Node")

#: How often a file is read again without the unknown keys that were found.
MAX_PRUNINGS = 3


class Node(BaseModel):
    """A mapping of the language that remembers where it was read.

    `ELSEWHERE` holds keys that authors look for here and that stand somewhere else, with what to tell them.
    """

    model_config = ConfigDict(extra="forbid", strict=True)

    ELSEWHERE: ClassVar[Mapping[str, tuple[str, str]]] = MappingProxyType({})

    # A slot and no private attribute of pydantic's, which would take as long to set as all the rest to read.
    __slots__ = ("_raw",)
    if TYPE_CHECKING:
        _raw: Any

    @model_validator(mode="wrap")
    @classmethod
    def _remember(cls: type[_M], data: Any, handler: ModelWrapValidatorHandler[_M]) -> _M:
        if isinstance(data, Map):
            data.model = cls
        node = handler(cls._long_form(data))
        object.__setattr__(node, "_raw", data)
        return node

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        """Return the mapping that a short form stands for."""
        return data

    @property
    def place(self) -> Place:
        """Where this mapping, or the text that stands for it, begins."""
        raw = self._raw
        found: Place = raw.file.place(raw.start)
        return found

    @property
    def written(self) -> bool:
        """Tell whether this was read as a mapping, not as a short form."""
        return isinstance(self._raw, Map)

    def at(self, key: str, index: int | None = None) -> Place:
        """Return where the value of `key` stands (or its element `index`), else where this mapping begins."""
        if not isinstance(self._raw, Map) or key not in self._raw:
            return self.place
        value = self._raw[key]
        if index is not None and isinstance(value, Seq):
            return value.place_of(index)
        return self._raw.value_place(key)

    def key_at(self, key: str, *inner: str) -> Place:
        """Return where the key itself stands, or a key in its mapping, as deep as there is one."""
        holder, last = self._deepest(key, *inner)
        return self.place if holder is None else holder.key_place(last)

    def text_of_key(self, key: str, inner: str) -> Text:
        """Return a key of the mapping under `key` as it was written."""
        text: Text = self._raw[key].key_text(inner)
        return text

    def mapping(self, key: str) -> Map | None:
        """Return the mapping under `key` as it was read, with its places."""
        found = self._raw.get(key) if isinstance(self._raw, Map) else None
        return found if isinstance(found, Map) else None

    def value_at(self, key: str, *inner: str) -> Place:
        """Return where a value in nested mappings stands, as deep as there is one."""
        holder, last = self._deepest(key, *inner)
        return self.place if holder is None else holder.value_place(last)

    def _deepest(self, *words: str) -> tuple[Map | None, str]:
        """Follow keys into nested mappings; return the last mapping that had its key, and that key."""
        raw, holder, last = self._raw, None, ""
        for name in words:
            if not isinstance(raw, Map) or name not in raw:
                break
            holder, last, raw = raw, name, raw[name]
        return holder, last


def _many(description: str) -> Any:
    """Describe a list that may be left out: then it is a tuple, for a list would be copied, which is slow."""
    return Field((), description=description)


def _by_name(description: str, alias: str | None = None) -> Any:
    """Describe a mapping that may be left out."""
    return Field(default_factory=dict, alias=alias, description=description)


def wrong_shape(text: str) -> PydanticCustomError:
    """Return what a model raises when a mapping is no mapping of its own; `text` is problem and hint."""
    return PydanticCustomError("wrong-shape", "{text}", {"text": text})


def _to_list(value: Any) -> Any:
    return value if isinstance(value, list) else [value]


def _as_it_is(value: Any) -> Any:
    return value


#: What may be an expression: text, number, yes or no, list or record; typed where it is used.
Written = Annotated[Any, WithJsonSchema({"type": ["string", "number", "boolean", "array", "object"]})]
#: A condition; always an expression.
Condition = Annotated[Any, WithJsonSchema({"type": ["string", "boolean"]})]
Names = Annotated[list[str], BeforeValidator(_to_list, json_schema_input_type=str | list[str])]
Bound = Annotated[Any, WithJsonSchema({"type": ["string", "number"]})]


class ActionNode(Node):
    """An action: a name, or a mapping of one name to its arguments."""

    name: str
    arguments: Any = None

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        if isinstance(data, str):
            return {"name": data}
        if not isinstance(data, Map) or len(data) != 1:
            raise wrong_shape("expected an action: a name, or a mapping of one name to its arguments")
        ((name, arguments),) = data.items()
        data.model = None
        if arguments is not None and not isinstance(arguments, Map):
            raise wrong_shape(f"expected the arguments of {name} as a mapping, got {show(arguments)}")
        return {"name": name, "arguments": arguments}


Actions = Annotated[
    list[Annotated[ActionNode, WithJsonSchema({"type": ["string", "object"], "maxProperties": 1})]],
    BeforeValidator(_to_list),
]


class TransitionNode(Node):
    """What an event does: go to a target, run actions, or refuse a request with a reason."""

    ELSEWHERE = MappingProxyType(
        {"after": ("a transition has no delay", "go to a state that waits: 'after: {1 s: STATE}'")}
    )

    target: str | None = Field(None, description="state to go to, found in the nearest enclosing scope")
    guard: Condition = Field(None, description="the transition is taken only when it is true")
    do: Actions = _many("actions, in order")
    refuse: str | None = Field(
        None,
        description="code that answers a request which is not allowed here; has no target and no actions",
    )
    during: Names = _many("holds during which this is taken all the same; they stay engaged")
    releases: Names = _many("holds that taking this releases")
    code: str | None = Field(None, description="code that is published as last_error when this is taken")
    internal: bool = Field(False, description="do not leave and re-enter the state that this stands in")
    use: str | None = Field(None, description="answer as this other state does; stands alone")

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

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        if not isinstance(data, Map):
            raise wrong_shape(f"expected {{after: DURATION, code: CODE}} or never, got {show(data)}")
        return data

    after: Written = Field(description="longest time for one attempt, a duration")
    code: str = Field(description="code that an attempt fails with which took longer")


def _timeout_kind(value: Any) -> str:
    return "limit" if isinstance(value, (Map, LimitNode)) or value != "never" else "never"


Timeout = Annotated[
    Annotated[LimitNode, Tag("limit")] | Annotated[Literal["never"], Tag("never")],
    Discriminator(_timeout_kind),
]


class RetryNode(Node):
    """How often and how patiently an operation is tried again."""

    attempts: Written = Field(description="attempts in all, the first included")
    backoff: Written = Field(None, description="pause between attempts, a duration")
    unless: Names = _many("codes that are not tried again")
    factor: Written = Field(None, description="how much longer every further pause is, 1 or more")
    jitter: Written = Field(None, description="share of each pause that is left to chance, 0 to 1")


class InvokeNode(Node):
    """An operation of a plugin that lives as long as its state."""

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        if isinstance(data, str):
            raise wrong_shape(f"expected a mapping, got {show(data)}; write {{do: {data}, timeout: ...}}")
        return data

    do: str = Field(description="operation, as PLUGIN.OPERATION")
    with_: dict[str, Written] = _by_name("arguments, by name", alias="with")
    timeout: Timeout | None = Field(
        None, description="limit of each attempt; must be written, `never` needs another way out of the state"
    )
    retry: RetryNode | None = Field(None, description="further attempts after an error")


_ENDS_HERE = "an element's end leads nowhere: the state goes on with the others"


class ElementEndNode(Node):
    """What is done when the operation for one element has ended."""

    ELSEWHERE = MappingProxyType(
        {
            "target": (
                _ENDS_HERE,
                "let the actions set a variable, and leave by 'always' with a guard on it",
            ),
            "guard": (_ENDS_HERE, "write '${ x if CONDITION else y }' in an argument of the action"),
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

    item: str = Field(description="what the element is called in the expressions below")
    in_: Written = Field(alias="in", description="list of elements, looked at again after every step")
    key: Written = Field(description="what tells elements apart; each is dealt with once in a mission")
    limit: Written = Field(None, description="largest number of operations at a time; otherwise all at once")
    when: Condition = Field(None, description="condition on the element; looked at until it holds")
    invoke: InvokeNode = Field(description="operation that is begun for the element")
    on_done: ElementEndNode | None = Field(
        None, description="what is done when the operation for an element has succeeded"
    )
    on_error: ElementEndNode | None = Field(None, description="what is done when it has failed for good")


class BudgetNode(Node):
    """The time that a state has over all visits in one mission."""

    after: Written = Field(description="time that the state has in all, a duration")
    code: str = Field(description="code that is published as last_error when the time is used up")
    target: str = Field(description="state to go to then, found in the nearest enclosing scope")
    do: Actions = _many("actions, in order")

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        if not isinstance(data, Map):
            wanted = "{after: DURATION, code: CODE, target: STATE}"
            raise wrong_shape(f"expected {wanted}, got {show(data)}")
        return data


class ItineraryNode(Node):
    """The list that a state walks."""

    items: Written = Field(description="list of targets")
    order: Written = Field(None, description="number for each `target`; the smallest is next")
    sweeps: Written = Field(None, description="how often the list is walked; 0: until something else ends it")
    on_abort: Literal["skip", "leave_open"] = Field(
        "skip", description="what itinerary.close_rest does to the targets that are still open"
    )
    source: str = Field("", description="what its observations name as their source; else the mission")


class StateNode(Node):
    """A state: what it does while active, and what makes it end."""

    summary: str = Field("", description="one sentence for people")
    type: Literal["parallel", "final", "history"] | None = Field(
        None,
        description="`parallel`: all children at once; `final`: an end; `history`: the child that was left",
    )
    depth: Literal["shallow", "deep"] | None = Field(
        None,
        description="of a history state: `shallow` is the child that was left, `deep` all inside it too",
    )
    initial: str | None = Field(
        None, description="child that is entered first; needed where several could be"
    )
    states: dict[str, StateNode | None] = _by_name("children, by name")
    entry: Actions = _many("actions on entering")
    exit: Actions = _many("actions on leaving")
    invoke: InvokeNode | None = Field(None, description="operation that lives as long as this state")
    on_done: Transitions = _many("when the operation has succeeded, or a final child is reached")
    on_error: Transitions = _many("when the operation has failed for good")
    on: dict[str, Transitions] = _by_name("by event: what it does")
    always: Transitions = _many("without an event: taken as soon as the guard is true")
    after: dict[str, Transitions] = _by_name(
        "by duration: what happens when the state has been active that long"
    )
    budget: BudgetNode | None = Field(None, description="time that this state has in one mission")
    for_each: ForEachNode | None = Field(None, description="one operation for every element of a list")
    itinerary: ItineraryNode | None = Field(None, description="the list that this state walks")
    use: str | None = Field(None, description="part whose states stand here")
    with_: dict[str, Written] = _by_name("by parameter: its value for this use of the part", alias="with")
    resume_at: Transitions = _many(
        "child to enter when history brings this state back; the first whose guard is true"
    )
    phase: str | None = Field(None, description="what is published as the phase while the state is active")
    paused: bool = Field(False, description="published as paused: waits for the operator")
    slot: Literal["mission"] | None = Field(
        None, description="in the lifecycle: the missions' states stand here"
    )
    history: Literal["shallow", "deep"] | None = Field(
        None, description="adds the child `history`, a target for going back to what was left"
    )


class ParameterNode(Node):
    """A setting: becomes a ROS parameter of the same name."""

    type: str = Field(description="such as duration, count, text, list of text")
    default: Written = Field(
        None, description="value when nobody sets it; only a part may leave it out: its users give it then"
    )
    unit: str | None = Field(None, description="unit of a number; a number in s is a duration")
    min: Bound = Field(None, description="smallest value")
    max: Bound = Field(None, description="largest value")
    summary: str = Field("", description="one sentence for people")


class CodeNode(Node):
    """A reason that can reach last_error."""

    label: str = Field(description="text for people")
    severity: Literal["info", "warn", "error"] = Field("warn", description="how bad it is")


class VariableNode(Node):
    """A context variable: written by `set`, kept in the snapshot."""

    type: str = Field(description="such as text, count, pose")
    default: Written = Field(description="value when the chart starts")
    summary: str = Field("", description="one sentence for people")


class LevelNode(Node):
    """A yes or no drawn from a number."""

    below: Written = Field(None, description="true below this value")
    above: Written = Field(None, description="true above this value; either this or `below` is written")
    hysteresis: Written = Field(None, description="how far the value must come back to be false again")


class InputNode(Node):
    """A live value of a plugin under the name that the chart reads it by."""

    value: str = Field(description="live value, as a plugin calls it")
    freshness: Written = Field(
        None, description="how long a report stays known, a duration; otherwise as the plugin says"
    )
    initial: Written = Field(None, description="value before the first report; unknown when not given")
    unit: str | None = Field(None, description="unit of the value, for the reader")
    min: Bound = Field(None, description="smallest value that is believed")
    max: Bound = Field(None, description="largest value that is believed")
    since: Literal["mission"] | None = Field(
        None,
        description="only what was reported since the mission began counts; "
        "of a list, only elements that were not reported just the same before it",
    )
    levels: dict[str, LevelNode] = _by_name("yes or no drawn from the number, by name")
    summary: str = Field("", description="one sentence for people")


class HoldNode(Node):
    """A suspension of the whole chart."""

    engage: str = Field(description="request (operator.pause) or level (input.estop) that engages it")
    release: Names = Field(description="requests that release it")
    code: str = Field(description="code that engaging reports")
    engage_guard: Condition = Field(None, description="when the request is allowed")
    engage_code: str | None = Field(None, description="code that refuses the request")
    release_guard: Condition = Field(None, description="when releasing is allowed")
    summary: str = Field("", description="one sentence for people")


class RequestFieldNode(Node):
    """A field of the request that starts a mission."""

    type: str = Field(description="such as count, duration, list of tag")
    default: Written = Field(None, description="value when the request does not say")
    not_empty: str | None = Field(None, description="code that refuses an empty list")
    min: Bound = Field(None, description="smallest value")
    summary: str = Field("", description="one sentence for people")


class InvariantNode(Node):
    """A condition that holds at every moment."""

    that: Condition = Field(description="what holds")
    summary: str = Field("", description="one sentence for people")

    @classmethod
    def _long_form(cls, data: Any) -> Any:
        if data is None or isinstance(data, list):
            raise wrong_shape(f"expected a condition, got {show(data)}; write 'NAME: CONDITION'")
        return data if isinstance(data, Map) else {"that": data}


class FileNode(Node):
    """What every kind of file may declare."""

    summary: str = Field("", description="one sentence for people")
    params: dict[str, ParameterNode] = _by_name("settings, by name")
    inputs: dict[str, InputNode] = _by_name("live values that are read, by the name that expressions use")
    codes: dict[str, CodeNode] = _by_name("reasons that can be reported, by name")
    context: dict[str, VariableNode] = _by_name("variables, by name")
    invariants: dict[
        str,
        Annotated[
            InvariantNode, BeforeValidator(_as_it_is, json_schema_input_type=str | bool | InvariantNode)
        ],
    ] = _by_name("conditions that hold at every moment; broken, they lead to FAULT")
    initial: str | None = Field(
        None, description="state that is entered first; needed where several could be"
    )
    states: dict[str, StateNode | None] = Field(description="states, by name")

    @property
    @abstractmethod
    def name(self) -> str:
        """The name that the file gives itself."""

    @property
    def title(self) -> str:
        """Kind and name, unique over the files of a chart."""
        return f"{type(self).__name__} {self.name}"


class LifecycleNode(FileNode):
    """What all missions share."""

    lifecycle: str = Field(description="name of the lifecycle")
    holds: dict[str, HoldNode] = _by_name("suspensions of the whole chart, by name")
    on: dict[str, Transitions] = _by_name("by event: what it does in every state")

    @property
    def name(self) -> str:
        """The name that the file gives itself."""
        return self.lifecycle


class MissionNode(FileNode):
    """A mission: stands in the slot of the lifecycle."""

    mission: str = Field(description="name of the mission, as requests call it")
    request: dict[str, RequestFieldNode] = _by_name("what the request that starts it carries, by name")
    entry: Actions = _many("actions when the mission starts")
    exit: Actions = _many("actions when the mission ends")
    on: dict[str, Transitions] = _by_name("by event: what it does in every state of the mission")

    @property
    def name(self) -> str:
        """The name that the file gives itself."""
        return self.mission


class PartNode(FileNode):
    """States that missions use, with parameters of their own."""

    part: str = Field(description="name of the part, also that of its file")
    needs: Literal["itinerary"] | None = Field(None, description="what the state that uses this must have")
    resume_at: Transitions = _many(
        "child to enter when history brings it back; the first whose guard is true"
    )

    @property
    def name(self) -> str:
        """The name that the file gives itself."""
        return self.part


KINDS: Mapping[str, type[FileNode]] = {"lifecycle": LifecycleNode, "mission": MissionNode, "part": PartNode}

_D = TypeVar("_D", bound=FileNode)


#: Every key that says what kind of file it stands in.
KEYS_OF_KINDS = (*KINDS, "binding")


def read_document(raw: Map, model: type[_D], findings: Findings) -> _D | None:
    """Validate a file against its model; None after findings."""
    kind = next(word for word, known in KINDS.items() if known is model)
    if not is_kind(raw, kind, findings):
        return None
    if kind != "part":
        want_defaults(raw, findings)
    return validate(raw, model, findings)


def want_defaults(raw: Map, findings: Findings) -> None:
    """Tell the parameters without a default: only a part has users who can give one."""
    params = raw.get("params")
    for name, written in params.items() if isinstance(params, Map) else ():
        if isinstance(written, Map) and "default" not in written:
            problem, hint = "the key 'default' is missing", "write 'default: ...'"
            findings.add(written.place, "missing-key", f"params.{name}", problem, hint)


def is_kind(raw: Map, kind: str, findings: Findings) -> bool:
    """Tell whether a file says that it is of a kind; a finding otherwise."""
    if kind in raw:
        return True
    other = next((word for word in KEYS_OF_KINDS if word in raw), None)
    what = f"this is a {other}" if other else "the file does not say what it is"
    place = raw.key_place(other) if other else raw.place
    findings.add(place, "wrong-shape", "", f"expected a {kind}, but {what}", f"begin with '{kind}: NAME'")
    return False


def validate(raw: Map, model: type[_M], findings: Findings) -> _M | None:
    """Read the mapping of a whole file as `model`; None after findings that leave nothing to go on with."""
    for _ in range(MAX_PRUNINGS):
        try:
            return model.model_validate(raw)
        except ValidationError as error:
            found = error.errors(include_url=False)
        for details in found:
            _report(raw, details, findings)
        if any(details["type"] != "extra_forbidden" for details in found):
            return None
        for details in found:
            _prune(raw, details)
    return None


def _prune(raw: Map, details: ErrorDetails) -> None:
    """Drop an unknown key that has been told, so that the rest of the file can still be read."""
    *steps, key = (str(step) for step in details["loc"])
    holder: Any = raw
    for step in steps:
        if isinstance(holder, Map) and step in holder:
            holder = holder[step]
        elif isinstance(holder, Seq) and step.isdigit() and int(step) < len(holder):
            holder = holder[int(step)]
    if isinstance(holder, Map):
        holder.pop(key, None)


def _report(raw: Map, details: ErrorDetails, findings: Findings) -> None:
    """Turn one of pydantic's errors into a finding at the deepest place that its path still meets."""
    found: Any = raw
    place, trail, missing = raw.place, [], ""
    for step in details["loc"]:
        name = str(step)
        if isinstance(found, Map) and name in found:
            place, missing = found.value_place(name), ""
            found, last = found[name], found.key_place(name)
            trail.append(name)
        elif isinstance(found, Seq) and isinstance(step, int) and step < len(found):
            place, missing = found.place_of(step), ""
            found, last = found[step], place
            trail.append(name)
        else:
            missing = name
    path = ".".join(trail)
    kind = details["type"]
    if kind == "extra_forbidden":
        _unknown_key(raw, trail, last, findings)
    elif kind == "missing":
        hint = f"write '{missing}: ...'"
        findings.add(place, "missing-key", path, f"the key {missing!r} is missing", hint)
    elif kind == "wrong-shape":
        problem, _, hint = details["msg"].partition("; ")
        findings.add(place, "wrong-shape", path, problem, hint)
    else:
        findings.add(place, "wrong-shape", path, *_expected(details, found))


def _unknown_key(raw: Map, trail: list[str], place: Place, findings: Findings) -> None:
    key, path = trail[-1], ".".join(trail[:-1])
    holder: Any = raw
    for name in trail[:-1]:
        holder = holder[int(name)] if isinstance(holder, Seq) else holder[name]
    if holder.model and key in holder.model.ELSEWHERE:
        findings.add(place, "wrong-shape", path, *holder.model.ELSEWHERE[key])
        return
    known = keys_of(holder.model) if holder.model else ()
    if holder[key] is None and " " in key:
        hint = "if it belongs to the text before it, quote that text: an unquoted comma begins a new key"
        findings.add(place, "unknown-key", path, f"unknown key {key!r}", hint)
        return
    findings.unknown(place, "unknown-key", path, "key", key, known)


def keys_of(model: type[Node]) -> tuple[str, ...]:
    """Return the keys that a mapping of this model may have."""
    return tuple(field.alias or name for name, field in model.model_fields.items())


_SHAPES: Mapping[str, str] = {
    "model_type": "a mapping",
    "dict_type": "a mapping",
    "list_type": "a list",
    "string_type": "text",
    "bool_type": "true or false",
}


def _expected(details: ErrorDetails, found: Any) -> tuple[str, str]:
    """Return problem and hint for a value of the wrong shape."""
    kind = details["type"]
    if kind == "literal_error":
        allowed = str(details["ctx"]["expected"])
        hint = meant(found, re.findall(r"'([^']+)'", allowed)) if isinstance(found, str) else ""
        return f"expected {allowed}, got {show(found)}", hint
    return f"expected {_SHAPES.get(kind) or details['msg']}, got {show(found)}", ""


def show(value: Any) -> str:
    """Return a value as a person would recognise it: short, without the machinery around it."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return "a mapping" + (f" with {_some(value)}" if value else "")
    if isinstance(value, list):
        return f"a list of {len(value)}"
    text = repr(str(value)) if isinstance(value, Text) else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _some(names: Iterable[str]) -> str:
    shown = [repr(name) for name in names]
    return ", ".join(shown[:4]) + (", ..." if len(shown) > 4 else "")


__all__ = [
    "KINDS",
    "ActionNode",
    "BudgetNode",
    "CodeNode",
    "ElementEndNode",
    "FileNode",
    "ForEachNode",
    "HoldNode",
    "InputNode",
    "InvariantNode",
    "InvokeNode",
    "ItineraryNode",
    "LevelNode",
    "LifecycleNode",
    "LimitNode",
    "MissionNode",
    "Node",
    "ParameterNode",
    "PartNode",
    "RequestFieldNode",
    "RetryNode",
    "StateNode",
    "TransitionNode",
    "VariableNode",
    "is_kind",
    "keys_of",
    "read_document",
    "show",
    "validate",
    "want_defaults",
    "wrong_shape",
]
