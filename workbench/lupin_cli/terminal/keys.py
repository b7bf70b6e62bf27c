"""Reads keys in the view of a run without blocking, and maps them to commands."""

from __future__ import annotations

import os
import select
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from lupin_engine.plugin import ANSWER_VERB, Profile
from lupin_engine.runtime import OpenQuestion

#: Within so many seconds the key that ends a mission is pressed twice.
TWICE_S = 3.0
HELP = "?"
#: What comes in one piece and is longer was pasted, or is the code of another key.
_LONGEST = 2


@dataclass(frozen=True)
class Press:
    """The effect of a key: a command, or only a `text` to show."""

    text: str
    verb: str = ""
    request: Mapping[str, Any] = field(default_factory=dict)


class Keypad:
    """The keys of a profile's requests, and 1 to 9 for the answers to open questions.

    The key that aborts the mission must be pressed twice within `TWICE_S`.
    """

    def __init__(self, profile: Profile) -> None:
        self._requests = {request.key: name for name, request in profile.requests.items() if request.key}
        self._verbs = profile.verbs
        self._abort = profile.abort
        self._begun = -TWICE_S

    @property
    def help(self) -> str:
        """The keys and their commands in one line."""
        twice = dict.fromkeys([self._abort], " (twice)")
        keys = [f"{key} {self._verbs[name]}{twice.get(name, '')}" for key, name in self._requests.items()]
        return f"keys: {', '.join([*keys, '1-9 answer', f'{HELP} this line'])}"

    def press(self, key: str, asked: Sequence[OpenQuestion], now: float) -> Press | None:
        """Return the effect of a key at `now`, in seconds; None for one without any."""
        if key == HELP:
            return Press(self.help)
        choices = [name for question in asked for name, _ in question.choices]
        if key in "123456789" and int(key) <= len(choices):
            return Press(key, ANSWER_VERB, {"choice": choices[int(key) - 1]})
        name = self._requests.get(key, "")
        if not name:
            return None
        if name == self._abort and now - self._begun > TWICE_S:
            self._begun = now
            return Press(f"{key} once more within {TWICE_S:g} s: {self._verbs[name]}")
        self._begun = -TWICE_S
        return Press(key, name)


def typed(descriptor: int = 0) -> str:
    """Return the keys pressed since the last call; more than `_LONGEST` at once are a paste, and dropped."""
    try:
        if not select.select([descriptor], [], [], 0.0)[0]:
            return ""
        keys = os.read(descriptor, 1024).decode("ascii", "replace")
    except OSError:  # the terminal was closed
        return ""
    return keys if len(keys) <= _LONGEST else ""
