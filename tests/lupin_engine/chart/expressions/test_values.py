"""Values as files write them: of the type that is asked for, with their units, and told apart from texts."""

from __future__ import annotations

import re
from typing import Any

import pytest

from lupin_engine.chart.expressions.evaluation import Constant, Expression
from lupin_engine.chart.expressions.names import names_read
from lupin_engine.chart.expressions.scope import Scope
from lupin_engine.chart.expressions.values import (
    Signature,
    read_arguments,
    read_constant,
    read_guard,
    read_value,
)
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.source import Map, parse
from lupin_engine.errors import Place
from lupin_engine.plugin.contract import Argument
from lupin_engine.plugin.types import (
    ANGLE,
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
    convert,
    list_of,
)

RECORD = Type("record", "pair", fields={"a": TEXT, "b": COUNT})


def written(text: str) -> Map:
    """Parse the text of a file that must be right."""
    findings = Findings()
    found = parse(text, "m.yaml", findings)
    assert findings.all == ()
    assert found is not None
    return found


def told(findings: Findings) -> list[str]:
    """Return findings as column, problem, hint and rule."""
    return [f"{d.place.column}: {d.problem}; {d.hint} [{d.rule}]" for d in findings.all]


@pytest.mark.parametrize(
    ("text", "wanted", "value"),
    [
        ("a", TEXT, "a"),
        ("true", BOOL, True),
        ("3", COUNT, 3),
        ("2.5", NUMBER, 2.5),
        ("2.50", NUMBER, 2.5),
        ("007", COUNT, 7),
        ("20 %", NUMBER, 0.2),
        ("2 min", DURATION, 120.0),
        ("10 cm", LENGTH, 0.1),
        ("[a, b]", list_of(TEXT), ["a", "b"]),
        ("{a: x, b: 2}", RECORD, {"a": "x", "b": 2}),
        ("{x: 1 m, y: 2 m, yaw: 0 rad}", POSE, {"x": 1.0, "y": 2.0, "yaw": 0.0}),
        ("{a: [1, {b: x}], c: null}", ANY, {"a": [1, {"b": "x"}], "c": None}),
    ],
)
def test_plain_data_becomes_a_constant(text: str, wanted: Type, value: Any) -> None:
    """In base units, and without places."""
    raw, findings = written(f"k: {text}"), Findings()
    found = read_constant(raw["k"], raw.value_place("k"), wanted, findings, "here")
    assert told(findings) == []
    assert found == Constant(value, Place("m.yaml", 1, 4), wanted)
    assert type(found.value) is type(value)


@pytest.mark.parametrize(
    ("text", "wanted", "expected"),
    [
        ("5", TEXT, ["4: expected text, got 5; quote it: '5' [wrong-type]"]),
        ("007", TEXT, ["4: expected text, got 007; quote it: '007' [wrong-type]"]),
        ("1.10", TEXT, ["4: expected text, got 1.10; quote it: '1.10' [wrong-type]"]),
        ("1e3", TEXT, ["4: expected text, got 1e3; quote it: '1e3' [wrong-type]"]),
        ("True", TEXT, ["4: expected text, got true; quote it [wrong-type]"]),
        ("0x1F", DURATION, ["4: 0x1F has no unit, but a duration needs one; write '31 s' [no-unit]"]),
        ("1.50", DURATION, ["4: 1.50 has no unit, but a duration needs one; write '1.50 s' [no-unit]"]),
        ("yes", BOOL, ["4: expected bool, got 'yes'; write true or false [wrong-type]"]),
        ("x", list_of(TEXT), ["4: expected list of text, got 'x';  [wrong-type]"]),
        ("x", RECORD, ["4: expected pair, got 'x'; write a mapping with a, b [wrong-type]"]),
        ("x", Type("record", "reading"), ["4: expected reading, got 'x';  [wrong-type]"]),
        ("[1, a]", list_of(COUNT), ["8: expected a plain number, got 'a';  [wrong-type]"]),
        ("{a: x, c: 1}", RECORD, [
            "4: this pair has no b;  [wrong-type]",
            "11: a pair has no 'c'; allowed: 'a', 'b' [wrong-type]",
        ]),
        ("true", NUMBER, ["4: expected a plain number, got true;  [wrong-type]"]),
        ("[1]", COUNT, ["4: expected a plain number, got a list of 1;  [wrong-type]"]),
        ("2.5", INTEGER, ["4: expected a whole number, got 2.5;  [wrong-type]"]),
        ("-1", COUNT, ["4: expected count of at least 0, got -1;  [wrong-type]"]),
        ("5", DURATION, ["4: 5 has no unit, but a duration needs one; write '5 s' [no-unit]"]),
        ("'5'", DURATION, ["4: expected duration (s), got '5'; write '5 s' [no-unit]"]),
        ("soon", DURATION, [
            "4: expected duration (s), got 'soon'; its units are 'ms', 's', 'min', 'h' [wrong-type]",
        ]),
        ("5 parsec", DURATION, [
            "4: expected duration (s), got '5 parsec'; its units are 'ms', 's', 'min', 'h' [wrong-type]",
        ]),
        ("5 mins", DURATION, ["4: expected duration (s), got '5 mins'; did you mean 'min'? [wrong-type]"]),
        ("5 parsec", NUMBER, [
            "4: expected a plain number, got '5 parsec'; write a number without a unit, or in % [wrong-type]",
        ]),
        ("nan", DURATION, [
            "4: expected duration (s), got 'nan'; write a finite number, such as '5 s' [wrong-type]",
        ]),
        ("-.inf m", LENGTH, [
            "4: expected length (m), got '-.inf m'; write a finite number, such as '5 m' [wrong-type]",
        ]),
        ("inf", NUMBER, ["4: expected a plain number, got 'inf'; write a finite number [wrong-type]"]),
        ("5 m", DURATION, [
            "4: expected duration (s), got '5 m'; its units are 'ms', 's', 'min', 'h' [wrong-unit]",
        ]),
        ("5 m", NUMBER, [
            "4: expected a plain number, got '5 m'; write a number without a unit, or in % [wrong-unit]",
        ]),
        ("5 s", COUNT, [
            "4: expected a plain number, got '5 s'; write a whole number without a unit [wrong-type]",
        ]),
        ("x", ANGLE, ["4: expected angle (rad), got 'x'; its units are 'deg', 'rad' [wrong-type]"]),
        ("['${ a }']", list_of(TEXT), [
            "5: an expression inside a list or record; an expression stands for the whole value here "
            "[partial-expression]",
        ]),
        ("[{a: ['{{ a }}']}]", ANY, [
            "10: an expression inside a list or record; an expression stands for the whole value here "
            "[partial-expression]",
        ]),
    ],
)  # fmt: skip
def test_data_of_another_type_is_told_where_it_parts(text: str, wanted: Type, expected: list[str]) -> None:
    """At the innermost place, with what to write."""
    raw, findings = written(f"k: {text}"), Findings()
    assert read_constant(raw["k"], raw.value_place("k"), wanted, findings, "here") is None
    assert told(findings) == expected


@pytest.mark.parametrize(
    ("text", "source"),
    [("true", "true"), ("1 < 2", "1 < 2"), ("not false", "not false")],
)
def test_a_condition_needs_no_marks(text: str, source: str) -> None:
    """It is always an expression."""
    raw, findings = written(f"k: {text}"), Findings()
    found = read_guard(raw["k"], raw.value_place("k"), Scope({}), findings, "here")
    assert isinstance(found, Expression)
    assert (found.source, found.evaluate({}), found.place.column) == (source, True, 4)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[a]", ["4: expected a condition, got a list of 1;  [wrong-shape]"]),
        ("5", ["4: expected bool, but '5' is a plain number; compare it, such as '5 > 0' [wrong-type]"]),
        ("'${ true }'", [
            "4: a condition has no ${ }; it is always an expression, so write it without "
            "[partial-expression]",
        ]),
    ],
)  # fmt: skip
def test_what_is_no_condition_is_told(text: str, expected: list[str]) -> None:
    """Lists, numbers, and expressions with marks."""
    raw, findings = written(f"k: {text}"), Findings()
    assert read_guard(raw["k"], raw.value_place("k"), Scope({}), findings, "here") is None
    assert told(findings) == expected


def test_no_condition_is_none() -> None:
    """Without a finding."""
    findings = Findings()
    assert read_guard(None, Place("m.yaml", 1, 1), Scope({}), findings, "here") is None
    assert findings.all == ()


def test_an_expression_is_the_whole_value() -> None:
    """Or it is told at the value."""
    raw, findings = written("k: a ${ 1 }\nl: ${ 1 + 1 }"), Findings()
    scope = Scope({})
    assert read_value(raw["k"], raw.value_place("k"), ANY, scope, findings, "here") is None
    found = read_value(raw["l"], raw.value_place("l"), COUNT, scope, findings, "here")
    assert isinstance(found, Expression)
    assert found.evaluate({}) == 2
    assert told(findings) == [
        "4: an expression must be the whole value; write the whole value as one ${ ... } [partial-expression]"
    ]


SCOPE = Scope(
    {
        "name": TEXT,
        "left": DURATION,
        "depth": LENGTH,
        "share": NUMBER,
        "count": COUNT,
        "dry": BOOL,
        "names": list_of(TEXT),
        "depths": list_of(LENGTH),
        "pair": RECORD,
        "odd": ANY,
    }
)
SEEN = {
    "context": {
        "name": "tulip",
        "left": 150.0,
        "depth": 0.123456789,
        "share": 0.455,
        "count": 1234567,
        "dry": True,
        "names": ["1", "5"],
        "depths": [0.01, 0.02],
        "odd": 2.5,
    }
}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("tag ${ name }!", "tag tulip!"),
        ("${ name }${ name }", "tuliptulip"),
        ("${ left } left", "150 s left"),
        ("${ left:min } left", "2.5 min left"),
        ("${ left : .0f s }", "150 s"),
        ("${ left / 2:.1f min }", "1.2 min"),
        ("${ depth } deep", "0.123457 m deep"),
        ("${ depth:.1f }, ${ depth:.1f cm }", "0.1 m, 12.3 cm"),
        ("${ share:.0f % } of ${ count }", "46 % of 1234567"),
        ("dry: ${ dry }, ${ not dry }", "dry: true, false"),
        ("tags ${ names }", "tags 1, 5"),
        ("at ${ depths:cm }", "at 1 cm, 2 cm"),
        ("${ 'a: }' if dry else 'b' }: ${ 0 }", "a: }: 0"),
        ("${ odd:.2f } or ${ odd }", "2.50 or 2.5"),
        ("a $5 note {x}: ${ name }", "a $5 note {x}: tulip"),
    ],
)
def test_a_text_has_expressions_in_it(text: str, value: str) -> None:
    """With their units, or in another one; each knows what it reads."""
    raw, findings = written(f'k: "{text}"'), Findings()
    found = read_value(raw["k"], raw.value_place("k"), TEXT, SCOPE, findings, "here")
    assert told(findings) == []
    assert isinstance(found, Expression)
    assert (found.evaluate(SEEN), found.type) == (value, TEXT)
    assert names_read(found.source) == {name for name in SCOPE.names if re.search(rf"\b{name}\b", text)}


@pytest.mark.parametrize(
    ("text", "wanted", "finding"),
    [
        ("it is ${ nam }", TEXT, "14: unknown name 'nam'; did you mean 'name'? [unknown-name]"),
        ("${ name }, ${ 1 + name }", TEXT, "23: expected a number, but 'name' is text;  [wrong-type]"),
        ("at ${ pair }", TEXT, "11: 'pair' is pair, which is no text; name a field: 'pair.a' [wrong-type]"),
        ("a ${ name", TEXT, "7: the expression in this text is not closed; write '}' behind it"),
        ("a ${ left:2 }", TEXT, "14: ':2' is no way to tell a value; write digits, a unit or both"),
        ("a ${ left: }", TEXT, "14: ':' is no way to tell a value; write digits, a unit or both"),
        (
            "a ${ left:cm }",
            TEXT,
            "14: 'left' is duration (s), not in 'cm'; its units are 'ms', 's', 'min', 'h' [wrong-unit]",
        ),
        (
            "a ${ count:m }",
            TEXT,
            "15: 'count' is a plain number, not in 'm'; leave the unit out, or write '%'",
        ),
        (
            "a ${ dry:.1f }",
            TEXT,
            "13: 'dry' is bool, and only numbers have digits and units; leave the ':' out",
        ),
        ("${ left:.1f }", DURATION, "4: an expression must be the whole value; write the whole value as one"),
        (
            "a ${ name } ${ names }",
            list_of(TEXT),
            "4: an expression must be the whole value; write the whole",
        ),
    ],
)
def test_what_is_wrong_in_a_text_is_told_where_it_stands(text: str, wanted: Type, finding: str) -> None:
    """At the column of the name, or of the format."""
    raw, findings = written(f'k: "{text}"'), Findings()
    assert read_value(raw["k"], raw.value_place("k"), wanted, SCOPE, findings, "here") is None
    assert [line[: len(finding)] for line in told(findings)] == [finding]


def test_defaults_stand_in_for_arguments_that_are_not_given() -> None:
    """They stand where the operation is named; what is optional may be missing."""
    wanted = {
        "tag": Argument(TEXT, "id of the tag"),
        "wait": Argument(DURATION, "how long", default="2 s"),
        "note": Argument(TEXT, "free text", optional=True),
    }
    place, findings = Place("m.yaml", 9, 9), Findings()
    found = read_arguments(Signature("x.y", wanted), written("tag: '1'"), place, Scope({}), findings, "here")
    assert {name: (value.place.line, value.evaluate({})) for name, value in found.items()} == {
        "tag": (1, "1"),
        "wait": (9, 2.0),
    }
    assert findings.all == ()


def test_arguments_that_nobody_asked_for_or_gave_are_told() -> None:
    """Each where it stands."""
    place, findings = Place("m.yaml", 9, 9), Findings()
    wanted = {"tag": Argument(TEXT, "id of the tag")}
    assert (
        read_arguments(Signature("x.y", wanted), written("tga: '1'"), place, Scope({}), findings, "here")
        == {}
    )
    assert read_arguments(Signature("x.y", wanted), None, place, Scope({}), findings, "here") == {}
    assert told(findings) == [
        "1: x.y has no argument 'tga'; did you mean 'tag'? [unknown-argument]",
        "9: x.y needs the argument 'tag': id of the tag; add 'tag: ...' [missing-argument]",
    ]


@pytest.mark.parametrize(
    ("text", "wanted", "shown"),
    [
        ("1e400", NUMBER, "1e400"),
        ("-1e400", NUMBER, "-1e400"),
        ("1e400 s", DURATION, "'1e400 s'"),
        ("1e308 h", DURATION, "'1e308 h'"),
        ("-1e400 m", LENGTH, "'-1e400 m'"),
    ],
)
def test_a_number_that_cannot_be_kept_is_refused(text: str, wanted: Type, shown: str) -> None:
    """Nobody waits for infinity; the machine would find that out on the robot."""
    file, findings = written(f"a: {text}"), Findings()
    assert read_constant(file["a"], file.value_place("a"), wanted, findings, "here") is None
    assert told(findings) == [f"4: {shown} is too large;  [wrong-type]"]


@pytest.mark.parametrize("given", [float("inf"), float("-inf"), float("nan"), 10**400, "1e400 s"])
def test_data_that_no_clock_could_show_is_refused(given: object) -> None:
    """A request or a parameter with an endless number is wrong when it is read, not when a timer needs it."""
    with pytest.raises(ValueError, match="expected duration, got"):
        convert(given, DURATION)
