"""Mutation testing: change the engine in one small way after the other, and see whether a test notices.

    python tools/mutate.py 'lupin_engine/machine/*.py' --json mutants.json

One pytest session collects the tests and never runs them itself. Every test is first run alone, in a fork, to
know its time and which lines it reaches; then every mutant gets a fork of its own that runs the tests which
reach its line, fastest first, until one fails. Nothing is written but the JSON: in a fork the code of living
functions is exchanged, and what has its effect when it is imported (constants, defaults, class bodies) is
imported anew from the changed syntax tree, in a session of its own.

What the JSON calls killed is not tried again while the module is unchanged; survivors are, for tests may have
been added. Property tests run with fewer examples, always the same ones.
"""

from __future__ import annotations

import argparse
import ast
import gc
import hashlib
import importlib.util
import json
import os
import random
import resource
import select
import shutil
import signal
import sys
import tempfile
import time
import types
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from importlib.machinery import ModuleSpec, SourceFileLoader
from itertools import accumulate, zip_longest
from pathlib import Path
from typing import Any

import coverage
import pytest
from _pytest.runner import runtestprotocol
from hypothesis import HealthCheck, Phase, settings
from mutants import Mutant, mutants_of

ROOT = Path(__file__).resolve().parents[1]
PLUGINS_ROOT = "plugins"  # a source root of its own
TESTS = ["tests/chart", "tests/machine", "tests/test_determinism.py", "tests/scenarios"]
MODULES = ["lupin_engine/machine/**/*.py", "lupin_engine/chart/**/*.py"]
#: What would load itself is named here instead: whose distribution has a plugin, its modules are rewritten by
#: pytest when they are imported, and a mutant would be replaced by the original.
PLUGINS = ["pytest_timeout", "_hypothesis_pytestplugin", "lupin_engine.pytest_plugin"]
OPTIONS = [
    *("-q", "-s", "-p", "no:cacheprovider", "-W", "ignore::pytest.PytestAssertRewriteWarning"),
    *("-m", "not ros"),  # their processes are none of the fork's
    *(option for plugin in PLUGINS for option in ("-p", plugin)),
]
EXAMPLES, MEMORY, WALL = 30, 6 << 30, 180.0  # of a property test; bytes and seconds that a fork may use


class Module:
    """A module that is to be changed, with its mutants and what became of them."""

    def __init__(self, path: Path, known: dict[str, Any]) -> None:
        self.path = path
        self.name = path.relative_to(ROOT).as_posix()
        source = path.read_bytes()
        self.source = source.decode().splitlines()
        self.digest = hashlib.sha256(source).hexdigest()
        self.tree = ast.parse(source)
        self.mutants = mutants_of(self.tree)
        same = known if known.get("digest") == self.digest else {}
        self.verdicts: dict[str, dict[str, Any]] = same.get("verdicts", {})

    def changed(self, mutant: Mutant) -> types.CodeType:
        """Return the module's code with one change; good for one mutant in each process."""
        mutant.change()
        code = compile(ast.fix_missing_locations(self.tree), str(self.path), "exec", dont_inherit=True)
        assert isinstance(code, types.CodeType)
        return code

    def count(self, verdict: str) -> int:
        """Return how many mutants had a verdict."""
        return sum(found["verdict"] == verdict for found in self.verdicts.values())


def exchange(code: types.CodeType, living: Iterable[types.FunctionType]) -> bool:
    """Give living functions the code they have in `code`; tell whether exactly that was possible."""
    codes: dict[tuple[str, int], list[types.CodeType]] = {}
    found = [code]
    while found:
        inner = [const for const in found.pop().co_consts if isinstance(const, types.CodeType)]
        found += inner
        for one in inner:
            codes.setdefault((one.co_name, one.co_firstlineno), []).append(one)
    exchanged = False
    for function in living:
        new = codes.get((function.__code__.co_name, function.__code__.co_firstlineno), [])
        if function.__code__ not in new:
            if len(new) != 1:
                return False
            try:
                function.__code__ = new[0]
            except ValueError:  # it closes over something else now, such as `super`
                return False
            exchanged = True
    return exchanged


class Changed(SourceFileLoader):
    """Imports one module from a code object; never from, and never into, a cache."""

    code: types.CodeType

    def get_code(self, fullname: str) -> types.CodeType:
        """Return the code."""
        return self.code

    def find_spec(self, name: str, path: object = None, target: object = None) -> ModuleSpec | None:
        """Be a finder as well."""
        if name != self.name:
            return None
        return importlib.util.spec_from_file_location(name, self.path, loader=self)


def first_failure(items: list[pytest.Item], seconds: dict[str, float]) -> str | None:
    """Run tests until one fails, and return its name; a test that takes too long ends the process."""
    for item, after in zip_longest(items, items[1:]):
        signal.setitimer(signal.ITIMER_PROF, 1.0 + 5 * seconds.get(item.nodeid, 10.0))
        if any(report.failed for report in runtestprotocol(item, log=False, nextitem=after)):
            return item.nodeid
    return None


def tame(items: list[pytest.Item]) -> None:
    """Make property tests short and repeatable."""
    for item in items:
        test = getattr(item, "obj", None)
        given = getattr(test, "_hypothesis_internal_use_settings", None)
        if getattr(test, "is_hypothesis_test", False):
            examples = min(EXAMPLES, given.max_examples if given else EXAMPLES)
            test._hypothesis_internal_use_settings = settings(  # type: ignore[union-attr]
                given, max_examples=examples, derandomize=True, database=None, deadline=None,
                phases=(Phase.explicit, Phase.generate), suppress_health_check=list(HealthCheck),
            )  # fmt: skip


class Again:
    """The session of a fork that imports everything anew."""

    def __init__(self, wanted: list[str], seconds: dict[str, float]) -> None:
        self.wanted, self.seconds = wanted, seconds
        self.failed: str | None = "collection"

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Run the wanted tests."""
        if not session.testsfailed:
            tame(session.items)
            items = {item.nodeid: item for item in session.items}
            self.failed = first_failure([items[i] for i in self.wanted if i in items], self.seconds)
        return True


def fork(work: Callable[[], Any]) -> tuple[int, int]:
    """Let a child do some work and send the result as JSON; return its id and where to read."""
    reader, writer = os.pipe()
    child = os.fork()
    if child:
        os.close(writer)
        return child, reader
    try:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        os.dup2(1, 2)
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        signal.setitimer(signal.ITIMER_PROF, 60.0)
        result = work()
    except BaseException as problem:
        result = {"verdict": "crash", "by": repr(problem)}
    with open(writer, "w", encoding="utf-8") as pipe:
        json.dump(result, pipe)
    os._exit(0)


def collect(children: dict[int, tuple[int, float, Any]], until: int) -> Iterator[tuple[Any, Any]]:
    """Wait until fewer than `until` children are left; yield (about, result), None for one that died."""
    while len(children) >= max(1, until):
        ready, _, _ = select.select(list(children), [], [], 1.0)
        late = [fd for fd, (_, since, _) in children.items() if time.monotonic() - since > WALL]
        for fd in {*ready, *late}:
            child, _, about = children.pop(fd)
            if fd not in ready:
                os.kill(child, signal.SIGKILL)
            with open(fd, encoding="utf-8") as pipe:
                told = pipe.read()
            os.waitpid(child, 0)
            yield about, json.loads(told) if told else None


class Session:
    """The session whose forks do everything."""

    def __init__(self, options: argparse.Namespace, modules: list[Module], seen: coverage.Coverage) -> None:
        self.options, self.modules, self.importing = options, modules, seen
        self.items: dict[str, pytest.Item] = {}
        self.seconds: dict[str, float] = {}
        self.reached: dict[str, dict[str, set[int]]] = {}
        self.living: dict[str, list[types.FunctionType]] = {}

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Measure the tests, then try the mutants; no test runs in this process."""
        self.importing.stop()
        imported = lines_of(self.importing, self.modules)
        tame(session.items)
        self.items = {item.nodeid: item for item in session.items}
        for found in gc.get_objects():
            if isinstance(found, types.FunctionType):
                self.living.setdefault(found.__code__.co_filename, []).append(found)
        gc.freeze()
        if session.testsfailed:
            say(f"{session.testsfailed} test files cannot be imported and are left out")
        self.measure()
        for module in self.modules:
            self.control(module)
            self.try_all(module, set(imported.get(module.name, ())))
        return True

    def measure(self) -> None:
        """Run every test alone; leave out those that fail as it is."""
        for name, told in self.each(self.items, lambda name: self.alone(self.items[name])):
            if told is None or told["by"]:
                say(f"fails without any change, left out: {name}")
                continue
            self.seconds[name] = told["seconds"]
            for module, lines in told["lines"].items():
                self.reached.setdefault(module, {})[name] = set(lines)
        say(f"{len(self.seconds)} tests, {sum(self.seconds.values()):.0f} s one by one")

    def alone(self, item: pytest.Item) -> dict[str, Any]:
        """Run one test; return its outcome, its time and the lines it reaches."""
        seen = watch(self.modules)
        start = time.process_time()
        failed = first_failure([item], {})
        spent = time.process_time() - start
        seen.stop()
        return {"by": failed, "seconds": spent, "lines": lines_of(seen, self.modules)}

    def control(self, module: Module) -> None:
        """Make sure that tests pass when a module is imported anew without any change."""
        code = compile(module.path.read_bytes(), str(module.path), "exec", dont_inherit=True)
        wanted = sorted(self.seconds, key=self.seconds.__getitem__)
        for _, failed in self.each([module], lambda module: import_anew(module, code, wanted, self.seconds)):
            if failed is not None:
                raise SystemExit(f"{module.name} imported anew as it is does not pass: {failed}")

    def each(self, names: Iterable[Any], work: Callable[[Any], Any]) -> Iterator[tuple[Any, Any]]:
        """Yield (name, result) of work done in forks, `--jobs` at a time."""
        children: dict[int, tuple[int, float, Any]] = {}
        for name in names:
            child, fd = fork(lambda name=name: work(name))  # type: ignore[misc]
            children[fd] = (child, time.monotonic(), name)
            yield from collect(children, self.options.jobs)
        yield from collect(children, 0)

    def try_all(self, module: Module, imported: set[int]) -> None:
        """Try the mutants of a module that are not known to be killed."""
        chosen = sample(module, self.options)
        known = {key for key, found in module.verdicts.items() if found["verdict"] in ("killed", "timeout")}
        open_ones = [mutant for mutant in chosen if mutant.key not in known]
        kills: Counter[str] = Counter()
        start = time.monotonic()
        for done, (mutant, told) in enumerate(
            self.each(open_ones, lambda mutant: self.attempt(module, mutant, imported, kills)), 1
        ):
            found = told or {"verdict": "timeout"}
            kills[found.get("by") or ""] += 1
            module.verdicts[mutant.key] = {"line": mutant.line, "was": mutant.was, "now": mutant.now, **found}
            if done % 25 == 0:
                say(f"  {module.name}: {done} of {len(open_ones)}, {module.count('survived')} survived")
                save(self.options, self.modules)
        spent = time.monotonic() - start
        say(f"{module.name}: {len(open_ones)} tried in {spent:.0f} s, {module.count('survived')} survived")
        save(self.options, self.modules)

    def most_promising(self, names: list[str]) -> list[str]:
        """Return the first tests, for `--limit` seconds, and at least one."""
        if not self.options.limit:
            return names
        spent = accumulate(self.seconds[name] for name in names)
        within = [name for name, until in zip(names, spent, strict=True) if until <= self.options.limit]
        return within or names[:1]

    def attempt(
        self, module: Module, mutant: Mutant, imported: set[int], kills: Counter[str]
    ) -> dict[str, Any]:
        """Try one mutant, in a fork."""

        def rank(name: str) -> float:
            return -(kills[name] + 0.1) / (self.seconds[name] + 0.001)

        reached = self.reached.get(module.name, {})
        code = module.changed(mutant)
        if mutant.inside and imported.isdisjoint(mutant.span):
            wanted = sorted((n for n in reached if not reached[n].isdisjoint(mutant.span)), key=rank)
            if not wanted:
                return {"verdict": "survived", "by": "no test reaches it"}
            wanted = self.most_promising(wanted)
            if exchange(code, self.living.get(str(module.path), [])):
                by = first_failure([self.items[name] for name in wanted], self.seconds)
                return {"verdict": "killed" if by else "survived", "by": by}
        else:
            wanted = self.most_promising(sorted(self.seconds, key=rank))
        by = import_anew(module, code, wanted, self.seconds)
        return {"verdict": "killed" if by else "survived", "by": by, "imported": True}


def import_anew(
    module: Module, code: types.CodeType, wanted: list[str], seconds: dict[str, float]
) -> str | None:
    """Forget all modules of this tree and run tests in a new session; return the first that fails."""
    for name in [name for name, loaded in sys.modules.items() if is_ours(loaded)]:
        del sys.modules[name]
    imported_as = module.name.removeprefix(f"{PLUGINS_ROOT}/").removesuffix(".py").replace("/", ".")
    loader = Changed(imported_as, str(module.path))
    loader.code = code
    sys.meta_path.insert(0, loader)
    again = Again(wanted, seconds)
    signal.setitimer(signal.ITIMER_PROF, 60.0)
    pytest.main([*OPTIONS, *sorted({name.partition("::")[0] for name in wanted})], [again])
    return again.failed


def is_ours(loaded: types.ModuleType) -> bool:
    """Tell whether a module or namespace lies in this tree."""
    where = getattr(loaded, "__file__", None) or next(iter(getattr(loaded, "__path__", ())), "")
    return where.startswith(f"{ROOT}{os.sep}") and not where.startswith(f"{ROOT}{os.sep}.venv")


def watch(modules: list[Module]) -> coverage.Coverage:
    """Begin to note the lines that are reached."""
    seen = coverage.Coverage(data_file=None, config_file=False, include=[str(m.path) for m in modules])
    seen.set_option("run:disable_warnings", ["no-data-collected"])
    seen.start()
    return seen


def lines_of(seen: coverage.Coverage, modules: list[Module]) -> dict[str, list[int]]:
    """Return the lines reached, by module."""
    data = seen.get_data()
    found = {module.name: data.lines(str(module.path)) for module in modules}
    return {name: lines for name, lines in found.items() if lines}


def sample(module: Module, options: argparse.Namespace) -> list[Mutant]:
    """Return the mutants to try: all, or as many as asked for, the same ones for the same seed."""
    if not options.sample or len(module.mutants) <= options.sample:
        return module.mutants
    chosen = random.Random(f"{options.seed}:{module.name}").sample(module.mutants, options.sample)
    return sorted(chosen, key=lambda mutant: mutant.line)


def save(options: argparse.Namespace, modules: list[Module]) -> None:
    """Write what is known, so that an interrupted run can go on."""
    if options.json:
        told = json.loads(options.json.read_text()) if options.json.exists() else {}
        for module in modules:
            if module.verdicts:
                told[module.name] = {
                    "digest": module.digest, "mutants": len(module.mutants), "verdicts": module.verdicts
                }  # fmt: skip
        options.json.write_text(json.dumps(told, indent=1))


def say(text: str) -> None:
    """Show progress."""
    print(text, flush=True)


def report(modules: list[Module]) -> None:
    """Print the figures by module, and every survivor."""
    total: Counter[str] = Counter()
    say("\n| module | mutants | tried | killed | of these by timeout | survived | score |")
    say("|---|---|---|---|---|---|---|")
    for module in modules:
        tried, survived, late = len(module.verdicts), module.count("survived"), module.count("timeout")
        total.update(mutants=len(module.mutants), tried=tried, survived=survived, late=late)
        say(f"| `{module.name}` | {_row(len(module.mutants), tried, survived, late)} |")
    say(f"| all | {_row(total['mutants'], total['tried'], total['survived'], total['late'])} |\n")
    for module in modules:
        for found in sorted(module.verdicts.values(), key=lambda found: found["line"]):
            if found["verdict"] not in ("killed", "timeout"):
                line, told = module.source[found["line"] - 1].strip(), found.get("by")
                about = f"  ({found['verdict']}: {told})" if told else ""
                say(f"{module.name}:{found['line']}: {line}\n    {found['was']} -> {found['now']}{about}")


def _row(mutants: int, tried: int, survived: int, late: int) -> str:
    score = f"{100 * (tried - survived) / tried:.1f} %" if tried else ""
    return f"{mutants} | {tried} | {tried - survived} | {late} | {survived} | {score}"


def main() -> None:
    """Read the command line and do it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("modules", nargs="*", default=MODULES, help="globs, from the root of the checkout")
    parser.add_argument("--tests", nargs="+", default=TESTS, help="what to run")
    parser.add_argument("--sample", type=int, default=0, help="at most that many mutants of each module")
    parser.add_argument("--seed", type=int, default=1, help="which ones")
    parser.add_argument("--limit", type=float, default=0, help="at most that many seconds of tests for each")
    parser.add_argument("--jobs", type=int, default=1, help="forks at a time")
    parser.add_argument("--json", type=Path, help="where the verdicts are kept, and go on from")
    parser.add_argument("--count", action="store_true", help="only say how many mutants there are")
    options = parser.parse_args()
    options.json = options.json and options.json.resolve()
    os.chdir(ROOT)
    known = json.loads(options.json.read_text()) if options.json and options.json.exists() else {}
    paths = sorted({path for glob in options.modules for path in ROOT.glob(glob) if path.suffix == ".py"})
    modules = [Module(path, known.get(path.relative_to(ROOT).as_posix(), {})) for path in paths]
    if options.count:
        for module in modules:
            say(f"{len(module.mutants):5}  {module.name}")
        return
    sys.path[:0] = [str(ROOT), str(ROOT / PLUGINS_ROOT)]
    scratch = tempfile.mkdtemp(prefix="mutate-")
    os.environ.update(
        PYTEST_DEBUG_TEMPROOT=scratch,
        HYPOTHESIS_STORAGE_DIRECTORY=f"{scratch}/hypothesis",
        PYTEST_DISABLE_PLUGIN_AUTOLOAD="1",
    )
    try:
        pytest.main([*OPTIONS, *options.tests], [Session(options, modules, watch(modules))])
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
    report(modules)


if __name__ == "__main__":
    main()
