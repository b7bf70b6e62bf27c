"""Slips of the pen in a catalog are told in the words of their place, all at once."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from lupin_engine.errors import PluginError
from lupin_engine.plugin.contract import (
    Action,
    Argument,
    Code,
    EventKind,
    Function,
    LiveValue,
    Mock,
    Operation,
    Parameter,
    Plugin,
    Reader,
)
from lupin_engine.plugin.registry import build_catalog
from lupin_engine.plugin.types import DURATION, NUMBER, TEXT, Type, list_of, number_in, within

BROKEN = Code("broken", "it is broken")


def odd(value: Any) -> Any:
    """Return what no type checker would let stand there."""
    return value


def told(**changed: Any) -> list[str]:
    """Return what the registry says of a plugin with these parts."""
    with pytest.raises(PluginError) as refused:
        build_catalog([replace(Plugin("lamp", "A lamp."), **changed)])
    return [line.removeprefix("plugin 'lamp': ") for line in str(refused.value).splitlines()]


def operation(**changed: Any) -> dict[str, Any]:
    """Return a plugin's part with one operation."""
    return {"operations": {"dim": replace(Operation("Dim it."), **changed)}}


@pytest.mark.parametrize(
    ("parts", "problem"),
    [
        ({"doc": None}, "doc must be a text, got None"),
        ({"client": Plugin}, "client must be a text, got <class 'lupin_engine.plugin.contract."),
        ({"internal": "no"}, "internal must be True or False, got 'no'"),
        (
            {"companions": "sim"},
            "companions must be a tuple of names, got 'sim'; of one, with a comma: (ONE,)",
        ),
        (
            operation(classes={"level": 1.0}),
            "operation 'dim': classes must be a tuple of mappings by name, got {'level': 1.0};"
            " of one, with a comma: (ONE,)",
        ),
        (
            {"values": {"lamp.level": LiveValue("How bright.", NUMBER, classes=odd(1.0))}},
            "value 'lamp.level': classes must be a tuple of values, got 1.0; of one, with a comma: (ONE,)",
        ),
        (
            operation(result={"level": NUMBER}, classes=({"lever": 1.0},)),
            "operation 'dim': class 1 answers 'lever', which is no field of the result",
        ),
        (
            operation(result={"level": NUMBER}, classes=({"level": 1.0}, {"level": "dark"})),
            "operation 'dim': class 2's 'level': expected number, got 'dark'",
        ),
        (
            {"values": {"lamp.level": LiveValue("How bright.", NUMBER, classes=(True,))}},
            "value 'lamp.level': class 1: expected number, got True",
        ),
        ({"operations": []}, "operations must be a mapping by name, such as {'name': ...}, got []"),
        (
            {"operations": {"dim": Action("Dim.")}},
            "operation 'dim' must be made with Operation(...), got Action(",
        ),
        ({"operations": {3: Operation("Dim.")}}, "operation 3: a name must be a text"),
        (operation(doc=5), "operation 'dim': doc must be a text, got 5"),
        (
            operation(codes=BROKEN),
            "operation 'dim': codes must be a tuple of Code(...), got Code(name='broken', label='it is",
        ),
        (
            operation(codes=("x", BROKEN)),
            "operation 'dim': codes: number 1 must be made with Code(...), got 'x'",
        ),
        (
            operation(codes=(Code("x", "x", odd("bad")),)),
            "operation 'dim': codes: number 1: severity must be a Severity, got 'bad'",
        ),
        (
            operation(uses=("base")),
            "operation 'dim': uses must be a tuple of names, got 'base'; of one, with a ",
        ),
        (
            operation(on_hold="cancel"),
            "operation 'dim': on_hold must be OnHold.CANCEL or OnHold.FINISH, got 'can",
        ),
        (
            operation(mock=Mock(after=odd("2 s"))),
            "operation 'dim': mock: after must be a number of seconds, such as 2.0, got '2 s'",
        ),
        (
            operation(mock=Mock(result=odd(5))),
            "operation 'dim': mock: result must be a mapping by name, or a function of arguments and ",
        ),
        (
            operation(arguments={"by": NUMBER}),
            "operation 'dim': the argument 'by' must be made with Argument(...), got Type(kind='number', ",
        ),
        (
            operation(arguments={"by": Argument(NUMBER, odd(None))}),
            "operation 'dim': the argument 'by': doc must be a text, got None",
        ),
        (
            {"actions": {"blink": Action("Blink.", moves=odd("yes"))}},
            "action 'blink': moves must be True or False, ",
        ),
        (
            {"functions": {"glow": Function("How.", NUMBER, odd(5))}},
            "function 'glow': bind must be a function of the parameters, got 5",
        ),
        (
            {"values": {"lamp.on": LiveValue("whether", TEXT, freshness=odd("2 s"))}},
            "value 'lamp.on': freshness must be a number of seconds, such as 2.0, got '2 s'",
        ),
        (
            {"events": {"burnt": EventKind("Burnt.", odd([]))}},
            "event 'burnt': fields must be a mapping by name, such ",
        ),
        (
            {"parameters": {"watt": Parameter(NUMBER, 1.0, "watts", minimum=odd("0"))}},
            "parameter 'watt': minimum must be a number, got '0'",
        ),
        (
            {"readers": {"text": Reader(odd("x"), odd(str))}},
            "reader 'text': code must be made with Code(...), got 'x'",
        ),
        ({"nodes": {"sim": None}}, "node 'sim' must be a text, got None"),
        (
            {"stands_in": {"sim": "go"}},
            "stands_in 'sim' must be a tuple of names, got 'go'; of one, with a comma",
        ),
    ],
)
def test_a_slip_is_told_with_its_place(parts: dict[str, Any], problem: str) -> None:
    """What must be there, and what stands there."""
    (only,) = told(**parts)
    assert only.startswith(problem)


def test_all_slips_are_told_at_once() -> None:
    """In the order in which the catalog is declared."""
    slips = told(doc=1, **operation(doc=2, uses=3), parameters={"watt": 4})
    assert [slip.rpartition(", got ")[0] for slip in slips[:2]] == [
        "doc must be a text",
        "operation 'dim': doc must be a text",
    ]
    assert slips[2].startswith("operation 'dim': uses must be a tuple of names, got 3")
    assert slips[3] == "parameter 'watt' must be made with Parameter(...), got 4"


# -- units ------------------------------------------------------------------------------------------------


def test_a_unit_that_missions_cannot_write_is_refused() -> None:
    """Wherever a type has one: also in lists and records."""
    load = Type("record", "load", fields={"weight": number_in("kgs")})
    assert told(values={"lamp.load": LiveValue("what it bears", list_of(load))}) == [
        "value 'lamp.load': the field 'weight' has the unit 'kgs', which missions cannot write; "
        "did you mean 'kg'?"
    ]
    (only,) = told(**operation(result={"heavy": number_in("stone")}))
    assert only.startswith(
        "operation 'dim': the result field 'heavy' has the unit 'stone', which missions cannot write; "
        "allowed: '%', "
    )


def test_a_unit_that_numbers_are_not_kept_in_is_refused() -> None:
    """A driver would get and report kilograms all the same."""
    assert told(parameters={"most": Parameter(number_in("g"), 5.0, "what it can bear")}) == [
        "parameter 'most' has the unit 'g'; numbers are kept in 'kg', so declare that one"
    ]


def test_a_range_that_nothing_is_in_is_refused() -> None:
    """And not the default for being outside of it."""
    assert told(parameters={"rest": Parameter(DURATION, 5.0, "rest", minimum=9, maximum=2)}) == [
        "parameter 'rest': the minimum 9 is above the maximum 2"
    ]


def test_a_range_is_checked_wherever_a_type_has_one() -> None:
    """Of arguments, results, values and events, also inside of lists; a text has none."""
    level = LiveValue("how bright it is", list_of(within(NUMBER, 2, 1)))
    assert told(values={"lamp.level": level}) == ["value 'lamp.level': the minimum 2 is above the maximum 1"]
    said = Argument(within(TEXT, None, 5), "what it says")
    assert told(**operation(arguments={"said": said})) == [
        "operation 'dim': the argument 'said': a text has no minimum or maximum"
    ]
    narrow = Argument(within(DURATION, 1, 2), "how long", default=3.0)
    assert told(**operation(arguments={"wait": narrow})) == [
        "operation 'dim': the default of argument 'wait': expected duration between 1 and 2 s, got 3.0"
    ]
