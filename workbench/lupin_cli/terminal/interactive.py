"""The terminal of the debugger: prompt, completion, colours."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterable

from rich.console import Console
from rich.text import Text

from lupin_cli.terminal.colours import styled
from lupin_cli.terminal.debugger import Debugger
from lupin_engine.replay import TonedLine


def interact(debugger: Debugger, console: Console) -> int:
    """Read commands until quit or the end of input, and return the exit code 0.

    Ctrl-C drops the line or ends the command; a wrong command is answered with its problem. Both go on.
    """
    _show(debugger.greeting(), console)
    ask = _terminal(debugger) if sys.stdin.isatty() else _pipe(debugger, console)
    while not debugger.over:
        try:
            line = ask()
        except EOFError:
            console.print()
            break
        except KeyboardInterrupt:
            console.print()
            continue
        try:
            _show(debugger.do(line), console)
        except KeyboardInterrupt:
            _show(debugger.interrupted(), console)
    return 0


def _show(rows: Iterable[TonedLine], console: Console) -> None:
    for row in rows:
        console.print(styled(row), soft_wrap=True)


def _pipe(debugger: Debugger, console: Console) -> Callable[[], str]:
    """Return a reader of lines from a pipe; it echoes them, so that the output reads like a dialogue."""

    def ask() -> str:
        line = sys.stdin.readline()
        if not line:
            console.print(Text(debugger.prompt, "bold"), end="")
            raise EOFError
        console.print(Text(debugger.prompt, "bold"), Text(line.rstrip("\n")), sep="", soft_wrap=True)
        return line

    return ask


def _terminal(debugger: Debugger) -> Callable[[], str]:
    """Return a reader of lines with editing, history and completion, as far as this Python has them."""
    with contextlib.suppress(ImportError):
        import readline

        def complete(_: str, state: int) -> str | None:
            found = debugger.complete(readline.get_line_buffer()[: readline.get_endidx()])
            return found[state] + _after(found[state]) if state < len(found) else None

        readline.set_completer(complete)
        # A dotted name is one word.
        readline.set_completer_delims(" ")
        readline.parse_and_bind("tab: complete")
    return lambda: input(debugger.prompt)


def _after(word: str) -> str:
    """Return the text after a completed word: nothing after `=`, else a blank."""
    return "" if word.endswith("=") else " "
