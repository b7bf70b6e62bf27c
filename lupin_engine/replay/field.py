"""What robots have gone through, from their journals: transitions, outcomes, holds, breaches and margins."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from lupin_engine.chart.model import Chart
from lupin_engine.errors import LupinError
from lupin_engine.plugin.registry import Catalog
from lupin_engine.properties.margins import Margin, MarginMonitor
from lupin_engine.replay.coverage import HOLDS, OUTCOMES, TRANSITIONS, CoverageItem, Key, items, reached
from lupin_engine.replay.journaled import JournaledRun, as_run, chart_of, runs_of
from lupin_engine.replay.why import LivedStep
from lupin_engine.runtime.journal.replay import replay
from lupin_engine.runtime.setup import make_world
from lupin_engine.sim.suite import Counts

#: The kinds that are asked of the field, in the order of reports.
FIELD_KINDS = (TRANSITIONS, OUTCOMES, HOLDS)


@dataclass
class FieldEvidence:
    """The contents of journals: missions, how often each item was reached, breaches and smallest margins.

    `watched` are the properties that were watched, each with the number of missions in which it was.
    `left_out` are the files and missions that were not used, and why.
    """

    missions: int = 0
    watched: Counter[str] = field(default_factory=Counter)
    counts: Counts = field(default_factory=Counter)
    breaches: Counter[str] = field(default_factory=Counter)
    margins: dict[str, Margin] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)

    def shown(self, name: str) -> str:
        """Return what robots have shown of a property."""
        near = f"; nearest: {self.margins[name]}" if name in self.margins else ""
        return f"{'on robots: ' if name in self.watched else ''}{self.counted(name)}{near}"

    def counted(self, name: str) -> str:
        """Return how often robots have broken a property, and in how many missions it was watched."""
        if name not in self.watched:
            return "not watched on robots"
        return f"broken {self.breaches[name]} times, missions: {self.watched[name]}"

    def record(self) -> dict[str, Any]:
        """Return the properties' part as JSON data."""
        return {
            "missions": self.missions,
            "breaches": {name: self.breaches[name] for name in sorted(self.watched)},
            "margins": {name: one._asdict() for name, one in sorted(self.margins.items())},
            "left_out": self.left_out,
        }


def field_evidence(
    folders: Iterable[Path], catalog: Catalog, report: Callable[[str], object] = lambda text: None
) -> FieldEvidence:
    """Replay the journals in some folders; `report` is called with the progress as text.

    Raises:
        JournalError: one of the folders has no journal.
    """
    found, charts = FieldEvidence(), dict[str, Chart]()
    for folder in folders:
        runs = runs_of(folder, found.left_out.append)
        for number, run in enumerate(runs, 1):
            report(f"{folder}: file {number} of {len(runs)}")
            try:
                key = run.files[0].head.chart
                charts[key] = charts.get(key) or chart_of(run, catalog).chart
                _add(found, run, charts[key])
            except LupinError as problem:
                found.left_out.append(f"{run.mission} {run.mission_id}: {problem}".strip().splitlines()[0])
    return found


def _add(found: FieldEvidence, run: JournaledRun, chart: Chart) -> None:
    """Add one mission, or the time between two."""
    monitor, lived, machine = MarginMonitor(chart), list[LivedStep](), None
    for file in run.files:
        for each in replay(file, make_world(chart, file.head.parameters), monitor):
            machine = each.machine
            if each.step is not None:
                step = replace(each.step, time=each.record.wall)
                lived.append(LivedStep(step, held=tuple(machine.memory.held)))
    if machine is None or not lived:
        return
    found.missions += bool(run.mission_id)
    found.counts += reached(as_run(chart, lived, machine))
    found.watched.update(dict.fromkeys(monitor.names, int(bool(run.mission_id))))
    found.breaches.update(monitor.breaches)
    for name, margin in monitor.margins.items():
        if name not in found.margins or margin.left < found.margins[name].left:
            found.margins[name] = margin


def field_items(chart: Chart) -> list[CoverageItem]:
    """Return the transitions, ends of operations and holds of a chart, in the order of the file."""
    known = [item for item in items(chart) if item.kind in FIELD_KINDS]
    holds = (
        CoverageItem((HOLDS, name, ""), hold.place, f"hold {name}", "") for name, hold in chart.holds.items()
    )
    return [*known, *holds]


def field_lines(chart: Chart, found: FieldEvidence, others: Mapping[str, Mapping[Key, int]]) -> Iterator[str]:
    """Yield a table of what has never happened on a robot, beside what `others` have seen, by their names."""
    every = field_items(chart)
    missing = [item for item in every if not found.counts[item.key]]
    for kind in FIELD_KINDS:
        of = sum(item.kind == kind for item in every)
        seen = of - sum(item.kind == kind for item in missing)
        yield f"{kind}: {seen} of {of} have happened on robots"
    if missing:
        yield ""
        yield "".join(f"{name:>10}" for name in others) + "  never on a robot"
    for item in missing:
        seen_by = "".join(f"{_shown(item.key, counts):>10}" for counts in others.values())
        yield f"{seen_by}  {item.place.shown}: {item.text}"


def field_record(
    chart: Chart, found: FieldEvidence, others: Mapping[str, Mapping[Key, int]]
) -> dict[str, Any]:
    """Return all items as JSON data, with how often robots and `others` have seen each; null: not asked."""
    return {
        **found.record(),
        "items": [
            {
                "kind": item.kind,
                "place": item.place.shown,
                "what": item.text,
                "field": found.counts[item.key],
                **{name: _count(item.key, counts) for name, counts in others.items()},
            }
            for item in field_items(chart)
        ],
    }


def _count(key: Key, counts: Mapping[Key, int]) -> int | None:
    """Return how often an item was seen; None where this source does not look at its kind."""
    looks = any(kind == key[0] for kind, *_ in counts)
    return counts.get(key, 0) if looks else None


def _shown(key: Key, counts: Mapping[Key, int]) -> str:
    count = _count(key, counts)
    return "-" if count is None else str(count)
