"""Built-in properties that a file names, because no condition can say them.

    properties:
      good_at_its_target: {built_in: true}

Each judges one step, as those of `built_in` do. Those of the graph as a whole are in `lupin_verify`: they
have such names, too, but no step breaks them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import lru_cache

from lupin_engine.chart.expressions.evaluation import Compiled, Expression
from lupin_engine.chart.model import Chart, Invoke, Kind, State, every_call
from lupin_engine.chart.records import Role, walk
from lupin_engine.machine.event import Start
from lupin_engine.machine.memory import Memory, Traversal, Visit
from lupin_engine.machine.scope import reads_of, traversal_of
from lupin_engine.plugin.contract import OnHold
from lupin_engine.plugin.profile import ANSWER, Publish
from lupin_engine.properties.built_in import (
    COMMANDED,
    HOLDS,
    MOVED,
    NOT_ABOUT,
    REQUESTED,
    Passage,
    Property,
    Remembered,
    Rule,
    Verdict,
    is_under_way,
    of_kinds,
    taken,
)

_found: list[Property] = []


def _named(name: str, says: str, rule: Rule, of: int) -> None:
    def watch(state: Remembered, passage: Passage) -> tuple[Remembered, Verdict]:
        breach = rule(passage)
        return state, NOT_ABOUT if breach is None else Verdict(True, breach)

    asked = of_kinds(of)
    _found.append(Property(name, says, watch, remembers=False, of_values=False, is_asked=asked))


# -- where the robot is ----------------------------------------------------------------------------------


def _at_its_target(state: Remembered, passage: Passage) -> tuple[Remembered, Verdict]:
    """Judge good results by the drive before them.

    Remembered is which target of its itinerary the robot is at: one `math.inf` for the first, two for the
    second, and so on; none where it is at no target.
    """
    chart, memory = passage.chart, passage.after
    verdict = NOT_ABOUT
    drives = _drives(chart)
    if not drives:
        return state, verdict
    arrives = False  # the next drive may begin in the same step
    for rule in taken(passage):
        if rule.event == "done" and drives.get(rule.source):
            walk_of, arrives = traversal_of(chart, memory, rule.source), True
            state = () if walk_of is None else (math.inf,) * (walk_of.index + 1)
    for walked, indices, visit in _good_results(passage):
        if any(walked.state in chart.lineage[name] for name in drives):
            verdict = HOLDS
            if not arrives and len(state) - 1 not in indices:
                what = f"{visit.target} is reported as {visit.status}, but no drive to it has succeeded"
                return state, Verdict(True, f"{what}, or the robot has driven elsewhere since")
    drives_on = any(isinstance(each, Start) and each.state in drives for each in passage.step.commands)
    is_over = drives_on or _leaves_itinerary(passage) or _has_result(passage, len(state) - 1)
    return () if is_over else state, verdict


def _leaves_itinerary(passage: Passage) -> bool:
    return any(passage.chart.states[name].itinerary is not None for name in passage.step.exited)


def _has_result(passage: Passage, index: int) -> bool:
    """Return whether the visit at an index has its result, in an itinerary that is or was active."""
    active = {*passage.after.configuration, *passage.step.exited}
    walks = (walked for name, walked in passage.after.itineraries.items() if index >= 0 and name in active)
    return any(walked.visits[index].closed for walked in walks if index < len(walked.visits))


_found.append(
    Property(
        "good_at_its_target",
        "Where a mission drives to its targets, a target gets a good result only after its drive succeeded.",
        _at_its_target,
        of_values=False,
        about=lambda passage: _is_drive_or_good(passage),
        is_asked=of_kinds(COMMANDED | MOVED),
    )
)


def _is_drive_or_good(passage: Passage) -> bool:
    """Return whether a drive begins or ends well in a step, or a target gets a good result."""
    drives = _drives(passage.chart)
    return bool(drives) and (
        any(isinstance(each, Start) and each.state in drives for each in passage.step.commands)
        or any(rule.event == "done" and rule.source in drives for rule in taken(passage))
        or any(isinstance(each, Publish) for each in passage.step.commands)
        or _leaves_itinerary(passage)
    )


def _good_after_success(passage: Passage) -> str | None:
    good = [visit for _, _, visit in _good_results(passage)]
    if not good:
        return None
    for rule in taken(passage):
        if rule.event == "error":
            return f"{good[0].target} is reported as {good[0].status} because {rule.source} failed"
    return ""


_named(
    "good_after_success",
    "The failure of an operation gives no target a good result.",
    _good_after_success,
    COMMANDED,
)


def _good_results(passage: Passage) -> Iterator[tuple[Traversal, list[int], Visit]]:
    """Yield the visits that get a good result in a step, with their indices: a target may be named twice."""
    for command in passage.step.commands:
        outcome = passage.chart.profile.outcome(command.status) if isinstance(command, Publish) else None
        if outcome is None or not outcome.is_good:
            continue
        assert isinstance(command, Publish)
        what = command.target, command.status
        for walked in passage.after.itineraries.values():
            visits = enumerate(walked.visits if walked.begun else ())
            found = [index for index, visit in visits if (visit.target, visit.status) == what]
            if found:
                yield walked, found, walked.visits[found[0]]


# -- what belongs to a visit -----------------------------------------------------------------------------


def _nothing_after_close(passage: Passage) -> str | None:
    chart, memory, step = passage.chart, passage.after, passage.step
    about, begun = _about_targets(chart), {}
    if step.event.name != f"operator.{chart.profile.resume}":  # it may stand there once more
        starts = (each for each in step.commands if isinstance(each, Start) and each.state in about)
        begun = {each.state: each.operation for each in starts if each.state in step.entered}
    if any(isinstance(each, Publish) for each in step.commands):
        begun.update(_under_way(memory, about))
    for name, operation in begun.items():
        walked = traversal_of(chart, memory, name)
        if walked is not None and walked.visit is not None and walked.visit.closed:
            return f"{operation} is under way in {name} for {walked.visit.target}, which has its result"
    return "" if begun else None


def _under_way(memory: Memory, states: Mapping[str, object]) -> dict[str, str]:
    found = {}
    for one in memory.invocations.values():
        attempt = memory.attempts.get(one.attempt or "") if one.state in states else None
        if attempt is not None and is_under_way(attempt):
            found[one.state] = attempt.operation
    return found


_named(
    "nothing_after_close",
    "Once a target has its result, nothing begins or goes on that was for it.",
    _nothing_after_close,
    COMMANDED,
)


def _no_second_round(passage: Passage) -> str | None:
    memory, step = passage.after, passage.step
    before = passage.before.unfinished if step.entered and memory.itineraries else ()
    published = sum(isinstance(command, Publish) for command in step.commands)
    for name, rounds, left in before if passage.before.mission_id == memory.mission_id else ():
        walked = memory.itineraries.get(name)
        if name in step.entered and walked is not None and walked.before > rounds and published < left:
            return f"the itinerary of {name} begins anew, though it has targets without a result"
    return "" if before else None


_named(
    "no_second_round",
    "An itinerary does not begin anew while targets of it have no result.",
    _no_second_round,
    MOVED,
)


# -- what people say -------------------------------------------------------------------------------------


def _resume_goes_on(passage: Passage) -> str | None:
    chart, step = passage.chart, passage.step
    resume = f"operator.{chart.profile.resume}"
    if step.event.name != resume or not step.accepted:
        return None
    if not any(chart.states[name].paused for name in passage.before.configuration):
        return None
    back = [
        name for history, names in passage.before.history for name in names if _is_of_slot(chart, history)
    ]
    left = [name for name in back if name not in step.entered]
    if left:
        return f"{left[0]} was left, and the resume does not lead back there"
    open_before = {name for name, *_ in passage.before.unfinished}
    for above, name in zip(step.entered, step.entered[1:], strict=False):
        if (
            above in open_before
            and chart.states[name].kind is Kind.FINAL
            and chart.states[name].parent == above
        ):
            return f"the resume ends {above} at once, though targets of it have no result"
    return "" if back else None


def _is_of_slot(chart: Chart, history: str) -> bool:
    parent = chart.states[history].parent if history in chart.states else history
    return parent is not None and chart.states[parent].slot


_named(
    "resume_goes_on",
    "A mission that waits away from its work goes on where it was when it is resumed.",
    _resume_goes_on,
    REQUESTED,
)


def _answers_lead_on(passage: Passage) -> str | None:
    step = passage.step
    if not step.event.name.startswith(ANSWER) or not step.accepted:
        return None
    for name in passage.after.asked:
        ask = passage.chart.states[name].ask
        if name in passage.before.asked and ask and step.event.name.removeprefix(ANSWER) in ask.choices:
            return f"{step.event.name} is accepted, and the same question is asked again in {name}"
    return ""


_named(
    "answers_lead_on",
    "Whoever answers a question is not asked the same again at once.",
    _answers_lead_on,
    REQUESTED,
)

# -- what comes before something else --------------------------------------------------------------------


def bypassed(passage: Passage) -> list[str]:
    """Return the operations whose success leads to a state that was entered without it, from elsewhere.

    A state's own successors may lead back to it, and so may a history.
    """
    chart, led = passage.chart, _led_to(passage.chart)
    entered = [name for name in passage.step.entered if name in led]
    ways = list(taken(passage)) if entered else []
    if any(way.target is not None and chart.states[way.target].kind is Kind.HISTORY for way in ways):
        return []
    found = set[str]()
    for name in entered:
        leads, after = led[name], _after(chart, name)
        into = [way for way in ways if way.target is not None and _is_on_way(chart, way.target, name)]
        if not any(way.source in after or (way.event == "done" and way.source in leads) for way in into):
            found.update(leads.values())
    return sorted(found)


def _is_on_way(chart: Chart, target: str, name: str) -> bool:
    return name in chart.lineage[target] or target in chart.lineage[name]


@lru_cache(maxsize=32)
def _led_to(chart: Chart) -> Mapping[str, Mapping[str, str]]:
    """Return the states to which a success leads: the states that run the operation, each with its name."""
    found: dict[str, dict[str, str]] = {}
    for state in chart.states.values():
        for way in state.transitions if state.invoke is not None and state.mission else ():
            if way.event == "done" and way.target and chart.states[way.target].kind is not Kind.FINAL:
                assert state.invoke is not None
                found.setdefault(way.target, {})[state.name] = state.invoke.name
    return found


@lru_cache(maxsize=256)
def _after(chart: Chart, name: str) -> frozenset[str]:
    """Return what a mission can come to from a state, guards left out, and the states around that."""
    states, mission = chart.states, chart.states[name].mission
    found, waiting = set[str](), [name]
    while waiting:
        entered = waiting.pop()
        inside = [each for each in states if entered in chart.lineage[each]]
        new = {*inside, *chart.lineage[entered]} - found
        new = {each for each in new if states[each].mission == mission}
        found |= new
        waiting += [way.target for each in new for way in states[each].transitions if way.target is not None]
    return frozenset(found)


#: Those that are watched in each step, by name.
INHERITED: Mapping[str, Property] = {one.name: one for one in _found}


# -- what is asked of a chart ----------------------------------------------------------------------------


@lru_cache(maxsize=32)
def _drives(chart: Chart) -> Mapping[str, bool]:
    """Return the states that drive to a pose, each with whether that follows from the current target."""
    found = {}
    for name, state in chart.states.items():
        invoke = state.invoke
        if invoke is not None and invoke.operation.on_hold is OnHold.CANCEL and _takes_pose(invoke):
            found[name] = _names_target(chart, invoke)
    return found if any(state.itinerary for state in chart.states.values()) else {}


def _takes_pose(invoke: Invoke) -> bool:
    return any(argument.type.name == "pose" for argument in invoke.operation.arguments.values())


@lru_cache(maxsize=32)
def _about_targets(chart: Chart) -> Mapping[str, State]:
    """Return the states whose operation is about the current target."""
    with_invoke = ((name, state) for name, state in chart.states.items() if state.invoke is not None)
    return {name: state for name, state in with_invoke if state.invoke and _names_target(chart, state.invoke)}


def _names_target(chart: Chart, invoke: Invoke) -> bool:
    """Return whether an argument is computed from the current target, or from a variable that is."""
    reads = {one for value in invoke.arguments.values() for one in _roots(value)}
    kept = _kept(chart)
    return any(root == "target" or (root == "context" and name in kept) for root, name in reads)


@lru_cache(maxsize=32)
def _kept(chart: Chart) -> frozenset[str]:
    """Return the variables that something sets from the current target."""
    said = (one.value for state in chart.states.values() for one in walk(state, frozenset({Role.ACTIONS})))
    stored = (call for actions in said for call in every_call(actions) if call.name == "set")
    each = ((name, _roots(value)) for call in stored for name, value in call.arguments.items())
    return frozenset(name for name, roots in each if any(root == "target" for root, _ in roots))


def _roots(value: object) -> tuple[tuple[str, str], ...]:
    if not isinstance(value, Expression) or not isinstance(value.evaluate, Compiled):
        return ()
    return reads_of(value.evaluate.code)
