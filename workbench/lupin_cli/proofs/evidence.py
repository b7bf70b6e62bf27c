"""Records the origin of proofs, as evidence: engine, hashes of files and catalogs, date, command line."""

from __future__ import annotations

import functools
import hashlib
import inspect
import os
import platform
import shlex
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

import lupin_engine
import lupin_verify
from lupin_engine.missions import LoadedMissions
from lupin_engine.plugin import Plugin, sections

#: What the words of a proof mean.
MEANINGS: Mapping[str, str] = {
    "Situation": "All that the engine remembers at one moment, without what decides nothing: texts, counters,"
    " and values that are only passed on.",
    "Transition": "A move of the world in a situation: an answer, a value, a request, an event, a deadline.",
    "Not relevant": "No explored step concerns the property: it is not broken, but it was not tested either.",
}
#: What is taken for granted.
ASSUMPTIONS = (
    "The catalogs are true: a server answers with nothing that its catalog does not declare.",
    "If an operation sets a live value, that value is known before the operation succeeds.",
    "Values are divided into classes. Two values of one class lead to the same steps, as far as conditions"
    " compare them with numbers, texts and parameters. Of a list only its length matters.",
    "Values on which no condition depends have one class. It is not shown that an expression has a result for"
    " each of them.",
    "A deadline of 0 s comes before all others. Otherwise two are due at the same moment only if they were"
    " set together.",
    "An order that was given up and holds back no other gets no late answer, unless the bounds say so.",
    "The parameters have the values that are listed.",
    "The robot's clock may come to any time of day between two steps; it is not adjusted. A wait for a time"
    " of day may end at any time; the clock then shows that time.",
)
#: What nobody may conclude.
NOT_SHOWN = (
    "Nothing about servers, drivers, ROS, the network, the robot's physics, or how long a step takes.",
    "Nothing beyond the bounds, and nothing about distances and readings.",
    "Nothing about orders that were given up as lost, which a restarted orchestrator cancels once more,"
    " unless the bounds include late answers.",
    "Nothing about how likely something is: the shortest way to a breach need not be a likely one.",
)


@dataclass(frozen=True)
class Origin:
    """The origin of proofs: date, command line, version of the engine, its sources' hash, processor."""

    date: str
    command: str
    version: str
    engine: str
    machine: str


def origin(context: click.Context) -> Origin:
    """Return the origin of the proofs of this command."""
    date = time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime())
    return Origin(date, _command(context), lupin_engine.__version__, engine_hash(), _machine())


def _command(context: click.Context) -> str:
    """Return the command line with all that is not as usual."""
    words = ["lupin", str(context.info_name)]
    for parameter in context.command.params:
        words += _words_of(parameter, context.params.get(parameter.name or ""))
    return shlex.join(words)


def _words_of(parameter: click.Parameter, value: Any) -> list[str]:
    """Return the words of a command line that set a parameter; none where it has its default."""
    if isinstance(parameter, click.Argument):
        return list(value or ())
    if value is None or value is False or value == parameter.default:
        return []
    words: list[str] = []
    for one in value if isinstance(value, tuple) else (value,):
        words += [parameter.opts[0], *([] if one is True else [str(one)])]
    return words


def _machine() -> str:
    """Return the processor in words, and how many cores it has."""
    found = platform.processor() or platform.machine()
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return f"{next(named, found)}, {os.cpu_count()} cores"


@functools.cache
def engine_hash() -> str:
    """Return the SHA-256 of the source files of the engine and of the prover, each with its name."""
    found = hashlib.sha256()
    for package in (Path(lupin_engine.__file__).parent, Path(lupin_verify.__file__).parent):
        for file in sorted(package.rglob("*.py")):
            found.update(f"{package.name}/{file.relative_to(package).as_posix()}\0".encode())
            found.update(hashlib.sha256(file.read_bytes()).digest())
    return found.hexdigest()


def catalogs_hash(loaded: LoadedMissions) -> str:
    """Return the SHA-256 of the declarations of the missions' plugins, and of their mocks.

    Of a function it covers the file that it is written in.
    """
    plugins = loaded.chart.catalog.plugins
    used = [plugins[name] for name in sorted(loaded.chart.plugins) if name in plugins]
    declared = [(sections(plugin), sorted(_behaviour(plugin))) for plugin in used]
    return hashlib.sha256(repr(declared).encode()).hexdigest()


def _behaviour(plugin: Plugin) -> Iterator[tuple[str, str]]:
    """Yield the behaviour of a plugin in a proof: the results and values of mocks, functions and readers."""
    for name, operation in plugin.operations.items():
        mock = operation.mock
        yield f"{name} after", repr(mock.after)
        yield f"{name} result", _given(mock.result)
        yield f"{name} values", _given(mock.values)
    for name, function in plugin.functions.items():
        yield name, _given(function.bind)
    for name, reader in plugin.readers.items():
        yield name, _given(reader.bind)


def _given(what: Mapping[str, Any] | Callable[..., Any]) -> str:
    if isinstance(what, Mapping):
        return repr(sorted(what.items()))
    inner = inspect.unwrap(what.func if isinstance(what, functools.partial) else what)
    file = inspect.getsourcefile(inner)
    source = hashlib.sha256(Path(file).read_bytes()).hexdigest() if file and Path(file).is_file() else ""
    return f"{getattr(inner, '__qualname__', type(inner).__qualname__)} {source}"
