"""Requests: resolved as a whole before anything changes. Dry runs say which are available, and why not.

A request is refused for the first of these that applies:

1. an answer to a question that is not open, or that has no such choice;
2. a refusal of the chart, or a hold that blocks the transition that listens to it; else a hold's own guard;
3. it would resume the robot while a motion operation refuses to end; the way home stays open;
4. it starts a mission: an invariant is broken, or the mission's request or parameters are wrong;
5. it would change nothing.

A refused request changes nothing, not even a hold.
"""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import PurePath
from typing import Any, cast

from lupin_engine.chart.expressions.evaluation import Constant, Environment, UnknownValue
from lupin_engine.chart.expressions.evaluation import Value as Written
from lupin_engine.chart.expressions.names import names_read
from lupin_engine.chart.model import Field, Invariant, Mission, Prompt, Transition, UsedMission
from lupin_engine.chart.semantics import ENGINE_EVENTS
from lupin_engine.errors import guessed, nearest, reason, shortened
from lupin_engine.machine.event import NO_TRIGGER, Event, Trigger
from lupin_engine.machine.holds import Holds, all_holds, blocking_hold, released_by
from lupin_engine.machine.memory import Attempt
from lupin_engine.machine.scope import EvaluationScope, World
from lupin_engine.machine.step import Considered, Macrostep, Refusal, moment_of
from lupin_engine.machine.structure import Configuration, Structure
from lupin_engine.machine.timers import seconds
from lupin_engine.plugin.builtin import DEFAULT_MAX_TARGETS, MAX_TARGETS
from lupin_engine.plugin.contract import DIVERT_CODE, INVARIANT_CODE, REFUSED_CODE, OnHold, classify
from lupin_engine.plugin.describe import number_text, value_text
from lupin_engine.plugin.profile import ANSWER
from lupin_engine.plugin.types import ANY, Type, convert, converted, fitted, innermost, problems

#: The code of a request that nothing answers here.
NOT_POSSIBLE = "not_possible"
UNKNOWN_MISSION = "unknown_mission"
BAD_REQUEST = "bad_request"
#: Wrong elements of a list that are named.
MAX_PROBLEMS = 5
#: How eventless transitions are called where an event's name is expected.
ALWAYS = "always"
#: What transitions on an answer see as the event.
BY_OPERATOR, BY_DEFAULT = {"by": "operator"}, {"by": "default"}


@dataclass(slots=True)
class Resolution:
    """The effects of a request: transitions, holds, the request's values; or its refusal.

    `trigger` is the event for its transitions; `releases` are the holds that it or one of them releases,
    engaged or not.
    """

    trigger: Trigger
    rules: tuple[Transition, ...] = ()
    engages: tuple[str, ...] = ()
    releases: tuple[str, ...] = ()
    starts: bool = False
    values: dict[str, Any] = field(default_factory=dict)
    refusal: Refusal | None = None


class Requests:
    """Resolves the requests of one machine without changing anything."""

    __slots__ = ("_holds", "_resume", "_scope", "_structure", "questions")

    def __init__(self, scope: EvaluationScope, holds: Holds, structure: Structure) -> None:
        self._scope = scope
        self._holds = holds
        self._structure = structure
        self._resume = f"operator.{scope.chart.profile.resume}"
        self.questions = Questions(scope)

    def _refused(self, event: Event, resumes: bool, starts: bool) -> Refusal | None:
        """Return why a request with effects is refused, None where it is not.

        The reasons, in order: a motion that refuses to end, if the request `resumes`; a broken invariant, if
        it `starts` a mission.
        """
        broken = self._broken() if starts else None
        going = self._goes_on() if resumes else None
        if going is not None:
            return Refusal(REFUSED_CODE, f"{_verb(event)} refused: {going.detail}")
        if broken is None:
            return None
        text = f"{_verb(event)} refused: the invariant {broken.name} does not hold: "
        return Refusal(INVARIANT_CODE, text + (broken.summary or broken.that.source))

    def resolve(
        self, event: Event, active: Configuration, step: Macrostep, skip_fields: bool = False
    ) -> Resolution:
        """Return the effects of a request here; with `skip_fields` a mission's request is not checked."""
        is_answer = event.name.startswith(ANSWER)
        found = Resolution(Trigger(event=BY_OPERATOR if is_answer else event.data))
        found.refusal = self.questions.refusal(event) if is_answer else None
        if found.refusal is not None:
            return found
        holds = self._holds.asked(event, step)
        found.rules, refusing = self._transitions(event.name, found.trigger, active, holds.releases, step)
        released = [hold for rule in found.rules for hold in released_by(rule)]
        found.engages = tuple(holds.engages)
        found.releases = (*holds.releases, *released)
        targets = (self._scope.chart.states[rule.target] for rule in found.rules if rule.target is not None)
        found.starts = any(target.slot for target in targets)
        resumes = event.name == self._resume or self._scope.memory.is_any_engaged(holds.releases)
        if refusing is not None or holds.refused:
            found.refusal = self._refusal(event, refusing or holds.refused, found.trigger, step)
            return found
        found.refusal = self._refused(event, resumes, found.starts)
        if found.refusal is None and found.starts and not skip_fields:
            env = self._scope.see("", step, found.trigger)
            found.values, found.refusal = read_request(self._scope.world, event.data, env)
        changes = found.rules or found.engages or self._scope.memory.is_any_engaged(found.releases)
        if found.refusal is None and not changes:
            found.refusal = self._impossible(event)
        return found

    def _goes_on(self) -> Attempt | None:
        """Return the attempt of a motion operation that refuses to end; None where there is none."""
        memory, known = self._scope.memory, self._scope.chart.catalog.operations
        for claim in memory.claims:
            if claim.refused:
                attempt = memory.attempts[claim.attempt]
                operation = known.get(attempt.operation)
                if operation is None or operation.on_hold is OnHold.CANCEL:
                    return attempt
        return None

    def _broken(self) -> Invariant | None:
        """Return an invariant that does not hold and reads no variable that begins anew; None without one."""
        chart = self._scope.chart
        anew = {name for name, variable in chart.context.items() if variable.of_mission}
        broken = (chart.invariants[name] for name in self._scope.memory.broken)
        return next((one for one in broken if anew.isdisjoint(names_read(one.that.source))), None)

    def _transitions(
        self, name: str, trigger: Trigger, active: Configuration, released: Sequence[str], step: Macrostep
    ) -> tuple[tuple[Transition, ...], Transition | str | None]:
        """Return the transitions that answer a request; or none, and what refuses: the first, or a code."""
        chosen = []
        for offered in active.candidates(name):
            for rule in self._scope.enabled((offered,), step, trigger):
                hold = blocking_hold(rule, self._scope.memory, released)
                if rule.refuse is not None:
                    return (), rule
                if hold is not None:
                    return (), all_holds(self._scope.chart)[hold].code
                chosen.append(rule)
        return self._structure.without_conflicts(active.states, chosen), None

    def _refusal(self, event: Event, by: Transition | str, trigger: Trigger, step: Macrostep) -> Refusal:
        """Return the refusal by a transition, or with the code of a hold."""
        value, code = (None, by) if isinstance(by, str) else (by.value, by.refuse or "")
        state = "" if isinstance(by, str) else by.source
        label = classify(code, self._scope.chart.codes).label
        named = "" if value is None else _named(value, self._scope.see(state, step, trigger))
        return Refusal(code, f"{_verb(event)} refused: {label}{named}")

    def _impossible(self, event: Event) -> Refusal:
        """Say where a request would be possible, from the chart."""
        chart = self._scope.chart
        here = moment_of(chart, self._scope.memory)
        where = {
            "a running mission" if state.slot else state.label or state.local_name
            for state in chart.states.values()
            if any(rule.refuse is None for rule in self._structure.rules_of(state.name, event.name))
        } - {here.lifecycle}
        text = f"{_verb(event)} is not possible in {f'{here.lifecycle} {here.phase}'.strip() or 'this state'}"
        resumes = any(event.name in hold.release for hold in chart.holds.values())
        if resumes and event.name != "mission.start":
            text += " because nothing is paused"
        elif where:
            text += "; it is possible in " + " or ".join(sorted(where))
        return Refusal(NOT_POSSIBLE, text)


class Questions:
    """The questions to the operator: each is open until it is answered or its state is left."""

    __slots__ = ("_scope",)

    def __init__(self, scope: EvaluationScope) -> None:
        self._scope = scope

    def ask(self, state: str, ask: Prompt, trigger: Trigger, step: Macrostep) -> None:
        """Ask the question of a state that is entered."""
        env = self._scope.see(state, step, trigger)
        try:
            question, delay = str(ask.question.evaluate(env)), seconds(ask.after.evaluate(env))
        except Exception as problem:
            step.fail(state, f"{ask.place}: ask: {reason(problem)}")
            return
        step.note(f"asks: {question}")
        self._scope.memory.asked[state] = question
        self._scope.timers.arm("ask", state, step.now, delay, ask.timer.event)

    def close(self, state: str) -> None:
        """Forget the question of a state that is left, or that was answered."""
        self._scope.memory.asked.pop(state, None)
        self._scope.timers.disarm("ask", state)

    def answered(self, event: Event) -> None:
        """Close the questions that an answer is for."""
        for state in self._open(event):
            self.close(state)

    def refusal(self, event: Event) -> Refusal | None:
        """Say why a request is no answer to an open question; None where it is."""
        if self._open(event):
            return None
        asks = [self._scope.chart.states[state].ask for state in self._scope.memory.asked]
        allowed = [name for ask in asks if ask is not None for name in ask.choices]
        if not allowed:
            return Refusal(NOT_POSSIBLE, f"the answer {_verb(event)!r} is refused: nothing is asked")
        hint = nearest(_verb(event), allowed)
        return Refusal(NOT_POSSIBLE, f"the answer {_verb(event)!r} is refused: it is no choice; {hint}")

    def _open(self, event: Event) -> list[str]:
        """Return the states whose questions an event answers."""
        name, states = event.name.removeprefix(ANSWER), self._scope.chart.states
        asks = [(state, states[state].ask) for state in self._scope.memory.asked]
        return [state for state, ask in asks if ask is not None and name in ask.choices]


def _verb(event: Event) -> str:
    return event.name.rpartition(".")[2]


def consider(
    scope: EvaluationScope, rule: Transition, step: Macrostep, trigger: Trigger = NO_TRIGGER
) -> Considered:
    """Return why a transition cannot be taken: guard and hold, empty where it can."""
    blocking, guard = blocking_hold(rule, scope.memory) or "", rule.guard
    value, problem = _value(scope, guard.evaluate, rule, step, trigger)
    if value and not problem:
        return Considered(rule.id, rule.place, guard.source, holds=True, held=blocking)
    values = [(text, _value(scope, part, rule, step, trigger)) for text, part in guard.operands]
    shown = tuple((text, problem or value) for text, (value, problem) in values)
    return Considered(rule.id, rule.place, guard.source, holds=False, held=blocking, parts=shown)


def _value(
    scope: EvaluationScope, part: Any, rule: Transition, step: Macrostep, trigger: Trigger
) -> tuple[object, str]:
    """Return the value of a part of a guard, and the problem if it cannot be evaluated."""
    try:
        return part(scope.see(rule.source, step, trigger)), ""
    except UnknownValue as unknown:
        return None, str(unknown)
    except Exception as problem:
        return None, f"an error: {reason(problem)}"


def read_request(
    world: World, data: Mapping[str, Any], env: Environment
) -> tuple[dict[str, Any], Refusal | None]:
    """Return the mission's request values and None, or {} and the first reason to refuse.

    Args:
        world: gives the missions and the readers of plugin types.
        data: the event's fields; `mission_type` names the mission, a field that is absent means its default.
        env: the environment of defaults.
    """
    mission = world.chart.missions.get(data.get("mission_type", ""))
    if mission is None and "mission_type" not in data:
        return {}, Refusal(UNKNOWN_MISSION, "it names no mission to begin")
    if mission is None:
        return {}, _unknown_mission(world, shortened(data.get("mission_type", "")))
    missing = ", ".join(map(described, lacking(mission, data)))
    if missing:
        return {}, Refusal(BAD_REQUEST, f"{mission.name} needs {missing}")
    values: dict[str, Any] = {}
    for asked in mission.request.values():
        value, refusal = _read_field(world, asked, data.get(asked.name), env)
        if refusal is not None:
            return {}, refusal
        values[asked.name] = value
    refusal = _refused_by(
        mission.request, values, world, ChainMap({"request": values}, cast("dict[str, Any]", env))
    )
    return ({}, refusal) if refusal else (values, None)


def _refused_by(
    fields: Mapping[str, Field], values: Mapping[str, Any], world: World, env: Environment
) -> Refusal | None:
    """Return the first refusal of the values of a request that `env` has; None where they are accepted.

    A condition that reads an unknown value is false, as everywhere.
    """
    for asked, one in [(each, one) for each in fields.values() for one in each.refusals]:
        try:
            if not one.guard.evaluate(env):
                continue
        except UnknownValue:
            continue
        except Exception as problem:
            return Refusal(BAD_REQUEST, f"{one.place}: {asked.name}: {reason(problem)}")
        about = Constant(values[asked.name], one.place, asked.type) if one.value is None else one.value
        return Refusal(one.code, world.chart.codes[one.code].label + _named(about, env))
    return None


def _named(value: Written, env: Environment) -> str:
    """Return the value of a refusal as the end of its sentence; '' where it cannot be evaluated."""
    try:
        found = value.evaluate(env)
    except Exception:  # it is not known, as in a dry run without the event's fields
        return ""
    several, kind = (found, value.type.item) if isinstance(found, list) else ([found], value.type)
    texts = [_shown(one, kind or ANY) for one in several[:MAX_PROBLEMS]]
    more = f" and {len(several) - MAX_PROBLEMS} more" if len(several) > MAX_PROBLEMS else ""
    return f": {', '.join(texts)}{more}" if texts else ""


def _shown(value: Any, kind: Type) -> str:
    """Return a value as a sentence names it: a text in quotes, a target by its name, a number in its unit."""
    if isinstance(value, Mapping) and "id" in value:
        value = value["id"]
    if isinstance(value, str):
        return repr(shortened(value))
    is_number = kind.kind == "number" and isinstance(value, (int, float))
    return " ".join(filter(None, number_text(value, kind.unit))) if is_number else value_text(value, kind)


def lacking(mission: Mission, given: Mapping[str, Any]) -> list[Field]:
    """Return the fields that a request must have, and that are not given."""
    return [one for one in mission.request.values() if one.default is None and given.get(one.name) is None]


def described(field: Field) -> str:
    """Return the name of a request's field, with its type and summary."""
    return f"{field.name} ({field.type}{f': {field.summary}' if field.summary else ''})"


def _unknown_mission(world: World, name: str) -> Refusal:
    """Return the refusal of a name that no mission has, with the nearest name of a mission or its file."""
    missions = world.chart.missions
    called = {PurePath(mission.file).stem: mission.name for mission in missions.values()}
    called.update({mission: mission for mission in missions})
    guess = called.get(guessed(name, called))
    hint = f"did you mean {guess!r}?" if guess else nearest(name, missions)
    return Refusal(UNKNOWN_MISSION, f"unknown mission {name!r}; {hint}")


def read_given(world: World, state: str, use: UsedMission, env: Environment) -> dict[str, Any]:
    """Return the request of a mission that `state` uses as a part.

    Raises:
        ValueError: a value is none that the mission would accept; the text has its place.
    """
    values = {}
    for asked in use.request.values():
        value, refusal = _read_field(world, asked, None, env)
        if refusal is not None:
            text = refusal.text.removeprefix(f"{asked.place}: ")
            raise ValueError(f"{asked.place}: use {use.mission}: {text}")
        values[asked.name] = value
    given = ChainMap({"given": {**env["given"], state: values}}, cast("dict[str, Any]", env))
    refusal = _refused_by(use.request, values, world, given)
    if refusal is not None:
        raise ValueError(f"{use.place}: use {use.mission}: {refusal.text}")
    return values


def _read_field(world: World, field: Field, given: Any, env: Environment) -> tuple[Any, Refusal | None]:
    too_many = _too_many(world, field, given)
    if too_many:
        return None, too_many
    try:
        value = (
            field.default.evaluate(env)
            if given is None and field.default
            else _read(world, field.type, given, field.name)
        )
    except ValueError as problem:
        return None, Refusal(_code_of(world, field.type), str(problem))
    except Exception as problem:
        # A default that cannot be computed, or data of a shape no reader expects: nothing has changed yet.
        return None, Refusal(BAD_REQUEST, f"{field.place}: {field.name}: {reason(problem)}")
    try:
        value = fitted(value, field.type)
    except ValueError as problem:
        return None, Refusal(BAD_REQUEST, f"{field.name} is {problem}")
    too_many = _too_many(world, field, value)
    if too_many:
        return None, too_many
    if field.not_empty is not None and not value:
        return None, Refusal(field.not_empty, world.chart.codes[field.not_empty].label)
    if field.minimum is not None and value < field.minimum:
        return None, Refusal(BAD_REQUEST, f"{field.name} must be at least {field.minimum:g}, got {value!r}")
    return value, None


def _too_many(world: World, field: Field, value: Any) -> Refusal | None:
    """Return the refusal of a list that is too long, else None; the elements are checked after it."""
    most = world.parameters.get(MAX_TARGETS, DEFAULT_MAX_TARGETS)
    if not isinstance(value, list) or len(value) <= most:
        return None
    text = f"{field.name} has {len(value)} elements; at most {most} are taken (parameter {MAX_TARGETS})"
    return Refusal(BAD_REQUEST, text)


def _read(world: World, wanted: Type, given: Any, name: str) -> Any:
    inner = innermost(wanted)
    if inner.kind == "record" and inner.name not in world.readers:
        found = [problem.at(name) for problem in problems(given, wanted)]
        if found:
            raise ValueError(_together(found))
        return converted(given, wanted)
    if wanted.kind == "list" and wanted.item is not None and isinstance(given, list):
        return _read_list(world, wanted.item, given, name)
    if wanted.name in world.readers:
        return world.readers[wanted.name](given)
    return convert(given, wanted)


def _read_list(world: World, item: Type, given: list[Any], name: str) -> list[Any]:
    """Read every element; ValueError with the texts of all wrong ones."""
    values, wrong = [], []
    for element in given:
        try:
            values.append(_read(world, item, element, name))
        except ValueError as problem:
            wrong.append(str(problem))
    if wrong:
        raise ValueError(_together(wrong))
    return values


def _together(problems: list[str]) -> str:
    """Join problems; a common ending ("...; allowed: ...") is written once."""
    left_out = f" and {len(problems) - MAX_PROBLEMS} more" if len(problems) > MAX_PROBLEMS else ""
    problems = problems[:MAX_PROBLEMS]
    parts = [problem.partition("; ") for problem in problems]
    allowed = {tail for _, _, tail in parts}
    if len(allowed) > 1:
        return "; ".join(problems) + left_out
    return "; ".join(filter(None, (", ".join(head for head, _, _ in parts) + left_out, *allowed)))


def _code_of(world: World, wanted: Type) -> str:
    """Return the code that a wrong value of this type is refused with."""
    name = wanted.item.name if wanted.item is not None else wanted.name
    return f"unknown_{name}" if f"unknown_{name}" in world.chart.codes else BAD_REQUEST


@dataclass(frozen=True)
class Possibility:
    """The dry run of an event: its effects if it came now.

    For the level of an input, `level` says whether it is true. `taken` are the transitions that the event
    would take, `engages` and `releases` the holds. `refusal` says why a request would be refused.
    `considered` are the transitions that listen to the event, each with the reason against it. `waits` says
    that a divert waits until the states are left that are finished first.
    """

    event: str
    possible: bool
    taken: tuple[str, ...] = ()
    engages: tuple[str, ...] = ()
    releases: tuple[str, ...] = ()
    refusal: Refusal | None = None
    considered: tuple[Considered, ...] = ()
    level: bool | None = None
    waits: str = ""

    def __str__(self) -> str:
        if self.refusal is not None:
            return f"{self.event}: {self.refusal.text}"
        if self.level is False and self.considered:
            return f"{self.event}: it is not true now"
        if not self.possible:
            return f"{self.event}: " + ("; ".join(map(str, self.considered)) or "nobody listens to it here")
        holds = [f"engages {name}" for name in self.engages] + [f"releases {name}" for name in self.releases]
        return f"{self.event}: {', '.join(filter(None, (*self.taken, *holds, self.waits)))}"


class Explainer:
    """Dry-runs events of one machine in one configuration; changes nothing."""

    __slots__ = ("_active", "_requests", "_scope", "_structure")

    def __init__(
        self, scope: EvaluationScope, requests: Requests, structure: Structure, active: Configuration
    ) -> None:
        self._scope = scope
        self._requests = requests
        self._structure = structure
        self._active = active

    def explain(self, now: float) -> tuple[Possibility, ...]:
        """Dry-run every request and every event of the chart at time `now`.

        Requests come first, then the other events by name, with `always` for transitions without one; ends of
        operations and timers are left out. Fields of a mission's request are not checked, and a guard that
        reads the event's data sees none.
        """
        requests = (*self._scope.chart.profile.events, *self._scope.chart.answers)
        others = [n for n in (*self._structure.events, "") if n not in requests and not _is_internal(n)]
        found = [self._request(name, now) for name in requests] + [self._event(name, now) for name in others]
        return tuple(one for one in found if one.considered or one.event != ALWAYS)

    def one(self, event: str, now: float) -> Possibility:
        """Dry-run one request or event, as `explain` does with all."""
        chart = self._scope.chart
        is_request = event in chart.profile.events or event in chart.answers
        return self._request(event, now) if is_request else self._event(event, now)

    def considered(self, event: str, now: float, trigger: Trigger = NO_TRIGGER) -> tuple[Considered, ...]:
        """Return the transitions that listen to an event here, each with the reason against it."""
        step = Macrostep(Event(event), now)
        offered = self._active.candidates(event)
        rules = {rule.id: rule for some in offered for rule in some}
        return tuple(consider(self._scope, rule, step, trigger) for rule in rules.values())

    def request(self, event: Event, now: float, skip_fields: bool = False) -> Possibility:
        """Dry-run a request at time `now`; with `skip_fields` its fields are not checked."""
        step = Macrostep(event, now)
        found = self._requests.resolve(event, self._active, step, skip_fields)
        if found.refusal is not None:
            return Possibility(event.name, possible=False, refusal=found.refusal)
        taken = tuple(rule.id for rule in found.rules)
        releases = tuple(hold for hold in self._scope.memory.held if hold in found.releases)
        is_put_off = any(rule.code == DIVERT_CODE for rule in found.rules)
        waits = classify(DIVERT_CODE, self._scope.chart.codes).label if is_put_off else ""
        return Possibility(event.name, True, taken, found.engages, releases, waits=waits)

    def _request(self, name: str, now: float) -> Possibility:
        found = self.request(Event(name), now, skip_fields=True)
        return replace(found, considered=self.considered(name, now))

    def _event(self, name: str, now: float) -> Possibility:
        found = self.considered(name, now)
        ready = {one.transition for one in found if one.holds and not one.held}
        first = [
            next((rule.id for rule in offered if rule.id in ready), "")
            for offered in self._active.candidates(name)
        ]
        level = self._level(name, now) if name.startswith("input.") else None
        taken = () if level is False else tuple(dict.fromkeys(filter(None, first)))
        return Possibility(name or ALWAYS, bool(taken), taken, considered=found, level=level)

    def _level(self, name: str, now: float) -> bool:
        self._scope.inputs.now = now
        return self._scope.inputs.holds(name)


def _is_internal(event: str) -> bool:
    return event.partition(".")[0] in ENGINE_EVENTS
