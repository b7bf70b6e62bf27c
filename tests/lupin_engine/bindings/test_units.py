"""Units in bindings: what a number is on the other side; on this one it is kept in its base unit."""

from __future__ import annotations

import math
import shutil
from pathlib import Path
from typing import Any

import pytest

from lupin_engine.bindings.catalog import bound_catalog
from lupin_engine.bindings.data import Binding
from lupin_engine.bindings.reader import check_definition
from lupin_engine.chart.expressions.evaluation import Expression
from lupin_engine.chart.findings import Findings
from lupin_engine.errors import Place
from lupin_engine.machine.scope import Arguments
from lupin_engine.missions.folders import LIFECYCLE
from lupin_engine.missions.load import check_chart
from lupin_engine.plugin.registry import Catalog
from lupin_engine.plugin.types import (
    ANGLE,
    ANY,
    COUNT,
    DURATION,
    LENGTH,
    NUMBER,
    TEXT,
    UNITS,
    Type,
    list_of,
    number_in,
    parse_quantity,
)

MINI = Path(__file__).parents[2] / "charts" / "mini"
AROUND: dict[str, Any] = {"param": {}, "constant": {}, "now": 0.0}
VALUE = """\
binding: scale
summary: The scale.
values:
  scale.weight:
    summary: what lies on it
    type: number
    unit: {unit}
    topic: {{name: /scale, type: std_msgs/msg/Float32}}
    from: ${{ message.data }}
"""
OPERATION = """\
binding: scale
summary: The scale.
codes:
  scale_gone: {label: the scale is gone}
operations:
  tare:
    summary: Set it to zero.
    arguments:
      wait: {type: duration, default: 2, summary: how long it waits}
    service: {name: /scale/tare, type: std_srvs/srv/Trigger}
    done_when: response.success
    code: scale_gone
"""
MISSION = """\
mission: Weigh
states:
  TARING:
    invoke: {do: scale.tare, timeout: {after: 5 s, code: scale_gone}}
    on_done: done
    on_error: done
  done: {type: final}
"""


def write(folder: Path, text: str) -> None:
    """Write a binding beside the missions of a folder."""
    (folder / "bindings").mkdir()
    (folder / "bindings" / "scale.yaml").write_text(text, encoding="utf-8")


@pytest.mark.parametrize(
    ("unit", "base", "factor"), [("g", "kg", 1e-3), ("kg", "kg", 1.0), ("ml", "l", 1e-3), ("min", "s", 60.0)]
)
def test_a_number_in_a_unit_is_kept_in_its_base(
    tmp_path: Path, catalog: Catalog, unit: str, base: str, factor: float
) -> None:
    """What is in the message is in the unit; missions compare it with quantities."""
    write(tmp_path, VALUE.format(unit=unit))
    findings = Findings()
    bound = bound_catalog([tmp_path], catalog, {}, findings)
    assert bound is not None
    assert findings.all == ()
    assert bound.catalog.values["scale.weight"].type == (DURATION if base == "s" else number_in(base))
    heard = bound.bindings["scale"].values["scale.weight"].heard({"data": 5.0}, AROUND)
    assert heard == {"value": pytest.approx(5.0 * factor)}


def test_a_default_that_is_wrong_is_told_once(tmp_path: Path, catalog: Catalog) -> None:
    """Not once more in each mission that relies on it."""
    shutil.copy(MINI / LIFECYCLE, tmp_path)
    write(tmp_path, OPERATION)
    mission = tmp_path / "weigh.yaml"
    mission.write_text(MISSION, encoding="utf-8")
    _, found = check_chart(tmp_path / LIFECYCLE, [mission], catalog)
    assert [(finding.rule, finding.path) for finding in found if finding.rule != "not-allowed"] == [
        ("no-unit", "operations.tare.arguments.wait.default")
    ]


# -- both ways ---------------------------------------------------------------------------------------------

HEAD = """\
binding: head
summary: A head that counts in degrees, millimetres and per cent.
params:
  offset: {type: angle, unit: deg, default: 1 deg}
  reaches: {type: list of number, unit: mm, default: [1 m, 2 m]}
codes:
  head_failed: {label: the head did not turn}
operations:
  turn:
    summary: Turn it.
    arguments:
      pan: {type: angle, unit: deg, min: -90 deg, max: 90 deg, summary: to the side}
      share: {type: number, unit: "%", default: 50 %, min: 10 %, summary: of its speed}
      steps: {type: list of list of length, unit: mm, default: [[1 cm]], summary: where to stop}
      wait: {type: duration, unit: ms, default: 2 s, max: 1 min, summary: how long it waits there}
      up: {type: number, default: 5, max: 9, summary: without a unit}
    service: {name: /head/turn, type: head_msgs/srv/Turn}
    with:
      pan: ${ pan + param.offset - '1 deg' }
      whole: ${ round(pan) }
      far: ${ pan > '45 deg' }
      half: ${ pan / 2 }
      share: ${ share }
      steps: ${ steps }
      reach: ${ param.reaches[1] }
      wait: ${ wait }
      seconds: ${ wait / '1 s' }
      up: ${ up }
    done_when: response.ok
    code: head_failed
    result:
      pan: {type: angle, unit: deg, from: "${ response.pan - param.offset }"}
      steps: {type: list of length, unit: mm, from: "${ response.steps }"}
      share: {type: number, unit: "%", from: "${ response.share }"}
      fixed: {type: length, unit: mm, from: 1 m}
    mock: {result: {pan: 5 deg, steps: [1 mm], share: 5 %, fixed: 1 m}}
events:
  moved:
    summary: It moved.
    topic: {name: /head/moved, type: std_msgs/msg/Float32}
    fields:
      mass: {type: number, unit: g, from: "${ message.data }"}
"""
SETTINGS: dict[str, Any] = {**AROUND, "param": {"offset": math.radians(1), "reaches": [1.0, 2.0]}}


def quantity(text: str) -> float:
    """Return what a mission hands over when it writes this."""
    found = parse_quantity(text)
    assert found is not None
    return found[0]


@pytest.fixture
def head(tmp_path: Path, catalog: Catalog) -> Binding:
    """The binding of the head, which is without a mistake."""
    (tmp_path / "bindings").mkdir()
    (tmp_path / "bindings" / "head.yaml").write_text(HEAD, encoding="utf-8")
    findings = Findings()
    bound = bound_catalog([tmp_path], catalog, {}, findings)
    assert findings.all == ()
    assert bound is not None
    return bound.bindings["head"]


def given(**changed: Any) -> dict[str, Any]:
    """The arguments of an order."""
    usual = {"pan": quantity("60 deg"), "share": 0.57, "steps": [[0.01, 0.035]], "wait": 2.0, "up": 5.0}
    return {**usual, **changed}


def test_missions_see_base_units_and_ranges(head: Binding) -> None:
    """Whatever the other side counts in."""
    turn = head.plugin.operations["turn"]
    kinds = {name: (argument.type.name, argument.type.unit) for name, argument in turn.arguments.items()}
    assert kinds == {
        "pan": ("angle", "rad"),
        "share": ("number", ""),
        "steps": ("list of list of length", ""),
        "wait": ("duration", "s"),
        "up": ("number", ""),
    }
    pan, wait = turn.arguments["pan"].type, turn.arguments["wait"].type
    assert (pan.minimum, pan.maximum) == (-math.pi / 2, math.pi / 2)
    assert (wait.minimum, wait.maximum) == (0, 60)
    defaults = {name: argument.default for name, argument in turn.arguments.items()}
    assert defaults == {"pan": None, "share": 0.5, "steps": [[0.01]], "wait": 2.0, "up": 5.0}
    assert turn.result == {"pan": ANGLE, "steps": list_of(LENGTH), "share": NUMBER, "fixed": LENGTH}
    assert head.plugin.events["moved"].fields == {"mass": number_in("kg")}
    assert head.plugin.parameters["reaches"].type == list_of(LENGTH)


def test_what_is_sent_is_in_the_unit(head: Binding) -> None:
    """To the last digit what was written; a whole number is one, and quantities are of the unit as well."""
    sent = head.calls["turn"].sending.sent(given(), SETTINGS)
    assert sent == {
        "pan": 60.0,
        "whole": 60,
        "far": True,
        "half": 30.0,
        "share": 57.0,
        "steps": [[10.0, 35.0]],
        "reach": 2000.0,
        "wait": 2000.0,
        "seconds": 2.0,
        "up": 5.0,
    }
    assert isinstance(sent["whole"], int)


def test_what_is_read_is_in_the_unit(head: Binding) -> None:
    """And kept in the base; what is written without an expression has its own."""
    answer = {"response": {"ok": True, "pan": 61, "steps": [1, 20.5], "share": 40}}
    outcome = head.calls["turn"].outcome(answer, SETTINGS)
    assert outcome.result == {"pan": quantity("60 deg"), "steps": [0.001, 0.0205], "share": 0.4, "fixed": 1.0}
    assert head.events["moved"].heard({"data": 250}, SETTINGS) == {"mass": 0.25}


@pytest.mark.parametrize("told", [True, "5", "5 g", None, math.nan, math.inf, [5.0]])
def test_what_is_no_number_has_no_unit(head: Binding, told: Any) -> None:
    """It is told for what it is."""
    with pytest.raises(ValueError, match=r"^expected number in g, got "):
        head.events["moved"].heard({"data": told}, SETTINGS)


@pytest.mark.parametrize(
    ("computed", "told"),
    [
        ({"pan": 1.6}, "pan: expected angle between -1.5708 and 1.5708 rad, got 1.6"),
        ({"share": 0.05}, "share: expected number of at least 0.1, got 0.05"),
        ({"wait": 61.0}, "wait: expected duration between 0 and 60 s, got 61.0"),
        ({"up": 10}, "up: expected number of at most 9, got 10"),
        ({"pan": "5 deg"}, "pan: expected angle, got '5 deg'"),
        ({"steps": [[0.1], [True]]}, "steps[1][0]: expected length, got True"),
    ],
)
def test_what_is_computed_is_held_against_the_range(
    head: Binding, computed: dict[str, Any], told: str
) -> None:
    """A checker cannot know it."""
    ((name, wrong),) = computed.items()
    values = {name: Expression(name, Place("feel.yaml", 1, 1), ANY, lambda _: wrong)}
    with pytest.raises(ValueError, match=r"expected") as raised:
        Arguments(values, head.plugin.operations["turn"].arguments).evaluate({})
    assert str(raised.value) == told


@pytest.mark.parametrize("unit", UNITS)
def test_every_unit_comes_back_as_it_was_written(tmp_path: Path, catalog: Catalog, unit: str) -> None:
    """A number with four digits, out and in again."""
    text = HEAD.replace("type: angle, unit: deg, min: -90 deg, max: 90 deg", f'type: number, unit: "{unit}"')
    text = text.replace("${ pan + param.offset - '1 deg' }", "${ pan }").replace(
        "      far: ${ pan > '45 deg' }\n", ""
    )
    text = text.replace("type: number, unit: g,", f'type: number, unit: "{unit}",')
    (tmp_path / "bindings").mkdir()
    (tmp_path / "bindings" / "head.yaml").write_text(text, encoding="utf-8")
    findings = Findings()
    bound = bound_catalog([tmp_path], catalog, {}, findings)
    assert findings.errors == ()
    assert bound is not None
    head = bound.bindings["head"]
    for number in (0.0, 0.1, 57.0, 60.0, 33.33, 1234.0, 0.007):
        kept = quantity(f"{number} {unit}")
        sent = head.calls["turn"].sending.sent(given(pan=kept), SETTINGS)
        assert sent["pan"] == number
        assert head.events["moved"].heard({"data": sent["pan"]}, SETTINGS) == {"mass": kept}


# -- held against a definition -----------------------------------------------------------------------------


def misfits(head: Binding, **fields: Type) -> list[str]:
    """What does not fit a service whose request has these fields."""
    numbers = dict.fromkeys(("pan", "half", "share", "steps", "reach", "wait", "seconds", "up"), NUMBER)
    numbers |= {"whole": COUNT, "far": Type("bool", "bool"), "steps": list_of(list_of(NUMBER))}
    numbers |= fields
    answer = {"ok": Type("bool", "bool"), "pan": NUMBER, "steps": list_of(NUMBER), "share": COUNT}
    turn = {
        "request": Type("record", "Turn.Request", fields=numbers),
        "response": Type("record", "Turn.Response", fields=answer),
        "constant": Type("record", "constant"),
    }
    moved = {
        "message": Type("record", "Float32", fields={"data": NUMBER}),
        "constant": Type("record", "constant"),
    }
    findings = Findings()
    check_definition(head, lambda name: turn if name == "head_msgs/srv/Turn" else moved, findings)
    return [str(found).partition("error: operations.turn.")[2] for found in findings.all]


def test_units_fit_every_number_of_a_definition(head: Binding) -> None:
    """There they have none."""
    assert misfits(head) == []


def test_a_time_is_sent_in_seconds_and_a_whole_number_is_rounded(head: Binding) -> None:
    """A number of milliseconds would be taken for seconds."""
    time = Type("record", "builtin_interfaces/msg/Duration", fields={"sec": COUNT, "nanosec": COUNT})
    assert misfits(head, wait=time, seconds=time, half=COUNT, share=TEXT) == [
        "with.half: expected a whole number, but 'pan / 2' is one with digits; write 'round(pan / 2)' "
        "[wrong-type]",
        "with.share: expected text, but 'share' is number in % [wrong-type]",
        "with.wait: expected a time, but 'wait' is number in ms; "
        "a time is sent in s: leave 'unit' out, or divide by '1 s' [wrong-type]",
    ]
