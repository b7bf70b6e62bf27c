"""Much that is done at once leaves turns to others: the node's thread is a list here."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from unittest.mock import Mock

import pytest

from lupin_ros.adapter.host import SLICE, Slices


def test_what_is_too_much_for_a_turn_is_done_in_the_next_ones_in_order() -> None:
    posted: list[Callable[[], None]] = []
    done: list[int] = []
    slices = Slices(Mock(post=posted.append))
    for number in range(2 * SLICE + 1):
        slices.add(partial(done.append, number))
    assert done == list(range(SLICE))
    assert not slices.is_done
    (turn,) = posted
    posted.clear()
    turn()
    slices.add(partial(done.append, 2 * SLICE + 1))
    assert done == list(range(2 * SLICE))
    while posted:
        posted.pop(0)()
    assert done == list(range(2 * SLICE + 2))
    assert slices.is_done


def test_a_few_are_done_at_once() -> None:
    posted: list[Callable[[], None]] = []
    done: list[int] = []
    slices = Slices(Mock(post=posted.append))
    for number in range(SLICE):
        slices.add(partial(done.append, number))
    assert done == list(range(SLICE))
    posted.pop()()
    assert not posted, "nothing waits, so the thread rests"
    slices.add(partial(done.append, -1))
    assert done[-1] == -1


def test_what_is_to_be_done_is_made_when_its_turn_comes() -> None:
    """Twenty thousand at once would be a silence by themselves."""
    posted: list[Callable[[], None]] = []
    made: list[int] = []
    done: list[int] = []

    def acts() -> Iterator[Callable[[], None]]:
        for number in range(2 * SLICE):
            made.append(number)
            yield partial(done.append, number)

    slices = Slices(Mock(post=posted.append))
    slices.add_each(acts())
    slices.add(partial(done.append, -1))
    assert made == done == list(range(SLICE))
    while posted:
        posted.pop(0)()
    assert done == [*range(2 * SLICE), -1]
    assert slices.is_done


def test_the_end_waits_for_no_turn() -> None:
    done: list[int] = []
    slices = Slices(Mock())
    for number in range(2 * SLICE):
        slices.add(partial(done.append, number))
    slices.finish()
    assert done == list(range(2 * SLICE))


def test_the_end_makes_the_calls_behind_one_that_fails() -> None:
    """There will be no other turn; the first failure is passed on when all are made."""
    made: list[str] = []
    slices = Slices(Mock())
    slices.add_each([*[lambda: None] * SLICE, lambda: 1 // 0, lambda: made.append("behind it")])
    with pytest.raises(ZeroDivisionError):
        slices.finish()
    assert made == ["behind it"]
    assert slices.is_done
