"""Scanning: on good YAML the same as the parser; on YAML that is being typed, still something."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from lupin_engine.chart import source
from lupin_engine.chart.findings import Findings
from lupin_lsp.scan import Scan, Steps, TokenRole

ROOT = Path(__file__).parents[3]
#: What stands for something that is written elsewhere; the scanner leaves it alone.
ALIAS = re.compile(r"(?:: |- |, |\[)\*\w")
#: Files with other things that it leaves alone: texts over several lines, escapes.
LEFT_ALONE = ("expression_columns", "for_each_beside", "expressions")
#: Line and column.
Start = tuple[int, int]


def plain_yaml(file: Path) -> bool:
    """Tell whether a file is YAML as missions are written."""
    if ALIAS.search(file.read_text(encoding="utf-8", errors="replace")):
        return False
    findings = Findings()
    return source.read(file, findings) is not None and not findings.errors and file.stem not in LEFT_ALONE


FOLDERS = (ROOT / "missions", ROOT / "tests")
FILES = [file for folder in FOLDERS for file in sorted(folder.rglob("*.yaml")) if plain_yaml(file)]


def written(raw: Any, path: Steps, start: Start) -> Iterator[tuple[str, Steps, Start, Any]]:
    """Yield every key and scalar that the parser found: what it is, path, place, value."""
    if isinstance(raw, source.Map):
        for key, value in raw.items():
            place = raw.key_place(key)
            yield "key", (*path, key), (place.line - 1, place.column - 1), key
            place = raw.value_place(key)
            yield from written(value, (*path, key), (place.line - 1, place.column - 1))
    elif isinstance(raw, source.Seq):
        for index, value in enumerate(raw):
            place = raw.place_of(index)
            yield from written(value, (*path, index), (place.line - 1, place.column - 1))
    elif raw is not None:
        yield "value", path, start, raw


@pytest.mark.slow
@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(ROOT)))
def test_finds_what_the_parser_finds(file: Path) -> None:
    """Every key and value of every mission and scenario of the repository, in the same place."""
    raw = source.read(file, Findings())
    found = Scan(file.read_text(encoding="utf-8"))
    ours = {
        ("key" if token.role is TokenRole.KEY else "value", token.path): found.lines.position(token.start)
        for token in found.tokens
        if token.text not in ("null", "~")
    }
    parsed = list(written(raw, (), (0, 0)))
    assert ours == {(what, path): start for what, path, start, _ in parsed}
    for what, path, _, value in parsed:
        token = found.key_token(path) if what == "key" else found.value_token(path)
        assert token is not None
        if isinstance(value, str):
            assert token.text == value


CURSORS = {
    "key": ("states:\n  A:\n    on_d|one: B\n", ("key", "states A on_done", "on_done")),
    "value": ("states:\n  A:\n    on_done: B|\n", ("value", "states A on_done", "B")),
    "no value yet": ("states:\n  A:\n    on_done: |\n    on_error: C\n", ("value", "states A on_done", "")),
    "no key yet": ("states:\n  A:\n    |\n  B:\n", ("open", "states A", "")),
    "a key without its colon": ("states:\n  A:\n    ent|\n    exit: x\n", ("open", "states A", "ent")),
    "at the end": ("states:\n  A:\n    phase: X\n    |", ("open", "states A", "")),
    "less indented": ("states:\n  A:\n    phase: X\n  |", ("open", "states", "")),
    "the top": ("states:\n  A:\n    phase: X\n|", ("open", "", "")),
    "an element": ("always:\n  - |\n  - B\n", ("open", "always 0", "")),
    "an element under its key": ("always:\n- A\n- |\n", ("open", "always 1", "")),
    "a key in an element": ("always:\n  - target: A\n    |\n", ("open", "always 0", "")),
    "a value in an element": ("always:\n  - target: A\n    guard: x|\n", ("value", "always 0 guard", "x")),
    "after the mapping's bracket": ("on_done: {|}\n", ("key", "on_done", "")),
    "a key between brackets": ("on_done: {tar|}\n", ("key", "on_done tar", "tar")),
    "a second key": ("on_done: {target: A, |}\n", ("key", "on_done", "")),
    "a value between brackets": ("on_done: {target: |}\n", ("value", "on_done target", "")),
    "an open bracket": ("on_done: {target: |\non_error: B\n", ("value", "on_done target", "")),
    "two open brackets": ("invoke: {do: x, timeout: {aft|\non: y\n", ("key", "invoke timeout aft", "aft")),
    "an open bracket in a list": ("always:\n  - {target: A|\n  - B\n", ("value", "always 0 target", "A")),
    "a list": ("during: [pause, |]\n", ("value", "during 1", "")),
    "a mapping over lines": ("with: {a: 1,\n  b: |,\n  c: 3}\n", ("value", "with b", "")),
    "a mapping in a list": ("do: [set: {reason: |}]\n", ("value", "do 0 set reason", "")),
    "in quotes": ('limit: "${ param.| }"\n', ("value", "limit", "${ param. }")),
    "in quotes that are open": ('limit: "${ param.|\nnext: x\n', ("value", "limit", "${ param.")),
    "behind a blank": ("guard: a and |\n", ("value", "guard", "a and ")),
    "behind a comment": ("a: b   # wo|rd\n", None),
    "a comment on its own": ("# wo|rd\na: b\n", None),
    "behind a bracket": ("a: {b: c} |\n", None),
    "a quoted key": ('after: {"${ pa| }": X}\n', ("key", "after ${ pa }", "${ pa }")),
}


@pytest.mark.parametrize("case", CURSORS)
def test_says_where_the_cursor_is(case: str) -> None:
    """Role, path and the text that is there already."""
    marked, wanted = CURSORS[case]
    offset = marked.index("|")
    cursor = Scan(marked.replace("|", "", 1)).cursor(offset)
    if cursor is None:
        assert wanted is None
        return
    text = cursor.token.text if cursor.token else ""
    assert (cursor.role.value, " ".join(map(str, cursor.path)), text) == wanted


def test_a_text_block_has_no_keys() -> None:
    """What looks like a key in it is text."""
    found = Scan("a: |\n  b: c\n\n  d: e\nf: g\n")
    assert [token.text for token in found.tokens] == ["a", "f", "g"]


@pytest.mark.slow
def test_nothing_that_can_be_typed_stops_it() -> None:
    """Every beginning of a mission, and a cursor everywhere in it."""
    text = (ROOT / "missions" / "parts" / "visit_targets.yaml").read_text(encoding="utf-8")
    text = text[: text.index("PUBLISHING:")]
    for end in range(0, len(text), 7):
        found = Scan(text[:end])
        assert all(text[token.start : token.end] for token in found.tokens)
        found.cursor(end)
    whole = Scan(text)
    assert {cursor.role for offset in range(len(text)) if (cursor := whole.cursor(offset))} == set(TokenRole)


@pytest.mark.slow
@pytest.mark.parametrize("wrong", ["{", "[", '"', "'", "- ", ": ", "}", "]", "\t", "&a ", "*", "|", "é"])
def test_nothing_that_is_inserted_stops_it(wrong: str) -> None:
    """One wrong character anywhere but at the very beginning leaves most of the file as it was."""
    text = (ROOT / "missions" / "inspection.yaml").read_text(encoding="utf-8")
    for offset in range(11, len(text), 11):
        found = Scan(text[:offset] + wrong + text[offset:])
        assert len(found.tokens) >= 30
        found.cursor(offset + 1)


def test_lines_end_as_files_of_windows_do() -> None:
    """The carriage return belongs to no value."""
    found = Scan("a: b\r\nc:\r\n  d: e\r\n")
    assert [(token.path, token.text) for token in found.tokens] == [
        (("a",), "a"),
        (("a",), "b"),
        (("c",), "c"),
        (("c", "d"), "d"),
        (("c", "d"), "e"),
    ]
