"""A process that stands still is noticed, one that is only busy is not; and how long others remember it."""

from __future__ import annotations

import ctypes
import math
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from lupin_ros.adapter.dds.profile import RANGE, forgotten_after, use_profile, variables
from lupin_ros.adapter.process import standstill_calls

#: Is stopped by itself, and let go on by a child of its own.
STOPPED = """
import os, signal, subprocess, threading, time
from lupin_ros.adapter.process import standstill_calls

told, found = [], threading.Event()
with standstill_calls(lambda seconds: (told.append(seconds), found.set()), 0.5, time.monotonic):
    subprocess.Popen(["sh", "-c", f"sleep 1; kill -CONT {os.getpid()}"])
    os.kill(os.getpid(), signal.SIGSTOP)
    found.wait(10.0)
print(*told)
"""


def test_a_process_that_was_stopped_is_told_for_how_long() -> None:
    done = subprocess.run([sys.executable, "-c", STOPPED], capture_output=True, text=True, timeout=60.0)
    (told,) = done.stdout.split()
    assert 0.9 < float(told) < 5.0, done.stderr


def test_a_call_that_holds_pythons_lock_is_no_standstill() -> None:
    """The sleep of C, called as a function of Python is."""
    told: list[float] = []
    with standstill_calls(told.append, 0.5, time.monotonic):
        ctypes.PyDLL(None).usleep(900_000)
        begin = time.monotonic()
        while time.monotonic() < begin + 0.5:  # the other thread has its turn
            time.monotonic()
    assert told == []


def test_a_clock_that_jumps_is_told_once() -> None:
    """As the clock does that goes on while the computer sleeps."""
    told: list[float] = []
    jump = [0.0]
    with standstill_calls(told.append, 2.0, lambda: time.monotonic() + jump[0]):
        for hours in (1, 2):
            jump[0] = 3600.0 * hours
            end = time.monotonic() + 1.0
            while time.monotonic() < end and not told:
                signal.sigtimedwait([], 0.01)
    assert [round(seconds / 3600.0, 2) for seconds in told] == [1.0]


LEASE = '<dds><p xmlns="http://x"><leaseDuration>{}</leaseDuration>{}</p></dds>'


@pytest.mark.parametrize(
    ("profile", "seconds"),
    [
        (
            LEASE.format(
                "<sec>10</sec>", "<leaseAnnouncement><nanosec>500000000</nanosec></leaseAnnouncement>"
            ),
            9.25,
        ),
        (LEASE.format("<sec>8</sec>", ""), 4.0),  # the announcements are the middleware's, every 3 s
        (LEASE.format("<sec>DURATION_INFINITY</sec>", ""), math.inf),
        (LEASE.format("<sec>soon</sec>", ""), 15.5),
        ("<dds/>", 15.5),
        ("no XML", 15.5),
    ],
)
def test_how_long_others_remember_is_in_the_profile(
    profile: str, seconds: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "own.xml").write_text(profile)
    monkeypatch.setenv(variables()[0], str(tmp_path / "own.xml"))
    assert forgotten_after() == seconds


@pytest.mark.parametrize("reach", ["LOCALHOST", "SUBNET"])
def test_ours_remember_for_two_seconds_and_a_quarter(reach: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(RANGE, reach)
    for name in variables():
        monkeypatch.setenv(name, "")
    use_profile()
    assert forgotten_after() == 2.25
