"""What is told of the missions that can be asked for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml

from lupin_engine.chart.model import Field
from lupin_engine.errors import Place, Severity
from lupin_engine.plugin.contract import ENGINE_CODES, Code
from lupin_engine.plugin.types import TIME_OF_DAY, list_of, number_in, one_of, within
from lupin_engine.runtime import offer
from lupin_engine.runtime.offer import missions_record, offered
from lupin_engine.runtime.setup import make_machine
from tests import shipped

ROOT = Path(__file__).parents[3]
PLACE = Place("x.yaml", 1, 1)

FIELDS: dict[str, dict[str, Any]] = {
    "exploration": {
        "name": "discovery_goal",
        "type": "count",
        "kind": "integer",
        "required": False,
        "default": 5,
        "computed": "param.discovery_goal",
        "minimum": 1,
    },
    "inspection": {
        "name": "tag_sequence",
        "type": "list of tag",
        "kind": "name",
        "required": False,
        "computed": "tags.named(param.tag_sequence) if len(param.tag_sequence) > 0 else tags.numeric_order()",
        "may_be_empty": False,
    },
}


@pytest.mark.parametrize("name", FIELDS)
def test_a_field_of_a_request_is_told_with_its_bounds(name: str) -> None:
    """The default of the tags is every tag of the layout, which is not written here."""
    (told,) = offered(make_machine(shipped.mission(name), {}), 0.0)
    assert told["summary"]
    (field,) = told["request"]
    assert field == {**FIELDS[name], "default": FIELDS[name].get("default", field["default"])}


def test_all_codes_say_what_to_do() -> None:
    """A sentence each: of the engine, the plugins, and the missions that are shipped and shown."""
    codes = dict(ENGINE_CODES)
    for plugin in shipped.catalog().plugins.values():
        codes.update({code.name: code for one in plugin.operations.values() for code in one.codes})
    for file in sorted(
        [*(ROOT / "missions").rglob("*.yaml"), *(ROOT / "examples").rglob("missions/**/*.yaml")]
    ):
        written = yaml.safe_load(file.read_text(encoding="utf-8")) or {}
        for name, code in written.get("codes", {}).items():
            codes[name] = Code(name, code["label"], advice=code.get("advice", ""))
    assert {"nav_timeout", "servo_failed", "driver_error", "valve_gone"} <= set(codes)
    assert [name for name, code in codes.items() if not code.advice.endswith(".")] == []


def test_what_is_told_beside_the_missions_is_said_once() -> None:
    told = missions_record(make_machine(shipped.mission("inspection"), {}), 0.0, ["a problem"])
    assert told["problems"] == ["a problem"]
    assert told["holds"] == {
        "pause": "paused_by_operator",
        "estop": "estop_engaged",
        "restarted": "restarted",
        "unrecorded": "journal_failed",
        "breached": "property_broken",
    }
    assert told["codes"]["battery_low"] == {
        "label": "battery low",
        "severity": Severity.WARN,
        "advice": "Charge the robot, then resume or start.",
    }
    assert told["codes"]["driver_error"]["advice"]
    assert told["outcomes"][0] == {
        "name": "OK",
        "counter": "completed",
        "word": told["outcomes"][0]["word"],
        "rating": "good",
    }
    assert (told["stages"]["returning"], told["ends"]) == (("RETURNING",), "abort")


def test_the_range_of_a_list_is_that_of_its_elements() -> None:
    """How many there may be is told beside, and so is what a text must look like."""
    machine = make_machine(shipped.mission("inspection"), {})
    described = {
        "amounts": replace(list_of(within(number_in("l"), 0.1, 5.0)), maximum=3),
        "at": TIME_OF_DAY,
        "mode": one_of("dry", "wet"),
    }
    told = {name: offer._field(Field(name, kind, PLACE), machine, 0.0) for name, kind in described.items()}
    bounds = {"minimum": 0.1, "maximum": 5.0, "at_most": 3, "unit": "l", "kind": "number"}
    assert told["amounts"].items() >= bounds.items()
    assert (told["at"]["kind"], told["at"]["example"]) == ("text", "06:30")
    assert told["mode"]["allowed"] == ["dry", "wet"]
