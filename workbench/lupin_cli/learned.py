"""Learned rates on the command line: the file, for `expect` and `simulate`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from lupin_engine.errors import UsageError

if TYPE_CHECKING:
    from lupin_engine.chart import Chart
    from lupin_verify import Rates

#: The file that `lupin learn` writes and `lupin expect` reads when no other is named.
LEARNED = Path("learned.yaml")


def learned_rates(file: Path, chart: Chart) -> Rates:
    """Read a file of rates.

    Raises:
        UsageError: there is none.
        ChartError: with everything that is wrong with it.
    """
    from lupin_verify import read_rates

    if not file.is_file():
        raise UsageError(f"--rates: no file {str(file)!r}; 'lupin learn' writes one from the journal")
    return read_rates(file, chart)
