"""Converts the record of a run to a scenario that runs the same: mocks of servers, requests, events, values.

A record is the output of `lupin simulate --json` (one object with `steps`), its steps alone as a list, or the
orchestrator's steps, one JSON object a line, bare or under `step` as `lupin run --json` prints them.

Times count from the last entered state, so that the scenario keeps its meaning when something before takes
longer. A server's answers become its operation's mock, one outcome per attempt. Live values are minimized: a
value is left out where the run is the same without it; else its last report before each effect is kept. If no
tried scenario runs the same, an error says where it differs.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from lupin_engine.chart.model import Chart
from lupin_engine.errors import ChartError, UsageError, near
from lupin_engine.machine.event import CLOCK, RESUMED, Start
from lupin_engine.machine.step import Step
from lupin_engine.plugin.builtin import TIME_ZONE
from lupin_engine.plugin.mocks import contains
from lupin_engine.plugin.profile import START, Publish
from lupin_engine.properties.built_in import INVARIANTS
from lupin_engine.replay.rebuilt import rebuilt
from lupin_engine.replay.yaml_text import yaml_text
from lupin_engine.runtime.clock import UTC, calendar_of
from lupin_engine.runtime.history import AttemptHistory, History
from lupin_engine.runtime.record import read_step
from lupin_engine.runtime.setup import check_parameters
from lupin_engine.sim.scenario import Missions, Scenario, load_scenario_text, mission_name
from lupin_engine.sim.simulation import NEW_YEAR, Run, is_named, label_of

#: To how many digits times are written: the first that makes the run come out the same will do.
_DIGITS = (3, 6, 12)


@dataclass(frozen=True)
class RunRecord:
    """The steps of a run, its settings, seed and mission's file, as far as known.

    `name` is its file in messages.
    """

    steps: tuple[Step, ...]
    parameters: Mapping[str, Any] = field(default_factory=dict)
    seed: int = 0
    file: str = ""
    name: str = "what was recorded"

    @property
    def values(self) -> list[str]:
        """The live values that were reported, sorted."""
        return sorted({step.event.data["name"] for step in self.steps if step.event.name == "value"})

    def without(self, value: str) -> RunRecord:
        """Return the record without the reports of a live value."""
        reports = (step.event.name == "value" and step.event.data["name"] == value for step in self.steps)
        kept = (step for step, is_report in zip(self.steps, reports, strict=True) if not is_report)
        return replace(self, steps=tuple(kept))

    @property
    def mission(self) -> str:
        """The first requested mission; '' when none was."""
        asked = (step.event.data["mission_type"] for step in self.steps if step.event.name == START)
        return next(asked, "")


def read_recording(text: str, name: str) -> RunRecord:
    """Read a record that a run can be rebuilt from; `name` is its file in messages.

    Raises:
        UsageError: it is no record of steps, or does not have the beginning.
    """
    recording = read_steps(text, name)
    if not recording.mission:
        raise UsageError(f"{name}: no mission is started in it")
    return recording


def read_steps(text: str, name: str) -> RunRecord:
    """Read a record; `name` is its file in messages.

    Raises:
        UsageError: it is no record of steps.
    """
    try:
        whole = json.loads(text)
    except ValueError:
        return _checked(_steps_of_lines(text, name), name)
    if isinstance(whole, list):
        return _checked(whole, name)
    if isinstance(whole, dict) and isinstance(whole.get("steps"), list):
        parameters, seed = whole.get("parameters") or {}, whole.get("seed") or 0
        if not isinstance(parameters, dict) or not isinstance(seed, int):
            raise UsageError(f"{name}: 'parameters' must be an object and 'seed' a whole number")
        file = str(whole.get("file") or "")
        return replace(_checked(whole["steps"], name), parameters=parameters, seed=seed, file=file)
    raise UsageError(f"{name}: expected the output of 'lupin simulate --json', or steps, one a line")


def _steps_of_lines(text: str, name: str) -> Iterator[Any]:
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip():
            continue
        try:
            found = json.loads(line)
        except ValueError:
            hint = "'lupin simulate MISSION --json' prints a record"
            raise UsageError(f"{name}:{number}: this is no JSON; {hint}") from None
        if isinstance(found, dict):
            step = found.get("step", found)
            if isinstance(step, dict) and "event" in step and "time" in step:
                yield step


def _checked(records: Iterable[Any], name: str) -> RunRecord:
    found = [record for record in records if isinstance(record, dict) and {"event", "time"} <= set(record)]
    if not found:
        raise UsageError(f"{name}: there are no steps in it")
    return RunRecord(tuple(_step(record, number, name) for number, record in enumerate(found, 1)), name=name)


def _step(record: Any, number: int, name: str) -> Step:
    try:
        return read_step(record)
    except ValueError as problem:
        part = str(problem)
        raise UsageError(f"{name}: step {number} is none: its {part!r} is not as it is recorded") from None


# -- what the servers said -------------------------------------------------------------------------------


class _Mocks:
    """Converts attempts to mocks."""

    def __init__(self, chart: Chart, recording: RunRecord, digits: int) -> None:
        self._catalog = chart.catalog
        self._parameters = check_parameters(chart.parameters, recording.parameters)
        self._attempts = History(recording.steps).attempts.values()
        self._digits = digits

    def mocks(self) -> Iterator[Mapping[str, Any]]:
        """Yield a mock for each operation whose attempts differ from its plugin's mock."""
        outcomes: dict[str, list[Any]] = {}
        for attempt in self._attempts:
            outcomes.setdefault(attempt.operation, []).append(self._outcome(attempt) or "done")
        for operation, found in outcomes.items():
            while found and found[-1] == "done":
                found.pop()
            if found:
                yield {"do": operation, "then": found}

    def _outcome(self, attempt: AttemptHistory) -> Mapping[str, Any]:
        if attempt.accepted is None and attempt.ended is None:
            return {"accepted": "never"}
        begun = attempt.started if attempt.accepted is None else attempt.accepted
        found: dict[str, Any] = {}
        if begun > attempt.started:
            found["accepted"] = duration(begun - attempt.started, self._digits)
        if attempt.answer == "failed":
            found["fail"] = attempt.data["code"]
            if attempt.data.get("detail"):
                found["detail"] = attempt.data["detail"]
        elif attempt.answer == "done":
            result = self._differs(attempt)
            if result:
                found["done"] = result
        else:
            found["never"] = True
            if "result" in attempt.data:
                found["cut_short"] = self._differs(attempt)
        found |= self._timing(attempt, begun)
        if attempt.progress:
            found["progress"] = attempt.progress
        return found

    def _timing(self, attempt: AttemptHistory, begun: float) -> Mapping[str, Any]:
        """Return when an attempt ended, and the effect of its cancel."""
        found: dict[str, Any] = {}
        cancelled = attempt.cancelled is not None and (attempt.ended or begun) >= attempt.cancelled
        if attempt.answer in ("done", "failed") and attempt.ended is not None:
            after = duration(attempt.ended - begun, self._digits)
            if after != duration(self._catalog.operations[attempt.operation].mock.after, self._digits):
                found["after"] = after
            if cancelled:
                found["cancel"] = "ignored"
        elif attempt.answer == "cancelled" and attempt.cancelled is not None and attempt.ended is not None:
            if attempt.ended > attempt.cancelled:
                found["cancel"] = duration(attempt.ended - attempt.cancelled, self._digits)
        elif attempt.cancelled is not None:
            found["cancel"] = "unconfirmed"
        return found

    def _differs(self, attempt: AttemptHistory) -> dict[str, Any]:
        """Return the fields of a result that differ from the plugin's mock."""
        mocked = self._catalog.operations[attempt.operation].mock.result
        usual = mocked(attempt.arguments, self._parameters) if callable(mocked) else mocked
        result: Mapping[str, Any] = attempt.data.get("result", {})
        missing = object()
        return {name: value for name, value in result.items() if usual.get(name, missing) != value}


def duration(seconds: float, digits: int) -> str:
    """Return seconds as written in files, rounded to so many digits."""
    return f"{round(seconds, digits):.{digits}f}".rstrip("0").rstrip(".") + " s"


# -- what happened ---------------------------------------------------------------------------------------


class _Happenings:
    """Converts requests, values and events to the scenario's timed entries."""

    def __init__(self, chart: Chart, recording: RunRecord, digits: int, waited: float | None) -> None:
        """Make one; with `waited`, times count from the run's start, less so many seconds."""
        self._chart = chart
        self._waited = waited
        self._catalog = chart.catalog
        self._recording = recording
        self._digits = digits
        self._inputs = {spec.value for spec in chart.inputs.values()}
        self._entries: dict[str, int] = {}
        self._anchor: tuple[str, float] | None = None
        self._origin = recording.steps[0].time
        self._values: dict[str, Mapping[str, Any]] = {}
        self._calendar = calendar_of(recording.parameters.get(TIME_ZONE, UTC))

    def happenings(self, starts: bool) -> list[Mapping[str, Any]]:
        """Return the entries; with `starts` without the first start of a mission."""
        found: list[Mapping[str, Any]] = []
        for step in self._recording.steps:
            event, data = step.event.name, step.event.data
            notable = bool(step.taken or step.entered or step.commands or step.accepted is not None)
            reported = {"value": {data["name"]: data["value"]}} if event == "value" else None
            if reported and data["name"] in self._inputs:
                self._values.pop(data["name"], None)
                self._values[data["name"]] = self._when(step, reported)
            if notable:
                found += self._values.values()
                self._values.clear()
            if event == START and starts:
                starts = False
            else:
                found += self._happened(step)
            self._enter(step)
        return [*found, *self._values.values()]

    def _happened(self, step: Step) -> Iterator[Mapping[str, Any]]:
        """Yield what made a step, where it was a request, a restart, the clock or an event of a plugin."""
        event, data = step.event.name, step.event.data
        if step.accepted is not None:
            yield self._when(step, {"request": self._request(event, data)})
        elif event == RESUMED:
            away = float(data["away"])
            yield self._when(step, {"restart": duration(away, self._digits)}, away)
        elif event == CLOCK:
            yield self._when(step, {"clock": self.clock(step)})
        elif event in self._catalog.events:
            yield self._when(step, {"event": {event: dict(data)} if data else event})

    def _request(self, event: str, data: Mapping[str, Any]) -> Any:
        known = self.request(data) if event == START else dict(data)
        return {event: known} if known else event

    def request(self, data: Mapping[str, Any]) -> dict[str, Any]:
        """Return the fields of a request, without those that each run sets anew."""
        named = (
            {} if data.get("mission_type") in self._chart.missions else {"mission_type": data["mission_type"]}
        )
        rest = {name: value for name, value in data.items() if name not in ("mission_type", "mission_id")}
        return {**named, **rest}

    def clock(self, step: Step) -> str:
        """Return the robot's clock at a step that reports it; else ''."""
        ahead = step.event.data.get("ahead")
        return "" if ahead is None else self._calendar.written(step.time + ahead)

    def _enter(self, step: Step) -> None:
        """Keep the last entered state, as reference of times."""
        for name in step.entered:
            if name:
                self._entries[name] = self._entries.get(name, 0) + 1
                self._anchor = (name, step.time)

    def _when(self, step: Step, what: Mapping[str, Any], before: float = 0.0) -> Mapping[str, Any]:
        """Return an entry at a step, or so many seconds `before`, relative to a state's entry."""
        time = step.time - before
        if self._anchor is None or self._waited is not None:
            return {"at": duration(time - self._origin - (self._waited or 0.0), self._digits), **what}
        name, entered = self._anchor
        found: dict[str, Any] = {"on": short(self._chart, name)}
        if self._entries[name] > 1:
            found["nth"] = self._entries[name]
        if time > entered:
            found["after"] = duration(time - entered, self._digits)
        return {**found, **what}


def short(chart: Chart, name: str) -> str:
    """Return the shortest unique name of a state."""
    parts = name.split(".")
    for count in range(1, len(parts)):
        tail = ".".join(parts[-count:])
        if sum(1 for other in chart.states if is_named(other, tail)) == 1:
            return tail
    return name


# -- the scenario ----------------------------------------------------------------------------------------


def script_of(
    recording: RunRecord, mission: str, promise: str, chart: Chart, digits: int, names_states: bool = True
) -> dict[str, Any]:
    """Return a scenario without expectations.

    Args:
        mission: the mission's name in the scenario.
        promise: its sentence.
        digits: to how many digits times are written.
        names_states: whether times count from the last entered state, or all from the start.
    """
    asked = [step for step in recording.steps if step.event.name == START]
    before = [step for step in recording.steps if step.accepted is not None or step.event.name == "value"]
    starts = bool(asked and asked[0].accepted) and before[0] is asked[0]
    waited = _waited(recording.steps) if starts else 0.0
    happenings = _Happenings(chart, recording, digits, None if names_states else waited)
    parts: dict[str, Any] = {
        "scenario": promise,
        "mission": mission,
        "request": happenings.request(asked[0].event.data) if starts else {},
        "parameters": dict(recording.parameters),
        "seed": recording.seed,
        "clock": happenings.clock(recording.steps[0]),
        "start": "ready" if starts else "never",
        "limit": _limit(recording, chart, digits, waited),
        "mocks": list(_Mocks(chart, recording, digits).mocks()),
        "when": happenings.happenings(starts),
    }
    usual = {"start": "ready", "clock": NEW_YEAR}
    return {name: value for name, value in parts.items() if value and value != usual.get(name)}


def _waited(steps: Sequence[Step]) -> float:
    """Return the seconds between the first start of a mission and the step before it."""
    start = next(index for index, step in enumerate(steps) if step.event.name == START)
    return steps[start].time - steps[max(0, start - 1)].time


def _limit(recording: RunRecord, chart: Chart, digits: int, waited: float) -> str:
    """Return the length of a record that ends within a mission."""
    steps = recording.steps
    if label_of(chart, steps[-1].configuration) in chart.profile.stages.over:
        return ""
    # What happened last must not be cut off by rounding.
    return duration(steps[-1].time - steps[0].time - waited + 10**-digits, digits)


def expectations(run: Run) -> dict[str, Any]:
    """Return the results of a run as a scenario's expectations."""
    entered = [name for _, name in run.history.entered if name]
    leaves = [short(run.chart, name) for name in entered if not run.chart.states[name].children]
    found: dict[str, Any] = {
        "lifecycle": list(run.history.lifecycles),
        "passes": leaves,
        "published": [" ".join(filter(None, (p.target, p.status, p.code))) for _, p in run.history.published],
        "refused": [
            {"request": step.event.name, "code": step.refusal.code}
            for step in run.history.refused
            if step.refusal
        ],
        "counts": dict(Counter(attempt.operation for attempt in run.history.attempts.values())),
        "broken": [name for _, name in run.history.broken],
        "violated": [name for _, name, _ in run.violated if name != INVARIANTS],
    }
    kept = {name: value for name, value in found.items() if value}
    return {**kept, "final": run.view.lifecycle, "last_error": run.view.code}


def difference(recording: RunRecord, run: Run) -> str:
    """Describe the first difference in effects between a run and the record; '' for none."""
    recorded, simulated = _all_facts(recording.steps), _all_facts(run.steps)
    for index in range(max(len(recorded), len(simulated))):
        was = recorded[index] if index < len(recorded) else "nothing more"
        now = simulated[index] if index < len(simulated) else "nothing more"
        if was != now:
            return f"recorded: {was}; simulated: {now}"
    return ""


def _all_facts(steps: Iterable[Step]) -> list[str]:
    return [fact for step in steps for fact in _facts(step)]


def _facts(step: Step) -> Iterator[str]:
    """Yield the effects of a step."""
    yield from (f"entered {name}" for name in step.entered)
    for command in step.commands:
        if isinstance(command, Start):
            yield f"started {command.operation} {json.dumps(command.arguments, sort_keys=True)}"
        elif isinstance(command, Publish):
            yield f"published {command.target} {command.status} {command.code}".rstrip()
    if step.refusal is not None:
        yield f"refused {step.event.name} {step.refusal.code}"


def scenario_text(recording: RunRecord, promise: str, file: Path, missions: Missions) -> str:
    """Return the text of a scenario that runs as recorded and expects the recorded results.

    Args:
        promise: the scenario's sentence.
        file: where it will be; the mission is searched from there.

    Raises:
        UsageError: the mission does not exist, or no scenario runs the same.
        ChartError: all errors of the mission, or of the record's entries.
    """
    return _Maker(recording, promise, file, missions).text()


def as_scenario(recording: RunRecord, mission: Path, missions: Missions) -> Scenario:
    """Return a record as a scenario of a mission's file, without expectations.

    Raises:
        ChartError: all errors of the mission.
        UsageError: all recorded entries that the mission does not have.
    """
    parts = script_of(recording, mission.name, "as it was recorded", missions.chart(mission), _DIGITS[-1])
    beside = mission.parent / "recorded"  # where its names are looked for; there is no such file
    try:
        return load_scenario_text(yaml_text({**parts, "expect": {}}), beside, missions)
    except ChartError as problem:
        about = f"{recording.name} does not fit {near(str(mission))}: "
        raise UsageError("\n".join(about + each.message for each in problem.diagnostics)) from None


def would_differ(recording: RunRecord, mission: Path, missions: Missions) -> str:
    """Describe the first difference of another mission's run in the recorded world; '' for none.

    Raises:
        ChartError: all errors of the mission.
        UsageError: the record is about something that the mission does not have.
    """
    return difference(recording, as_scenario(recording, mission, missions).run())


class _Maker:
    """Tries scenarios until one runs as recorded."""

    def __init__(self, recording: RunRecord, promise: str, file: Path, missions: Missions) -> None:
        self._recording = recording
        self._promise = promise
        self._file = file
        self._missions = missions
        known = Path(recording.file)
        self._mission = known if known.is_file() else missions.file(recording.mission, file)
        self._called = mission_name(self._mission, file, missions)

    def text(self) -> str:
        """Return the scenario with the fewest digits and live values that run the same.

        Raises:
            UsageError: none with all digits runs as recorded; the text has the first difference.
            ChartError: all errors of the mission, or of the scenario that was made.
        """
        digits = next((digits for digits in _DIGITS if not self._differs(self._recording, digits)), None)
        if digits is None:
            differs = self._differs(self._recording, _DIGITS[-1])
            raise UsageError(f"the scenario does not come out as it was recorded: {differs}")
        kept = self._recording
        for name in kept.values:
            fewer = kept.without(name)
            if not self._differs(fewer, digits):
                kept = fewer
        parts = self._parts(kept, digits)
        return yaml_text({**parts, "expect": expectations(self._run(parts))})

    def _parts(self, recording: RunRecord, digits: int) -> dict[str, Any]:
        chart = self._missions.chart(self._mission)
        return script_of(recording, self._called, self._promise, chart, digits)

    def _run(self, parts: Mapping[str, Any]) -> Run:
        text = yaml_text({**parts, "expect": {}})
        return load_scenario_text(text, self._file, self._missions).run()

    def _differs(self, recording: RunRecord, digits: int) -> str:
        run = self._run(self._parts(recording, digits))
        return difference(self._recording, run) or self._variable_that_differs(run)

    def _variable_that_differs(self, run: Run) -> str:
        """Return which variable differs at the end from the rebuilt machine; '' for none.

        Not checked where the rebuilt machine itself differs from the record.
        """
        chart, recording = run.chart, self._recording
        world = self._missions.world(chart, recording.parameters)
        variables, steps = rebuilt(recording.steps, replace(world, seed=recording.seed))
        if _all_facts(steps) != _all_facts(recording.steps):
            return ""
        for name, was in variables.items():
            now = run.context.get(name)
            if not (contains(now, was) and contains(was, now)):
                return f"recorded: the variable {name} is {was}; simulated: it is {now}"
        return ""
