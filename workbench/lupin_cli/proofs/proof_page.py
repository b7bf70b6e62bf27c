"""Writes a self-contained HTML report of proofs, for a safety case."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from html import escape

from lupin_cli.proofs.evidence import ASSUMPTIONS, MEANINGS, NOT_SHOWN, Origin, catalogs_hash
from lupin_cli.proofs.proof_words import counted, name_of, shown_place, summary, tried_only
from lupin_cli.proofs.safety_case import EVIDENCE, SIGNATURES, SOURCES, CaseSection, as_html
from lupin_engine.diagram import Counts, coloured, outline
from lupin_engine.diagram import svg as draw
from lupin_engine.errors import near
from lupin_engine.missions import LoadedMissions
from lupin_engine.plugin import ANY, value_text
from lupin_engine.replay import exact_columns, laid_out, svg, timeline
from lupin_verify import FailingScenario, Proof, Proven, why_none

_STYLE = """
body { font: 15px/1.5 Inter, "DejaVu Sans", Arial, sans-serif; margin: 2rem auto; max-width: 76rem; }
body { color: #1f2933; padding: 0 1rem; } h2 { border-top: 2px solid #d5dbe1; padding-top: 1rem; }
table { border-collapse: collapse; } td, th { padding: .25rem 1.2rem .25rem 0; text-align: left; }
td, th { vertical-align: top; border-bottom: 1px solid #e4e8ec; } td:first-child { white-space: nowrap; }
code { font-size: .85em; overflow-wrap: anywhere; } td:last-child { overflow-wrap: anywhere; }
pre { background: #f5f7f9; overflow-x: auto; padding: .6rem; } svg { height: auto; max-width: 100%; }
.holds { color: #2d7a4b; } .broken { color: #cf4458; } .not-proven, .not-shown, .warning { color: #a15c00; }
.not-relevant { color: #66727f; } .result { border-left: .4rem solid; padding: .4rem .8rem; }
.result { background: #f5f7f9; font-weight: 600; } .verdict { white-space: nowrap; font-weight: 600; }
details { margin: 1rem 0; } summary { cursor: pointer; font-weight: 600; }
@media (max-width: 40rem) { td { border: 0; display: block; } tr { border-bottom: 1px solid #d5dbe1; } }
"""
#: How wide a story is on the page, in characters.
_COLUMNS = 110
#: What the colours of the picture mean.
_LEGEND = "reached; pale: never"
#: What the page calls a verdict.
_VERDICTS = {"not relevant": "not relevant: never applied"}
#: A proof with its missions, and the scenarios that were written for what is broken, by the property.
ProvenMission = tuple[LoadedMissions, Proof, Mapping[str, FailingScenario]]


def proof_page(
    proofs: Sequence[ProvenMission], made_by: Origin, cases: Sequence[Sequence[CaseSection]] = ()
) -> str:
    """Return the page.

    Args:
        proofs: the missions, their proofs, and the scenarios of broken properties.
        made_by: the origin of the proofs.
        cases: the safety case of each.
    """
    parts = [[*_mission(*one)] for one in proofs]
    for found, case in zip(parts, cases, strict=bool(cases)):
        # The page has the rest in words of its own.
        found += as_html([one for one in case if one.title in (EVIDENCE, SOURCES, SIGNATURES)])
    body = "\n".join(part for found in parts for part in found)
    head = "<meta charset='utf-8'><meta name='viewport' content='width=device-width'>"
    head += f"<title>Proof, {escape(made_by.date)}</title><style>{_STYLE}</style>"
    made = f"<h1>Proof</h1>{_table(_made(made_by))}"
    results = [(escape(name_of(loaded, proof.varied)), _result(proof)) for loaded, proof, _ in proofs]
    every = f"<h2>Results</h2>{_table(results)}" if len(results) > 1 else ""
    text = "\n".join((made, every, body, *_meaning()))
    return f"<!doctype html><html lang='en'><head>{head}</head><body>{text}</body></html>\n"


def _made(by: Origin) -> Iterator[tuple[str, ...]]:
    yield "Made on", escape(by.date)
    yield "Command", f"<code>{escape(by.command)}</code>"
    yield "Engine", f"Lupin engine {escape(by.version)}, SHA-256 of its sources <code>{by.engine}</code>"
    yield "Processor", escape(by.machine)


def _meaning() -> Iterator[str]:
    """Yield an explanation of the verdicts, for a reader without the documentation."""
    yield "<h2>What the words mean</h2>"
    yield _table((escape(word), escape(text)) for word, text in MEANINGS.items())
    yield f"<h2>Assumptions</h2>{_list(ASSUMPTIONS)}"
    yield f"<h2>What a proof does not show</h2>{_list(NOT_SHOWN)}"


def _mission(loaded: LoadedMissions, proof: Proof, written: Mapping[str, FailingScenario]) -> Iterator[str]:
    yield f"<h2>{escape(name_of(loaded, proof.varied))}</h2>"
    yield f"<p class='result {_kind(proof)}'>{escape(_short(loaded, summary(proof)))}</p>"
    yield _table(_facts(loaded, proof))
    rows = [(f"<code>{one.name}</code>", escape(one.says), _verdict(proof, one)) for one in proof.properties]
    yield "<h3>Properties</h3>" + _table(rows)
    for one in (*proof.broken, *proof.not_shown):
        yield from _counterexample(loaded, one, written.get(one.name))
    yield f"<h3>What was explored, and its bounds</h3>{_list(proof.bounds)}"
    if proof.dead:
        dead = [part.sentence(shown_place(loaded, part.place)) for part in proof.dead]
        yield f"<h3>Never reached</h3>{_list(dead)}"
    yield f"<details><summary>Parameters</summary>{_table(_parameters(proof))}</details>"
    flags = Counts(dict.fromkeys(proof.entered, 1), dict.fromkeys(proof.taken, 1), _LEGEND, counted=False)
    yield f"<h3>What was reached</h3><p>{proof.reached}.</p>{draw(coloured(outline(proof.chart), flags))}"


def _facts(loaded: LoadedMissions, proof: Proof) -> Iterator[tuple[str, ...]]:
    progress = proof.progress
    deep = counted(progress.depth, "move")
    yield "Situations", f"{progress.situations:,}, up to {deep} deep"
    yield "Transitions", f"{progress.transitions:,}"
    yield "Steps of the machine", f"{progress.steps:,}; other transitions are known from equal steps"
    if not proof.complete:
        yield "Still to explore", f"{counted(progress.waiting, 'situation')}, and what follows"
    yield "Coverage", escape(str(proof.reached))
    yield "Time", f"{proof.seconds:.1f} s, {proof.processor:.1f} s of the processor"
    yield "Files", escape(", ".join(loaded.short_names.values()))
    yield "SHA-256 of the files", f"<code>{loaded.hash}</code>"
    yield "SHA-256 of the catalogs", f"<code>{catalogs_hash(loaded)}</code>, mocks and functions included"


def _parameters(proof: Proof) -> Iterator[tuple[str, ...]]:
    known = proof.chart.parameters
    for name, value in sorted(proof.parameters.items()):
        kind = known[name].type if name in known else ANY
        unit = f" {kind.unit}" if kind.unit and not isinstance(value, (list, tuple)) else ""
        yield f"<code>{escape(name)}</code>", escape(f"{value_text(value)}{unit}")


def _kind(proof: Proof) -> str:
    is_proven = proof.complete and not proof.not_shown
    return "broken" if proof.broken else "holds" if is_proven else "not-proven"


def _result(proof: Proof) -> str:
    return f"<b class='{_kind(proof)}'>{escape(summary(proof))}</b>"


def _short(loaded: LoadedMissions, text: str) -> str:
    """Return a text with the files of missions as they are called in their folder."""
    for name, short in loaded.short_names.items():
        for long in (name, near(name)):
            text = text.replace(f"{long}:", f"{short}:")
    return text


def _verdict(proof: Proof, one: Proven) -> str:
    """Return the verdict in its colour; that an author's own property never applied is a warning."""
    verdict = _VERDICTS.get(one.verdict.value, one.verdict.value)
    kind = "warning" if one in proof.never_applied else _class(one)
    return f"<span class='verdict {kind}'>{verdict}{tried_only(proof, one)}</span>"


def _class(one: Proven) -> str:
    return one.verdict.value.replace(" ", "-")


def _list(texts: Iterable[str]) -> str:
    return f"<ul>{''.join(f'<li>{escape(text)}</li>' for text in texts)}</ul>"


def _counterexample(loaded: LoadedMissions, one: Proven, scenario: FailingScenario | None) -> Iterator[str]:
    title = "Counterexample" if one.verdict is one.verdict.BROKEN else "Not shown"
    yield f"<h3 class='{_class(one)}'>{title}: {escape(one.name)}</h3>"
    yield f"<p>{escape(one.says)}<br>{escape(_short(loaded, one.text))}</p>"
    if scenario is None:
        yield f"<p>{escape(why_none(one))}</p>"
        yield "<ol>" + "".join(f"<li>{escape(text)}</li>" for text in one.moves) + "</ol>"
        return
    story = scenario.lines
    columns = exact_columns(story, _COLUMNS)
    rows = (row for line in story for row in laid_out(line, columns))
    lines = "\n".join(["".join(text for text, _ in row) for row in rows] + [scenario.rest])
    yield f"<pre>{escape(lines.rstrip())}</pre>{svg(timeline(scenario.run))}"
    name = f"As a scenario: {escape(scenario.file.name)}"
    yield f"<details><summary>{name}</summary><pre>{escape(scenario.text)}</pre></details>"


def _table(rows: Iterable[tuple[str, ...]]) -> str:
    return (
        "<table>"
        + "".join(f"<tr>{''.join(f'<td>{cell}</td>' for cell in row)}</tr>" for row in rows)
        + "</table>"
    )
