"""Pictures as text: Mermaid."""

from __future__ import annotations

from typing import Any

from lupin_engine.chart.model import Chart
from lupin_engine.diagram.mermaid import mermaid
from lupin_engine.diagram.outline import outline
from lupin_engine.diagram.trace import Counts, coloured
from tests.lupin_engine.diagram import pictured
from tests.lupin_engine.machine.charts import chart

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


def test_labels_cannot_break_the_picture() -> None:
    """Signs of Mermaid in a guard are written as its entities."""
    picture = outline(strange())
    assert "A --> B : go [a #lt; 3#59; #quot;x#quot; #35; #123;y#125; // \\z]\n" in mermaid(picture)


def test_the_history_of_a_parallel_state_is_no_region() -> None:
    """It would be drawn beside them, as if something went on there."""
    assert mermaid(outline(pictured.chart("words"))).count("    --\n") == 1


def test_colours_reach_mermaid() -> None:
    """What was visited, how often, and what never was."""
    picture = coloured(outline(chart(STATES)), Counts({"DRIVE": 2}, {"DRIVE.on_error.0": 1}, "a run"))
    text = mermaid(picture)
    assert "\u00d72" in text
    assert "a run" in text
    assert "class DRIVE visited\n" in text
