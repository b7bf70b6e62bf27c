"""Exit codes: of an interruption, of the operator's verbs, of proofs, and of missions not carried out."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

from lupin_engine.errors import LupinError

#: How every verb ends that somebody interrupts, as for a shell.
INTERRUPTED = 130

#: How a verb of the operator ends. The orchestrator said yes, or there was something to show; it said no, or
#: there was nothing; nobody was asked, because no orchestrator is there or the command line is wrong.
ACCEPTED, REFUSED, NOBODY = 0, 1, 2

#: How a proof ends that is none: something is broken; or it is not shown that everything holds, or, where
#: that is demanded, only within bounds.
BROKEN, NOT_PROVEN = 1, 3


@contextlib.contextmanager
def not_done() -> Iterator[None]:
    """Give errors the exit code of a mission that was not done: 1 would mean that targets were missed."""
    try:
        yield
    except LupinError as problem:
        from lupin_ros.launch import NOT_DONE

        problem.exit_code = NOT_DONE
        raise
