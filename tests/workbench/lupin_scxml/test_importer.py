"""Charts of others become missions: what SCXML and the language share, and the rest by its line."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from decimal import ROUND_HALF_DOWN, ROUND_HALF_UP, Decimal
from typing import Any

import pytest

from lupin_engine.diagram.outline import outline
from lupin_engine.errors import UsageError
from lupin_scxml.elements import MAX_BYTES, MAX_DEPTH, Element, elements
from lupin_scxml.exporter import scxml
from lupin_scxml.importer import Imported, from_scxml
from tests.lupin_engine.diagram import pictured

STATES = ("state", "parallel", "final", "history")


def imported(inside: str, attributes: str = "") -> Imported:
    """A document's mission."""
    head = f'<scxml xmlns="http://www.w3.org/2005/07/scxml" version="1.0" {attributes}>'
    return from_scxml(f"{head}\n{inside}\n</scxml>".encode(), "Tried")


def states(inside: str, attributes: str = "") -> dict[str, Any]:
    """Its states."""
    found: dict[str, Any] = imported(inside, attributes).mission["states"]
    return found


def notes(inside: str) -> list[str]:
    """What is said of it, with the line."""
    return [f"{note.line}: {note.text}" for note in imported(inside).notes]


# -- fields of events ----------------------------------------------------------------------------------------


def test_a_field_has_the_type_that_the_senders_of_its_event_give_it() -> None:
    """Whatever another event carries under that name; of two types of one event none is chosen."""
    inside = """<datamodel><data id="x"/><data id="y"/></datamodel><state id="a"><onentry>
        <send event="n"><param name="v" expr="5"/></send>
        <send event="t"><param name="v" expr="'five'"/></send></onentry>
        <transition event="n"><assign location="x" expr="_event.data.v"/></transition>
        <transition event="t"><assign location="y" expr="_event.data.v"/></transition></state>"""
    variables = {name: one["type"] for name, one in imported(inside).mission["context"].items()}
    assert variables == {"x": "number", "y": "text"}
    both = inside.replace('event="t"', 'event="n"', 1)
    assert "context" not in imported(both).mission
    assert "4: 'n' carries v as number and as text: its type is not known" in notes(both)
    assert "5: a value of 'x' cannot be said; it is left out" in notes(both)


# -- round trip ---------------------------------------------------------------------------------------------


def drawn(element: Element) -> Iterator[tuple[tuple[str, ...], str, Counter[str]]]:
    """The picture of a document: each state, its kind, and where its transitions lead."""
    for state in element.every():
        if state.kind not in STATES:
            continue
        around = [one for one in reversed(state.around) if one.kind in STATES]
        ends = f"done.state.{state.get('id')}"
        rules = [rule for rule in state.all("transition") if rule.get("event") != "error"]
        rules = [rule for rule in rules if not rule.get("event").startswith("done.state.")]
        rules += [
            r for one in (state, *around) for r in one.all("transition") if ends in r.get("event").split()
        ]
        targets = Counter(rule.get("target") for rule in rules)
        names = tuple(local(one) for one in (*around, state))
        yield names, state.kind, targets if state.kind != "history" else Counter()


def local(state: Element) -> str:
    """A state's own name."""
    return state.get("id").removeprefix(f"{state.around[0].get('id')}-")


def made(
    node: Mapping[str, Any], path: tuple[str, ...] = (), scopes: tuple[Any, ...] = ()
) -> Iterator[tuple[tuple[str, ...], str, Counter[str]]]:
    """The picture of a mission."""
    inner = (*scopes, (path, node))
    for name, state in node.get("states", {}).items():
        kind = state.get("type", "state")
        groups = [state.get(word, []) for word in ("always", "on_done", "on_error")]
        groups += [rules for word in ("on", "after", "every", "at") for rules in state.get(word, {}).values()]
        rules = [rule for some in groups for rule in (some if isinstance(some, list) else [some])]
        here = (*path, name)
        around = (*inner, (here, state))
        if name != "begin":
            yield here, kind, Counter(found(rule, around) for rule in rules)
        yield from made(state, here, inner)


def found(rule: Any, scopes: tuple[Any, ...]) -> str:
    """The id of what a transition's target names, from the nearest state around."""
    target: str = rule if isinstance(rule, str) else rule.get("target", "")
    first, *_ = words = target.split(".")
    for path, node in reversed(scopes):
        if first in node.get("states", {}):
            return "-".join((*path, *words))
    return target


@pytest.mark.parametrize("name", pictured.NAMES)
def test_what_is_exported_comes_back(name: str) -> None:
    """Every state in its place, of its kind, with transitions to the same states."""
    document = scxml(outline(pictured.chart(name), whole=True)).encode()
    mission = from_scxml(document, "Again").mission
    wanted = {path: (kind, targets) for path, kind, targets in drawn(elements(document))}
    assert {path: (kind, targets) for path, kind, targets in made(mission)} == wanted


def test_what_clocks_do_comes_back() -> None:
    """Each under its word, with its time; nothing is noted as lost."""
    document = scxml(outline(pictured.chart("words"), whole=True)).encode()
    found = from_scxml(document, "Again")
    looking = found.mission["states"]["MISSION"]["states"]["Words"]["states"]["STARTING"]["states"]["LOOKING"]
    assert {word: list(looking[word]) for word in ("after", "every", "at")} == {
        "after": ["1 s"],
        "every": ["0.2 s"],
        "at": ["06:30"],
    }
    assert looking["every"]["0.2 s"] == {"do": [{"set": {"read": "${ read + 1 }"}}]}
    assert [note for note in found.notes if "again" in note.text or "delayed" in note.text] == []


# -- what is the same in both -------------------------------------------------------------------------------


def test_names_are_mapped() -> None:
    """States in upper case, ends in lower case; two that would be the same stay two."""
    found = imported('<state id="wait-here"/><state id="Wait.Here"/><final id="The-End"/>')
    assert list(found.mission["states"]) == ["WAIT_HERE", "WAIT_HERE_", "the_end"]
    assert found.names == {"wait-here": "WAIT_HERE", "Wait.Here": "WAIT_HERE_", "The-End": "the_end"}


def test_an_id_with_that_of_the_state_around_is_the_rest() -> None:
    """Unless that name is taken."""
    found = imported(
        '<state id="m::on"><state id="m::on::slow"/><state id="m::on::fast"/></state>'
        '<state id="m::off"><state id="m::off::slow"/><final id="m::off::end"/>'
        '<transition event="done" target="m::on"/></state>'
    ).mission["states"]
    assert (list(found["M_ON"]["states"]), list(found["M_OFF"]["states"])) == (
        ["SLOW", "FAST"],
        ["M_OFF_SLOW", "end"],
    )
    assert found["M_OFF"]["on_done"] == "M_ON"


def test_guards_and_assignments_are_expressions() -> None:
    """With the signs of ECMAScript, variables with a type."""
    found = imported(
        """<datamodel><data id="n" expr="0"/><data id="who" expr="'me'"/>
        <data id="ok">false</data></datamodel>
        <state id="a"><onexit><assign location="n" expr="n + 1"/></onexit>
        <transition target="b"
          cond="!ok &amp;&amp; (n === 1 || who != 'a &amp;&amp; b') &amp;&amp; In('b')"/></state>
        <state id="b"/>"""
    ).mission
    assert found["context"] == {
        "n": {"type": "number", "default": 0},
        "who": {"type": "text", "default": "me"},
        "ok": {"type": "bool", "default": False},
    }
    assert found["states"]["A"] == {
        "exit": [{"set": {"n": "${ n + 1 }"}}],
        "always": {"target": "B", "guard": "not ok and (n == 1 or who != 'a && b') and in_state('B')"},
    }


def test_delays_history_parallel_and_ends() -> None:
    """A delayed send of a state that only this one hears is its `after`."""
    found = states(
        """<parallel id="p"><history id="h" type="deep"><transition target="b"/></history>
        <state id="a" initial="b"><state id="b"><onentry><send event="late" id="t" delay="1500ms"/></onentry>
        <onexit><cancel sendid="t"/></onexit><transition event="late" target="e"/></state>
        <final id="e"/></state>
        <state id="c"/><transition event="done.state.a" target="f"/></parallel>
        <state id="back"><transition event="again" target="h"/></state><final id="f"/>"""
    )
    assert found["P"]["type"] == "parallel"
    assert found["P"]["states"]["H"] == {"type": "history", "depth": "deep", "initial": "A.B"}
    assert found["P"]["states"]["A"]["states"]["B"] == {"after": {"1500 ms": "e"}}
    assert found["P"]["states"]["A"]["on_done"] == "f"
    assert found["BACK"] == {"on": {"again": "P.H"}}


def test_raise_if_and_results() -> None:
    """Executable content has the same words."""
    found = states(
        """<datamodel><data id="n" expr="0"/></datamodel>
        <state id="a"><onentry><raise event="x.y"/><if cond="n==1"><raise event="one"/><elseif cond="n==2"/>
        <raise event="two"/><else/><send event="more" target="#_internal"><param name="v" expr="n"/></send>
        </if></onentry></state><final id="f"><donedata><param name="got" expr="n"/></donedata></final>"""
    )
    assert found["A"]["entry"] == [
        {"raise": {"event": "x.y"}},
        {
            "if": {
                "guard": "n == 1",
                "then": [{"raise": {"event": "one"}}],
                "else": [
                    {
                        "if": {
                            "guard": "n == 2",
                            "then": [{"raise": {"event": "two"}}],
                            "else": [{"raise": {"event": "more", "with": {"v": "${ n }"}}}],
                        }
                    }
                ],
            }
        },
    ]
    assert found["f"] == {"type": "final", "result": {"got": "${ n }"}}


def test_a_pattern_stands_under_each_event_that_it_covers() -> None:
    """So the order of the document decides."""
    found = states(
        """<state id="a"><onentry><raise event="go.far"/><raise event="go"/><raise event="stay"/></onentry>
        <transition event="go" target="b"/><transition event="go.far *" target="c"/></state>
        <state id="b"/><state id="c"/>"""
    )
    assert found["A"]["on"] == {"go": "B", "go.far": "B", "stay": "C"}


def test_a_beginning_further_in_is_a_helper_state() -> None:
    """It leads on at once, with what is done on the way."""
    found = imported('<state id="a"><state id="b"/><state id="c"/></state>', 'initial="c"').mission
    assert (found["initial"], found["states"]["begin"]) == ("begin", {"always": "A.C"})


def test_a_beginning_that_is_the_first_anyway_needs_no_state() -> None:
    """Though the document names it."""
    found = imported(
        '<state id="a"><state id="b"/><state id="c"/></state><state id="d"/>', 'initial="b"'
    ).mission
    assert (found["initial"], list(found["states"])) == ("A", ["A", "D"])


def test_a_beginning_in_every_region_is_the_parallel_state() -> None:
    """Also where it has no id."""
    found = imported('<parallel><state id="a"/><state id="b"/></parallel>', 'initial="a b"')
    assert (found.mission["initial"], found.notes) == ("CHART_PARALLEL", ())


@pytest.mark.timeout(20)
def test_a_long_document_is_no_trouble() -> None:
    """The work grows with its length, not with the square of it."""
    one = (
        '<state id="s{0}"><onentry><send event="e{0}" delay="1s"/></onentry>'
        '<transition event="e{0}" target="s0"/></state>'
    )
    found = states("".join(one.format(number) for number in range(749)))
    assert found["S748"] == {"after": {"1 s": "S0"}}


# -- what ECMAScript means by it ----------------------------------------------------------------------------


def guard(cond: str) -> Any:
    """A condition in the language, where `n` is a number and `t` a text; nothing where it cannot be said."""
    data = """<datamodel><data id="n" expr="1"/><data id="t" expr="'a'"/></datamodel>"""
    found = states(f'{data}<state id="a"><transition cond="{cond}" target="b"/></state><state id="b"/>')
    rule = found["A"].get("always")
    return rule.get("guard", "true") if isinstance(rule, dict) else "true" if rule else None


@pytest.mark.parametrize("given", [-7.5, -5, -2.5, -0.5, 0, 0.49999999999999994, 0.5, 1.5, 2.5, 3, 1e17])
def test_remainders_and_rounding(given: float) -> None:
    """The remainder has the sign of what is divided; halves are rounded up."""
    for by in (3, -3, 0.5, -2.5):
        remainder = eval(guard(f"n % {by} == 9").removesuffix(" == 9"), {"n": given, "abs": abs})
        assert remainder == math.fmod(given, by)
        remainder = eval(guard("n % (n + 2) == 9").removesuffix(" == 9"), {"n": given, "abs": abs})
        assert remainder == math.fmod(given, given + 2)
    halves = Decimal(given).quantize(Decimal(1), ROUND_HALF_UP if given > 0 else ROUND_HALF_DOWN)
    assert eval(guard("Math.round(n) == 9").removesuffix(" == 9"), {"n": given}) == halves


@pytest.mark.parametrize(
    ("cond", "said"),
    [
        ("n == 010", "n == 8"),
        ("n == 089", "n == 89"),
        ("n == 0x1F", "n == 31"),
        ("n == 9007199254740993", "n == 9007199254740992.0"),
        ("n == 1e999", None),
        ("n % 2 == 0", "n % 2 == 0"),
        ("-5 % 3 == n", "-2 == n"),
        ("Math.round(2.5) == n", "3 == n"),
        ("Math.max(n) == 1", "n == 1"),
        ("t + 1 == 'a1'", "t == 'a'"),
        ("'a1' != t + 1", "t != 'a'"),
        ("t + 1 == 'b'", None),
        ("'n' + n == 'n12'", "n == 12"),
        ("'n' + n == 'n012'", None),
        ("'n' + n != 'nn'", "true"),
        ("t + 1.0 + true == 'x1true'", "t == 'x'"),
        ("'a' + 1 == 'a1'", "true"),
        ("t + n == 'a1'", None),
        ("t + 1", None),
        ("!(t + 1) || n == 1", "n == 1"),
        ("t + ''", None),
        ("t - 1 == 0", None),
        ("-t == 0", None),
        ("n + true == 2", None),
    ],
)
def test_values_of_several_types(cond: str, said: str | None) -> None:
    """What cannot be said is not said otherwise."""
    assert guard(cond) == said


def test_fields_of_events() -> None:
    """They are in lower case, and no words of expressions, wherever they are written."""
    text = """
        <state id="a"><onentry><send event="x"><param name="isLong" expr="1"/>
        <param name="class" expr="2"/></send></onentry>
        <transition event="x" cond="_event.data.isLong &lt; _event.data['class']" target="b"/>
        <transition event="button" cond="_event.data.isShort"/></state><state id="b"/>"""
    head = '<scxml xmlns="http://www.w3.org/2005/07/scxml" version="1.0">'
    found = from_scxml(f"{head}{text}</scxml>".encode(), "Tried", "m")
    state = found.mission["states"]["A"]
    assert state["entry"] == [{"raise": {"event": "x", "with": {"is_long": 1, "class_": 2}}}]
    assert state["on"]["x"] == {"target": "B", "guard": "event.is_long < event.class_"}
    assert list(found.binding["events"]["button"]["fields"]) == ["is_short"]


# -- what is not --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("inside", "text"),
    [
        ("<script>x()</script>", "2: a script cannot be said; it is left out"),
        (
            '<state id="a"><invoke src="b.scxml"/></state>',
            "2: an invoke of type 'scxml' cannot be said; it is left out",
        ),
        (
            '<state id="a"><invoke><content><scxml><state id="b"/></scxml></content></invoke></state>',
            "2: an invoke of type 'scxml' cannot be said; it is left out",
        ),
        (
            '<final id="a"><donedata><param name="b" expr="1or"/></donedata></final>',
            "2: the expression '1or' cannot be said; it is left out",
        ),
        (
            '<state id="a"><onentry><send event="x" delay="1s"/></onentry></state>'
            '<state id="b"><transition event="x" target="a"/></state>',
            "2: send of 'x' after 1 s outlives its state: the region X_TIMER waits; a second send meanwhile "
            "starts its clock anew, where SCXML delivers both",
        ),
        (
            '<state id="a"><onentry><send event="x" delay="1s"/><cancel sendid="y"/></onentry></state>',
            "2: cancel of 'y': nothing is sent under that id",
        ),
        (
            '<datamodel><data id="xs" expr="[1]"/></datamodel>'
            '<state id="a"><onexit><assign location="xs[0]" expr="1"/></onexit></state>',
            "2: an assignment to 'xs[0]' cannot be said; it is left out",
        ),
        (
            "<script>function f() {}</script>"
            '<state id="a"><onexit><assign location="b" expr="1"/></onexit></state>',
            "2: an assignment to 'b' cannot be said; it is left out",
        ),
        (
            '<state id="a"><onentry><cancel sendidexpr="y"/></onentry></state>',
            "2: <cancel> of 'y', which is known only when it is carried out, cannot be said; it is left out",
        ),
        (
            '<state id="a"><onentry><send eventexpr="y"/></onentry></state>',
            "2: a send of an event that is named when it is sent cannot be said; it is left out",
        ),
        (
            '<datamodel><data id="xs" expr="[1]"/></datamodel><state id="a"><onentry>'
            '<assign location="xs" expr="[2]"/><foreach array="xs" item="x"/></onentry></state>',
            "2: a <foreach> over 'xs', which is no list that stays the same, cannot be said; it is left out",
        ),
        (
            '<state id="a"><onentry><assign location="b" expr="1"/></onentry></state>',
            "2: nothing declares 'b': always an error, written as 'failed.execution'; "
            "the rest of its block is left out",
        ),
        (
            '<final id="a"><onexit><raise event="x"/></onexit></final>',
            "2: what an end does when it is left cannot be said; it is left out",
        ),
        (
            '<parallel id="p"><final id="a"/><state id="b"/></parallel>',
            "2: a final region: the parallel state is over as it is entered, with all its regions",
        ),
        (
            '<state id="a"><transition target="b c"/></state><state id="b"/><state id="c"/>',
            "2: several targets at once (b c) cannot be said; it is left out",
        ),
        (
            '<state id="a"><transition target="b"/><other><state id="b"/></other></state>',
            "2: the target 'b', which does not exist, cannot be said; it is left out",
        ),
        (
            '<state id="a"><transition cond="typeof x" target="a"/></state>',
            "2: the expression 'typeof x' cannot be said; it is left out",
        ),
        (
            '<state id="a"><onentry><send event="x" target="http://other"/></onentry></state>',
            "2: a send to others cannot be said; it is left out",
        ),
        (
            '<state id="a"><onentry><send event="x"/></onentry></state>',
            "2: a send to the chart itself is a raise: dealt with before what comes from outside",
        ),
        (
            '<state id="a"><transition event="error.execution"/></state>',
            "2: 'error.execution': what fails only when the mission runs leads to FAULT instead",
        ),
        (
            '<datamodel><data id="x" expr="new Date()"/></datamodel>',
            "2: the variable 'x' that begins with 'new Date()' cannot be said; it is left out",
        ),
        (
            '<datamodel><data id="x"/></datamodel>'
            '<state id="a"><onexit><assign location="x" expr="1"/></onexit></state>',
            "2: the variable 'x' is 0 until it is set",
        ),
    ],
)
def test_what_cannot_be_said_has_its_line(inside: str, text: str) -> None:
    """And what is said otherwise."""
    assert text in notes(inside)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (b"<a>", "line 1: no XML: no element found"),
        (b'<?xml version="1.0" encoding="x"?><a/>', "line 1: no XML: unknown encoding: x"),
        (
            b'<?xml version="1.0" encoding="utf-32"?><a/>',
            "line 1: no XML: multi-byte encodings are not supported",
        ),
        (b"<svg/>", "line 1: the document is <svg>, not <scxml xmlns='http://www.w3.org/2005/07/scxml'>"),
        (b'<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "line 1: a document type is not read; remove it"),
        (b" " * (MAX_BYTES + 1), f"the document has {MAX_BYTES + 1} bytes; {MAX_BYTES} are the most"),
        (b"<a>" * (MAX_DEPTH + 1), f"line 1: elements are nested deeper than {MAX_DEPTH}"),
    ],
)
def test_a_document_that_is_none_is_refused(text: bytes, problem: str) -> None:
    """Entities are not expanded, and there is a bound to everything."""
    with pytest.raises(UsageError) as told:
        from_scxml(text, "Tried")
    assert str(told.value) == problem
