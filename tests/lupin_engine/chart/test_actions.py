"""The engine's own actions: what they are given, and what is told of what they cannot be given."""

from __future__ import annotations

from pathlib import Path

import pytest

from lupin_engine.chart.compose.actions import builtin_actions
from lupin_engine.missions.folders import LIFECYCLE
from lupin_engine.missions.load import check_chart
from lupin_engine.plugin.registry import Catalog
from lupin_greenhouse.profile import PROFILE

MINI = Path(__file__).parents[2] / "charts" / "mini" / LIFECYCLE
MISSION = """\
mission: M
initial: A
states:
  A:
    itinerary: {{items: "${{ tags.numeric_order() }}"}}
    on_done: done
    initial: B
    states:
      B:
        invoke: {{do: bridge.read_tag, with: {{tag_id: T}}, timeout: {{after: 1 s, code: late}}}}
        on_done:
          target: over
          do:
            - {action}
        on_error: over
      over: {{type: final}}
  done: {{type: final}}
"""


def told(action: str, folder: Path, catalog: Catalog) -> list[str]:
    """Return what is said of an action where there is an itinerary and a reading."""
    (folder / "m.yaml").write_text(MISSION.format(action=action), encoding="utf-8")
    _, found = check_chart(MINI, [folder / "m.yaml"], catalog)
    return [str(one).partition("MISSION.M.A.B.on_done.do.")[2] or str(one) for one in found]


@pytest.mark.parametrize(
    "action",
    [
        *(f"itinerary.close: {{status: {status}}}" for status in PROFILE.statuses),
        "itinerary.close: {status: OK, code: late, detail: x, reading: '${ event.reading }'}",
        "itinerary.close_rest: {status: SKIPPED, code: late, detail: x}",
        "{publish.reading: {tag: T, reading: '${ event.reading }'}}",
        "report.clear",
        "report.summary",
        "report.note: {text: 'at ${ target.id }'}",
        "set: {reason: x}",
        "set: {reason: '${ target.id }'}",
    ],
)
def test_an_action_takes_what_it_says(action: str, tmp_path: Path, catalog: Catalog) -> None:
    """Everything that it may be given, and no more than it must be."""
    assert told(action, tmp_path, catalog) == []


@pytest.mark.parametrize(
    ("action", "problem"),
    [
        (
            "itinerary.close: {}",
            "itinerary.close: itinerary.close needs the argument 'status': how the visit ended: "
            "OK, UNREACHABLE, SCAN_FAILED, SKIPPED; add 'status: ...' [missing-argument]",
        ),
        (
            "itinerary.close: {status: OKAY}",
            "itinerary.close.status: unknown status 'OKAY'; did you mean 'OK'? [wrong-type]",
        ),
        (
            "itinerary.close: {status: GONE}",
            "itinerary.close.status: unknown status 'GONE'; "
            "allowed: 'OK', 'SCAN_FAILED', 'SKIPPED', 'UNREACHABLE' [wrong-type]",
        ),
        (
            "itinerary.close_rest: {status: OK, code: lte}",
            "itinerary.close_rest.code: the code 'lte' is not declared; did you mean 'late'? "
            "Or declare it under codes: 'lte: {label: ...}' [undeclared-code]",
        ),
        (
            "itinerary.close_rest: {status: OK, reading: 1}",
            "itinerary.close_rest: itinerary.close_rest has no argument 'reading'; "
            "allowed: 'code', 'detail', 'status' [unknown-argument]",
        ),
        (
            "publish.reading: {tag: T}",
            "publish.reading: publish.reading needs the argument 'reading': what was read; "
            "add 'reading: ...' [missing-argument]",
        ),
        (
            "report.clear: {all: true}",
            "report.clear: report.clear has no argument 'all'; nothing is allowed here [unknown-argument]",
        ),
        ("set", "set: set names no variable; write 'set: {NAME: VALUE}' [missing-argument]"),
        ("raise", "raise: raise names no event; write 'raise: {event: NAME}' [missing-argument]"),
        (
            "raise: {event: done.x}",
            "raise: 'done.x' cannot be raised: events of 'done' come from the engine itself; "
            "begin it with another word [bad-name]",
        ),
        (
            "itinerary.cloze",
            "itinerary.cloze: unknown action 'itinerary.cloze'; "
            "did you mean 'itinerary.close'? [unknown-action]",
        ),
    ],
)
def test_what_an_action_cannot_do_is_told(
    action: str, problem: str, tmp_path: Path, catalog: Catalog
) -> None:
    """With what it can."""
    assert told(action, tmp_path, catalog) == [problem]


def test_every_argument_is_explained() -> None:
    """The editor shows it, and so does the page of the language."""
    assert list(builtin_actions(PROFILE)) == [
        "itinerary.advance",
        "itinerary.close",
        "itinerary.close_rest",
        "report.clear",
        "report.note",
        "report.summary",
        "publish.reading",
    ]
    explained = {
        name: argument.doc
        for arguments in builtin_actions(PROFILE).values()
        for name, argument in arguments.items()
    }
    assert explained == {
        "status": "how the visit ended: OK, UNREACHABLE, SCAN_FAILED, SKIPPED",
        "code": "the reason, a declared code",
        "detail": "free text for people",
        "reading": "what was read",
        "text": "what the log and the story of the run say",
        "tag": "id of the tag",
    }
