"""Fills the template of a safety case: system, claims, evidence, assumptions, limits, signatures."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from lupin_cli.proofs.evidence import ASSUMPTIONS, NOT_SHOWN, Origin, catalogs_hash
from lupin_cli.proofs.proof_words import counted, exemptions, last_line, name_of, shown_place, tried_only
from lupin_engine.errors import UsageError
from lupin_engine.properties import LiveMonitor
from lupin_verify import is_own

if TYPE_CHECKING:
    from lupin_engine.missions import LoadedMissions
    from lupin_engine.plugin import Catalog
    from lupin_engine.replay import FieldEvidence
    from lupin_verify import Proof

#: Who signs, each with room for name, date and signature.
_SIGNERS = ("Author of the mission", "Assessor", "Operator of the robot")
#: The sections that a page of proofs lacks.
EVIDENCE, SOURCES, SIGNATURES = "Claims and their evidence", "Evidence as a whole", "Signatures"
#: What stands where evidence was not given.
_NOT_GIVEN = "not given"


class CaseSection(NamedTuple):
    """A heading, and a table whose first row is its head, or a list of sentences."""

    title: str
    rows: Sequence[tuple[str, ...]] = ()
    texts: Sequence[str] = ()


class CaseEvidence(NamedTuple):
    """The evidence beside proofs: of robots, of `lupin test --json` and of `lupin campaign --json`."""

    field: FieldEvidence | None = None
    tests: Mapping[str, Any] | None = None
    campaign: Mapping[str, Any] | None = None


def read_seen(field: Sequence[Path], results: Sequence[Path], catalog: Catalog) -> CaseEvidence:
    """Read journals of robots, and outputs of `lupin test --json` and `lupin campaign --json`.

    Raises:
        JournalError: a folder has no journal.
        UsageError: a file is no such output.
    """
    from lupin_engine.replay import field_evidence

    seen = CaseEvidence(field_evidence(field, catalog) if field else None)
    for file in results:
        try:
            found = json.loads(file.read_text(encoding="utf-8"))
            name = "tests" if "scenarios" in found else "campaign"
            _ = (
                (found["failed"], found["scenarios"])
                if name == "tests"
                else (found["seeds"], found["missions"])
            )
        except (OSError, ValueError, LookupError, TypeError) as problem:
            hint = "expected the output of 'lupin test --json' or 'lupin campaign --json'"
            raise UsageError(f"--seen: {str(file)!r}: {hint}: {problem}") from None
        seen = seen._replace(**{name: found})
    return seen


def safety_case(loaded: LoadedMissions, proof: Proof, by: Origin, seen: CaseEvidence) -> list[CaseSection]:
    """Return the safety case of a mission."""
    cut = map(_cut, proof.cut)
    return [
        CaseSection("System", [("What", "Value"), *_system(loaded, proof, by)]),
        CaseSection(EVIDENCE, list(_claims(proof, seen))),
        CaseSection(SOURCES, [("Source", "Result"), *_sources(proof, seen)]),
        CaseSection("Assumptions", texts=ASSUMPTIONS),
        CaseSection(
            "What was cut, and what is not shown",
            texts=[
                *_exempt(proof),
                *_unreached(loaded, proof),
                *cut,
                *proof.bounds,
                *NOT_SHOWN,
            ],
        ),
        CaseSection("Origin", [("What", "Value"), ("Made on", by.date), ("Command", by.command)]),
        CaseSection(
            SIGNATURES,
            [("Role", "Name", "Date", "Signature"), *((who, "", "", "") for who in _SIGNERS)],
        ),
    ]


def _exempt(proof: Proof) -> Iterator[str]:
    """Yield a sentence for each property that a mission is exempt from."""
    for name, mission, why in exemptions(proof.chart):
        yield f"{name} is not meant of {mission}, because {why}."


def _unreached(loaded: LoadedMissions, proof: Proof) -> Iterator[str]:
    """Yield a sentence for each state that was never entered, and each transition that was never taken."""
    for part in proof.dead:
        sentence = part.sentence(shown_place(loaded, part.place))
        yield f"{sentence[0].upper()}{sentence[1:]}."


def _cut(what: str) -> str:
    return f"The proof is limited to {what}."


def _claims(proof: Proof, seen: CaseEvidence) -> Iterator[tuple[str, ...]]:
    yield "Property", "Claim", "From", "Proof", "Campaign", "On robots", "Nearest"
    watched = LiveMonitor(proof.chart).names
    campaign = {one["name"]: one for one in (seen.campaign or {}).get("properties", ())}
    for one in proof.properties:
        known = one.name in proof.chart.properties
        origin = "mission" if is_own(proof.chart, one.name) else "lifecycle" if known else "engine"
        yield (
            one.name,
            one.says,
            origin,
            f"{one.verdict.value}{tried_only(proof, one)}",
            _violated(campaign.get(one.name)),
            _on_robots(one.name, seen.field) if one.name in watched else "not watched on robots",
            str(seen.field.margins[one.name]) if seen.field and one.name in seen.field.margins else "",
        )


def _violated(found: Mapping[str, Any] | None) -> str:
    return "" if found is None else f"{found['violated_by']} violations, looked at {found['looked_at']} times"


def _on_robots(name: str, field: FieldEvidence | None) -> str:
    return _NOT_GIVEN if field is None else field.counted(name)


def _sources(proof: Proof, seen: CaseEvidence) -> Iterator[tuple[str, str]]:
    yield "Proof", last_line(proof)
    yield "Reached by the proof", str(proof.reached)
    tests, campaign = seen.tests, seen.campaign
    yield "Tests", f"{len(tests['scenarios'])} scenarios, {tests['failed']} failed" if tests else _NOT_GIVEN
    yield (
        "Campaign",
        f"{campaign['missions']} missions of {campaign['seeds']} seeds" if campaign else _NOT_GIVEN,
    )
    if seen.field is None:
        yield "Robots", _NOT_GIVEN
        return
    from lupin_engine.replay import field_lines

    left_out = f"; {len(seen.field.left_out)} not used" if seen.field.left_out else ""
    yield "Robots", f"{counted(seen.field.missions, 'mission')}, simulated robots included{left_out}"
    for line in field_lines(proof.chart, seen.field, {}):
        if not line:
            return
        yield "Coverage on robots", line


def _system(loaded: LoadedMissions, proof: Proof, by: Origin) -> Iterator[tuple[str, str]]:
    """Yield what the case is about."""
    yield "Mission", name_of(loaded, proof.varied)
    yield "Files", ", ".join(loaded.short_names.values())
    yield "SHA-256 of the files", loaded.hash
    yield "Engine", f"Lupin engine {by.version}, SHA-256 of its sources {by.engine}"
    yield "Plugins", ", ".join(loaded.plugins)
    yield "SHA-256 of their catalogs", catalogs_hash(loaded)


def as_markdown(cases: Iterable[tuple[LoadedMissions, Proof, Sequence[CaseSection]]]) -> str:
    """Return safety cases as one Markdown page."""
    return "\n".join(line for one in cases for line in _markdown(*one)) + "\n"


def _markdown(loaded: LoadedMissions, proof: Proof, case: Sequence[CaseSection]) -> Iterator[str]:
    yield f"# Safety case: {name_of(loaded, proof.varied)}\n"
    for section in case:
        yield f"## {section.title}\n"
        for number, row in enumerate(section.rows):
            yield f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in row)} |"
            if not number:
                yield f"|{'---|' * len(row)}"
        yield from (f"- {text}" for text in section.texts)
        yield ""


def as_html(case: Sequence[CaseSection]) -> Iterator[str]:
    """Yield a safety case as parts of a page."""
    for section in case:
        yield f"<h3>{escape(section.title)}</h3>"
        if section.rows:
            head, *rows = section.rows
            cells = [f"<tr>{''.join(f'<th>{escape(cell)}</th>' for cell in head)}</tr>"]
            cells += (f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows)
            yield f"<table>{''.join(cells)}</table>"
        if section.texts:
            yield f"<ul>{''.join(f'<li>{escape(text)}</li>' for text in section.texts)}</ul>"
