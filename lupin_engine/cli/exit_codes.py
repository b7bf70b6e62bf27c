"""The exit code of verbs that carry out a mission, when they fail."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

from lupin_engine.errors import LupinError


@contextlib.contextmanager
def not_done() -> Iterator[None]:
    """Give errors the exit code of a mission that was not done: 1 would mean that targets were missed."""
    try:
        yield
    except LupinError as problem:
        from lupin_engine.ros.launch.monitor import NOT_DONE

        problem.exit_code = NOT_DONE
        raise
