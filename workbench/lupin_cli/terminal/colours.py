"""The terminal style of each tone of a story, a debugger and a timeline."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType

from rich.text import Text

from lupin_cli.terminal.view import RATING_STYLES
from lupin_engine.replay import CURVE, FLAG, HOLD, OPERATION, PHASE, STATE, TonedText
from lupin_engine.runtime import history

#: Tone -> style of rich; other tones are plain.
STYLES: Mapping[str, str] = MappingProxyType(
    {
        **{rating.value: style for rating, style in RATING_STYLES.items()},
        "time": "dim",
        "dim": "dim",
        "label": "bold",
        "refused": "bold red",
        "note": "yellow",
        "command": "cyan",
        "event": "",
        STATE: "bold green",
        PHASE: "blue",
        OPERATION: "green",
        HOLD: "yellow",
        FLAG: "red",
        CURVE: "cyan",
        history.FAILED: "red",
        history.TIMED_OUT: "bold yellow",
        history.CANCELLED: "bright_black",
        history.OPEN: "blue",
    }
)


def styled(pieces: Iterable[TonedText]) -> Text:
    """Return the parts of a line in their styles."""
    text = Text(no_wrap=True)
    for piece, tone in pieces:
        text.append(piece, STYLES.get(tone, ""))
    return text
