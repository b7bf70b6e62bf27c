"""Formats the state of an orchestrator, from its published records, as JSON data and as lines."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from itertools import takewhile
from typing import Any

from lupin_cli.terminal.words import clock, default_text
from lupin_engine.plugin import ANSWER, ANSWER_VERB, START_VERB
from lupin_engine.runtime import OpenQuestion, open_questions

#: How many of the codes that were reported last are shown.
SHOWN_CODES = 3


def look(
    steps: Iterable[Mapping[str, Any]],
    possible: Mapping[str, Any],
    offer: Mapping[str, Any],
    now: float,
) -> dict[str, Any]:
    """Return the state of the orchestrator as JSON data.

    Args:
        steps: its last records of steps, oldest first; at least one.
        possible: its record of available requests; empty where none was received.
        offer: its mission catalogue, with codes, holds and outcomes; empty where none was received.
        now: the time of its loop.
    """
    records = list(steps)
    view = records[-1]["view"]
    fields = ("lifecycle", "phase", "target", "mission", "mission_id", "total", "paused", "code", "detail")
    began = view["started_at"]
    missions = {one["mission"]: one.get("file") or one["mission"] for one in offer.get("missions", ())}
    stages = offer.get("stages", {})
    now_shown = list(takewhile(_is_of(view, stages.get("ready", ())), reversed(records)))
    codes = [code for record in reversed(now_shown) for code in record["step"].get("codes", ())]
    idle = any(view["lifecycle"] in states for stage, states in stages.items() if stage != "returning")
    requests = possible.get("requests", ())
    return {
        **{name: view[name] for name in fields},
        "seconds": None if began is None or idle else round(now - began, 1),
        "counts": {one["counter"]: view[one["counter"]] for one in offer.get("outcomes", ())},
        "holds": view.get("holds", dict.fromkeys(view["held"], "")),
        "asking": [_question(asked) for asked in open_questions(view, now)],
        "operations": [each["operation"] for each in view["attempts"]],
        "codes": codes[-SHOWN_CODES:],
        "requests": [
            {**request, "start": missions.get(request["mission"], request["mission"])} for request in requests
        ],
        "to_do": to_do(view, requests if idle else (), offer),
    }


def _is_of(view: Mapping[str, Any], ready: Collection[str]) -> Callable[[Mapping[str, Any]], bool]:
    """Return a predicate: whether a record is of the mission of a view, or of the time without one."""
    rests = view["lifecycle"] in ready

    def is_of(record: Mapping[str, Any]) -> bool:
        before = record["view"]
        return before["mission_id"] == view["mission_id"] and (before["lifecycle"] in ready) is rests

    return is_of


def to_do(
    view: Mapping[str, Any], requests: Iterable[Mapping[str, Any]], offer: Mapping[str, Any]
) -> list[str]:
    """Return advice about the holds, else about the last codes and refused starts."""
    holds, table = offer.get("holds", {}), offer.get("codes", {})
    held = [holds.get(name, "") for name in view["held"]]
    refused = [one["code"] for one in requests if one["verb"] == START_VERB]
    advised = (table.get(code, {}).get("advice", "") for code in held or (view["code"], *refused))
    return list(dict.fromkeys(filter(None, advised)))


def _question(asked: OpenQuestion) -> dict[str, Any]:
    choices = [{"name": name, "label": label} for name, label in asked.choices]
    return {"question": asked.question, "choices": choices, "default": default_text(asked)}


def lines(standing: Mapping[str, Any], verbs: Mapping[str, str]) -> Iterator[str]:
    """Yield the result of `look` as lines; `verbs` are those of the command line by request."""
    now = [standing["lifecycle"], standing["phase"]]
    target = f"target {standing['target']}" if standing["target"] else ""
    yield "  ".join(filter(None, (" ".join(filter(None, now)) or "no state", target)))
    for name, texts in _rows(standing, verbs):
        for row, text in enumerate(texts):
            yield f"  {'' if row else name:<10} {text}"


def _rows(standing: Mapping[str, Any], verbs: Mapping[str, str]) -> Iterator[tuple[str, list[str]]]:
    if standing["mission_id"]:
        since = "" if standing["seconds"] is None else f", for {clock(standing['seconds'])}"
        yield "mission", [f"{standing['mission']} {standing['mission_id']}{since}"]
        counts = ", ".join(f"{count} {name}" for name, count in standing["counts"].items() if count)
        total = standing["total"]
        yield "done", [f"{counts or 'none'} of {total} targets"] if total else []
    yield "doing", [", ".join(standing["operations"])] if standing["operations"] else []
    yield "paused", [label or name for name, label in standing["holds"].items()]
    for asked in standing["asking"]:
        answers = [f"lupin answer {choice['name']}: {choice['label']}" for choice in asked["choices"]]
        yield "asks", [asked["question"], *answers, asked["default"]]
    yield "last", [_code(code) for code in standing["codes"]] or [standing["code"]] * bool(standing["code"])
    yield "to do", standing["to_do"]
    possible: list[str] = []
    refused: dict[str, list[str]] = {}
    for request in standing["requests"]:
        if request["possible"]:
            possible.append(_command(request, verbs))
        elif request["verb"] != ANSWER_VERB:  # one that is not asked for says nothing
            refused.setdefault(request["reason"], []).append(_command(request, verbs))
    yield "possible", [", ".join(possible)] if possible else []
    yield "not now", [f"{', '.join(commands)}: {reason}" for reason, commands in refused.items()]


def _code(code: Mapping[str, Any]) -> str:
    detail = f": {code['detail']}" if code["detail"] else ""
    target = f", target {code['target']}" if code["target"] else ""
    return f"{code['label']} ({code['code']}{detail}){target}"


def _command(request: Mapping[str, Any], verbs: Mapping[str, str]) -> str:
    """Return the arguments of `lupin` that make a request."""
    if request["verb"] == START_VERB:
        return f"{START_VERB} {request['start']}"
    if request["verb"] == ANSWER_VERB:
        return f"{ANSWER_VERB} {request['request'].removeprefix(ANSWER)}"
    return verbs.get(request["verb"], str(request["verb"]))
