"""What `lupin plugin new` does."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import click

from lupin_engine.cli.files import nearest_name, title_of, write_text
from lupin_engine.errors import PluginError, UsageError
from lupin_engine.plugin.contract import Plugin
from lupin_engine.plugin.discovery import entry_points, source_file
from lupin_engine.plugin.registry import NAME, build_catalog

TEMPLATE = Path(__file__).with_name("plugin_template")
#: What is written -> what it is made of; `%name%` stands for the plugin's name.
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
#: What is different without a node; None: it is not written.
WITHOUT_NODE: Mapping[str, str | None] = MappingProxyType(
    {"lupin_%name%/node.py": None, "tests/test_contract.py": "tests/test_contract_without_node.py.txt"}
)
#: Ends a line that is about the node.
_NODE_MARK = " ;;node"
#: Of a name; folders, modules, parameters and codes begin with it.
MAX_NAME = 40


def work(name: str, folder: str | None, no_node: bool) -> int:
    """Do what the options of `lupin plugin new` say, and return the exit code."""
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
