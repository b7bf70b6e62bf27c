"""Reads the folder of a package of interfaces before it is compiled: all mistakes with their lines.

It needs rosidl's own parser, as `files` does.
"""

from __future__ import annotations

import contextlib
import io
import re
import xml.etree.ElementTree as Xml
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lupin_engine.errors import Problems, UsageError, nearest
from lupin_ros.interfaces.files import PARTS, parser

#: Packages of Lupin's checkout with whole definitions, which a run does not compile.
COMPLETE = Path(__file__).resolve().parents[2] / "interfaces" / "complete"
MANIFEST = "package.xml"
_NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")
#: The separator of the parts of a service or an action.
_SEPARATOR = "---"


@dataclass(frozen=True)
class InterfacePackage:
    """A package of interfaces: its files, relative to its folder, and the packages that they use."""

    name: str
    version: str
    folder: Path
    files: tuple[str, ...]
    uses: tuple[str, ...]


#: How many separators a file has.
_SEPARATED = {"msg": "a message has none", "srv": "a service has one", "action": "an action has two"}


class _PackageReader:
    """Reads one package; `known` has the messages of other packages, by package."""

    def __init__(self, folder: Path, name: str, known: Mapping[str, Collection[str]]) -> None:
        self._name = name
        self._known = known
        self._own = [path.stem for path in folder.glob("msg/*.msg")]
        self.problems: list[str] = []
        self.uses: set[str] = set()

    def read(self, file: Path) -> None:
        """Read one file, and note its mistakes."""
        kind = file.suffix[1:]
        parts = _parts(file.read_text(encoding="utf-8", errors="replace").splitlines())
        if len(parts) != len(PARTS[kind]):
            there = f"{len(parts) - 1} lines are {_SEPARATOR!r}"
            self.problems.append(f"{file}: {there}, but {_SEPARATED[kind]}")
            return
        for start, lines in parts:
            self._part(file, start, lines)

    def _part(self, file: Path, start: int, lines: Sequence[str]) -> None:
        problem = self._parse(file, [])[1]
        if problem:
            self.problems.append(f"{file}: {problem}")
            return
        read = [self._parse(file, [line]) for line in lines]
        wrong = {number: problem for number, (_, problem) in enumerate(read) if problem}
        if not wrong and self._parse(file, lines)[1]:  # a name twice: its second line
            parsed = ((number, self._parse(file, lines[: number + 1])[1]) for number in range(len(lines)))
            wrong = dict([next((number, problem) for number, problem in parsed if problem)])
        for number, problem in wrong.items():
            self.problems.append(f"{file}:{start + number + 1}: {lines[number].strip()!r}: {problem}")
        for number, (fields, _) in enumerate(read, start=start + 1):
            for one in fields:
                if not one.type.is_primitive_type():
                    self._use(f"{file}:{number}", str(one.type.pkg_name), str(one.type.type))

    def _parse(self, file: Path, lines: Sequence[str]) -> tuple[Sequence[Any], str]:
        """Return the fields of some lines, and what the parser says against them."""
        try:
            with contextlib.redirect_stderr(io.StringIO()):
                found = parser().parse_message_string(self._name, file.stem, "\n".join(lines))
        except UsageError:
            raise
        except Exception as problem:  # the parser raises whatever comes
            return (), " ".join(str(problem).split()) or type(problem).__name__
        return found.fields, ""

    def _use(self, place: str, package: str, message: str) -> None:
        """Note a message that a field is of."""
        known = self._own if package == self._name else self._known.get(package)
        if package != self._name:
            self.uses.add(package)
        if known is None:
            problem = f"{package}/{message}: the package {package!r} is not in this environment"
            hint = "add it before: lupin interfaces add FOLDER"
            self.problems.append(f"{place}: {problem}; {hint}")
        elif message not in known:
            self.problems.append(f"{place}: {package} has no message {message!r}; {nearest(message, known)}")


def read_package(folder: Path, known: Mapping[str, Collection[str]]) -> InterfacePackage:
    """Read a package; `known` has the messages of those that it may use, by package.

    Raises:
        UsageError: the folder is none of a package, or files have mistakes; the text has all of them.
    """
    name, version = _manifest(folder)
    files = [file for kind in PARTS for file in sorted(folder.glob(f"{kind}/*.{kind}"))]
    if not files:
        raise UsageError(f"{folder}: no msg/*.msg, srv/*.srv or action/*.action is there")
    reader = _PackageReader(folder, name, known)
    for file in files:
        reader.read(file)
    problems: Problems = Problems(UsageError)
    for text in reader.problems:
        with problems.collecting():
            raise UsageError(text)
    problems.raise_any()
    uses = {*reader.uses, *(["action_msgs"] if any(f.suffix == ".action" for f in files) else [])}
    relative = tuple(file.relative_to(folder).as_posix() for file in files)
    return InterfacePackage(name, version, folder, relative, tuple(sorted(uses)))


def shipped_folder(name: str) -> Path | None:
    """Return the folder of whole definitions that come with Lupin; None where there are none of that name."""
    return COMPLETE / name if (COMPLETE / name / MANIFEST).is_file() else None


def shipped_names() -> list[str]:
    """Return the packages whose whole definitions come with Lupin."""
    return sorted(file.parent.name for file in COMPLETE.glob(f"*/{MANIFEST}"))


def _manifest(folder: Path) -> tuple[str, str]:
    """Return name and version of a package."""
    file = folder / MANIFEST
    if not file.is_file():
        raise UsageError(f"{folder}: no {MANIFEST} is there, which gives a package its name")
    try:
        root = Xml.parse(file).getroot()
    except Xml.ParseError as problem:
        raise UsageError(f"{file}:{problem.position[0]}: this is no XML: {problem}") from None
    name, version = ((root.findtext(key) or "").strip() for key in ("name", "version"))
    if not _NAME.fullmatch(name):
        raise UsageError(f"{file}: {name!r} cannot be the name of a package; use small letters, digits and _")
    return name, version if re.fullmatch(r"\d+\.\d+\.\d+", version) else "0.0.0"


def _parts(lines: Sequence[str]) -> list[tuple[int, list[str]]]:
    """Return the parts of a definition, each with the number of lines before it."""
    found: list[tuple[int, list[str]]] = [(0, [])]
    for number, line in enumerate(lines, start=1):
        if line.strip() == _SEPARATOR:
            found.append((number, []))
        else:
            found[-1][1].append(line)
    return found


def uses_of(folder: Path) -> Iterator[str]:
    """Yield the packages that a manifest names as dependencies."""
    root: Any = Xml.parse(folder / MANIFEST).getroot()
    yield from ((one.text or "").strip() for one in root.iterfind("depend"))


__all__ = ["InterfacePackage", "read_package", "shipped_folder", "shipped_names", "uses_of"]
