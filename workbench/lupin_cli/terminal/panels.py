"""Formats the state of a simulation between two steps as lines for a terminal."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from lupin_engine.chart import Chart, Transition
from lupin_engine.machine import Considered, Possibility, View
from lupin_engine.replay import TonedLine
from lupin_engine.sim import Simulation, short_name, shorten

_LABEL = 14
_EVENT = 22


def labelled(label: str, text: str, tone: str = "", width: int = _LABEL) -> TonedLine:
    """Return a line that begins with a label."""
    return [(f"  {label:<{width}}  ", "label"), (text, tone)]


# -- what is possible -------------------------------------------------------------------------------------


def possibilities(chart: Chart, found: Iterable[Possibility]) -> list[TonedLine]:
    """Return the available events as lines, then the others with the reasons."""
    each = list(found)
    ready = [_what(chart, one) for one in each if one.possible]
    others = [labelled(one.event, _why_not(one), "dim", _EVENT) for one in each if not one.possible]
    nothing: list[TonedLine] = [[("  nothing", "")]]
    return [[("possible now", "label")], *(ready or nothing), [("not possible", "label")], *others]


def possibility(chart: Chart, found: Possibility) -> list[TonedLine]:
    """Return the dry run of one event as lines, with every transition that listens to it."""
    others = [one for one in found.considered if not found.possible or one.transition not in found.taken]
    if found.possible:
        first = _what(chart, found)
    else:  # the reasons stand behind the transitions
        text = found.refusal.text if found.refusal else "not possible now" if others else _why_not(found)
        first = labelled(found.event, text, "", _EVENT)
    each = (f"    {_leads_to(chart, one.transition)}: {_reason(found, one)}" for one in others)
    return [first, *([(text, "dim")] for text in each)]


def _what(chart: Chart, found: Possibility) -> TonedLine:
    """Return the effects of an event as a line."""
    text = [f"engages {name}" for name in found.engages] + [f"releases {name}" for name in found.releases]
    text += [_leads_to(chart, rule) for rule in found.taken]
    text += [found.waits] if found.waits else []
    return labelled(found.event, ", ".join(text), "state", _EVENT)


def _why_not(found: Possibility) -> str:
    if found.refusal is not None:
        return found.refusal.text
    reasons = dict.fromkeys(_reason(found, one) for one in found.considered)
    return "; ".join(reasons) or "nobody listens to it here"


def _reason(found: Possibility, one: Considered) -> str:
    """Return why a transition would not be taken."""
    otherwise = f"{found.event} is false" if found.event.startswith("input.") else "can be taken"
    return one.reason(shorten) or otherwise


def _leads_to(chart: Chart, rule: str) -> str:
    """Return where a transition leads and where it is written."""
    transition = next((found for found in _transitions(chart) if found.id == rule), None)
    if transition is None:
        return "-> FAULT"  # the chart's own answer to an error
    where = "stays"
    if transition.refuse is not None:
        where = f"refused as {transition.refuse}"
    elif transition.target:
        where = f"-> {short_name(chart, transition.target)}"
    return f"{where} ({chart.file_of(transition.place)}:{transition.place.line})"


def _transitions(chart: Chart) -> Iterator[Transition]:
    for state in chart.states.values():
        yield from state.transitions


# -- what is ----------------------------------------------------------------------------------------------


def where(chart: Chart, view: View) -> list[TonedLine]:
    """Return the configuration, the mission and the running operations as lines."""
    rows = [labelled("state", short_name(chart, name), "state") for name in _innermost(chart, view)]
    closed = sum(view.counts.values())
    facts = {
        "mission": " ".join(filter(None, (view.mission, view.mission_id))),
        "target": f"{view.target} ({closed} of {view.total} closed)" if view.target else "",
        "held by": ", ".join(view.held),
        "last error": " ".join(filter(None, (view.code, view.detail))),
    }
    rows += [labelled(name, text) for name, text in facts.items() if text]
    for asked in view.asking:
        rows.append(labelled("asked", asked.question))
        rows += [labelled(f"  {choice.name}", choice.label) for choice in asked.choices]
    for attempt in view.attempts:
        tried = f", try {attempt.tries}" if attempt.tries > 1 else ""
        rows.append(labelled("under way", f"{attempt.operation} ({attempt.phase}{tried})", "command"))
    return rows + [labelled("cancelling", operation, "command") for operation in view.cancelling]


def _innermost(chart: Chart, view: View) -> list[str]:
    active = set(view.configuration)
    return [
        name for name in view.configuration if name and not active.intersection(chart.states[name].children)
    ]


def inputs(chart: Chart, simulation: Simulation) -> list[TonedLine]:
    """Return the live values as lines: each value, its time, and the plugin's name for it."""
    machine, now = simulation.machine, simulation.now
    rows = []
    for name, spec in chart.inputs.items():
        kept = machine.memory.inputs.get(name)
        known = kept is not None and machine.input_value(name, now) is not None
        text = shorten(kept.value) if kept is not None and known else "unknown"
        since = f", {now - kept.stamp:.1f} s ago" if kept is not None and kept.reported else ""
        rows.append(labelled(name, f"{text}  ({spec.value}{since})"))
    return rows or [[("this chart reads no live value", "dim")]]


def variables(simulation: Simulation) -> list[TonedLine]:
    """Return the chart's variables as lines, and the request of an active embedded mission."""
    memory = simulation.machine.memory
    rows = [labelled(name, shorten(value)) for name, value in memory.context.items()]
    for state in (name for name in memory.given if name in memory.configuration):
        fields = memory.given[state].items()
        rows += [labelled(f"{state.rpartition('.')[2]}.{name}", shorten(value)) for name, value in fields]
    return rows or [[("this chart has no variable", "dim")]]


def timers(chart: Chart, simulation: Simulation) -> list[TonedLine]:
    """Return the deadlines, running and frozen, and the time of the next event, as lines."""
    memory, now = simulation.machine.memory, simulation.now

    def about(kind: str, owner: str) -> str:
        attempt = memory.attempts.get(owner)
        if attempt is not None:
            what = {"timeout": "times out", "cancel": "must have confirmed its cancel"}.get(kind, kind)
            return f"{attempt.operation} {what}"
        if kind == "fresh":
            return f"input.{owner} is looked at again"
        state = owner.partition("[")[0]
        where = f" in {short_name(chart, state)}" if state in chart.states else ""
        return f"{_TIMERS.get(kind, kind)}{where}"

    rows = [labelled(f"at {due:.1f} s", about(kind, owner)) for due, _, kind, (owner, _) in memory.timers]
    rows += [
        labelled(f"{left:.1f} s left", f"{about(kind, owner)} (stopped by the hold)", "dim")
        for left, _, kind, (owner, _) in memory.frozen
    ]
    due = simulation.next_due
    if due is None:
        return [*rows, [("nothing will happen by itself", "dim")]]
    return [*rows, [(f"now is {now:.1f} s, the next thing happens at {due:.1f} s", "dim")]]


_TIMERS = {
    "after": "time is up",
    "budget": "the budget is up",
    "retry": "next try",
    "ask": "the default counts",
    "at": "the clock has come to it",
}
