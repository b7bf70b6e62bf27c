"""Signals and the end of a node's process; a process that stood still; nodes that share a process.

A node that was started by `lupin run`, or by a test, does not outlive it. The supervisor holds the writing
end of the child's standard input and never writes. However the supervisor ends, `kill -9` included, the
kernel closes that end, and a thread of the child reads the end of the file. The child then gets a SIGTERM, as
from an operator (goals are cancelled, the robot stops), and is killed after `GRACE_S`. A SIGKILL from the
kernel on the parent's death would be shorter and would leave a real robot driving.
"""

from __future__ import annotations

import contextlib
import faulthandler
import os
import resource
import signal
import socket
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from queue import Empty, SimpleQueue

from lupin_engine.errors import LupinError

#: Set for the processes that a supervisor starts.
SUPERVISED = "LUPIN_SUPERVISED"

#: Seconds between the SIGTERM and the SIGKILL, once the supervisor is gone.
GRACE_S = 5.0

#: The period of the check for a standstill, in seconds.
LOOK_S = 0.25
#: A thread that waits for Python's lock wakes every 5 ms, except in a process that stands still.
_WAKES = 10

_LEAVING = threading.Lock()

#: The file descriptor, because `sys.stderr` may be anything by then.
_STDERR = 2


class StoodStill(LupinError):
    """The process stood still for so long that others may have forgotten it; it must be started again."""

    exit_code = 75  # EX_TEMPFAIL: the same again may succeed


class _Ending:
    """Stops the nodes that share a process: those that spin, and later ones as soon as they spin."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._stops: list[Callable[[], None]] = []
        self._is_stopped = False

    @contextlib.contextmanager
    def calls(self, stop: Callable[[], None]) -> Iterator[None]:
        with self._lock:
            self._stops.append(stop)
            late = self._is_stopped
        if late:
            stop()
        try:
            yield
        finally:
            with self._lock:
                self._stops.remove(stop)

    def stop_all(self) -> None:
        with self._lock:
            self._is_stopped = True
            stops = list(self._stops)
        for stop in stops:
            stop()


_ENDING = _Ending()


def run_together(nodes: Mapping[str, Callable[[], int]]) -> int:
    """Run nodes on threads of their own; when one ends, or at a signal, stop all.

    Returns the first exit code that is not 0. The first exception of a node is raised here. Where nodes have
    not stopped in `GRACE_S`, the process exits with code 1, to be started again as a whole.
    """
    ended: SimpleQueue[int | BaseException] = SimpleQueue()

    def run(node: Callable[[], int]) -> None:
        try:
            ended.put(node())
        except BaseException as problem:  # the others must not go on without this node
            ended.put(problem)

    with signals_call(_ENDING.stop_all):
        for name, node in nodes.items():
            threading.Thread(target=run, args=(node,), name=name, daemon=True).start()
        results = [ended.get()]
        _ENDING.stop_all()
        with contextlib.suppress(Empty):
            while len(results) < len(nodes):
                results.append(ended.get(timeout=GRACE_S))
    problem = next((result for result in results if isinstance(result, BaseException)), None)
    if len(results) < len(nodes):
        print(
            f"{len(nodes) - len(results)} of {', '.join(nodes)} did not stop; first: {problem!r}",
            file=sys.stderr,
        )
        os._exit(1)
    if problem is not None:
        raise problem
    return next((code for code in results if isinstance(code, int) and code), 0)


@contextlib.contextmanager
def signals_call(stop: Callable[[], None]) -> Iterator[None]:
    """Let SIGINT and SIGTERM call `stop`, at once and on another thread.

    A Python signal handler runs only when the main thread executes Python, and that thread waits inside
    the middleware. So the bytes that Python writes for each signal are read by a small thread. Outside the
    main thread no signal is handled here; `run_together` handles them for its nodes.
    """
    if threading.current_thread() is not threading.main_thread():
        with _ENDING.calls(stop):
            yield
        return
    reader, writer = socket.socketpair()
    writer.setblocking(False)
    handled = (signal.SIGINT, signal.SIGTERM)

    def watch_descriptor() -> None:
        while received := reader.recv(64):
            if any(number in handled for number in received):
                stop()

    watcher = threading.Thread(target=watch_descriptor, name="signals", daemon=True)
    # First the descriptor: a signal that found only the handler would be lost.
    old_descriptor = signal.set_wakeup_fd(writer.fileno(), warn_on_full_buffer=False)
    before = {number: signal.signal(number, lambda *_: None) for number in handled}
    watcher.start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(old_descriptor)
        for number, handler in before.items():
            signal.signal(number, handler)
        writer.close()
        watcher.join()
        reader.close()


@contextlib.contextmanager
def standstill_calls(
    report: Callable[[float], None], limit: float, clock: Callable[[], float]
) -> Iterator[None]:
    """Call `report`, on another thread, when the process has stood still for more than `limit` seconds.

    It gets the seconds, and is called once at most. `clock` is in seconds and never goes back. A call that
    holds Python's lock for as long is no standstill: the threads of the middleware, which announce this node
    to others, do without it.
    """
    over = threading.Event()

    def look() -> None:
        before, woken = clock(), _wakes()
        while not over.wait(LOOK_S):
            now, wakes = clock(), _wakes()
            if now - before > limit and wakes - woken < _WAKES:
                report(now - before)
                return
            before, woken = now, wakes

    watcher = threading.Thread(target=look, name="standstill", daemon=True)
    watcher.start()
    try:
        yield
    finally:
        over.set()
        watcher.join()


def _wakes() -> int:
    """Return the number of voluntary context switches of this thread."""
    return resource.getrusage(resource.RUSAGE_THREAD).ru_nvcsw


@contextlib.contextmanager
def ends_the_process_after(seconds: float) -> Iterator[None]:
    """End the process with code 1 and a traceback when the body hangs for so long.

    The deadlock in Fast DDS holds Python's lock, so no Python code could do it: not a thread, not a signal
    handler. `faulthandler` watches from a thread of its own that needs no Python. It watches one body at a
    time: nodes that share a process leave one after the other.
    """
    with _LEAVING:
        faulthandler.dump_traceback_later(seconds, exit=True, file=_STDERR)
        try:
            yield
        finally:
            faulthandler.cancel_dump_traceback_later()


def is_rclpys_end(problem: BaseException) -> bool:
    """Whether rclpy's own spin ended by a signal: it raises one of three exceptions."""
    from rclpy.executors import ExternalShutdownException  # only who has run a node asks

    too_late = type(problem).__name__ == "RCLError" and "context is not valid" in str(problem)
    return too_late or isinstance(problem, (ExternalShutdownException, KeyboardInterrupt))


def end_with_supervisor(descriptor: int = 0) -> threading.Thread | None:
    """End this process when the supervisor that started it ends; return the thread that watches.

    None where no supervisor started it.
    """
    if os.environ.get(SUPERVISED) != "1":
        return None
    reading = (descriptor, _end_this_process)
    watcher = threading.Thread(target=watch_descriptor, args=reading, name="supervision", daemon=True)
    watcher.start()
    return watcher


def watch_descriptor(descriptor: int, end: Callable[[], None]) -> None:
    """Read until the end of the file, then call `end`."""
    try:
        while os.read(descriptor, 4096):
            pass
    except OSError:
        return  # standard input was closed: nothing is left to watch
    end()


def _end_this_process() -> None:
    os.kill(os.getpid(), signal.SIGTERM)
    threading.Event().wait(GRACE_S)
    os.kill(os.getpid(), signal.SIGKILL)
