"""docs/war-stories.md: every story is shown by something or says why not, and what it links to is there.

What kind of proof a story has is derived from its links; ACCEPT=1 writes it into the page.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

from lupin_engine.sim import SUFFIX
from tests.docs.proofs import ON_THE_WIRE, Kind, kind_of

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "war-stories.md"
SCENARIOS = ROOT / "tests" / "scenarios" / "war_stories"
#: Below tests/.
WIRE = "lupin_ros/system/wire"

#: The stories as they are numbered: told by the field (62 was never given), and found by reading.
NUMBERS = [str(number) for number in range(1, 79) if number != 62] + [f"A{number}" for number in range(1, 43)]
#: What a story says that is kept by somebody else; it may then have nothing that shows it.
NOT_OURS = "Not ours"

#: What no topic, service, action or process shows, and why.
OFF_THE_WIRE = {
    "26": "a defect of tests: a server that one of them left running answered the next",
    "78": "about files: the generator of a world was given other arguments",
}

_ROW = re.compile(r"^\| (A?\d+) \| ([^|]+) \| ([^|]+) \|([^|]*)\| ([^|]+) \|$", re.MULTILINE)
_LINK = re.compile(r"\[([^]]+)\]\(([^)]+)\)")


def rows() -> dict[str, tuple[str, list[tuple[str, str]]]]:
    """Return what keeps each story from happening, and its links as text and target, by its number."""
    found = _ROW.findall(PAGE.read_text(encoding="utf-8"))
    numbers = [number for number, *_ in found]
    assert sorted(set(numbers)) == sorted(numbers), "a number stands twice"
    return {number: (kept, _LINK.findall(shown)) for number, _, kept, _, shown in found}


def kinds(links: list[tuple[str, str]]) -> set[Kind]:
    """Return the kinds of proof behind links."""
    return {kind_of((PAGE.parent / target).resolve(), text.partition("::")[2]) for text, target in links}


def with_kinds(row: re.Match[str]) -> str:
    """Return a row of the page with the kinds of its proofs, from the least to the most."""
    number, before, kept, _, shown = row.groups()
    found = kinds(_LINK.findall(shown))
    told = ", ".join(kind.value for kind in Kind if kind in found) or "none"
    return f"| {number} | {before} | {kept} | {told} | {shown} |"


def story_of(scenario: Path) -> str:
    """Return the number that a scenario is named by: `A04_accepted_after_pause` is about A4."""
    letter, digits = re.match(r"(A?)0*(\d+)_", scenario.name).groups()  # type: ignore[union-attr]
    return f"{letter}{digits}"


def scenarios() -> list[Path]:
    """Return the scenarios of the war stories."""
    return sorted(SCENARIOS.glob(f"*{SUFFIX}"))


def test_every_story_is_told_once_in_order() -> None:
    """The tables are complete."""
    assert len(NUMBERS) == 119
    assert list(rows()) == NUMBERS


@pytest.mark.parametrize("number", NUMBERS)
def test_what_a_story_links_to_is_there(number: str) -> None:
    """A link is a file; what it says after `::` is a test of that file."""
    kept, links = rows()[number]
    assert links or kept.startswith((f"{NOT_OURS}: ", f"{NOT_OURS}, "))
    for text, target in links:
        file = (PAGE.parent / target).resolve()
        assert file.is_file(), target
        _, separator, test = text.partition("::")
        if separator:
            assert re.search(
                rf"^(async )?def {re.escape(test)}\(", file.read_text(encoding="utf-8"), re.MULTILINE
            )
        if file.parent.name == "broken":
            assert file.with_suffix(".txt").is_file(), f"{file.name} is no broken chart"


@pytest.mark.slow
def test_the_page_says_what_kind_of_proof_each_story_has() -> None:
    """Derived from what the linked tests start, not typed."""
    page = PAGE.read_text(encoding="utf-8")
    derived = _ROW.sub(with_kinds, page)
    if os.environ.get("ACCEPT"):
        PAGE.write_text(derived, encoding="utf-8")
    assert page == derived


@pytest.mark.slow
@pytest.mark.parametrize("number", NUMBERS)
def test_what_is_seen_on_the_wire_is_proven_there(number: str) -> None:
    """Story 23 was shown by a pure function, and happened on the running system."""
    proven = bool(kinds(rows()[number][1]) & ON_THE_WIRE)
    assert proven == (number not in OFF_THE_WIRE), f"story {number} has no proof by nodes or processes"


@pytest.mark.parametrize(
    ("proof", "kind"),
    [
        ("scenarios/war_stories/A04_accepted_after_pause.scenario.yaml", Kind.SIMULATED),
        ("charts/broken/no_deadline.yaml", Kind.CHECK),
        ("docs/test_outcomes.py", Kind.SIMULATED),
        ("plugins/nav/test_approach.py", Kind.FUNCTION),
        # Beside tests of nodes, and none.
        ("lupin_ros/orchestrator/test_readiness.py::test_a_cancelled_wait_is_silent", Kind.FUNCTION),
        ("lupin_ros/orchestrator/test_messages.py", Kind.FUNCTION),
        # Its fixture is that of the folder, which asks for one of the module.
        (f"{WIRE}/test_base.py::test_a_goal_that_is_accepted_twice_is_driven_once", Kind.SYSTEM),
        # Its node is in this process, by a class which could start it as one of its own.
        ("lupin_ros/plugins/arm/test_library.py::test_calls_of_torque_do_not_overlap", Kind.NODES),
        ("lupin_ros/plugins/arm/test_library.py::test_a_process_that_is_killed_leaves_a_mark", Kind.SYSTEM),
        ("lupin_ros/system/console/test_present.py::test_an_orchestrator_that_is_not_heard", Kind.SYSTEM),
    ],
)  # fmt: skip
def test_a_kind_of_proof_is_what_runs_in_it(proof: str, kind: Kind) -> None:
    file, _, test = proof.partition("::")
    assert kind_of(ROOT / "tests" / file, test) is kind


@pytest.mark.parametrize("scenario", scenarios(), ids=lambda path: path.name.removesuffix(SUFFIX))
def test_a_scenario_stands_in_its_row_and_says_how_it_would_fail(scenario: Path) -> None:
    """Named by its number, linked from it, and its first line tells what the old flaw would do to it."""
    linked = [(PAGE.parent / target).resolve() for _, target in rows()[story_of(scenario)][1]]
    assert scenario.resolve() in linked
    first = scenario.read_text(encoding="utf-8").partition("\n")[0]
    assert re.match(r"# (The old|Old) flaw: ", first), first
