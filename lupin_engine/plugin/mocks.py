"""Mocks whose result depends on the arguments, as data."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

#: Two numbers are the same when they differ by less than this share, or by so little beside 0: nobody writes
#: sixteen digits, and what is computed is seldom exactly 0.
SAME, SAME_AS_ZERO = 1e-6, 1e-9


@dataclass(frozen=True)
class MockCases:
    """A mock's result: `usual`, updated with the first case that covers the arguments.

    A case is a part of the arguments, and its result.
    """

    usual: Mapping[str, Any]
    cases: tuple[tuple[Mapping[str, Any], Mapping[str, Any]], ...]

    def __call__(self, arguments: Mapping[str, Any], _: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return the result for some arguments; parameters make no difference."""
        found = (given for wanted, given in self.cases if contains(arguments, wanted))
        return {**self.usual, **next(found, {})}


def contains(whole: Any, part: Any) -> bool:
    """Say whether `whole` contains `part`; computed numbers are compared to six digits.

    Records need only contain the given fields; lists have as many elements as they are given.
    """
    if isinstance(part, Mapping) and isinstance(whole, Mapping):
        return all(name in whole and contains(whole[name], value) for name, value in part.items())
    if isinstance(part, list) and isinstance(whole, list):
        return len(whole) == len(part) and all(map(contains, whole, part))
    if isinstance(whole, float) and isinstance(part, float):
        return math.isclose(whole, part, rel_tol=SAME, abs_tol=SAME_AS_ZERO)
    return bool(whole == part)
