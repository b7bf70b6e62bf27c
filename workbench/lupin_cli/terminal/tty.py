"""Sets up the terminal while a picture is redrawn in place, and redirects its streams once it is closed."""

from __future__ import annotations

import contextlib
import os
import sys
import termios
from collections.abc import Iterator


@contextlib.contextmanager
def quiet_terminal(keys: bool = False) -> Iterator[None]:
    """Turn off the echo of the terminal: the `^C` of Ctrl-C would push the picture down a line.

    With `keys` each key comes at once, not with the end of its line.
    """
    try:
        descriptor = sys.stdin.fileno()
        before = termios.tcgetattr(descriptor)
    except (OSError, ValueError, termios.error):  # standard input is no terminal
        yield
        return
    quiet = list(before)
    quiet[3] &= ~(termios.ECHO | (termios.ICANON if keys else 0))
    termios.tcsetattr(descriptor, termios.TCSANOW, quiet)
    try:
        yield
    finally:
        with contextlib.suppress(termios.error):  # it may have been closed meanwhile
            if keys:  # what was pressed too late is no command of the shell
                termios.tcflush(descriptor, termios.TCIFLUSH)
            termios.tcsetattr(descriptor, termios.TCSANOW, before)


def hang_up() -> None:
    """Redirect closed streams to /dev/null: flushing them at the exit would fail visibly."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
