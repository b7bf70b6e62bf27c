"""`lupin plugin`: lists and shows plugins, tests them against the contract, and begins new ones."""

from __future__ import annotations

import json
import sys
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import click

from lupin_cli.files import nearest_name, title_of, write_text
from lupin_engine.errors import LupinError, PluginError, UsageError
from lupin_engine.plugin import (
    NAME,
    Distribution,
    EntryPoint,
    Plugin,
    build_catalog,
    declared_in,
    entry_points,
    find_entry_point,
    load_catalog,
    source_file,
    verified_plugin,
)

if TYPE_CHECKING:
    from lupin_cli.terminal.tables import InstalledPlugin
    from lupin_harness import PluginUnderTest

#: Where the missions of the current folder may be.
_HERE = ("missions", ".")
TEMPLATE = Path(__file__).parents[1] / "plugin_template"
#: What `lupin plugin new` writes -> what it is made of; `%name%` stands for the plugin's name.
FILES: Mapping[str, str] = MappingProxyType(
    {
        "pyproject.toml": "pyproject.toml.txt",
        "README.md": "README.md.txt",
        "lupin_%name%/__init__.py": "package/__init__.py.txt",
        "lupin_%name%/catalog.py": "package/catalog.py.txt",
        "lupin_%name%/switch.py": "package/switch.py.txt",
        "lupin_%name%/client.py": "package/client.py.txt",
        "lupin_%name%/node.py": "package/node.py.txt",
        "tests/test_contract.py": "tests/test_contract.py.txt",
        "tests/test_switch.py": "tests/test_switch.py.txt",
    }
)
#: Files that differ without a node; None: not written.
WITHOUT_NODE: Mapping[str, str | None] = MappingProxyType(
    {"lupin_%name%/node.py": None, "tests/test_contract.py": "tests/test_contract_without_node.py.txt"}
)
#: The mark at the end of lines that are about the node.
_NODE_MARK = " ;;node"
#: The longest name; folders, modules, parameters and codes begin with it.
MAX_NAME = 40


@click.group()
def plugin() -> None:
    """List, show and check plugins, and begin new ones."""


_as_json = click.option("--json", "as_json", is_flag=True, help="Print it as JSON.")


def _echo_json(data: object) -> None:
    click.echo(json.dumps(data, indent=2, ensure_ascii=False))


# -- list, show -------------------------------------------------------------------------------------------


@plugin.command("list")
@_as_json
def list_plugins(as_json: bool) -> int:
    """List the plugins that are installed, and who brought them.

    Exit code: 1 when one of them is refused; the list has the reason.
    """
    from lupin_cli.terminal.tables import print_plugins

    plugins = [_installed(point) for point in entry_points()]
    if as_json:
        _echo_json([asdict(one) for one in plugins])
    else:
        print_plugins(plugins)
    return 1 if any(one.problem for one in plugins) else 0


def _installed(point: EntryPoint) -> InstalledPlugin:
    from lupin_cli.terminal.tables import InstalledPlugin

    name, version = (point.distribution.name, point.distribution.version) if point.distribution else ("", "")
    try:
        found = verified_plugin(point)
    except PluginError as problem:
        return InstalledPlugin(point.name, "", 0, name, version, point.value, str(problem))
    return InstalledPlugin(found.name, found.doc, len(found.operations), name, version, point.value)


@plugin.command()
@click.argument("name")
@_as_json
def show(name: str, as_json: bool) -> int:
    """Show a plugin's operations, functions, live values, and parameters with units and ranges.

    NAME may also be a binding of the missions in the current folder, or its file.

    Example: lupin plugin show nav

    Exit code: 0 shown; 1 it cannot be used; 2 there is none, or the binding has errors.
    """
    from lupin_engine.plugin import sections

    found, origin = _installed_or_bound(name)
    if as_json:
        offers = {section.title: [asdict(entry) for entry in section.entries] for section in sections(found)}
        _echo_json({"name": found.name, "doc": found.doc, "offers": offers})
    else:
        from lupin_cli.terminal.tables import print_plugin

        print_plugin(found, origin)
    return 0


def _installed_or_bound(name: str) -> tuple[Plugin, str]:
    """Return a plugin and where it is from: a package, or a binding of the missions in the current folder.

    Raises:
        UsageError: there is none, or the binding has errors.
        PluginError: the package's plugin cannot be used.
    """
    file = _binding_called(name)
    if file is None:
        point = find_entry_point(name)
        return verified_plugin(point), str(point)
    from lupin_engine.bindings import bound_catalog
    from lupin_engine.chart import Findings

    findings = Findings()
    bound = bound_catalog([file.parent.parent], load_catalog(), {}, findings)
    wrong = any(Path(found.place.file).resolve() == file.resolve() for found in findings.errors)
    if wrong or bound is None or file.stem not in bound.bindings:
        raise UsageError(f"the binding {file} has errors; to see them: lupin check {file}")
    return bound.bindings[file.stem].plugin, str(file)


def _binding_called(name: str) -> Path | None:
    """Return the file of a binding: named itself, or by its name, of the missions in the current folder.

    None where there is no such file.
    """
    named = Path(name)
    files = (
        [named] if named.suffix == ".yaml" else [Path(folder, "bindings", f"{name}.yaml") for folder in _HERE]
    )
    return next((file for file in files if file.is_file()), None)


# -- check ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class RuleVerdict:
    """Whether a plugin keeps a rule of the contract: it does where there are no problems.

    `not_tried` is why that is not known; '' where it is.
    """

    plugin: str
    rule: str
    problems: tuple[str, ...]
    not_tried: str = ""


@plugin.command()
@click.argument("name", required=False)
@click.option("--live", is_flag=True, help="Try its driver too, over ROS 2, with the nodes that it brings.")
@_as_json
def check(name: str | None, live: bool, as_json: bool) -> int:
    """Check that a plugin keeps the contract; without a NAME, all that are installed.

    NAME may be a folder with a pyproject.toml: the plugins that it declares are checked, installed or not.
    With --live, a driver is tried against the nodes that its plugin brings, which are started for that.
    Rules for operations that fail with made-up arguments are not tried; a test gives arguments with which
    they succeed (lupin_harness.DriverContract).
    """
    # Python shows these to tests only; here the author looks. See `lupin_engine.moved`.
    warnings.filterwarnings("default", ".* is now lupin_", DeprecationWarning)
    verdicts: list[RuleVerdict] = []
    printed: set[str] = set()
    for subject in _subjects(name):
        for verdict in _tried(subject, live, is_named=name is not None):
            verdicts.append(verdict)
            if not as_json and (verdict.problems or verdict.not_tried or name is not None):
                _print_verdict(verdict, printed)
    broken = sum(1 for verdict in verdicts if verdict.problems)
    if as_json:
        _echo_json([asdict(verdict) for verdict in verdicts])
    else:
        plugins, rules = len({verdict.plugin for verdict in verdicts}), len(verdicts)
        kept = "all kept" if not broken else f"{broken} broken"
        untried = sum(1 for verdict in verdicts if verdict.not_tried)
        kept += f", {untried} not tried" if untried else ""
        click.echo(f"{plugins} plugin{'s' * (plugins != 1)}, {rules} rule{'s' * (rules != 1)}, {kept}")
    return 1 if broken else 0


def _subjects(name: str | None) -> list[PluginUnderTest]:
    from lupin_harness import PluginUnderTest, find_subject

    if name is None:
        return [PluginUnderTest(point) for point in entry_points()]
    if Path(name).is_dir():
        return _in_folder(Path(name))
    binding = _binding_called(name)
    if binding is not None:
        raise UsageError(f"{name!r} is a binding; it is checked with the missions: lupin check {binding}")
    return [find_subject(name)]


def _in_folder(folder: Path) -> list[PluginUnderTest]:
    """Return the plugins that a project declares, and add its packages to the import path.

    Raises:
        UsageError: it has no pyproject.toml, or declares none there.
    """
    from lupin_harness import PluginUnderTest

    file = folder / "pyproject.toml"
    if not file.is_file():
        raise UsageError(f"{str(folder)!r} has no pyproject.toml, so it declares no plugin")
    sys.path[:0] = [str(folder.resolve()), str(folder.resolve() / "src")]
    project = Distribution(folder.resolve().name, "")
    found = [PluginUnderTest(EntryPoint(name, value, project)) for name, value in declared_in(file)]
    if not found:
        wanted = '[project.entry-points."lupin.plugins"] with NAME = "MODULE:PLUGIN"'
        raise UsageError(f"{file} declares no plugin; it needs {wanted}")
    return found


def _tried(subject: PluginUnderTest, live: bool, is_named: bool) -> Iterator[RuleVerdict]:
    """Yield the verdicts on a plugin; a driver without nodes is not tried, which is an error where named."""
    from lupin_harness import findings

    name = subject.point.name
    try:
        plugin = subject.plugin
    except PluginError as problem:
        yield RuleVerdict(name, "loads", (str(problem),))
        return
    is_tried = live and plugin.client
    if is_tried and not plugin.serving:
        reason = (
            f"plugin {plugin.name!r} brings no node to try its driver with; "
            "derive a test from lupin_harness.DriverContract, with servers of yours"
        )
        if is_named:
            raise UsageError(reason)
        click.echo(f"not tried live: {reason}", err=True)
    for rule, problems in findings(subject).items():
        yield RuleVerdict(name, rule, tuple(problems))
    if is_tried and plugin.serving:
        yield from _tried_live(subject)


def _tried_live(subject: PluginUnderTest) -> Iterator[RuleVerdict]:
    plugin = subject.plugin
    from lupin_ros.launch import prepare_ros

    prepare_ros()
    from lupin_harness import ContractBroken, Lab, NeedsArguments, Setting, Untried, apply, live_cases

    setting = Setting(plugin, nodes=plugin.serving)
    with Lab(setting).open() as lab:
        lab.find_out_whether_it_waits()
        if not lab.setting.waits:
            click.echo(
                f"note: the driver of {plugin.name!r} waits for no server: missing() is empty", err=True
            )
        problems: tuple[str, ...]
        for rule, operation in live_cases(plugin):
            try:
                reason, problems = "", ()
                apply(rule, operation, lab)
            except Untried:
                continue  # the first rule has reported the reason
            except NeedsArguments as needed:
                problems, reason = (), str(needed).splitlines()[0]
            except (ContractBroken, LupinError) as broken:
                problems = tuple(str(broken).splitlines())
            yield RuleVerdict(plugin.name, f"{rule}({operation})" if operation else rule, problems, reason)


def _print_verdict(verdict: RuleVerdict, printed: set[str]) -> None:
    """Print a verdict; a problem that several rules have is printed once."""
    sign = click.style("broken", fg="red") if verdict.problems else click.style("kept  ", fg="green")
    if verdict.not_tried:
        sign = click.style("not tried", fg="yellow")
    click.echo(f"{sign}  {verdict.plugin}: {verdict.rule}")
    if verdict.not_tried:
        click.echo(f"        {verdict.not_tried}")
    new = [problem for problem in verdict.problems if problem not in printed]
    printed.update(new)
    for problem in new or (["as above"] if verdict.problems else []):
        click.echo(f"        {problem}")


# -- new --------------------------------------------------------------------------------------------------


@plugin.command()
@click.argument("name")
@click.argument("folder", required=False)
@click.option("--no-node", is_flag=True, help="Without a node: the server is there already.")
def new(name: str, folder: str | None, no_node: bool) -> int:
    """Begin a plugin: a package of its own, with a catalog, a client, a node and tests.

    NAME is its name in missions, such as lamp. It is written into FOLDER, by default lupin-NAME; existing
    files are never overwritten.

    Example: lupin plugin new lamp

    Exit code: 0 written; 2 the name cannot be one or is taken, or a file exists.
    """
    target = Path(folder or f"lupin-{name}")
    for file in write_plugin(name, target, no_node):
        click.echo(f"wrote {file}")
    click.echo(f"next: pip install --editable {target}; lupin plugin check {name}")
    return 0


def write_plugin(name: str, folder: Path, no_node: bool = False) -> list[Path]:
    """Write a plugin's package into `folder` and return its files.

    Raises:
        UsageError: the name cannot be one, or is taken; a file exists, or cannot be written.
    """
    _check_name(name)
    texts = {folder / _named(file, name): text for file, text in _texts(name, no_node).items()}
    for file in texts:
        if file.exists():
            raise UsageError(f"{str(file)!r} exists; choose another folder, or remove it")
    for file, text in texts.items():
        write_text(file, text)
    return list(texts)


def _check_name(name: str) -> None:
    if not NAME.fullmatch(name) or len(name) > MAX_NAME:
        wanted = f"up to {MAX_NAME} lower-case letters, digits and underscores, such as lamp"
        raise UsageError(f"{name!r} cannot be the name of a plugin: write {wanted}{nearest_name(name)}")
    try:
        build_catalog([Plugin(name, "A new one.")])
    except PluginError as problem:
        raise UsageError(f"{name!r} cannot be the name of a plugin: {problem}") from None
    taken = {point.name: point for point in entry_points()}
    if name in taken:
        whose = taken[name].distribution
        raise UsageError(f"there is a plugin {name!r} already, from {whose}; choose another name")
    if source_file(f"lupin_{name}") is not None:
        raise UsageError(f"there is a package lupin_{name} already; choose another name")


def _texts(name: str, no_node: bool) -> dict[str, str]:
    files: dict[str, str | None] = {**FILES, **(WITHOUT_NODE if no_node else {})}
    return {file: _filled(source, name, no_node) for file, source in files.items() if source is not None}


def _filled(source: str, name: str, no_node: bool) -> str:
    lines = (TEMPLATE / source).read_text(encoding="utf-8").splitlines()
    kept = [line for line in lines if not (no_node and line.endswith(_NODE_MARK))]
    return _named("".join(f"{line.removesuffix(_NODE_MARK)}\n" for line in kept), name)


def _named(text: str, name: str) -> str:
    return text.replace("%name%", name).replace("%Title%", title_of(name))
