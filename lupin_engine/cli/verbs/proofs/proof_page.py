"""What was proven as one page that needs nothing else: for a safety case, and for whoever was not there."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from html import escape

from lupin_engine import __version__
from lupin_engine.cli.verbs.proofs.proof_words import name_of, result, shown_place
from lupin_engine.diagram.outline import outline
from lupin_engine.diagram.svg import svg as draw
from lupin_engine.diagram.trace import Counts, coloured
from lupin_engine.missions.load import LoadedMissions
from lupin_engine.plugin.describe import sections
from lupin_engine.replay.story import exact_columns, laid_out
from lupin_engine.replay.timeline import timeline
from lupin_engine.replay.timeline_svg import svg
from lupin_engine.verify.proof import Proof, Proven
from lupin_engine.verify.story import FailingScenario, why_none

_STYLE = """
body { font: 15px/1.5 Inter, "DejaVu Sans", Arial, sans-serif; margin: 2rem auto; max-width: 76rem; }
table { border-collapse: collapse; } td, th { padding: .2rem .8rem .2rem 0; text-align: left; }
td, th { vertical-align: top; border-bottom: 1px solid #e4e8ec; }
pre { background: #f5f7f9; overflow-x: auto; padding: .6rem; } svg { height: auto; max-width: 100%; }
.holds { color: #2d7a4b; } .broken { color: #cf4458; }
"""

#: How wide a story is on the page, in characters.
_COLUMNS = 110
#: A proof with its missions, and the scenarios that were written for what is broken, by the property.
ProvenMission = tuple[LoadedMissions, Proof, Mapping[str, FailingScenario]]


def proof_page(proofs: Sequence[ProvenMission], date: str) -> str:
    """Return the page.

    Args:
        proofs: what was proven, and of which missions.
        date: when, as people write it.
    """
    body = "\n".join(part for one in proofs for part in _mission(*one))
    head = f"<meta charset='utf-8'><title>Proof, {escape(date)}</title><style>{_STYLE}</style>"
    told = f"<h1>Proof</h1><p>Made on {escape(date)} by Lupin engine {escape(__version__)}.</p>"
    return f"<!doctype html><html lang='en'><head>{head}</head><body>{told}\n{body}</body></html>\n"


def _mission(loaded: LoadedMissions, proof: Proof, written: Mapping[str, FailingScenario]) -> Iterator[str]:
    yield f"<h2>{escape(name_of(loaded, proof.varied))}</h2>"
    yield _table(_facts(loaded, proof))
    rows = [(one.name, escape(one.says), _verdict(one)) for one in proof.properties]
    yield "<h3>Properties</h3>" + _table(rows)
    yield "<h3>What was explored, and its bounds</h3><ul>"
    yield from (f"<li>{escape(text)}</li>" for text in proof.bounds)
    yield "</ul>"
    if proof.dead:
        yield "<h3>Never reached</h3><ul>"
        yield from (f"<li>{escape(part.told(shown_place(loaded, part.place)))}</li>" for part in proof.dead)
        yield "</ul>"
    for one in proof.broken:
        yield from _counterexample(one, written.get(one.name))
    states = dict.fromkeys(proof.entered, 1)
    ways = dict.fromkeys(proof.taken, 1)
    picture = coloured(outline(proof.chart), Counts(states, ways, "reached; pale: never"))
    yield f"<h3>What was reached</h3>{draw(picture)}"


def _facts(loaded: LoadedMissions, proof: Proof) -> Iterator[tuple[str, ...]]:
    progress = proof.progress
    yield "Result", _result(proof)
    yield "Situations", f"{progress.situations:,}, up to {progress.depth} moves deep"
    yield "Transitions", f"{progress.transitions:,}, of which {progress.steps:,} were steps of the machine"
    yield "Chart", f"<code>{loaded.hash}</code>"
    yield "Catalogs", f"<code>{_catalogs(loaded)}</code>"
    yield "Files", escape(", ".join(loaded.short_names.values()))


def _result(proof: Proof) -> str:
    kind = "broken" if proof.broken else "holds" if proof.complete else "not-proven"
    return f"<b class='{kind}'>{escape(result(proof))}</b>"


def _catalogs(loaded: LoadedMissions) -> str:
    """Return a name for what the plugins that the missions use declare."""
    plugins = loaded.chart.catalog.plugins
    told = [sections(plugins[name]) for name in sorted(loaded.chart.plugins) if name in plugins]
    return hashlib.sha256(repr(told).encode()).hexdigest()


def _verdict(one: Proven) -> str:
    return f"<span class='{one.verdict.value.replace(' ', '-')}'>{one.verdict.value}</span>"


def _counterexample(one: Proven, scenario: FailingScenario | None) -> Iterator[str]:
    yield f"<h3 class='broken'>{escape(one.name)}</h3><p>{escape(one.text)}</p>"
    if scenario is None:
        yield f"<p>{escape(why_none(one))}</p>"
        yield "<ol>" + "".join(f"<li>{escape(text)}</li>" for text in one.moves) + "</ol>"
        return
    told = scenario.lines
    columns = exact_columns(told, _COLUMNS)
    rows = (row for line in told for row in laid_out(line, columns))
    lines = "\n".join(["".join(text for text, _ in row) for row in rows] + [scenario.rest])
    yield f"<pre>{escape(lines.rstrip())}</pre>{svg(timeline(scenario.run))}"
    yield f"<p>{escape(scenario.file.name)}</p><pre>{escape(scenario.text)}</pre>"


def _table(rows: Iterable[tuple[str, ...]]) -> str:
    return (
        "<table>"
        + "".join(f"<tr>{''.join(f'<td>{cell}</td>' for cell in row)}</tr>" for row in rows)
        + "</table>"
    )
