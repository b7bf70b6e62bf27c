"""`lupin diagram`: draws a mission, or all missions of a folder."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import click

from lupin_engine.errors import ChartError, Diagnostic, Problems, UsageError
from lupin_engine.plugin import Catalog, load_catalog
from lupin_engine.sim import SUFFIX

if TYPE_CHECKING:
    from lupin_engine.diagram import Counts, Picture
    from lupin_engine.missions import LoadedMissions

#: Format -> ending of its files.
FORMATS: Mapping[str, str] = MappingProxyType(
    {"mermaid": ".mmd", "scxml": ".scxml", "svg": ".svg", "png": ".png"}
)
#: Ending of an output file -> its format.
_ENDINGS = {ending: name for name, ending in FORMATS.items()} | {".mermaid": "mermaid"}
#: Formats in which a large chart is drawn to a readable depth only.
_PICTURES = ("svg", "png")


@click.command(short_help="Draw a mission.")
@click.argument("mission", required=False)
@click.option(
    "--format",
    "formats",
    type=click.Choice(list(FORMATS)),
    multiple=True,
    help="Default: by the file's name, else mermaid. With --all also several.",
)
@click.option("--output", "-o", type=click.Path(path_type=Path), help="File to write; default: print.")
@click.option("--focus", metavar="STATE", help="Draw this state, and greyed what leads there and from there.")
@click.option("--depth", type=click.IntRange(min=1), help="Draw so many levels; deeper states are collapsed.")
@click.option(
    "--trace",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="Colour what a run visited, and how often: what 'lupin simulate --json' printed.",
)
@click.option(
    "--all",
    "folder",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    help="Draw every mission of a folder; the output is a folder, with an index.",
)
def diagram(
    mission: str | None,
    formats: tuple[str, ...],
    output: Path | None,
    focus: str | None,
    depth: int | None,
    trace: Path | None,
    folder: Path | None,
) -> int:
    """Draw a mission with the lifecycle around it.

    MISSION is the name of a mission (inspection, InspectionMission) or a file. SVG needs nothing but this
    program; PNG needs the package's extra 'diagram'. Mermaid is for documentation sites, SCXML for other
    statechart tools.

    Exit code: 0 drawn, 1 a mission has errors, 2 wrong usage.
    """
    if folder is not None:
        if mission or focus or trace or output is None:
            raise UsageError("--all FOLDER needs --output FOLDER, and takes no MISSION, --focus or --trace")
        _draw_all(folder, formats or ("mermaid", "svg"), depth, output)
        return 0
    if mission is None:
        raise UsageError("name a mission, or a folder of missions with --all FOLDER")
    from lupin_engine.diagram import check_fits, coloured, find_state

    problems = Problems(UsageError)
    with problems.collecting():
        wanted = _format(formats, output)
        if wanted == "scxml" and (focus or depth or trace):
            raise UsageError("SCXML is the whole chart: leave --focus, --depth and --trace out")
    with problems.collecting():
        counts = None if trace is None else _counts(trace)
    with problems.collecting():
        loaded = _loaded(mission, load_catalog())
        if focus is not None:
            find_state(loaded.chart, focus)
    problems.raise_any()
    picture = _picture(loaded, wanted, focus, depth)
    if trace is not None and counts is not None:
        check_fits(picture, counts, trace.name)
        picture = coloured(picture, counts)
    _write(_draw(picture, wanted), output)
    return 0


def _loaded(mission: str, catalog: Catalog) -> LoadedMissions:
    from lupin_engine.missions import load_missions

    if mission.endswith(SUFFIX):
        raise UsageError(_scenario(mission, catalog))
    return load_missions([mission], catalog)


def _format(formats: tuple[str, ...], output: Path | None) -> str:
    if len(formats) > 1:
        raise UsageError("one file has one format; several are for --all")
    named = _ENDINGS.get(output.suffix) if output else None
    if not formats and output is not None and named is None:
        endings = ", ".join(FORMATS.values())
        raise UsageError(f"{str(output)!r} says no format: end it in {endings}, or add --format")
    if formats and named not in (None, formats[0]) and output is not None:
        problem = f"{str(output)!r} ends like {named} but --format says {formats[0]}"
        raise UsageError(f"{problem}: leave --format out, or end the file in {FORMATS[formats[0]]}")
    return formats[0] if formats else named or "mermaid"


def _scenario(name: str, catalog: Catalog) -> str:
    """Return the error about a scenario, which cannot be drawn."""
    from lupin_engine.sim import load_scenario

    mission = load_scenario(name, catalog).mission
    return f"{name!r} is a scenario; for a picture name the mission that it tests: {str(mission)!r}"


def _picture(loaded: LoadedMissions, wanted: str, focus: str | None, depth: int | None) -> Picture:
    """Return the picture to draw."""
    from lupin_engine.diagram import outline, readable_depth

    if wanted == "scxml":
        return outline(loaded.chart, whole=True)
    picture = outline(loaded.chart, focus=focus, depth=depth)
    levels = readable_depth(picture) if wanted in _PICTURES and depth is None else None
    if levels is not None:
        click.echo(f"lupin: drawn {levels} levels deep, to be readable; --depth says how deep", err=True)
        picture = outline(loaded.chart, focus=focus, depth=levels)
    return picture


def _counts(trace: Path) -> Counts:
    from lupin_engine.diagram import Counts
    from lupin_engine.replay import read_steps

    steps = read_steps(trace.read_text(encoding="utf-8", errors="replace"), trace.name).steps
    states = Counter(name for step in steps for name in step.entered)
    if not states:
        raise UsageError(f"the run in {trace.name!r} entered no state")
    ways = Counter(name for step in steps for name in step.taken)
    return Counts(states, ways, f"coloured by {trace.name}: {len(steps)} steps; pale: never visited")


def _draw(picture: Picture, wanted: str) -> bytes:
    """Return a picture in one of the formats."""
    if wanted == "png":
        from lupin_engine.diagram import png

        return png(_text(picture, "svg"))
    return _text(picture, wanted).encode()


def _text(picture: Picture, wanted: str) -> str:
    if wanted == "scxml":
        from lupin_scxml import scxml

        return scxml(picture)
    if wanted == "mermaid":
        from lupin_engine.diagram import mermaid

        return mermaid(picture)
    from lupin_engine.diagram import svg

    return svg(picture)


def _write(content: bytes, output: Path | None) -> None:
    if output is None:
        if content.startswith(b"\x89PNG") and sys.stdout.isatty():
            raise UsageError("a PNG is not for a terminal: name a file with --output")
        click.echo(content, nl=False)
        return
    try:
        output.write_bytes(content)
    except OSError as problem:
        raise UsageError(f"cannot write {str(output)!r}: {problem.strerror}") from problem


def _draw_all(folder: Path, formats: tuple[str, ...], depth: int | None, output: Path) -> None:
    from lupin_engine.diagram import Page, index
    from lupin_engine.missions import mission_files

    files = mission_files(folder)
    if not files:
        raise UsageError(f"there are no missions in {str(folder)!r}")
    missions = _loaded_each(files)
    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise UsageError(f"cannot write {str(output)!r}: {problem.strerror}") from problem
    pages = []
    for file, loaded in zip(files, missions, strict=True):
        names = {wanted: f"{file.stem}{FORMATS[wanted]}" for wanted in formats}
        for wanted, name in names.items():
            picture = _picture(loaded, wanted, None, depth)
            _write(_draw(picture, wanted), output / name)
        mission = loaded.chart.missions[loaded.names[0]]
        pages.append(Page(mission.name, mission.summary, names))
    _write(index(pages).encode(), output / "index.md")


def _loaded_each(files: Sequence[Path]) -> list[LoadedMissions]:
    """Load missions, each for itself; ChartError with the problems of all, those of a shared file once."""
    from lupin_engine.missions import load_missions

    catalog = load_catalog()
    loaded: list[LoadedMissions] = []
    found: set[Diagnostic] = set()
    for file in files:
        try:
            loaded.append(load_missions([str(file)], catalog))
        except ChartError as problem:
            found.update(problem.diagnostics)
    if found:
        raise ChartError(found)
    return loaded
