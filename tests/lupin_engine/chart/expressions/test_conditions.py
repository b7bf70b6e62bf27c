"""Conditions are compared without running them: what is not certain counts as possible."""

from __future__ import annotations

import itertools
from typing import Any

import pytest

from lupin_engine.chart.expressions import guards
from lupin_engine.chart.expressions.guards import (
    Fact,
    ValueSet,
    constant,
    exclusive,
    fact,
    formula_of,
    implies,
    negate,
    possible,
    total,
)
from lupin_engine.chart.expressions.names import names_read, tree_of, unknowns_read

# -- which exclude each other, which follow ------------------------------------------------------------


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("x == 'a'", "x == 'b'"),
        ("x", "not x"),
        ("x == true", "not x"),
        ("x < 5", "x >= 5"),
        ("x < y", "y <= x"),
        ("x in ('a', 'b')", "x in ['c']"),
        ("x in ('a', 'b')", "x not in ('a', 'b', 'c')"),
        ("a and x < 1", "x > 2 and b"),
        ("x < '5 s'", "x > '1 min'"),
        ("x > -1", "x < -2"),
        ("a or b", "not a and not b"),
        ("0 < x < 5", "x == 7"),
        ("len(x) == 0", "len(x) > 0"),
        ("f(x)", "not f(x)"),
        ("x in y", "x not in y"),
        ("a", "b and false"),
    ],
)
def test_conditions_that_exclude_each_other(first: str, second: str) -> None:
    """What is provable by comparing one operand with constants, or with one other operand."""
    assert exclusive(formula_of(first), formula_of(second))
    assert exclusive(formula_of(second), formula_of(first))


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("x", "y"),
        ("x <= 5", "x >= 5"),
        ("a or b", "not a"),
        ("x != 'a'", "x != 'b'"),
        ("x < y", "x < z"),
        ("x in y", "x in z"),
        ("x < 5", "y >= 5"),
        ("x == '60 s'", "x == '1 min'"),
        ("not an expression", "x"),
    ],
)
def test_conditions_that_may_hold_together(first: str, second: str) -> None:
    """What is not certain counts as possible."""
    assert not exclusive(formula_of(first), formula_of(second))


def test_conditions_of_which_one_is_always_true() -> None:
    """Together they leave nothing out."""
    assert total([formula_of("x < 1"), formula_of("1 <= x and x < 5"), formula_of("x >= 5")])
    assert not total([formula_of("x < 1"), formula_of("x > 1")])
    assert total([formula_of("x == 'a'")], fact("x", "a"))


def test_conditions_that_follow_from_each_other() -> None:
    """A narrower one from a wider one."""
    assert implies(formula_of("x > 5"), formula_of("x > 3"))
    assert implies(formula_of("x == 'a' and y"), formula_of("x in ('a', 'b')"))
    assert not implies(formula_of("x > 3"), formula_of("x > 5"))


@pytest.mark.parametrize(
    ("source", "value"),
    [
        ("true", True),
        ("False", False),
        ("1 > 2", False),
        ("2 in (1, 2)", True),
        ("x in []", False),
        ("x and false", False),
        ("x or not x", True),
        ("x > 5 and x < 3", False),
        ("'a' == 'b'", False),
        ("x and y", None),
        ("x == 'true'", None),
        ("0 < x < 5", None),
        ("x == 'a' or y == 'a'", None),
    ],
)
def test_conditions_that_depend_on_nothing(source: str, value: bool | None) -> None:
    """Constants, however they are hidden."""
    assert constant(source) is value


def test_too_many_alternatives_are_taken_to_be_possible() -> None:
    """The search is bounded: a condition of any size costs milliseconds."""
    wide = " and ".join(f"(a{n} == 1 or a{n} == 2)" for n in range(30))
    assert not exclusive(formula_of(wide), formula_of("b == 1 and b == b and c in (1, 2) or d"))


@pytest.mark.parametrize(
    ("source", "read"),
    [
        ("input.a > 1 and input.b.low", ("input.a", "input.b")),
        ("known(input.a) and input.a > 1", ()),
        ("input.a > 1 and known(input.a)", ("input.a",)),
        ("not known(input.a) or input.a > 1", ()),
        ("known(input.a) or input.a > 1", ("input.a",)),
        ("input.a if known(input.a) else input.b", ("input.b",)),
        ("0 if not known(input.a) else input.a", ()),
        ("input.a if input.b else input.c", ("input.b", "input.a", "input.c")),
        ("input.a if known(input.b) else input.b", ("input.a", "input.b")),
        ("input.a + (1 if known(input.a) else input.b)", ("input.a", "input.b")),
        ("(known(input.a) or known(input.b)) and input.a", ("input.a",)),
        ("known(input.a) and x and max(input.a, input.b) > 1", ("input.b",)),
        ("find(xs, t.id == 'a').x > 1", ("find(xs, t.id == 'a')",)),
        ("known(find(xs, t.id == 'a')) and find(xs, t.id=='a').x > 1", ()),
        ("known(find(input.a, t.x > 1)) and len(input.a) > 1", ()),
        ("find(input.a, t.x > 1)", ("find(input.a, t.x > 1)", "input.a")),
        ("[t.x for t in input.a if known(input.b) and input.b > t.x]", ("input.a",)),
        ("[input.b for t in xs if known(input.b)]", ()),
        ("event.reading['heat'] > 1 and error.code in ['a']", ("event.reading['heat']",)),
        ("known(event.reading['heat']) and event.reading['heat'] > 1", ()),
        ("[input.b for t in xs]", ("input.b",)),
    ],
)
def test_inputs_that_are_read_without_asking(source: str, read: tuple[str, ...]) -> None:
    """Asking counts from where it is asked on, on the branch where the answer is yes."""
    assert unknowns_read(source) == read


def test_names_that_are_read() -> None:
    """The first words, functions included."""
    assert names_read("in_state('A') and input.a > laps") == {"in_state", "input", "laps"}


# -- compared with what really happens ---------------------------------------------------------------------

#: What each operand may be, with something between and beside all that conditions name.
WORLD: dict[str, tuple[Any, ...]] = {
    "n": (-1, 0, 0.5, 1, 1.5, 2, 2.5, 3, 4),
    "m": (-1, 0, 0.5, 1, 1.5, 2, 2.5, 3, 4),
    "t": ("a", "b", "c", "d"),
    "f": (True, False),
}
ATOMS = [
    *(f"n {sign} {number}" for sign in ("==", "!=", "<", "<=", ">", ">=") for number in (1, 2)),
    *(f"{number} {sign} n" for sign in ("==", "<", "<=", ">", ">=") for number in (1, 2)),
    *(f"n {sign} m" for sign in ("==", "!=", "<", "<=", ">", ">=")),
    *(f"m {sign} n" for sign in ("==", "<", "<=", ">", ">=")),
    *(f"not n {sign} m" for sign in ("==", "<", ">=")),
    "f",
    "not f",
    "f == true",
    "f != true",
    "true == f",
    "f == false",
    "not f == false",
    "t == 'a'",
    "'a' != t",
    "t in ('a', 'b')",
    "t not in ['a', 'b']",
    "not t in ['c']",
    "t in []",
    "t not in []",
    "n in [1, 2]",
    "0 < n < 3",
    "not 0 < n <= 2",
    "2 > 1",
    "1 in (1, 2)",
    "1 not in [1, 2]",
    "'a' == 'b'",
    "true",
    "not True",
]
MOMENTS = [dict(zip(WORLD, values, strict=True)) for values in itertools.product(*WORLD.values())]


def moments(source: str) -> frozenset[int]:
    """Return when a condition holds, by trying."""
    code = compile(source.replace("true", "True").replace("false", "False"), "condition", "eval")
    return frozenset(at for at, moment in enumerate(MOMENTS) if eval(code, {}, moment))


HOLDS = {source: moments(source) for source in ATOMS}


def about(source: str) -> frozenset[str]:
    """Return the operands of a condition: only what is said of the same ones can be compared."""
    return names_read(source) & WORLD.keys()


@pytest.mark.parametrize("first", ATOMS)
def test_what_is_said_of_two_conditions_is_so(first: str) -> None:
    """As trying every value shows: exactly so for the same operands, and for others nothing too much."""
    one = formula_of(first)
    for second in ATOMS:
        other = formula_of(second)
        apart = HOLDS[first].isdisjoint(HOLDS[second])
        within = HOLDS[first] <= HOLDS[second]
        covering = HOLDS[first] | HOLDS[second] == frozenset(range(len(MOMENTS)))
        assert exclusive(one, other) <= apart, second
        assert implies(one, other) <= within, second
        assert total([one, other]) <= covering, second
        if about(first) == about(second) or not (HOLDS[first] and HOLDS[second]):
            assert (exclusive(one, other), implies(one, other), total([one, other])) == (
                apart,
                within,
                covering,
            ), second


@pytest.mark.parametrize("source", ATOMS)
def test_a_condition_and_its_opposite_leave_nothing_and_share_nothing(source: str) -> None:
    """Whatever it is made of."""
    both = formula_of(source), negate(formula_of(source))
    assert exclusive(*both)
    assert total(both)
    assert possible(both[0]) is bool(HOLDS[source])
    assert constant(source) is {0: False, len(MOMENTS): True}.get(len(HOLDS[source]))


@pytest.mark.parametrize(
    ("values", "inside", "outside"),
    [
        (ValueSet(low=1), [1, 2], [0, "a", None]),
        (ValueSet(low=1, low_open=True), [1.5, 2], [1, 0, "1"]),
        (ValueSet(high=1), [1, 0], [2, "a"]),
        (ValueSet(high=1, high_open=True), [0.5], [1, 2]),
        (ValueSet(excluded=frozenset([1])), [0, "a"], [1]),
        (ValueSet(frozenset(["a"])), ["a"], ["b", 1]),
        (ValueSet(), ["a", 1, None], []),
        (ValueSet(low=1, high=1), [1], [0, 2]),
    ],
)
def test_which_values_are_in_a_set(values: ValueSet, inside: list[Any], outside: list[Any]) -> None:
    """Between bounds lie numbers only."""
    assert [values.holds(value) for value in inside] == [True] * len(inside)
    assert [values.holds(value) for value in outside] == [False] * len(outside)


def test_what_two_sets_have_in_common() -> None:
    """Nothing when bounds leave nothing, also a single value that is excluded or not inside."""
    low, high = ValueSet(low=1), ValueSet(high=1)
    assert low.meets(high) == ValueSet(low=1, high=1)
    assert low.meets(ValueSet(high=1, high_open=True)) is None
    assert ValueSet(low=1, low_open=True).meets(high) is None
    assert low.meets(ValueSet(high=0)) is None
    assert low.meets(ValueSet(frozenset([0, 1]))) == ValueSet(frozenset([1]), low=1)
    assert low.meets(ValueSet(frozenset(["a", 0]))) is None
    assert ValueSet(frozenset("ab")).meets(ValueSet(frozenset("bc"))) == ValueSet(frozenset("b"))
    assert ValueSet(low=1, high=1).meets(ValueSet(excluded=frozenset([1]))) is None


def test_a_bound_of_something_that_is_no_number_says_nothing() -> None:
    """It may be a date or a time of day: what is compared with the same text is the same fact, no more."""
    assert formula_of("t < 'b'") == Fact("'b' ? t", ValueSet(frozenset(">")))
    assert exclusive(formula_of("t < 'b'"), formula_of("t >= 'b'"))
    assert not exclusive(formula_of("t < 'b'"), formula_of("t > 'c'"))
    assert exclusive(formula_of("t == 'a'"), formula_of("t > 3"))
    assert formula_of("t is 3") == fact("t is 3", True)
    assert formula_of("not t is 3") == fact("t is 3", False)
    assert formula_of("not even an expression") == fact("not even an expression", True)


def test_how_many_alternatives_are_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every choice counts one, and the question itself; from then on conditions may hold together."""
    first, second = formula_of("a == 1 or a == 2"), formula_of("a == 3")
    for limit, seen in ((2, False), (3, True)):
        monkeypatch.setattr(guards, "MAX_ALTERNATIVES", limit)
        assert exclusive(first, second) is seen


@pytest.mark.parametrize(
    ("source", "value"),
    [
        ("f() or not f()", True),
        ("x in [] or y", None),
        ("(x == 'a and b') and y", None),
        ("x == 'true' or y == \"and\"", None),
        ("x == 'a' and 2 > 1", None),
        ("x == 'a' and 2 < 1", False),
        ("len(x) > 0 or len(x) == 0", None),
        ("x and (y or not x and x)", None),
    ],
)
def test_conditions_that_look_constant_or_look_not(source: str, value: bool | None) -> None:
    """Told apart by words alone where that is certain, else by trying."""
    assert constant(source) is value


def test_what_was_refused_as_too_large_is_not_followed() -> None:
    """The bound is that of expressions."""
    small, large = " and ".join(["a"] * 30), " and ".join(["a"] * 300)
    assert tree_of(small) is not None
    assert tree_of(large) is None
    assert names_read(large) == frozenset()
    assert unknowns_read("not an expression") == ()
    assert tree_of("a\n and\tb") is not None
