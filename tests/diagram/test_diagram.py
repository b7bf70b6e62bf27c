"""Pictures of charts: what they show, and that the kept ones are those of the shipped missions."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from lupin_engine.cli.diagram import diagram
from lupin_engine.diagram import svg as svg_module
from lupin_engine.diagram.dot import dot
from lupin_engine.diagram.mermaid import mermaid
from lupin_engine.diagram.outline import outline
from lupin_engine.diagram.svg import svg
from lupin_engine.errors import LupinError
from tests import shipped
from tests.machine.charts import chart

KEPT = Path(__file__).parents[2] / "docs" / "diagrams"

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
    "MORE": {"states": {"M": {}, "H": {"kind": "history", "depth": None}}},
}

MERMAID = """\
---
title: test
---
stateDiagram-v2
    state "DRIVE<br/>nav.go ≤ 60 s<br/>tries: 2<br/>entry / arm.preset" as DRIVE
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
"""


def test_mermaid() -> None:
    """Nested states, regions, deadlines, history, labels; refusals and ways within a state are no arrows."""
    assert mermaid(outline(chart(STATES))) == MERMAID


def test_labels_cannot_break_the_picture() -> None:
    """A guard may hold any character."""
    rule = {"target": "B", "guard": lambda env: True}
    given = chart({"A": {"on": {"go": rule}}, "B": {}})
    guard = given.states["A"].transitions[0].guard
    assert guard is not None
    object.__setattr__(guard, "source", 'a < 3; "x" # {y}')
    assert "A --> B : go [a #lt; 3#59; #quot;x#quot; #35; #123;y#125;]\n" in mermaid(outline(given))
    assert r'"A" -> "B" [label="go [a < 3; \"x\" # {y}]"]' in dot(outline(given))


@pytest.mark.parametrize("mission", ["inspection"])
def test_the_kept_picture_is_the_missions(mission: str) -> None:
    """The picture in the documentation is not out of date; `lupin diagram MISSION -o FILE` draws it anew."""
    file = KEPT / f"{mission}.mmd"
    assert file.read_text(encoding="utf-8") == mermaid(outline(shipped.mission(mission)))


def test_every_state_is_drawn() -> None:
    """Each state of a mission is a node or a cluster, the one that wraps the mission excepted."""
    given = shipped.mission("inspection")
    text = dot(outline(given))
    wrapper = given.missions["InspectionMission"].state
    for name in given.states:
        if name not in ("", wrapper):
            assert f'"{name}" [' in text or f'subgraph "cluster_{name}"' in text


@pytest.mark.skipif(shutil.which("dot") is None, reason="graphviz is not installed")
def test_graphviz_draws_it() -> None:
    """Graphviz has nothing to complain about."""
    text = dot(outline(shipped.mission("inspection")))
    drawn = subprocess.run(["dot", "-Tsvg"], input=text, capture_output=True, text=True, check=True)
    assert drawn.stderr == ""
    assert "<svg" in svg(text)


def test_without_a_program_svg_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    """A missing program is a sentence, not a traceback."""
    monkeypatch.setattr(svg_module, "_find", lambda: None)
    with pytest.raises(LupinError, match="pip install graphviz-pure"):
        svg("digraph {}")


def test_the_verb_writes_a_file(tmp_path: Path) -> None:
    """The ending of the file decides the format."""
    for name, begins in (("x.mmd", "---\ntitle: InspectionMission"), ("x.dot", "digraph chart {")):
        done = CliRunner().invoke(diagram, ["inspection", "-o", str(tmp_path / name)], standalone_mode=False)
        assert done.exception is None
        assert (tmp_path / name).read_text(encoding="utf-8").startswith(begins)
