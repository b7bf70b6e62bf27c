"""Checks and reports recordings, for `run` and `record`."""

from __future__ import annotations

import contextlib
import importlib.util
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lupin_cli.run_folders import writable
from lupin_engine.errors import Severity, UsageError
from lupin_engine.plugin import robot_namespace

if TYPE_CHECKING:
    from lupin_ros.recording import Recording, TopicRecorder


def check_recording(path: Path) -> None:
    """Check that a recording can be made there, before anything is started.

    Raises:
        UsageError: it cannot.
    """
    if importlib.util.find_spec("mcap") is None:
        raise UsageError("to record, the package mcap is needed: `pip install 'lupin-engine[record]'`")
    if path.exists():
        raise UsageError(f"{str(path)!r} is there already; name another file")
    writable(path.parent, "recording")


def open_recording(path: Path) -> Recording:
    """Open a recording to read it.

    Raises:
        UsageError: it cannot be read, or packages are missing.
    """
    if any(importlib.util.find_spec(name) is None for name in ("mcap", "mcap_ros2")):
        raise UsageError("to read a recording, packages are needed: `pip install 'lupin-engine[record]'`")
    from lupin_ros.recording import Recording

    return Recording(path, robot_namespace())


def amount(recorder: TopicRecorder) -> str:
    """Return how much was recorded, in words."""
    size = recorder.size / 1e6
    written = f"{size:.1f} MB" if size >= 1.0 else f"{1e3 * size:.0f} kB"
    return f"{recorder.messages:,} messages of {recorder.topics} topics, {written}"


def result(recorder: TopicRecorder) -> str:
    """Return a sentence about an ended recording."""
    if not recorder.messages:
        return "nothing was published: there is no recording"
    return f"recorded {amount(recorder)}, in {recorder.path}"


@contextlib.contextmanager
def recorded(path: Path | None, observer: Any) -> Iterator[Any]:
    """Record a run, if there is a path; yields an observer that also reports news of the recording."""
    if path is None:
        yield observer
        return
    from lupin_cli.terminal.observers import RecordingReporter
    from lupin_ros.recording import TopicRecorder  # needs rclpy

    with TopicRecorder(path) as recorder:
        yield RecordingReporter(observer, recorder)
    for text, severity in recorder.news():
        observer.note(text, severity)
    observer.note(result(recorder), Severity.INFO)
