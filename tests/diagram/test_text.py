"""Pictures as text: Mermaid, DOT and PlantUML."""

from __future__ import annotations

import re
import shutil
import subprocess
from typing import Any

import pytest

from lupin_engine.chart.model import Chart
from lupin_engine.diagram.dot import dot
from lupin_engine.diagram.mermaid import mermaid
from lupin_engine.diagram.outline import outline
from lupin_engine.diagram.plantuml import plantuml
from lupin_engine.diagram.trace import Counts, coloured
from tests.diagram import pictured
from tests.machine.charts import chart

STATES: dict[str, Any] = {
    "DRIVE": {
        "invoke": {"do": "nav.go", "timeout": 60.0, "attempts": 2},
        "on_done": "BOTH",
        "on_error": "STOP",
        "on": {"operator.skip_current": "BOTH", "operator.pause": {"refuse": "paused"}},
        "entry": "arm.preset",
    },
    "BOTH": {
        "kind": "parallel",
        "states": {"LEFT": {"states": {"l1": {}}}, "RIGHT": {"states": {"end": {"kind": "final"}}}},
        "after": {2.5: "STOP"},
        "on": {"again": "BOTH"},
    },
    "STOP": {"paused": True, "on": {"back": "MORE.H"}},
    "MORE": {"states": {"M": {"on": {"out": "STOP"}}, "H": {"kind": "history", "depth": None}}},
}

MERMAID = """\
---
title: test
---
stateDiagram-v2
    state "DRIVE<br/>do / nav.go ≤ 60 s<br/>tries: 2<br/>entry / arm.preset" as DRIVE
    state "BOTH<br/>again → BOTH" as BOTH {
        state "LEFT" as LEFT {
            state "l1" as l1
            [*] --> l1
        }
        --
        state "RIGHT" as RIGHT {
            state "end" as RIGHT_end
            [*] --> RIGHT_end
            RIGHT_end --> [*]
        }
    }
    state "STOP<br/>paused" as STOP
    state "MORE" as MORE {
        state "M" as M
        state "H*" as H
        [*] --> M
    }
    [*] --> DRIVE
    DRIVE --> BOTH : skip_current<br/>done
    DRIVE --> STOP : error
    BOTH --> STOP : after 2.5 s
    STOP --> H : back
    M --> STOP : out
"""

PLANTUML = """\
title test
state "DRIVE" as DRIVE
DRIVE : do / nav.go ≤ 60 s
DRIVE : tries: 2
DRIVE : entry / arm.preset
state "BOTH" as BOTH {
  state "LEFT" as BOTH_LEFT {
    state "l1" as BOTH_LEFT_l1
    [*] --> BOTH_LEFT_l1
  }
  --
  state "RIGHT" as BOTH_RIGHT {
    state "end" as BOTH_RIGHT_end
    [*] --> BOTH_RIGHT_end
    BOTH_RIGHT_end --> [*]
  }
}
BOTH : again → BOTH
state "STOP" as STOP
STOP : paused
state "MORE" as MORE {
  state "M" as MORE_M
  state "H*" as MORE_H <<history*>>
  [*] --> MORE_M
}
[*] --> DRIVE
DRIVE --> BOTH : skip_current\\ndone
DRIVE -[#dc2626]-> STOP : error
BOTH -[#d97706]-> STOP : after 2.5 s
STOP --> MORE_H : back
MORE_M --> STOP : out
@enduml
"""


def strange() -> Chart:
    """A chart whose guard holds any character."""
    given = chart({"A": {"on": {"go": {"target": "B", "guard": lambda env: True}}}, "B": {}})
    guard = given.states["A"].transitions[0].guard
    assert guard is not None
    object.__setattr__(guard, "source", 'a < 3; "x" # {y} // \\z')
    return given


def test_mermaid() -> None:
    """Nested states, regions, deadlines, history, labels; refusals and ways within a state are no arrows."""
    assert mermaid(outline(chart(STATES))) == MERMAID


def test_plantuml() -> None:
    """The same."""
    text = plantuml(outline(chart(STATES)))
    assert text.startswith("@startuml\n")
    assert text.partition("}\n")[2] == PLANTUML


def test_labels_cannot_break_the_picture() -> None:
    """Every language has its own signs."""
    picture = outline(strange())
    assert "A --> B : go [a #lt; 3#59; #quot;x#quot; #35; #123;y#125; // \\z]\n" in mermaid(picture)
    assert r'"A" -> "B" [label="go [a < 3; \"x\" # {y} // \\z]"]' in dot(picture)
    assert r"A --> B : go [a ~< 3; <U+0022>x<U+0022> # {y} ~// <U+005C>z]" in plantuml(picture)


def test_plantuml_has_no_arrow_over_the_border_of_a_region() -> None:
    """It refuses them: they are lines of text. The history of a parallel state is the state itself."""
    text = plantuml(outline(pictured.chart("regions")))
    assert "M_WORK_EXPLORE_b : z → OUT\n" in text
    assert "OUT : again → b\n" in text
    assert "M --> OUT : stop\n" in text
    kinds = plantuml(outline(pictured.chart("kinds")))
    assert "MISSION_Kinds_WAITING -[#2563eb]-> MISSION_Kinds_BOTH : resume\n" in kinds


@pytest.mark.parametrize("name", pictured.NAMES)
def test_plantuml_is_well_formed(name: str) -> None:
    """Braces match, every end of an arrow is declared, and no line is of any other form."""
    lines = [line.strip() for line in plantuml(outline(pictured.chart(name))).splitlines()]
    declared = {found[1] for line in lines if (found := re.match(r'state "[^"]*" as (\w+)', line))}
    forms = (r'state "[^"]*" as \w+( (#\w+|<<history\*?>>))?( \{)?', r"\}", r"--", r"\w+ : .+")
    arrow = re.compile(r"(\[\*\]|\w+) -(?:-|\[#\w+(?:,bold)?\]-)> (\[\*\]|\w+)( : .+)?")
    body = lines[lines.index("}") + 2 : -1]
    assert sum(line.endswith("{") for line in body) == body.count("}")
    for line in body:
        found = arrow.fullmatch(line)
        if found:
            assert {found[1], found[2]} <= declared | {"[*]"}
        else:
            assert line.startswith("footer ") or any(re.fullmatch(form, line) for form in forms), line


def test_the_history_of_a_parallel_state_is_no_region() -> None:
    """It would be drawn beside them, as if something went on there."""
    assert mermaid(outline(pictured.chart("words"))).count("    --\n") == 1


def test_colours_reach_every_language() -> None:
    """What was visited, how often, and what never was."""
    picture = coloured(outline(chart(STATES)), Counts({"DRIVE": 2}, {"DRIVE.on_error.0": 1}, "a run"))
    texts = mermaid(picture), dot(picture), plantuml(picture)
    assert all("\u00d72" in text and "a run" in text for text in texts)
    assert "class DRIVE visited\n" in texts[0]
    assert 'color="#15803d", penwidth=2' in texts[1]
    assert 'state "DRIVE" as DRIVE #d6f0de\n' in texts[2]


@pytest.mark.parametrize("name", pictured.NAMES)
def test_graphviz_draws_it(name: str) -> None:
    """And has nothing to complain about."""
    if shutil.which("dot") is None:
        pytest.skip("graphviz is not installed")
    text = dot(outline(pictured.chart(name)))
    drawn = subprocess.run(["dot", "-Tsvg"], input=text, capture_output=True, text=True, check=True)
    assert drawn.stderr == ""


def test_plantuml_draws_it() -> None:
    """The real one takes a second of Java for each start, so it gets all of them at once."""
    if shutil.which("plantuml") is None:
        pytest.skip("PlantUML is not installed")
    texts = [plantuml(outline(pictured.chart(name))) for name in pictured.NAMES]
    checked = subprocess.run(
        ["plantuml", "-syntax"], input="".join(texts), capture_output=True, text=True, timeout=100
    )
    assert "ERROR" not in checked.stdout
    assert checked.stdout.count("entities)") == len(texts)
