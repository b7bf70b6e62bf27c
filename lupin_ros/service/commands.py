"""Validates commands of the command service, and deduplicates them by id (idempotent requests).

Pure: no ROS, and time is an argument. An id is remembered for `REMEMBERED_S`; when `MAX_REMEMBERED` are, new
ids are refused, except for requests such as a pause.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, Protocol

from pydantic import TypeAdapter, ValidationError

from lupin_engine.chart import Chart
from lupin_engine.errors import nearest, shortened, unknown_field
from lupin_engine.machine import BAD_REQUEST, MAX_PROBLEMS, Event, Refusal, Step
from lupin_engine.plugin import ANSWER, ANSWER_VERB, OWN_VERBS, START, START_VERB, without_repetition

#: The field of an answer.
CHOICE = "choice"
#: How many letters are read: of the request, and of each other part of a command.
MAX_REQUEST, MAX_WORD = 65_536, 200
#: How long an id is remembered, in seconds, and how many are: see `CommandMemory.once`.
REMEMBERED_S, MAX_REMEMBERED = 60.0, 1000

#: What JSON can write and UTF-8 cannot: halves of characters beyond the first 65536.
_LONE_SURROGATE = frozenset(map(chr, range(0xD800, 0xE000)))

#: Codes of commands that never reach the machine, beside `bad_request`.
UNKNOWN_VERB, ID_IN_USE, TOO_MANY = "unknown_verb", "command_id_in_use", "too_many_commands"
#: The code of a request that a node refuses because of its lifecycle state.
INACTIVE = "inactive"


@dataclass(frozen=True)
class CommandRequest:
    """A command: the fields of the service; `request` is JSON."""

    verb: str
    mission: str = ""
    request: str = ""
    command_id: str = ""
    by: str = ""

    @property
    def origin(self) -> dict[str, str]:
        """The caller and the command's id, as far as given, for the log and the record."""
        given = {"by": self.by, "command_id": self.command_id}
        return {name: _printable(text) for name, text in given.items() if text}


@dataclass(frozen=True)
class CommandAnswer:
    """The response's fields. `step` is 0 where the command caused none."""

    accepted: bool
    code: str
    message: str
    mission_id: str = ""
    step: int = 0
    repeated: bool = False


#: What came of a command in which something raised an exception: it may have been carried out.
_BROKEN_OFF = CommandAnswer(False, "broken_off", "it was begun and broken off: look at the state")


def _answer_of(fields: Mapping[str, Any]) -> CommandAnswer:
    """Return a saved answer; an invalid one counts as broken off."""
    try:
        return TypeAdapter(CommandAnswer).validate_python(fields)
    except ValidationError:
        return _BROKEN_OFF


class AnswerLog(Protocol):
    """Saves answers for the next process."""

    def answered(self, command_id: str, what: str, answer: Mapping[str, Any]) -> None:
        """Save an answer, with the id and the command's digest."""


class CommandMemory:
    """The commands of the last minute, by id, each with its answer, which a `log` saves."""

    def __init__(self, log: AnswerLog | None = None) -> None:
        self._known: dict[str, tuple[float, str, CommandAnswer]] = {}
        self._log = log

    def remember(self, command_id: str, when: float, what: str, answer: Mapping[str, Any]) -> None:
        """Restore a command of an earlier process; without an answer it counts as broken off."""
        self._known[command_id] = when, what, _answer_of(answer)

    def once(
        self,
        asked: CommandRequest,
        chart: Chart,
        now: float,
        carry_out: Callable[[CommandRequest], CommandAnswer],
    ) -> CommandAnswer:
        """Return the answer to a command, which is carried out unless its id is known.

        Without an id it is always carried out. An id that was another command's is refused. Where
        `MAX_REMEMBERED` ids are known, a new id is refused too, since forgetting one could execute that
        command twice; only requests that count however late, such as a pause, are then carried out, and not
        remembered.
        """
        known = self._recall(asked, now)
        if known is None and asked.command_id and len(self._known) >= MAX_REMEMBERED:
            if _counts_however_late(asked, chart):
                return carry_out(asked)
            text = f"refused: {MAX_REMEMBERED} commands came within {REMEMBERED_S:g} s; wait for a moment"
            return CommandAnswer(False, TOO_MANY, text)
        if known is None:
            return self._first(asked, now, carry_out)
        _, what, answer = known
        if what in ("", _what(asked)):
            return replace(answer, repeated=True)
        name = shortened(asked.command_id)
        return CommandAnswer(False, ID_IN_USE, f"refused: the command id {name!r} was another command's")

    def _first(
        self, asked: CommandRequest, now: float, carry_out: Callable[[CommandRequest], CommandAnswer]
    ) -> CommandAnswer:
        if not asked.command_id or len(asked.command_id) > MAX_WORD:
            return carry_out(asked)
        what = _what(asked)
        self._known[asked.command_id] = now, what, _BROKEN_OFF  # until there is an answer
        answer = carry_out(asked)
        self._known[asked.command_id] = now, what, answer
        if self._log is not None:
            self._log.answered(asked.command_id, what, asdict(answer))
        return answer

    def knows(self, asked: CommandRequest, now: float) -> bool:
        """Return whether a command is answered from memory, however late it arrives."""
        return self._recall(asked, now) is not None

    def _recall(self, asked: CommandRequest, now: float) -> tuple[float, str, CommandAnswer] | None:
        """Return the answer that this command's id got in the last `REMEMBERED_S` seconds; else None."""
        for command_id, (kept, _, _) in list(self._known.items()):  # the oldest come first
            if now - kept <= REMEMBERED_S:
                break
            del self._known[command_id]
        return self._known.get(asked.command_id)


def _counts_however_late(asked: CommandRequest, chart: Chart) -> bool:
    return counts_however_late(event_name(asked.verb, chart) or "", chart)


def counts_however_late(event: str, chart: Chart) -> bool:
    """Return whether an event is a request that is carried out however late it comes."""
    request = chart.profile.requests.get(event.removeprefix("operator."))
    return request is not None and request.however_late


def _printable(text: str) -> str:
    """Return the beginning of a text with characters replaced that could control a terminal."""
    return "".join(letter if letter.isprintable() else "?" for letter in text[:MAX_WORD])


def _what(asked: CommandRequest) -> str:
    """Return a digest of a command, the same in every process."""
    text = json.dumps([asked.verb, asked.mission, asked.request])
    return hashlib.blake2b(text.encode(), digest_size=8).hexdigest()


# -- reading ----------------------------------------------------------------------------------------------


def read_command(asked: CommandRequest, chart: Chart, mission_id: str) -> Event | Refusal:
    """Return the event of a command, or why it is refused.

    Types, units and ranges of a mission's fields are checked by the machine. `mission_id` is the id of a
    mission that this command may start.
    """
    problem = _too_long(asked)
    if problem:
        return Refusal(BAD_REQUEST, problem)
    event = event_name(asked.verb, chart)
    if event is None:
        known = (*OWN_VERBS, *chart.profile.verbs.values())
        return Refusal(UNKNOWN_VERB, f"unknown verb {shortened(asked.verb)!r}; {nearest(asked.verb, known)}")
    try:
        fields = _fields(asked.request)
        if asked.mission and event != START:
            raise ValueError("it is for whatever mission runs, so it names none")
        if event == START:
            mission = chart.missions.get(asked.mission)
            if mission is not None:  # the machine says what is wrong with the name
                _check_names(fields, mission.request)
            return Event(START, {**fields, "mission_type": asked.mission, "mission_id": mission_id})
        if event == ANSWER:
            return Event(ANSWER + _choice(fields, chart))
        _check_names(fields, ())
    except ValueError as wrong:
        return Refusal(BAD_REQUEST, f"{asked.verb} refused: {wrong}")
    return Event(event)


def event_name(verb: str, chart: Chart) -> str | None:
    """Return the event of a verb: a request, by its name or its verb; None for an unknown one."""
    verbs = chart.profile.verbs
    requests = {**{verb: name for name, verb in verbs.items()}, **{name: name for name in verbs}}
    own = {START_VERB: START, ANSWER_VERB: ANSWER}
    return own.get(verb) or (f"operator.{requests[verb]}" if verb in requests else None)


def _too_long(asked: CommandRequest) -> str:
    parts = {"verb": asked.verb, "mission": asked.mission, "command_id": asked.command_id, "by": asked.by}
    sizes = [("request", len(asked.request), MAX_REQUEST)]
    sizes += [(name, len(text), MAX_WORD) for name, text in parts.items()]
    long = [f"{name} has {size} letters, at most {most}" for name, size, most in sizes if size > most]
    return f"refused: too long: {', '.join(long)}" if long else ""


def _fields(text: str) -> dict[str, Any]:
    """Parse the JSON object of a command; an empty text is an empty object, any other a ValueError."""
    try:
        found = json.loads(
            text or "{}",
            parse_constant=_no_number,
            parse_float=_finite,
            object_pairs_hook=without_repetition,
        )
    except RecursionError:
        raise ValueError("its request is no JSON: it is nested too deep") from None
    except ValueError as problem:
        raise ValueError(f"its request is no JSON: {problem}") from None
    if not isinstance(found, dict):
        raise ValueError("its request must be a JSON object, such as {}")
    if not _LONE_SURROGATE.isdisjoint(json.dumps(found, ensure_ascii=False)):
        raise ValueError("its request has half of a character, which no message can carry")
    return found


def _finite(text: str) -> float:
    number = float(text)
    return number if math.isfinite(number) else _no_number(shortened(text))


def _no_number(text: str) -> Any:
    raise ValueError(f"{text} is no number of JSON")


def _check_names(fields: Mapping[str, Any], known: Iterable[str]) -> None:
    """Raise ValueError for unknown fields, with the nearest known ones."""
    names = list(known)
    unknown = [name for name in fields if name not in names]
    problems = [unknown_field(name, names) for name in unknown[:MAX_PROBLEMS]]
    if unknown:
        more = f" and {len(unknown) - MAX_PROBLEMS} more" if len(unknown) > MAX_PROBLEMS else ""
        raise ValueError("; ".join(problems) + more)


def _choice(fields: Mapping[str, Any], chart: Chart) -> str:
    _check_names(fields, [CHOICE])
    choice = fields.get(CHOICE)
    if not isinstance(choice, str) or not choice:
        raise ValueError(f'say what, as {{"{CHOICE}": NAME}}')
    return choice if f"{ANSWER}{choice}" in chart.answers else shortened(choice)


# -- answering --------------------------------------------------------------------------------------------


def refused(refusal: Refusal, step: int = 0) -> CommandAnswer:
    """Return the answer to a refused command."""
    return CommandAnswer(False, refusal.code, refusal.text, step=step)


def answered(asked: CommandRequest, step: Step) -> CommandAnswer:
    """Return the answer to a command, from the step that it caused."""
    if not step.accepted:
        return refused(step.refusal or Refusal("", f"{asked.verb} refused"), step.sequence)
    mission_id = str(step.event.data.get("mission_id", "")) if step.event.name == START else ""
    # A request has a name and a verb: the answer names the one that was used.
    word = step.event.name.removeprefix(ANSWER) if step.event.name.startswith(ANSWER) else asked.verb
    said = f"{asked.mission} {mission_id} started" if mission_id else f"{word} accepted"
    return CommandAnswer(True, "", said, mission_id, step.sequence)
