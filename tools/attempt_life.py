"""Draw the life of an attempt of an operation, from the table that the machine goes by.

    .venv/bin/python tools/attempt_life.py > docs/diagrams/attempt.mmd

The picture is a function of `operations.LIFE`, so a test can tell when it is out of date.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

from lupin_engine.machine.memory import Phase
from lupin_engine.machine.operations import CANCEL_DEADLINE, LIFE

PHASES = {
    Phase.WAITING: "an earlier attempt still uses what it needs",
    Phase.REQUESTED: "the server was asked",
    Phase.ACCEPTED: "the server works on it",
    Phase.REPLACED: "an update was sent in its place",
    Phase.CANCELLING: f"left, held, or too slow<br/>it keeps what it uses, {CANCEL_DEADLINE:g} s at most",
    Phase.REFUSED: "the server refuses to end it<br/>it keeps what it uses; the cancel is repeated",
    Phase.LOST: "its resources are free<br/>a late acceptance is still cancelled",
}
#: How an attempt ends that somebody still wants; every other end is that it is cancelled.
ENDS = {
    "done": "its result moves the chart",
    "failed": "tried again, or an error of its state",
    "cancelled": "nobody hears of it",
}
#: What happens, as the table calls it, in the words of the picture.
WORDS = {
    "resource free": "what it needs is free",
    "not wanted": "nobody wants it any more",
    "updated": "its arguments have changed",
    "not ended in time": f"still there after {CANCEL_DEADLINE:g} s",
    "no answer in time": f"no answer in {CANCEL_DEADLINE:g} s",
    "cancel_refused": "refuses to end",
}


def picture() -> str:
    """Return the text of docs/diagrams/attempt.mmd."""
    lines = [*_states(), "[*] --> waiting", *_arrows(), *(f"{end} --> [*]" for end in (*ENDS, "lost"))]
    head = ["---", "title: The life of an attempt", "---", "stateDiagram-v2"]
    return "\n".join([*head, *(f"    {line}" for line in lines)]) + "\n"


def _states() -> Iterator[str]:
    texts = {phase.value: text for phase, text in PHASES.items()} | ENDS
    for name, text in texts.items():
        yield f'state "{name}<br/>{text}" as {name}'


def _arrows() -> Iterator[str]:
    """Yield one arrow for each pair of states, with all words that lead along it."""
    words: dict[tuple[str, str], list[str]] = {}
    for (phase, word), after in LIFE.items():
        target = after.value if after is not None else _end(phase, word)
        words.setdefault((phase.value, target), []).append(WORDS.get(word, word))
    for (source, target), told in words.items():
        is_first = source == Phase.REPLACED.value
        again = (", cancelled" if is_first else ", cancelled again") if source == target else ""
        yield f"{source} --> {target} : {' or '.join(told)}{again}"


def _end(phase: Phase, word: str) -> str:
    """Return what an end comes to: one that was not asked to be cancelled, and is, has failed."""
    if phase not in (Phase.REQUESTED, Phase.ACCEPTED):
        return "cancelled"
    return "done" if word == "done" else "failed"


if __name__ == "__main__":
    sys.stdout.write(picture())
