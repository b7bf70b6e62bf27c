"""Rules of the language that mutation testing found nobody asking about."""

from __future__ import annotations

from pathlib import Path

import pytest

from lupin_engine.chart.expressions import units as q
from lupin_engine.chart.findings import RULES, SUBJECTS, Findings, warning
from lupin_engine.chart.rules import checks
from lupin_engine.chart.rules.graph import components, cycles
from lupin_engine.errors import Place
from lupin_engine.missions.folders import LIFECYCLE
from lupin_engine.missions.load import check_chart
from lupin_engine.plugin.registry import Catalog
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
    list_of,
    number_in,
)

# -- quantities ---------------------------------------------------------------------------------------------

SPEED, RATE = number_in("m/s"), number_in("Hz")
#: What is computed has no range: a difference of durations may be negative.
SECONDS, METRES = Type("number", "duration", unit="s"), Type("number", "length", unit="m")
MODE = Type("text", "mode", values=("slow", "fast"))
LIST = Type("list", "list")


def record(**fields: Type) -> Type:
    """Return a record that no type is named after."""
    return Type("record", "", fields=fields)


@pytest.mark.parametrize(
    ("left", "sign", "right", "expected"),
    [
        *((DURATION, sign, DURATION, SECONDS) for sign in "+-%"),
        *((DURATION, sign, LENGTH, None) for sign in "+-%"),
        *((DURATION, sign, q.ZERO, SECONDS) for sign in "+-%"),
        *((q.ZERO, sign, DURATION, SECONDS) for sign in "+-%"),
        *((COUNT, sign, COUNT, INTEGER) for sign in "+-%*"),
        *((INTEGER, sign, NUMBER, NUMBER) for sign in "+-%*/"),
        *((NUMBER, sign, NUMBER, NUMBER) for sign in "+-%*/"),
        (INTEGER, "/", INTEGER, NUMBER),
        (q.ZERO, "*", q.ZERO, INTEGER),
        (q.ZERO, "*", DURATION, SECONDS),
        (q.ZERO, "-", q.ZERO_NUMBER, q.ZERO_NUMBER),
        (INTEGER, "*", DURATION, SECONDS),
        (DURATION, "*", NUMBER, SECONDS),
        (DURATION, "/", NUMBER, SECONDS),
        (DURATION, "/", DURATION, NUMBER),
        (SPEED, "*", DURATION, METRES),
        (DURATION, "*", SPEED, METRES),
        (RATE, "*", DURATION, NUMBER),
        (DURATION, "*", RATE, NUMBER),
        (LENGTH, "/", DURATION, SPEED),
        (LENGTH, "/", SPEED, SECONDS),
        (NUMBER, "/", DURATION, RATE),
        (NUMBER, "/", RATE, SECONDS),
        (LENGTH, "*", LENGTH, number_in("m2")),
        (DURATION, "/", LENGTH, number_in("s/m")),
        (number_in("deg"), "*", LENGTH, None),
    ],
)
def test_arithmetic_knows_units(left: Type, sign: str, right: Type, expected: Type | None) -> None:
    """Units multiply and divide where both are base units; whole numbers stay whole, not in `/`."""
    assert q.arithmetic(sign, left, right) == expected


@pytest.mark.parametrize(
    ("kind", "expected"),
    [(q.ZERO, q.ZERO), (DURATION, SECONDS), (COUNT, INTEGER), (NUMBER, NUMBER), (INTEGER, INTEGER)],
)
def test_what_is_computed_has_no_range(kind: Type, expected: Type) -> None:
    """A written zero keeps having any unit."""
    assert q.plain(kind) == expected


@pytest.mark.parametrize(
    ("first", "second", "expected"),
    [
        (INTEGER, NUMBER, NUMBER),
        (COUNT, INTEGER, INTEGER),
        (COUNT, COUNT, COUNT),
        (DURATION, DURATION, DURATION),
        (DURATION, SECONDS, SECONDS),
        (DURATION, q.ZERO, SECONDS),
        (q.ZERO, DURATION, SECONDS),
        (q.ZERO, q.ZERO_NUMBER, q.ZERO_NUMBER),
        (DURATION, LENGTH, None),
        (DURATION, NUMBER, None),
        (DURATION, ANY, ANY),
        (ANY, TEXT, ANY),
        (TEXT, BOOL, None),
        (TEXT, NUMBER, None),
        (MODE, MODE, MODE),
        (MODE, TEXT, TEXT),
        (TEXT, MODE, TEXT),
        (Type("bool", "flag"), BOOL, BOOL),
        (list_of(COUNT), list_of(INTEGER), list_of(INTEGER)),
        (list_of(TEXT), list_of(BOOL), None),
        (LIST, list_of(TEXT), list_of(ANY)),
        (list_of(TEXT), LIST, list_of(ANY)),
        (record(x=LENGTH), POSE, record(x=LENGTH)),
        (POSE, record(x=LENGTH), record(x=LENGTH)),
        (record(a=TEXT), record(b=TEXT), None),
        (record(a=TEXT), list_of(TEXT), None),
    ],
)
def test_what_two_values_have_in_common(first: Type, second: Type, expected: Type | None) -> None:
    """The type of `a if c else b`: of records the one with fewer fields, of texts any text."""
    assert q.join(first, second) == expected


@pytest.mark.parametrize(
    ("wanted", "got", "fits"),
    [
        (ANY, LENGTH, True),
        (LENGTH, ANY, True),
        (NUMBER, INTEGER, True),
        (INTEGER, NUMBER, False),
        (INTEGER, COUNT, True),
        (DURATION, NUMBER, False),
        (NUMBER, DURATION, False),
        (DURATION, q.ZERO, True),
        (DURATION, q.ZERO_NUMBER, True),
        (COUNT, q.ZERO, True),
        (TEXT, BOOL, False),
        (TEXT, MODE, True),
        (list_of(NUMBER), list_of(INTEGER), True),
        (list_of(INTEGER), list_of(NUMBER), False),
        (list_of(TEXT), TEXT, False),
        (LIST, list_of(TEXT), True),
        (list_of(TEXT), LIST, True),
        (record(x=LENGTH), POSE, True),
        (POSE, record(x=LENGTH), False),
        (record(x=LENGTH, y=TEXT), POSE, False),
        (record(x=TEXT, y=LENGTH), POSE, False),
        (record(), POSE, True),
    ],
)
def test_what_fits_where(wanted: Type, got: Type, fits: bool) -> None:
    """Whole numbers fit where numbers do, units must agree, a record needs every field that is asked for."""
    assert q.accepts(wanted, got) is fits


@pytest.mark.parametrize(
    ("kind", "told"),
    [
        (DURATION, "duration (s)"),
        (ANGLE, "angle (rad)"),
        (SPEED, "number in m/s"),
        (NUMBER, "a plain number"),
        (INTEGER, "a plain number"),
        (COUNT, "a plain number"),
        (q.ZERO, "a plain number"),
        (q.ZERO_NUMBER, "a plain number"),
        (TEXT, "text"),
        (MODE, "mode"),
        (Type("any", ""), "unknown"),
        (list_of(TEXT), "list of text"),
        (POSE, "pose"),
        (record(a=TEXT, b=BOOL), "a record of a, b"),
        (record(), "a record of nothing"),
        *(
            (Type("record", root, fields={"a": TEXT}), "a record of a")
            for root in ("param", "request", "input", "event", "error", "itinerary")
        ),
    ],
)
def test_a_type_is_called_so_that_an_author_knows_it(kind: Type, told: str) -> None:
    """With its unit; a record that is no type by what is in it."""
    assert q.describe(kind) == told


@pytest.mark.parametrize(
    ("kind", "example"),
    [
        (DURATION, "'5 s'"),
        (LENGTH, "'0.5 m'"),
        (ANGLE, "'90 deg'"),
        (SPEED, "'0.3 m/s'"),
        (RATE, "'2 Hz'"),
    ],
)
def test_a_number_without_its_unit_is_told_how_to_write_it(kind: Type, example: str) -> None:
    """Whichever of the two the unit is missing from; between two units there is nothing to advise."""
    hint = f"write the number with its unit as a text, such as {example}"
    assert q.unit_hint(kind, NUMBER) == q.unit_hint(NUMBER, kind) == hint
    assert q.unit_hint(kind, number_in("kg")) == q.unit_hint(NUMBER, NUMBER) == ""


def test_a_rounded_number_is_whole_and_keeps_its_unit() -> None:
    """Beside another of its kind too, and a written 0; only a number with digits makes digits."""
    seconds = q.whole("s")
    assert (seconds.kind, str(seconds), seconds.unit) == ("integer", "duration", "s")
    assert q.whole("") == INTEGER
    assert q.join(seconds, seconds) == q.join(seconds, q.ZERO) == q.join(q.ZERO, seconds) == seconds
    assert q.join(seconds, DURATION) == q.number("s")
    assert q.join(seconds, q.whole("m")) is None
    assert q.accepts(DURATION, seconds)
    assert not q.accepts(INTEGER, seconds)


# -- what authors are told ----------------------------------------------------------------------------------

MINI = Path(__file__).parents[2] / "charts" / "mini" / LIFECYCLE
HEAD = """\
mission: M
context:
  n: {type: count, default: 0}
initial: A
states:
"""


def told(text: str, folder: Path, catalog: Catalog) -> list[str]:
    """Return what is wrong with a mission in the mini lifecycle: where, and the problem."""
    file = folder / "m.yaml"
    file.write_text(text, encoding="utf-8")
    _, found = check_chart(MINI, [file], catalog)
    return [str(one).removeprefix(f"{file}:").replace("error: MISSION.M.", "") for one in found]


@pytest.mark.parametrize(
    ("guard", "problem"),
    [
        ("n is not 1", "'is not' is not allowed in an expression; write '!=' [bad-expression]"),
        ("n[1:2] == 1", "a slice is not allowed in an expression [bad-expression]"),
        (
            "(1 if n > 0 else 'a') == 1",
            "one outcome is a plain number, the other text; both must have one type [wrong-type]",
        ),
        ("held(name='pause')", "arguments are given by position [bad-expression]"),
        ("_x == 1", "unknown name '_x': no name begins with an underscore [unknown-name]"),
        ("held()", "held takes one argument, got 0 [missing-argument]"),
        ("n in reason", "expected text, but 'n' is a plain number [wrong-type]"),
        (
            "n in n",
            "expected a list after 'in', but 'n' is a plain number [wrong-type]",
        ),
        ("n in ['a']", "'n' is a plain number and cannot be in list of text [wrong-type]"),
        ("min() > 1", "min takes a list of numbers, or several numbers [missing-argument]"),
        ("max(n) > 1", "max of one value needs a list [wrong-type]"),
        *(
            (source, f"{what} is not allowed in an expression [bad-expression]")
            for source, what in (
                ("lambda: n", "a lambda"),
                ("{x for x in (1,)} == 1", "a comprehension"),
                ("{x: x for x in (1,)} == 1", "a comprehension"),
                ("(n := 1) == 1", "':='"),
                ("f'{n}' == ''", "a formatted text"),
                ("{'a': n} == 1", "a mapping"),
                ("{n} == 1", "a set"),
                ("(await n) == 1", "await"),
                ("(yield) == 1", "yield"),
                ("(yield from n) == 1", "yield"),
                ("max(*[n]) == 1", "'*'"),
                ("n ** 2 == 1", "'**'"),
                ("n << 2 == 1", "'<<'"),
                ("n >> 2 == 1", "'>>'"),
                ("n ^ 2", "'^'"),
                ("n @ 2", "'@'"),
                ("+n == 1", "a unary '+'"),
            )
        ),
        ("n | 2", "'|' is not allowed in an expression; write 'or' [bad-expression]"),
        ("n & 2", "'&' is not allowed in an expression; write 'and' [bad-expression]"),
        ("~n == 1", "'~' is not allowed in an expression; write 'not' [bad-expression]"),
        ("n is 1", "'is' is not allowed in an expression; write '==' [bad-expression]"),
    ],
)
def test_what_is_no_expression_is_told(guard: str, problem: str, tmp_path: Path, catalog: Catalog) -> None:
    """With what to write instead, where there is something."""
    states = f'  A: {{on: {{operator.dock: {{target: done, guard: "{guard}"}}}}}}\n  done: {{type: final}}\n'
    (found,) = told(HEAD + states, tmp_path, catalog)
    assert found.partition(": A.on.operator.dock.guard: ")[2] == problem


def test_every_mistake_in_actions_is_told(tmp_path: Path, catalog: Catalog) -> None:
    """Also the second one of the same action."""
    actions = "[{set: {a: 1, b: 2}}, {raise: {event: 'fine.not ok'}}, {itinerary.close: {status: OK}}]"
    states = f"  A:\n    entry: {actions}\n    after: {{1 s: done}}\n  done: {{type: final}}\n"
    assert told(HEAD + states, tmp_path, catalog) == [
        "7:20: A.entry.set: unknown variable 'a'; allowed: 'n', 'reason'; "
        "or declare it under context: 'a: {type: ..., default: ...}' [unknown-argument]",
        "7:26: A.entry.set: unknown variable 'b'; allowed: 'n', 'reason'; "
        "or declare it under context: 'b: {type: ..., default: ...}' [unknown-argument]",
        "7:50: A.entry.raise: 'fine.not ok' cannot be an event; "
        "use words of letters, digits and underscores, with dots between [bad-name]",
        "7:67: A.entry.itinerary.close: itinerary.close needs an itinerary, "
        "and no state around this one has one; add 'itinerary: {items: ...}' [missing-itinerary]",
    ]


def test_every_mistake_in_declarations_is_told(tmp_path: Path, catalog: Catalog) -> None:
    """Names that are none, a level that would hide its value, a way back to nowhere."""
    text = """\
mission: M
context: {1a: {type: count, default: 0}, 2b: {type: count, default: 0}}
inputs: {charge: {value: robot.battery, levels: {value: {below: 10 %}}}}
initial: A
states:
  A:
    resume_at: [{guard: 'true'}]
    states: {B: {after: {1 s: done}}}
  done: {type: final}
"""
    rule = "cannot be used as the name of a variable; use letters, digits and underscores [bad-name]"
    assert told(text, tmp_path, catalog) == [
        f"2:11: error: context.1a: '1a' {rule}",
        f"2:42: error: context.2b: '2b' {rule}",
        "3:50: error: inputs.charge.levels.value: "
        "a level cannot be called 'value', the number itself is [bad-name]",
        "7:17: A.resume_at: 'resume_at' names a child; add 'target: CHILD' [missing-key]",
    ]


def test_what_silences_rules_are_rules_themselves() -> None:
    """A misspelt name in these tables would silence nothing, and follow-up mistakes would be told as well."""
    assert {*checks._BROKEN_USES} - {*RULES} == set()
    assert {*checks._BROKEN_WAYS} < {*checks._BROKEN_READS} < {*checks._BROKEN_USES}


def test_the_page_of_rules_has_every_subject_and_every_rule() -> None:
    """What the page says and what the checker knows are the same words."""
    page = (Path(__file__).parents[3] / "docs" / "rules.md").read_text(encoding="utf-8").replace("`", "")
    for subject, rules in SUBJECTS.items():
        _, _, section = page.partition(f"\n## {subject}\n")
        section = section.partition("\n## ")[0]
        assert [rule for rule, told in rules.items() if f"{told[1:]}." not in section] == []


def test_a_finding_has_a_rule_that_is_known() -> None:
    """A misspelt rule is a defect of the checker, and told at once."""
    with pytest.raises(KeyError, match="rule 'nonsense' is not in RULES"):
        Findings().add(Place("a.yaml", 1, 1), "nonsense", "", "what is wrong")
    found = Findings()
    found.extend([warning(Place("a.yaml", 1, 1), "bad-name", "A", "what is wrong")])
    assert [str(one) for one in found.all] == ["a.yaml:1:1: warning: A: what is wrong [bad-name]"]


# -- graphs -------------------------------------------------------------------------------------------------

#: Two circles that share b, one that they lead to, a node of its own; what is no node does not count.
GRAPH = {"a": ["b"], "b": ["c", "a", "outside"], "c": ["b", "d"], "d": ["e"], "e": ["d"], "f": ["a", "c"]}


def test_components_come_after_what_they_lead_to() -> None:
    """Who can come back to itself stands together, in the order of the way there."""
    assert list(components(GRAPH)) == [["d", "e"], ["a", "b", "c"], ["f"]]


def test_what_was_left_does_not_join_what_comes_later() -> None:
    """A way to a finished part is no way back."""
    assert list(components({"a": ["b", "c"], "b": [], "c": ["b"]})) == [["b"], ["c"], ["a"]]


def test_every_simple_circle_is_told_once() -> None:
    """From its first node in the order given; a node that leads to itself is a circle."""
    assert list(cycles(GRAPH, ["a", "b", "c"], 100)) == [["a", "b"], ["b", "c"]]
    whole = {name: ["x", "y", "z"] for name in "xyz"}
    assert list(cycles(whole, ["x", "y", "z"], 1000)) == [
        ["x"],
        ["x", "y"],
        ["x", "y", "z"],
        ["x", "z"],
        ["x", "z", "y"],
        ["y"],
        ["y", "z"],
        ["z"],
    ]


def test_looking_for_circles_ends_after_its_limit() -> None:
    """Each step counts one: one step finds x, two more (to y and back) the second circle."""
    whole = {name: ["x", "y"] for name in "xy"}
    found = {limit: list(cycles(whole, ["x", "y"], limit)) for limit in range(4)}
    assert found == {0: [], 1: [["x"]], 2: [["x"]], 3: [["x"], ["x", "y"]]}


# -- rules --------------------------------------------------------------------------------------------------


def test_a_state_and_one_inside_it_cannot_both_have_a_resource(tmp_path: Path, catalog: Catalog) -> None:
    """The outer operation goes on meanwhile; an operation without that resource may run beside it."""
    drive = "{do: nav.dock, with: {pose: '${ param.dock_pose }'}, timeout: {after: 5 s, code: late}}"
    wait = "{do: nav.localize, with: {max_variance: 1}, timeout: {after: 5 s, code: late}}"
    text = f"""\
mission: M
initial: A
states:
  A:
    invoke: {drive}
    on_done: done
    on_error: done
    initial: B
    states:
      B: {{invoke: {wait}, on_done: C, on_error: done}}
      C: {{invoke: {drive}, on_done: B, on_error: B}}
  done: {{type: final}}
"""
    (found,) = told(text, tmp_path, catalog)
    assert found == (
        "11:19: warning: MISSION.M.A.C: nav.dock uses 'base' as nav.dock in 'A' does, "
        "and both can be active: one waits until the other has ended; "
        "do them one after the other [shared-resource]"
    )
