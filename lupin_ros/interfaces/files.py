"""Parses .msg, .srv and .action files: fields, constants, defaults and comments, for `lupin types`.

The files are read where their packages are installed, else where this checkout has them. It needs rosidl's
own parser (`rosidl_adapter`), which comes with ROS 2, and nothing else of ROS.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lupin_engine.errors import Problems, UsageError, meant
from lupin_ros.interfaces.type_hashes import find_source, installed

_CHECKOUT = Path(__file__).resolve().parents[2]
#: Below what, in a checkout, the packages of interfaces lie.
_FOLDERS = ("", "interfaces/")
#: What a file consists of, by kind: the parts as messages are called, in order.
PARTS: Mapping[str, tuple[str, ...]] = {
    "msg": ("",),
    "srv": ("_Request", "_Response"),
    "action": ("_Goal", "_Result", "_Feedback"),
}
#: The parts that a caller fills: on the wire, what is missing there has its default.
FILLED = ("_Request", "_Goal")
_WHOLE = {f"{sign}int{bits}": (sign, bits) for sign in ("", "u") for bits in (8, 16, 32, 64)}


@dataclass(frozen=True)
class FieldType:
    """The type of a field: `base` is a primitive of ROS or the full name of a message.

    `size` is the number of an array's elements, the largest one if it is `bounded`; None: any number.
    `longest` is the greatest length of a text; None: any.
    """

    base: str
    is_array: bool = False
    size: int | None = None
    bounded: bool = False
    longest: int | None = None

    def __str__(self) -> str:
        text = f"{self.base}<={self.longest}" if self.longest else self.base
        length = f"{'<=' if self.bounded else ''}{self.size or ''}"
        return f"{text}[{length}]" if self.is_array else text

    @property
    def is_message(self) -> bool:
        """Whether it is made of fields itself."""
        return "/" in self.base

    @property
    def is_real(self) -> bool:
        """Whether it may be NaN or infinite, which JSON writes as null."""
        return self.base in ("float32", "float64")

    @property
    def is_base64(self) -> bool:
        """Whether it travels as a text in base64: an array of bytes."""
        return self.is_array and self.base in ("uint8", "char", "byte")

    @property
    def span(self) -> tuple[int, int] | None:
        """The least and the greatest value of an integer; None for anything else."""
        if self.base in ("byte", "char"):
            return 0, 255
        if self.base not in _WHOLE:
            return None
        sign, bits = _WHOLE[self.base]
        return (0, 2**bits - 1) if sign else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)


@dataclass(frozen=True)
class WrittenField:
    """A field or a constant, with its comment; `value` is the constant's, or the field's default."""

    name: str
    type: FieldType
    doc: str = ""
    value: Any = None


@dataclass(frozen=True)
class WrittenMessage:
    """A message, or a part of a service or action, such as `std_srvs/srv/Trigger_Response`."""

    name: str
    doc: str = ""
    fields: tuple[WrittenField, ...] = ()
    constants: tuple[WrittenField, ...] = ()

    @property
    def is_filled(self) -> bool:
        """Whether a caller fills it, and may leave fields out."""
        return self.name.endswith(FILLED)


@dataclass(frozen=True)
class InterfaceSet:
    """Interfaces by name, and all that they are made of by name; both sorted."""

    interfaces: tuple[str, ...]
    messages: Mapping[str, WrittenMessage] = field(default_factory=dict)

    def of_kind(self, kind: str) -> Iterator[str]:
        """Yield the names of messages, services or actions: `msg`, `srv` or `action`."""
        for name in self.interfaces if kind != "msg" else self.messages:
            if name.split("/")[1] == kind:
                yield name


def read_interfaces(names: Iterable[str]) -> InterfaceSet:
    """Read interfaces with all messages that they are made of.

    Raises:
        UsageError: files or their parser are missing; the text has each of them, with a remedy.
    """
    found: dict[str, WrittenMessage] = {}
    wanted, problems = sorted(set(names)), Problems(UsageError)
    left = list(wanted)
    while left:
        name = left.pop()
        with problems.collecting():
            for part in _read(name):
                found[part.name] = part
                inside = {one.type.base for one in part.fields if one.type.is_message}
                left.extend(inside.difference(found, left))
    problems.raise_any()
    return InterfaceSet(tuple(wanted), dict(sorted(found.items())))


def names_in(package: str) -> list[str]:
    """Return the full names of a package's interfaces, installed or in this checkout; none without any."""
    return [name for name in _all_names() if name.startswith(f"{package}/")]


def packages() -> list[str]:
    """Return the packages with interfaces, installed or in this checkout."""
    return sorted({name.partition("/")[0] for name in _all_names()})


def _all_names() -> list[str]:
    found = {f"{package}/{kind}/{name}" for kind in PARTS for package, name in installed(kind)}
    for kind in PARTS:
        for folder in _FOLDERS:
            files = _CHECKOUT.glob(f"{folder}*_msgs/{kind}/*.{kind}")
            found |= {f"{file.parents[1].name}/{kind}/{file.stem}" for file in files}
    return sorted(found)


def _file(name: str) -> Path | None:
    """Return the file of an installed type, else of one in this checkout; None where there is none."""
    package, kind, local = name.split("/")
    ours = (_CHECKOUT / f"{folder}{package}" / kind / f"{local}.{kind}" for folder in _FOLDERS)
    return find_source(name) or next((file for file in ours if file.is_file()), None)


def _read(name: str) -> Iterator[WrittenMessage]:
    package, kind, local = name.split("/")
    file = _file(name)
    if file is None:
        hint = meant(name, names_in(package)) or f"install the package {package}"
        raise UsageError(f"the definition of {name} is not here; {hint}")
    specifications = _parsed(kind, package, local, file.read_text(encoding="utf-8"))
    for suffix, specification in zip(PARTS[kind], specifications, strict=True):
        yield WrittenMessage(
            f"{name}{suffix}",
            _doc(specification.annotations),
            tuple(_field(one) for one in specification.fields),
            tuple(_constant(one) for one in specification.constants),
        )


def _parsed(kind: str, *what: str) -> Sequence[Any]:
    reads = parser()
    if kind == "msg":
        return (reads.parse_message_string(*what),)
    if kind == "srv":
        service = reads.parse_service_string(*what)
        return service.request, service.response
    action = reads.parse_action_string(*what)
    return action.goal, action.result, action.feedback


def parser() -> Any:
    """Return rosidl's parser of interface files.

    Raises:
        UsageError: it is not installed.
    """
    try:
        return importlib.import_module("rosidl_adapter.parser")
    except ImportError:
        raise UsageError(
            "rosidl_adapter, which reads interface files, is not installed: it comes with ROS 2; "
            "`pip install 'lupin-engine[ros]'`, or source an apt ROS 2 Jazzy"
        ) from None


def _field(read: Any) -> WrittenField:
    kind = read.type
    base = kind.type if kind.is_primitive_type() else f"{kind.pkg_name}/msg/{kind.type}"
    written = FieldType(base, kind.is_array, kind.array_size, kind.is_upper_bound, kind.string_upper_bound)
    return WrittenField(read.name, written, _doc(read.annotations), read.default_value)


def _constant(read: Any) -> WrittenField:
    return WrittenField(read.name, FieldType(read.type), _doc(read.annotations), read.value)


def _doc(annotations: Mapping[str, Any]) -> str:
    """Return a comment; the parser takes the unit out of it, which is put back to the end."""
    lines = [line.rstrip() for line in annotations.get("comment", ())]
    unit = annotations.get("unit")
    return "\n".join([*lines, f"[{unit}]"] if unit else lines).strip()
