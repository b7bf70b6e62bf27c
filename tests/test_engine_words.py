"""Only plugins know the greenhouse: names, texts and comments of the other shelves have none of its words."""

from __future__ import annotations

import io
import re
import tokenize
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

from lupin_greenhouse.profile import PROFILE, WIRE

ROOT = Path(__file__).parents[1]
SHELVES = [ROOT / "lupin_engine", ROOT / "lupin_ros", ROOT / "workbench"]
MODULES = sorted(file for shelf in SHELVES for file in shelf.rglob("*.py"))
#: What `lupin plugin new` writes is read as well.
FILES = [*MODULES, *sorted((ROOT / "workbench/lupin_cli/plugin_template").rglob("*.txt"))]

#: Words of the greenhouse that the profile uses without naming them.
OTHERS = frozenset(
    {
        "arm",
        "battery",
        "climate",
        "dock",
        "docked",
        "docking",
        "estop",
        "floranova",
        "flower",
        "flowers",
        "greenhouse",
        "layout",
    }
    | {"lupin_msgs", "species", "tulip", "tulips"}
)
#: Where a word means something else, by the beginning of a module's path.
MEANT_OTHERWISE: Mapping[str, frozenset[str]] = {
    "lupin_engine/chart/documents.py": frozenset({"tag"}),  # pydantic's Tag
    "lupin_engine/chart/source.py": frozenset({"tag", "tags"}),  # of YAML
    "workbench/lupin_cli/terminal/sarif.py": frozenset({"tags"}),  # of SARIF
    "lupin_engine/diagram/": frozenset({"layout", "tags"}),  # of a graph; of XML
    "workbench/lupin_lsp/server.py": frozenset({"tag", "tags"}),  # of the language server protocol
    "lupin_engine/machine/": frozenset({"arm"}),  # a timer is armed
    "lupin_engine/plugin/types.py": frozenset({"°C"}),  # a unit as others are
    "lupin_engine/replay/timeline_svg.py": frozenset({"tag"}),  # of XML
    "lupin_engine/runtime/record.py": frozenset({"tag"}),  # pydantic's Tag
}
_NAME = re.compile(r"[A-Za-z_°][A-Za-z0-9_°]*")
_PART = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|[a-z0-9]+")


def words_of_the_profile() -> frozenset[str]:
    """Return what the profile calls its outcomes, its fields, its targets, its columns and its interfaces."""
    words, wire_types = PROFILE.terminal, (WIRE.state.type, WIRE.outcomes.type, WIRE.start.type)
    found = {*PROFILE.statuses, *PROFILE.request, words.target, words.targets, *words.columns}
    found |= {kind.rpartition("/")[2] for kind in wire_types} - {"Observation"}  # a common word
    return OTHERS | found - {"OK", "light"}  # so are these


def words_in(text: str) -> Iterator[str]:
    """Yield the names in a text, whole and taken apart at underscores and at capitals."""
    for name in _NAME.findall(text):
        yield name
        for part in name.split("_"):
            yield from (part, part.lower())
            yield from (piece.lower() for piece in _PART.findall(part))


def breaches(file: Path) -> Iterator[str]:
    """Yield the words of the greenhouse in a file, each with its line."""
    inside = file.relative_to(ROOT).as_posix()
    allowed = [words for begin, words in MEANT_OTHERWISE.items() if inside.startswith(begin)]
    unwanted = words_of_the_profile().difference(*allowed)
    for line, text in texts_of(file):
        for word in sorted(unwanted.intersection(words_in(text))):
            yield f"{inside}:{line}: {word}"


def texts_of(file: Path) -> Iterator[tuple[int, str]]:
    """Yield the names, strings and comments of a module, and the lines of any other file."""
    text = file.read_text(encoding="utf-8")
    if file.suffix != ".py":
        yield from enumerate(text.splitlines(), 1)
        return
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in (tokenize.OP, tokenize.NUMBER):
            for offset, line in enumerate(token.string.splitlines()):
                yield token.start[0] + offset, line


def test_no_word_of_the_greenhouse_stands_outside_the_plugins() -> None:
    """What the engine needs of it, a profile gives."""
    assert [breach for file in FILES for breach in breaches(file)] == []


def test_no_text_of_the_engine_names_a_state_of_the_lifecycle() -> None:
    """Another profile has others; FAULT is where the engine itself leads."""
    stages = PROFILE.stages
    labels = {*stages.starting, *stages.ready, *stages.returning, *stages.ended, *stages.faulted} - {"FAULT"}
    for file in MODULES:
        for token in tokenize.generate_tokens(io.StringIO(file.read_text(encoding="utf-8")).readline):
            if token.type not in (tokenize.OP, tokenize.NAME):
                said = {*_NAME.findall(re.sub(r"\{[^{}]*\}", "", token.string))}
                assert not said & labels, f"{file}:{token.start[0]}: {said & labels}"


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("def tags_of(tag_id): ...", "tag"),
        ("STATUS = 'SCAN_FAILED'", "SCAN_FAILED"),
        ("class MissionStateReader: ...", "mission"),
        ("'the MissionState message'", "MissionState"),
        ("tag_sequence", "tag_sequence"),
        ("seedClimate", "climate"),
        ("DOCK_TIMEOUT", "dock"),
    ],
)
def test_a_word_is_found_wherever_it_stands(text: str, word: str) -> None:
    """Whole, at underscores, at capitals."""
    assert word in set(words_in(text))


def test_every_exception_is_needed() -> None:
    """One that is left behind would hide a word."""
    for begin, words in MEANT_OTHERWISE.items():
        there = "\n".join(
            text
            for file in FILES
            if file.relative_to(ROOT).as_posix().startswith(begin)
            for _, text in texts_of(file)
        )
        assert words <= set(words_in(there)), begin
