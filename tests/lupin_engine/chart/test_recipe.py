"""The recipe of docs/CONTRIBUTING.md for a word of the language: what is forgotten fails here.

The words are read off the models and the records, so that a new one is looked at without an entry here.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pytest

from lupin_engine.chart import documents as d
from lupin_engine.chart import model as m
from lupin_engine.chart.expressions.evaluation import Constant, Expression
from lupin_engine.chart.nodes import Meaning, Node, keys_of
from lupin_engine.chart.records import COMPUTED, Role, parts_of, same_meaning, walk
from lupin_engine.chart.rules.written import codes_of, reads_of, sayings_of
from lupin_engine.diagram.outline import outline
from lupin_engine.errors import Place, Severity
from lupin_engine.machine.event import Cancel, Event
from lupin_engine.machine.step import CodeEvent, Considered, Moment, Refusal, Step
from lupin_engine.plugin.types import TEXT
from lupin_engine.runtime.record import read_step, step_record
from lupin_greenhouse.profile import PROFILE
from lupin_lsp.grammar import fields_of, meaning_of, shapes_of
from lupin_ros.launch.monitor import RunMonitor
from lupin_scxml.exporter import scxml
from tests.lupin_engine.diagram import pictured
from tests.lupin_engine.machine.charts import Bench
from tests.lupin_engine.machine.charts import chart as built

PLACE = Place("note.yaml", 1, 1)
#: What is written, and what it becomes.
BECOMES: dict[type[Node], type] = {
    d.TransitionNode: m.Transition,
    d.RetryNode: m.Retry,
    d.InvokeNode: m.Invoke,
    d.ForEachNode: m.ForEach,
    d.ItineraryNode: m.Itinerary,
    d.AskNode: m.Prompt,
    d.StateNode: m.State,
    d.HoldNode: m.Hold,
    d.RequestFieldNode: m.Field,
    d.RefusalNode: m.FieldRefusal,
    d.VariableNode: m.Variable,
    d.LevelNode: m.Level,
    d.InputNode: m.Input,
    d.InvariantNode: m.Invariant,
    d.PropertyNode: m.TemporalProperty,
    d.RaiseNode: m.ActionCall,
    d.IfNode: m.ActionCall,
}
#: Words that make a type narrower.
IN_TYPES = ("unit", "max", "distinct")
#: Those whose `summary` the chart keeps, because it is told.
TOLD = (d.StateNode, d.InvariantNode, d.PropertyNode)
#: Words that become something else than a field of that name.
ELSEWHERE = {
    (d.TransitionNode, "use"): "the other state's transitions are composed again",
    **{
        (d.StateNode, key): "transitions"
        for key in ("on", "on_done", "on_error", "always", "after", "every", "at")
    },
    (d.StateNode, "states"): "children",
    (d.StateNode, "before_divert"): "transitions of the slot and of the state",
    **{(d.StateNode, key): "states, before the file is validated" for key in ("sequence", "times")},
    (d.StateNode, "use"): "the part's states",
    (d.StateNode, "with"): "is built into the part's expressions",
    (d.StateNode, "out"): "the part's expressions and actions have the variable",
    (d.StateNode, "history"): "a child",
    (d.InvariantNode, "that"): "the record has one expression",
    **{(node, "summary"): "for the editor" for node in BECOMES if node not in TOLD},
    (d.RaiseNode, "event"): "one of the arguments",
    (d.InputNode, "unit"): "for the reader",
    (d.PropertyNode, "formerly"): "the name of an exemption",
    **{(node, key): "is in the type" for node in (d.VariableNode, d.RequestFieldNode) for key in IN_TYPES},
}
#: Values, on which something depends or that are handed on.
VALUES = frozenset({Role.VALUE, Role.CARRIED})
#: Which role a meaning asks for.
ROLES = {
    Meaning.CONDITION: {Role.CONDITION},
    Meaning.VALUE: VALUES,
    Meaning.CODE: {Role.CODE},
    Meaning.HOLD: {Role.HOLDS},
    Meaning.STATE: {Role.STATE},
    Meaning.CHILD: {Role.STATE},
}
WORDS = [(node, key) for node in BECOMES for key in keys_of(node) if (node, key) not in ELSEWHERE]
PARTS = [(record, part) for record in BECOMES.values() for part in parts_of(record)]


def named(found: Any) -> str:
    """The name of a case."""
    return found.__name__ if isinstance(found, type) else getattr(found, "field", str(found))


@pytest.fixture(scope="module")
def chart() -> m.Chart:
    """The mission that says everything."""
    return pictured.chart("words")


def records(chart: m.Chart, kind: type) -> Iterator[tuple[str, Any, Any]]:
    """Yield the places of a kind of record: field of the chart, what stands there, and the record in it."""
    for family in ("states", "holds", "invariants", "properties", "inputs", "context", "missions"):
        for thing in getattr(chart, family).values():
            yield from ((family, thing, found) for found in inside(thing, kind))


def inside(thing: Any, kind: type) -> Iterator[Any]:
    """Yield the records of a kind in another one."""
    if isinstance(thing, kind):
        yield thing
    for part in parts_of(type(thing)):
        if part.role in (Role.INSIDE, Role.ACTIONS):
            value = getattr(thing, part.field)
            several = (
                value.values() if isinstance(value, dict) else value if isinstance(value, tuple) else [value]
            )
            for each in several:
                if each is not None:
                    yield from inside(each, kind)


def exchanged(thing: Any, old: Any, new: Any) -> Any:
    """Return a record with one that is somewhere in it exchanged."""
    if thing is old:
        return new
    changes = {}
    for part in parts_of(type(thing)):
        value = getattr(thing, part.field)
        if part.role not in (Role.INSIDE, Role.ACTIONS) or value is None:
            continue
        if isinstance(value, dict):
            changes[part.field] = {name: exchanged(each, old, new) for name, each in value.items()}
        elif isinstance(value, tuple):
            changes[part.field] = tuple(exchanged(each, old, new) for each in value)
        else:
            changes[part.field] = exchanged(value, old, new)
    return replace(thing, **changes)


def with_part(chart: m.Chart, kind: type, field: str, value: Any) -> m.Chart:
    """Return a chart in which one record of a kind says something."""
    family, holder, found = next(records(chart, kind))
    changed = exchanged(holder, found, replace(found, **{field: value}))
    things = {name: changed if each is holder else each for name, each in getattr(chart, family).items()}
    return replace(chart, **{family: things})


@pytest.mark.parametrize(("node", "key"), WORDS, ids=named)
def test_a_word_that_is_written_is_a_part_of_the_chart(node: type[Node], key: str) -> None:
    """It has a field in the record that its node becomes, which says so with `said`."""
    written = {part.word.partition(".")[0] for part in parts_of(BECOMES[node])}
    assert key in written


@pytest.mark.slow
@pytest.mark.parametrize(("node", "key"), WORDS, ids=named)
def test_a_word_that_is_written_is_read(node: type[Node], key: str, chart: m.Chart) -> None:
    """The mission that says everything says it, and composing has put it into the chart."""
    said = [
        getattr(record, field.name) != field.default
        for part in parts_of(BECOMES[node])
        for field in fields(BECOMES[node])
        for _, _, record in records(chart, BECOMES[node])
        if field.name == part.field and part.word.partition(".")[0] == key
    ]
    assert any(said)


@pytest.mark.parametrize(("record", "part"), PARTS, ids=named)
def test_a_part_of_the_chart_is_written(record: type, part: Any) -> None:
    """The word of a field is a key of the node that it comes from."""
    nodes = [node for node, becomes in BECOMES.items() if becomes is record]
    if part.word:
        assert any(part.word.partition(".")[0] in keys_of(node) for node in nodes)


@pytest.mark.parametrize(("node", "key"), WORDS, ids=named)
def test_what_the_editor_takes_a_word_for_the_checker_does_too(node: type[Node], key: str) -> None:
    """The meaning at the key and the role of the field say the same."""
    wanted = ROLES.get(meaning_of(node, key) or Meaning.TEXT)
    roles = {part.role for part in parts_of(BECOMES[node]) if part.word.partition(".")[0] == key}
    assert wanted is None or wanted & roles
    nested = roles & VALUES and (shapes_of(node)[key].model or shapes_of(node)[key].names)
    computed = roles & COMPUTED
    assert not computed or nested or wanted & computed


@pytest.mark.parametrize(("node", "key"), [(n, k) for n in BECOMES for k in keys_of(n)], ids=named)
def test_a_word_is_documented(node: type[Node], key: str) -> None:
    """Hover, completion, schema and reference show its description."""
    assert fields_of(node)[key].description


@pytest.mark.parametrize(
    ("record", "part"),
    [(r, p) for r, p in PARTS if p.role in COMPUTED and p.field != "arguments"],
    ids=named,
)
def test_an_expression_is_among_the_checkers_reads(record: type, part: Any, chart: m.Chart) -> None:
    """So it counts as a use of what it reads, and an input that may be unknown is told."""
    note = Expression("note", PLACE, TEXT, lambda _: "")
    (found,) = (
        read
        for read in reads_of(sayings_of(with_part(chart, record, part.field, note)))
        if read.expression is note
    )
    assert found.condition == (part.role is Role.CONDITION)
    assert found.path.endswith(part.word)


@pytest.mark.parametrize(("record", "part"), [(r, p) for r, p in PARTS if p.role is Role.CODE], ids=named)
def test_a_code_counts_as_used(record: type, part: Any, chart: m.Chart) -> None:
    """Else the checker would tell that nobody reports it."""
    several = isinstance(getattr(next(records(chart, record))[2], part.field), frozenset)
    code = frozenset({"noted"}) if several else "noted"
    assert "noted" in codes_of(sayings_of(with_part(chart, record, part.field, code)))


@pytest.mark.parametrize("part", [p for p in parts_of(m.Transition) if p.word], ids=named)
def test_what_a_transition_says_is_in_its_scxml(part: Any, chart: m.Chart) -> None:
    """In SCXML's words where it has some, else in an attribute of ours."""
    outer = next(
        state for state in chart.states.values() if state.name and state.children and state.transitions
    )
    rule = replace(outer.transitions[0], target=outer.children[0], internal=False)
    values = {
        Role.STATE: outer.name,
        Role.CONDITION: Expression("note", PLACE, TEXT, lambda _: ""),
        **dict.fromkeys(VALUES, Constant("noted", PLACE, TEXT)),
        Role.CODE: "noted",
        Role.HOLDS: frozenset({"noted"}),
        Role.ACTIONS: (m.ActionCall("noted", {}, PLACE),),
    }
    told = replace(rule, **{part.field: values.get(part.role, True)})
    documents = []
    for each in (rule, told):
        state = replace(outer, transitions=(each,))
        changed = replace(chart, states={**chart.states, state.name: state})
        documents.append(scxml(outline(changed, whole=True)))
    assert documents[0] != documents[1]


@pytest.mark.parametrize(
    ("record", "part"), [(r, p) for r in (m.Invoke, m.Retry) for p in parts_of(r)], ids=named
)
def test_what_an_operation_says_is_in_its_scxml(record: type, part: Any, chart: m.Chart) -> None:
    """Arguments in elements, the rest in attributes of ours."""
    doing = next(state for state in chart.states.values() if state.invoke and state.invoke.retry)
    assert doing.invoke is not None
    note = Expression("noted", PLACE, TEXT, lambda _: "")
    values: dict[Role, Any] = {Role.PLAIN: "noted", Role.CODE: "noted", Role.INSIDE: None}
    said = {"arguments": {"noted": note}, "unless": frozenset({"noted"})}
    value = said.get(part.field, values.get(part.role, note))
    holder = doing.invoke if record is m.Invoke else doing.invoke.retry
    invoke = exchanged(doing.invoke, holder, replace(holder, **{part.field: value}))
    state = replace(doing, invoke=invoke)
    told = scxml(outline(replace(chart, states={**chart.states, state.name: state}), whole=True))
    assert ("noted" in told) == (part.role is not Role.INSIDE)
    assert told != scxml(outline(chart, whole=True))


@pytest.mark.parametrize(
    ("record", "field"),
    [
        (r, f.name)
        for r in (m.Input, m.Variable, m.Level)
        for f in fields(r)
        if f.name not in ("place", "levels")
    ],
    ids=named,
)
def test_declarations_that_differ_in_a_part_are_different(record: type, field: str, chart: m.Chart) -> None:
    """Two files that declare one name must say the same of it, in every word."""
    found = next(records(chart, record))[2]
    assert same_meaning(found, replace(found, place=PLACE))
    assert not same_meaning(found, replace(found, **{field: "otherwise"}))


def test_the_walk_looks_into_every_record(chart: m.Chart) -> None:
    """What holds another record says so, or nothing in that would be found."""
    for record in BECOMES.values():
        assert next(records(chart, record), None) is not None, record
    roles = frozenset(Role)
    assert sum(1 for state in chart.states.values() for _ in walk(state, roles)) > 100


#: Of the parts of a step those that are no texts; the others say their own name.
SAYS: dict[str, Any] = {
    "sequence": 1,
    "time": 2.0,
    "event": Event("operator.abort", {"mission": "m"}),
    "commands": (Cancel("1", "nav.go_to"),),
    "trail": (Moment("A", "", ""),),
    "accepted": False,
    "refusal": Refusal("busy", "Not now"),
    "why": (Considered("A.on.operator.abort.1", PLACE, "false", False),),
    "codes": (CodeEvent("busy", "not now", Severity.WARN, "come back", "1"),),
}
#: A step that says everything that one can say.
STEP = Step(**{field.name: SAYS.get(field.name, (field.name,)) for field in fields(Step)})
#: What is in the record for people only, or not at all, because it follows from the rest.
NOT_READ_BACK = ("trail", "why")


@pytest.mark.parametrize("part", [field.name for field in fields(Step)])
def test_a_part_of_a_step_is_recorded(part: str) -> None:
    """And read back: the live view and what looks at runs afterwards have nothing else."""
    if part not in NOT_READ_BACK:
        assert getattr(read_step(step_record(STEP)), part) == getattr(STEP, part)


#: What a transition computes that is taken: the value of a refusal is in `sim/test_refused_values.py`.
COMPUTES = [p for p in parts_of(m.Transition) if p.role in COMPUTED and p.field != "value"]


@pytest.mark.parametrize("part", COMPUTES, ids=named)
def test_what_a_transition_computes_is_computed_when_it_is_taken(part: Any) -> None:
    """The machine does it, and what comes of it for people to read is in the step."""
    looked: list[Any] = []
    expression = Expression("note", PLACE, TEXT, lambda env: looked.append(env) or "noted")
    bare = built({"A": {"on": {"go": "B"}}, "B": {}})
    state = bare.states["A"]
    rule = replace(state.transitions[0], code="late", **{part.field: expression})
    bench = Bench(replace(bare, states={**bare.states, "A": replace(state, transitions=(rule,))}))
    step = bench.send("go")
    assert step.taken
    assert looked
    assert part.role is Role.CONDITION or "noted" in str(
        [getattr(step, field.name) for field in fields(step)]
    )


#: What else shows a part of a step while a mission runs, where no line of its own does.
SEEN_LIVE = {
    **dict.fromkeys(("sequence", "time", "event", "trail", "why"), "the record for those who look closer"),
    **dict.fromkeys(("configuration", "taken", "exited", "entered"), "the state in the view"),
    "commands": "the operations under way",
    "notes": "the node's log",
    "broken": "the code that each reports",
    **dict.fromkeys(("accepted", "refusal"), "the answer of the service"),
}


@pytest.mark.parametrize("part", [f.name for f in fields(Step) if f.name not in SEEN_LIVE] or [""])
def test_a_part_of_a_step_is_seen_live(part: str) -> None:
    """`lupin run` tells it as it happens."""
    monitor = RunMonitor(PROFILE, "m", 0.0)
    data = {"time": 1.0, "step": step_record(STEP), "view": {"mission_id": "m"}}
    assert monitor.take("step", data, 1.0)
    told = " ".join(happening.text for happening in monitor.happenings)
    assert all(str(text) in told for text in getattr(STEP, part, ()))


def test_the_files_that_the_recipes_name_are_there() -> None:
    """`NAME` stands for what is added."""
    root = Path(__file__).parents[3]
    named = re.findall(
        r"`((?:lupin_engine|tests|tools|docs)/[\w/.]+)`", (root / "docs/CONTRIBUTING.md").read_text()
    )
    assert len(named) > 15
    assert [path for path in named if "NAME" not in path and not (root / path).exists()] == []
