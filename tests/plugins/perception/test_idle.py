"""Which tags are read while no mission is under way, and when."""

from __future__ import annotations

import pytest

from lupin_perception.idle import AGAIN_S, AT_ONCE, Schedule


def test_a_tag_is_read_once() -> None:
    schedule = Schedule(0.0)
    assert schedule.due(["1", "2"], 0.0) == ["1", "2"]
    assert schedule.due(["1", "2"], 1.0) == [], "both are under way"
    schedule.done("1", 2.0)
    assert schedule.due(["1", "2", "3"], 1e9) == ["3"]


@pytest.mark.parametrize("period", [60.0, 0.5])
def test_with_a_period_it_is_read_again(period: float) -> None:
    schedule = Schedule(period)
    schedule.due(["1"], 0.0)
    schedule.done("1", 2.0)
    assert schedule.due(["1"], 1.9 + period) == []
    assert schedule.due(["1"], 2.0 + period) == ["1"]


def test_a_reading_that_failed_is_tried_again_after_a_while() -> None:
    schedule = Schedule(0.0)
    schedule.due(["1"], 0.0)
    schedule.failed("1", 1.0)
    assert schedule.due(["1"], 1.0 + AGAIN_S - 0.1) == []
    assert schedule.due(["1"], 1.0 + AGAIN_S) == ["1"]


def test_not_all_are_asked_for_at_once() -> None:
    schedule = Schedule(0.0)
    tags = [str(number) for number in range(AT_ONCE + 2)]
    first = schedule.due(tags, 0.0)
    assert first == tags[:AT_ONCE]
    assert schedule.due(tags, 0.0) == []
    schedule.done(first[0], 0.0)
    assert schedule.due(tags, 0.0) == [tags[AT_ONCE]]
