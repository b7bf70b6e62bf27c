"""The child's side of supervision: a node that was started by `lupin run`, or by a test, does not outlive it.

The supervisor holds the writing end of the child's standard input and never writes. However the supervisor
ends, `kill -9` included, the kernel closes that end, and a thread of the child reads the end of the file. The
child is then told to stop as an operator would (SIGTERM: goals are cancelled, the robot stops) and killed
when it has not ended in time. Asking the kernel for a SIGKILL on the parent's death would be shorter and
would leave a real robot driving.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable

#: Set for the processes that a supervisor starts.
SUPERVISED = "LUPIN_SUPERVISED"

#: Seconds between being told to stop and being killed, once the supervisor is gone.
GRACE_S = 5.0


def hold_on(descriptor: int = 0) -> threading.Thread | None:
    """End this process when the supervisor that started it ends; None where there is no supervisor."""
    if os.environ.get(SUPERVISED) != "1":
        return None
    watcher = threading.Thread(target=watch, args=(descriptor, _end_myself), name="lifeline", daemon=True)
    watcher.start()
    return watcher


def watch(descriptor: int, end: Callable[[], None]) -> None:
    """Read until the end of the file, then call `end`."""
    try:
        while os.read(descriptor, 4096):
            pass
    except OSError:
        return  # somebody closed our standard input: there is nothing left to tell by
    end()


def _end_myself() -> None:
    os.kill(os.getpid(), signal.SIGTERM)
    threading.Event().wait(GRACE_S)
    os.kill(os.getpid(), signal.SIGKILL)
