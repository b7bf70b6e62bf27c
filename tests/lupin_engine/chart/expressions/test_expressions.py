"""Expressions: what they mean, what they read, and the long list of what they refuse."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import FunctionType
from typing import Any

import pytest

from lupin_engine.chart.compose.compose import ITINERARY
from lupin_engine.chart.expressions.checker import check_expression, compile_expression
from lupin_engine.chart.expressions.evaluation import Compiled, Expression, UnknownInput
from lupin_engine.chart.expressions.reader import MAX_CHARACTERS
from lupin_engine.chart.expressions.scope import Fragment, Scope, Typed, Usage, fragment_of, literal
from lupin_engine.chart.expressions.texts import read_text
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.source import text_at
from lupin_engine.errors import Place
from lupin_engine.plugin.contract import Argument, Function
from lupin_engine.plugin.registry import Catalog
from lupin_engine.plugin.types import (
    ANY,
    BOOL,
    COUNT,
    DURATION,
    INTEGER,
    LENGTH,
    NUMBER,
    POSE,
    TEXT,
    Type,
    list_of,
)

PLACE = Place("m.yaml", 3, 5)


def record(name: str, **fields: Type) -> Type:
    """Make a record type."""
    return Type("record", name, fields=fields)


def wide_scope(catalog: Catalog) -> Scope:
    """Return a scope with one of everything."""
    names = {
        "param": record(
            "param", patience=DURATION, far=LENGTH, ratio=NUMBER, goal=COUNT, names=list_of(TEXT)
        ),
        "request": record("request", goal=COUNT),
        "input": record(
            "input", estop=BOOL, pose=POSE, battery=record("input.battery", value=NUMBER, low=BOOL)
        ),
        "event": ANY,
        "target": catalog.types["tag"],
        "itinerary": ITINERARY,
        "operator": record("operator"),
        "reason": TEXT,
        "visits": COUNT,
        "done": BOOL,
    }
    states = ("READY", "MISSION", "MISSION.A", "MISSION.A.READY")
    return Scope(names, catalog.functions, states, ("pause", "estop"), usage=Usage())


@pytest.fixture(scope="module")
def scope(catalog: Catalog) -> Scope:
    """A scope with one of everything."""
    return wide_scope(catalog)


class Inputs(dict[str, Any]):
    """Live values of which the missing ones are unknown."""

    def __missing__(self, name: str) -> Any:
        raise UnknownInput(name)


def environment(**changes: Any) -> Mapping[str, Any]:
    """An environment for the scope above."""
    inputs = Inputs(estop=False, battery={"value": 0.5, "low": False})
    return {
        "param": {"patience": 30.0, "far": 2.0, "ratio": 0.5, "goal": 3, "names": ["a", "b"]},
        "request": {"goal": 2},
        "input": inputs,
        "known": inputs.__contains__,
        "event": {"pose": {"x": 1.0}},
        "target": {"id": "T1", "x": 1.0, "y": 2.0},
        "itinerary": {"open": True, "remaining": 2, "total": 5, "closed": 3},
        "context": {"reason": "battery", "visits": 4, "done": True},
        "held": lambda name: name == "pause",
        "in_state": lambda names: names,
        "functions": {
            "approach": lambda target: {"x": target["x"], "y": 0.0, "yaw": 0.0},
            "tags.named": list,
        },
        **changes,
    }


def compiled(source: str, scope: Scope, wanted: Type = ANY) -> Expression:
    """Compile an expression that must be right."""
    findings = Findings()
    text = text_at(source, PLACE)
    expression = compile_expression(Fragment(source, text), scope, wanted, findings, "here")
    assert findings.all == ()
    assert expression is not None
    return expression


def refusals(source: str, scope: Scope, wanted: Type = ANY) -> list[str]:
    """Return what is said against an expression, as column, problem and rule."""
    findings = Findings()
    text = text_at(source, PLACE)
    assert compile_expression(Fragment(source, text), scope, wanted, findings, "here") is None
    return [f"{d.place.column - PLACE.column}: {d.problem} [{d.rule}]" for d in findings.all]


@pytest.mark.parametrize(
    ("source", "value"),
    [
        ("1 + 2 * 3", 7),
        ("-(7 // 2) % 4", 1),
        ("7 / 2", 3.5),
        ("param.patience / 2", 15.0),
        ("param.patience > '20 s'", True),
        ("'1 min' < param.patience", False),
        ("param.patience + '500 ms'", 30.5),
        ("param.patience > 0", True),
        ("param.patience > 0.0", True),
        ("max(param.patience, param.patience * 2)", 60.0),
        ("param.far / param.patience", 2 / 30),
        ("min(3, 1, 2)", 1),
        ("max(param.goal, request.goal)", 3),
        ("max([3, 1])", 3),
        ("abs(-2.5)", 2.5),
        ("round(2.567, 1)", 2.6),
        ("round(2.6)", 3),
        ("round(param.patience) + 0", 30),
        ("round(param.patience / '7 s')", 4),
        ("len(param.names)", 2),
        ("param.names[0]", "a"),
        ("'b' in param.names", True),
        ("reason in ('battery', 'dock')", True),
        ("reason not in ['battery']", False),
        ("'bat' in reason", True),
        ("any([input.estop, done])", True),
        ("all([input.estop, done])", False),
        ("1 if done else 2", 1),
        ("1 < visits <= 4", True),
        ("not done", False),
        ("true and not false", True),
        ("known(input.pose)", False),
        ("known(input.battery)", True),
        ("input.pose.x > '1 m' if known(input.pose) else false", False),
        ("input.battery.value", 0.5),
        ("held(pause)", True),
        ("held('estop')", False),
        ("in_state('READY')", ("READY", "MISSION.A.READY")),
        ("in_state('A.READY')", ("MISSION.A.READY",)),
        ("event.pose.x", 1.0),
        ("target.id", "T1"),
        ("approach(target).x", 1.0),
        ("tags.named(['x', 'y'])", ["x", "y"]),
        ("itinerary.open and itinerary.remaining > 0", True),
        ("'ü' == reason or visits == 4", True),
        ("('5 s' if done else '6 s') < param.patience", True),
        ("1if done else 2", 1),
        ("event.pose.x < 3", True),
    ],
)
def test_expressions_mean_what_the_same_python_means(source: str, value: Any, scope: Scope) -> None:
    """Whoever knows Python can read a guard."""
    assert compiled(source, scope).evaluate(environment()) == value


def test_what_a_function_can_do_without_may_be_left_out(scope: Scope) -> None:
    """Arguments are given by position, the optional ones last."""
    arguments = {"first": Argument(COUNT, "one"), "second": Argument(COUNT, "another", optional=True)}
    function = Function("Adds.", COUNT, lambda _: lambda *given: sum(given), arguments)
    adding = replace(scope, functions={"add": function})
    env = environment(functions={"add": lambda *given: sum(given)})
    assert compiled("add(1)", adding).evaluate(env) == 1
    assert compiled("add(1, 2)", adding).evaluate(env) == 3


def test_and_or_stop_at_the_first_answer(scope: Scope) -> None:
    """`known(x) and x > 1` must not read an unknown x."""
    expression = compiled("known(input.pose) and input.pose.x > '1 m'", scope, BOOL)
    assert expression.evaluate(environment()) is False


def test_reading_an_unknown_input_is_told_by_name(scope: Scope) -> None:
    """The machine decides what an unknown value means; the expression only says which."""
    with pytest.raises(UnknownInput, match="pose"):
        compiled("input.pose.x > '1 m'", scope).evaluate(environment())


def test_the_parts_of_a_guard_tell_why_it_is_false(scope: Scope) -> None:
    """Operands of the outermost and/or/not come with their text and their own function."""
    expression = compiled("done and (visits > 9 or not input.estop) and visits > 5", scope, BOOL)
    env = environment()
    assert [(text, part(env)) for text, part in expression.parts] == [
        ("done", True),
        ("visits > 9 or not input.estop", True),
        ("visits > 5", False),
    ]
    assert [text for text, _ in compiled("not done", scope, BOOL).parts] == ["done"]
    assert compiled("visits > 5", scope, BOOL).parts == ()


def test_an_expression_notes_what_it_reads(catalog: Catalog) -> None:
    """Which parameters and plugins a chart needs is known after loading it."""
    usage = Usage()
    names = {"param": record("param", a=list_of(TEXT)), "input": record("input", b=BOOL)}
    compiled("len(tags.named(param.a)) > 0 and input.b", Scope(names, catalog.functions, usage=usage))
    assert (usage.parameters, usage.inputs, usage.functions) == ({"a"}, {"b"}, {"tags.named"})


@pytest.mark.parametrize(
    ("source", "wanted", "problems"),
    [
        ("1 +", ANY, ["3: not an expression: it ends too early [bad-expression]"]),
        ("   reson", ANY, ["3: unknown name 'reson' [unknown-name]"]),
        ("reason == 3", BOOL, ["10: cannot compare text with a plain number [wrong-type]"]),
        ("visits", BOOL, ["0: expected bool, but 'visits' is a plain number [wrong-type]"]),
        (
            "param.ratio",
            COUNT,
            ["0: expected a whole number, but 'param.ratio' is a plain number [wrong-type]"],
        ),
        ("param.far", DURATION, ["0: expected duration (s), but 'param.far' is length (m) [wrong-unit]"]),
        ("5", DURATION, ["0: expected duration (s), but '5' is a plain number [wrong-unit]"]),
        ("param.far + param.patience", ANY, ["0: cannot compute length (m) + duration (s) [wrong-unit]"]),
        ("reason + 'x'", ANY, ["0: expected a number, but 'reason' is text [wrong-type]"]),
        ("reason * 3", ANY, ["0: expected a number, but 'reason' is text [wrong-type]"]),
        ("[0] * 3", ANY, ["0: expected a number, but '[0]' is list of integer [wrong-type]"]),
        ("event.x * 3", ANY, ["0: expected a number, but 'event.x' is any [wrong-type]"]),
        ("param.nmaes", ANY, ["6: unknown parameter 'nmaes' [unknown-parameter]"]),
        ("target.name", ANY, ["7: 'target' has no 'name' [unknown-name]"]),
        ("visits.x", ANY, ["7: 'visits' is a plain number, no record [unknown-name]"]),
        ("visits[0]", ANY, ["0: 'visits' is a plain number, only a list can be indexed [wrong-type]"]),
        (
            "[1, 'a']",
            ANY,
            ["4: a list holds one type: the first is a plain number, this is text [wrong-type]"],
        ),
        ("len(3)", ANY, ["4: '3' is a plain number, which has no length [wrong-type]"]),
        ("len()", ANY, ["0: len takes one argument, got 0 [missing-argument]"]),
        ("1 if visits else 2", ANY, ["5: expected bool, but 'visits' is a plain number [wrong-type]"]),
        ("1 if done else 'a'", ANY, ["15: one outcome is a plain number, the other text [wrong-type]"]),
        ("max(1, param.far)", ANY, ["7: cannot compare a plain number with length (m) [wrong-unit]"]),
        ("known(reason)", BOOL, ["6: known asks about what may be missing [wrong-type]"]),
        ("known(input.poes)", BOOL, ["12: 'input' has no 'poes' [unknown-name]"]),
        ("held(stop)", BOOL, ["5: unknown hold 'stop' [unknown-hold]"]),
        ("in_state('REDY')", BOOL, ["9: no state is called 'REDY' [unknown-state]"]),
        ("in_state(reason + '')", BOOL, ["9: in_state takes the name of a state [wrong-type]"]),
        ("approach", ANY, ["0: 'approach' is a function [wrong-type]"]),
        ("approach()", ANY, ["0: approach needs the argument 'target': tag [missing-argument]"]),
        ("approach(target, 3)", ANY, ["17: approach takes one argument [unknown-argument]"]),
        ("operator.x", ANY, ["9: 'operator' has no fields to read [unknown-name]"]),
        ("3 in param.names", BOOL, ["0: '3' is a plain number and cannot be in list of text [wrong-type]"]),
        ("max(3)", ANY, ["4: max of one value needs a list [wrong-type]"]),
        ("max(visits, reason)", ANY, ["12: expected a number, but 'reason' is text [wrong-type]"]),
        ("abs(reason)", ANY, ["4: expected a number, but 'reason' is text [wrong-type]"]),
        ("round()", ANY, ["0: round takes one argument, got 0 [missing-argument]"]),
        ("round(reason)", ANY, ["6: expected a number, but 'reason' is text [wrong-type]"]),
        ("any()", BOOL, ["0: any takes one argument, got 0 [missing-argument]"]),
        ("known()", BOOL, ["0: known takes one argument, got 0 [missing-argument]"]),
        ("held()", BOOL, ["0: held takes one argument, got 0 [missing-argument]"]),
        (
            "('5 s' if done else '1 m') < param.patience",
            BOOL,
            ["1: expected a number, but \"'5 s' if done else '1 m'\" is text [wrong-type]"],
        ),
        ("approach(3)", POSE, ["9: expected tag, but '3' is a plain number [wrong-type]"]),
        ("round(2.5, visits)", ANY, ["11: the digits of round must be written out, 0 to 9 [wrong-type]"]),
        ("None", ANY, ["0: None is not allowed in an expression [bad-expression]"]),
        ("1" + " + 1" * 100, ANY, ["0: the expression is too large [bad-expression]"]),
        ("a and b", BOOL, ["0: unknown name 'a' [unknown-name]", "6: unknown name 'b' [unknown-name]"]),
    ],
)
def test_a_mistake_is_told_at_its_column(
    source: str, wanted: Type, problems: list[str], scope: Scope
) -> None:
    """Every mistake of an expression at once, each where it stands."""
    assert refusals(source, scope, wanted) == problems


@pytest.mark.parametrize(
    ("source", "problem", "hint"),
    [
        ("param.ratio > 200 %", "it ends too early", "write the quantity in quotes: '200 %'"),
        (
            "param.far > 1.5 cm and 7 % 2 == 1",
            "from here on",
            "write the quantity in quotes: '1.5 cm'",
        ),
        ("'5 s' < 7 % ) 2", "from here on", "write the quantity in quotes: '7 %'"),
        ("visits > 7 % 2 2", "from here on", ""),
        ("visits > 2 sheep", "from here on", ""),
    ],
)
def test_a_quantity_belongs_into_quotes(source: str, problem: str, hint: str, scope: Scope) -> None:
    """Who writes a unit without them reads what to write."""
    findings = Findings()
    fragment = Fragment(source, text_at(source, PLACE))
    assert compile_expression(fragment, scope, BOOL, findings, "here") is None
    (found,) = findings.all
    assert found.problem.startswith("not an expression")
    assert found.problem.endswith(problem)
    assert found.hint == hint


ESCAPES = [
    "().__class__",
    "().__class__.__bases__[0].__subclasses__()",
    "reason.__class__",
    "event.__class__",
    "event._x",
    "param.__dict__",
    "__import__('os')",
    "__builtins__",
    "eval('1')",
    "open('x')",
    "getattr(reason, 'x')",
    "'{0.__class__}'.format(reason)",
    "'%s' % reason",
    "f'{reason}'",
    "f'{reason.__class__}'",
    "reason.upper()",
    "param.names.append('x')",
    "input.keys()",
    "event.get('x')",
    "tags.named.__globals__",
    "approach.__code__",
    "env",
    "env['param']",
    "lambda: 1",
    "(lambda: 1)()",
    "(x := 3)",
    "[(lambda: x)() for x in param.names]",
    "[x.__class__ for x in param.names]",
    "[env for x in param.names]",
    "find(param.names, t.__class__ == t)",
    "[v_x for x in param.names]",
    "{x for x in param.names}",
    "{x: 1 for x in param.names}",
    "any(x for x in param.names)",
    "[[0 for a in param.names] for b in param.names]",
    "{'a': 1}",
    "{1, 2}",
    "{**param}",
    "[*param.names]",
    "max(*param.names)",
    "max(key=len)",
    "yield 1",
    "await reason",
    "param.names[0:1]",
    "param.names[::-1]",
    "reason is None",
    "...",
    "b'x'",
    "1j",
    "1e999",
    "~1",
    "+1",
    "1 @ 2",
    "1 | 2",
    "import os",
    "a = 1",
    "1; 2",
    "print(1)",
    "exit()",
    "approach(target)()",
    "param.names[0]()",
    "(1)(2)",
    "True.real",
    "'\\x00'",
    "\x00",
    "{{ reason }}",
]
EXHAUSTIONS = [
    "9**9**9",
    "2**64",
    "1 << (1 << 40)",
    "1 >> 3",
    "'a' * 10**10",
    "'a' * 1000000000",
    "[0] * 1000000000",
    "(0,) * 9",
    "reason * 1000000000",
    "reason + reason",
    "param.names + param.names",
    "event.x + event.x",
    "event.x * event.x",
    "1" * 60,
    "round(5, -1000000000)",
    "round(5, 1000000000)",
    "round(5, visits)",
    "(" * 500 + "1" + ")" * 500,
    "-" * 500 + "1",
    "not " * 300 + "done",
    "1 + " * 300 + "1",
    "[" * 300 + "]" * 300,
    "done and " * 300 + "done",
    "'" + "a" * MAX_CHARACTERS + "'",
    "x" * 100_000,
    "",
    "   ",
]


@pytest.mark.parametrize("source", ESCAPES + EXHAUSTIONS, ids=lambda source: source[:40] or "empty")
def test_attempts_to_escape_or_exhaust_are_refused_at_load(source: str, scope: Scope) -> None:
    """Nothing of these is ever evaluated."""
    assert refusals(source, scope)


def test_a_product_of_integers_is_bounded_when_it_is_computed(scope: Scope) -> None:
    """A variable that is squared at every event cannot fill the memory."""
    expression = compiled("visits * visits", scope)
    assert expression.evaluate(environment(context={"visits": 1000})) == 1_000_000
    with pytest.raises(OverflowError):
        expression.evaluate(environment(context={"visits": 10**10}))


def test_compiled_code_has_no_builtins(scope: Scope) -> None:
    """What the checker would let slip could still not reach Python's own functions."""
    evaluate = compiled("len(param.names)", scope).evaluate
    assert isinstance(evaluate, Compiled)
    function = evaluate.compiled()
    assert isinstance(function, FunctionType)
    assert function.__globals__["__builtins__"] == {}


def test_an_expression_is_compiled_once_and_when_it_is_first_needed(scope: Scope) -> None:
    """A thousand states are loaded without compiling what is never evaluated."""
    first, second = compiled("visits + 1", scope), compiled(" visits + 1", scope)
    assert isinstance(first.evaluate, Compiled)
    assert first.evaluate is second.evaluate
    function = first.evaluate.compiled()
    assert isinstance(function, FunctionType)
    assert first.evaluate.compiled() is function
    assert (first.evaluate(environment()), function(environment())) == (5, 5)
    assert first.place != second.place


def test_the_same_words_in_another_scope_are_another_expression(scope: Scope) -> None:
    """A name may have another type there, and a part's parameter another value."""
    event = Type("record", "event", fields={"x": COUNT})
    assert scope.with_event(event) is scope.with_event(event)
    assert compiled("event.x + 1", scope.with_event(event)).type is INTEGER
    assert refusals("event.x + 1", scope) == ["0: expected a number, but 'event.x' is any [wrong-type]"]
    bound = replace(scope, bound={"goal": literal(7, COUNT), "names": literal(["c"], list_of(TEXT))})
    assert compiled("param.goal + 1", scope).evaluate(environment()) == 4
    assert compiled("param.goal + 1", bound).evaluate(environment()) == 8
    assert compiled("param.names[0]", bound).evaluate(environment()) == "c"


def test_a_text_that_a_part_was_given_may_be_a_quantity(scope: Scope) -> None:
    """As a written one may be."""
    bound = replace(scope, bound={"goal": literal("5 s", TEXT), "far": literal(3, ANY)})
    assert compiled("param.goal < param.patience", bound).evaluate(environment()) is True
    with pytest.raises(TypeError):
        compiled("param.far.x", bound).evaluate(environment())


def test_values_in_values_are_bounded(scope: Scope) -> None:
    """A part that doubles what it is given, given to another that does, and so on, would double for ever."""
    text, findings = text_at("param.goal + param.goal", PLACE), Findings()
    value: Typed | None = literal(1, COUNT)
    doublings = 0
    while value is not None:
        doublings += 1
        bound = replace(scope, bound={"goal": value})
        value = check_expression(Fragment(str(text), text), bound, COUNT, findings, "here")
    assert 10 < doublings < 20
    problem = "the expression is too large with the values that stand for its parameters"
    assert [(d.place, d.problem, d.rule) for d in findings.all] == [(PLACE, problem, "bad-expression")]


def test_values_in_values_may_be_too_deep(scope: Scope) -> None:
    """Small, but nested deeper than Python reads."""
    deep = literal(1, COUNT)
    for _ in range(250):
        deep = deep._replace(code=f"(-{deep.code})")
    bound = replace(scope, bound={"goal": deep})
    problem = "the expression is too large with the values that stand for its parameters"
    assert refusals("param.goal", bound) == [f"0: {problem} [bad-expression]"]


@pytest.mark.parametrize(
    ("text", "source"),
    [
        ("${ a }", " a "),
        ("  ${a}  ", "a"),
        ("${ 'x}y' }", " 'x}y' "),
        ("a", None),
        ("${ a } }", " a } "),
        ("${ a ${ b }", None),
        ("x ${ a }", None),
        ("${ a } ${ b }", None),
        ("$ { a }", None),
    ],
)
def test_only_a_whole_value_is_an_expression(text: str, source: str | None) -> None:
    """A piece of a text is never computed."""
    fragment = fragment_of(text_at(text, PLACE))
    assert (fragment.source if fragment else None) == source


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("is ${ param.ratio + param.ratio }", r"^param.ratio \+ param.ratio makes inf$"),
        ("is ${ param.ratio + param.ratio - param.ratio - param.ratio }", "makes inf"),
        ("is ${ sum([param.ratio, param.ratio]) }", r"sum\(\[param.ratio, param.ratio\]\) makes inf"),
        ("is ${ param.ratio * 10 }", r"1e\+308 and 10 make inf"),
        ("is ${ param.far:.1f cm }", r"1e\+308 makes inf cm"),
    ],
)
def test_a_text_tells_no_number_that_was_computed_beyond_all(text: str, told: str, scope: Scope) -> None:
    """A sum, a product, a unit; what a sensor tells may be infinite, and is told as that."""
    findings = Findings()
    read = read_text(text_at(text, PLACE), scope, findings, "x")
    assert read is not None, findings.all
    large = environment(param={"ratio": 1e308, "far": 1e308})
    with pytest.raises(OverflowError, match=told):
        read.evaluate(large)
    sensed = read_text(text_at("is ${ input.battery.value }", PLACE), scope, findings, "x")
    assert sensed is not None
    assert sensed.evaluate(environment(input={"battery": {"value": float("inf")}})) == "is inf"
