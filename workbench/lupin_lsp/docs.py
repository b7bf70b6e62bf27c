"""Formats descriptions of the language and of plugins as Markdown, for hover and completion.

Models, catalog and missions describe themselves; the tables here describe the engine's own calls, roots and
actions.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any

from pydantic.fields import FieldInfo

from lupin_engine.chart import Field, Hold, Input, Kind, State, Variable, builtin_actions, named_in
from lupin_engine.errors import Severity
from lupin_engine.plugin import (
    UNITS,
    Action,
    Argument,
    Code,
    EventKind,
    Function,
    LiveValue,
    OnHold,
    Operation,
    Parameter,
    Profile,
    Type,
    number_text,
)

#: Built-in functions of expressions: signature, and description of the result.
CALLS: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "len": ("len(list or text) -> count", "How many elements, or characters."),
        "min": ("min(list) or min(number, number, ...) -> number", "The smallest."),
        "max": ("max(list) or max(number, number, ...) -> number", "The largest."),
        "abs": ("abs(number) -> number", "The number without its sign."),
        "round": (
            "round(number, digits) -> number",
            "The nearest number with so many digits, 0 to 9; without `digits` a whole number.",
        ),
        "any": ("any(list of bool) -> bool", "Whether one of them is true."),
        "all": ("all(list of bool) -> bool", "Whether all of them are true."),
        "sum": ("sum(list of number) -> number", "What they come to; of none 0."),
        "first": ("first(list, default) -> element", "The first element, or the default when there is none."),
        "find": (
            "find(list, condition of t) -> element",
            "The first element `t` for which the condition holds; unknown when there is none.",
        ),
        "sorted": (
            "sorted(list, number or text of t) -> list",
            "The elements by what is said of each, `t`; the smallest first.",
        ),
        "known": (
            "known(input.NAME) -> bool",
            "Whether that live value was reported and is still fresh; of `find(...)`, whether there is one.",
        ),
        "held": ("held(HOLD) -> bool", "Whether that hold is engaged."),
        "in_state": ("in_state('STATE') -> bool", "Whether a state is active whose full name ends so."),
        "was_in_state": ("was_in_state('STATE') -> bool", "In properties: whether it was before the step."),
    }
)
#: The records that an expression reads from.
ROOTS: Mapping[str, str] = MappingProxyType(
    {
        "param": "The settings: of this file, of the lifecycle, of the plugins.",
        "request": "What the request carried that started the mission.",
        "input": "The live values.",
        "event": "What came with the event, or the result of the operation or state that has ended.",
        "error": "Why the operation failed: `code` and `detail`; `result`, if it was cut short.",
        "target": "The element of the itinerary that is visited now.",
        "clock": "What the robot's clock shows in the zone `param.time_zone`: `today` and `time`.",
        "this_step": "In properties: the step, with what it accepted, released, began and ended.",
        "itinerary": "How far the itinerary is: `open`, `remaining`, `total`, `closed`, `sweep`.",
    }
)
#: What the engine's own actions do.
ACTIONS: Mapping[str, str] = MappingProxyType(
    {
        "set": "Write variables: `set: {NAME: VALUE}`.",
        "add": "Put something into a list or set that has a `max`: `add: {NAME: VALUE}`.",
        "remove": "Take something out of a list or set, wherever it stands: `remove: {NAME: VALUE}`.",
        "raise": "Let an event happen: `raise: {event: NAME, with: {FIELD: VALUE}}`.",
        "if": "Choose: `if: {guard: CONDITION, then: ACTIONS, else: ACTIONS}`.",
        "itinerary.advance": "Go on to the next target of the itinerary.",
        "itinerary.close": "End the visit of the current target, once.",
        "itinerary.close_rest": "Close all targets that are still open.",
        "report.clear": "Forget the last error.",
        "report.note": "Say something in the log and in the story of the run.",
        "report.summary": "Publish the summary of the mission.",
    }
)
_KINDS = {
    Kind.ATOMIC: "state",
    Kind.COMPOUND: "state with states inside",
    Kind.PARALLEL: "parallel state",
    Kind.FINAL: "final state",
    Kind.HISTORY: "history state",
}
_ON_HOLD = {
    OnHold.CANCEL: "A hold cancels it; it is begun again when the hold is released.",
    OnHold.FINISH: "A hold lets it finish; its answer waits for the release.",
}


def code(text: str) -> str:
    """Return a signature or a declaration to be shown in one piece."""
    return f"```text\n{text}\n```"


def paragraphs(*texts: str) -> str:
    """Join the texts that are not empty."""
    return "\n\n".join(text for text in texts if text)


def type_text(kind: Type) -> str:
    """Return a type as people read it: with the fields of a record and the unit of a number."""
    shown = kind.name
    if kind.kind == "number" and kind.unit and kind.unit not in shown:
        shown += f" in {kind.unit}"
    if kind.fields:
        shown += " {" + ", ".join(f"{name}: {inner}" for name, inner in kind.fields.items()) + "}"
    named = named_in(kind)
    if named is not None:
        parts = (f"{name} ({inner.unit})" if inner.unit else name for name, inner in named[1].named.items())
        shown += f", by name: {', '.join(parts)}"
    return shown


def quantity(value: Any, kind: Type) -> str:
    """Return a value as a file would write it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (int, float)):
        return " ".join(number_text(value, kind.unit)).strip()
    if isinstance(value, Mapping):
        return (
            "{" + ", ".join(f"{k}: {quantity(v, kind.fields.get(k, kind))}" for k, v in value.items()) + "}"
        )
    return repr(value) if isinstance(value, str) else str(value)


def range_text(low: float | None, high: float | None, kind: Type) -> str:
    """Return the range of a number."""
    if low is not None and high is not None:
        return f"{quantity(low, kind)} to {quantity(high, kind)}"
    if low is not None:
        return f"at least {quantity(low, kind)}"
    return f"at most {quantity(high, kind)}" if high is not None else ""


def arguments(wanted: Mapping[str, Argument]) -> str:
    """Return the arguments of something as a list."""
    return "\n".join(f"- {argument_line(name, argument)}" for name, argument in wanted.items())


def argument_line(name: str, argument: Argument) -> str:
    """Return one argument in a line."""
    kind, extra = argument.type, []
    if argument.default is not None:
        extra.append(f"default {quantity(argument.default, kind)}")
    elif argument.optional:
        extra.append("may be left out")
    limits = range_text(kind.minimum, kind.maximum, kind)
    extra += [limits] if limits else []
    return f"`{name}`: {type_text(kind)} — {argument.doc}" + (f" ({', '.join(extra)})" if extra else "")


def operation(name: str, found: Operation) -> str:
    """Describe an operation: arguments, result, codes, resources."""
    signature = f"{name}({_names(found.arguments)})"
    if found.result:
        signature += " -> {" + ", ".join(f"{key}: {kind}" for key, kind in found.result.items()) + "}"
    codes = ", ".join(f"`{each.name}` ({each.label})" for each in found.codes)
    return paragraphs(
        code(f"operation {signature}"),
        found.doc,
        arguments(found.arguments),
        f"Fails with: {codes}." if codes else "",
        f"Uses: {', '.join(found.uses)}." if found.uses else "",
        _ON_HOLD[found.on_hold],
        "Cancelled, it gives its result as far as it came." if found.cut_short else "",
        "Its server takes a new goal in place of the old one." if found.updates else "",
        "It goes on when the orchestrator was started again." if found.adopts else "",
    )


def action(name: str, found: Action) -> str:
    """Describe a plugin's action."""
    moves = "It moves the robot: while held it waits for the release." if found.moves else ""
    head = code(f"action {name}({_names(found.arguments)})")
    return paragraphs(head, found.doc, arguments(found.arguments), moves)


def builtin_actions_of(profile: Profile) -> Mapping[str, str]:
    """Return the descriptions of the engine's own actions, and of the profile's publications."""
    return {**ACTIONS, **{name: publication.doc for name, publication in profile.publications.items()}}


def builtin_action(name: str, profile: Profile) -> str:
    """Describe one of the engine's own actions."""
    wanted = builtin_actions(profile).get(name, {})
    doc = builtin_actions_of(profile).get(name, "")
    return paragraphs(code(f"action {name}({_names(wanted)})"), doc, arguments(wanted))


def function(name: str, found: Function) -> str:
    """Describe a function of a plugin."""
    return paragraphs(code(signature(name, found)), found.doc, arguments(found.arguments))


def signature(name: str, found: Function) -> str:
    """Return a function's signature."""
    shown = ", ".join(f"{key}: {each.type}" for key, each in found.arguments.items())
    return f"{name}({shown}) -> {type_text(found.returns)}"


def call(name: str) -> str:
    """Describe one of the engine's own calls."""
    signature, doc = CALLS[name]
    return paragraphs(code(signature), doc)


def event(name: str, found: EventKind) -> str:
    """Describe a plugin's event, with its fields."""
    fields = "\n".join(f"- `event.{key}`: {type_text(kind)}" for key, kind in found.fields.items())
    return paragraphs(code(f"event {name}"), found.doc, fields)


def live_value(name: str, found: LiveValue) -> str:
    """Describe a live value."""
    facts = [f"Known for {found.freshness:g} s." if found.freshness is not None else ""]
    if found.initial is not None:
        facts.append(f"Before the first report: {quantity(found.initial, found.type)}.")
    return paragraphs(code(f"{name}: {type_text(found.type)}"), found.doc, " ".join(filter(None, facts)))


def parameter(name: str, found: Parameter, origin: str = "") -> str:
    """Describe a parameter: type, unit, default and range."""
    facts = [f"Default: {quantity(found.default, found.type)}"]
    limits = range_text(found.minimum, found.maximum, found.type)
    facts += [f"range: {limits}"] if limits else []
    head = code(f"param.{name}: {type_text(found.type)}")
    return paragraphs(head, found.doc, "; ".join(facts) + ".", f"From {origin}." if origin else "")


def request_field(found: Field, summary: str) -> str:
    """Describe a field of a mission's request."""
    return paragraphs(code(f"request.{found.name}: {type_text(found.type)}"), summary)


def reason(found: Code) -> str:
    """Describe a code: label and severity."""
    return paragraphs(code(f"code {found.name}"), f"{found.label} ({Severity(found.severity).name.lower()})")


def hold(found: Hold, summary: str = "") -> str:
    """Describe a hold: the events that engage and release it."""
    released = " or ".join(f"`{name}`" for name in found.release)
    facts = f"Engaged by `{found.engage}`, released by {released}; reports `{found.code}`."
    return paragraphs(code(f"hold {found.name}"), summary, facts)


def live_input(found: Input, summary: str, source: LiveValue | None) -> str:
    """Describe an input: its live value, and its levels."""
    limits = range_text(found.minimum, found.maximum, found.type)
    facts = [
        f"The live value `{found.value}`" + (f": {source.doc}" if source else "") + ".",
        f"Known for {found.freshness:g} s." if found.freshness is not None else "",
        f"Before the first report: {quantity(found.initial, found.type)}."
        if found.initial is not None
        else "",
        f"Range: {limits}." if limits else "",
        f"Levels: {', '.join(f'`{level.name}`' for level in found.levels)}." if found.levels else "",
    ]
    return paragraphs(code(f"input.{found.name}: {type_text(found.type)}"), summary, *facts)


def variable(found: Variable, summary: str) -> str:
    """Describe a context variable: type and first value."""
    source = getattr(found.default, "source", None)
    begins = f"${{ {source} }}" if source else quantity(getattr(found.default, "value", None), found.type)
    return paragraphs(code(f"{found.name}: {type_text(found.type)}"), summary, f"At start: {begins}.")


def state(name: str, found: State, file: str) -> str:
    """Describe a state: its summary, full name and file."""
    facts = [_KINDS[found.kind]]
    facts += [f"published as phase {found.phase}"] if found.phase else []
    facts += [f"does `{found.invoke.name}`"] if found.invoke else []
    return paragraphs(code(f"state {name}"), found.summary, f"{', '.join(facts)}; {file}")


def key(name: str, field: FieldInfo | None, words: Iterable[str] = ()) -> str:
    """Describe a word of the language."""
    described = field.description or "" if field else ""
    facts = [f"One of {', '.join(f'`{word}`' for word in words)}."] if words else []
    if field is not None and field.is_required():
        facts.append("Must be written.")
    return paragraphs(f"**{name}** — {described}" if described else f"**{name}**", " ".join(facts))


def unit(name: str) -> str:
    """Describe a unit."""
    base, factor = UNITS[name]
    return f"1 {name} is {factor:g} {base}".strip() if base != name else f"base unit {name}"


def _names(wanted: Mapping[str, Argument]) -> str:
    return ", ".join(f"{name}?" if each.optional else name for name, each in wanted.items())
