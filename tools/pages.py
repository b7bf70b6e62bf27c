"""Keep the pages for authors true: the files that they show, and what the commands on them print.

    .venv/bin/python tools/pages.py          # write what is out of date
    .venv/bin/python tools/pages.py --check  # only tell

A page is Markdown with four kinds of block that mean something. They are carried out in their order, in a
folder of their own that begins empty, as a reader would:

- a file: the block after `<!-- file: steps/01-first.yaml -->` is that file, which the reader saves under the
  name in the block's title; what is new since the file's last state is highlighted;
- a look: the block after `<!-- shows: lamp/README.md -->` is that file of the reader's folder, as it is;
- `console`: a line with `$ lupin ...` is carried out, what follows is what it prints; it may be piped through
  head, tail and grep; `$ pip install --editable FOLDER` lets the plugins there be found;
- `diff`, with a title: the reader's change to that file, undone where the next file, change or heading comes.

The pages of one book are read one after the other, in one folder. The plugins beside them are installed.
"""

from __future__ import annotations

import contextlib
import difflib
import io
import os
import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from lupin_cli.main import main as run_lupin
from lupin_engine.missions.folders import default_missions_folder

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"

#: Book -> its pages, in the order in which they are read.
BOOKS: Mapping[str, tuple[Path, ...]] = MappingProxyType(
    {
        "ten-minutes": (DOCS / "ten-minutes.md",),
        "coming-from": (DOCS / "coming-from.md",),
        "guide": (DOCS / "guide" / "index.md", *sorted((DOCS / "guide").glob("[0-9]*.md"))),
        "cookbook": (DOCS / "cookbook.md",),
        "tutorial": (DOCS / "tutorial-new-mission.md",),
        "bindings": (DOCS / "bindings.md",),
        "plugins": (DOCS / "plugins.md",),
        "scale": (DOCS / "scale.md",),
        "profiles": (DOCS / "profiles.md",),
    }
)

#: As a terminal of 100 columns, without colours.
_TERMINAL = {"COLUMNS": "100", "LINES": "50", "NO_COLOR": "1", "TERM": "dumb"}
_FILE = re.compile(r"<!-- file: (\S+) -->")
_SHOWS = re.compile(r"<!-- shows: (\S+) -->")
_FENCE = re.compile(r"(\s*)(`{3,})(\w*)(.*)")
_TITLE = re.compile(r'title="([^"]+)"')
#: How long a computer took differs every time.
_TOOK = re.compile(r"(?<=computed)(\s+in) \d+\.\d\d s")


class PageError(Exception):
    """A page asks for something that cannot be done."""


class _Announced(NamedTuple):
    """What the comment before a block says that it is: a file, a look, or neither."""

    file: str = ""
    look: str = ""

    def after(self, line: str) -> _Announced:
        """Return what is announced after another line; blank ones change nothing."""
        if not line.strip():
            return self
        file, look = _FILE.fullmatch(line.strip()), _SHOWS.fullmatch(line.strip())
        return _Announced(file[1] if file else "", look[1] if look else "")


@dataclass
class Reader:
    """Somebody who reads a book and does what it says, in `folder`."""

    folder: Path
    _unchanged: dict[Path, str] = field(default_factory=dict)
    _installed: list[str] = field(default_factory=list)

    def page(self, file: Path) -> str:
        """Read a page, and return it as it should be."""
        lines = file.read_text(encoding="utf-8").splitlines()
        try:
            return "\n".join(self._read(lines, file.parent)) + "\n"
        except PageError as problem:
            raise PageError(f"{file.relative_to(ROOT)}: {problem}") from None

    def _read(self, lines: Sequence[str], beside: Path) -> Iterator[str]:
        number, announced = 0, _Announced()
        while number < len(lines):
            line = lines[number]
            fence = _FENCE.fullmatch(line)
            if fence is None:
                announced = announced.after(line)
                if line.startswith("#"):
                    self._undo()
                yield line
                number += 1
                continue
            after = number + 1
            end = next((n for n in range(after, len(lines)) if lines[n].strip() == fence[2]), None)
            if end is None:
                raise PageError(f"line {after}: the block has no end")
            yield from self._block(fence, lines[after:end], announced, beside)
            yield lines[end]
            number, announced = end + 1, _Announced()

    def _block(
        self, fence: re.Match[str], lines: Sequence[str], announced: _Announced, beside: Path
    ) -> Iterator[str]:
        """Do what a block says; yield it, without its last line, as it should be."""
        indent, _, language, rest = fence.groups()
        first, block = fence[0], [text.removeprefix(indent) for text in lines]
        title = _TITLE.search(rest)
        if announced.file:
            first, block = self._file(first, title[1] if title else "", beside / announced.file)
        elif announced.look:
            block = (self.folder / announced.look).read_text(encoding="utf-8").splitlines()
        elif language == "console":
            block = [*self._console(block)]
        elif language == "diff" and title:
            self._change(title[1], block)
        yield first
        yield from (f"{indent}{text}".rstrip() for text in block)

    # -- files ------------------------------------------------------------------------------------------

    def _file(self, fence: str, name: str, source: Path) -> tuple[str, list[str]]:
        """Save a file as the reader does; return its block's first line and its lines."""
        if not name:
            raise PageError(f"the block of {source.name} has no title to save it under")
        self._undo()
        text = source.read_text(encoding="utf-8")
        saved = self.folder / name
        before = saved.read_text(encoding="utf-8").splitlines() if saved.exists() else []
        saved.parent.mkdir(parents=True, exist_ok=True)
        saved.write_text(text, encoding="utf-8")
        lines = text.splitlines()
        fence = re.sub(r' hl_lines="[^"]*"', "", fence)
        new = _ranges(_new_lines(before, lines)) if before else ""
        return (f'{fence} hl_lines="{new}"' if new else fence), lines

    def _change(self, name: str, block: Sequence[str]) -> None:
        """Change a file as a diff says."""
        self._undo()
        file = self.folder / name
        if not file.exists():
            raise PageError(f"there is no {name} to change yet")
        text = file.read_text(encoding="utf-8")
        old = "".join(f"{line[1:]}\n" for line in block if line[:1] != "+")
        new = "".join(f"{line[1:]}\n" for line in block if line[:1] != "-")
        if f"\n{text}".count(f"\n{old}") != 1:
            raise PageError(f"what is to be changed does not stand once in {name}:\n{old}")
        self._unchanged[file] = text
        file.write_text(f"\n{text}".replace(f"\n{old}", f"\n{new}")[1:], encoding="utf-8")

    def _undo(self) -> None:
        for file, text in self._unchanged.items():
            file.write_text(text, encoding="utf-8")
        self._unchanged.clear()

    # -- commands ---------------------------------------------------------------------------------------

    def _console(self, block: Iterable[str]) -> Iterator[str]:
        """Carry out the commands of a block; yield them with what they print."""
        for line in block:
            if line.startswith("$ "):
                yield line
                yield from self._command(line.removeprefix("$ "))

    def _command(self, command: str) -> list[str]:
        first, *filters = (shlex.split(part, comments=True) for part in command.split(" | "))
        if first[:3] == ["pip", "install", "--editable"]:
            self._install(self.folder / first[3])
            return []
        if first[:1] != ["lupin"]:
            raise PageError(f"only lupin is carried out in a console, not {command!r}")
        lines = [line.rstrip() for line in self._output(first[1:]).splitlines()]
        for words in filters:
            lines = _filtered(lines, words)
        while lines and not lines[0]:
            lines.pop(0)
        while lines and not lines[-1]:
            lines.pop()
        joined = "".join("".join(lines).split())  # a long path may be broken
        if any(str(place) in joined for place in (ROOT, self.folder)):
            raise PageError(f"{command!r} prints where files are on this machine")
        return lines

    def _install(self, project: Path) -> None:
        """Do what pip does for a project that can be edited: describe it, and put it on the path."""
        described = "from setuptools import setup; setup()"
        command = [sys.executable, "-W", "ignore", "-c", described, "--quiet", "egg_info"]
        subprocess.run(command, cwd=project, check=True, capture_output=True)
        if str(project) not in sys.path:
            sys.path.insert(0, str(project))
            self._installed.append(str(project))

    def leave(self) -> None:
        """Uninstall what was installed."""
        for project in self._installed:
            sys.path.remove(project)
            packages = {path.parent.name for path in Path(project).glob("*/__init__.py")}
            for name in [name for name in sys.modules if name.partition(".")[0] in packages]:
                del sys.modules[name]
        self._installed.clear()

    def _output(self, arguments: Sequence[str]) -> str:
        """Return what a call of lupin prints, in the reader's folder."""
        written = io.StringIO()
        before, environment = Path.cwd(), dict(os.environ)
        os.chdir(self.folder)
        os.environ.pop("FORCE_COLOR", None)
        os.environ.update(_TERMINAL)
        try:
            with contextlib.redirect_stdout(written), contextlib.redirect_stderr(written):
                run_lupin(arguments)
        finally:
            os.chdir(before)
            os.environ.clear()
            os.environ.update(environment)
        said = written.getvalue().replace(f"{default_missions_folder()}/", ".../missions/")
        return _TOOK.sub(r"\1 0.01 s", said)


def _filtered(lines: list[str], words: Sequence[str]) -> list[str]:
    """Return what a filter of the shell leaves of lines."""
    name, *arguments = words
    if name in ("head", "tail") and arguments[:1] == ["-n"]:
        count = int(arguments[1])
        return lines[:count] if name == "head" else lines[-count:]
    if name == "grep" and arguments[:1] == ["-v"]:
        return [line for line in lines if not re.search(arguments[1], line)]
    if name == "grep":
        return [line for line in lines if re.search(arguments[0], line)]
    raise PageError(f"a page can pipe through head -n, tail -n and grep, not {' '.join(words)!r}")


def _new_lines(before: Sequence[str], now: Sequence[str]) -> list[int]:
    """Return the numbers of the lines that are not as they were."""
    matcher = difflib.SequenceMatcher(None, before, now, autojunk=False)
    codes = matcher.get_opcodes()
    return [line + 1 for kind, _, _, first, last in codes if kind != "equal" for line in range(first, last)]


def _ranges(numbers: Iterable[int]) -> str:
    """Return numbers as `1-3 5`."""
    found: list[list[int]] = []
    for number in numbers:
        if found and found[-1][1] == number - 1:
            found[-1][1] = number
        else:
            found.append([number, number])
    return " ".join(f"{first}-{last}" if last > first else f"{first}" for first, last in found)


@contextlib.contextmanager
def installed(plugin: Path) -> Iterator[None]:
    """Let a plugin of one file be found as if it was installed."""
    with tempfile.TemporaryDirectory(prefix="lupin-plugin-") as folder:
        name = plugin.stem
        information = Path(folder, f"lupin_{name}-1.0.dist-info")
        information.mkdir()
        (information / "METADATA").write_text(f"Metadata-Version: 2.1\nName: lupin-{name}\nVersion: 1.0\n")
        (information / "entry_points.txt").write_text(f"[lupin.plugins]\n{name} = {name}:PLUGIN\n")
        sys.path[:0] = [folder, str(plugin.parent)]
        try:
            yield
        finally:
            del sys.path[:2]
            sys.modules.pop(name, None)


def pages(book: str) -> Iterator[tuple[Path, str]]:
    """Read a book; yield each page and what it should say.

    Raises:
        PageError: it asks for something that cannot be done.
    """
    with contextlib.ExitStack() as stack:
        reader = Reader(Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="lupin-pages-"))))
        stack.callback(reader.leave)
        for plugin in sorted((DOCS / book).glob("*.py")):
            stack.enter_context(installed(plugin))
        for file in BOOKS[book]:
            yield file, reader.page(file)


def main() -> int:
    """Write the pages, or with `--check` tell which are out of date."""
    checks = "--check" in sys.argv[1:]
    stale = 0
    for book in BOOKS:
        for file, text in pages(book):
            if file.read_text(encoding="utf-8") == text:
                continue
            stale += 1
            print(f"{'out of date' if checks else 'wrote'}: {file.relative_to(ROOT)}")
            if not checks:
                file.write_text(text, encoding="utf-8")
    return 1 if checks and stale else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except PageError as problem:
        sys.exit(f"pages: {problem}")
