"""What is offered where, in the shipped missions as somebody changes them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from lupin_lsp.completion import complete
from lupin_lsp.folder import Folder

Typed = Callable[[str, str, str], tuple[Path, int]]

INSPECTION, LIFECYCLE, PART = "inspection.yaml", "lifecycle.yaml", "parts/visit_targets.yaml"
TRANSITION = ["target", "guard", "do", "refuse", "value", "during", "releases", "code", "detail"]
TRANSITION += ["internal", "use"]
ROOT_STATES = ["BOOT", "READY", "MISSION", "RETURNING", "DONE", "FAULT"]
MISSION_STATES = ["PREPARE", "INSPECTING", "done"]
PARAMETERS = ["localization_covariance_threshold", "localization_timeout_s", "dependency_timeout_s"]
OPERATIONS = ["plugins.ready", "bridge.read_tag", "nav.localize", "nav.go_to", "nav.choose_frontier"]
OPERATIONS += ["nav.dock"]
REQUESTS = ["mission.start", "operator.abort", "operator.dock", "operator.pause", "operator.reset"]
REQUESTS += ["operator.resume", "operator.skip_current"]
CODES = ["already_paused", "paused_by_operator", "not_running"]

#: file, what stands there, what is typed instead, what is offered first, and how much in all (0: no matter).
CASES = {
    "targets, the nearest first": (
        INSPECTION, "on_error: FAULT", "on_error: F|",
        ["LOCALIZING", *MISSION_STATES, "history", *ROOT_STATES], 11,
    ),
    "targets in a mapping": (
        INSPECTION, "on_error: FAULT", "on_error: {target: |}",
        ["LOCALIZING", *MISSION_STATES, "history", *ROOT_STATES], 11,
    ),
    "targets in a bracket that is open": (
        INSPECTION, "on_error: FAULT", "on_error: {target: |", ["LOCALIZING", *MISSION_STATES], 11,
    ),
    "targets in a part": (
        PART, "- target: visited", "- target: |",
        ["NAVIGATING", "SCANNING", "PUBLISHING", "visited", "PREPARE", "INSPECTING", "done"], 14,
    ),
    "states inside a state": (
        PART, "target: SCANNING.READING", "target: SCANNING.|",
        ["SCANNING.CONFIRMING", "SCANNING.READING", "SCANNING.DWELLING"], 3,
    ),
    "the first state": (LIFECYCLE, "initial: DRIVING_HOME", "initial: |", ["DRIVING_HOME", "DOCKED"], 2),
    "the child to come back to": (
        PART, "{target: NAVIGATING, guard: itinerary.open}", "{target: |, guard: itinerary.open}",
        ["NAVIGATING", "SCANNING", "PUBLISHING", "visited"], 4,
    ),
    "whose answers": (LIFECYCLE, "{use: READY}", "{use: |}", ROOT_STATES, 6),
    "keys of a transition": (INSPECTION, "on_error: FAULT", "on_error: {|}", TRANSITION, 11),
    "further keys": (LIFECYCLE, "{refuse: not_ready}", "{refuse: not_ready, |}", TRANSITION[:3], 10),
    "keys or a target": (
        INSPECTION, "on_error: FAULT", "on_error:\n          - |", [*TRANSITION, "LOCALIZING"], 22,
    ),
    "keys of a state": (
        INSPECTION, "        on_error: FAULT", "        |",
        ["summary", "type", "depth", "initial", "states", "sequence", "times", "entry", "exit", "on_error",
         "on"], 28,
    ),
    "keys of a file": (INSPECTION, "initial: PREPARE", "|", ["lupin", "types", "inputs"], 0),
    "fields of an element by its number": (
        PART, "guard: itinerary.open              #",
        "guard: request.tag_sequence[0].| #",
        [f"request.tag_sequence[0].{name}" for name in ("id", "x", "y")], 3,
    ),
    "keys of a field of a record": (
        INSPECTION, "initial: PREPARE", "types: {ward: {door: {|}}}\ninitial: PREPARE",
        ["type", "unit", "min", "max"], 4,
    ),
    "the type of a field of a record": (
        INSPECTION, "initial: PREPARE", "types: {ward: {id: |}}\ninitial: PREPARE", ["bool", "text"], 0,
    ),
    "operations": (INSPECTION, "do: nav.localize", "do: na|", OPERATIONS, 7),
    "arguments of an operation": (INSPECTION, "with: {max_variance:", "with: {|", ["max_variance"], 1),
    "arguments that are left": (PART, "{pose: ", "{|, pose: ", [], 0),
    "limits": (INSPECTION, "{after: \"${ param.localization_timeout_s }\"", "{|", ["after"], 1),
    "words": (LIFECYCLE, "severity: info", "severity: |", ["info", "warn", "error"], 3),
    "yes or no": (LIFECYCLE, "paused: true", "paused: |", ["true", "false"], 2),
    "no limit": (
        LIFECYCLE, "timeout: {after: \"${ param.dock_timeout_s }\", code: nav_timeout}", "timeout: |",
        ["never"], 1,
    ),
    "events": (
        INSPECTION, "        on_error: FAULT", "        on:\n          op|",
        [*REQUESTS, "input.estop", "input.battery.low"], 10,
    ),
    "requests that release": (LIFECYCLE, "release: operator.resume", "release: |", REQUESTS, 7),
    "what engages": (LIFECYCLE, "engage: input.estop", "engage: |", [*REQUESTS, "input.estop"], 9),
    "holds": (LIFECYCLE, "releases: pause", "releases: |", ["pause", "estop"], 2),
    "holds in a list": (LIFECYCLE, "during: estop\n", "during: [pause, |]\n", ["pause", "estop"], 2),
    "codes": (LIFECYCLE, "{refuse: not_ready}", "{refuse: |}", CODES, 0),
    "codes of the operation": (
        PART, "unless: amcl_drift_var", "unless: |",
        ["nav_status_0", "nav_status_5", "nav_status_6", "nav_rejected", "nav_unavailable", "amcl_drift_var",
         "nav_timeout"], 7,
    ),
    "what if chooses between": (
        LIFECYCLE, "- report.summary", "- if: {|}", ["guard", "then", "else"], 3,
    ),
    "actions in an if": (
        LIFECYCLE, "- report.summary", "- if: {guard: x, then: {set: {|", ["reason", "home"], 2,
    ),
    "actions": (
        LIFECYCLE, "- report.summary", "- |",
        ["set", "add", "remove", "raise", "if", "itinerary.close", "itinerary.close_rest", "report.note",
         "publish.reading",
         "arm.preset", "itinerary.advance", "report.clear", "report.summary"], 13,
    ),
    "arguments of an action": (
        LIFECYCLE, "- report.summary", "- itinerary.close: {|}", ["status", "code", "detail", "reading"], 4,
    ),
    "an expression in a text": (
        PART, 'detail: "${ error.detail }"', 'detail: "so ${ error.code }: ${ error.| }"',
        ["error.code", "error.detail"], 2,
    ),
    "how a visit ended": (
        PART, "status: UNREACHABLE", "status: |", ["OK", "UNREACHABLE", "SCAN_FAILED", "SKIPPED"], 4,
    ),
    "variables": (LIFECYCLE, "- report.summary", "- set: {|}", ["reason", "home"], 2),
    "parts": (INSPECTION, "use: visit_targets", "use: |", ["visit_targets"], 1),
    "parameters of a part": (
        INSPECTION, "use: visit_targets", "use: visit_targets\n    with: {|}",
        ["nav_timeout_s", "nav_max_attempts"], 9,
    ),
    "variables that take what a part reports": (
        INSPECTION, "use: visit_targets", "use: visit_targets\n    out: {locked: |}", ["reason", "home"], 2,
    ),
    "types": (LIFECYCLE, "type: duration, default: 60 s", "type: |, default: 60 s", ["bool", "text"], 0),
    "types of elements": (INSPECTION, "type: list of tag", "type: list of |", ["bool", "text"], 0),
    "live values": (
        LIFECYCLE, "value: robot.estop", "value: |",
        ["plugins.missing", "robot.pose", "robot.battery", "robot.battery_source"], 0,
    ),
    "parameters, the nearest first": (
        INSPECTION, "${ param.localization_timeout_s }", "${ param.|",
        [f"param.{name}" for name in PARAMETERS], 0,
    ),
    "what an expression begins with": (
        PART, "guard: itinerary.open}", "guard: |}",
        ["param", "input", "reason", "home", "clock", "request", "target", "itinerary", "event"], 0,
    ),
    "what an expression goes on with": (
        PART, "guard: itinerary.open              #", "guard: itinerary.open and | #",
        ["param", "input", "reason", "home"], 0,
    ),
    "what the clock shows": (
        PART, "guard: itinerary.open              #", "guard: clock.| #", ["clock.today", "clock.time"], 2,
    ),
    "fields of the target": (
        PART, "\"${ target.id }\"", "\"${ target.| }\"", ["target.id", "target.x", "target.y"], 3,
    ),
    "fields of the request": (
        INSPECTION, "${ request.tag_sequence }", "${ request.| }", ["request.tag_sequence"], 1,
    ),
    "what a field refuses": (
        INSPECTION, "not_empty: no_tags", "refuse: {|}", ["guard", "code", "value"], 3,
    ),
    "fields that a refusal reads": (
        INSPECTION, "not_empty: no_tags", "refuse: {guard: len(request.|)}", ["request.tag_sequence"], 1,
    ),
    "codes of a refusal": (INSPECTION, "not_empty: no_tags", "refuse: {code: |}", CODES, 0),
    "fields of what is found": (
        PART, "guard: itinerary.open              #",
        "guard: find(request.tag_sequence, t.|) #", ["t.id", "t.x", "t.y"], 3,
    ),
    "fields of the element of a loop": (
        PART, "guard: itinerary.open              #",
        "guard: any([tag.| for tag in tags.numeric_order()]) #", ["tag.id", "tag.x", "tag.y"], 3,
    ),
    "lists to add to, of which there are none": (LIFECYCLE, "- report.summary", "- add: {|}", [], 0),
    "levels of an input": (
        LIFECYCLE, "guard: input.battery.low}", "guard: input.battery.|}",
        ["input.battery.value", "input.battery.low"], 2,
    ),
    "the result of the operation": (PART, "${ event.reading }", "${ event.| }", ["event.reading"], 1),
    "why it failed": (PART, "${ error.code }", "${ error.| }", ["error.code", "error.detail"], 2),
    "names of what was read": (
        PART, "${ event.reading }", "${ event.reading['|'] }", ["temperature", "humidity", "co2"], 5,
    ),
    "codes to compare with": (
        PART, "target: PUBLISHING\n      do:\n        - itinerary.close: {status: UNREACHABLE",
        "target: PUBLISHING\n      guard: error.code == '|'\n      do:\n        - itinerary.close: {x: y",
        ["amcl_drift_var", "driver_error", "execution_error", "nav_rejected"], 10,
    ),
    "functions by their name": (
        INSPECTION, "tags.numeric_order()", "tags.|", ["tags.numeric_order", "tags.named"], 2,
    ),
    "holds to ask for": (LIFECYCLE, "in_state('PREPARE')", "held(|)", ["pause", "estop"], 2),
    "states to ask for": (LIFECYCLE, "in_state('PREPARE')", "in_state('|')", ROOT_STATES[:3], 21),
    "words of a property": (
        INSPECTION, "initial: PREPARE", "properties: {tour: {|}}\ninitial: PREPARE",
        ["always", "never", "eventually", "visit_all", "visit_in_order", "within", "after", "until"], 13,
    ),
    "states to visit": (
        INSPECTION, "initial: PREPARE", "properties:\n  tour: {visit_all: [in_state('|')]}\ninitial: PREPARE",
        ROOT_STATES[:3], 21,
    ),
    "more states to visit": (
        INSPECTION, "initial: PREPARE",
        "properties:\n  tour:\n    visit_all:\n      - held(pause)\n      - in_state('|')\ninitial: PREPARE",
        ROOT_STATES[:3], 21,
    ),
    "nothing in a sentence": (INSPECTION, "summary: Visit every", "summary: Vi|sit every", [], 0),
    "nothing for a name": (INSPECTION, "  INSPECTING:", "  INSP|:", [], 0),
    "nothing in a comment": (LIFECYCLE, "# stop where", "# st|op where", [], 0),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_offers(case: str, typed: Typed, folder: Folder) -> None:
    """The first offers, in order, and how many there are."""
    name, old, new, first, count = CASES[case]
    path, offset = typed(name, old, new)
    found = [offer.label for offer in complete(folder, path, offset).found]
    assert found[: len(first)] == first
    if count or not first:
        assert len(found) == (count if count else len(first))


def test_a_new_file_begins_with_what_it_is(folder: Folder) -> None:
    """Nothing else can come first."""
    path = folder.path / "new.yaml"
    folder.put(path, "")
    found = complete(folder, path, 0)
    assert [offer.insert for offer in found.found] == ["lifecycle: ", "mission: ", "part: ", "binding: "]


def test_a_scenario_is_left_to_the_schema(folder: Folder) -> None:
    """It does not begin with what it is not."""
    path = folder.path.parent / "scenarios" / "a.scenario.yaml"
    folder.put(path, "scenario: one tag\nmission: inspection\n")
    assert complete(folder, path, 0).found == ()


def test_a_name_with_dots_is_replaced_as_a_whole(typed: Typed, folder: Folder) -> None:
    """Editors do not agree on what a word is."""
    path, offset = typed("inspection.yaml", "do: nav.localize", "do: nav.lo|")
    found = complete(folder, path, offset)
    assert folder.text(path)[found.start : found.end] == "nav.lo"
    path, offset = typed("inspection.yaml", "${ param.localization_timeout_s }", "${ param.loc|ali }")
    found = complete(folder, path, offset)
    assert folder.text(path)[found.start : found.end] == "param.locali"


def test_a_key_brings_its_colon_once(typed: Typed, folder: Folder) -> None:
    """None where there is one already."""
    path, offset = typed("inspection.yaml", "on_error: FAULT", "on_er|: FAULT")
    assert "on_error" in [offer.insert for offer in complete(folder, path, offset).found]
    path, offset = typed("inspection.yaml", "on_er: FAULT", "on_er|")
    assert "on_error: " in [offer.insert for offer in complete(folder, path, offset).found]


def test_an_offer_says_what_it_is_and_where(typed: Typed, folder: Folder) -> None:
    """The full name, the file and the line of a state."""
    path, offset = typed("inspection.yaml", "on_error: FAULT", "on_error: |")
    offer = complete(folder, path, offset).found[1]
    assert offer.label == "PREPARE"
    assert offer.detail == "MISSION.InspectionMission.PREPARE (inspection.yaml:20)"


def test_what_was_raised_elsewhere_is_an_event(typed: Typed, folder: Folder) -> None:
    """As soon as it is written, in whichever file."""
    typed("lifecycle.yaml", "- report.clear", "- raise: {event: robot.mended}|")
    path, offset = typed("inspection.yaml", "        on_error: FAULT", "        on: {|}")
    assert "robot.mended" in [offer.label for offer in complete(folder, path, offset).found]


def test_nothing_that_is_typed_stops_it(folder: Folder) -> None:
    """Every beginning of a part, at its end."""
    path = folder.path / "parts" / "visit_targets.yaml"
    text = folder.text(path)
    text = text[: text.index("  SCANNING:")]
    for end in range(0, len(text), 29):
        folder.put(path, text[:end])
        assert all(offer.label for offer in complete(folder, path, end).found)
