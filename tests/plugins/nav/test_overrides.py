"""The poses set by hand: what is read, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from lupin_engine.errors import LupinError
from lupin_nav import overrides
from lupin_nav.overrides import Override


def test_a_missing_file_is_refused_with_its_name(tmp_path: Path) -> None:
    path = str(tmp_path / "gone")
    with pytest.raises(LupinError) as caught:
        overrides.load(path)
    why = f"[Errno 2] No such file or directory: {path!r}"
    assert str(caught.value) == f"approach_overrides_file {path!r} cannot be used: {why}"


def test_no_overrides_file_means_no_overrides() -> None:
    assert overrides.load("") == {}


def test_overrides_are_read_by_id_as_text_without_unknown_keys_and_entries_that_are_no_mapping() -> None:
    data = {"overrides": {7: {"yaw": 1, "colour": "red"}, "a": {"goal_x": 0.5, "standoff": 0.3}, "b": 4}}
    assert overrides.parse(data) == {"7": Override(yaw=1.0), "a": Override(standoff=0.3, goal_x=0.5)}


@pytest.mark.parametrize("data", [None, {}, {"other": 1}, []])
def test_without_the_key_overrides_there_are_none(data: Any) -> None:
    assert overrides.parse(data) == {}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("overrides: [1]", "'overrides' must map tag ids to values, got list"),
        ("overrides: {7: {yaw: north}}", "yaw of tag '7' must be a finite number, got 'north'"),
        ("overrides: {7: {goal_x: true}}", "goal_x of tag '7'"),
        ("overrides: {7: {goal_x: .inf}}", "goal_x of tag '7'"),
        (f"overrides: {{7: {{goal_x: 1{'0' * 400}}}}}", "goal_x of tag '7'"),
        ("overrides: {", "while parsing a flow node"),
        ("overrides:\n  7: {yaw: 1}\n  '7': {yaw: 2}", "'7' is there twice in what begins in line 2"),
        ("overrides: {7: {yaw: 1, yaw: 2}}", "'yaw' is there twice in what begins in line 1"),
        ("[" * 2_000, "maximum recursion depth exceeded"),
    ],
)
def test_overrides_that_cannot_be_used_are_refused_with_their_file(
    tmp_path: Path, content: str, said: str
) -> None:
    file = tmp_path / "overrides.yaml"
    file.write_text(content)
    with pytest.raises(LupinError) as caught:
        overrides.load(str(file))
    assert str(caught.value).startswith(f"approach_overrides_file {str(file)!r} cannot be used: {said}")
