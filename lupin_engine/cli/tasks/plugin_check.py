"""What `lupin plugin check` does: the harness, without pytest."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import click

from lupin_engine.cli.tasks.plugin import binding_called
from lupin_engine.errors import LupinError, PluginError, UsageError
from lupin_engine.harness.live import apply, cases
from lupin_engine.harness.referee import ContractBroken, Untried
from lupin_engine.harness.rules import Subject, find_subject, findings
from lupin_engine.plugin.discovery import Distribution, EntryPoint, declared_in, entry_points


@dataclass(frozen=True)
class Verdict:
    """What a rule came to; without problems it is kept."""

    plugin: str
    rule: str
    problems: tuple[str, ...]


def work(name: str | None, live: bool, as_json: bool) -> int:
    """Do what the options of `lupin plugin check` say, and return the exit code."""
    verdicts: list[Verdict] = []
    told: set[str] = set()
    for subject in _subjects(name):
        for verdict in _tried(subject, live):
            verdicts.append(verdict)
            if not as_json and (verdict.problems or name is not None):
                _tell(verdict, told)
    broken = sum(1 for verdict in verdicts if verdict.problems)
    if as_json:
        click.echo(json.dumps([asdict(verdict) for verdict in verdicts], indent=2, ensure_ascii=False))
    else:
        plugins, rules = len({verdict.plugin for verdict in verdicts}), len(verdicts)
        kept = "all kept" if not broken else f"{broken} broken"
        click.echo(f"{plugins} plugin{'s' * (plugins != 1)}, {rules} rule{'s' * (rules != 1)}, {kept}")
    return 1 if broken else 0


def _subjects(name: str | None) -> list[Subject]:
    if name is None:
        return [Subject(point) for point in entry_points()]
    if Path(name).is_dir():
        return _in_folder(Path(name))
    binding = binding_called(name)
    if binding is not None:
        raise UsageError(f"{name!r} is a binding; it is checked with the missions: lupin check {binding}")
    return [find_subject(name)]


def _in_folder(folder: Path) -> list[Subject]:
    """Return the plugins that a project declares; its packages are found as if it was installed."""
    file = folder / "pyproject.toml"
    if not file.is_file():
        raise UsageError(f"{str(folder)!r} has no pyproject.toml, so it declares no plugin")
    sys.path[:0] = [str(folder.resolve()), str(folder.resolve() / "src")]
    project = Distribution(folder.resolve().name, "", folder)
    found = [Subject(EntryPoint(name, value, project)) for name, value in declared_in(file)]
    if not found:
        wanted = '[project.entry-points."lupin.plugins"] with NAME = "MODULE:PLUGIN"'
        raise UsageError(f"{file} declares no plugin; it needs {wanted}")
    return found


def _tried(subject: Subject, live: bool) -> Iterator[Verdict]:
    name = subject.point.name
    try:
        plugin = subject.plugin
    except PluginError as problem:
        yield Verdict(name, "loads", (str(problem),))
        return
    for rule, problems in findings(subject).items():
        yield Verdict(name, rule, tuple(problems))
    if live and plugin.client:
        yield from _tried_live(subject)


def _tried_live(subject: Subject) -> Iterator[Verdict]:
    plugin = subject.plugin
    if not plugin.nodes:
        raise UsageError(
            f"plugin {plugin.name!r} brings no node to try its driver with; "
            "derive a test from lupin_engine.harness.cases.DriverContract, with servers of yours"
        )
    from lupin_engine.ros.launch.requirements import prepare_ros

    prepare_ros()
    from lupin_engine.harness.bench import Lab, Setting

    setting = Setting(plugin, nodes=plugin.nodes)
    with Lab(setting).open() as lab:
        for rule, operation in cases(plugin):
            try:
                apply(rule, operation, lab)
                problems: tuple[str, ...] = ()
            except Untried:
                continue  # the first rule has told why
            except (ContractBroken, LupinError) as broken:
                problems = tuple(str(broken).splitlines())
            yield Verdict(plugin.name, f"{rule}({operation})" if operation else rule, problems)


def _tell(verdict: Verdict, told: set[str]) -> None:
    """Print a verdict; what several rules meet is told by the first of them."""
    sign = click.style("broken", fg="red") if verdict.problems else click.style("kept  ", fg="green")
    click.echo(f"{sign}  {verdict.plugin}: {verdict.rule}")
    new = [problem for problem in verdict.problems if problem not in told]
    told.update(new)
    for problem in new or (["as above"] if verdict.problems else []):
        click.echo(f"        {problem}")
