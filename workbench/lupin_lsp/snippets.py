"""Snippets and example values for the schemas; a test holds each against its model's schema."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

Snippet = Mapping[str, Any]


def _snippet(label: str, description: str, body: Any) -> Snippet:
    return MappingProxyType({"label": label, "description": description, "body": body})


_LIMIT = {"after": "${2:30 s}", "code": "${3:CODE}"}
_INVOKE = {"do": "${1:plugin.operation}", "timeout": _LIMIT}

#: By model: what can stand for one of it.
SNIPPETS: Mapping[str, tuple[Snippet, ...]] = MappingProxyType(
    {
        "StateNode": (
            _snippet(
                "state that does something",
                "an operation with a limit, and where its ends lead",
                {"invoke": _INVOKE, "on_done": "${4:STATE}", "on_error": "${5:STATE}"},
            ),
            _snippet("state that waits", "for a time", {"after": {"${1:5 s}": "${2:STATE}"}}),
            _snippet(
                "state with states inside",
                "the first of them is entered",
                {"initial": "${1:CHILD}", "states": {"${1:CHILD}": {"summary": "${2}"}}},
            ),
            _snippet(
                "state that walks a list",
                "an itinerary, and a part that is done at each target",
                {
                    "itinerary": {"items": "${1:'\\${ request.FIELD \\}'}"},
                    "use": "${2:part}",
                    "on_done": "${3:STATE}",
                },
            ),
            _snippet("final state", "an end", {"type": "final"}),
        ),
        "InvokeNode": (
            _snippet("operation", "an operation with a limit", _INVOKE),
            _snippet(
                "operation with arguments",
                "and further attempts after an error",
                {
                    "do": "${1:plugin.operation}",
                    "with": {"${2:argument}": "${3:value}"},
                    "timeout": {"after": "${4:30 s}", "code": "${5:CODE}"},
                    "retry": {"attempts": "${6:2}", "backoff": "${7:1 s}"},
                },
            ),
        ),
        "LimitNode": (
            _snippet("limit", "how long one attempt may take", {"after": "${1:30 s}", "code": "${2:CODE}"}),
        ),
        "RetryNode": (
            _snippet("retry", "further attempts", {"attempts": "${1:2}", "backoff": "${2:1 s}"}),
            _snippet(
                "retry with growing pauses",
                "each pause longer than the one before",
                {"attempts": "${1:5}", "backoff": "${2:1 s}", "factor": "${3:2}", "jitter": "${4:20 %}"},
            ),
        ),
        "ForEachNode": (
            _snippet(
                "one operation for every element",
                "of a list that may grow",
                {
                    "item": "${1:element}",
                    "in": "${2:'\\${ input.LIST \\}'}",
                    "key": "${3:'\\${ element.id \\}'}",
                    "invoke": {"do": "${4:plugin.operation}", "timeout": "never"},
                },
            ),
        ),
        "ItineraryNode": (
            _snippet("itinerary", "a list to walk", {"items": "${1:'\\${ request.FIELD \\}'}"}),
            _snippet(
                "itinerary, the nearest first",
                "in an order, several times",
                {
                    "items": "${1:'\\${ request.FIELD \\}'}",
                    "order": "${2:'\\${ target.x \\}'}",
                    "sweeps": "${3:1}",
                },
            ),
        ),
        "BudgetNode": (
            _snippet(
                "budget",
                "time over all visits of one mission",
                {"after": "${1:5 min}", "code": "${2:CODE}", "target": "${3:STATE}"},
            ),
        ),
        "TransitionNode": (
            _snippet(
                "transition with a guard",
                "taken only when the condition holds",
                {"target": "${1:STATE}", "guard": "${2:condition}"},
            ),
            _snippet(
                "transition with actions",
                "they are done on the way",
                {"target": "${1:STATE}", "do": [{"set": {"${2:variable}": "${3:value}"}}]},
            ),
            _snippet("refusal", "answers a request with a reason", {"refuse": "${1:CODE}"}),
        ),
        "Action": (
            _snippet("set", "write a variable", {"set": {"${1:variable}": "${2:value}"}}),
            _snippet("raise", "let an event happen", {"raise": {"event": "${1:name}"}}),
            _snippet("if", "choose", {"if": {"guard": "${1:condition}", "then": ["${2:action}"]}}),
        ),
        "lupin": (
            _snippet(
                "mission",
                "a new mission",
                {
                    "mission": "${1:NameOfTheMission}",
                    "summary": "${2:What it does, in one sentence.}",
                    "initial": "${3:PREPARE}",
                    "states": {"${3:PREPARE}": {"after": {"1 s": "done"}}, "done": {"type": "final"}},
                },
            ),
            _snippet(
                "part",
                "states that missions use",
                {
                    "part": "${1:name_of_the_file}",
                    "summary": "${2:What it does, in one sentence.}",
                    "initial": "${3:FIRST}",
                    "states": {"${3:FIRST}": {"after": {"1 s": "over"}}, "over": {"type": "final"}},
                },
            ),
        ),
    }
)

#: Values as people write them, by `Model.key`.
EXAMPLES: Mapping[str, tuple[Any, ...]] = MappingProxyType(
    {
        "TransitionNode.target": ("WORKING", "ROUND.DRIVING", "MISSION.history"),
        "TransitionNode.guard": ("input.charge.low", "len(request.places) > 0", "in_state('WORKING')"),
        "InvokeNode.do": ("nav.go_to",),
        "LimitNode.after": ("30 s", "${ param.timeout_s }"),
        "RetryNode.attempts": (3,),
        "RetryNode.backoff": ("1 s",),
        "RetryNode.jitter": ("20 %",),
        "BudgetNode.after": ("5 min",),
        "BeforeDivertNode.within": ("60 s",),
        "ParameterNode.type": ("duration", "count", "list of text"),
        "ParameterNode.default": ("30 s", 3, True),
        "ParameterNode.unit": ("m/s",),
        "VariableNode.type": ("text",),
        "InputNode.value": ("robot.charge",),
        "LevelNode.below": ("20 %",),
        "HoldNode.engage": ("operator.pause", "input.danger"),
        "ItineraryNode.items": ("${ request.places }",),
        "ItineraryNode.order": ("${ distance(input.pose, approach(target)) }",),
        "ForEachNode.key": ("${ place.id }",),
    }
)
