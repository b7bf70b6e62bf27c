"""Whose names are whose: missions, states and declarations of several files in one chart."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from lupin_engine.chart.compose import tree
from lupin_engine.missions.folders import LIFECYCLE
from lupin_engine.missions.load import check_chart
from lupin_engine.plugin.registry import Catalog

MINI = Path(__file__).parents[2] / "charts" / "mini" / LIFECYCLE
IDLE = "states:\n  A: {after: {1 s: done}}\n  done: {type: final}\n"


def told(folder: Path, catalog: Catalog, *missions: str, **parts: str) -> list[str]:
    """Return what is said of missions in the mini lifecycle, with files named as from their folder."""
    shutil.copy(MINI, folder)
    (folder / "parts").mkdir()
    for name, text in parts.items():
        (folder / "parts" / f"{name}.yaml").write_text(text, encoding="utf-8")
    files = [folder / f"{name}.yaml" for name in "abcd"[: len(missions)]]
    for file, text in zip(files, missions, strict=True):
        file.write_text(text, encoding="utf-8")
    _, found = check_chart(folder / LIFECYCLE, files, catalog)
    return [str(one).replace(f"{folder}/", "") for one in found]


def test_missions_of_one_lifecycle_have_names_of_their_own(tmp_path: Path, catalog: Catalog) -> None:
    """The request says which; one that cannot be said keeps no other from being read."""
    texts = [f"mission: {name}\n{IDLE}" for name in ("M", "M", "my-mission")]
    assert told(tmp_path, catalog, *texts, f"mission: N\n{IDLE.replace('done}}', 'over}}')}") == [
        "b.yaml:1:10: error: mission: a second mission is called 'M'; "
        "the other is in a.yaml [conflicting-definition]",
        "c.yaml:1:10: error: mission: 'my-mission' cannot name a mission; "
        "use letters, digits and underscores [bad-name]",
        "d.yaml:3:20: error: MISSION.N.A.after.0: no state is called 'over' here; "
        "allowed: 'A', 'MISSION', 'READY', 'done' [unknown-state]",
    ]


def test_what_two_files_declare_alike_is_one(tmp_path: Path, catalog: Catalog) -> None:
    """The same default, the same level, the same label: the same thing."""
    shared = """\
codes: {lost: {label: lost, severity: error}}
context:
  laps: {type: count, default: 0}
  spot: {type: pose, default: "${ param.dock_pose }"}
inputs:
  charge: {value: robot.battery, levels: {empty: {below: 5 %}, full: {above: 90 %}}}
params:
  rest: {type: duration, default: 1 s, max: 1 min}
"""
    states = """\
initial: A
states:
  A:
    after: {"${ param.rest }": {target: done, code: lost}}
    on:
      input.charge.empty: {target: done, do: [set: {laps: 1, spot: "${ param.dock_pose }"}]}
      input.charge.full: {target: done, guard: laps > 0 and spot.x > '1 m'}
  done: {type: final}
"""
    missions = [f"mission: {name}\n{shared}{states}" for name in "MN"]
    assert told(tmp_path, catalog, *missions) == []


def test_what_two_files_declare_differently_is_told(tmp_path: Path, catalog: Catalog) -> None:
    """Each difference: type, default, limits, label, severity, age, levels."""
    first = """\
codes: {a: {label: lost}, b: {label: lost}}
context: {c: {type: count, default: 0}, d: {type: count, default: 0}}
inputs:
  e: {value: robot.battery, levels: {low: {below: 5 %}}}
  f: {value: robot.battery, freshness: 1 s}
  g: {value: robot.battery, min: 1 %}
params:
  h: {type: duration, default: 1 s}
  i: {type: duration, default: 1 s}
  j: {type: duration, default: 1 s}
"""
    second = """\
codes: {a: {label: gone}, b: {label: lost, severity: error}}
context: {c: {type: number, default: 0}, d: {type: count, default: 1}}
inputs:
  e: {value: robot.battery, levels: {low: {below: 6 %}}}
  f: {value: robot.battery, freshness: 2 s}
  g: {value: robot.battery, max: 90 %}
params:
  h: {type: duration, default: 2 s}
  i: {type: duration, default: 1 s, max: 1 min}
  j: {type: duration, default: 1 s, min: 1 s}
"""
    found = told(tmp_path, catalog, f"mission: M\n{first}{IDLE}", f"mission: N\n{second}{IDLE}")
    pattern = re.compile(
        r"b\.yaml:(\d+):.* error: (\w+) '(\w)' is declared differently in a\.yaml:\1:\d+; "
        r"make both the same, or rename one \[conflicting-definition\]"
    )
    assert [match.groups() for match in map(pattern.fullmatch, found) if match] == [
        ("2", "code", "a"),
        ("2", "code", "b"),
        ("3", "variable", "c"),
        ("3", "variable", "d"),
        ("5", "input", "e"),
        ("6", "input", "f"),
        ("7", "input", "g"),
        ("9", "parameter", "h"),
        ("10", "parameter", "i"),
        ("11", "parameter", "j"),
    ]


def test_a_chart_has_a_largest_number_of_states(
    tmp_path: Path, catalog: Catalog, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Parts count as often as they are used: five that use each other ten times are a hundred thousand."""
    monkeypatch.setattr(tree, "MAX_STATES", 9)
    part = "part: p\nstates:\n  X: {after: {1 s: over}}\n  over: {type: final}\n"
    mission = "mission: M\ninitial: A\nstates:\n  A: {use: p, on_done: B}\n  B: {use: p, on_done: done}\n"
    found = told(tmp_path, catalog, f"{mission}  done: {{type: final}}\n", p=part)
    assert [one for one in found if "[too-large]" in one] == [
        "a.yaml:6:3: error: more than 9 states, parts counted as often as they are used [too-large]",
        "parts/p.yaml:4:3: error: more than 9 states, parts counted as often as they are used [too-large]",
    ]


def test_a_part_remembers_as_a_mission_does(tmp_path: Path, catalog: Catalog) -> None:
    """Each use has a history of its own, which is no event's doing."""
    part = """\
part: p
initial: A
states:
  A: {history: deep, on: {operator.dock: B}, states: {C: {after: {1 s: over}}}}
  B: {after: {1 s: A.history}}
  over: {type: final}
"""
    mission = "mission: M\ninitial: X\nstates:\n  X: {use: p, on_done: done}\n  done: {type: final}\n"
    assert told(tmp_path, catalog, mission, p=part) == []
