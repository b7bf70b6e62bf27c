"""The models are the one list of what may be written."""

from __future__ import annotations

import json

import pytest

from lupin_engine.chart.documents import (
    KINDS,
    FileNode,
    MissionNode,
    Node,
    PartNode,
    TransitionNode,
    keys_of,
    read_document,
)
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.source import Map, parse


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
    return [model for model in found if model.__module__ == Node.__module__]


@pytest.mark.parametrize("model", all_models(), ids=lambda model: model.__name__)
def test_every_key_is_described(model: type[Node]) -> None:
    """The editor shows the description."""
    undescribed = [name for name, field in model.model_fields.items() if not field.description]
    assert undescribed == ([] if model.__name__ != "ActionNode" else ["name", "arguments"])


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
    assert keys_of(PartNode)[:3] == ("summary", "params", "inputs")
