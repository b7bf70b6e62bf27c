"""The console's types of records are those of the engine, and say what records of simulated runs have."""

from __future__ import annotations

import json
import re
import time
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("starlette", reason="the extra hmi is not installed here")

from lupin_cli.settings import read_value
from lupin_engine.missions.folders import default_missions_folder
from lupin_engine.missions.load import load_files
from lupin_engine.plugin import PageMessage
from lupin_engine.runtime.setup import make_world
from lupin_engine.sim import Script
from lupin_gateway.access import AccessControl, AllowList
from lupin_gateway.guard import STOPS_TOPIC, ClockPair, GatewayRules, RuleOutputs
from lupin_gateway.motion import BASE_TOPIC, MotionGate
from lupin_gateway.people import NOTIFICATIONS_TOPIC, PEOPLE_TOPIC, People
from lupin_gateway.stop import StopArbiter
from lupin_ros.service import SimulatedPages, names
from lupin_ros.service.simulated import SIMULATION_SERVICE, SIMULATION_TOPIC
from tests import shipped
from tests.tools import load_tool

records = load_tool("records")
CONSOLE = Path(__file__).parents[2] / "console"
#: What the shipped missions do not tell: a question, an action, fields with bounds, a broken invariant.
ASKING = """\
mission: Asking
types:
  ward:
    id: text
    door: {type: length, min: 50 cm, max: 2 m}
    since: date
    beds: {type: set of count, max: 9}
    at: pose
request:
  to:
    type: list of ward
    default: [{id: icu, door: 1 m, since: "2026-01-01", beds: [1], at: {x: 1 m, y: 0 m, yaw: 0 deg}}]
  tags: {type: list of tag, default: [], max: 50, distinct: true}
  at: {type: time_of_day, default: "06:30", summary: when to begin}
  rest: {type: number, unit: min, min: 0 s, default: 1 min}
  power: {type: number, unit: "%", default: 50 %}
invariants:
  never_waits: not in_state('WAITING')
initial: ASKS
states:
  ASKS:
    ask: {question: "Again?", choices: {again: Once more, enough: "No"}, default: enough, after: 1 min}
    on:
      answer.again: WAITING
      answer.enough: WAITING
      operator.skip_current: {target: done, guard: len(request.tags) + len(request.to) > 1}
  WAITING: {entry: [{arm.preset: {name: home}}], after: {1 min: done}}
  done: {type: final}
"""
#: What only types of other plugins have: fields of requests with allowed values, or a largest one.
NEVER_MET = {("FieldRecord", "allowed"), ("FieldRecord", "maximum"), ("TypeRecord", "allowed")}
KINDS = {
    names.STEPS_TOPIC: "StepRecord",
    names.POSSIBLE_TOPIC: "PublishedPossible",
    names.MISSIONS_TOPIC: "MissionsRecord",
    names.CHART_TOPIC: "ChartRecord",
    names.EXPLAIN_SERVICE: "ExplanationRecord",
    SIMULATION_TOPIC: "SimulationRecord",
    STOPS_TOPIC: "StopsRecord",
    BASE_TOPIC: "BaseRecord",
    PEOPLE_TOPIC: "PeopleRecord",
    NOTIFICATIONS_TOPIC: "NotificationsRecord",
    "/robots": "RobotRecord",
}
INTERFACES = {kind.__name__: members for kind, members in records.interfaces().items()}
OPEN = {kind.__name__ for kind, written in records.WRITTEN.items() if written.others}
#: What JSON has of the scalars of TypeScript.
SCALARS = {"string": (str,), "boolean": (bool,), "number": (int, float), "null": (type(None),)}


class Desk:
    """A mission in a simulation, and an operator; what is answered is checked."""

    def __init__(self, mission: str, file: Path) -> None:
        lifecycle = default_missions_folder() / "lifecycle.yaml"
        loaded = load_files(lifecycle, [file], shipped.catalog())
        script, world = Script(mission, starts=False), make_world(loaded.chart, {})
        self.mission = mission
        self.pages = SimulatedPages(loaded, script, world, read_value, lambda: 0.0)
        self.asked = 0
        self._heard: list[PageMessage] = []
        self.pages.begin(self._heard.append, lambda: None)

    def ask(self, verb: str, accepted: bool, **request: Any) -> None:
        """Command the orchestrator."""
        self.asked += 1
        mission = self.mission if verb == "start" else ""
        fields = {"verb": verb, "mission": mission, "request": json.dumps(request)}
        origin = {"by": "anna", "command_id": str(self.asked)}
        answer = self.pages.call(names.COMMAND_SERVICE, {**fields, **origin}, 0.0)
        assert answer["accepted"] == accepted, answer

    def do(self, command: str, *words: str) -> None:
        """Do something to the simulation."""
        answer = self.pages.call(SIMULATION_SERVICE, {"command": command, "words": list(words)}, 0.0)
        assert answer["success"], answer

    def go_on(self, steps: int) -> None:
        for _ in range(steps):
            self.do("step")

    def told(self) -> Iterator[tuple[str, dict[str, Any]]]:
        """Yield the records of all topics, and explanations, each with where it is from."""
        for message in self._heard:
            if message.topic in KINDS:
                yield message.topic, json.loads(message.fields["data"])
        answer = self.pages.call(names.EXPLAIN_SERVICE, {"element": "MISSION"}, 0.0)
        yield names.EXPLAIN_SERVICE, json.loads(answer["explanation"])


def gateway() -> Iterator[tuple[str, Any]]:
    """Yield what a gateway tells of a page that stops the robot, each with its topic."""
    told: list[tuple[str, Any]] = []
    people = People(lambda topic, text: told.append((topic, json.loads(text))))
    people.presence.joined(1, "anna-1", "anna", "operator", "browser", 0.0)
    people.notifications.add("stop", "anna-1", 2, "stopped by anna-1", 0.0)
    people.publish_changes()
    stops, motion = StopArbiter(), MotionGate()
    stops.joined(1, "anna-1", operator=True)
    stops.report(1, True, 0.0)
    motion.settle(stops.stopped, 1.0)
    yield from told
    yield STOPS_TOPIC, json.loads(json.dumps(stops.state(1.0)))
    yield BASE_TOPIC, json.loads(json.dumps(motion.state()))
    outputs = RuleOutputs(*(lambda _: None,) * 4)
    access = AccessControl(), AllowList(())
    rules = GatewayRules(*access, stops, None, ClockPair(time.monotonic, time.time), outputs)
    yield "/robots", json.loads(json.dumps(rules.summary("robot1")))


class Checker:
    """Holds records against their interfaces, and remembers which members it has met.

    `counts` are the fields that a record has under names of the profile, where its interface is open.
    """

    def __init__(self, counts: set[str]) -> None:
        self.met: set[tuple[str, str]] = set()
        self.problems: set[str] = set()
        self._counts = counts

    def take(self, record: dict[str, Any], name: str) -> None:
        """Hold a record against an interface, down to its values."""
        members, others = INTERFACES[name], self._counts if name in OPEN else set()
        needed = {each for each, member in members.items() if not member.may_be_missing}
        self.problems |= {f"{name}.{each} is not declared" for each in record.keys() - members - others}
        self.problems |= {f"{name}.{each} is not told" for each in (needed | others) - record.keys()}
        for each in record.keys() & members:
            self.met.add((name, each))
            if not self._fits(record[each], members[each].type):
                self.problems.add(f"{name}.{each} is {record[each]!r:.80}, not {members[each].type}")

    def _fits(self, value: Any, wanted: str) -> bool:
        """Tell whether a value is of a type of TypeScript; records in it are held against theirs."""
        if wanted.startswith("readonly "):
            inner = wanted.removeprefix("readonly ").removesuffix("[]").strip("()")
            return isinstance(value, list) and all(self._fits(each, inner) for each in value)
        if mapping := re.fullmatch(r"Readonly<Record<string, (.+)>>", wanted):
            return isinstance(value, dict) and all(self._fits(each, mapping[1]) for each in value.values())
        if " | " in wanted:
            return any(self._fits(value, one) for one in wanted.split(" | ") if not _is_another(value, one))
        if wanted in INTERFACES and isinstance(value, dict):
            self.take(value, wanted)
            return True
        if wanted.startswith('"'):
            return bool(value == json.loads(wanted))
        return wanted == "unknown" or type(value) in SCALARS.get(wanted, ())


def _is_another(value: Any, name: str) -> bool:
    """Tell whether a value is a command of another kind than an interface is of."""
    kind = INTERFACES.get(name, {}).get("command")
    return kind is not None and kind.type != json.dumps(value["command"])


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[Any]]:
    """What two simulated missions and a gateway tell, by topic."""
    inspection = Desk("InspectionMission", default_missions_folder() / "inspection.yaml")
    inspection.ask("resume", accepted=False)
    inspection.ask("start", accepted=True, tag_sequence=["1", "5"])
    inspection.go_on(3)
    inspection.ask("pause", accepted=True)
    inspection.go_on(1)
    inspection.ask("resume", accepted=True)
    inspection.go_on(40)
    file = tmp_path_factory.mktemp("missions") / "asking.yaml"
    file.write_text(ASKING)
    asking = Desk("Asking", file)
    asking.ask("start", accepted=True)
    asking.ask("skip_current", accepted=False)
    asking.ask("pause", accepted=True)
    asking.ask("resume", accepted=True)
    asking.go_on(2)
    found: dict[str, list[Any]] = defaultdict(list)
    for topic, record in (*inspection.told(), *asking.told(), *gateway()):
        found[topic].append(record)
    return found


def test_the_types_are_what_the_classes_say() -> None:
    """A changed field changes the module, and what reads it by its earlier name fails the compiler."""
    if (CONSOLE / "src" / "records.ts").read_text(encoding="utf-8") != records.module():
        pytest.fail(
            "out of date; write it anew: .venv/bin/python tools/records.py > console/src/records.ts", False
        )


def test_records_are_as_their_types_say(told: dict[str, list[Any]]) -> None:
    """Down to their values: nothing is told that is not declared, nor left out, and every member is met."""
    assert told.keys() == KINDS.keys()
    checker = Checker({one["counter"] for one in told[names.MISSIONS_TOPIC][0]["outcomes"]})
    for topic, found in told.items():
        for record in found:
            checker.take(record, KINDS[topic])
    assert checker.problems == set()
    declared = {(name, each) for name, members in INTERFACES.items() for each in members}
    assert declared - checker.met == NEVER_MET


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"more": 1}, "Countdown.more is not declared"),
        ({"event": None}, "Countdown.event is None, not string"),
        ({"left": "1"}, "Countdown.left is '1', not number | null"),
    ],
)
def test_a_record_of_another_form_is_told(change: dict[str, Any], problem: str) -> None:
    checker = Checker(set())
    checker.take({"state": "A", "event": "after.0", "deadline": 1.5, "left": None, **change}, "Countdown")
    assert checker.problems == {problem}


def test_a_member_that_is_left_out_is_told() -> None:
    checker = Checker(set())
    checker.take({"code": "x"}, "Refusal")
    assert checker.problems == {"Refusal.text is not told"}
