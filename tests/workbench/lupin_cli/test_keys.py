"""The keys in the view of a run: what each of them means."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest

from lupin_cli.terminal.keys import Keypad, Press, typed
from lupin_engine.runtime.questions import OpenQuestion
from lupin_greenhouse.profile import PROFILE

ASKED = [
    OpenQuestion("A", "Go on?", (("go_on", "Go on"), ("stay", "Stay here")), "stay", 9.0, stopped=False),
    OpenQuestion("B", "Light?", (("on", "On"),), "on", 9.0, stopped=False),
]


def test_the_letters_are_those_of_the_profile() -> None:
    """A letter that means nothing does nothing."""
    pad = Keypad(PROFILE)
    assert {key: pad.press(key, (), 0.0) for key in "prsdxPR \n\x00"} == {
        "p": Press("p", "pause"),
        "r": Press("r", "resume"),
        "s": Press("s", "skip_current"),
        "d": Press("d", "dock"),
        **dict.fromkeys("xPR \n\x00"),
    }


def test_what_the_keys_are_is_told() -> None:
    """In one line."""
    told = "keys: a abort (twice), d dock, p pause, r resume, s skip, 1-9 answer, ? this line"
    assert Keypad(PROFILE).press("?", (), 0.0) == Press(told)


def test_a_mission_is_ended_by_two_presses_within_three_seconds() -> None:
    """The one is told what the other will do; each abort takes two."""
    pad, first = Keypad(PROFILE), Press("a once more within 3 s: abort")
    assert pad.press("a", (), 10.0) == first
    assert pad.press("a", (), 13.5) == first
    assert pad.press("a", (), 16.0) == Press("a", "abort")
    assert pad.press("a", (), 16.1) == first


def test_another_key_takes_the_first_press_back() -> None:
    """A pause between two letters is no abort."""
    pad = Keypad(PROFILE)
    pad.press("a", (), 10.0)
    assert pad.press("p", (), 10.5) == Press("p", "pause")
    assert pad.press("a", (), 11.0) == Press("a once more within 3 s: abort")


def test_a_number_answers_what_is_asked() -> None:
    """They go on from question to question, as the picture shows them."""
    pad = Keypad(PROFILE)
    answers = [pad.press(key, ASKED, 0.0) for key in "123"]
    assert answers == [
        Press(key, "answer", {"choice": name})
        for key, name in zip("123", ("go_on", "stay", "on"), strict=True)
    ]
    assert [pad.press(key, ASKED, 0.0) for key in "049"] == [None] * 3
    assert pad.press("1", (), 0.0) is None


@pytest.fixture
def pipe() -> Iterator[tuple[int, int]]:
    """Where keys are read, and where they are pressed."""
    ends = os.pipe()
    yield ends
    for end in ends:
        os.close(end)


@pytest.mark.parametrize(
    ("pressed", "keys"),
    [(b"", ""), (b"p", "p"), (b"aa", "aa"), (b"\x1b[D", ""), (b"sudo apt install", ""), (b"\xff", "\ufffd")],
)
def test_what_was_pasted_and_other_keys_press_nothing(
    pipe: tuple[int, int], pressed: bytes, keys: str
) -> None:
    """The code of an arrow has letters in it; and nothing is waited for."""
    os.write(pipe[1], pressed)
    assert typed(pipe[0]) == keys


def test_a_terminal_that_was_closed_presses_nothing() -> None:
    """The run hears of that by a signal."""
    reader, writer = os.pipe()
    os.close(writer)
    assert typed(reader) == ""
    os.close(reader)
