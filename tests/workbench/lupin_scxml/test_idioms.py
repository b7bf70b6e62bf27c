"""Small charts of others that run as missions: each thing that SCXML says otherwise than the language.

They are converted, checked and run as the tests of the W3C are (`tools/conformance.py`), without its data.
"""

from __future__ import annotations

import copy
import random
import xml.etree.ElementTree as ElementTree
from contextlib import suppress
from pathlib import Path

import pytest

from lupin_engine.errors import UsageError
from lupin_engine.replay.yaml_text import yaml_text
from lupin_scxml.importer import from_scxml
from tests.tools import load_tool

HEAD = '<scxml xmlns="http://www.w3.org/2005/07/scxml" version="1.0" name="Lamp" {}>'
ENDS = '<final id="pass"/><final id="fail"/>'
conformance = load_tool("conformance")

#: Charts that must come to `pass`, in which every word counts.
CHARTS = {
    # -- values --
    "a remainder, halves, texts with numbers, eights": """
        <datamodel><data id="x" expr="-5"/><data id="h" expr="2.5"/><data id="t" expr="'a'"/></datamodel>
        <state id="s"><transition cond="x % 3 == -2 &amp;&amp; x % -3 == -2 &amp;&amp; Math.round(h) == 3
          &amp;&amp; Math.round(-h) == -2 &amp;&amp; t + 1 == 'a1' &amp;&amp; h + 5.5 == 010" target="pass"/>
        <transition target="fail"/></state>""",
    # -- targets --
    "a fork leads past the beginnings of regions, and only where it is one": """
        <datamodel><data id="n" expr="0"/></datamodel>
        <state id="s"><transition cond="n == 0" target="C2 D2"/><transition target="p"/></state>
        <parallel id="p">
          <state id="C"><state id="C1"><transition cond="In('D2')" target="fail"/></state>
            <state id="C2"/></state>
          <state id="D"><state id="D1"><transition cond="n == 1 &amp;&amp; In('C1')" target="pass"/></state>
            <state id="D2"><transition cond="n == 0 &amp;&amp; In('C2')" target="s">
              <assign location="n" expr="1"/></transition></state></state>
        </parallel>""",
    # -- sends --
    "a send waits behind what is raised": """
        <state id="s"><onentry><send event="outside"/><raise event="inside"/></onentry>
        <transition event="outside" target="fail"/><transition event="inside" target="pass"/></state>""",
    "a delayed send outlives its state": """
        <state id="s"><onentry><send event="late" delay="2s"/></onentry><transition target="t"/></state>
        <state id="t"><onentry><send event="early" delay="1s"/></onentry>
        <transition event="early" target="u"/><transition event="late" target="fail"/></state>
        <state id="u"><transition event="late" target="pass"/></state>""",
    "a cancel stops what is on its way": """
        <state id="s"><onentry><send event="late" id="x" delay="1s"/></onentry>
        <transition target="t"><cancel sendid="x"/></transition></state>
        <state id="t"><onentry><send event="later" delay="2s"/></onentry>
        <transition event="late" target="fail"/><transition event="later" target="pass"/></state>""",
    "a send after its cancel begins anew": """
        <state id="s"><onentry><send event="late" id="x" delay="3s"/>
        <send event="again" delay="2s"/></onentry>
        <transition event="again"><cancel sendid="x"/><send event="late" id="x" delay="3s"/>
        <send event="old" delay="2s"/></transition>
        <transition event="old" target="t"/><transition event="late" target="fail"/></state>
        <state id="t"><transition event="late" target="pass"/></state>""",
    "a cancel knows a send by the variable that has its id": """
        <datamodel><data id="timer"/></datamodel>
        <state id="s"><onentry><send event="late" idlocation="timer" delay="1s"/></onentry>
        <transition cond="timer" target="t"><cancel sendidexpr="timer"/></transition></state>
        <state id="t"><onentry><send event="later" delay="2s"/></onentry>
        <transition event="late" target="fail"/><transition event="later" target="pass"/></state>""",
    "a delayed event carries what was true when it was sent": """
        <datamodel><data id="n" expr="1"/></datamodel>
        <state id="s"><onentry><send event="late" delay="1s"><param name="was" expr="n"/></send>
        <assign location="n" expr="2"/></onentry>
        <transition event="late" cond="_event.data.was == 1" target="pass"/>
        <transition event="late" target="fail"/></state>""",
    "a delay may be a variable": """
        <datamodel><data id="d" expr="'1s'"/></datamodel>
        <state id="s"><onentry><assign location="d" expr="'3s'"/><send event="late" delayexpr="d"/>
        <send event="early" delay="2s"/></onentry>
        <transition event="late" target="fail"/><transition event="early" target="t"/></state>
        <state id="t"><transition event="late" target="pass"/></state>""",
    "a delay may be a number and the text of its unit": """
        <datamodel><data id="n" expr="500"/><data id="m" expr="1"/></datamodel>
        <state id="s"><onentry><assign location="m" expr="m + 1"/><send event="soon" delayexpr="n + 'ms'"/>
        <send event="late" delayexpr="m + 's'"/><send event="middle" delay="1"/></onentry>
        <transition event="middle" target="t"/></state>
        <state id="t"><transition event="late" target="fail"/><transition event="soon" target="u"/></state>
        <state id="u"><transition event="late" cond="m == 2" target="pass"/></state>""",
    "two events after the same time": """
        <state id="s"><onentry><send event="one" delay="1s"/><send event="two" delay="1s"/></onentry>
        <state id="in"><transition event="one" target="out"/></state>
        <state id="out"><transition event="two" target="pass"/></state></state>""",
    "a variable names the event": """
        <datamodel><data id="next" expr="'no'"/></datamodel>
        <state id="s"><onentry><assign location="next" expr="'yes'"/><send eventexpr="next"/></onentry>
        <transition event="no" target="fail"/><transition event="yes" target="pass"/></state>""",
    "a script names the event": """
        <datamodel><data id="next" expr="'no'"/></datamodel>
        <state id="s"><onentry><script>next = 'yes'</script><send eventexpr="next"/></onentry>
        <transition event="no" target="fail"/><transition event="yes" target="pass"/></state>""",
    # -- what an event says --
    "the name of an event": """
        <datamodel><data id="was"/></datamodel>
        <state id="s"><onentry><raise event="go.on"/></onentry>
        <transition event="go" target="t"/></state>
        <state id="t"><onentry><assign location="was" expr="_event.name"/></onentry>
        <transition cond="was == 'go.on'" target="pass"/><transition target="fail"/></state>""",
    "an event without an id has none": """
        <state id="s"><onentry><send event="go"/></onentry>
        <transition event="go" cond="typeof _event.sendid === 'undefined'" target="pass"/>
        <transition event="go" target="fail"/></state>""",
    "an event that carries something in one place only": """
        <datamodel><data id="sum" expr="1"/></datamodel>
        <state id="s"><onentry><raise event="go"/></onentry><transition event="go" target="t"/></state>
        <state id="t"><onentry><send event="go"><param name="n" expr="sum"/></send><log expr="sum"/></onentry>
        <transition event="go" cond="_event.data.n" target="pass"/><transition event="go" target="fail"/>
        </state>""",
    "content of an end is all that it gives": """
        <state id="s"><state id="a"><transition target="b"/></state>
        <final id="b"><donedata><content>21</content></donedata></final>
        <transition event="done.state.s" cond="_event.data == 21" target="pass"/>
        <transition event="done.state.s" target="fail"/></state>""",
    "an end without the name of its state": """
        <state id="s"><state id="a"><transition target="b"/></state><final id="b"/>
        <transition event="done" target="pass"/></state>""",
    "an end that is heard in another region": """
        <parallel id="p">
        <state id="left"><state id="a"><transition target="b"/></state><final id="b"/></state>
        <state id="right"><transition event="done.state.left" target="pass"/></state></parallel>""",
    # -- data --
    "turns of a list, in order": """
        <datamodel><data id="xs">[3, 1, 2]</data><data id="x"/><data id="told" expr="0"/></datamodel>
        <state id="s"><onentry><foreach array="xs" item="x" index="i">
        <assign location="told" expr="told * 10 + x + i"/></foreach></onentry>
        <transition cond="told === 324 &amp;&amp; x == 2" target="pass"/>
        <transition target="fail"/></state>""",
    "scripts that assign": """
        <datamodel><data id="n" expr="1"/></datamodel><script>var m = 2;</script>
        <state id="s"><onentry><script>n += m; // three
        n++; m = n - 1</script></onentry>
        <transition cond="n == 4 &amp;&amp; m == 3" target="pass"/><transition target="fail"/></state>""",
    "an object is a variable for each field": """
        <datamodel><data id="lamp" expr="{lit: false, at: {x: 1}}"/></datamodel>
        <state id="s"><onentry><assign location="lamp.lit" expr="lamp.at.x &lt; 2"/></onentry>
        <transition cond="lamp.lit" target="pass"/><transition target="fail"/></state>""",
    "what ECMAScript takes for true": """
        <datamodel><data id="n" expr="2"/><data id="t" expr="''"/><data id="xs" expr="[1]"/>
        <data id="no"/></datamodel>
        <state id="s"><onentry><if cond="n &amp;&amp; !t &amp;&amp; xs &amp;&amp; !no"><raise event="yes"/>
        <else/><raise event="no"/></if></onentry>
        <transition event="no" target="fail"/><transition event="yes" target="pass"/></state>""",
    "signs bind as in ECMAScript": """
        <datamodel><data id="a" expr="true"/><data id="n" expr="5"/></datamodel>
        <state id="s"><transition cond="!a || a &amp;&amp; !a" target="fail"/>
        <transition cond="n % 3 !== 2" target="fail"/>
        <transition cond="(n > 4 ? -n : n) + 2 * 3 == 1" target="pass"/></state>""",
    "a first value that is computed": """
        <datamodel><data id="n" expr="2"/><data id="m" expr="n * 3"/><data id="who" expr="_name"/></datamodel>
        <state id="s"><transition cond="m == 6 &amp;&amp; who == 'Lamp'" target="pass"/>
        <transition target="fail"/></state>""",
    # -- errors --
    "what nothing declares is an error, and ends its block": """
        <datamodel><data id="n" expr="0"/></datamodel>
        <state id="s"><onentry><raise event="go"/><assign location="nowhere" expr="1"/>
        <assign location="n" expr="1"/></onentry><onentry><raise event="on"/></onentry>
        <transition event="error" target="fail"/><transition event="go" target="t"/></state>
        <state id="t"><transition event="error.execution" cond="n == 0" target="u"/>
        <transition event="on" target="fail"/></state>
        <state id="u"><transition event="on" target="pass"/></state>""",
    "a send to nobody is an error of its own": """
        <state id="s"><onentry><send event="x" target="#_scxml_7"/></onentry>
        <transition event="error.execution" target="fail"/>
        <transition event="error.communication" target="pass"/></state>""",
    "an error ends the turns of a list": """
        <datamodel><data id="xs" expr="[1, 2]"/><data id="n" expr="0"/></datamodel>
        <state id="s"><onentry><foreach array="xs" item="x"><assign location="n" expr="n + x"/>
        <assign location="n" expr="return"/></foreach><assign location="n" expr="9"/></onentry>
        <transition cond="n == 1" target="pass"/><transition target="fail"/></state>""",
    "a condition that is no expression is never true": """
        <state id="s"><transition cond="return" target="fail"/><transition target="pass"/></state>""",
    # -- structure --
    "a history that does something the first time": """
        <datamodel><data id="n" expr="0"/></datamodel>
        <state id="s"><initial><transition target="h"/></initial>
        <history id="h"><transition target="a"><assign location="n" expr="n + 1"/></transition></history>
        <state id="a"><transition target="t"/></state><state id="b"/></state>
        <state id="t"><transition cond="n == 1" target="u"/></state>
        <state id="u"><transition target="pass"/></state>""",
    "regions that begin with another child": """
        <state id="s" initial="b d"><parallel id="p"><state id="left"><state id="a"/>
        <state id="b"><transition cond="In('d')" target="pass"/></state></state>
        <state id="right"><state id="c"/><state id="d"/></state>
        <transition cond="In('a') || In('c')" target="fail"/></parallel></state>""",
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CHARTS)
def test_a_chart_of_others_does_what_it_says(name: str, tmp_path: Path) -> None:
    """Nothing of it is left out, the checker has nothing against it, and it comes to `pass`."""
    document = tmp_path / "chart.scxml"
    document.write_text(HEAD.format("") + CHARTS[name] + ENDS + "</scxml>")
    found = conformance.outcome(document)
    assert (found.kind in (conformance.ITSELF, conformance.IDIOM), found.reason) == (True, "")


def test_a_chart_that_fails_is_told(tmp_path: Path) -> None:
    """So that the others say something."""
    document = tmp_path / "chart.scxml"
    document.write_text(
        HEAD.format("") + '<state id="s"><transition target="fail"/></state>' + ENDS + "</scxml>"
    )
    assert conformance.outcome(document).kind == conformance.OTHERWISE


@pytest.mark.slow
def test_no_document_is_too_strange() -> None:
    """Whatever stands wherever, there is a mission or a sentence."""
    chance = random.Random(1)
    trees = [ElementTree.fromstring(HEAD.format("") + inside + "</scxml>") for inside in CHARTS.values()]
    parts = [part for tree in trees for part in tree.iter()]
    values = (
        "",
        "*",
        "x",
        "return",
        "1+",
        "[1, 2]",
        "{a: 1}",
        "_event.data",
        "a b",
        "#_x",
        "1s",
        "'foo'",
        "((",
    )
    for _ in range(600):
        tree = copy.deepcopy(chance.choice(trees))
        for _ in range(3):
            part = chance.choice(list(tree.iter()))
            part.insert(0, copy.deepcopy(chance.choice(parts)))
            for name in part.attrib:
                part.set(name, chance.choice((*values, part.get(name, ""))))
        with suppress(UsageError):
            yaml_text(from_scxml(ElementTree.tostring(tree), "Strange").mission)


def made(inside: str) -> str:
    """The mission of a document, as it is written."""
    return yaml_text(from_scxml(f"{HEAD.format('')}{inside}</scxml>".encode(), "Lamp").mission)


def test_a_clock_is_a_region() -> None:
    """It is started and stopped by events, so that the chart reads as before."""
    found = made(
        """<state id="dark"><transition event="touch" target="lit">
        <send event="timeIsUp" id="t" delay="1min"/></transition></state>
        <state id="lit"><transition event="touch" target="dark"><cancel sendid="t"/></transition>
        <transition event="timeIsUp" target="dark"/></state>"""
    )
    assert (
        found
        == """\
mission: Lamp
initial: RUNNING
states:
  RUNNING:
    type: parallel
    states:
      CHART:
        initial: DARK
        states:
          DARK: {on: {touch: {target: LIT, do: [{raise: {event: time_is_up_timer.start}}]}}}
          LIT: {on: {touch: {target: DARK, do: [{raise: {event: time_is_up_timer.stop}}]}, timeIsUp: DARK}}
      TIME_IS_UP_TIMER:
        initial: IDLE
        states:
          IDLE: {on: {time_is_up_timer.start: TICKING}}
          TICKING:
            on: {time_is_up_timer.start: TICKING, time_is_up_timer.stop: IDLE}
            after: {1 min: {target: IDLE, do: [{raise: {event: timeIsUp}}]}}
"""
    )


def test_what_is_sent_again_each_time_is_every() -> None:
    """A state that waits for itself; a doubled delay in the document would be two clocks."""
    found = made(
        """<datamodel><data id="n" expr="0"/></datamodel><state id="s">
        <onentry><send event="tick" delay="2s"/></onentry>
        <transition event="tick" cond="n == 3" target="e"/>
        <transition event="tick"><assign location="n" expr="n + 1"/><send event="tick" delay="2s"/>
        </transition></state><final id="e"/>"""
    )
    assert (
        found
        == """\
mission: Lamp
context: {n: {type: number, default: 0}}
initial: S
states:
  S: {every: {2 s: [{target: e, guard: "n == 3"}, {do: [{set: {n: "${ n + 1 }"}}]}]}}
  e: {type: final}
"""
    )


def test_any_event_is_no_request_of_an_operator() -> None:
    """Or a chart that listens to everything could not be aborted."""
    found = made(
        """<state id="a"><onentry><raise event="one"/><raise event="two"/></onentry>
        <transition event="*" target="b"/></state><state id="b"/>"""
    )
    assert "on: {one: B, two: B}" in found


def test_what_nothing_raises_comes_from_outside() -> None:
    """It is declared in a binding, with the fields that are read of it."""
    found = from_scxml(
        f"""{HEAD.format("")}<state id="a"><transition event="button.1" target="b"/>
        <transition event="button" cond="_event.data.hard == 1" target="a"/>
        <transition event="on" target="b"/></state>
        <state id="b"><onentry><raise event="on"/></onentry></state></scxml>""".encode(),
        "Lamp",
        "lamp",
    )
    assert found.mission["states"]["A"]["on"] == {
        "lamp.button_x1": "B",
        "lamp.button": {"target": "A", "guard": "event.hard == 1"},
        "on": "B",
    }
    assert (
        yaml_text(found.binding)
        == """\
binding: lamp
summary: "What the chart hears from outside; say which topics tell of it."
events:
  button:
    summary: The event button of the chart.
    topic: {name: "/lamp/button", type: std_msgs/msg/String}
    fields: {hard: {type: any, from: "${ message.data }"}}
  button_x1:
    summary: The event button.1 of the chart.
    topic: {name: "/lamp/button_x1", type: std_msgs/msg/String}
    fields: {hard: {type: any, from: "${ message.data }"}}
"""
    )


def test_an_error_says_why() -> None:
    """And a log is a note of the run."""
    found = made(
        """<datamodel><data id="n" expr="1"/></datamodel><state id="s"><onentry>
        <log label="n:" expr="n + ' of 3'"/><log expr="'plain'"/><assign location="m" expr="1"/></onentry>
        <transition event="error" target="e"><log label="over"/></transition></state><final id="e"/>"""
    )
    assert (
        found
        == """\
mission: Lamp
context: {n: {type: number, default: 1}}
initial: S
states:
  S:
    entry:
      - {report.note: {text: "n: ${ n } of 3"}}
      - {report.note: {text: plain}}
      - {raise: {event: failed.execution, with: {detail: "nothing declares 'm'"}}}
    on: {failed.execution: {target: e, do: [{report.note: {text: over}}]}}
  e: {type: final}
"""
    )
