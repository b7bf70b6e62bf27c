"""What has happened on robots, beside what tests, campaigns and proofs have seen."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lupin_engine.errors import UsageError

if TYPE_CHECKING:
    from lupin_engine.chart import Chart
    from lupin_engine.replay import Coverage, FieldEvidence

#: How often something was seen, by its kind, its name and which of several.
_Counts = Mapping[tuple[str, str, str], int]


class FieldTable:
    """The field coverage of missions whose scenarios were run."""

    def __init__(self, coverage: Coverage, found: FieldEvidence, results: Sequence[Path]) -> None:
        """Compare what robots did with the coverage of tests, and with results of proofs and campaigns.

        Raises:
            UsageError: a file has no such results.
        """
        self._coverage = coverage
        self._found = found
        self._results = dict(_read(file) for file in results)

    def lines(self) -> Iterator[str]:
        """Yield the table of each mission, then the files that could not be used."""
        from lupin_engine.replay import field_lines

        for chart, others in self._charts():
            yield f"\n{', '.join(chart.missions)} on robots"
            yield from field_lines(chart, self._found, others)
        yield from (f"left out: {problem}" for problem in self._found.left_out)

    def record(self) -> dict[str, Any]:
        """Return the same as JSON data, by the mission."""
        from lupin_engine.replay import field_record

        charts = self._charts()
        return {
            ", ".join(chart.missions): field_record(chart, self._found, others) for chart, others in charts
        }

    def _charts(self) -> Iterator[tuple[Chart, dict[str, _Counts]]]:
        for chart, counts in self._coverage.charts.values():
            yield chart, {"tests": counts, **self._results}


def _read(file: Path) -> tuple[str, _Counts]:
    """Read the counts in the output of `lupin prove --json` or `lupin campaign --json`.

    Raises:
        UsageError: it is none.
    """
    from lupin_engine.replay import TRANSITIONS

    try:
        found = json.loads(file.read_text(encoding="utf-8"))
        if isinstance(found, list):
            taken = {name: 1 for proof in found for name in proof["taken"]}
        else:
            taken = dict(found["transitions"])
    except (OSError, ValueError, LookupError, TypeError) as problem:
        hint = "expected the output of 'lupin prove --json' or 'lupin campaign --json'"
        raise UsageError(f"--seen: {str(file)!r}: {hint}: {problem}") from None
    name = "proof" if isinstance(found, list) else "campaign"
    return name, {(TRANSITIONS, rule, ""): count for rule, count in taken.items()}
