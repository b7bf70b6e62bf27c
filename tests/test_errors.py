"""The error family: several problems told as one."""

from __future__ import annotations

import pytest

from lupin_engine.errors import ChartError, Diagnostic, LupinError, Place, Problems, UsageError


def test_every_problem_is_told_once_in_the_order_of_finding() -> None:
    problems = Problems(UsageError)
    assert not problems
    problems.raise_any()
    problems.add("two", "one")
    with problems.collecting():
        raise LupinError("three")
    problems.add("two")
    assert problems
    with pytest.raises(UsageError) as told:
        problems.raise_any()
    assert str(told.value) == "two\none\nthree"


def test_findings_of_a_chart_are_told_as_such() -> None:
    """Each has a place in a file, which editors and terminals turn into a link."""
    problems = Problems()
    finding = Diagnostic(Place("a.yaml", 1, 1), "unknown-key", "", "unknown key 'phaze'")
    with pytest.raises(ChartError, match=r"^a\.yaml:1:1: error: unknown key"), problems.collecting():
        raise ChartError([finding])
    assert not problems


def test_what_is_no_mistake_of_the_user_is_not_collected() -> None:
    problems = Problems()
    with pytest.raises(ZeroDivisionError), problems.collecting():
        raise ZeroDivisionError
    assert not problems
