"""Lists in expressions: what can be asked of them, what is refused, and that none of it takes long."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import pytest

from lupin_engine.chart.expressions.checker import compile_expression
from lupin_engine.chart.expressions.evaluation import MAX_ELEMENTS, Expression, UnknownInput, UnknownValue
from lupin_engine.chart.expressions.reader import MAX_STEPS
from lupin_engine.chart.expressions.scope import Fragment, Scope
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.source import text_at
from lupin_engine.errors import Place
from lupin_engine.plugin.contract import Function
from lupin_engine.plugin.types import (
    ANY,
    BOOL,
    COUNT,
    INTEGER,
    LENGTH,
    NUMBER,
    TEXT,
    Type,
    list_of,
    named_values,
    number_in,
    set_of,
    within,
)

PLACE = Place("m.yaml", 3, 5)
PLANT = Type("record", "plant", fields={"id": TEXT, "x": LENGTH, "dry": BOOL, "seen": list_of(TEXT)})
SCOPE = Scope(
    {
        "plants": list_of(PLANT),
        "few": within(list_of(PLANT), None, 5),
        "done": within(set_of(TEXT), None, 50),
        "names": list_of(TEXT),
        "numbers": list_of(COUNT),
        "lengths": list_of(LENGTH),
        "flags": list_of(BOOL),
        "told": list_of(ANY),
        "word": TEXT,
        "target": PLANT,
        "input": Type("record", "input", fields={"plants": list_of(PLANT)}),
    },
    {"nearest": Function("Nearest.", list_of(PLANT), lambda _: list)},
)
PLANTS = [
    {"id": "a", "x": 3.0, "dry": True, "seen": ["u"]},
    {"id": "b", "x": 1.0, "dry": False, "seen": []},
    {"id": "c", "x": 2.0, "dry": True, "seen": ["u", "v"]},
]
CONTEXT: Mapping[str, Any] = {
    "plants": PLANTS,
    "few": PLANTS,
    "done": ["b"],
    "names": ["c", "a"],
    "numbers": [3, 1, 2],
    "lengths": [0.5, 1.5],
    "flags": [True, False],
    "told": [1, "x"],
    "word": "abc",
}


class NoInputs(dict[str, Any]):
    """Live values that nobody has told of."""

    def __missing__(self, name: str) -> Any:
        raise UnknownInput(name)


def environment(**context: Any) -> Mapping[str, Any]:
    """What the expressions see."""
    inputs = NoInputs()
    return {
        "context": {**CONTEXT, **context},
        "target": PLANTS[2],
        "input": inputs,
        "known": inputs.__contains__,
        "functions": {"nearest": lambda: PLANTS[:2]},
    }


def compiled(source: str, wanted: Type = ANY) -> Expression | list[str]:
    """Compile an expression, or return what is said against it."""
    findings, text = Findings(), text_at(source, PLACE)
    found = compile_expression(Fragment(source, text), SCOPE, wanted, findings, "here")
    told = [f"{d.place.column - PLACE.column}: {d.problem} [{d.rule}]" for d in findings.all]
    assert (found is None) == bool(told)
    return found or told


def value(source: str, **context: Any) -> Any:
    """Return what an expression comes to."""
    expression = compiled(source)
    assert isinstance(expression, Expression), expression
    return expression.evaluate(environment(**context))


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("[p.id for p in plants]", ["a", "b", "c"]),
        ("[p.id for p in plants if p.dry and p.id not in done]", ["a", "c"]),
        ("[p.id for p in plants if p.dry if p.x > '2.5 m']", ["a"]),
        ("[p.x - target.x for p in few]", [1.0, -1.0, 0.0]),
        ("len([n for n in names if n in word])", 2),
        ("any(p.dry for p in plants)", True),
        ("all([p.dry for p in plants])", False),
        ("sum(numbers)", 6),
        ("sum(p.x for p in plants) > '5 m'", True),
        ("sum([p.x for p in plants if p.id == 'z']) == 0", True),
        ("max(p.x for p in plants)", 3.0),
        ("min([len(p.seen) for p in plants])", 0),
        ("find(plants, t.id == target.id).x", 2.0),
        ("find(plants, t.x < '2.5 m').id", "b"),
        ("first([p.id for p in plants if p.dry], '')", "a"),
        ("first([p.id for p in plants if p.x > '9 m'], 'none')", "none"),
        ("first(lengths, '1 cm')", 0.5),
        ("first([n for n in lengths if n > '9 m'], '1 cm')", 0.01),
        ("[p.id for p in sorted(plants, t.x)]", ["b", "c", "a"]),
        ("[p.id for p in sorted(plants, -t.x)]", ["a", "c", "b"]),
        ("[p.id for p in sorted(plants, t.id)][0]", "a"),
        ("sorted(names)", ["a", "c"]),
        ("sorted(numbers)[0]", 1),
        ("'b' in done and 'a' not in done", True),
        ("len(done)", 1),
        ("known(find(plants, t.id == 'z'))", False),
        ("known(find(plants, t.id == 'a'))", True),
        ("known(find(plants, t.id == 'z').x)", False),
        ("known(find(input.plants, t.id == 'a'))", False),
        ("find(plants, t.id == 'z').x if known(find(plants, t.id == 'z')) else '0 m' * 2", 0.0),
        ("[p.id for p in nearest()]", ["a", "b"]),
        ("[len(v_x) for v_x in names]", [1, 1]),
    ],
)
def test_a_list_is_asked_as_in_python(source: str, expected: Any) -> None:
    """With `find`, `first` and `sorted(list, key)` besides, whose element is called `t`."""
    if "* 2" in source:
        source = source.replace("'0 m' * 2", "lengths[0] * 0")
    assert value(source) == expected


@pytest.mark.parametrize(
    ("source", "kind", "most"),
    [
        ("[p.x for p in few]", LENGTH, 5),
        ("[p.x for p in plants]", LENGTH, MAX_ELEMENTS),
        ("['a', 'b']", TEXT, 2),
        ("sorted(done)", TEXT, 50),
        ("done if word == '' else ['a']", TEXT, 50),
        ("names if word == '' else ['a']", TEXT, None),
        ("[len(n) + 1 for n in done]", INTEGER, 50),
    ],
)
def test_a_list_has_the_bound_of_what_it_is_made_of(source: str, kind: Type, most: int | None) -> None:
    """So that the checker knows how far a variable can grow."""
    expression = compiled(source)
    assert isinstance(expression, Expression)
    assert (expression.type.item, expression.type.maximum) == (kind, most)


@pytest.mark.parametrize(
    ("source", "told"),
    [
        ("[q.id for p in plants]", ["1: unknown name 'q' [unknown-name]"]),
        ("[p.ids for p in plants]", ["3: 'p' has no 'ids' [unknown-name]"]),
        ("[p for p in word]", ["12: expected a list, but 'word' is text [wrong-type]"]),
        ("[p for p in plants if p.x]", ["22: expected bool, but 'p.x' is length (m) [wrong-type]"]),
        (
            "[word for word in names]",
            ["0: 'word' cannot be the name of the element: it has a meaning here [bad-name]"],
        ),
        (
            "[len for len in names]",
            ["0: 'len' cannot be the name of the element: it has a meaning here [bad-name]"],
        ),
        (
            "[_x for _x in names]",
            ["0: '_x' cannot be the name of the element: it has a meaning here [bad-name]"],
        ),
        ("[a for a, b in plants]", ["7: a loop has one name and one list [bad-expression]"]),
        ("[p for p in plants for n in names]", ["23: a loop has one name and one list [bad-expression]"]),
        (
            "[[n for n in p.seen] for p in plants]",
            ["1: a loop inside a loop is not allowed [bad-expression]"],
        ),
        (
            "[find(plants, t.id == n) for n in names]",
            ["1: a loop inside a loop is not allowed [bad-expression]"],
        ),
        (
            "sorted(plants, sum(n for n in t.seen))",
            ["18: a loop inside a loop is not allowed [bad-expression]"],
        ),
        ("find(plants, t.x)", ["13: expected bool, but 't.x' is length (m) [wrong-type]"]),
        ("find(plants)", ["0: find takes 2 arguments, got 1 [missing-argument]"]),
        ("find(word, t == 'a')", ["5: expected a list, but 'word' is text [wrong-type]"]),
        ("t.id == 'a'", ["0: unknown name 't' [unknown-name]"]),
        ("sorted(plants)", ["7: expected a number or a text, but 'plants' is plant [wrong-type]"]),
        ("sorted(plants, t)", ["15: expected a number or a text, but 't' is plant [wrong-type]"]),
        ("sorted(plants, t.x, t.id)", ["0: sorted takes 2 arguments, got 3 [unknown-argument]"]),
        ("first(names)", ["0: first takes 2 arguments, got 1 [missing-argument]"]),
        ("first(names, 3)", ["13: the elements are text, the default is a plain number [wrong-type]"]),
        ("sum(names)", ["4: expected a number, but 'names' is text [wrong-type]"]),
        ("sum(lengths) + 1", ["0: cannot compute length (m) + a plain number [wrong-unit]"]),
        ("known(sum(numbers))", ["6: known asks about what may be missing [wrong-type]"]),
        ("known(word)", ["6: known asks about what may be missing [wrong-type]"]),
        ("{p.id for p in plants}", ["0: a comprehension is not allowed in an expression [bad-expression]"]),
    ],
)
def test_a_mistake_in_a_loop_is_told_at_its_column(source: str, told: list[str]) -> None:
    """As everywhere in expressions."""
    assert compiled(source) == told


def test_what_is_not_found_is_unknown_by_its_own_words() -> None:
    """As a live value is before its first report."""
    with pytest.raises(
        UnknownValue, match=r"^find\(plants, t.id == 'z'\) is unknown: there is no such element$"
    ):
        value("find(plants, t.id == 'z').x")


# -- values by name ---------------------------------------------------------------------------------------

MEASURE = Type("record", "measure", fields={"name": TEXT, "value": NUMBER})
TOLD = named_values(
    MEASURE, {"heat": number_in("°C"), "share": number_in("%"), "turned": number_in("deg"), "level": NUMBER}
)
READING = Type("record", "reading", fields={"id": TEXT, "measures": TOLD})
EVENT = Scope({"event": Type("record", "event", fields={"reading": READING, "at": list_of(READING)})})
READ = {"id": "a", "measures": [{"name": "heat", "value": 21.5}, {"name": "share", "value": 55.0}]}


def read(source: str) -> Any:
    """Return type and value of an expression about a reading, or what is said against it."""
    findings, text = Findings(), text_at(source, PLACE)
    found = compile_expression(Fragment(source, text), EVENT, ANY, findings, "here")
    if found is None:
        return [f"{d.place.column - PLACE.column}: {d} ".partition("here: ")[2] for d in findings.all]
    return found.evaluate({"event": {"reading": READ, "at": [READ]}})


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("event.reading['heat'] > '20 °C'", True),
        ("event.reading.measures['heat']", 21.5),
        ("event.reading['share'] > '50 %'", True),
        ("event.reading['share']", 0.55),
        ("known(event.reading['turned'])", False),
        ("known(event.reading['heat'])", True),
        ("event.reading['level'] if known(event.reading['level']) else 1.5", 1.5),
        ("find(event.at, t['heat'] > '20 °C').id", "a"),
        ("len(event.reading.measures)", 2),
        ("event.reading.measures[0].value", 21.5),
    ],
)
def test_a_value_is_read_by_its_name_in_its_unit(source: str, expected: Any) -> None:
    """Of the record that has such values, or of these; as numbers are kept, not as they are told."""
    assert read(source) == expected


@pytest.mark.parametrize(
    ("source", "told"),
    [
        ("event.reading['heta']", "'event.reading' tells no 'heta'; did you mean 'heat'? [unknown-name] "),
        ("event.reading[event.reading.id]", "a name must be written out, in quotes [wrong-type] "),
        (
            "event.reading['heat'] > 20",
            "cannot compare number in °C with a plain number; "
            "write the number with its unit as a text, such as '5 °C' [wrong-unit] ",
        ),
        ("event.reading['heat'] + event.reading['share']", "cannot compute number in °C + a plain number"),
    ],
)
def test_a_name_that_nobody_declares_is_a_mistake(source: str, told: str) -> None:
    """The catalog says what can be told, and in what."""
    (found,) = read(source)
    assert found.startswith(told)


def test_what_is_not_told_is_unknown() -> None:
    """Not zero."""
    with pytest.raises(UnknownValue, match=r"^event.reading\['level'\] is unknown: it was not told$"):
        read("event.reading['level'] > 0")


# -- bounded ----------------------------------------------------------------------------------------------

LONG = [f"n{number}" for number in range(MAX_ELEMENTS)]
MANY = [dict(PLANTS[0], id=name) for name in LONG]


@pytest.mark.parametrize(
    "source",
    [
        "[p for p in plants if p in input.plants and p in nearest() and p.id in names]",
        "[n for n in names" + " if n in told" * 2 + "]",
        "[max(max(numbers), max(numbers), sum(numbers)) for n in names]",
        "[nearest() for n in names if n in names]",
        "[n for n in names" + " if n in word" * 25 + "]",
        "sorted(plants, sum(numbers) + sum(numbers))",
    ],
)
def test_a_huge_product_of_lists_is_refused(source: str) -> None:
    """Whatever their elements are: it is counted with the most that each can have."""
    told = compiled(source)
    assert isinstance(told, list)
    assert f"steps, at most {MAX_STEPS} are allowed [unbounded]" in told[-1]


@pytest.mark.parametrize(
    "source",
    [
        "[p for p in plants if p not in told]",
        "[n for n in names if n not in names]",
        "[n for n in names if n in done and n in word]",
        "find(plants, t in told)",
        "sorted(sorted(sorted(plants, -t.x), t.id), t.x)",
    ],
)
def test_what_is_allowed_takes_a_moment_even_where_it_is_much(source: str) -> None:
    """All lists as long as they may be; a step of a mission is not held up for long."""
    expression = compiled(f"len([n for n in names]) + len({source})" if "find" not in source else source)
    assert isinstance(expression, Expression)
    env = environment(plants=MANY, names=LONG, told=MANY, done=LONG[:50], word="x" * 10_000)
    began = time.process_time()
    expression.evaluate(env)
    assert time.process_time() - began < 1.0


@pytest.mark.parametrize(
    ("source", "context"),
    [
        ("[n for n in names]", {"names": [*LONG, "more"]}),
        ("find(names, t == 'x')", {"names": [*LONG, "more"]}),
        ("sorted(names)", {"names": [*LONG, "more"]}),
        ("[n for n in done if n in names]", {"names": [*LONG, "more"]}),
        ("[n for n in done if n in word]", {"word": "x" * 10_001}),
    ],
)
def test_a_list_or_text_that_is_too_long_is_not_gone_through(source: str, context: dict[str, Any]) -> None:
    """Nobody knows before how much comes from outside."""
    with pytest.raises(ValueError, match=r"at most 10?0?00"):
        value(source, **context)


def test_what_is_no_list_is_not_gone_through() -> None:
    """Of type `any` it may be anything."""
    told = Scope({"message": ANY})
    text = text_at("[v for v in message]", PLACE)
    expression = compile_expression(Fragment(str(text), text), told, ANY, Findings(), "here")
    assert expression is not None
    with pytest.raises(TypeError, match="expected a list, got 'abc'"):
        expression.evaluate({"context": {"message": "abc"}})


def test_a_number_type_stays_what_it_is() -> None:
    """A sum has no range."""
    expression = compiled("sum(numbers)")
    assert isinstance(expression, Expression)
    assert expression.type == INTEGER
    assert compiled("[n / 2 for n in numbers]", list_of(NUMBER))
