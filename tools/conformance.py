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
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from lupin_engine.chart.model import Chart
from lupin_engine.errors import LupinError, Severity
from lupin_engine.machine.event import Event
from lupin_engine.missions.load import inspect_chart
from lupin_engine.plugin.registry import load_catalog
from lupin_engine.replay.yaml_text import yaml_text
from lupin_engine.runtime.setup import make_machine
from lupin_scxml.importer import from_scxml

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
#: Why something cannot be said and who would miss it, by what the importer tells; the first that fits counts.
REASONS: Mapping[str, tuple[str, str]] = {
    "invoke": (
        "other charts that are invoked: a mission uses parts, which are there when it is loaded",
        "who splits a machine into several (actors of XState, `<invoke>` in Qt and SCION): "
        "write the other one as a part or a region",
    ),
    **dict.fromkeys(
        ("_sessionid", "_ioprocessors", "_event.origin", "send to others"),
        (
            "sessions and I/O processors: plugins and bindings are the way outwards",
            "who talks to other machines or over HTTP: that is a plugin or a binding",
        ),
    ),
    "_event.": ("`_event.type` and `_event.sendid` of an event that has several senders", "nobody"),
    "script": ("scripts from a file: a mission has no code of its own", "who calls functions of the host"),
    "begins with": ("variables that begin as a file or as an error", "nobody: parameters are set otherwise"),
    "typeof": ("variables that do not exist until their state is entered (`binding=late`)", "nobody"),
    "always an error": ("a condition that is an error each time, which is heard", "nobody"),
    "known only when": (
        "a `cancel` of an id that is computed",
        "hardly anybody; that of `idlocation` is said",
    ),
    "an end does": (
        "what an end does when the state around it is left",
        "nobody: the state has its own `exit`",
    ),
    "foreach": (
        "a `foreach` over a list that changes",
        "who keeps lists in a chart: go through them by expressions",
    ),
    "of another state or of the engine": (
        "the end of a parallel state that is left in the same step, heard elsewhere",
        "nobody",
    ),
}
#: What the sections of the specification are about that have mandatory tests.
SECTIONS: Mapping[str, str] = {
    "3.2": "the document",
    "3.3": "states",
    "3.7": "ends",
    "3.8": "entry",
    "3.9": "exit",
    "3.10": "history",
    "3.12": "names of events",
    "3.13": "which transitions are taken, in which order",
    "4.2": "raise",
    "4.3": "if",
    "4.6": "foreach",
    "4.9": "order and errors of content",
    "5.3": "variables",
    "5.4": "assign",
    "5.5": "what an end gives",
    "5.6": "content",
    "5.7": "param",
    "5.8": "scripts",
    "5.9": "expressions",
    "5.10": "system variables",
    "6.2": "send",
    "6.3": "cancel",
    "6.4": "invoke",
    "B.1": "charts without data",
    "C.1": "queues and targets of events",
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


ORDER = (ITSELF, IDIOM, MANUAL, OTHERWISE, REFUSED, UNSAID, ABSENT)


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
            UNSAID, next(why for part, (why, _) in REASONS.items() if any(part in t for t in lost))
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


def documents(folder: Path, name: str) -> list[Path]:
    """Return the document of a test, or those that it has by letters."""
    whole = folder / f"test{name}.txml.scxml"
    return [whole] if whole.exists() else sorted(folder.glob(f"test{name}[a-z].txml.scxml")) or [whole]


def worst(found: Iterable[Outcome]) -> Outcome:
    """Return the outcome of a test of several documents: it passes if all do."""
    return max(found, key=lambda one: ORDER.index(one.kind))


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
    found = {name: worst(outcome(file) for file in documents(folder, name)) for name in tests}
    manual = {name for name, (_, judged) in tests.items() if judged and found[name].kind == OTHERWISE}
    found |= dict.fromkeys(manual, Outcome(MANUAL))
    counts = Counter(one.kind for one in found.values())
    yield from HEAD
    for kind in (ITSELF, IDIOM, OTHERWISE, MANUAL, REFUSED, UNSAID, ABSENT):
        yield f"| {kind} | {counts[kind]} |"
    yield f"| all mandatory tests | {len(tests)} |"
    yield from (
        "",
        "## What is left out, and why",
        "",
        "| why | tests | who would miss it |",
        "|---|---|---|",
    )
    reasons = Counter(one.reason for one in found.values() if one.kind == UNSAID)
    missed = dict(REASONS.values())
    yield from (f"| {reason} | {count} | {missed[reason]} |" for reason, count in reasons.most_common())
    yield from ("", "## Every test", "", "| test | section | about | |", "|---|---|---|---|")
    for name in sorted(tests, key=lambda text: (int(re.findall(r"\d+", text)[0]), text)):
        one = found[name]
        why = f": {one.reason.partition(':')[0]}" if one.reason else ""
        section = tests[name][0]
        yield f"| {name} | {section} | {SECTIONS[section]} | {one.kind}{why} |"


HEAD = """\
# Conformance

The W3C tests implementations of SCXML by documents that end in `pass` or `fail`. `tools/conformance.py`
imports the mandatory ones of the npm package `@scion-scxml/test-framework` as `lupin import scxml` does and
runs them in virtual time; this page is what it printed. A test passes here only if the importer could say the
whole of it, and the checker has nothing against the mission but states that cannot be reached or left, which
these tests are full of. *By an idiom* means that it wrote something other than the same word, and said so
(see [diagrams](diagrams.md#a-chart-of-others)). What is left out is out of scope by intent.

| what came of it | tests |
|---|---|
""".splitlines()

if __name__ == "__main__":
    print("\n".join(page(Path(sys.argv[1]))))
