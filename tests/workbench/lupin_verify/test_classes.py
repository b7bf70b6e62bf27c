"""Classes that the author of a mission adds: what else `lupin prove` tries."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from lupin_cli.main import main
from lupin_engine.chart.model import Chart
from lupin_engine.missions.selection import load_missions
from lupin_engine.plugin.types import BOOL, TEXT, list_of
from lupin_engine.runtime.setup import make_world
from lupin_verify.situations.classes import Classes
from lupin_verify.situations.relevance import Relevance
from tests import shipped
from tests.lupin_engine.machine.charts import chart
from tests.workbench.lupin_verify.toys import explored

LIFECYCLE = Path(__file__).parents[2] / "charts" / "mini" / "lifecycle.yaml"
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
      - {target: LATE, guard: abs(round(event.reading.stamp)) == '31 s'}
      - {target: JUST_SO, guard: input.charge * input.charge > 0.096 and input.charge * input.charge < 0.097}
      - target: done
    on_error: done
  LATE: {after: {1 s: done}}
  JUST_SO: {after: {1 s: done}}
  done: {type: final}
"""
#: The whole of a reading.
READING = "{tag_id: '1', stamp: 31 s, sim_time_of_day_seconds: 80001 s, readings: []}"


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
    assert "; 2 states never entered, 2 more transitions never taken; " in told
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


#: A mission with one condition, and a property that holds as long as the condition is never true.
DOUBT = """\
mission: Doubt
params:
  bar: {type: number, default: 0.5}
<ASKED_FOR>
inputs:
  charge: {value: robot.battery, initial: 50 %}
context:
  c: {type: <OF_TYPE>, default: <BEGINS>}
properties:
  never_there: {never: "in_state('THERE')"}
initial: LOOKING
states:
  LOOKING:
    invoke:
      do: perception.confirm_tag
      with: {tag_id: "1"}
      timeout: {after: 10 s, code: late}
    on_done:
      - {target: THERE, guard: "<CONFIRMED>"}
      - {target: READING, do: {set: {c: "${ <KEPT> }"}}}
    on_error:
      - {target: THERE, guard: "<FAILED>"}
      - target: READING
  READING:
    invoke:
      do: bridge.read_tag
      with: {tag_id: "1"}
      timeout: {after: 10 s, code: late}
    on_done:
      - {target: THERE, guard: "<READ>"}
      - target: ASKING
    on_error: done
  ASKING:
    always:
      - {target: THERE, guard: "<SEEN>"}
    after: {1 s: done}
  THERE: {after: {1 s: done}}
  done: {type: final}
"""
NOTHING = {
    "ASKED_FOR": "",
    "CONFIRMED": "param.bar > 2",
    "FAILED": "param.bar > 2",
    "READ": "param.bar > 2",
    "SEEN": "param.bar > 2",
    "KEPT": "0.0",
    "OF_TYPE": "number",
}
REQUEST = "request: {n: {type: count, default: 1}, tags: {type: list of text, default: ['1']}}"

WORD = "request: {word: {type: text, default: a}}"
LATEST = "request: {latest: {type: time_of_day, default: '07:00'}}"
SHARE = "request: {share: {type: number, min: 0.2, default: 0.5}}"
TIMES = "request: {a: {type: time_of_day, default: '07:00'}, b: {type: time_of_day, default: '08:00'}}"
SPOT = "request: {spot: {type: pose, default: {x: 0 m, y: 0 m, yaw: 0 rad}}}"
COLD = "known(event.reading['temperature']) and event.reading['temperature'] < '5 °C'"


def doubt(said: dict[str, str]) -> str:
    """Return the mission that says this."""
    text = DOUBT
    begins = {"time_of_day": "'06:00'", "pose": "{x: 0 m, y: 0 m, yaw: 0 rad}", "text": "p"}.get(
        said.get("OF_TYPE", ""), "0.0"
    )
    for word, what in {**NOTHING, "BEGINS": begins, **said}.items():
        text = text.replace(f"<{word}>", what)
    return text


def classes_of(of: Chart) -> Classes:
    """Return the classes of a chart for one target."""
    return Classes(make_world(of, {}), Relevance(of), 1)


def proven(folder: Path, capsys: pytest.CaptureFixture[str], said: dict[str, str]) -> tuple[int, str]:
    """Return the exit code of a proof of the mission that says this, and what it prints."""
    shutil.copy(LIFECYCLE, folder)
    (folder / "doubt.yaml").write_text(doubt(said), encoding="utf-8")
    code = main(["prove", "doubt.yaml", "--targets", "1", "--no-restarts", "--no-scenarios"])
    return code, capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize(
    "said",
    [
        {"CONFIRMED": "0.4 < event.confidence < 0.6"},
        {"CONFIRMED": "event.confidence < -0.5"},
        {"CONFIRMED": "event.confidence in [0.25, 0.75]"},
        {"CONFIRMED": "event.confidence == param.bar"},
        {"CONFIRMED": "param.bar - 0.1 < event.confidence < param.bar"},
        {"CONFIRMED": "0.3 + 0.2 < event.confidence * 2 < 0.6"},
        {"CONFIRMED": "max(event.confidence, 0.2) < 0.4"},
        {"CONFIRMED": "abs(event.confidence - 3) < 0.1"},
        {"KEPT": "event.confidence", "SEEN": "0 < c < 0.5"},
        {"KEPT": "1 - event.confidence", "SEEN": "c > 0.6"},
        {"KEPT": "event.confidence if event.confidence > 7 else 0", "SEEN": "c > 9"},
        {"KEPT": "input.charge", "SEEN": "c > 0.97"},
        {"SEEN": "input.charge > '97 %'"},
        {"SEEN": "input.charge > 0.9 + 0.07"},
        {"SEEN": "'31 %' < input.charge < '33 %'"},
        {"READ": "known(event.reading['temperature']) and event.reading['temperature'] < '-3 °C'"},
        {"READ": "known(event.reading['humidity']) and event.reading['humidity'] > '97 %'"},
        {"READ": "not known(event.reading['temperature'])"},
        {"READ": "event.reading.stamp == '7 s'"},
        {"READ": "event.reading.tag_id == 'nobody'"},
        {"ASKED_FOR": REQUEST, "SEEN": "request.n > 7"},
        {"ASKED_FOR": REQUEST, "SEEN": "len(request.tags) == 0"},
        {"ASKED_FOR": WORD, "SEEN": "request.word == 'b'"},
        {"ASKED_FOR": WORD, "SEEN": "request.word not in ['a', 'b']"},
        {"ASKED_FOR": WORD, "SEEN": "request.word in 'abc' and request.word not in ['abc', 'a', 'b', 'c']"},
        {"ASKED_FOR": LATEST, "SEEN": "request.latest < '06:30'"},
        {"ASKED_FOR": LATEST, "SEEN": "request.latest > '07:00'"},
        {"ASKED_FOR": SHARE, "SEEN": "0.1 < request.share < 0.3"},
        {"SEEN": "clock.time >= '12:00' and clock.time < '12:30'"},
        {"SEEN": "clock.today > '2026-03-01' and clock.time == '00:00'"},
        {"KEPT": "clock.time", "OF_TYPE": "time_of_day", "SEEN": "c == '22:15'"},
        {"READ": "event.reading.tag_id not in ['1', '2']"},
        {"READ": f"{COLD} and event.reading['humidity'] > '99 %'"},
        {"SEEN": "input.charge < 0.1 and input.battery.value > 0.09"},
        {"ASKED_FOR": SPOT, "KEPT": "request.spot", "OF_TYPE": "pose", "SEEN": "c.x > '7 m'"},
    ],
    ids=lambda said: ", ".join(f"{word} {what}" for word, what in said.items() if word != "ASKED_FOR"),
)
def test_what_a_condition_can_tell_apart_is_tried(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    said: dict[str, str],
) -> None:
    """So a property that one value breaks is not proven."""
    monkeypatch.chdir(tmp_path)
    code, told = proven(tmp_path, capsys, said)
    assert "✗ never_there: never in_state('THERE')\n" in told, told
    assert code == 1
    assert "Not all values were tried" not in told


@pytest.mark.slow
@pytest.mark.parametrize(
    ("said", "told"),
    [
        (
            {"CONFIRMED": "round(event.confidence) == 7"},
            "event.confidence: only -1000, -1, 0, 0.5, 1, 1000 were tried,"
            " although `round(event.confidence) == 7` reads it",
        ),
        (
            {"CONFIRMED": "event.confidence == -40 - input.charge"},
            "event.confidence: only -1000, -1, 0, 0.5, 1, 1000 were tried,"
            " although `event.confidence == -40 - input.charge` reads it",
        ),
        (
            {"KEPT": "c + event.confidence", "SEEN": "c > 40000"},
            "event.confidence: only -1000, -1, 0, 0.5, 1, 1000 were tried,"
            " although `c + event.confidence` reads it",
        ),
        (
            {"FAILED": "error.detail == 'stuck'"},
            "error.detail: no other values were tried, although `error.detail == 'stuck'` reads it",
        ),
        (
            {"CONFIRMED": "any(event.confidence == one for one in [7, 9])"},
            "event.confidence: only -1000, -1, 0, 0.5, 1, 1000 were tried,"
            " although `any(event.confidence == one for one in [7, 9])` reads it",
        ),
        (
            {"ASKED_FOR": REQUEST, "SEEN": "'9' in request.tags"},
            "request.tags: only lists of 0, 1 elements were tried, although `'9' in request.tags` reads it",
        ),
        (
            {"ASKED_FOR": WORD, "SEEN": "'b' in request.word and request.word != 'b'"},
            "request.word: only a, b, x1 were tried,"
            " although `'b' in request.word and request.word != 'b'` reads it",
        ),
        (
            {"ASKED_FOR": WORD, "SEEN": "request.word in 'bcdefg' and request.word == 'cdef'"},
            'request.word: only a, "", b, bc, bcd, bcdefg, c, cd and 10 more were tried,'
            " although `request.word in 'bcdefg' and request.word == 'cdef'` reads it",
        ),
        (
            {"ASKED_FOR": WORD, "SEEN": "len(request.word) > 9"},
            "request.word: only a, x1 were tried, although `len(request.word) > 9` reads it",
        ),
        (
            {"ASKED_FOR": WORD, "KEPT": "request.word", "OF_TYPE": "text", "SEEN": "len(c) > 9"},
            "request.word: only a, x1 were tried, although `len(c) > 9` reads it",
        ),
        (
            {"SEEN": "input.charge < (0.07 if in_state('ASKING') else 0.05) and input.charge > 0.06"},
            "input.charge: only 0, 0.03, 0.06, 0.13, 0.2, 0.225, 0.25, 0.5 and 2 more were tried, although"
            " `input.charge < (0.07 if in_state('ASKING') else 0.05) and input.charge > 0.06` reads it",
        ),
        (
            {"ASKED_FOR": TIMES, "SEEN": "request.a > request.b"},
            "request.a: only 07:00, 06:59, 07:01 were tried, although `request.a > request.b` reads it",
        ),
        (
            {"ASKED_FOR": LATEST, "SEEN": "clock.time > request.latest"},
            "clock.time: only 06:00, 05:59, 06:01 were tried,"
            " although `clock.time > request.latest` reads it",
        ),
        (
            {"CONFIRMED": "event.confidence in [input.charge + 3, 9 + input.charge]"},
            "event.confidence: only -1000, -1, 0, 0.5, 1, 1000 were tried,"
            " although `event.confidence in [input.charge + 3, 9 + input.charge]` reads it",
        ),
        (
            {"CONFIRMED": "event.confidence * (event.confidence - 1) == 42"},
            "event.confidence: only -1000, -1, 0, 0.5, 1, 1000 were tried,"
            " although `event.confidence * (event.confidence - 1) == 42` reads it",
        ),
    ],
    ids=lambda one: next(iter(one.values())) if isinstance(one, dict) else "",
)
def test_what_is_not_understood_is_told(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    said: dict[str, str],
    told: str,
) -> None:
    """With the values that were tried, and the condition."""
    monkeypatch.chdir(tmp_path)
    code, printed = proven(tmp_path, capsys, said)
    assert code == 0
    assert f"    Not all values were tried: {told}.\n" in printed
    assert re.search(r": proven for (.*, )?the values that were tried; ", printed)


@pytest.mark.slow
@pytest.mark.parametrize(
    "condition",
    [
        "event.confidence > input.charge",
        "event.confidence < -input.charge",
        "event.confidence * input.charge > 400",
        "event.confidence * event.confidence > 400",
        "round(event.confidence) % 10 == 9",
    ],
)
def test_of_what_is_not_understood_a_few_values_are_tried(
    condition: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Zero, one, large ones and their opposites, besides those around bounds: what these break is found."""
    monkeypatch.chdir(tmp_path)
    code, told = proven(tmp_path, capsys, {"CONFIRMED": condition})
    assert code == 1, told
    assert "✗ never_there: never in_state('THERE')\n" in told
    assert "Not all values were tried: event.confidence: only -1000, -1, 0, 0.5, 1, 1000 were tried" in told


def test_the_values_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of all on which something depends, and of nothing else."""
    monkeypatch.chdir(tmp_path)
    seen = "input.charge > '97 %' and len(request.tags) > 0 and request.n > 7"
    said = {"CONFIRMED": "event.confidence < param.bar", "READ": COLD, "SEEN": seen, "ASKED_FOR": REQUEST}
    _, told = proven(tmp_path, capsys, said)
    lines = [line.strip() for line in told.splitlines()]
    assert [line for line in lines if line.startswith(("Tried as ", "Conditions and "))] == [
        "Tried as event.confidence: -0.5, 0.5, 1.",
        "Tried as event.reading.readings['temperature']: 4 °C, 5 °C, 22.531 °C, nothing.",
        "Tried as input.battery: 0.1, 0.2, 0.225, 0.25, 0.61, 0.97, 0.985.",
        "Tried as input.charge: 0.1, 0.2, 0.225, 0.25, 0.61, 0.97, 0.985.",
        "Tried as input.estop: false, true.",
        "Tried as request.n: 0, 7, 8.",
        "Tried as request.tags: lists of 0, 1 elements.",
        "Conditions and times read these parameters: bar = 0.5.",
    ]


def test_results_that_differ_in_nothing_that_decides_are_one_class(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also those that a plugin's catalog adds: a reading that is only published is tried once."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "doubt.yaml").write_text(doubt({"READ": COLD}), encoding="utf-8")
    shutil.copy(LIFECYCLE, tmp_path)
    found = classes_of(load_missions(["doubt.yaml"], shipped.catalog()).chart)
    reading = found.results("bridge.read_tag", {"tag_id": "1"})
    told = [
        find["value"]
        for one in reading
        for find in one["reading"]["readings"]
        if find["name"] == "temperature"
    ]
    assert told == [22.531, 4.0, 5.0]
    assert len(reading) == len(told) + 1
    assert found.results("perception.confirm_tag", {"tag_id": "1"}) == [{"confidence": 1.0}]


def test_an_input_that_is_an_event_is_tried() -> None:
    """Although no expression reads it."""
    states = {"A": {"on": {"input.danger": "B"}}, "B": {}}
    found = explored(chart(states, inputs={"danger": {"type": BOOL}}), restarts=False)
    assert {"A", "B"} <= found.entered


def test_what_an_input_begins_with_is_tried() -> None:
    """It may come again later."""
    rule = {"target": "B", "guard": lambda env: "q" in env["input"]["seen"]}
    of = chart({"A": {"always": rule}, "B": {}}, inputs={"seen": {"type": list_of(TEXT), "initial": ["q"]}})
    assert [event.data["value"] for event in classes_of(of).values] == [[], ["x1"], ["q"]]
