"""A sequence is the chart of the states that it stands for."""

from __future__ import annotations

from pathlib import Path

import pytest

from lupin_engine.chart.model import Chart
from lupin_engine.missions.load import load_chart
from lupin_engine.plugin.registry import Catalog

LIFECYCLE_FILE = Path(__file__).parents[3] / "missions" / "lifecycle.yaml"

SHORT = """\
mission: M
initial: WORK
states:
  WORK:
    sequence:
      - GO: {invoke: {do: nav.dock, with: {pose: "${ home }"}, timeout: {after: 9 s, code: nav_timeout}}}
      - REST: {after: {5 s: BACK}}
      - BACK:
          sequence:
            - IN: {states: {AT: {after: {1 s: over}}, over: {type: final}}, initial: AT}
          on_done: {do: report.clear}
    TIMES
    on_error: FAULT
    on_done: done
  done: {type: final}
"""
LONG = """\
mission: M
initial: WORK
CONTEXT
states:
  WORK:
    INITIAL
    states:
      BEGIN
      GO:
        invoke: {do: nav.dock, with: {pose: "${ home }"}, timeout: {after: 9 s, code: nav_timeout}}
        on_done: REST
        on_error: FAULT
      REST: {after: {5 s: BACK}}
      BACK:
        initial: IN
        states:
          IN: {states: {AT: {after: {1 s: over}}, over: {type: final}}, initial: AT, on_done: BACK.over}
          over: {type: final}
        on_done: {do: report.clear, target: WORK.LAST}
      AGAIN
      over: {type: final}
    on_done: done
  done: {type: final}
"""
ONCE = {"CONTEXT": "", "INITIAL": "initial: GO", "BEGIN": "", "AGAIN": "", "LAST": "over"}
TWICE = {
    "CONTEXT": "context: {work_round: {type: count, default: 0}}",
    "INITIAL": "initial: begin\n    resume_at: GO",
    "BEGIN": "begin: {always: {target: GO, do: [{set: {work_round: 1}}]}}",
    "AGAIN": "again: {always: [{target: GO, guard: work_round < (2), "
    'do: [{set: {work_round: "${ work_round + 1 }"}}]}, over]}',
    "LAST": "again",
}


def chart(text: str, folder: Path, catalog: Catalog) -> Chart:
    """Load a mission in the slot of the shipped lifecycle."""
    file = folder / "m.yaml"
    file.write_text(text, "utf-8")
    return load_chart(LIFECYCLE_FILE, [file], catalog)


def shape(found: Chart) -> list[str]:
    """Describe states and transitions without their places."""
    return [
        line
        for state in sorted(found.states.values(), key=lambda state: state.name)
        for line in (
            f"{state.name} {state.kind} {state.initial}",
            *(
                f"{state.name} {t.event} {t.target} {t.guard.source if t.guard else ''} "
                f"{[(call.name, sorted(call.arguments)) for call in t.actions]}"
                for t in (*state.transitions, *state.resume_at)
            ),
        )
    ]


@pytest.mark.parametrize(("times", "written"), [("", ONCE), ("times: 2", TWICE)], ids=["once", "twice"])
def test_a_sequence_is_the_states_that_it_stands_for(
    times: str, written: dict[str, str], tmp_path: Path, catalog: Catalog
) -> None:
    long = LONG
    for key, value in written.items():
        long = long.replace(key, value)
    short = chart(SHORT.replace("TIMES", times), tmp_path, catalog)
    assert shape(short) == shape(chart(long, tmp_path, catalog))


def test_a_step_keeps_its_place(tmp_path: Path, catalog: Catalog) -> None:
    states = chart(SHORT.replace("TIMES", "times: 2"), tmp_path, catalog).states
    assert str(states["MISSION.M.WORK.REST"].place).endswith("m.yaml:7:9")
    assert str(states["MISSION.M.WORK.again"].place).endswith("m.yaml:12:5")
