"""Run the mandatory tests of the W3C's SCXML suite, and write what came of them as a page.

    npm install @scion-scxml/test-framework
    tools/conformance.py node_modules/@scion-scxml/test-framework/test/w3c-ecma > docs/conformance.md

Each test is a document that ends in `pass` or `fail`. It is imported as by `lupin import scxml` and runs in
virtual time. A test that is not wholly said counts as such, however it would end.
"""

from __future__ import annotations

import re
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from lupin_engine.chart.model import Chart
from lupin_engine.errors import LupinError, Severity
from lupin_engine.machine.event import Event
from lupin_engine.missions.from_scxml import from_scxml
from lupin_engine.missions.load import inspect_chart
from lupin_engine.plugin.registry import load_catalog
from lupin_engine.replay.yaml_text import yaml_text
from lupin_engine.runtime.setup import make_machine

LIFECYCLE = """\
lifecycle: small
initial: READY
states:
  READY: {on: {mission.start: MISSION}}
  MISSION: {slot: mission, on_done: READY}
  FAULT: {}
"""
#: What is looked for in the checker's findings: it makes no chart unusable for a test.
HARMLESS = {"never-wins", "unreachable-state", "dead-end", "endless", "unused"}
#: More steps than this are no test that ends.
MAX_STEPS = 200
#: Why something cannot be said, by what the importer tells of it; the first that fits counts.
REASONS: Mapping[str, str] = {
    "script": "scripts: a mission has no code of its own",
    "invoke": "invokes of other charts: a mission uses parts, which are there when it is loaded",
    "send to others": "sends to others and I/O processors: plugins are the way outwards",
    "delayed send": "delays that outlive their state: here they belong to one (`after`)",
    "cancel": "`cancel` of a delay while its state is active",
    "history": "executable content of a history, or of leaving an end",
    "an end does": "executable content of a history, or of leaving an end",
    "foreach": "`foreach`: lists are gone through by expressions",
    "of another state or of the engine": "errors and ends of the engine as events (`error.execution`, ...)",
    "variable": "variables that are undefined, arrays or objects",
    "several targets": "several targets of one transition",
    "expression": "expressions of ECMAScript, and the system's variables (`_event.name`, `_sessionid`, ...)",
    "<": "other elements (`content`, assignments to what is no variable)",
}
ITSELF, IDIOM, OTHERWISE, MANUAL, REFUSED, UNSAID, ABSENT = (
    "passes by itself",
    "passes by an idiom",
    "does something else",
    "runs, and is for a person to judge",
    "refused by the checker",
    "is left out in part or whole",
    "not in the package as one document",
)


@dataclass(frozen=True)
class Outcome:
    """What came of a test, and why."""

    kind: str
    reason: str = ""


def mandatory(folder: Path) -> dict[str, tuple[str, bool]]:
    """Return of each mandatory test the section of the specification, and whether a person judges it."""
    root = ElementTree.parse(folder / "manifest.xml").getroot()
    return {
        test.attrib["id"]: (assertion.attrib["specnum"], test.attrib["manual"] == "true")
        for assertion in root.iter("assert")
        for test in assertion.iter("test")
        if test.attrib["conformance"] == "mandatory"
    }


def outcome(file: Path) -> Outcome:
    """Import a test and run it."""
    if not file.exists():
        return Outcome(ABSENT)
    try:
        found = from_scxml(file.read_bytes(), "Tried")
    except LupinError as problem:
        return Outcome(UNSAID, str(problem))
    lost = [note.text for note in found.notes if note.lost]
    if lost:
        return Outcome(
            UNSAID, next(why for part, why in REASONS.items() if any(part in text for text in lost))
        )
    with tempfile.TemporaryDirectory() as folder:
        lifecycle, mission = Path(folder, "lifecycle.yaml"), Path(folder, "tried.yaml")
        lifecycle.write_text(LIFECYCLE)
        mission.write_text(yaml_text(found.mission))
        inspection = inspect_chart(lifecycle, [mission], load_catalog())
    errors = [d for d in inspection.found if d.severity is Severity.ERROR and d.rule not in HARMLESS]
    if errors or inspection.composed is None:
        return Outcome(REFUSED, ", ".join(sorted({f"`{d.rule}`" for d in errors})))
    if not passes(inspection.composed.chart):
        return Outcome(OTHERWISE)
    return Outcome(IDIOM if any("is never taken" not in n.text for n in found.notes) else ITSELF)


def passes(chart: Chart) -> bool:
    """Say whether a mission comes to `pass`."""
    machine = make_machine(chart, {})
    steps = [machine.start(0.0), machine.handle(Event("mission.start", {"mission_type": "Tried"}), 0.0)]
    while (due := machine.next_deadline) is not None and len(steps) < MAX_STEPS:
        step = machine.advance(due)
        if step is not None:
            steps.append(step)
    return any("MISSION.Tried.pass" in step.entered for step in steps)


def page(folder: Path) -> Iterator[str]:
    """Yield the lines of the page."""
    tests = mandatory(folder)
    found = {name: outcome(folder / f"test{name}.txml.scxml") for name in tests}
    manual = {name for name, (_, judged) in tests.items() if judged and found[name].kind == OTHERWISE}
    found |= dict.fromkeys(manual, Outcome(MANUAL))
    counts = Counter(one.kind for one in found.values())
    yield from HEAD
    for kind in (ITSELF, IDIOM, OTHERWISE, MANUAL, REFUSED, UNSAID, ABSENT):
        yield f"| {kind} | {counts[kind]} |"
    yield f"| all mandatory tests | {len(tests)} |"
    yield from ("", "## What is left out, and why", "", "| why | tests |", "|---|---|")
    reasons = Counter(one.reason for one in found.values() if one.kind == UNSAID)
    yield from (f"| {reason} | {count} |" for reason, count in reasons.most_common())
    yield from ("", "## Every test", "", "| test | section | |", "|---|---|---|")
    for name in sorted(tests, key=lambda text: (int(re.findall(r"\d+", text)[0]), text)):
        one = found[name]
        why = f": {one.reason.partition(':')[0]}" if one.reason else ""
        yield f"| {name} | {tests[name][0]} | {one.kind}{why} |"


HEAD = """\
# Conformance

The W3C tests implementations of SCXML by documents that end in `pass` or `fail`. `tools/conformance.py`
imports the mandatory ones of the npm package `@scion-scxml/test-framework` as `lupin import scxml` does and
runs them in virtual time; this page is what it printed. A test passes here only if the importer could say the
whole of it. *By an idiom* means that it wrote something other than the same word (see
[diagrams](diagrams.md#a-chart-of-others)). *Does something else*: a `send` to the chart itself is a `raise`
here, so it does not wait behind internal events. What is left out is out of scope by intent (scripts, I/O
processors, invokes of charts that are data), or it is what the importer does not write yet.

| what came of it | tests |
|---|---|
""".splitlines()

if __name__ == "__main__":
    print("\n".join(page(Path(sys.argv[1]))))
