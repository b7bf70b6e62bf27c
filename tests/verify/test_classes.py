"""Classes that the author of a mission adds: what else `lupin prove` tries."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from lupin_engine.cli.main import main

LIFECYCLE = Path(__file__).parents[1] / "charts" / "mini" / "lifecycle.yaml"
#: What is read late leads to LATE, and so does a charge that is just so.
MISSION = """\
mission: Late
properties:
  never_late: {never: "in_state('LATE')"}
  never_just_so: {never: "in_state('JUST_SO')"}
inputs:
  charge: {value: robot.battery, initial: 50 %, classes: CHARGES}
initial: READING
states:
  READING:
    invoke:
      do: bridge.read_tag
      with: {tag_id: "1"}
      timeout: {after: 10 s, code: late}
      classes: RESULTS
    on_done:
      - {target: LATE, guard: event.reading.sim_time_of_day_seconds > '80000 s'}
      - {target: JUST_SO, guard: input.charge * 2 > 0.61 and input.charge * 2 < 0.63}
      - target: done
    on_error: done
  LATE: {after: {1 s: done}}
  JUST_SO: {after: {1 s: done}}
  done: {type: final}
"""
#: The whole of a reading.
READING = "{tag_id: '1', stamp: 0 s, sim_time_of_day_seconds: 80001 s, readings: []}"


def asked(verb: str, folder: Path, charges: str, results: str) -> int:
    """Return the exit code of a verb for the mission with some classes."""
    shutil.copy(LIFECYCLE, folder)
    text = MISSION.replace("CHARGES", charges).replace("RESULTS", results)
    (folder / "late.yaml").write_text(text, encoding="utf-8")
    options = ["--targets", "0", "--no-restarts", "--no-scenarios"] if verb == "prove" else []
    return main([verb, "late.yaml", *options])


def test_what_is_added_is_tried(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Values of an input, and results that differ from the usual one; without them nothing leads there."""
    monkeypatch.chdir(tmp_path)
    assert asked("prove", tmp_path, "[]", "[]") == 0
    told = capsys.readouterr().out
    assert "  warning: never entered: late.yaml:20:3, state LATE\n" in told
    assert "  warning: never entered: late.yaml:21:3, state JUST_SO\n" in told
    assert "  warning: never taken: late.yaml:16:9, READING done → LATE\n" in told
    assert "; 2 states never entered, 2 transitions of others never taken; " in told
    assert asked("prove", tmp_path, "[31 %]", f"[{{reading: {READING}}}]") == 1
    told = capsys.readouterr().out
    assert "✗ never_late: never in_state('LATE')\n" in told
    assert "✗ never_just_so: never in_state('JUST_SO')\n" in told
    assert "never entered" not in told


def test_mistakes_are_told_with_their_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """All at once."""
    monkeypatch.chdir(tmp_path)
    assert asked("check", tmp_path, "[2 %, 300 %]", "[{reading: 4}, {redaing: 1}, never]") == 1
    told = [line for line in capsys.readouterr().out.splitlines() if ": error: " in line]
    where = "MISSION.Late.READING.invoke.classes"
    fields = "tag_id, stamp, sim_time_of_day_seconds, readings"
    assert told == [
        "late.yaml:6:64: error: inputs.charge.classes: expected number between 0 and 100 %, got '300 %'"
        " [wrong-type]",
        f"late.yaml:14:27: error: {where}.reading: expected reading, got 4; write a mapping with {fields}"
        " [wrong-type]",
        f"late.yaml:14:31: error: {where}: unknown result of bridge.read_tag 'redaing';"
        " did you mean 'reading'? [wrong-type]",
        f"late.yaml:14:45: error: {where}: expected a record of reading, got 'never'; write a mapping with"
        " reading [wrong-type]",
    ]
