"""Write docs/patterns.md: the specification patterns that one line of a mission says, each with two runs.

    .venv/bin/python tools/patterns.py > docs/patterns.md

The runs are simulated, of missions that walk from state to state; the property's own monitor says where it is
broken.
"""

from __future__ import annotations

import math
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from lupin_engine.chart.model import Chart
from lupin_engine.machine.step import Step
from lupin_engine.missions.folders import LIFECYCLE
from lupin_engine.missions.load import load_chart
from lupin_engine.plugin.registry import load_catalog
from lupin_engine.properties.authored import properties_of
from lupin_engine.properties.built_in import Glance, Passage, due
from lupin_engine.runtime.setup import make_world
from lupin_engine.sim.simulation import Script, Simulation

#: How many seconds a letter of a picture is.
_LETTER = 0.5
_AROUND = """\
lifecycle: around
initial: READY
states:
  READY: {on: {mission.start: MISSION}}
  MISSION: {slot: mission, on_done: READY}
"""
#: A run: the states that the mission goes through, and how many seconds it is in each.
Walk = tuple[tuple[str, int], ...]


@dataclass(frozen=True)
class Pattern:
    """A pattern: what it says, its line in a mission, the literature's words for it, and its two runs."""

    title: str
    says: str
    line: str
    known_as: str
    kept: Walk
    broken: Walk


PATTERNS = (
    Pattern(
        "Never, always",
        "A condition holds at no moment, or at every one.",
        "never: in_state('CLOSET')",
        "absence, universality; global avoidance",
        (("HALL", 3), ("DOOR", 3), ("WINDOW", 4)),
        (("HALL", 3), ("DOOR", 3), ("CLOSET", 4)),
    ),
    Pattern(
        "Never before, avoid until",
        "From each start of the mission on, a condition must not hold until another one has. If both"
        " become true in"
        " one step, the property is kept. It does not say that the awaited one comes at all.",
        "never: in_state('WINDOW'), until: in_state('DOOR')",
        "precedence; past avoidance",
        (("HALL", 3), ("DOOR", 3), ("WINDOW", 4)),
        (("HALL", 3), ("WINDOW", 4), ("DOOR", 3)),
    ),
    Pattern(
        "Between",
        "After each moment at which `after` holds, up to the next at which `until` does, a condition must not"
        " hold (`never`), or must (`always`). An aborted mission may never come to `until`: if the part ends"
        " with the mission, write `or not in_state('MISSION')` behind it.",
        "after: in_state('DOOR'), never: in_state('HALL'), until: in_state('WINDOW')",
        "absence and universality after Q until R",
        (("HALL", 2), ("DOOR", 3), ("ROOF", 2), ("WINDOW", 3)),
        (("DOOR", 3), ("HALL", 2), ("WINDOW", 3), ("ROOF", 2)),
    ),
    Pattern(
        "Response within",
        "Whenever one condition holds, and as long as it does, another one follows in time. A hold does not"
        " stop this clock: name it in"
        " `until` where it is an excuse. Without `after` the time begins when the robot does, once.",
        "after: in_state('DOOR'), eventually: in_state('WINDOW'), within: 4 s",
        "existence, bounded response; visit, bounded reaction",
        (("HALL", 2), ("DOOR", 3), ("WINDOW", 4)),
        (("HALL", 2), ("DOOR", 2), ("ROOF", 3), ("WINDOW", 2)),
    ),
    Pattern(
        "Visit all",
        "When the mission is done, each condition has been true at a moment since its start, in any order.",
        "visit_all: [in_state('DOOR'), in_state('WINDOW')]",
        "visit",
        (("HALL", 2), ("WINDOW", 3), ("DOOR", 4)),
        (("HALL", 2), ("WINDOW", 3), ("ROOF", 4)),
    ),
    Pattern(
        "Visit in order",
        "The same, and none of them becomes true before the one to its left has been. The robot may come"
        " back, and"
        " be elsewhere in between.",
        "visit_in_order: [in_state('DOOR'), in_state('WINDOW'), in_state('ROOF')]",
        "ordered visit",
        (("DOOR", 3), ("HALL", 2), ("WINDOW", 3), ("ROOF", 2)),
        (("DOOR", 3), ("HALL", 2), ("ROOF", 3), ("WINDOW", 2)),
    ),
)


def chart_of(pattern: Pattern, walk: Walk) -> Chart:
    """Return a mission that walks so, with the property; the states of the other run are there as well."""
    names = dict.fromkeys(name for name, _ in (*pattern.kept, *pattern.broken))
    follows = dict(zip([name for name, _ in walk], [name for name, _ in walk[1:]], strict=False))
    seconds = dict(walk)
    lines = ["mission: Walk", f"properties: {{it: {{{pattern.line}}}}}", f"initial: {walk[0][0]}", "states:"]
    for name in names:
        others = [other for other in names if other not in seconds]
        on = "".join(f", on: {{operator.dock: {other}}}" for other in others if name == walk[0][0])
        lines.append(f"  {name}: {{after: {{{seconds.get(name, 1)} s: {follows.get(name, 'done')}}}{on}}}")
    with tempfile.TemporaryDirectory(prefix="lupin-patterns-") as folder:
        around, mission = Path(folder, LIFECYCLE), Path(folder, "walk.yaml")
        around.write_text(_AROUND, encoding="utf-8")
        mission.write_text("\n".join([*lines, "  done: {type: final}", ""]), encoding="utf-8")
        return load_chart(around, [mission], load_catalog())


def breach_of(pattern: Pattern, walk: Walk) -> tuple[float, str]:
    """Simulate a walk; return when the property is broken and how, '' where it is not."""
    chart = chart_of(pattern, walk)
    simulation = Simulation(chart, Script("Walk"), {}, make_world(chart, {}))
    (rule,) = [one for one in properties_of(chart) if one.name == "it"]
    state, found = rule.first, list[tuple[float, str]]()

    def watch(step: Step) -> None:
        nonlocal state
        late = due(state)
        state, verdict = rule.watch(state, Passage(Glance(), step, simulation.machine.scope))
        if verdict.breach:
            found.append((min(late, step.time), verdict.breach.partition("): ")[2]))

    simulation.listener = watch
    simulation.run()
    return found[0] if found else (math.inf, "")


def picture(pattern: Pattern) -> Iterator[str]:
    """Yield the lines of a pattern's picture: its two runs, and where the second one breaks it."""
    for word, walk in (("kept", pattern.kept), ("broken", pattern.broken)):
        begin, total = 0, sum(seconds for _, seconds in walk)
        for name, seconds in walk:
            bar = "█" * round(seconds / _LETTER)
            before = "·" * round(begin / _LETTER)
            yield f"{word:<8}{name:<8}{before + bar:·<{round(total / _LETTER)}}"
            word, begin = "", begin + seconds
        time, breach = breach_of(pattern, walk)
        assert bool(breach) == (walk is pattern.broken), f"{pattern.title}: {breach or 'it is kept'}"
        if breach:
            yield f"{'':<16}{' ' * round(time / _LETTER)}▲ {breach.removeprefix('property it ')}"
        yield ""


def page() -> str:
    """Return the page."""
    lines = [_HEAD]
    for one in PATTERNS:
        lines += [f"## {one.title}", "", one.says, "", "```yaml", "properties:"]
        lines += [f"  it: {{{one.line}}}", "```", "", "```text", *list(picture(one))[:-1], "```", ""]
    rows = [f"| {one.title} | `{one.line}` | {one.known_as} |" for one in PATTERNS]
    return "\n".join([*lines, _TAIL, *rows, ""])


_HEAD = """\
# Patterns of properties

What a mission must keep in every run is mostly one of a few patterns. Each is one line under
`properties` of the mission, or of a [scenario](testing-missions.md#properties). [`lupin prove`](proof.md),
[campaigns](proof.md#campaigns) and `lupin test` watch it. Its conditions are
[expressions](language.md#property): of states (`in_state`), holds (`held`), live values, and of what
the step did (`this_step`).

In the pictures a mission walks from state to state; a letter is half a second. The second run breaks
the property where the arrow is. Conditions are looked at when the machine is at rest: a state that is
left in the step in which it is entered was not visited.
"""
_TAIL = """\
## Which one

- Visits, and `until` without `after`, are about one mission: they begin anew with each start of it. A
  mission that is aborted or ends in FAULT owes no visits. `until` excuses them:
  `until: this_step.accepted == 'operator.skip_current'`.
- Every mission is [proven](proof.md#what-is-watched) to come to its end, and to give each target of an
  itinerary one result. Neither needs a property.
- A proof tries every way. One that may break the pattern needs an excuse in the property, or is a
  mistake.

The names of the literature are those of Dwyer, Avrunin and Corbett, *Patterns in property
specifications for finite-state verification* (1999), and of Menghi, Tsigkanos, Pelliccione, Ghezzi and
Berger, *Specification patterns for robotic missions* (2019).

| Pattern | Line | In the literature |
|---|---|---|"""


if __name__ == "__main__":
    sys.stdout.write(page())
