"""The models are the one list of what may be written."""

from __future__ import annotations

import json
from typing import Any

import pytest

from lupin_engine.chart.documents import KINDS, FileNode, MissionNode, PartNode, TransitionNode
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.nodes import Node, keys_of, show
from lupin_engine.chart.source import Map, parse
from lupin_engine.chart.validation import read_document


def mission(text: str) -> MissionNode:
    """Read a mission that must be right."""
    findings = Findings()
    raw = parse(text, "m.yaml", findings)
    assert isinstance(raw, Map)
    node = read_document(raw, MissionNode, findings)
    assert findings.all == ()
    assert node is not None
    return node


def all_models() -> list[type[Node]]:
    """Every model of the language."""
    found: list[type[Node]] = []
    waiting: list[type[Node]] = [Node]
    while waiting:
        model = waiting.pop()
        waiting.extend(model.__subclasses__())
        found.append(model)
    return [model for model in found if model.__module__ == FileNode.__module__]


@pytest.mark.parametrize("model", all_models(), ids=lambda model: model.__name__)
def test_every_key_is_described(model: type[Node]) -> None:
    """The editor shows the description."""
    undescribed = [name for name, field in model.model_fields.items() if not field.description]
    assert undescribed == ([] if model.__name__ != "ActionNode" else ["name", "arguments"])


@pytest.mark.parametrize("model", all_models(), ids=lambda model: model.__name__)
def test_a_summary_may_be_left_out(model: type[Node]) -> None:
    """Then it is empty, and nothing is shown."""
    summary = model.model_fields.get("summary")
    assert summary is None or summary.default == ""


@pytest.mark.parametrize("model", all_models(), ids=lambda model: model.__name__)
def test_what_stands_elsewhere_is_no_key_here(model: type[Node]) -> None:
    """Else the explanation would never be told."""
    assert not set(model.ELSEWHERE) & set(keys_of(model))


@pytest.mark.parametrize("model", KINDS.values(), ids=lambda model: model.__name__)
def test_a_schema_can_be_made_of_every_kind_of_file(model: type[FileNode]) -> None:
    """Completion and checking in editors come from it."""
    schema = model.model_json_schema(by_alias=True)
    assert "additionalProperties" in schema
    assert "use" in json.dumps(schema)


@pytest.mark.parametrize(
    ("written", "targets"),
    [
        ("B", ["B"]),
        ("{target: B}", ["B"]),
        ("[B, {target: C, guard: x}]", ["B", "C"]),
        ("{do: {raise: {event: x}}}", [None]),
    ],
)
def test_transitions_have_short_forms(written: str, targets: list[str | None]) -> None:
    """Text, mapping or list: one meaning."""
    node = mission(f"mission: M\nstates:\n  A: {{on_done: {written}}}\n").states["A"]
    assert node is not None
    assert [transition.target for transition in node.on_done] == targets


def test_short_forms_know_their_place() -> None:
    """A finding about a short form points at it."""
    node = mission("mission: M\nstates:\n  A:\n    on_done: B\n    entry: [report.summary]\n").states["A"]
    assert node is not None
    assert (node.on_done[0].place.line, node.on_done[0].place.column) == (4, 14)
    assert (node.entry[0].place.line, node.entry[0].place.column) == (5, 13)
    assert node.on_done[0].at("target") == node.on_done[0].place


def test_the_keys_of_a_model_are_those_that_are_written() -> None:
    """`with`, not the name that Python needs."""
    assert "use" in keys_of(TransitionNode)
    assert keys_of(PartNode)[:3] == ("lupin", "summary", "types")


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (None, "nothing"),
        (True, "true"),
        (False, "false"),
        (5, "5"),
        (0.5, "0.5"),
        ("x", "'x'"),
        ({}, "a mapping"),
        ({"a": 1}, "a mapping with 'a'"),
        (dict.fromkeys("abcd", 1), "a mapping with 'a', 'b', 'c', 'd'"),
        (dict.fromkeys("abcde", 1), "a mapping with 'a', 'b', 'c', 'd', ..."),
        ([], "a list of 0"),
        (["a", "b"], "a list of 2"),
        ("x" * 58, f"'{'x' * 58}'"),
        ("x" * 59, f"'{'x' * 56}..."),
    ],
)
def test_a_value_is_shown_as_a_person_would_know_it(value: Any, shown: str) -> None:
    """Short, without the machinery around it."""
    assert show(value) == shown


def told(text: str, kind: str = "mission") -> list[str]:
    """Return what is said of a file by itself."""
    findings = Findings()
    raw = parse(text, "m.yaml", findings)
    assert isinstance(raw, Map)
    read_document(raw, KINDS[kind], findings)
    return [str(one).removeprefix("m.yaml:") for one in findings.all]


@pytest.mark.parametrize(
    ("written", "problem"),
    [
        ("phase: 5", "12: error: states.A.phase: expected text, got 5"),
        ("paused: maybe", "13: error: states.A.paused: expected true or false, got 'maybe'"),
        ("states: x", "13: error: states.A.states: expected a mapping, got 'x'"),
        ("states: []", "13: error: states.A.states: expected a mapping, got a list of 0"),
        ("on: 3", "9: error: states.A.on: expected {EVENT: STATE}, got 3"),
        ("itinerary: x", "16: error: states.A.itinerary: expected {items: LIST}, got 'x'"),
        (
            "type: {a: 1}",
            "11: error: states.A.type: expected 'parallel', 'final' or 'history', got a mapping with 'a'",
        ),
        (
            "type: finale",
            "11: error: states.A.type: expected 'parallel', 'final' or 'history', got 'finale'; "
            "did you mean 'final'?",
        ),
        ("type: x", "11: error: states.A.type: expected 'parallel', 'final' or 'history', got 'x'"),
        (
            "entry: [3]",
            "13: error: states.A.entry.0: "
            "expected an action: a name, or a mapping of one name to its arguments",
        ),
        (
            "entry: [{set: 3}]",
            "13: error: states.A.entry.0: expected the arguments of set as a mapping, got 3",
        ),
        (
            "invoke: nav.dock",
            "13: error: states.A.invoke: expected a mapping, got 'nav.dock'; "
            "write {do: nav.dock, timeout: ...}",
        ),
        (
            "invoke: {do: nav.dock, timeout: 5 s}",
            "37: error: states.A.invoke.timeout: expected {after: DURATION, code: CODE} or never, got '5 s'; "
            "write 'timeout: {after: 5 s, code: CODE}'",
        ),
        (
            "budget: 5 s",
            "13: error: states.A.budget: expected {after: DURATION, code: CODE, target: STATE}, got '5 s'; "
            "write 'budget: {after: 5 s, code: CODE, target: STATE}'",
        ),
        (
            "on_done: {after: 1 s}",
            "15: error: states.A.on_done: a transition has no delay; "
            "go to a state that waits: 'after: {1 s: STATE}'",
        ),
    ],
)
def test_a_value_of_the_wrong_shape_is_told(written: str, problem: str) -> None:
    """What is expected, in words of the language, and what stands there."""
    (found,) = told(f"mission: M\nstates:\n  A:\n    {written}\n")
    assert found == f"4:{problem} [wrong-shape]"


@pytest.mark.parametrize(
    ("key", "hint"),
    [
        ("target", "let the actions set a variable, and leave by 'always' with a guard on it"),
        ("guard", "let the actions choose: 'if: {guard: CONDITION, then: ACTION}'"),
        ("code", "hand the code to an action"),
    ],
)
def test_the_end_of_an_element_leads_nowhere(key: str, hint: str) -> None:
    """What to do instead."""
    each = f"{{item: x, in: [], key: 1, invoke: {{do: a.b, timeout: never}}, on_done: {{do: [], {key}: B}}}}"
    (found,) = told(f"mission: M\nstates:\n  A:\n    for_each: {each}\n")
    assert found.partition(": error: ")[2] == (
        "states.A.for_each.on_done: an element's end leads nowhere: the state goes on with the others; "
        f"{hint} [wrong-shape]"
    )


def test_an_unquoted_comma_begins_a_key() -> None:
    """The commonest slip in flow style is told as what it is; after unknown keys the rest is read."""
    assert told(
        "mission: M\nsummary: s\nstates:\n  A: {summary: first, then second, phase: 5, fase: 1}\n"
    ) == [
        "4:23: error: states.A: unknown key 'then second'; "
        "if it belongs to the text before it, quote that text: "
        "an unquoted comma begins a new key [unknown-key]",
        "4:43: error: states.A.phase: expected text, got 5 [wrong-shape]",
        "4:46: error: states.A: unknown key 'fase'; did you mean 'phase'? [unknown-key]",
    ]


def test_what_is_not_written_is_looked_for_where_it_should_be() -> None:
    """The place of a key that is missing is that of the mapping around it, as deep as there is one."""
    node = mission("mission: M\nstates:\n  A:\n    on: {operator.dock: B}\n").states["A"]
    assert node is not None
    assert (node.key_at("phase"), node.value_at("phase"), node.at("phase")) == (node.place,) * 3
    assert node.key_at("on", "operator.dock").column == 10
    assert node.key_at("on", "operator.reset") == node.key_at("on")
    assert node.value_at("on", "operator.dock").column == 25
    assert node.value_at("on", "operator.reset") == node.value_at("on")
    assert node.mapping("on") == {"operator.dock": "B"}
    assert node.mapping("phase") is None


def test_what_is_left_out_is_as_if_it_were_not_there() -> None:
    """No summary, no flag, no list: nothing is implied."""
    read = mission(
        "mission: M\nparams: {p: {type: count, default: 1}}\nstates:\n  A: {on_done: {target: B}}\n  B:\n"
    )
    (state, empty), parameter = read.states.values(), read.params["p"]
    assert (empty, read.summary, read.initial, parameter.summary) == (None, "", None, "")
    assert state is not None
    (transition,) = state.on_done
    assert (transition.internal, transition.guard, list(transition.do)) == (False, None, [])
    assert (state.paused, state.summary, state.phase, state.slot, dict(state.on)) == (
        False,
        "",
        None,
        None,
        {},
    )


@pytest.mark.parametrize(
    ("kind", "title"),
    [("mission", "MissionNode x"), ("lifecycle", "LifecycleNode x"), ("part", "PartNode x")],
)
def test_a_file_is_known_by_its_kind_and_name(kind: str, title: str) -> None:
    """A part may be called like a mission."""
    findings = Findings()
    raw = parse(f"{kind}: x\nstates: {{}}\n", "m.yaml", findings)
    assert isinstance(raw, Map)
    node = read_document(raw, KINDS[kind], findings)
    assert node is not None
    assert (node.name, node.title) == ("x", title)


def test_editors_know_what_an_expression_may_stand_for() -> None:
    """A value may be text or what it is, a condition text or yes-or-no, a bound text or a number."""
    known = MissionNode.model_json_schema(by_alias=True)["$defs"]

    def key(model: str, name: str) -> Any:
        found = dict(known[model]["properties"][name])
        return {word: found[word] for word in found if word not in ("description", "title", "default")}

    assert key("VariableNode", "default") == {"type": ["string", "number", "boolean", "array", "object"]}
    assert key("TransitionNode", "guard") == {"type": ["string", "boolean"]}
    assert key("ParameterNode", "min") == {"type": ["string", "number"]}
    assert key("StateNode", "entry") == {
        "type": "array",
        "items": {"type": ["string", "object"], "maxProperties": 1},
    }
    assert key("RetryNode", "unless") == {
        "anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}]
    }


def test_a_file_of_another_kind_is_told_as_that() -> None:
    """By the key that says what it is."""
    for kind in ("lifecycle", "part", "binding"):
        assert told(f"{kind}: x\nstates: {{}}\n") == [
            f"1:1: error: expected a mission, but this is a {kind}; begin with 'mission: NAME' [wrong-shape]"
        ]
    assert told("states: {}\n") == [
        "1:1: error: expected a mission, but the file does not say what it is; "
        "begin with 'mission: NAME' [wrong-shape]"
    ]
