"""Processes that end with the test that started them."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from typing import AnyStr


@contextmanager
def ended(process: subprocess.Popen[AnyStr]) -> Iterator[subprocess.Popen[AnyStr]]:
    """Kill it if it still runs: `with Popen` would wait for it for ever after a failure."""
    with process:
        try:
            yield process
        finally:
            process.kill()
