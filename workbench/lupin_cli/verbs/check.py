"""`lupin check`: prints all findings of the checker about missions.

Exit codes: 0 nothing is wrong; 1 there are errors, or with `--strict` warnings; 2 wrong usage.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from lupin_engine.errors import Diagnostic, LupinError, Problems, Severity, UsageError
from lupin_engine.plugin import Catalog, load_catalog
from lupin_engine.sim import SUFFIX

if TYPE_CHECKING:
    from lupin_cli.terminal.findings import Checked
    from lupin_engine.bindings import BoundCatalog

#: Kind of file -> the folder beside the missions in which such files stand.
_BESIDE = {"part": "parts", "binding": "bindings"}


@click.command()
@click.argument("paths", nargs=-1)
@click.option("--json", "as_json", is_flag=True, help="Print the findings as a JSON list.")
@click.option("--sarif", "as_sarif", is_flag=True, help="Print the findings as SARIF 2.1.0, for CI.")
@click.option("--github", "as_github", is_flag=True, help="Print the findings as annotations of a workflow.")
@click.option("--strict", is_flag=True, help="Warnings count like errors for the exit code.")
@click.option("--watch", "-w", is_flag=True, help="Check again whenever a file changes; Ctrl-C ends.")
@click.option(
    "--prove",
    "budget",
    metavar="DURATION",
    help="Explore every way that the missions can go, too, for at most this time, such as '60 s'.",
)
@click.option("--expand", is_flag=True, help="Print the lifecycle as one file, with what it extends.")
@click.option(
    "--explain", metavar="RULE", help="Tell what a rule protects, with an example, and check nothing."
)
def check(
    paths: tuple[str, ...],
    as_json: bool,
    as_sarif: bool,
    as_github: bool,
    strict: bool,
    watch: bool,
    budget: str | None,
    expand: bool,
    explain: str | None,
) -> int:
    """Check missions and report all mistakes in them.

    A warning is accepted where the comment '# accept RULE: REASON' stands on its line or just above it: it is
    listed as a note then, and does not count.

    PATHS are mission files, lifecycles, parts, folders, or names of missions; without any, the missions of
    the folder missions are checked, or where there is none the shipped ones.

    Exit code: 0 nothing is wrong, 1 there are errors (with --strict also warnings), 2 wrong usage. Warnings
    alone leave it at 0.
    """
    if explain is not None:
        from lupin_cli.terminal.findings import wants_colour
        from lupin_cli.terminal.rule_page import rule_text

        click.echo(rule_text(explain), color=wants_colour())
        return 0
    if expand:
        return print_expanded(paths)
    forms = [
        form for form, wanted in (("json", as_json), ("sarif", as_sarif), ("github", as_github)) if wanted
    ]
    problems = Problems(UsageError)
    named = " and ".join(f"--{form}" for form in forms)
    if len(forms) > 1:
        problems.add(f"{named} are different forms of the same findings; use one of them")
    if budget is not None and watch:
        problems.add("--prove takes its time; leave out --watch")
    if watch and forms:
        problems.add(f"--watch is for people and {named} for programs; use one of them")
    problems.raise_any()
    if watch:
        return watch_paths(paths, strict)
    return check_paths(paths, forms[0] if forms else "text", strict, budget)


def _proven(paths: Sequence[str | Path], seconds: float, verbose: bool) -> tuple[Diagnostic, ...]:
    """Return the broken properties of missions in `paths`; `verbose` as for `prove_within`."""
    from lupin_cli.verbs.prove import prove_within
    from lupin_engine.missions import mission_folders

    files = [file for name in paths or mission_folders()[:1] for file in _meant_by(str(name))[1]]
    return prove_within(list(dict.fromkeys(files)), seconds, verbose)


def check_paths(
    paths: Sequence[str | Path], form: str = "text", strict: bool = False, budget: str | None = None
) -> int:
    """Check the missions of `paths`, print the findings and return the exit code.

    With a `budget` of time, missions without an error are proven as well.

    Raises:
        UsageError: a path does not exist, or the budget is no duration.
        PluginError: the installed plugins cannot be used.
    """
    from lupin_cli.terminal.excerpt import Sources
    from lupin_cli.terminal.findings import FORMS, wants_colour
    from lupin_engine.chart import accepted

    seconds = None
    if budget is not None:
        from lupin_cli.verbs.prove import read_budget

        seconds = read_budget("--prove", budget)
    checked = run_check(paths, load_catalog())
    if seconds is not None and not checked.count(Severity.ERROR):
        broken, sources = _proven(paths, seconds, form == "text"), Sources()
        shown = (accepted(one, sources.lines(one.place.file)) for one in broken)
        checked = replace(checked, found=(*checked.found, *shown))
    text = FORMS[form](checked)
    if text:
        click.echo(text, color=wants_colour())
    return checked.exit_code(strict)


def print_expanded(paths: Sequence[str | Path]) -> int:
    """Print the lifecycle of `paths` as one file, without comments.

    Raises:
        UsageError: a path does not exist, or they have several lifecycles.
        ChartError: the lifecycle cannot be read, or an override in it is wrong.
    """
    from lupin_engine.missions import expanded, mission_folders
    from lupin_engine.replay import yaml_text

    lifecycles = dict.fromkeys(_meant_by(str(path))[0] for path in paths or mission_folders()[:1])
    if len(lifecycles) > 1:
        raise UsageError(f"--expand prints one lifecycle, not {', '.join(map(str, lifecycles))}")
    click.echo(yaml_text(expanded(*lifecycles)), nl=False)
    return 0


def watch_paths(
    paths: Sequence[str | Path],
    strict: bool = False,
    wait: Callable[[], None] | None = None,
    clock: Callable[[], str] = lambda: time.strftime("%H:%M:%S"),
) -> int:
    """Check the missions of `paths` whenever one of their files changes, until Ctrl-C.

    Args:
        wait: called between two checks of the files; default: a short sleep.
        clock: returns the time that is shown.

    Returns:
        The exit code of the last check.

    Raises:
        UsageError: a path does not exist when this begins; later that is a line like others.
    """
    from lupin_cli.terminal.findings import as_text, counted
    from lupin_cli.watch import PAUSE_S, changes

    catalog = load_catalog()
    code, first = 0, True
    try:
        for _ in changes(lambda: _watched(paths), wait or (lambda: time.sleep(PAUSE_S))):
            try:
                checked = run_check(paths, catalog)
                text, code = as_text(checked), checked.exit_code(strict)
            except LupinError as problem:
                if first:
                    raise
                text, code = str(problem), problem.exit_code
            first = False
            click.clear()
            click.echo(
                f"{text}\n{clock()}  watching {counted(len(set(_watched(paths))), 'file')}; Ctrl-C ends"
            )
    except KeyboardInterrupt:
        click.echo()
    return code


# -- what is checked --------------------------------------------------------------------------------------


def run_check(paths: Sequence[str | Path], catalog: Catalog) -> Checked:
    """Check the missions of `paths`, each file once. Errors as for `check_paths`."""
    from lupin_cli.terminal.findings import Checked
    from lupin_engine.bindings import BINDINGS, bound_catalog
    from lupin_engine.chart import Findings
    from lupin_engine.missions import SAVED, check_sizes, inspect_chart, mission_folders

    groups: dict[Path, dict[Path, None]] = {}
    problems = Problems(UsageError)
    for path in paths or mission_folders()[:1]:
        with problems.collecting():
            lifecycle, missions = _meant_by(str(path))
            groups.setdefault(lifecycle, {}).update(dict.fromkeys(missions))
    problems.raise_any()
    found: dict[Diagnostic, None] = {}
    for root, files in groups.items():
        if files:
            check_sizes(next(iter(files)).parent, list(files))
        inspection = inspect_chart(root, list(files), catalog)
        shown = (d for d in inspection.found if not _is_elsewhere(d, root, files))
        found.update(dict.fromkeys([*shown, *_misfits(inspection.bound)]))
    # A folder can have bindings and no missions yet.
    folders_of_bindings = {Path(path).parent.parent for path in paths if Path(path).parent.name == BINDINGS}
    for folder in folders_of_bindings:
        findings = Findings()
        bound = bound_catalog([folder], catalog, SAVED, findings)
        if bound is not None:
            from lupin_engine.bindings import check_allowed

            check_allowed(bound.bindings.values(), catalog, findings)
        found.update(dict.fromkeys([*findings.all, *_misfits(bound)]))
    return Checked(sum(map(len, groups.values())), tuple(found))


def _misfits(bound: BoundCatalog | None) -> tuple[Diagnostic, ...]:
    """Return the findings of bindings that do not fit the interfaces installed here."""
    bindings = bound.bindings.values() if bound is not None else ()
    if not bindings:
        return ()
    from lupin_engine.bindings import check_definition
    from lupin_engine.chart import Findings
    from lupin_ros.interfaces import installed_types, knows_interfaces

    findings = Findings()
    for binding in bindings if knows_interfaces() else ():
        check_definition(binding, installed_types, findings)
    return findings.all


def _is_elsewhere(diagnostic: Diagnostic, lifecycle: Path, missions: Iterable[Path]) -> bool:
    """Whether this is a warning in a lifecycle that stands elsewhere and is used by a single mission file."""
    lent = all(mission.parent != lifecycle.parent for mission in missions)
    return lent and diagnostic.severity < Severity.ERROR and diagnostic.place.file == str(lifecycle)


def _missions_in(folder: Path, name: str) -> list[Path]:
    """Return the missions of a folder, [] where it has a lifecycle only; UsageError: it has neither."""
    from lupin_engine.missions import LOCAL
    from lupin_engine.missions import folders as files

    missions = files.mission_files(folder)
    if not missions and not (folder / files.LIFECYCLE).is_file():
        inside = folder / LOCAL
        hint = f"; did you mean {str(inside)!r}?" if inside.is_dir() else ""
        raise UsageError(f"there are no missions in {name!r}{hint}")
    return missions


def _meant_by(name: str) -> tuple[Path, list[Path]]:
    """Return the lifecycle and the missions to check for a path or a mission's name.

    Raises:
        UsageError: there is none of this name, or the file is no mission, or does not stand beside one.
    """
    from lupin_engine.chart import head
    from lupin_engine.missions import folders as files
    from lupin_engine.missions import mission_folders

    path = Path(name)
    if path.name.endswith(SUFFIX):
        raise UsageError(f"{name!r} is a scenario; scenarios are read by lupin test")
    if path.is_dir():
        return files.lifecycle_in(path), _missions_in(path, name)
    if not path.is_file() or path.suffix == files.BUNDLE:
        mission = files.find_mission(name, mission_folders())
        return files.lifecycle_of(mission), [mission]
    kind = (head(path) or ("", ""))[0]
    if path.name == files.LIFECYCLE or kind == "lifecycle":
        return path, files.mission_files(path.parent)
    if kind in _BESIDE and path.parent.name == _BESIDE[kind]:
        folder = path.parent.parent
        return files.lifecycle_in(folder), files.mission_files(folder)
    if kind in _BESIDE:
        raise UsageError(f"the {kind} {name!r} does not stand in a folder {_BESIDE[kind]!r} beside missions")
    return files.lifecycle_of(path), [path]


def _watched(paths: Sequence[str | Path]) -> Iterator[Path]:
    """Yield every file that the missions of `paths` may depend on."""
    from lupin_engine.missions import find_mission, mission_folders

    for path in paths or mission_folders()[:1]:
        named = Path(path)
        if not named.is_dir() and not named.suffix:
            named = find_mission(str(path), mission_folders())
        folder = named if named.is_dir() else named.parent
        if folder.name in _BESIDE.values():
            folder = folder.parent
        yield from folder.glob("*.yaml")
        for inside in _BESIDE.values():
            yield from folder.glob(f"{inside}/*.yaml")
