"""YAML is read as YAML 1.2, with the place of every key and value, and never beyond bounds."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from lupin_engine.chart import source
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.source import Map, Seq, Text, head, map_at, parse, read, text_at
from lupin_engine.errors import Place


def parsed(text: str) -> Map:
    """Parse a text that must be right."""
    findings = Findings()
    found = parse(text, "m.yaml", findings)
    assert findings.all == ()
    assert found is not None
    return found


def problems(text: str) -> list[str]:
    """Return what is said against a text."""
    findings = Findings()
    parse(text, "m.yaml", findings)
    return [f"{d.place.line}:{d.place.column} {d.problem} [{d.rule}]" for d in findings.all]


@pytest.mark.parametrize(
    ("written", "value"),
    [
        ("on", "on"),
        ("off", "off"),
        ("yes", "yes"),
        ("No", "No"),
        ("true", True),
        ("False", False),
        ("TRUE", True),
        ("FALSE", False),
        ("True", True),
        ("false", False),
        ("tRUE", "tRUE"),
        ("NULL", None),
        ("null", None),
        ("~", None),
        ("", None),
        ("12", 12),
        ("-3", -3),
        ("0x1F", 31),
        ("0o17", 15),
        ("017", 17),
        ("1_000", "1_000"),
        ("1.5", 1.5),
        ("-.5e3", -500.0),
        ("12:30:45", "12:30:45"),
        ("2026-11-21", "2026-11-21"),
        (".inf", ".inf"),
        ("60 s", "60 s"),
        ("20 %", "20 %"),
        ("'12'", "12"),
        ('"true"', "true"),
        ("<<", "<<"),
    ],
)
def test_scalars_are_those_of_yaml_1_2(written: str, value: object) -> None:
    """A state named `off` is a state, and no text becomes a date."""
    found = parsed(f"key: {written}")["key"]
    assert found == value
    assert isinstance(found, Text if isinstance(value, str) else type(value))
    assert isinstance(found, Text) or found is None or type(value) is bool or repr(found) == written


def test_keys_are_always_text() -> None:
    """`on:` is the most common key of a mission."""
    assert list(parsed("{on: 1, yes: 2, 5: 3, null: 4, 1.5: 5}")) == ["on", "yes", "5", "null", "1.5"]


def test_every_key_and_value_has_its_place() -> None:
    """Places count from 1 and survive nesting."""
    found = parsed("a:\n  b: [x, y]\n  c: {d: 1}\n")
    inner = found["a"]
    assert (found.key_place("a"), found.value_place("a")) == (Place("m.yaml", 1, 1), Place("m.yaml", 2, 3))
    assert isinstance(inner["b"], Seq)
    assert [place.column for place in inner["b"].places] == [7, 10]
    assert inner["c"].key_place("d") == Place("m.yaml", 3, 7)
    assert inner["c"].value_place("d") == Place("m.yaml", 3, 10)


@pytest.mark.parametrize(
    ("text", "word", "place"),
    [
        ("k: a bc", "bc", (1, 6)),
        ("k: 'a bc'", "bc", (1, 7)),
        ("k: 'it''s bc'", "bc", (1, 11)),
        ('k: "a \\"x\\" bc"', "bc", (1, 13)),
        ('k: "\\u00fc\\t bc"', "bc", (1, 14)),
        ('k: "\\x41 bc"', "bc", (1, 10)),
        ('k: "\\U0001f98b bc"', "bc", (1, 16)),
        ('k: "\\r \\n bc"', "bc", (1, 11)),
        ("k: a\n  bc d", "bc", (2, 3)),
        ("k: 'a\n\n  bc'", "bc", (3, 3)),
        ("k: |\n  a\n  x bc\n", "bc", (3, 5)),
        ("k: >-\n\n   a\n   x bc\n", "bc", (4, 6)),
        ("k: |2-\n    bc\n", "bc", (2, 5)),
        ("x: 1\r\nk: ü bc", "bc", (2, 6)),
    ],
)
def test_a_character_of_a_text_is_found_in_the_file(text: str, word: str, place: tuple[int, int]) -> None:
    """Through quotes, escapes and folding: mistakes in expressions are told there."""
    value = parsed(text)["k"]
    found = value.at(value.index(word))
    assert (found.line, found.column) == place


def test_aliases_are_shared() -> None:
    """An alias is the value of its anchor."""
    found = parsed("a: &x {b: 1}\nc: *x\n&k d: *x\ne: *k\n")
    assert found["c"] is found["d"] is found["a"]
    assert found["e"] == "d"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", ["1:1 the file is empty [wrong-yaml]"]),
        ("- a", ["1:1 expected a mapping of keys to values, got ['a'] [wrong-yaml]"]),
        ("a: &x [*x]", ["1:8 the alias '*x' contains itself [wrong-yaml]"]),
        ("a: !!int 3", ["1:4 the tag 'tag:yaml.org,2002:int' is not allowed [wrong-yaml]"]),
        ("!x a: 3", ["1:1 the tag '!x' is not allowed [wrong-yaml]"]),
        ("? [a]\n: 1", ["1:3 a key must be a plain word [wrong-yaml]"]),
        ("a: 1\na: 2\na: 3", [
            "2:1 the key 'a' stands twice, in line 1 and in line 2 [duplicate-key]",
            "3:1 the key 'a' stands twice, in line 1 and in line 3 [duplicate-key]",
        ]),
        ("a: " + "9" * 50, ["1:4 a number of 50 digits [too-large]"]),
        ("a: \x01", ["1:4 control characters are not allowed [wrong-yaml]"]),
        ("a: [1, 2", ["2:1 did not find expected ',' or ']' while parsing a flow sequence [wrong-yaml]"]),
        ("a: `b`", [
            "1:4 found character that cannot start any token while scanning for the next token [wrong-yaml]",
        ]),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_told_with_its_place(text: str, expected: list[str]) -> None:
    """A file is the user's: no traceback, and the place to look at."""
    assert problems(text) == expected


@pytest.mark.timeout(60)
@pytest.mark.parametrize(
    "text",
    [
        "a: " + "[" * 100_000,
        "a: " + "{b: " * 5_000,
        "\n".join(" " * depth + "a:" for depth in range(200)),
        "a: &a [x, x, x, x, x, x, x, x, x, x]\n"
        + "".join(
            f"{chr(98 + n)}: &{chr(98 + n)} [{', '.join([f'*{chr(97 + n)}'] * 10)}]\n" for n in range(12)
        ),
        "k: [" + "x, " * (source.MAX_NODES + 1) + "]",
    ],
    ids=["flow lists", "flow mappings", "block mappings", "aliases", "values"],
)
def test_size_and_depth_are_bounded(text: str) -> None:
    """A bomb is refused; unbounded, these would run for hours."""
    assert ["[too-large]" in problem for problem in problems(text)] == [True]


def test_a_file_has_a_largest_size(tmp_path: Path) -> None:
    """Nobody writes a mission of a megabyte by hand."""
    path = tmp_path / "m.yaml"
    path.write_text("# " + "x" * source.MAX_BYTES)
    findings = Findings()
    assert read(path, findings) is None
    assert [d.rule for d in findings.all] == ["too-large"]


def test_a_file_that_is_not_utf_8_says_where(tmp_path: Path) -> None:
    """An editor with another encoding is a common accident."""
    path = tmp_path / "m.yaml"
    path.write_bytes(b"mission: M\nsummary: gr\xfcn\n")
    findings = Findings()
    assert read(path, findings) is None
    assert [(d.place.line, d.place.column, d.rule) for d in findings.all] == [(2, 12, "wrong-yaml")]


def test_a_byte_order_mark_is_no_character(tmp_path: Path) -> None:
    """Some editors write one."""
    path = tmp_path / "m.yaml"
    path.write_bytes(b"\xef\xbb\xbfmission: M\n")
    found = read(path, Findings())
    assert found is not None
    assert found.key_place("mission") == Place(str(path), 1, 1)


def test_the_head_of_a_file_names_it_even_when_the_rest_is_broken(tmp_path: Path) -> None:
    """Finding a mission by name does not need it to be right."""
    path = tmp_path / "m.yaml"
    path.write_text("# mission: No\nmission: 'Yes'\nstates: [\n")
    assert head(path) == ("mission", "Yes")
    assert head(tmp_path / "none.yaml") is None


def test_an_anchor_is_not_part_of_a_text() -> None:
    """Neither of a value nor of a key; the place of either is where the anchor stands."""
    found = parsed("a: &x 'b c'\n&y 'd e': *x\n&z f g: &n 5\nh: *n\n")
    assert (found["a"].place, found["a"].at(2)) == (Place("m.yaml", 1, 4), Place("m.yaml", 1, 10))
    assert found.key_text("d e").at(2) == Place("m.yaml", 2, 7)
    assert (found.key_text("f g").place, found.key_text("f g").at(2)) == (
        Place("m.yaml", 3, 1),
        Place("m.yaml", 3, 6),
    )
    assert (found["f g"], found["h"]) == (5, 5)


@pytest.mark.parametrize(
    ("text", "offset", "column"),
    [
        ("k: ''", 0, 5),
        ("k: '  '", 1, 7),
        ("k: 'a '", 1, 7),
        ("k: 'a '", 2, 7),
        ("k: ab", 2, 6),
        ("k: |\n  \n", 0, 4),
    ],
)
def test_behind_the_last_character_stands_what_ends_the_text(text: str, offset: int, column: int) -> None:
    """The closing quote, or the first column after it: an expression that ends too early is told there."""
    assert parsed(text)["k"].at(offset).column == column


def test_a_text_without_its_file_stands_where_it_begins() -> None:
    """No place is better than a wrong one, and neither is an exception."""
    text = text_at("a b", Place("m.yaml", 3, 5))
    assert text.at(2) == Place("m.yaml", 3, 7)
    text.file = source.File("m.yaml", "")
    assert text.at(2) == Place("m.yaml", 3, 5)


def test_what_is_not_written_stands_where_it_is_missed() -> None:
    """An empty mapping with a place."""
    found = map_at(Place("m.yaml", 3, 5))
    assert (found, found.place) == ({}, Place("m.yaml", 3, 5))


def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    """Nor a device read to its end."""
    path = tmp_path / "m.yaml"
    os.mkfifo(path)
    findings = Findings()
    assert read(path, findings) is None
    assert [(d.problem, d.rule) for d in findings.all] == [("cannot read the file: it is no file", "no-file")]
    assert head(path) is None


def test_a_folder_is_no_file(tmp_path: Path) -> None:
    """It is told in the words of the system."""
    findings = Findings()
    assert read(tmp_path, findings) is None
    assert [d.problem for d in findings.all] == ["cannot read the file: Is a directory"]


@pytest.mark.parametrize(("opening", "closing"), [("[", "]"), ("{a: ", "}")])
def test_a_file_may_be_so_deep_and_no_deeper(opening: str, closing: str) -> None:
    """Lists and mappings count alike; the mapping that the file is counts as well."""
    for depth, expected in ((source.MAX_DEPTH, []), (source.MAX_DEPTH + 1, ["[too-large]"])):
        text = f"k: {opening * (depth - 1)}[]{closing * (depth - 1)}"
        assert [problem.rpartition(" ")[2] for problem in problems(text)] == expected


@pytest.mark.parametrize("more", [0, 1])
def test_a_file_may_have_so_many_values_and_no_more(more: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Keys, values and the mappings around them."""
    monkeypatch.setattr(source, "MAX_NODES", 12)
    text = "k: [" + ", ".join(["x"] * (9 + more)) + "]"
    assert [problem.rpartition(" ")[2] for problem in problems(text)] == ["[too-large]"] * more


def test_levels_of_nesting_are_counted_through_aliases() -> None:
    """Fifty anchors, each within brackets that hold the one before, would be 2,750 levels."""
    deep = [f"a0: &a0 {'[' * 55}x{']' * 55}"]
    deep += [f"a{i}: &a{i} {'[' * 55}*a{i - 1}{']' * 55}" for i in range(1, 50)]
    assert problems("\n".join(deep)) == ["2:64 more than 60 levels of nesting [too-large]"]
    assert problems("a: &a [[x]]\nb: [*a]") == []
